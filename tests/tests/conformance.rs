//! The one suite for endpoints, on the mock under a virtual clock, on the mock as a process, and on
//! endpoints that are broken on purpose, each of which must break its own rule.

use std::ffi::OsString;
use std::io::Write as _;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use bytemuck::Zeroable;
use nullsweep_executor::Hardware;
use nullsweep_ipc_types::ports::{Ipc, PortError};
use nullsweep_ipc_types::{JointStates, Setpoint, status};
use nullsweep_robot::{Arm, ArmSpec, Robot, Side};
use nullsweep_tests::conformance::{Rig, Terms, VirtualClock, VirtualEndpoint, suite};
use nullsweep_tests::endpoint::{Behaviour, Endpoint, Fidelity};
use nullsweep_tests::judge::Rules;
use nullsweep_tests::stage::Stage;
use nullsweep_tests::system::start_mock;

fn right_arm() -> Arm {
    Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).expect("the PR2 has a right arm")
}

/// The names of the rules that an endpoint breaks, each with what was found.
fn broken_by(behaviour: Behaviour) -> Vec<(&'static str, String)> {
    let (arm, clock) = (right_arm(), VirtualClock::default());
    let endpoint = Endpoint::new(&arm, arm.home(), behaviour, clock.now_ns()).expect("a PR2 arm");
    let mut rig = Rig::new(VirtualEndpoint::new(endpoint, clock.clone()), clock, &arm);
    suite(&mut rig, &Terms::default(), |_| true)
        .into_iter()
        .filter_map(|f| Some((f.name, f.broken?)))
        .collect()
}

#[test]
fn the_mock_keeps_every_rule() {
    for fidelity in [Fidelity::Servo, Fidelity::Mechanism] {
        let broken = broken_by(Behaviour { fidelity, ..Behaviour::default() });
        assert!(broken.is_empty(), "{fidelity:?}: {broken:?}");
    }
}

/// One that wraps its angles keeps them too, with the wrists at either side of half a turn.
#[test]
fn a_mock_that_wraps_its_angles_keeps_every_rule() {
    for fidelity in [Fidelity::Servo, Fidelity::Mechanism] {
        for near in [-0.03, 0.03] {
            let (arm, clock) = (right_arm(), VirtualClock::default());
            let mut at = arm.home();
            for (j, limits) in arm.limits().iter().enumerate().filter(|(_, l)| l.continuous) {
                assert!(limits.continuous);
                at[j] = std::f64::consts::PI + near;
            }
            let behaviour = Behaviour { fidelity, wrap: true, ..Behaviour::default() };
            let endpoint = Endpoint::new(&arm, at, behaviour, clock.now_ns()).expect("a PR2 arm");
            let mut rig = Rig::new(VirtualEndpoint::new(endpoint, clock.clone()), clock, &arm);
            let broken: Vec<_> = suite(&mut rig, &Terms::default(), |_| true)
                .into_iter()
                .filter_map(|f| Some((f.name, f.broken?)))
                .collect();
            assert!(broken.is_empty(), "{fidelity:?} {near}: {broken:?}");
        }
    }
}

#[test]
fn a_broken_endpoint_breaks_its_own_rule() {
    for (fault, rule) in [
        ("count@0s", "shape"),
        ("nan@0s", "shape"),
        ("uncalibrated@0s", "shape"),
        ("halt@0s", "shape"),
        ("stale@0s", "shape"),
        ("freeze@0s", "follow"),
        ("deaf@0s", "follow"),
        ("unanswered@0s", "answer"),
        ("stuck@0s", "answer"),
        ("ahead@0s", "answer"),
        ("clock@0s", "stream"),
    ] {
        let faults = vec![fault.parse().expect("a fault")];
        let broken = broken_by(Behaviour { faults, ..Behaviour::default() });
        let names: Vec<_> = broken.iter().map(|(name, _)| *name).collect();
        assert!(names.contains(&rule), "{fault}: {broken:?}");
    }
    // No watchdog of its own, and none that refuses.
    let rules = Rules { session_timeout_ns: 3_600_000_000_000, ..Rules::default() };
    let broken = broken_by(Behaviour { rules, ..Behaviour::default() });
    let names: Vec<_> = broken.iter().map(|(name, _)| *name).collect();
    assert!(names.contains(&"watchdog"), "{broken:?}");
    let rules = Rules { start_tolerance: 1.0, ..Rules::default() };
    let broken = broken_by(Behaviour { rules, ..Behaviour::default() });
    let names: Vec<_> = broken.iter().map(|(name, _)| *name).collect();
    assert_eq!(names, ["refuse"], "{broken:?}");
}

/// An endpoint that hears only some setpoints, says so of the others, and tells what it likes.
struct Odd {
    inner: VirtualEndpoint,
    hears: fn(&Setpoint, &JointStates) -> bool,
    tells: fn(&mut JointStates),
    last: JointStates,
    waits: bool,
}

