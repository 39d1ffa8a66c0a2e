//! A shell in which all programs of the house are on the PATH, in a copy of the examples.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Stdio};

use nullsweep_cell::{DESCRIBE, Described};
use tempfile::TempDir;

use crate::blocks::{Block, Mark};

/// Each program, and what it is here: the demo plays planner, executor and front too.
const DEMO: &str = env!("CARGO_BIN_EXE_demo");
const MOCK: &str = env!("CARGO_BIN_EXE_mock-hardware");
/// A loaded machine may stall a process for longer than a robot would bear.
const PATIENCE: &str = "--stale-ms 500 --lost-ms 1500 --min-rate 0.01 --spin-us 0";

/// Programs that are one command of the front, and that command.
const WHOLE: [(&str, &str, &str); 6] = [
    ("mock-hardware", "mock", MOCK),
    ("demo", "demo", DEMO),
    ("conformance", "conformance", env!("CARGO_BIN_EXE_conformance")),
    ("latency", "latency", env!("CARGO_BIN_EXE_latency")),
    ("kills", "kills", env!("CARGO_BIN_EXE_kills")),
    ("soak", "soak", env!("CARGO_BIN_EXE_soak")),
];

/// Commands of the front that start no program of a name of its own.
const OWN: [&str; 6] = ["endpoint", "doctor", "completions", "man", "help", "relay"];

/// A session.
pub(crate) struct Session {
    folder: TempDir,
}

impl Session {
    /// A folder of its own with the examples and the programs.
    pub(crate) fn new(root: &Path) -> Self {
        let folder = TempDir::with_prefix("nullsweep-commands-").expect("a folder");
        let (sample, copy) = (root.join("examples/sample"), folder.path().join("examples/sample"));
        copy_all(&sample, &copy);
        copy_all(&root.join("docs/tools"), &folder.path().join("docs/tools"));
        // Apart from whatever else runs on this machine.
        let cell = copy.join("cell.toml");
        let text = fs::read_to_string(&cell).expect("a cell");
        fs::write(&cell, format!("ipc_root = \"ipc\"\n{text}")).expect("written");
        let bin = folder.path().join("bin");
        fs::create_dir_all(&bin).expect("a folder");
        let script = |name: &str, text: &str| {
            let path = bin.join(name);
            fs::write(&path, format!("#!/bin/sh\n{text}\n")).expect("written");
            fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).expect("a script");
        };
        script("planner", &format!("exec {DEMO} __planner \"$@\""));
        let patient = format!("[ \"$1\" = run ] && set -- \"$@\" {PATIENCE}");
        script("executor", &format!("{patient}\nexec {DEMO} __executor \"$@\""));
        script("mock-hardware", &format!("exec {MOCK} --timeout 500 \"$@\""));
        // The front starts what lies beside it: the scripts.
        let front = bin.join("front");
        if fs::hard_link(DEMO, &front).is_err() {
            fs::copy(DEMO, &front).expect("copied");
        }
        script("nullsweep", &format!("exec {} __front \"$@\"", front.display()));
        Self { folder }
    }

    /// Runs blocks one after another, asserts that every command goes well, and gives what they said.
    pub(crate) fn run(&self, blocks: &[Block]) -> String {
        let mut text = String::from("set -eu\n");
        for block in blocks {
            let background = matches!(block.mark, Mark::Background(_));
            for command in block.commands() {
                text += &format!("echo '$ {command}'\n");
                text += &if background { format!("{command} &\n") } else { format!("{command}\n") };
            }
            if background {
                text += "for i in $(seq 300); do executor ctl status 2>/dev/null | grep -q hold && \
                         break; sleep 0.1; done\n";
            }
        }
        text += "kill $(jobs -p) 2>/dev/null || true\nwait\n";
        let at = self.folder.path();
        let said = at.join("said");
        let out = File::create(&said).expect("a file");
        let path = std::env::var("PATH").unwrap_or_default();
        let status = Command::new("bash")
            .args(["-c", &text])
            .current_dir(at)
            .env("PATH", format!("{}:{path}", at.join("bin").display()))
            .env_remove(nullsweep_cell::VARIABLE)
            .stdin(Stdio::null())
            .stderr(out.try_clone().expect("a file"))
            .stdout(out)
            .status()
            .expect("a shell");
        let said = fs::read_to_string(said).expect("output");
        assert!(status.success(), "{status}:\n{said}");
        said
    }
}

