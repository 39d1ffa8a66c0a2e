use nullsweep_ipc_types::Mode;
use nullsweep_robot::{ArmSpec, Robot, Side};

use super::*;

const MS: u64 = 1_000_000;

/// An endpoint at home and a sender that turns joint 0 by −1 rad/s.
struct Rig {
    endpoint: Endpoint,
    home: JointVector,
    sequence: u64,
    moved: f64,
}

impl Rig {
    fn new(faults: &[&str]) -> Self {
        let arm = Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).expect("the PR2 has a right arm");
        let faults = faults.iter().map(|f| f.parse().expect("a fault")).collect();
        let behaviour = Behaviour { faults, ..Behaviour::default() };
        let endpoint = Endpoint::new(&arm, arm.home(), behaviour, 0).expect("a PR2 arm");
        Self { endpoint, home: arm.home(), sequence: 0, moved: 0.0 }
    }

    fn setpoint(&mut self, now_ns: u64) -> Setpoint {
        let mut s = <Setpoint as bytemuck::Zeroable>::zeroed();
        self.sequence += 1;
        self.moved -= 1e-3;
        (s.sequence, s.stamp_ns, s.deadline_ns) = (self.sequence, now_ns, now_ns + MS);
        s.joint_count = 7;
        s.mode = Mode::Executing.wire();
        s.positions[..7].copy_from_slice(&self.home[..7]);
        s.positions[0] += self.moved;
        s.velocities[0] = -1.0;
        s
    }

    fn send(&mut self, now_ns: u64) {
        let setpoint = self.setpoint(now_ns);
        self.endpoint.receive(&[setpoint], now_ns);
    }
}

#[test]
fn it_stops_by_itself_when_setpoints_cease() {
    let mut rig = Rig::new(&[]);
    for k in 0..200 {
        rig.send(k * MS);
        assert_eq!(rig.endpoint.measure(k * MS).expect("sent").status, status::CALIBRATED);
    }
    // The last deadline is at 200 ms.
    rig.endpoint.receive(&[], 219 * MS);
    assert!(!rig.endpoint.is_timed_out());
    rig.endpoint.receive(&[], 221 * MS);
    assert!(rig.endpoint.is_timed_out());
    let state = rig.endpoint.measure(221 * MS).expect("sent");
    assert_eq!(state.status & status::SETPOINT_TIMEOUT, status::SETPOINT_TIMEOUT);
    rig.endpoint.receive(&[], 500 * MS);
    assert!((rig.endpoint.positions()[0] - (rig.home[0] + rig.moved)).abs() < 5e-3);
    assert_eq!(rig.endpoint.counters().timeouts, 1);

    // It follows again only what begins where the arm is.
    rig.moved -= 0.5;
    rig.send(501 * MS);
    assert_eq!(rig.endpoint.counters().refused, 1);
    assert!(rig.endpoint.is_timed_out());
    rig.moved += 0.5;
    rig.send(502 * MS);
    assert_eq!(rig.endpoint.counters().refused, 1);
    assert!(!rig.endpoint.is_timed_out());
}

#[test]
fn a_reader_that_stalls_does_not_stop_the_arm() {
    let mut rig = Rig::new(&[]);
    rig.send(0);
    let late: Vec<_> = (1..60).map(|k| rig.setpoint(k * MS)).collect();
    rig.endpoint.receive(&late, 60 * MS);
    assert_eq!(rig.endpoint.counters().timeouts, 0);
    assert!(rig.endpoint.judge().verdict().is_clean());
}

#[test]
fn every_fault_shows() {
    let state_with = |fault: &str| {
        let mut rig = Rig::new(&[fault]);
        for k in 0..20 {
            rig.send(k * MS);
            rig.endpoint.measure(k * MS);
        }
        (rig.endpoint.measure(20 * MS), rig)
    };
    let status_of = |fault: &str| state_with(fault).0.expect("sent").status;
    assert_eq!(status_of("halt@5ms"), status::CALIBRATED | status::HALTED);
    assert_eq!(status_of("halt@5ms+10ms"), status::CALIBRATED);
    assert_eq!(status_of("error@5ms"), status::CALIBRATED | status::ERROR);
    assert_eq!(status_of("uncalibrated@5ms"), 0);
    assert!(state_with("stale@5ms").0.is_none());
    assert!(state_with("stale@5ms+5ms").0.is_some());
    let (state, rig) = state_with("nan@5ms");
    assert!(state.expect("sent").positions[0].is_nan() && rig.endpoint.positions()[0] < 10.0);
    let (state, rig) = state_with("jump@18ms");
    let off = state.expect("sent").positions[0] - (rig.home[0] + rig.moved);
    assert!(off > 0.9 * FaultKind::JUMP, "{off}");
    assert_eq!(state_with("count@5ms").0.expect("sent").joint_count, 6);
    assert_eq!(state_with("delay@5ms").0.expect("sent").stamp_ns, 10 * MS);
    let (state, rig) = state_with("freeze@5ms");
    assert!(state.expect("sent").positions[0] > rig.endpoint.positions()[0] + 5e-3);
    assert_eq!(status_of("link@5ms"), status::CALIBRATED);
    let (_, rig) = state_with("deaf@5ms");
    assert!(rig.endpoint.positions()[0] > rig.home[0] - 7e-3);
    assert_eq!(state_with("drop@0s").1.endpoint.counters().states, 11);
}

#[test]
fn disabled_motors_stand() {
    let mut rig = Rig::new(&[]);
    for k in 0..50 {
        rig.send(k * MS);
    }
    let at = rig.endpoint.positions()[0];
    let mut setpoint = rig.setpoint(50 * MS);
    setpoint.disable = 1;
    rig.endpoint.receive(&[setpoint], 50 * MS);
    rig.endpoint.receive(&[], 65 * MS);
    assert!((rig.endpoint.positions()[0] - at).abs() < 2e-3);
    let state = rig.endpoint.measure(65 * MS).expect("sent");
    assert_eq!(state.status & status::HALTED, status::HALTED);
    assert_eq!(rig.endpoint.counters().disabled, 1);
}