impl Hardware for Odd {
    fn read(&mut self) -> Result<Option<JointStates>, PortError> {
        let Some(mut state) = self.inner.read()? else { return Ok(None) };
        self.last = state;
        if self.waits {
            state.status |= status::SETPOINT_TIMEOUT;
        }
        (self.tells)(&mut state);
        Ok(Some(state))
    }

    fn write(&mut self, setpoint: &Setpoint) -> Result<(), PortError> {
        self.waits = !(self.hears)(setpoint, &self.last);
        if self.waits { Ok(()) } else { self.inner.write(setpoint) }
    }
}

#[test]
fn an_odd_endpoint_breaks_its_own_rule_alone() {
    type Hears = fn(&Setpoint, &JointStates) -> bool;
    type Tells = fn(&mut JointStates);
    let cases: [(&str, Hears, Tells); 3] = [
        // Whole turns are a distance to it.
        (
            "turns",
            |setpoint, last| {
                let apart =
                    setpoint.positions.iter().zip(&last.positions).map(|(a, b)| (a - b).abs());
                !apart.fold(0.0, f64::max).ge(&3.0)
            },
            |_| {},
        ),
        // Its counter is small.
        ("late", |setpoint, _| setpoint.sequence < 1_000_000, |_| {}),
        // It tells now the newest, now an older one.
        (
            "answer",
            |_, _| true,
            |state| {
                let older = if state.sequence.is_multiple_of(2) { 5 } else { 0 };
                state.setpoint_sequence = state.setpoint_sequence.saturating_sub(older);
            },
        ),
    ];
    for (rule, hears, tells) in cases {
        let (arm, clock) = (right_arm(), VirtualClock::default());
        let endpoint = Endpoint::new(&arm, arm.home(), Behaviour::default(), clock.now_ns());
        let inner = VirtualEndpoint::new(endpoint.expect("a PR2 arm"), clock.clone());
        let odd = Odd { inner, hears, tells, last: JointStates::zeroed(), waits: false };
        let mut rig = Rig::new(odd, clock, &arm);
        let found = suite(&mut rig, &Terms::default(), |_| true);
        let broken: Vec<_> = found.iter().filter(|f| f.broken.is_some()).map(|f| f.name).collect();
        assert_eq!(broken, [rule], "{found:?}");
    }
}

/// Against a process, as a user runs it. A loaded machine may stall either side, so the time until
/// the watchdog is generous.
#[test]
fn the_mock_process_keeps_every_rule() {
    let stage = Stage::new(env!("CARGO_BIN_EXE_demo"), "pr2").expect("a folder");
    let mock = start_mock(&stage, "mock", ["--timeout", "500"]).expect("the mock starts");
    let mut args: Vec<OsString> = stage.place().to_vec();
    args.extend(["--grace", "2000", "--speed", "0.3", "--dare"].map(OsString::from));
    let run = Command::new(env!("CARGO_BIN_EXE_conformance")).args(args).output().expect("it runs");
    let said = String::from_utf8_lossy(&run.stdout);
    let complained = String::from_utf8_lossy(&run.stderr);
    assert_eq!(run.status.code(), Some(0), "{said}{complained}\nmock: {}", mock.stderr());
    assert_eq!(said.matches("kept").count(), 12, "{said}");
}

/// A pipe that nobody reads and that is full: no state waits for it.
#[test]
fn a_mock_whose_words_nobody_reads_sends_states() {
    let root = tempfile::TempDir::new().expect("a folder");
    let (_reader, writer) = std::io::pipe().expect("a pipe");
    let mut filler = writer.try_clone().expect("the same pipe");
    std::thread::spawn(move || while filler.write_all(&[b'.'; 4096]).is_ok() {});
    std::thread::sleep(Duration::from_millis(200));
    let ipc = Ipc::open("pr2", Some(root.path())).expect("a door");
    let states = ipc.state_receiver().expect("a place");
    let mut mock = Command::new(env!("CARGO_BIN_EXE_mock-hardware"));
    let mock = mock.arg("--ipc-root").arg(root.path()).stdout(Stdio::null()).stderr(writer).spawn();
    let mut mock = mock.expect("it starts");
    let end = Instant::now() + Duration::from_secs(20);
    let mut count = 0;
    while count < 100 && Instant::now() < end {
        count += states.newest().expect("a port").map_or(0, |newest| newest.skipped + 1);
        std::thread::sleep(Duration::from_millis(1));
    }
    mock.kill().expect("it runs");
    mock.wait().expect("it is ours");
    assert!(count >= 100, "{count} states");
}

#[test]
fn without_an_endpoint_it_could_not_be_tried() {
    let stage = Stage::new(env!("CARGO_BIN_EXE_demo"), "pr2").expect("a folder for the test");
    let ended = Command::new(env!("CARGO_BIN_EXE_conformance")).args(stage.place()).output();
    let ended = ended.expect("it starts");
    let said = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(2), "{said}");
    assert!(said.contains("no endpoint sends joint states for robot `pr2`"), "{said}");
    assert!(ended.stdout.is_empty(), "no table of rules that were not tried");
}
