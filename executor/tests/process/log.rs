//! What the program logs, and that nothing depends on anybody reading it.

use std::fs::File;
use std::io::Write as _;
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use nullsweep_ipc_types::{CommandKind, EventKind, Mode, Reason, Verdict};
use tempfile::TempDir;

use crate::rig::{Executor, PATIENT, System, command, newest, next, wait};

/// Standard error that cannot be written to.
#[derive(Clone, Copy, Debug)]
enum Broken {
    /// A pipe that nobody reads, full already.
    Full,
    /// A pipe whose reader is gone.
    Gone,
    /// A file on a full disk.
    Disk,
}

/// Where it goes, and what must be kept open meanwhile.
fn broken(how: Broken) -> (Stdio, Option<std::io::PipeReader>) {
    if matches!(how, Broken::Disk) {
        let full = File::options().write(true).open("/dev/full").expect("Linux has it");
        return (full.into(), None);
    }
    let (reader, writer) = std::io::pipe().expect("a pipe");
    if matches!(how, Broken::Gone) {
        return (writer.into(), None);
    }
    let filler = writer.try_clone().expect("the same pipe");
    let fills = thread::spawn(move || {
        let mut filler = filler;
        // Ends with the reader, long after the pipe is full.
        while filler.write_all(&[b'.'; 4096]).is_ok() {}
    });
    thread::sleep(Duration::from_millis(200));
    assert!(!fills.is_finished(), "it is full");
    (writer.into(), Some(reader))
}

/// Plans are admitted and rejected, commands answered, and SIGTERM ends it, whatever becomes of
/// what it says. Each of these writes lines.
fn runs_without_a_log(how: Broken) {
    let (stderr, _reader) = broken(how);
    let system = System::start_to(&["--spin-us", "0"], Some(stderr));
    let events = system.ipc.event_receiver().unwrap();
    let telemetry = system.ipc.telemetry_receiver().unwrap();
    let client = system.client();
    let mut publisher = system.ipc.plan_publisher(200).unwrap();
    let home = system.home();
    let mut away = home;
    away[0] += 0.3;
    let (header, elsewhere) = system.line(away, 0.1, 0.5);
    for _ in 0..20 {
        let id = publisher.publish(&header, &elsewhere).unwrap();
        assert_eq!(next(&events, id), (EventKind::Rejected, Reason::Start), "{how:?}");
    }
    let (header, knots) = system.line(home, 0.4, 8.0);
    let id = publisher.publish(&header, &knots).unwrap();
    assert_eq!(next(&events, id).0, EventKind::Accepted, "{how:?}");
    assert_eq!(next(&events, id).0, EventKind::Started, "{how:?}");
    let verdict = client.call(CommandKind::Stop, 0.0, Duration::from_secs(2)).unwrap().verdict;
    assert_eq!(Verdict::from_wire(verdict), Some(Verdict::Accepted), "{how:?}");
    assert_eq!(next(&events, id), (EventKind::Aborted, Reason::Stopped), "{how:?}");
    system.wait_for(Mode::Hold);
    // Who watches the executor sees that its log has holes; a pipe still has room in the buffer.
    let lost = newest(&telemetry).lost_lines;
    assert_eq!(lost > 0, !matches!(how, Broken::Full), "{how:?}: {lost}");
    let asked = Instant::now();
    system.terminate();
    let (seen, _) = system.finish();
    assert!(asked.elapsed() < Duration::from_secs(10), "{how:?}: {:?}", asked.elapsed());
    assert!(seen.worst <= 1.0 && seen.disabled, "{how:?}: {seen:?}");
}

#[test]
fn a_pipe_that_nobody_reads_stops_nothing() {
    runs_without_a_log(Broken::Full);
}

#[test]
fn a_reader_that_is_gone_stops_nothing() {
    runs_without_a_log(Broken::Gone);
}

#[test]
fn a_full_disk_stops_nothing() {
    runs_without_a_log(Broken::Disk);
}

/// Also the last words of one that fails, and an operator's command.
#[test]
fn what_cannot_be_written_does_not_change_the_exit_code() {
    for how in [Broken::Full, Broken::Gone, Broken::Disk] {
        let (stderr, _reader) = broken(how);
        let mut fails = Executor(command(&["run", "--arm", "none:there"], stderr).spawn().unwrap());
        assert_eq!(wait(&mut fails.0), Some(1), "{how:?}");
    }
    let system = System::start();
    let root = system.root.path().to_str().unwrap();
    let full = File::options().write(true).open("/dev/full").unwrap();
    let mut ctl = command(&["ctl", "--ipc-root", root, "stop"], Stdio::null());
    assert_eq!(wait(&mut ctl.stdout(full).spawn().unwrap()), Some(0));
    system.end();
}

