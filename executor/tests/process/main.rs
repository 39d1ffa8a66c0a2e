//! The program as a process, against an endpoint in a thread of the test.

use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use bytemuck::Zeroable;
use nullsweep_executor::replay;
use nullsweep_ipc_types::ports::{CommandClient, Ipc, IpcError, Receiver, now_ns};
use nullsweep_ipc_types::{
    CommandKind, EventKind, JoinRule, JointStates, Knot, MAX_KNOTS, Mode, PlanEvent, PlanHeader,
    PlanId, PlanMessage, Reason, Verdict, checksum, status,
};
use nullsweep_robot::{Arm, ArmSpec, Robot, Side};
use tempfile::TempDir;

/// A test machine may be busy: the bounds are wide where the test is not about them.
const PATIENT: &[&str] = &["--stale-ms", "500", "--lost-ms", "2000", "--min-rate", "0.05"];

/// What the endpoint saw.
#[derive(Debug, Default)]
struct Seen {
    setpoints: u64,
    /// Greatest step over its bound v·T·Δsequence; at most 1 is right.
    worst: f64,
    disabled: bool,
    last: [f64; 16],
}

struct System {
    root: TempDir,
    executor: Executor,
    log: JoinHandle<Vec<String>>,
    endpoint: JoinHandle<Seen>,
    over: Arc<AtomicBool>,
    ipc: Ipc,
    arm: Arm,
}

fn arm() -> Arm {
    Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).unwrap()
}

/// The process; a test that fails leaves none behind.
struct Executor(Child);

impl Drop for Executor {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn executor(root: &TempDir, more: &[&str]) -> Executor {
    let child = Command::new(env!("CARGO_BIN_EXE_executor"))
        .arg("run")
        .arg("--ipc-root")
        .arg(root.path())
        .args(more)
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    Executor(child)
}

impl System {
    fn start() -> Self {
        Self::start_with(&[])
    }

    /// With more arguments; `ROOT` in one stands for the root folder.
    fn start_with(more: &[&str]) -> Self {
        let root = TempDir::new().unwrap();
        let ipc = Ipc::open("pr2", Some(root.path())).unwrap();
        let here = root.path().to_str().unwrap();
        let more: Vec<String> = more.iter().map(|a| a.replace("ROOT", here)).collect();
        let arguments: Vec<&str> =
            PATIENT.iter().copied().chain(more.iter().map(String::as_str)).collect();
        let mut executor = executor(&root, &arguments);
        let lines = BufReader::new(executor.0.stderr.take().unwrap()).lines();
        let log = thread::spawn(move || lines.map_while(Result::ok).collect());
        let over = Arc::new(AtomicBool::new(false));
        let endpoint = {
            let (path, over) = (root.path().to_path_buf(), over.clone());
            thread::spawn(move || endpoint(&Ipc::open("pr2", Some(&path)).unwrap(), &arm(), &over))
        };
        let system = Self { root, executor, log, endpoint, over, ipc, arm: arm() };
        system.wait_for(Mode::Hold);
        system
    }

    fn client(&self) -> CommandClient {
        self.ipc.command_client().unwrap()
    }

    fn wait_for(&self, mode: Mode) {
        let client = self.client();
        let end = Instant::now() + Duration::from_secs(20);
        let mut last = None;
        while Instant::now() < end {
            last = client.call(CommandKind::Status, 0.0, Duration::from_secs(1)).ok();
            if last.is_some_and(|r| r.mode == mode.wire()) {
                return;
            }
            thread::sleep(Duration::from_millis(5));
        }
        panic!("no {mode}: {last:?}");
    }

    /// Moves joint 0 by `way` in `seconds` from `from`.
    fn line(&self, from: [f64; 16], way: f64, seconds: f64) -> (PlanHeader, Vec<Knot>) {
        let knots: Vec<Knot> = (0..=100u32)
            .map(|i| {
                let u = f64::from(i) / 100.0;
                let mut knot = Knot::zeroed();
                knot.time_from_start_ns = (u * seconds * 1e9) as u64;
                knot.positions = from;
                knot.positions[0] += way * u;
                knot
            })
            .collect();
        let held = self.arm.held_joints();
        let mut header = PlanHeader {
            fingerprint: self.arm.fingerprint(),
            joint_count: self.arm.dof() as u32,
            held_count: held.len() as u32,
            ..PlanHeader::default()
        };
        for (to, joint) in header.held_positions.iter_mut().zip(held) {
            *to = joint.position;
        }
        (header, knots)
    }

