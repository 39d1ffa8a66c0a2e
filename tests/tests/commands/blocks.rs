//! Blocks of shell commands in a document.

/// What is to be done with a block.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Mark {
    /// Nobody said.
    None,
    /// It is run in the session of this name.
    Run(String),
    /// The same, each command beside what follows.
    Background(String),
    /// It is not run, for a reason.
    Not,
}

/// A block.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    /// Where it begins.
    pub(crate) line: usize,
    pub(crate) mark: Mark,
    pub(crate) text: String,
}

impl Block {
    /// Its commands, comments left out.
    pub(crate) fn commands(&self) -> Vec<String> {
        let code = |line: &str| line.split(" #").next().unwrap_or_default().trim().to_owned();
        let lines = self.text.lines().map(code);
        lines.filter(|line| !line.is_empty() && !line.starts_with('#')).collect()
    }
}

/// The blocks of shell commands of a document.
pub(crate) fn blocks(text: &str) -> Vec<Block> {
    let mut all = Vec::new();
    let mut before = "";
    let mut lines = text.lines().enumerate();
    while let Some((i, line)) = lines.next() {
        if line.trim() == "```sh" {
            let body = lines.by_ref().map(|(_, l)| l).take_while(|l| l.trim() != "```");
            let text = body.collect::<Vec<_>>().join("\n");
            all.push(Block { line: i + 1, mark: mark(before), text });
        }
        before = line;
    }
    all
}

fn mark(line: &str) -> Mark {
    let said = line.trim().strip_prefix("<!--").and_then(|line| line.strip_suffix("-->"));
    match said.and_then(|said| said.split_once(':')) {
        Some((what, name)) if !name.trim().is_empty() => match what.trim() {
            "run" => Mark::Run(name.trim().into()),
            "run in the background" => Mark::Background(name.trim().into()),
            "not run" => Mark::Not,
            _ => Mark::None,
        },
        _ => Mark::None,
    }
}

#[test]
fn blocks_are_found_with_their_marks() {
    let text = "a\n<!-- run: x -->\n```sh\nplanner plan # all\n\n# only words\n```\n```sh\nb\n```\n\
        <!-- not run: -->\n```sh\nc\n```\n<!-- not run: long -->\n```sh\nd\n```\n```\ne\n```\n";
    let found = blocks(text);
    let marks: Vec<_> = found.iter().map(|b| b.mark.clone()).collect();
    assert_eq!(marks, [Mark::Run("x".into()), Mark::None, Mark::None, Mark::Not]);
    assert_eq!(found[0].commands(), ["planner plan"]);
    assert_eq!(found[0].line, 3);
}