/// The program with its subcommands, and the flags that a command line gives it; `None` where it is no
/// program of the house.
pub(crate) fn call(command: &str) -> Option<(Vec<String>, Vec<String>)> {
    let words: Vec<&str> = command.split_whitespace().collect();
    let words = match words.iter().position(|word| *word == "--bin") {
        Some(bin) if words.first() == Some(&"cargo") => {
            let rest = words.iter().position(|word| *word == "--").map_or(words.len(), |i| i + 1);
            [&words[bin + 1..bin + 2], &words[rest..]].concat()
        }
        _ => words,
    };
    let (program, rest) = words.split_first()?;
    let whole = |name: &str| WHOLE.iter().find(|(program, ..)| *program == name).map(|w| w.0);
    let (program, rest) = match (*program, rest.split_first()) {
        ("nullsweep", Some((&command, behind))) => {
            match WHOLE.iter().find(|(_, name, _)| *name == command) {
                Some((program, ..)) => (*program, behind),
                None if OWN.contains(&command) => return None,
                None if ["run", "ctl", "top", "replay"].contains(&command) => ("executor", rest),
                None => ("planner", rest),
            }
        }
        ("planner" | "executor", _) => (*program, rest),
        _ => (whole(program)?, rest),
    };
    if whole(program).is_some() {
        return Some((vec![program.to_owned()], flags(rest)));
    }
    let is_name = |word: &&&str| {
        !word.starts_with('-') && word.chars().all(|c| c.is_ascii_lowercase() || c == '-')
    };
    let deep = if rest.first().is_some_and(|word| ["cell", "ctl", "experiment"].contains(word)) {
        2
    } else {
        1
    };
    let below = rest.iter().filter(is_name).take(deep).map(ToString::to_string);
    Some((std::iter::once(program.to_owned()).chain(below).collect(), flags(rest)))
}

/// The names of the flags among words.
fn flags(words: &[&str]) -> Vec<String> {
    let flags = words.iter().filter(|word| word.starts_with("--") && word.len() > 2);
    flags.map(|flag| flag.split('=').next().unwrap_or_default().to_owned()).collect()
}

/// The commands of a program.
pub(crate) fn commands(program: &str) -> Vec<String> {
    described(program).below().iter().map(|below| below.name().to_owned()).collect()
}

/// The flags that a program's command takes.
pub(crate) fn flags_of(words: &[String]) -> BTreeSet<String> {
    let (program, below) = words.split_first().expect("a program");
    let mut told = described(program);
    let own = |told: &Described| told.flags().map(|flag| format!("--{flag}")).collect::<Vec<_>>();
    let mut all: BTreeSet<String> = ["--help".into(), "--version".into()].into();
    all.extend(own(&told));
    for name in below {
        // What is no command is what the command works on.
        let Some(sub) = told.below().into_iter().find(|sub| sub.name() == name) else { break };
        all.extend(own(&sub));
        told = sub;
    }
    all
}

/// What a program tells of itself.
pub(crate) fn described(program: &str) -> Described {
    let mut command = match WHOLE.iter().find(|(name, ..)| *name == program) {
        Some((.., path)) => Command::new(path),
        None => Command::new(DEMO),
    };
    if WHOLE.iter().all(|(name, ..)| *name != program) {
        command.arg(format!("__{program}"));
    }
    let output = command.arg(DESCRIBE).env(nullsweep_cell::VARIABLE, "").output();
    let text = String::from_utf8(output.expect("it starts").stdout).expect("text");
    Described::from_json(&text).expect("a description")
}

/// What a program says of itself.
pub(crate) fn help(words: &[String]) -> String {
    let mut command = Command::new(DEMO);
    command.arg(format!("__{}", words[0])).args(&words[1..]).arg("--help");
    let output = command.env(nullsweep_cell::VARIABLE, "").output().expect("it starts");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Copies a folder with all that is in it.
fn copy_all(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("a folder");
    for entry in fs::read_dir(from).expect("a folder") {
        let entry = entry.expect("an entry");
        let (path, copy) = (entry.path(), to.join(entry.file_name()));
        if path.is_dir() {
            copy_all(&path, &copy);
        } else {
            fs::copy(path, copy).expect("copied");
        }
    }
}
