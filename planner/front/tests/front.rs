//! The front among programs that only tell how they were called.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::LazyLock;

use clap::Arg;
use nullsweep_cell::Described;
use tempfile::TempDir;

/// A folder with the front and all that it starts: each prints its name and arguments, and ends with 7.
/// Made before anything is started: a file that is being written cannot be run, also where a process
/// that was started meanwhile holds it open.
static PROGRAMS: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("front");
    fs::create_dir_all(&folder).expect("a folder");
    fs::copy(env!("CARGO_BIN_EXE_nullsweep"), folder.join("nullsweep")).expect("copied");
    let planner = clap::Command::new("planner").subcommand(
        clap::Command::new("plan").arg(Arg::new("hurry").long("hurry").help("Be quick.")),
    );
    let executor = clap::Command::new("executor").subcommand(clap::Command::new("run"));
    let others = ["mock-hardware", "demo", "conformance", "latency", "kills", "soak"];
    let others = others.map(|name| (name, clap::Command::new(name)));
    for (name, command) in [("planner", planner), ("executor", executor)].into_iter().chain(others)
    {
        let told = Described::of(&command).to_json();
        let text = format!(
            "#!/bin/sh\nif [ \"$1\" = __describe ]; then echo '{told}'; exit; fi\n\
             if [ \"$1\" = --version ]; then echo {name} 0.0.1; exit; fi\necho {name}: \"$@\"\n[ \"$NULLSWEEP_FRONT\" = nullsweep ] && exit 7\n"
        );
        let path = folder.join(name);
        fs::write(&path, text).expect("written");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).expect("a script");
    }
    folder
});

/// A folder to work in.
fn folder() -> TempDir {
    tempfile::tempdir().expect("a folder")
}

fn front(folder: &Path, args: &[&str]) -> (Option<i32>, String) {
    let program = PROGRAMS.join("nullsweep");
    let Output { status, stdout, stderr } = Command::new(program)
        .args(args)
        .current_dir(folder)
        .stdin(Stdio::null())
        .output()
        .expect("it starts");
    let said = [stdout, stderr].map(|text| String::from_utf8_lossy(&text).into_owned());
    (status.code(), said.concat())
}

#[test]
fn commands_go_to_their_programs_as_they_stand() {
    let folder = folder();
    for (args, said) in [
        (
            &["plan", "scan.ply", "--base", "-1,0,0", "--help"][..],
            "planner: plan scan.ply --base -1,0,0 --help",
        ),
        (&["goto", "-0.5,1"], "planner: goto -0.5,1"),
        (&["run", "--rate", "500"], "executor: run --rate 500"),
        (&["ctl", "status"], "executor: ctl status"),
        (&["mock", "--seconds", "1"], "mock-hardware: --seconds 1"),
        (&["demo"], "demo:"),
    ] {
        let (code, told) = front(folder.path(), args);
        assert_eq!((code, told.trim_end()), (Some(7), said));
    }
    // The cell before the command is as good as behind it.
    for (args, said) in [
        (&["--cell", "own.toml", "plan", "a.ply"][..], "planner: --cell own.toml plan a.ply"),
        (&["--cell=own.toml", "mock", "--wrap"], "mock-hardware: --cell own.toml --wrap"),
    ] {
        let (code, told) = front(folder.path(), args);
        assert_eq!((code, told.trim_end()), (Some(7), said));
    }
    let (code, told) = front(folder.path(), &["--cell", "own.toml", "doctor"]);
    assert_eq!(code, Some(1), "{told}");
    assert!(told.contains("--cell"), "{told}");
    let (code, told) = front(folder.path(), &["paln"]);
    assert_eq!(code, Some(2), "{told}");
    assert!(told.contains("plan"), "{told}");
}

#[test]
fn the_endpoint_is_the_cells() {
    let folder = folder();
    let (code, told) = front(folder.path(), &["endpoint"]);
    assert_eq!(code, Some(1), "{told}");
    assert!(told.contains("no cell.toml here or above"), "{told}");
    let cell = "endpoint = [\"mock-hardware\", \"--wrap\"]\n";
    fs::write(folder.path().join("cell.toml"), cell).expect("written");
    let (code, told) = front(folder.path(), &["endpoint", "--seconds", "1"]);
    assert_eq!((code, told.trim_end()), (Some(7), "mock-hardware: --wrap --seconds 1"));
    // Another cell's, from elsewhere: it runs in that cell's folder and knows that cell.
    let other = folder.path().join("other");
    fs::create_dir(&other).expect("a folder");
    fs::write(other.join("own.toml"), "endpoint = [\"./arm\", \"a.urdf\"]\n").expect("written");
    let script = "#!/bin/sh\necho \"$(basename $PWD) $(basename $NULLSWEEP_CELL): $@\"\n";
    fs::write(other.join("arm"), script).expect("written");
    fs::set_permissions(other.join("arm"), fs::Permissions::from_mode(0o755)).expect("a script");
    for args in [
        &["endpoint", "--cell=other/own.toml", "-x"][..],
        &["endpoint", "--cell", "other/own.toml", "-x"],
        &["--cell", "other/own.toml", "endpoint", "-x"],
    ] {
        let (code, told) = front(folder.path(), args);
        assert_eq!((code, told.trim_end()), (Some(0), "other own.toml: a.urdf -x"));
    }
}

#[test]
fn completions_and_manuals_know_the_flags_of_all_programs() {
    let folder = folder();
    for shell in ["bash", "zsh", "fish"] {
        let (code, told) = front(folder.path(), &["completions", shell]);
        assert_eq!(code, Some(0), "{told}");
        assert!(told.contains("hurry") && told.contains("doctor"), "{shell}");
    }
    let (code, told) = front(folder.path(), &["man", "pages"]);
    assert_eq!(code, Some(0), "{told}");
    let page = fs::read_to_string(folder.path().join("pages/nullsweep-plan.1")).expect("a page");
    assert!(page.contains("hurry") && page.contains("Be quick"), "{page}");
}

#[test]
fn the_doctor_tells_programs_of_another_version() {
    let folder = folder();
    let (code, told) = front(folder.path(), &["doctor"]);
    assert_eq!(code, Some(0), "{told}");
    assert!(told.contains("poor  programs") && told.contains("planner is planner 0.0.1"), "{told}");
    for name in ["kernel", "SCHED_FIFO", "locked memory", "shared memory", "iceoryx2"] {
        assert!(told.contains(name), "{told}");
    }
}
