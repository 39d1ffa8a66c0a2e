//! Every fault of the endpoint in every mode of the executor, under a virtual clock: what happens
//! is listed, and is what the design asks for.

use std::time::Duration;

use nullsweep_executor::cycle::Order;
use nullsweep_ipc_types::{EventKind, Fault, Mode, PlanId};
use nullsweep_robot::{Arm, ArmSpec, Robot, Side};
use nullsweep_tests::endpoint::{Behaviour, Endpoint, Fidelity};
use nullsweep_tests::fault::FaultKind;
use nullsweep_tests::loopback::Loopback;
use nullsweep_tests::sketch::{Sketch, swung};

/// How a fault must end where the arm was at rest, and where it moved. `None`: nothing happens.
fn expected(kind: FaultKind) -> (Option<Fault>, Option<Fault>) {
    let both = |fault| (Some(fault), Some(fault));
    match kind {
        FaultKind::Halt | FaultKind::Link => both(Fault::Halted),
        FaultKind::Error => both(Fault::Endpoint),
        FaultKind::Uncalibrated => both(Fault::NotCalibrated),
        FaultKind::Stale => both(Fault::CommunicationLost),
        FaultKind::Nan => both(Fault::NotFinite),
        FaultKind::Count => both(Fault::JointCount),
        FaultKind::Jump => both(Fault::FollowingError),
        FaultKind::Unanswered | FaultKind::Stuck | FaultKind::Ahead => both(Fault::Answer),
        FaultKind::Clock => both(Fault::Clock),
        // An arm that stands does not show that its encoders stand too.
        FaultKind::Freeze | FaultKind::Deaf => (None, Some(Fault::FollowingError)),
        FaultKind::Drop | FaultKind::Delay => (None, None),
    }
}

fn right_arm() -> Arm {
    Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).expect("the PR2 has a right arm")
}

/// A system in a mode, and the plan that it has there.
fn in_mode(mode: Mode, fidelity: Fidelity) -> (Loopback, Option<PlanId>) {
    let arm = right_arm();
    let behaviour = Behaviour { fidelity, ..Behaviour::default() };
    let mut system = Loopback::new(&arm, behaviour).expect("a PR2 arm");
    if mode == Mode::Init {
        return (system, None);
    }
    system.run(10);
    let mut plan = None;
    if matches!(mode, Mode::Executing | Mode::Paused | Mode::Stopping) {
        let sketch = Sketch::swings(&arm, &arm.home(), 4, 0.4, 0.3);
        plan = Some(system.publish(&sketch).expect("a sound plan"));
        system.run(300);
    }
    match mode {
        Mode::Paused => {
            system.order(Order::Pause);
            system.run(500);
        }
        Mode::Stopping => {
            system.order(Order::Stop);
        }
        Mode::Fault => {
            let now = system.now_ns();
            let short = Some(Duration::from_millis(50));
            system.endpoint.play(FaultKind::Error, short, now);
            system.run(200);
        }
        Mode::Init | Mode::Hold | Mode::Executing => {}
    }
    assert_eq!(system.snapshot().mode, mode);
    (system, plan)
}

