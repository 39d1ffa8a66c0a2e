//! Two arms of a PR2 that reach before it at once: the waits that keep them clear of each other.

use nullsweep_collision::Options;
use nullsweep_planner::coordinate::{CoordinateError, Together, coordinate};
use nullsweep_planner::plan::{Plan, PlanKnot, Profile};
use nullsweep_planner::verify::{Given, ViolationKind, between, verify};
use nullsweep_planner::workcell::Scene;
use nullsweep_robot::{ArmSpec, JointVector, Robot, Side, Tool};

/// From one turn to the next, no whole steps of any clock. \[ns\]
const PERIOD: u64 = 2_013_456_789;

fn specs() -> [ArmSpec; 2] {
    [ArmSpec::pr2(Side::Right), ArmSpec::pr2(Side::Left)]
}

/// The stretched arm goes by these turns of the shoulder, inwards \[rad\].
fn swing(robot: &Robot, side: Side, profile: Profile, inwards: &[f64]) -> Plan {
    let arm = robot.arm(&ArmSpec::pr2(side)).expect("the PR2's arm");
    let inward = if side == Side::Right { 1.0 } else { -1.0 };
    let knot = |(k, turn): (usize, &f64)| PlanKnot {
        time_ns: PERIOD * k as u64,
        q: JointVector::new([inward * turn, 0.0, 0.0, -0.3, 0.0, -0.3, 0.0, 0.0]),
        v: JointVector::ZERO,
        line: None,
        patch: None,
    };
    let knots = inwards.iter().enumerate().map(knot).collect();
    Plan { profile, ..Plan::of(robot, &arm, &Tool::default(), knots) }
}

fn swings(robot: &Robot, profile: Profile, inwards: &[f64]) -> [Plan; 2] {
    [Side::Right, Side::Left].map(|side| swing(robot, side, profile, inwards))
}

fn hits(robot: &Robot, plans: [&Plan; 2]) -> usize {
    let (specs, scene, collision) = (specs(), Scene::empty(), Options::default());
    let given =
        [0, 1].map(|arm| Given { robot, arm: &specs[arm], scene: &scene, collision: &collision });
    let (violations, looks) = between(plans, given).expect("plans of one place");
    assert!(looks > 50, "{looks}");
    assert!(violations.iter().all(|v| v.kind == ViolationKind::Collision));
    violations.len()
}

fn brought_together(robot: &Robot, plans: &[Plan; 2]) -> Option<Together> {
    let [first, second] = specs();
    coordinate(robot, [&first, &second], [&plans[0], &plans[1]], &Options::default())
        .expect("two arms")
}

/// Out, in before the robot and out again.
const IN_AND_OUT: [f64; 3] = [-0.6, 0.3, -0.6];

#[test]
fn arms_that_would_meet_wait_for_each_other_and_keep_their_paths() {
    let robot = Robot::pr2();
    for profile in [Profile::Velocity, Profile::Acceleration] {
        let plans = swings(&robot, profile, &IN_AND_OUT);
        assert!(hits(&robot, [&plans[0], &plans[1]]) > 0, "they would meet");
        let both = brought_together(&robot, &plans).expect("one after the other is free");
        assert_eq!(hits(&robot, [&both.plans[0], &both.plans[1]]), 0);
        let [longest, one_after_the_other] = [2.0, 4.0].map(|turns| turns * 1e-9 * PERIOD as f64);
        println!("{profile:?}: {:.2} s, waited {:?} s", both.seconds, both.waited);
        assert!(both.seconds > longest && both.seconds < 0.95 * one_after_the_other, "{both:?}");
        assert!(both.waited.iter().any(|waited| *waited > 0.0));
        for ((plan, now), spec) in plans.iter().zip(&both.plans).zip(specs()) {
            // The same joint vectors in the same order, none of them faster.
            let mut found = now.knots.iter();
            let mut before = 0;
            for knot in &plan.knots {
                let at = found.find(|found| found.q == knot.q).expect("each knot is gone through");
                assert!(at.time_ns - before >= if knot.time_ns == 0 { 0 } else { PERIOD });
                before = at.time_ns;
            }
            assert_eq!(now.knots.last().map(|k| k.q), plan.knots.last().map(|k| k.q));
            let (scene, collision) = (Scene::empty(), Options::default());
            let given = Given { robot: &robot, arm: &spec, scene: &scene, collision: &collision };
            let found = verify(now, given, &|| ()).expect("a plan");
            assert!(found.violations.is_empty(), "{:?}", found.violations);
        }
    }
}

#[test]
fn an_arm_with_limited_acceleration_waits_only_where_it_is_at_rest() {
    let robot = Robot::pr2();
    let plans = swings(&robot, Profile::Acceleration, &IN_AND_OUT);
    let both = brought_together(&robot, &plans).expect("one after the other is free");
    for plan in &both.plans {
        for pair in plan.knots.windows(2).filter(|pair| pair[0].q == pair[1].q) {
            assert!(pair.iter().all(|knot| knot.v == JointVector::ZERO), "{pair:?}");
        }
    }
}

#[test]
fn arms_that_do_not_meet_wait_for_nothing() {
    let robot = Robot::pr2();
    let plans = swings(&robot, Profile::Velocity, &[-0.6, -0.2, -0.6]);
    assert_eq!(hits(&robot, [&plans[0], &plans[1]]), 0);
    let both = brought_together(&robot, &plans).expect("free as they are");
    assert_eq!((both.waited, &both.plans), ([0.0; 2], &plans));
}

#[test]
fn no_waits_help_where_the_arms_begin_in_each_others_way() {
    let robot = Robot::pr2();
    let plans = swings(&robot, Profile::Velocity, &[0.3, -0.6]);
    assert!(hits(&robot, [&plans[0], &plans[1]]) > 0);
    assert!(brought_together(&robot, &plans).is_none());
}

#[test]
fn an_arm_is_not_brought_together_with_itself() {
    let robot = Robot::pr2();
    let [right, _] = specs();
    let [plan, _] = swings(&robot, Profile::Velocity, &IN_AND_OUT);
    let error = coordinate(&robot, [&right, &right], [&plan, &plan], &Options::default())
        .expect_err("one arm");
    assert!(matches!(error, CoordinateError::Shared { .. }), "{error}");
}

#[test]
fn the_waits_are_the_same_on_any_number_of_threads() {
    let robot = Robot::pr2();
    let plans = swings(&robot, Profile::Velocity, &IN_AND_OUT);
    let by = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| brought_together(&robot, &plans)).expect("free").plans
    };
    assert_eq!(by(1), by(3));
}
