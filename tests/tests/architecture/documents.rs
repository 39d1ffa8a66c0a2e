//! What the documents name is there: paths, targets and subcommands.

use std::collections::BTreeMap;

use crate::markdown::{self, Piece, anchors, link_path, pieces};
use crate::packages::{Kind, Package, packages};
use crate::programs::Commands;
use crate::tree::{Offence, Tree, extension, folder, join};

/// The repository's pages, by which the book leads to what is no chapter.
const HOME: [&str; 2] = [
    "https://github.com/nullsweep/nullsweep/blob/main/",
    "https://github.com/nullsweep/nullsweep/tree/main/",
];

/// Chapters of the book that are not there, pages of its folder that are no chapters, and links out of
/// the book, which lead nowhere once it is built.
pub(crate) fn check_book(tree: &Tree, summary: &str) -> Vec<Offence> {
    let text = tree.with_extension("md").find(|(path, _)| *path == summary).map(|(_, text)| text);
    let Some(text) = text else { return vec![Offence::new(summary, 0, "there is no book")] };
    let links = pieces(text).into_iter().filter(|piece| piece.kind == markdown::Kind::Link);
    let chapters: Vec<String> =
        links.filter_map(|piece| join(folder(summary), &piece.text)).collect();
    let pages = tree.with_extension("md").map(|(path, _)| path);
    let pages = pages.filter(|path| folder(path) == folder(summary) && *path != summary);
    let told = |path| Offence::new(path, 0, format!("is no chapter of {summary}"));
    let mut offences: Vec<Offence> =
        pages.filter(|path| !chapters.iter().any(|one| one == path)).map(told).collect();
    let is_chapter = |page: &str| chapters.iter().any(|one| one == page);
    for (page, text) in tree.with_extension("md").filter(|(page, _)| is_chapter(page)) {
        for piece in pieces(text).iter().filter(|piece| piece.kind == markdown::Kind::Link) {
            let Some(path) = link_path(&piece.text).and_then(|path| join(folder(page), path))
            else {
                continue;
            };
            if !path.starts_with(folder(summary)) {
                let text = format!("{} leads out of the book: say {}{path}", piece.text, HOME[0]);
                offences.push(Offence::new(page, piece.line, text));
            }
        }
    }
    offences
}

/// Files with these extensions are of the repository, not of a user.
const SOURCES: [&str; 8] = ["rs", "toml", "md", "py", "sh", "urdf", "svg", "msg"];
/// No path has these, but placeholders, options and prose do.
const NO_PATH: [char; 19] = [
    '*', '<', '>', '{', '}', '(', ')', '[', ']', '$', '|', '…', '=', ',', ':', '~', '@', '\\', '"',
];

/// What the documents may name.
struct Known<'a> {
    tree: &'a Tree,
    packages: Vec<Package>,
    programs: BTreeMap<&'a str, Commands>,
}

/// Everything that a document names and that is not there.
pub(crate) fn check(tree: &Tree, programs: &[&str]) -> Vec<Offence> {
    let packages = packages(tree);
    let mut offences = Vec::new();
    let mut known = Known { tree, packages, programs: BTreeMap::new() };
    for &program in programs {
        match Commands::of(tree, &known.packages, program) {
            Some(commands) => {
                known.programs.insert(program, commands);
            }
            None => offences.push(Offence::new("", 0, format!("there is no program {program}"))),
        }
    }
    for (document, text) in tree.with_extension("md") {
        for piece in pieces(text) {
            for missing in known.missing(document, &piece) {
                let text = format!("{missing} (in “{}”)", piece.text);
                offences.push(Offence::new(document, piece.line, text));
            }
        }
    }
    offences
}

