//! What a document says in links, in backticks and in its shell blocks.

/// A piece of a document, with its line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Piece {
    pub(crate) line: usize,
    pub(crate) text: String,
    pub(crate) kind: Kind,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Where a link leads.
    Link,
    /// Between backticks.
    Code,
    /// A line of a block that a shell is to run.
    Shell,
}

/// What the info string of a block says where a shell is to run it.
const SHELLS: [&str; 5] = ["sh", "bash", "shell", "console", "zsh"];

/// All links, pieces in backticks and shell lines.
pub(crate) fn pieces(document: &str) -> Vec<Piece> {
    let mut found = Vec::new();
    let mut block: Option<bool> = None;
    let mut continued: Option<(usize, String)> = None;
    for (line, number) in document.lines().zip(1..) {
        if let Some(info) = line.trim_start().strip_prefix("```") {
            block = match block {
                None => Some(SHELLS.contains(&info.trim())),
                Some(_) => None,
            };
            continue;
        }
        match block {
            Some(false) => {}
            Some(true) => {
                let (first, text) = continued.take().unwrap_or((number, String::new()));
                let text = text + line.trim();
                match text.strip_suffix('\\') {
                    Some(part) => continued = Some((first, part.to_owned())),
                    None => found.push(Piece { line: first, text, kind: Kind::Shell }),
                }
            }
            None => {
                let mut add = |text: &str, kind| {
                    found.push(Piece { line: number, text: text.replace("\\|", "|"), kind });
                };
                links(line).for_each(|link| add(link, Kind::Link));
                // Split at backticks, every second part is between two.
                let parts: Vec<&str> = line.split('`').collect();
                let closed = parts.len() - usize::from(parts.len().is_multiple_of(2));
                parts[..closed].iter().skip(1).step_by(2).for_each(|part| add(part, Kind::Code));
            }
        }
    }
    found
}

/// Targets of `[text](target)` and of `[name]: target`.
fn links(line: &str) -> impl Iterator<Item = &str> {
    let inline = line.split("](").skip(1).filter_map(|rest| rest.split([')', ' ']).next());
    let named = line.strip_prefix('[').and_then(|rest| rest.split_once("]: "));
    inline.chain(named.map(|(_, target)| target.trim()))
}

/// The anchors of a document's headings, as they are made of their words.
pub(crate) fn anchors(document: &str) -> Vec<String> {
    let mut inside = false;
    let mut found: Vec<String> = Vec::new();
    for line in document.lines() {
        inside ^= line.trim_start().starts_with("```");
        let title = line.trim_start_matches('#');
        let depth = line.len() - title.len();
        if inside || !(1..=6).contains(&depth) || !title.starts_with(' ') {
            continue;
        }
        let kept = |c: &char| c.is_alphanumeric() || ['-', '_', ' '].contains(c);
        let slug: String = title.trim().to_lowercase().chars().filter(kept).collect();
        let slug = slug.replace(' ', "-");
        let same = found.iter().filter(|one| **one == slug).count();
        found.push(if same > 0 { format!("{slug}-{same}") } else { slug });
    }
    found
}

/// Where a link leads, without its anchor; `None` for what is no file of ours.
pub(crate) fn link_path(target: &str) -> Option<&str> {
    let path = target.split('#').next().unwrap_or(target);
    let elsewhere = path.is_empty() || path.contains(':') || path.starts_with('/');
    (!elsewhere).then_some(path)
}

#[test]
fn anchors_are_made_of_headings() {
    let document = "# Words, `widths` (two)\n```sh\n# no heading\n```\n## A-b_c\n## A-b_c\n#no\n";
    assert_eq!(anchors(document), ["words-widths-two", "a-b_c", "a-b_c-1"]);
}

#[test]
fn pieces_are_found() {
    let document = "A [`b`](c.md#d) and `e \\| f`\n```sh\ncargo \\\n  run # g\n```\n\
                    ```\n`no` [no](no)\n```\n[x]: https://y\n";
    let found: Vec<(usize, String, Kind)> =
        pieces(document).into_iter().map(|p| (p.line, p.text, p.kind)).collect();
    let expected = [
        (1, "c.md#d", Kind::Link),
        (1, "b", Kind::Code),
        (1, "e | f", Kind::Code),
        (3, "cargo run # g", Kind::Shell),
        (9, "https://y", Kind::Link),
    ];
    assert_eq!(found, expected.map(|(line, text, kind)| (line, text.to_owned(), kind)));
    assert_eq!(link_path("c.md#d"), Some("c.md"));
    assert_eq!((link_path("#d"), link_path("https://y/z")), (None, None));
}
