//! The operator's stop, and the ends of everything that could hang, whatever is broken.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use nullsweep_ipc_types::ports::Ipc;
use nullsweep_ipc_types::{EventKind, Mode, Reason};
use tempfile::TempDir;

use crate::rig::{Executor, System, command, next, wait};

/// A command of the program under this root path, and how long it took.
fn ctl(root: &TempDir, order: &[&str]) -> (Output, Duration) {
    let start = Instant::now();
    let arguments = ["ctl", "--ipc-root", root.path().to_str().unwrap()];
    let output = command(&arguments, Stdio::piped()).args(order).output().unwrap();
    (output, start.elapsed())
}

fn said(output: &Output) -> String {
    let text = [&output.stdout[..], &output.stderr[..]].concat();
    String::from_utf8_lossy(&text).into_owned()
}

/// A system that executes a long plan, has `stop` done to it, and must hold after it. The plan's
/// end is seen by a listener that was there before.
fn stops(system: &System, stop: impl FnOnce()) {
    let events = system.ipc.event_receiver().unwrap();
    let mut publisher = system.ipc.plan_publisher(200).unwrap();
    let (header, knots) = system.line(system.home(), 0.4, 8.0);
    let id = publisher.publish(&header, &knots).unwrap();
    assert_eq!(next(&events, id).0, EventKind::Accepted);
    assert_eq!(next(&events, id).0, EventKind::Started);
    stop();
    assert_eq!(next(&events, id), (EventKind::Aborted, Reason::Stopped));
}

#[test]
fn signals_stop_the_arm_and_the_executor_goes_on() {
    for (signal, disabled) in [("-USR1", false), ("-USR2", true)] {
        let system = System::start();
        stops(&system, || {
            let pid = system.executor.0.id().to_string();
            assert!(Command::new("kill").args([signal, &pid]).status().unwrap().success());
        });
        system.wait_for(Mode::Hold);
        // Only motors that are off are switched on again.
        let (output, _) = ctl(&system.root, &["resume"]);
        assert_eq!(output.status.success(), disabled, "{}", said(&output));
        system.wait_for(Mode::Hold);
        let (seen, log) = system.end();
        assert!(seen.worst <= 1.0, "{seen:?}");
        assert!(log.iter().any(|line| line.contains("INFO stopped by a signal")), "{log:#?}");
    }
}

#[test]
fn a_stop_needs_no_place_among_the_clients() {
    let system = System::start();
    // Four clients that never go away.
    let hung: Vec<_> = (0..4).map(|_| system.client()).collect();
    stops(&system, || {
        let (output, took) = ctl(&system.root, &["stop"]);
        let text = said(&output);
        assert!(output.status.success(), "{text}");
        assert!(text.contains("as a signal") && text.contains("all places are taken"), "{text}");
        assert!(took < Duration::from_secs(8), "{took:?}");
    });
    // Only a stop has a way past them.
    let (output, _) = ctl(&system.root, &["pause"]);
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    drop(hung);
    system.wait_for(Mode::Hold);
    system.end();
}

#[test]
fn a_stop_by_number_reaches_an_executor_and_nobody_else() {
    let system = System::start();
    stops(&system, || {
        let pid = system.executor.0.id().to_string();
        let (output, _) = ctl(&system.root, &["stop", "--pid", &pid]);
        assert!(output.status.success(), "{}", said(&output));
    });
    system.wait_for(Mode::Hold);
    let mut other = Executor(Command::new("sleep").arg("60").spawn().unwrap());
    let (output, _) = ctl(&system.root, &["stop", "--pid", &other.0.id().to_string()]);
    assert_eq!(output.status.code(), Some(1));
    assert!(said(&output).contains("it is no executor"), "{}", said(&output));
    assert!(other.0.try_wait().unwrap().is_none(), "it lives");
    system.end();
}

#[test]
fn a_stop_needs_no_shared_memory() {
    let system = System::start();
    let root = system.root.path().to_str().unwrap();
    // A name space of its own, in which /dev/shm is small and full.
    let script = "mount -t tmpfs -o size=64k tmpfs /dev/shm && \
                  { dd if=/dev/zero of=/dev/shm/full bs=4k 2>/dev/null; exec \"$@\"; }";
    let full = |program: &[&str]| {
        let mut command = Command::new("unshare");
        command.args(["-m", "sh", "-c", script, "sh"]).args(program).output()
    };
    if !full(&["true"]).is_ok_and(|output| output.status.success()) {
        println!("skipped: this user may not mount a file system");
        system.end();
        return;
    }
    stops(&system, || {
        let program = env!("CARGO_BIN_EXE_executor");
        let output = full(&[program, "ctl", "--ipc-root", root, "stop"]).unwrap();
        let text = said(&output);
        assert!(output.status.success(), "{text}");
        assert!(
            text.contains("as a signal") && text.contains("/dev/shm has 0 bytes free"),
            "{text}"
        );
    });
    system.wait_for(Mode::Hold);
    system.end();
}