    fn terminate(&self) {
        let kill = Command::new("kill").arg(self.executor.0.id().to_string()).status().unwrap();
        assert!(kill.success());
    }

    fn end(self) -> (Seen, Vec<String>) {
        self.terminate();
        self.finish()
    }

    fn finish(mut self) -> (Seen, Vec<String>) {
        let status = self.executor.0.wait().unwrap();
        self.over.store(true, Ordering::Release);
        let log = self.log.join().unwrap();
        assert!(status.success(), "{status}: {log:#?}");
        drop(self.root);
        (self.endpoint.join().unwrap(), log)
    }
}

/// Follows each setpoint at once and judges it.
fn endpoint(ipc: &Ipc, arm: &Arm, over: &AtomicBool) -> Seen {
    let states = ipc.state_sender().unwrap();
    let setpoints = ipc.setpoint_receiver().unwrap();
    let mut state = JointStates {
        joint_count: arm.dof() as u32,
        held_count: arm.held_joints().len() as u32,
        status: status::CALIBRATED,
        ..JointStates::zeroed()
    };
    state.positions[..arm.dof()].copy_from_slice(&arm.home()[..arm.dof()]);
    for (to, joint) in state.held_positions.iter_mut().zip(arm.held_joints()) {
        *to = joint.position;
    }
    let mut seen = Seen { last: state.positions, ..Seen::default() };
    while !over.load(Ordering::Acquire) {
        while let Some(setpoint) = setpoints.receive().unwrap() {
            // A sequence that falls is another executor's.
            let ahead = setpoint.sequence.saturating_sub(state.setpoint_sequence).max(1) as f64;
            for (j, limits) in arm.limits().iter().enumerate() {
                let step = (setpoint.positions[j] - seen.last[j]).abs();
                let most = limits.velocity * 1e-3 * ahead * (1.0 + 1e-6) + 1e-9;
                seen.worst = seen.worst.max(step / most);
            }
            seen.setpoints += 1;
            seen.last = setpoint.positions;
            seen.disabled = setpoint.disable != 0;
            state.setpoint_sequence = setpoint.sequence;
            state.setpoint_received_ns = now_ns();
            state.positions = setpoint.positions;
        }
        state.sequence += 1;
        state.stamp_ns = now_ns();
        states.send(&state).unwrap();
        thread::sleep(Duration::from_millis(1));
    }
    seen
}

fn next(events: &Receiver<PlanEvent>, id: PlanId) -> (EventKind, Reason) {
    let end = Instant::now() + Duration::from_secs(20);
    while Instant::now() < end {
        if let Some(event) = events.receive().unwrap() {
            if event.plan == id {
                let kind = EventKind::from_wire(event.kind).unwrap();
                return (kind, Reason::from_wire(event.reason).unwrap());
            }
        } else {
            thread::sleep(Duration::from_millis(1));
        }
    }
    panic!("no event of plan {id}");
}

#[test]
fn a_plan_from_publication_to_its_end() {
    let system = System::start();
    let events = system.ipc.event_receiver().unwrap();
    let mut publisher = system.ipc.plan_publisher(200).unwrap();
    let mut home = [0.0; 16];
    home[..8].copy_from_slice(&system.arm.home()[..]);
    let (header, knots) = system.line(home, 0.2, 0.5);

    let wrong = PlanHeader { fingerprint: 1, ..header };
    let id = publisher.publish(&wrong, &knots).unwrap();
    assert_eq!(next(&events, id), (EventKind::Rejected, Reason::Robot));
    let id = PlanId { epoch: 1, number: 1 };
    let mut old = PlanHeader { id, knot_count: knots.len() as u32, ..header };
    old.checksum = checksum(PlanMessage { header: &old, knots: &knots });
    publisher.publish_raw(&old, &knots).unwrap();
    assert_eq!(next(&events, old.id), (EventKind::Rejected, Reason::Epoch));

    let id = publisher.publish(&header, &knots).unwrap();
    assert_eq!(next(&events, id), (EventKind::Accepted, Reason::None));
    assert_eq!(next(&events, id), (EventKind::Started, Reason::None));
    assert_eq!(next(&events, id), (EventKind::Finished, Reason::None));
    let telemetry = system.ipc.telemetry_receiver().unwrap();
    let end = Instant::now() + Duration::from_secs(5);
    let report = loop {
        if let Some(newest) = telemetry.newest().unwrap() {
            break newest.value;
        }
        assert!(Instant::now() < end, "no telemetry");
        thread::sleep(Duration::from_millis(1));
    };
    assert_eq!(report.commanded, knots[100].positions);
    assert!(report.cycle > 500 && report.joint_count == 7);

    let (seen, log) = system.end();
    assert!(seen.worst <= 1.0, "{seen:?}");
    assert_eq!(seen.last, knots[100].positions);
    assert!(seen.disabled, "the motors are asked off at the end");
    let summary = log.iter().find(|l| l.contains("system-heap calls")).expect("a summary");
    assert!(summary.contains(": 0 system-heap calls"), "{summary}");
    println!("{summary}");
}

#[test]
fn commands_are_answered_and_obeyed() {
    let system = System::start();
    let events = system.ipc.event_receiver().unwrap();
    let client = system.client();
    let mut publisher = system.ipc.plan_publisher(200).unwrap();
    let mut home = [0.0; 16];
    home[..8].copy_from_slice(&system.arm.home()[..]);
    let (header, knots) = system.line(home, 0.3, 3.0);
    let id = publisher.publish(&header, &knots).unwrap();
    assert_eq!(next(&events, id).0, EventKind::Accepted);
    let mut answers = Vec::new();
    let mut ask = |kind, value| {
        let start = Instant::now();
        let response = client.call(kind, value, Duration::from_secs(2)).unwrap();
        answers.push(start.elapsed());
        Verdict::from_wire(response.verdict).unwrap()
    };
    assert_eq!(ask(CommandKind::Speed, 0.5), Verdict::Accepted);
    assert_eq!(ask(CommandKind::Speed, 2.0), Verdict::BadValue);
    assert_eq!(ask(CommandKind::Pause, 0.0), Verdict::Accepted);
    system.wait_for(Mode::Paused);
    assert_eq!(ask(CommandKind::Reset, 0.0), Verdict::WrongMode);
    assert_eq!(ask(CommandKind::Resume, 0.0), Verdict::Accepted);
    assert_eq!(ask(CommandKind::Stop, 0.0), Verdict::Accepted);
    assert_eq!(next(&events, id).0, EventKind::Started);
    assert_eq!(next(&events, id), (EventKind::Aborted, Reason::Stopped));
    system.wait_for(Mode::Hold);
    println!("answers within {answers:?}");
    let (seen, _) = system.end();
    assert!(seen.worst <= 1.0, "{seen:?}");
}

#[test]
fn a_plan_that_runs_at_shutdown_is_stopped_and_told() {
    let system = System::start();
    let events = system.ipc.event_receiver().unwrap();
    let mut publisher = system.ipc.plan_publisher(200).unwrap();
    let mut home = [0.0; 16];
    home[..8].copy_from_slice(&system.arm.home()[..]);
    let (header, knots) = system.line(home, 0.4, 4.0);
    let id = publisher.publish(&header, &knots).unwrap();
    assert_eq!(next(&events, id).0, EventKind::Accepted);
    assert_eq!(next(&events, id).0, EventKind::Started);
    system.terminate();
    assert_eq!(next(&events, id), (EventKind::Aborted, Reason::Shutdown));
    let (seen, _) = system.finish();
    assert!(seen.worst <= 1.0 && seen.disabled, "{seen:?}");
}

#[test]
fn a_second_executor_is_refused_and_a_killed_one_replaced() {
    let mut system = System::start();
    let mut second = executor(&system.root, PATIENT);
    let mut text = String::new();
    second.0.stderr.take().unwrap().read_to_string(&mut text).unwrap();
    assert!(!second.0.wait().unwrap().success());
    assert!(text.contains("all places are taken"), "{text}");
    system.wait_for(Mode::Hold);

    system.executor.0.kill().unwrap();
    system.executor.0.wait().unwrap();
    let mut publisher = system.ipc.plan_publisher(2).unwrap();
    let (header, knots) = system.line([0.0; 16], 0.1, 1.0);
    // The dead one's port is there until somebody sweeps; then a publication says so.
    system.ipc.sweep_dead_nodes();
    let e = publisher.publish(&header, &knots[..2]).unwrap_err();
    assert!(matches!(e, IpcError::NoExecutor { .. }), "{e}");
    system.executor = executor(&system.root, PATIENT);
    let lines = BufReader::new(system.executor.0.stderr.take().unwrap()).lines();
    system.log = thread::spawn(move || lines.map_while(Result::ok).collect());
    system.wait_for(Mode::Hold);
    system.end();
}

#[test]
fn a_killed_run_replays_bit_for_bit() {
    let mut system = System::start_with(&["--record", "ROOT/flight", "--record-mib", "1"]);
    let events = system.ipc.event_receiver().unwrap();
    let client = system.client();
    let mut publisher = system.ipc.plan_publisher(200).unwrap();
    let mut home = [0.0; 16];
    home[..8].copy_from_slice(&system.arm.home()[..]);
    let (header, knots) = system.line(home, 0.2, 0.5);
    let second = Duration::from_secs(1);
    let first = publisher.publish(&header, &knots).unwrap();
    assert_eq!(next(&events, first).0, EventKind::Accepted);
    client.call(CommandKind::Speed, 0.7, second).unwrap();
    let join = PlanHeader {
        join_rule: JoinRule::AtKnot.wire(),
        join_plan: first,
        join_knot: 90,
        ..header
    };
    let (_, on) = system.line(knots[90].positions, -0.2, 0.5);
    let other = publisher.publish(&join, &on).unwrap();
    assert_eq!(next(&events, other).0, EventKind::Accepted);
    assert_eq!(next(&events, other).0, EventKind::Started);
    assert_eq!(next(&events, other).0, EventKind::Finished);
    // Long enough in Hold for the files to change over at least once.
    thread::sleep(Duration::from_millis(3500));
    system.executor.0.kill().unwrap();
    system.executor.0.wait().unwrap();
    system.over.store(true, Ordering::Release);

    let files: Vec<_> = (0..2)
        .map(|i| system.root.path().join(format!("flight/flight-{i}.nswrec")))
        .filter(|f| f.exists())
        .collect();
    assert_eq!(files.len(), 2);
    let replayed: Vec<_> = files.iter().map(|f| replay(f).unwrap()).collect();
    let finished: usize = replayed.iter().map(|r| r.count(EventKind::Finished)).sum();
    let superseded: usize = replayed.iter().map(|r| r.count(EventKind::Superseded)).sum();
    assert_eq!((finished, superseded), (1, 1), "{replayed:?}");
    assert!(replayed.iter().all(|r| r.setpoints > 0));

    // A torn end is told; a setpoint that was tampered with is found.
    let bytes = std::fs::read(&files[0]).unwrap();
    let torn = system.root.path().join("torn");
    std::fs::write(&torn, &bytes[..bytes.len() - 7]).unwrap();
    let replayed_torn = replay(&torn).unwrap();
    assert_eq!(replayed_torn.cycles + 1, replayed[0].cycles);
    assert!(replayed_torn.torn > 0);
    let status = Command::new(env!("CARGO_BIN_EXE_executor")).arg("replay").arg(&torn).status();
    assert!(status.unwrap().success());
    assert!(replay(&system.root.path().join("flight")).is_err());
    system.endpoint.join().unwrap();
}

/// A plan of the largest size is admitted beside the commands, never in their way.
#[test]
fn commands_are_answered_while_a_large_plan_is_admitted() {
    let system = System::start();
    let events = system.ipc.event_receiver().unwrap();
    let client = system.client();
    let mut publisher = system.ipc.plan_publisher(MAX_KNOTS).unwrap();
    let mut home = [0.0; 16];
    home[..8].copy_from_slice(&system.arm.home()[..]);
    let (header, short) = system.line(home, 0.0, 1.0);
    let knots: Vec<Knot> = (0..MAX_KNOTS as u64)
        .map(|i| Knot { time_from_start_ns: i * 1_000_000, ..short[0] })
        .collect();
    let mut answers = Vec::new();
    for _ in 0..5 {
        let id = publisher.publish(&header, &knots).unwrap();
        for _ in 0..30 {
            let start = Instant::now();
            client.call(CommandKind::Status, 0.0, Duration::from_secs(2)).unwrap();
            answers.push(start.elapsed());
        }
        let first = next(&events, id).0;
        assert!(matches!(first, EventKind::Accepted | EventKind::Rejected), "{first}");
        client.call(CommandKind::Stop, 0.0, Duration::from_secs(2)).unwrap();
        system.wait_for(Mode::Hold);
    }
    answers.sort();
    // How fast is the laboratory's affair; here an answer may not wait for an admission at all.
    println!("median answer {:?}, slowest {:?}", answers[75], answers[149]);
    assert!(answers[75] < Duration::from_millis(10), "{answers:?}");
    system.end();
}

/// The laboratory's proof: a million cycles of the armed loop with a swap every 100 ms, and not
/// one call into the system's heap (the debug build would abort), not one page fault.
/// `cargo test -p nullsweep-executor --test process -- --ignored --nocapture million`
#[test]
#[ignore = "takes minutes"]
fn a_million_armed_cycles_with_swaps() {
    let system = System::start_with(&["--rate", "4000", "--spin-us", "0"]);
    let events = system.ipc.event_receiver().unwrap();
    let telemetry = system.ipc.telemetry_receiver().unwrap();
    let mut publisher = system.ipc.plan_publisher(200).unwrap();
    let mut home = [0.0; 16];
    home[..8].copy_from_slice(&system.arm.home()[..]);
    let (mut running, mut last) = (PlanId::NONE, Vec::new());
    let mut swaps = 0u64;
    let mut cycle = 0;
    while cycle < 1_001_000 {
        // There, from a knot of it back again, and so on: now by a knot, now by a stop.
        let from = last.get(60).map_or(home, |k: &Knot| k.positions);
        let way = home[0] + 0.2 - from[0];
        let way = if way.abs() < 0.1 { -0.2 } else { way };
        let (header, knots) = system.line(from, way, 0.6);
        let rule = if running.is_some() { JoinRule::AtKnot } else { JoinRule::StopThenStart };
        let header =
            PlanHeader { join_rule: rule.wire(), join_plan: running, join_knot: 60, ..header };
        let id = publisher.publish(&header, &knots).unwrap();
        if next(&events, id).0 == EventKind::Accepted {
            let then = next(&events, id);
            if then.0 != EventKind::Started {
                let newest = telemetry.newest().unwrap().map(|t| t.value);
                let (_, log) = system.end();
                panic!("{then:?} after cycle {cycle}, swap {swaps}, {newest:?}\n{log:#?}");
            }
            swaps += 1;
            (running, last) = (id, knots);
        } else {
            // Too late for its knot: begin anew from where the arm came to rest.
            system.wait_for(Mode::Hold);
            running = PlanId::NONE;
            last.clear();
            home = telemetry.newest().unwrap().map_or(home, |t| t.value.commanded);
        }
        cycle = telemetry.newest().unwrap().map_or(cycle, |t| t.value.cycle);
    }
    let (seen, log) = system.end();
    let summary = log.iter().find(|l| l.contains("system-heap calls")).expect("a summary");
    println!("{swaps} swaps; {summary}");
    assert!(seen.worst <= 1.0, "{seen:?}");
    assert!(summary.contains(": 0 system-heap calls, 0 page faults"), "{summary}");
}