fn matrix(fidelity: Fidelity) {
    println!("{:14} {:10} {:10} {:48} plan", "fault", "mode", "then", "fault code");
    for (kind, name) in FaultKind::NAMES {
        for &mode in Mode::ALL {
            let (mut system, plan) = in_mode(mode, fidelity);
            let now = system.now_ns();
            system.endpoint.play(kind, Some(Duration::from_secs(2)), now);
            system.run(1900);
            let after = system.snapshot();
            let story: Vec<_> = plan.map_or_else(Vec::new, |p| system.story(p));
            let end = story.last().map_or("", |e| e.kind.text());
            println!(
                "{name:14} {:10} {:10} {:48} {end}",
                mode.text(),
                after.mode.text(),
                after.fault.text()
            );

            let moves = mode == Mode::Executing;
            let (at_rest, moving) = expected(kind);
            match if moves { moving } else { at_rest } {
                // While it waits, it does not start; while it is latched, it stays so. A cut link
                // or a stuck answer shows only after it has started.
                Some(_) if mode == Mode::Init && kind == FaultKind::Jump => {
                    // It jumps before it has answered a setpoint: that is where it is begun with.
                    assert_eq!((after.mode, after.fault), (Mode::Hold, Fault::None), "{name}");
                }
                Some(_)
                    if mode == Mode::Init
                        && !matches!(kind, FaultKind::Link | FaultKind::Stuck) =>
                {
                    assert_eq!(after.mode, Mode::Init, "{name}");
                }
                _ if mode == Mode::Fault => assert_eq!(after.mode, Mode::Fault, "{name}"),
                Some(fault) => {
                    assert_eq!((after.mode, after.fault), (Mode::Fault, fault), "{name}")
                }
                None => assert_ne!(after.mode, Mode::Fault, "{name} in {mode}: {}", after.fault),
            }
            assert!(matches!(story.len(), 0 | 2 | 3), "{name} in {mode}: {story:?}");

            // Whatever happened: no violation at the endpoint, and a system that can be used again.
            let verdict = system.endpoint.judge().verdict().clone();
            assert_eq!(verdict.total(), 0, "{name} in {mode}: {:?}", verdict.first);
            recovers(&mut system, name, mode);
        }
    }
}

/// Once the fault is over, the arm is reset and sweeps on.
fn recovers(system: &mut Loopback, name: &str, mode: Mode) {
    system.run(3000);
    for order in [Order::Resume, Order::Stop, Order::Reset] {
        system.order(order);
        system.run(1500);
    }
    let after = system.snapshot();
    assert_eq!(after.mode, Mode::Hold, "after {name} in {mode}: {}", after.fault);
    let from = system.commanded();
    let sketch = Sketch::through(&system.arm, &[from, swung(&system.arm, &from, 0.1), from], 0.1);
    let plan = match system.publish(&sketch) {
        Ok(plan) => plan,
        Err(why) => panic!("after {name} in {mode}: {why}"),
    };
    system.run((sketch.seconds() * 1e3) as u32 + 1000);
    let last = system.story(plan).last().copied().expect("events");
    assert_eq!(last.kind, EventKind::Finished, "after {name} in {mode}: {last:?}");
    let verdict = system.endpoint.judge().verdict();
    assert_eq!(verdict.total(), 0, "after {name} in {mode}: {:?}", verdict.first);
}

#[test]
fn every_fault_in_every_mode_with_a_servo() {
    matrix(Fidelity::Servo);
}

#[test]
fn every_fault_in_every_mode_with_a_mechanism() {
    matrix(Fidelity::Mechanism);
}

/// A process that no longer reads, but goes on sending states: the arm stands while the setpoints
/// move on, and the states tell whatever. No plan is finished, and when the process reads again it
/// is not commanded away in one cycle.
#[test]
fn an_endpoint_that_reads_no_more_finishes_nothing_and_is_not_jerked() {
    for fidelity in [Fidelity::Servo, Fidelity::Mechanism] {
        for lie in [FaultKind::Unanswered, FaultKind::Stuck, FaultKind::Ahead] {
            let (mut system, plan) = in_mode(Mode::Executing, fidelity);
            let now = system.now_ns();
            for kind in [FaultKind::Deaf, lie] {
                system.endpoint.play(kind, Some(Duration::from_secs(3)), now);
            }
            let name = format!("{} with a {fidelity:?}", lie.name());
            system.run(2990);
            let story = system.story(plan.expect("it executes"));
            let end = story.last().map(|e| e.kind);
            assert_eq!(end, Some(EventKind::Aborted), "{name}: {story:?}");
            let after = system.snapshot();
            assert_eq!((after.mode, after.fault), (Mode::Fault, Fault::Answer), "{name}");
            let (commanded, there) = (system.commanded(), *system.endpoint.positions());
            for j in 0..system.arm.dof() {
                let apart = (commanded[j] - there[j]).abs();
                assert!(apart < 0.02, "{name}: joint {j} is commanded {apart} away");
            }
            recovers(&mut system, &name, Mode::Executing);
        }
    }
}

