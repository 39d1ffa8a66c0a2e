//! The reference, made of what the programs say of themselves and of the structs that their files are
//! read into: `NULLSWEEP_WRITE_REFERENCE=1 cargo test -p nullsweep-tests --test commands` writes it.

use std::fmt::Write as _;
use std::fs;
use std::process::Command;

use nullsweep_cell::Described;

use crate::keys::tables;
use crate::{root, session};

/// Where it is.
const PAGE: &str = "docs/reference.md";
/// Programs without commands.
const PLAIN: [(&str, &str); 6] = [
    ("mock-hardware", env!("CARGO_BIN_EXE_mock-hardware")),
    ("conformance", env!("CARGO_BIN_EXE_conformance")),
    ("demo", env!("CARGO_BIN_EXE_demo")),
    ("latency", env!("CARGO_BIN_EXE_latency")),
    ("kills", env!("CARGO_BIN_EXE_kills")),
    ("soak", env!("CARGO_BIN_EXE_soak")),
];

fn reference() -> String {
    let mut text = String::from(
        "# Reference\n\nWhat the files may hold and what the programs take, as they say it themselves. \
         This page is made by a test: change the sources, then run\n\n\
         <!-- not run: it is what makes this page -->\n```sh\n\
         NULLSWEEP_WRITE_REFERENCE=1 cargo test -p nullsweep-tests --test commands\n```\n\n\
         ## Cell file\n\n`cell.toml`, in the working folder or above, or named by `--cell`. Every key \
         may be left out; what is given on the command line wins. Paths are from the file's folder on.\n\n",
    );
    let read = |path: &str| fs::read_to_string(root().join(path)).expect("a source");
    let cell = [
        ("Cell", "On top"),
        ("Limits", "Table `[limits]`"),
        ("Scene", "Table `[scene]`"),
        ("Executor", "Table `[executor]`"),
    ];
    text += &tables(&read("robot/cell/src/file.rs"), &cell);
    text += "## Tool file\n\nWhat is at the tip of the arm. Every shape has its keys, and no others: see \
             [`flange-sponge`](tools/flange-sponge.toml), [`finger-pad`](tools/finger-pad.toml), \
             [`roller`](tools/roller.toml), [`spray-nozzle`](tools/spray-nozzle.toml) and \
             [`inspection-camera`](tools/inspection-camera.toml).\n\n";
    text += &tables(&read("robot/src/tool/file.rs"), &[("ToolFile", "Keys")]);
    for program in ["planner", "executor"] {
        for command in session::described(program).below() {
            put(&mut text, &[program.to_owned()], command);
        }
    }
    for (name, path) in PLAIN {
        let said = Command::new(path).arg("--help").env(nullsweep_cell::VARIABLE, "").output();
        let said = String::from_utf8(said.expect("it starts").stdout).expect("text");
        block(&mut text, name, &said);
    }
    text
}

/// A command and all below it.
fn put(text: &mut String, above: &[String], command: Described) {
    let words = [above, &[command.name().to_owned()]].concat();
    block(text, &words.join(" "), &session::help(&words));
    for below in command.below() {
        put(text, &words, below);
    }
}

fn block(text: &mut String, name: &str, said: &str) {
    let said: Vec<&str> = said.lines().map(str::trim_end).collect();
    let said = said.join("\n");
    let _ = write!(text, "## {name}\n\n```text\n{}\n```\n\n", said.trim_end());
}

#[test]
fn the_reference_is_what_the_programs_say() {
    let page = root().join(PAGE);
    let made = format!("{}\n", reference().trim_end());
    if std::env::var_os("NULLSWEEP_WRITE_REFERENCE").is_some() {
        fs::write(&page, &made).expect("written");
    }
    let found = fs::read_to_string(&page).unwrap_or_default();
    let line = found.lines().zip(made.lines()).position(|(a, b)| a != b);
    assert!(found == made, "{PAGE} is not what the programs say, line {line:?}: write it anew");
}

#[test]
fn no_line_of_help_is_wider_than_80_columns() {
    for line in reference().lines().skip_while(|line| !line.starts_with("```text")) {
        let wide = line.chars().count();
        assert!(wide <= 80, "{wide} columns: {line}");
    }
}
