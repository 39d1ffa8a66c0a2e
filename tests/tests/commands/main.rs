//! Every command of the documents: what is marked to be run is run as it stands, in a copy of the
//! examples' folder, and every flag that a document names is one that the program takes.
//!
//! A block of shell commands has a mark in the line before it: `<!-- run: NAME -->` (blocks of one name
//! are one session), `<!-- run in the background: NAME -->`, or `<!-- not run: REASON -->`.

mod blocks;
mod keys;
mod reference;
mod session;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use blocks::{Block, Mark, blocks};
use session::Session;

/// The documents of users; those of the house speak of cargo alone.
fn documents() -> Vec<PathBuf> {
    let root = root();
    let docs = fs::read_dir(root.join("docs")).expect("a folder of documents");
    let pages = docs.map(|entry| entry.expect("an entry").path());
    let mut all: Vec<PathBuf> =
        pages.filter(|p| p.extension().is_some_and(|e| e == "md")).collect();
    all.push(root.join("README.md"));
    all.sort();
    all
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize().expect("the repository")
}

fn all() -> Vec<(PathBuf, Block)> {
    let read = |path: PathBuf| {
        let text = fs::read_to_string(&path).expect("a document");
        blocks(&text).into_iter().map(move |block| (path.clone(), block))
    };
    documents().into_iter().flat_map(read).collect()
}

#[test]
fn every_block_of_commands_is_run_or_says_why_not() {
    let all = all();
    assert!(all.len() > 5, "{} blocks", all.len());
    for (path, block) in &all {
        assert!(block.mark != Mark::None, "{}:{} has no mark", path.display(), block.line);
    }
}

#[test]
fn every_flag_that_a_document_names_is_taken() {
    let mut known: BTreeMap<Vec<String>, BTreeSet<String>> = BTreeMap::new();
    let mut checked = 0;
    for (path, block) in all() {
        for command in block.commands() {
            let Some((words, flags)) = session::call(&command) else { continue };
            let known = known.entry(words.clone()).or_insert_with(|| session::flags_of(&words));
            for flag in flags {
                let place = format!("{}:{}: {command}", path.display(), block.line);
                assert!(known.contains(&flag), "{place}: no {flag} among {known:?}");
                checked += 1;
            }
        }
    }
    assert!(checked > 20, "{checked} flags");
}

#[test]
fn the_front_knows_every_command_of_planner_and_executor() {
    let front = fs::read_to_string(root().join("planner/front/src/lib.rs")).expect("a source");
    for (program, name) in [("planner", "PLANNER"), ("executor", "EXECUTOR")] {
        let commands = session::commands(program);
        assert!(commands.len() > 3, "{commands:?}");
        for command in commands {
            let start = format!("start({name}, Some(\"{command}\"), rest.args)");
            assert!(front.contains(&start), "nullsweep has no {command}");
        }
    }
}

#[test]
fn the_commands_run_as_they_are_written() {
    let mut sessions: BTreeMap<(PathBuf, String), Vec<Block>> = BTreeMap::new();
    for (path, block) in all() {
        if let Mark::Run(name) | Mark::Background(name) = &block.mark {
            sessions.entry((path, name.clone())).or_default().push(block);
        }
    }
    assert!(!sessions.is_empty());
    // Each beside the others, in a folder of its own: one of them waits for an arm most of the time.
    std::thread::scope(|scope| {
        for ((path, name), blocks) in &sessions {
            scope.spawn(move || {
                let said = Session::new(&root()).run(blocks);
                println!("{}: {name}\n{said}", path.display());
            });
        }
    });
}
