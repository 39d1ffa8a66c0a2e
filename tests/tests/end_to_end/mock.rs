//! The mock process alone, with this test in the executor's place.

use std::ffi::OsString;
use std::thread;
use std::time::Duration;

use nullsweep_ipc_types::ports::{Ipc, Receiver, Sender, now_ns};
use nullsweep_ipc_types::{JointStates, Mode, Setpoint, status};
use nullsweep_tests::stage::{Part, Process, Stage};
use nullsweep_tests::system::VERDICT;
use nullsweep_tests::witness::PATIENCE;
use serde_json::Value;

use crate::common::{right_arm, stage, verdict};

/// A hand-made executor.
struct Hand {
    setpoints: Sender<Setpoint>,
    states: Receiver<JointStates>,
    newest: Option<JointStates>,
    next: Setpoint,
}

impl Hand {
    fn open(stage: &Stage) -> Self {
        let ipc = Ipc::open(stage.robot(), Some(&stage.root())).expect("the test's own ports");
        let mut next = <Setpoint as bytemuck::Zeroable>::zeroed();
        next.joint_count = 7;
        next.mode = Mode::Executing.wire();
        next.positions[..7].copy_from_slice(&right_arm().home()[..7]);
        let setpoints = ipc.setpoint_sender().expect("the executor's place is free");
        let states = ipc.state_receiver().expect("the executor's place is free");
        Self { setpoints, states, newest: None, next }
    }

    /// Sends `count` setpoints at 1 kHz that turn joint 0 by `rate` rad/s.
    fn turn(&mut self, count: u32, rate: f64) {
        for _ in 0..count {
            self.next.sequence += 1;
            self.next.stamp_ns = now_ns();
            self.next.deadline_ns = self.next.stamp_ns + 1_000_000;
            self.next.positions[0] += rate * 1e-3;
            self.next.velocities[0] = rate;
            self.setpoints.send(&self.next).expect("sent");
            self.read();
            thread::sleep(Duration::from_millis(1));
        }
    }

    fn read(&mut self) {
        if let Some(newest) = self.states.newest().expect("states can be read") {
            self.newest = Some(newest.value);
        }
    }

    fn wait(&mut self, fits: impl Fn(&JointStates) -> bool) -> JointStates {
        let end = now_ns() + PATIENCE.as_nanos() as u64;
        loop {
            self.read();
            if let Some(state) = self.newest.filter(&fits) {
                return state;
            }
            assert!(now_ns() < end, "no such state came: {:?}", self.newest);
            thread::sleep(Duration::from_millis(2));
        }
    }
}

fn start(stage: &Stage, more: &[&str]) -> Process {
    let mut args: Vec<OsString> = stage.place().to_vec();
    args.extend(["--json".into(), stage.file(VERDICT).into()]);
    args.extend(more.iter().map(OsString::from));
    stage.start(Part::Mock, "mock", args).expect("the mock starts")
}

fn exit_code_and_verdict(stage: &Stage, mut mock: Process) -> (Option<i32>, Value) {
    let found = verdict(stage, &mut mock);
    (mock.status().expect("known").expect("ended").code(), found)
}

#[test]
fn it_follows_stops_by_itself_and_finds_nothing_wrong() {
    let stage = stage();
    let record = stage.file("record.csv");
    let record_arg = record.to_str().expect("UTF-8");
    let mock = start(&stage, &["--record", record_arg, "--record-every", "1"]);
    let mut hand = Hand::open(&stage);
    let first = hand.wait(|_| true);
    assert_eq!((first.status, first.joint_count), (status::CALIBRATED, 7));
    assert_eq!(first.positions[..7], right_arm().home()[..7]);
    hand.turn(300, -0.5);
    let stopped = hand.wait(|s| s.status & status::SETPOINT_TIMEOUT != 0);
    let goal = hand.next.positions[0];
    let settled = hand.wait(|s| s.sequence > stopped.sequence + 100);
    assert!((settled.positions[0] - goal).abs() < 0.02, "{} for {goal}", settled.positions[0]);

    let (code, found) = exit_code_and_verdict(&stage, mock);
    assert_eq!(code, Some(0), "{found:#}");
    assert_eq!(found["violations"], 0);
    let read = found["verdict"]["setpoints"].as_u64().expect("a count");
    let lost = found["verdict"]["lost_by_reader"].as_u64().expect("a count");
    assert!(read + lost <= 300 && read > 0, "{found:#}");
    assert!(found["endpoint"]["timeouts"].as_u64() >= Some(1));
    let csv = std::fs::read_to_string(record).expect("a record");
    assert!(csv.starts_with("time_s,plan,knot,r_shoulder_pan_joint,"), "{csv:.60}");
    assert!(csv.lines().count() > 20);
}

#[test]
fn a_step_too_far_ends_in_a_named_violation_and_exit_code_1() {
    let stage = stage();
    let mock = start(&stage, &[]);
    let mut hand = Hand::open(&stage);
    hand.wait(|_| true);
    hand.turn(20, 0.0);
    hand.next.positions[1] += 0.01;
    hand.turn(20, 0.0);
    hand.wait(|s| s.setpoint_sequence == 40);
    let (code, found) = exit_code_and_verdict(&stage, mock);
    assert_eq!(code, Some(1), "{found:#}");
    assert_eq!(found["verdict"]["violations"]["step"], 1, "{found:#}");
    assert_eq!(found["violations"], 1, "{found:#}");
    let first = &found["verdict"]["first"][0];
    assert_eq!(first["joint"], "r_shoulder_lift_joint");
    assert_eq!(first["sequence"], 21);
}

#[test]
fn it_plays_faults_ends_in_time_and_says_when_nothing_came() {
    let stage = stage();
    let mut mock = start(&stage, &["--seconds", "1.5", "--fault", "halt@0.1s"]);
    let mut hand = Hand::open(&stage);
    let state = hand.wait(|s| s.status & status::HALTED != 0);
    assert_eq!(state.status, status::CALIBRATED | status::HALTED);
    let status = mock.wait(PATIENCE).expect("known").expect("it ends by itself");
    assert!(status.success());
    assert!(mock.stdout().contains("no setpoint came"), "{}", mock.stdout());

    let mut wrong = start(&stage, &["--fault", "smoke@1s"]);
    assert_eq!(wrong.wait(PATIENCE).expect("known").expect("it ends").code(), Some(2));
    assert!(wrong.stderr().contains("there is no fault `smoke`"), "{}", wrong.stderr());
}
