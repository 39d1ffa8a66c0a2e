//! The sources as an abstract tree, path to text, so that a rule can be tried on a small one.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::fs;
use std::path::Path;

/// Folders that hold no source.
const SKIPPED: [&str; 6] = ["target", ".git", ".venv", "venv", "__pycache__", "node_modules"];
/// Files whose text a rule reads; of all others only the path is kept.
const READ: [&str; 3] = ["rs", "toml", "md"];

/// All files below one folder, paths with `/` and relative to it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tree(BTreeMap<String, String>);

/// A line that breaks a rule.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Offence {
    pub(crate) file: String,
    pub(crate) line: usize,
    pub(crate) text: String,
}

impl Offence {
    pub(crate) fn new(file: &str, line: usize, text: impl Into<String>) -> Self {
        Self { file: file.to_owned(), line, text: text.into() }
    }
}

impl fmt::Display for Offence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}: {}", self.file, self.line, self.text)
    }
}

/// Fails with every offence and what to do about them.
#[track_caller]
pub(crate) fn expect_none(mut offences: Vec<Offence>, what_to_do: &str) {
    offences.sort();
    let lines: Vec<String> = offences.iter().map(ToString::to_string).collect();
    assert!(lines.is_empty(), "{} offences\n{}\n{what_to_do}\n", lines.len(), lines.join("\n"));
}

impl Tree {
    /// A tree out of paths and texts.
    pub(crate) fn of(files: &[(&str, &str)]) -> Self {
        Self(files.iter().map(|&(path, text)| (path.to_owned(), text.to_owned())).collect())
    }

    /// The files below `root` on the disk.
    pub(crate) fn load(root: &Path) -> Self {
        let mut tree = Self::default();
        tree.read_folder(root, "");
        tree
    }

    fn read_folder(&mut self, folder: &Path, prefix: &str) {
        let entries = fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
        for entry in entries {
            let entry = entry.unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
            let name = entry.file_name().to_string_lossy().into_owned();
            let path = format!("{prefix}{name}");
            if entry.path().is_dir() {
                if !SKIPPED.contains(&name.as_str()) {
                    self.read_folder(&entry.path(), &format!("{path}/"));
                }
                continue;
            }
            let read = READ.contains(&extension(&path));
            let text = read.then(|| fs::read_to_string(entry.path()).ok()).flatten();
            self.0.insert(path, text.unwrap_or_default());
        }
    }

    pub(crate) fn text(&self, path: &str) -> Option<&str> {
        self.0.get(path).map(String::as_str)
    }

    pub(crate) fn has_file(&self, path: &str) -> bool {
        self.0.contains_key(path)
    }

    /// Whether there is a file or a folder of that path.
    pub(crate) fn has(&self, path: &str) -> bool {
        let folder = format!("{path}/");
        path.is_empty()
            || self.has_file(path)
            || self.0.range(folder.clone()..).next().is_some_and(|(p, _)| p.starts_with(&folder))
    }

    pub(crate) fn paths(&self) -> impl Iterator<Item = &str> {
        self.0.keys().map(String::as_str)
    }

    /// Paths and texts of the files with this extension.
    pub(crate) fn with_extension(&self, wanted: &str) -> impl Iterator<Item = (&str, &str)> {
        self.0
            .iter()
            .filter(move |(path, _)| extension(path) == wanted)
            .map(|(path, text)| (path.as_str(), text.as_str()))
    }

    /// The folders of the first level.
    pub(crate) fn top_folders(&self) -> BTreeSet<&str> {
        self.paths().filter_map(|path| path.split_once('/')).map(|(folder, _)| folder).collect()
    }
}

/// The first few of a list, for a message.
pub(crate) fn some_of(mut items: impl Iterator<Item = String>) -> String {
    let mut told: Vec<String> = items.by_ref().take(4).collect();
    told.extend(items.next().map(|_| "…".to_owned()));
    told.join(", ")
}

/// What stands behind the last point of a file's name.
pub(crate) fn extension(path: &str) -> &str {
    let name = path.rsplit('/').next().unwrap_or(path);
    name.rsplit_once('.').map_or("", |(_, extension)| extension)
}

/// The folder of a file, without a slash at its end.
pub(crate) fn folder(path: &str) -> &str {
    path.rsplit_once('/').map_or("", |(folder, _)| folder)
}

/// A path relative to a folder as one relative to the root; `None` where it leaves the tree.
pub(crate) fn join(folder: &str, path: &str) -> Option<String> {
    let mut parts: Vec<&str> = folder.split('/').filter(|part| !part.is_empty()).collect();
    for part in path.split('/') {
        match part {
            "" | "." => {}
            ".." => {
                parts.pop()?;
            }
            part => parts.push(part),
        }
    }
    Some(parts.join("/"))
}

#[test]
fn paths_are_joined() {
    assert_eq!(join("docs", "../tests/src/mock.rs").as_deref(), Some("tests/src/mock.rs"));
    assert_eq!(join("", "./a/"), Some("a".to_owned()));
    assert_eq!(join("docs", "../../a"), None);
    let tree = Tree::of(&[("a/b.rs", ""), ("a-c/d.rs", "")]);
    assert!(tree.has("a") && tree.has("a/b.rs") && !tree.has("a/d.rs") && !tree.has("b"));
}