/// An endpoint that keeps its angles within a turn, on a way through ±π and from there on.
#[test]
fn an_arm_that_wraps_its_angles_sweeps_through_half_a_turn() {
    for fidelity in [Fidelity::Servo, Fidelity::Mechanism] {
        let arm = right_arm();
        let behaviour = Behaviour { fidelity, wrap: true, ..Behaviour::default() };
        let mut system = Loopback::new(&arm, behaviour).expect("a PR2 arm");
        system.run(10);
        let wrist = arm.dof() - 1;
        assert!(arm.limits()[wrist].continuous);
        for by in [4.0, -8.0] {
            let from = system.commanded();
            let mut to = from;
            to[wrist] += by;
            let sketch = Sketch::through(&arm, &[from, to], 0.3);
            let plan = system.publish(&sketch).expect("a sound plan");
            system.run((sketch.seconds() * 1e3) as u32 + 1500);
            let story = system.story(plan);
            let end = story.last().map(|e| e.kind);
            assert_eq!(end, Some(EventKind::Finished), "{fidelity:?} by {by}: {story:?}");
            assert!((system.endpoint.positions()[wrist] - to[wrist]).abs() < 0.02);
        }
        let verdict = system.endpoint.judge().verdict();
        assert_eq!(verdict.total(), 0, "{fidelity:?}: {:?}", verdict.first);
    }
}

#[test]
fn a_weight_does_not_sink_while_a_past_halt_is_latched() {
    let arm = right_arm();
    let behaviour =
        Behaviour { fidelity: Fidelity::Mechanism, payload: 2.0, ..Behaviour::default() };
    let mut system = Loopback::new(&arm, behaviour).expect("a PR2 arm");
    system.run(3000);
    let now = system.now_ns();
    system.endpoint.play(FaultKind::Halt, Some(Duration::from_millis(200)), now);
    system.run(400);
    assert_eq!(system.snapshot().mode, Mode::Fault);
    let before = *system.endpoint.positions();
    system.run(5000);
    let after = *system.endpoint.positions();
    // The motors are on again: what the arm sank by when they were off is all it may sink.
    assert!((after[1] - before[1]).abs() < 0.01, "it sank by {} rad", after[1] - before[1]);
}

/// The endpoint dies and comes back with an arm that stands elsewhere, soon or late: it is met where
/// the arm is, follows again, and nothing jumps.
#[test]
fn a_restarted_endpoint_is_met_where_its_arm_stands() {
    for fidelity in [Fidelity::Servo, Fidelity::Mechanism] {
        for &mode in Mode::ALL {
            for (silent, off) in [(5, 0.0), (5, 0.01), (50, 0.05), (400, 0.05), (400, 0.3)] {
                let (mut system, plan) = in_mode(mode, fidelity);
                let now = system.now_ns();
                system.endpoint.play(FaultKind::Stale, None, now);
                system.run(silent);
                let mut at = *system.endpoint.positions();
                at[0] += off;
                at[3] -= off;
                let behaviour = Behaviour { fidelity, ..Behaviour::default() };
                let now = system.now_ns();
                system.endpoint =
                    Endpoint::new(&system.arm, at, behaviour, now).expect("a PR2 arm");
                system.run(800);
                let name = format!("{silent} ms of silence, {off} rad");
                let commanded = system.commanded();
                let there = *system.endpoint.positions();
                for j in 0..system.arm.dof() {
                    let apart = (commanded[j] - there[j]).abs();
                    assert!(apart < 0.05, "{name} in {mode}: joint {j} is {apart} off");
                }
                assert!(!system.endpoint.is_timed_out(), "{name} in {mode}: it follows again");
                let story = plan.map_or_else(Vec::new, |p| system.story(p));
                let ends = story.iter().filter(|e| e.kind == EventKind::Aborted).count();
                assert!(ends <= 1, "{name} in {mode}: {story:?}");
                recovers(&mut system, &name, mode);
            }
        }
    }
}