impl Known<'_> {
    fn missing(&self, document: &str, piece: &Piece) -> Vec<String> {
        if piece.kind == markdown::Kind::Link {
            return self.missing_in_link(document, &piece.text).into_iter().collect();
        }
        let text = piece.text.split(" #").next().unwrap_or_default().replace(';', " ; ");
        let words: Vec<&str> = text.split_whitespace().collect();
        let mut missing = Vec::new();
        for word in &words {
            let word = word.trim_matches([',', '\'']);
            if !self.may_be_named(document, word, words.len() == 1) {
                missing.push(format!("no {word}"));
            }
        }
        for command in words.split(|word| ["&&", "||", "|", ";", "&"].contains(word)) {
            missing.extend(self.missing_in_command(command));
        }
        missing
    }

    /// A file that is not there, or a heading that it does not have.
    fn missing_in_link(&self, document: &str, target: &str) -> Option<String> {
        let (path, anchor) = target.split_once('#').unwrap_or((target, ""));
        let leads = match link_path(target) {
            None if HOME.iter().any(|home| path.starts_with(home)) => HOME
                .iter()
                .find_map(|home| path.strip_prefix(home))
                .map(|path| path.trim_end_matches('/').to_owned())
                .filter(|path| self.tree.has(path)),
            Some(path) => join(folder(document), path).filter(|path| self.tree.has(path)),
            None if path.is_empty() => Some(document.to_owned()),
            None => return None,
        };
        let Some(leads) = leads else { return Some(format!("no {path}")) };
        if anchor.is_empty() || extension(&leads) != "md" {
            return None;
        }
        let mut texts = self.tree.with_extension("md").filter(|(path, _)| *path == leads);
        let there = texts.any(|(_, text)| anchors(text).iter().any(|one| one == anchor));
        (!there).then(|| format!("no #{anchor}"))
    }

    /// Whether this is no path of ours, or one that exists. `alone`: nothing else stands between
    /// the backticks; then it may also be the end of a path.
    fn may_be_named(&self, document: &str, word: &str, alone: bool) -> bool {
        let Some((first, _)) = word.split_once('/') else { return true };
        if first.is_empty() || word.contains(NO_PATH) || word.contains("//") {
            return true;
        }
        let ours = self.tree.top_folders().contains(first);
        let source = alone && SOURCES.contains(&extension(word));
        if !ours && !source {
            return true;
        }
        let candidates = [join("", word), join(folder(document), word)];
        let end = format!("/{word}");
        candidates.into_iter().flatten().any(|path| self.tree.has(&path))
            || (!ours && self.tree.paths().any(|path| path.ends_with(&end)))
    }

    fn missing_in_command(&self, words: &[&str]) -> Vec<String> {
        // What the shell sets for the command stands before it.
        let set = words.iter().take_while(|word| word.contains('=') || **word == "$").count();
        let words = &words[set..];
        let Some(&program) = words.first() else { return Vec::new() };
        if program == "cargo" {
            return self.missing_in_cargo(&words[1..]);
        }
        let name = program.rsplit('/').next().unwrap_or(program);
        self.missing_in_program(name, &words[1..]).into_iter().collect()
    }

    fn missing_in_program(&self, program: &str, words: &[&str]) -> Option<String> {
        let unknown = self.programs.get(program)?.unknown(words)?;
        Some(format!("{program} has no {unknown}"))
    }

    fn missing_in_cargo(&self, words: &[&str]) -> Vec<String> {
        let end = words.iter().position(|word| *word == "--").unwrap_or(words.len());
        let (words, rest) = (&words[..end], words.get(end + 1..).unwrap_or_default());
        let after = |options: [&str; 2]| -> Vec<&str> {
            let pairs = words.windows(2).filter(|pair| options.contains(&pair[0]));
            pairs.map(|pair| pair[1]).filter(|name| !name.contains(NO_PATH)).collect()
        };
        let mut missing = Vec::new();
        let named = after(["-p", "--package"]);
        for name in &named {
            if self.packages.iter().all(|package| package.name != *name) {
                missing.push(format!("no package {name}"));
            }
        }
        for kind in Kind::ALL {
            let option = format!("--{}", kind.key());
            for name in after([&option, &option]) {
                let mut packages =
                    self.packages.iter().filter(|p| named.is_empty() || named.contains(&&*p.name));
                if !packages.any(|p| p.targets(self.tree, kind).iter().any(|(n, _)| n == name)) {
                    missing.push(format!("no {} {name}", kind.key()));
                }
                if kind == Kind::Bin {
                    missing.extend(self.missing_in_program(name, rest));
                }
            }
        }
        missing
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(document: &str) -> Vec<String> {
        let manifest = "[package]\nname = \"x-lib\"\n\
            [[bin]]\nname = \"x\"\npath = \"src/main.rs\"\n";
        let main = "#[derive(Parser)] struct Cli { #[command(subcommand)] c: Command }\n\
            #[derive(Subcommand)] enum Command { Plan, Publish }";
        let tree = Tree::of(&[
            ("x/Cargo.toml", manifest),
            ("x/src/main.rs", main),
            ("x/src/deep/a.rs", ""),
            ("x/tests/t.rs", ""),
            ("x/benches/b.rs", ""),
            ("docs/d.md", document),
        ]);
        let offences = check(&tree, &["x"]);
        offences
            .iter()
            .map(|offence| offence.text.split(" (in").next().unwrap_or_default().to_owned())
            .collect()
    }

    #[test]
    fn what_exists_may_be_named() {
        let document = "[a](../x/src/deep/a.rs#L1), [b](https://c/d.rs), `x/src/`, `deep/a.rs`,\n\
            `/etc/x.toml`, `and/or`, `x plan scan.pcd`, `x plan\\|publish`, `x SUBCOMMAND`,\n\
            `x/<name>/a.rs`, `package://x/a.rs`, `my/scan.pcd`, `x::y/z`\n\
            ```sh\nA=1 cargo run -p x-lib --bin x -- publish x.json && x plan # x paln\n\
            cargo test --test t; cargo bench --bench b -- --test\n```\n\
            ```\nx paln x/gone.rs\n```\n";
        assert_eq!(told(document), [""; 0]);
    }

    #[test]
    fn a_link_leads_to_a_heading_that_is_there() {
        let document = "# The one, and more\n[a](#the-one-and-more), [b](d.md#the-one-and-more),\n\
            [c](../x/src/deep/a.rs#L1)\n[d](#gone), [e](d.md#the-one)\n";
        assert_eq!(told(document), ["no #gone", "no #the-one"]);
        let home = "https://github.com/nullsweep/nullsweep";
        let document = format!(
            "[a]({home}/tree/main/x/src/), [b]({home}/blob/main/x/src/gone.rs), [c]({home})"
        );
        assert_eq!(told(&document), [format!("no {home}/blob/main/x/src/gone.rs")]);
    }

    #[test]
    fn a_page_that_is_no_chapter_is_told() {
        let book = "# Summary\n- [a](a.md)\n";
        let tree =
            Tree::of(&[("d/SUMMARY.md", book), ("d/a.md", ""), ("d/b.md", ""), ("x.md", "")]);
        let told = check_book(&tree, "d/SUMMARY.md");
        assert_eq!(told, [Offence::new("d/b.md", 0, "is no chapter of d/SUMMARY.md")]);
        assert_eq!(check_book(&tree, "e/SUMMARY.md").len(), 1);
        let page =
            "[a](a.md#x), [b](../x.md), [c](https://github.com/nullsweep/nullsweep/blob/main/x.md)";
        let tree = Tree::of(&[("d/SUMMARY.md", book), ("d/a.md", page), ("x.md", "")]);
        let told = check_book(&tree, "d/SUMMARY.md");
        assert!(
            matches!(&told[..], [one] if one.text.starts_with("../x.md leads out")),
            "{told:?}"
        );
    }

    #[test]
    fn what_does_not_exist_is_told() {
        assert_eq!(told("[a](x/src/main.rs)"), ["no x/src/main.rs"]);
        assert_eq!(told("`x/src/gone.rs` `shallow/a.rs`"), ["no x/src/gone.rs", "no shallow/a.rs"]);
        assert_eq!(told("`x paln --y`, `x plan\\|send`"), ["x has no paln", "x has no send"]);
        let cargo = "```sh\ncargo run --release --bin y\ncargo test -p x --test u\n\
            cargo run --bin x -- paln\ncargo bench --bench b --bench c\nx plan x/y.toml\n```";
        let expected =
            ["no bin y", "no package x", "no test u", "x has no paln", "no bench c", "no x/y.toml"];
        assert_eq!(told(cargo), expected);
    }
}