#[test]
fn what_an_operator_would_ask_is_logged_in_one_line_each() {
    let system = System::start();
    let events = system.ipc.event_receiver().unwrap();
    let client = system.client();
    let mut publisher = system.ipc.plan_publisher(200).unwrap();
    let home = system.home();
    let mut away = home;
    away[0] += 0.3;
    // Sound by itself, but it does not fit the moment: the loop rejects it.
    let (header, elsewhere) = system.line(away, 0.1, 0.5);
    let rejected = publisher.publish(&header, &elsewhere).unwrap();
    assert_eq!(next(&events, rejected), (EventKind::Rejected, Reason::Start));
    let (header, knots) = system.line(home, 0.2, 0.5);
    let id = publisher.publish(&header, &knots).unwrap();
    while next(&events, id).0 != EventKind::Finished {}
    let ask = |kind, value| client.call(kind, value, Duration::from_secs(2)).unwrap();
    ask(CommandKind::Speed, 0.5);
    ask(CommandKind::Pause, 0.0);
    // The endpoint falls silent: a fault.
    system.silence();
    system.wait_for(Mode::Fault);
    ask(CommandKind::Reset, 0.0);
    // Longer than two of the loop's reports.
    thread::sleep(Duration::from_millis(100));
    system.terminate();
    let (_, log) = system.finish();
    let once = |words: &str| {
        let count = log.iter().filter(|line| line.contains(words)).count();
        assert_eq!(count, 1, "{words}: {log:#?}");
    };
    once("INFO holding the arm: plans and commands are taken");
    once(&format!("plan {rejected} received: 101 knots"));
    once(&format!(
        "WARN plan {rejected} rejected: does not start where the arm is, knot 0, joint \
         r_shoulder_pan_joint: 0.300000 rad off, at most 0.0"
    ));
    once("; plan from where the arm holds (--start), or take the arm there first");
    once(&format!("INFO plan {id} accepted "));
    once(&format!("INFO plan {id} started"));
    once(&format!("INFO plan {id} finished"));
    once("INFO command speed 50 %: accepted, mode hold");
    once("INFO command pause: not possible in this mode, mode hold; ");
    once("ERROR fault: communication with the hardware endpoint was lost; start the hardware");
    once("INFO command reset: the cause of the fault is still there, mode fault; ");
    assert!(!log.iter().any(|line| line.contains("checked in")), "{log:#?}");
}

#[test]
fn one_that_waits_for_an_endpoint_says_so() {
    let root = TempDir::new().unwrap();
    let path = root.path().to_str().unwrap();
    let arguments = ["run", "--ipc-root", path, "--robot-name", "lonely"];
    let mut child = Executor(command(&arguments, Stdio::piped()).args(PATIENT).spawn().unwrap());
    thread::sleep(Duration::from_secs(3));
    assert!(Command::new("kill").arg(child.0.id().to_string()).status().unwrap().success());
    let mut text = String::new();
    std::io::Read::read_to_string(&mut child.0.stderr.take().unwrap(), &mut text).unwrap();
    assert_eq!(wait(&mut child.0), Some(0), "{text}");
    let told = "waiting for the hardware endpoint: no joint state has come; start one for robot \
                `lonely` (--robot-name) under the same --ipc-root";
    assert_eq!(text.matches(told).count(), 1, "{text}");
}

#[test]
fn wrong_usage_is_told_with_its_own_code() {
    for (arguments, told) in [
        (["run", "--cpu", "99"], "--cpu 99: no such CPU can be used: "),
        (["run", "--cpu", "5000"], "are online, counted from 0"),
        (["run", "--stale-ms", "nan"], "--stale-ms must be a positive number"),
        (["run", "--following-lag", "11"], "--following-lag must be from 0 to 10"),
        (["run", "--min-rate", "1.5"], "--min-rate must be from 0 to 1"),
        (["run", "--arm", "middle"], "--arm <ARM>': right, left or BASE,TIP (two links) is wanted"),
    ] {
        let ended = command(&arguments, Stdio::piped()).output().unwrap();
        let text = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(2), "{arguments:?}: {text}");
        assert!(text.contains(told) && !text.contains("CAP_SYS_NICE"), "{text}");
    }
}
