//! What the command line says of itself: help without remnants of documentation markup, and advice
//! after an error that a flag mends.

use std::process::{Command, Output};

fn planner(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_planner")).args(args).output().expect("the planner starts")
}

fn help(args: &[&str]) -> String {
    let output = planner(&[args, &["--help"]].concat());
    assert!(output.status.success(), "{args:?}");
    String::from_utf8(output.stdout).expect("help is text")
}

/// The subcommands that the top-level help lists.
fn subcommands(help: &str) -> Vec<String> {
    let (_, list) = help.split_once("Commands:\n").expect("a list of commands");
    list.lines()
        .take_while(|line| !line.is_empty())
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next().map(str::to_owned))
        .filter(|name| name != "help")
        .collect()
}

#[test]
fn no_help_shows_documentation_markup() {
    let top = help(&[]);
    let commands = subcommands(&top);
    assert!(commands.len() >= 8 && commands.iter().any(|c| c == "plan"), "{commands:?}");
    let mut pages = vec![("planner".to_owned(), top)];
    for command in commands {
        let page = help(&[&command]);
        pages.push((command, page));
    }
    for (name, page) in pages {
        for remnant in ["\\[", "\\]", "[`", "`]", "](", "::"] {
            assert!(!page.contains(remnant), "{name}: {remnant} in\n{page}");
        }
    }
}

#[test]
fn an_error_that_a_flag_mends_comes_with_advice() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("line.xyz");
    let rows: String = (0..500).map(|i| format!("{} 0 0\n", 0.001 * f64::from(i))).collect();
    std::fs::write(&path, rows).expect("a file");
    let path = path.to_str().expect("a path in text");
    let cases = [
        (vec!["plan", path], "0 of 500 points are left", "--scale"),
        (vec!["plan", path, "--crop=5,5,5,6,6,6"], "holds none of 500 points", "--crop"),
    ];
    for (args, cause, flag) in cases {
        let output = planner(&args);
        let text = String::from_utf8(output.stderr).expect("text");
        assert_eq!(output.status.code(), Some(1), "{text}");
        let error = text.lines().find(|line| line.starts_with("planner: ")).expect("an error");
        assert!(error.contains(cause) && !error.contains("--"), "{error}");
        let advice = text.lines().find(|line| line.starts_with("help: ")).expect("advice");
        assert!(advice.contains(flag), "{advice}");
    }
}

#[test]
fn an_error_that_no_flag_mends_comes_without() {
    let output = planner(&["inspect", "/nowhere/plan.json"]);
    let text = String::from_utf8(output.stderr).expect("text");
    assert!(text.starts_with("planner: /nowhere/plan.json") && !text.contains("help:"), "{text}");
}