/// The node counter of a system.
fn counter(ipc: &Ipc) -> PathBuf {
    let all = fs::read_dir("/dev/shm").unwrap().filter_map(Result::ok);
    let mut own = all.filter(|entry| {
        let name = entry.file_name().to_string_lossy().into_owned();
        name.starts_with(ipc.prefix()) && name.ends_with(".global_mgmt")
    });
    own.next().expect("a counter").path()
}

/// A root path and its node counter, holding `content`.
fn damaged(content: &[u8]) -> (TempDir, PathBuf) {
    let root = TempDir::new().unwrap();
    let counter = counter(&Ipc::open("pr2", Some(root.path())).unwrap());
    fs::write(&counter, content).unwrap();
    (root, counter)
}

/// Files that a crash or another user left are told with their names, by whoever meets them, and
/// nobody waits for them without end.
#[test]
fn damaged_files_are_told_by_everybody_in_time() {
    for content in [&b""[..], &[0xab; 16]] {
        let (root, counter) = damaged(content);
        let here = root.path().to_str().unwrap();
        for arguments in [
            &["run", "--ipc-root", here][..],
            &["ctl", "--ipc-root", here, "status"],
            &["ctl", "--ipc-root", here, "stop"],
        ] {
            let start = Instant::now();
            let output = command(arguments, Stdio::piped()).output().unwrap();
            let text = said(&output);
            assert_eq!(output.status.code(), Some(1), "{text}");
            assert!(text.contains(&format!("{}, which belongs to", counter.display())), "{text}");
            assert!(text.contains("remove it and try again"), "{text}");
            assert!(start.elapsed() < Duration::from_secs(20), "{:?}", start.elapsed());
        }
        fs::remove_file(&counter).unwrap();
    }
}

/// Whoever typed `nullsweep` is told of commands of `nullsweep`, in errors and in help.
#[test]
fn behind_a_front_it_speaks_of_the_front() {
    let root = TempDir::new().unwrap();
    let here = root.path().to_str().unwrap();
    for (front, own, run) in [
        ("", "executor: no executor is running", "`executor run"),
        ("nullsweep", "nullsweep: no executor is running", "`nullsweep run"),
    ] {
        let mut ctl = command(&["ctl", "--ipc-root", here, "status"], Stdio::piped());
        let output = ctl.env(nullsweep_cell::FRONT, front).output().unwrap();
        let text = said(&output);
        assert!(text.contains(own) && text.contains(run), "{text}");
        // Which of several worlds it has looked into.
        assert!(text.contains(here) && text.contains("--ipc-root"), "{text}");
    }
}

/// SIGTERM ends one that is still starting at once.
#[test]
fn one_that_starts_can_be_ended() {
    let (root, counter) = damaged(b"");
    let here = root.path().to_str().unwrap();
    let mut starts =
        Executor(command(&["run", "--ipc-root", here], Stdio::null()).spawn().unwrap());
    thread::sleep(Duration::from_millis(500));
    assert!(starts.0.try_wait().unwrap().is_none(), "it waits for the file to get a length");
    let pid = starts.0.id().to_string();
    let asked = Instant::now();
    assert!(Command::new("kill").arg(pid).status().unwrap().success());
    assert_eq!(wait(&mut starts.0), Some(0), "as asked");
    // By itself it would give up two and a half seconds later.
    assert!(asked.elapsed() < Duration::from_millis(1500), "{:?}", asked.elapsed());
    fs::remove_file(&counter).unwrap();
}

/// What happened in a running system does not reach it: its counter is read at the start alone.
#[test]
fn a_running_system_does_not_mind_a_damaged_counter() {
    let system = System::start();
    let counter = counter(&system.ipc);
    stops(&system, || {
        fs::write(&counter, b"").unwrap();
        let (output, took) = ctl(&system.root, &["stop"]);
        let text = said(&output);
        assert!(output.status.success(), "{text}");
        assert!(text.contains("as a signal") && text.contains("remove it"), "{text}");
        assert!(took < Duration::from_secs(20), "{took:?}");
    });
    fs::remove_file(&counter).unwrap();
    system.wait_for(Mode::Hold);
    let (seen, _) = system.end();
    assert!(seen.worst <= 1.0, "{seen:?}");
}
