//! Wrong plans: each is rejected with its reason, and the running plan goes on.

use nullsweep_collision::Margins;
use nullsweep_executor::Guard;
use nullsweep_ipc_types::ports::{Ipc, IpcError};
use nullsweep_ipc_types::{EventKind, JoinRule, PlanHeader, PlanId, PlanMessage, Reason, checksum};
use nullsweep_robot::{ArmSpec, Robot, Side};
use nullsweep_tests::sketch::{Sketch, swung};
use nullsweep_tests::stage::Part;
use nullsweep_tests::witness::PATIENCE;

use crate::common::{right_arm, stage};
use crate::rig::{Rig, describe};

/// What makes a sound plan wrong.
type Spoil<'a> = &'a dyn Fn(&mut Sketch);

#[test]
fn wrong_plans_are_rejected_and_the_running_one_goes_on() {
    let mut rig = Rig::start();
    let running = rig.swings(20.0);
    let plan = rig.run(&running);
    let knot = rig.witness.see("motion", |t| t.plan == plan).expect("it moves").knot;
    let ahead = knot + 200;
    let sound = joining(&rig, &running, plan, ahead);
    let passed = joining(&rig, &running, plan, 0);
    let left = Robot::pr2().arm(&ArmSpec::pr2(Side::Left)).expect("the PR2 has a left arm");
    let torso = rig.arm.held_joints().iter().position(|h| h.name == "torso_lift_joint");
    let torso = torso.expect("the torso is held");

    let wrong: [(&str, Reason, Spoil<'_>); 11] = [
        ("made for the left arm", Reason::Robot, &|s| s.header.fingerprint = left.fingerprint()),
        ("another joint count", Reason::Robot, &|s| s.header.joint_count = 6),
        ("another torso height", Reason::HeldJoint, &|s| s.header.held_positions[torso] += 0.003),
        ("not a number", Reason::NotFinite, &|s| s.knots[1].positions[3] = f64::NAN),
        ("time stands still", Reason::TimeOrder, &|s| {
            s.knots[2].time_from_start_ns = s.knots[1].time_from_start_ns;
        }),
        ("time does not start at 0", Reason::TimeOrder, &|s| s.knots[0].time_from_start_ns = 1),
        ("outside the soft limits", Reason::SoftLimit, &|s| {
            for (k, knot) in s.knots.iter_mut().enumerate().skip(1) {
                knot.positions[1] += 0.004 * k as f64;
                knot.time_from_start_ns *= 20;
            }
            let last = s.knots.last_mut().expect("knots");
            last.positions[1] = 1.3;
            last.time_from_start_ns += 20_000_000_000;
        }),
        ("too fast", Reason::Velocity, &|s| {
            for knot in &mut s.knots {
                knot.time_from_start_ns /= 20;
            }
        }),
        ("joins a knot that has passed", Reason::JoinKnot, &|s| *s = passed.clone()),
        ("joins a plan that does not run", Reason::JoinPlan, &|s| s.header.join_plan.epoch ^= 1),
        ("starts elsewhere than its knot", Reason::Start, &|s| s.knots[0].positions[0] += 0.03),
    ];
    for (what, reason, spoil) in wrong {
        let mut sketch = sound.clone();
        spoil(&mut sketch);
        let id = rig.publish(&sketch);
        let answer = rig.witness.admission(id).expect("an answer");
        assert_eq!(answer.kind, EventKind::Rejected.wire(), "{what}: {}", describe(&answer));
        assert_eq!(answer.reason, reason.wire(), "{what}: {}", describe(&answer));
    }

    // A flipped bit after sealing.
    let header = PlanHeader { id: PlanId { epoch: plan.epoch + 1, number: 77 }, ..sound.header };
    let seal = checksum(PlanMessage { header: &header, knots: &sound.knots });
    let broken = PlanHeader { checksum: seal ^ 1, ..header };
    rig.publisher.publish_raw(&broken, &sound.knots).expect("an executor is there");
    let answer = rig.witness.admission(broken.id).expect("an answer");
    assert_eq!(answer.reason, Reason::Checksum.wire(), "{}", describe(&answer));

    // The sound one proves that the others failed for what was spoilt, and ends the motion.
    let still = rig.witness.see("motion", |_| true).expect("telemetry");
    assert_eq!(still.plan, plan, "the running plan goes on");
    assert!(still.knot < ahead, "the machine is too slow for this test's knot to be ahead");
    let joined = rig.run(&sound);
    rig.ends(plan, EventKind::Superseded);
    rig.ends(joined, EventKind::Finished);
    rig.verdict();
}

/// A torso that is off, and moves as far again, moves the arm by less than plans keep it clear.
#[test]
fn what_a_held_joint_may_be_off_is_less_than_what_is_verified() {
    let kept = Margins::default();
    let kept = kept.environment.min(kept.self_clearance);
    let drift = Guard::new(right_arm().limits()).held_drift;
    assert!(Guard::HELD_TOLERANCE + drift < kept, "{drift} m against {kept} m");
}

#[test]
fn a_plan_that_starts_elsewhere_is_rejected_in_hold() {
    let mut rig = Rig::start();
    let away = swung(&rig.arm, &rig.arm.home(), 0.05);
    let sketch = Sketch::through(&rig.arm, &[away, rig.arm.home()], 0.1);
    let plan = rig.publish(&sketch);
    let answer = rig.witness.admission(plan).expect("an answer");
    assert_eq!(answer.kind, EventKind::Rejected.wire(), "{}", describe(&answer));
    assert_eq!(answer.reason, Reason::Start.wire(), "{}", describe(&answer));
    rig.verdict();
}

#[test]
fn a_publish_without_an_executor_says_so() {
    let stage = stage();
    let ipc = Ipc::open(stage.robot(), Some(&stage.root())).expect("the test's own ports");
    let arm = right_arm();
    let sketch = Sketch::swings(&arm, &arm.home(), 1, 0.1, 0.1);
    let mut publisher = ipc.plan_publisher(sketch.knots.len()).expect("the test can publish");
    let error = publisher.publish(&sketch.header, &sketch.knots).expect_err("nobody is there");
    assert!(matches!(error, IpcError::NoExecutor { .. }), "{error}");

    let mut process = stage.start(Part::Sketch, "sketch", stage.place()).expect("it starts");
    let status = process.wait(PATIENCE).expect("known").expect("it does not wait for ever");
    assert!(!status.success());
    assert!(process.stderr().contains("no executor is running"), "{}", process.stderr());
}

/// A sound plan that joins `knot` of the running one.
fn joining(rig: &Rig, running: &Sketch, plan: PlanId, knot: u32) -> Sketch {
    let from = running.posture(knot as usize);
    let to = swung(&rig.arm, &rig.arm.home(), 0.2);
    let sketch = Sketch::through(&rig.arm, &[from, to, from], 0.1).at_knot(plan, knot);
    assert_eq!(sketch.header.join_rule, JoinRule::AtKnot.wire());
    sketch
}
