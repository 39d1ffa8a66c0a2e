//! Ways between postures, and what makes one necessary: a plan runs twice only if the arm comes back.

use nullsweep_collision::Options;
use nullsweep_planner::pipeline::{End, Job, StanceChoice, run};
use nullsweep_planner::plan::{Plan, Profile};
use nullsweep_planner::progress::Silent;
use nullsweep_planner::transit::{self, Place, Transit, TransitError};
use nullsweep_planner::workcell::{Scene, Stance};
use nullsweep_robot::{ArmSpec, JointVector, Robot, Side, Tool};
use nullsweep_surface::{CleanConfig, Placement, place, simulate};

fn stance() -> Stance {
    let held = vec![("torso_lift_joint".to_owned(), 0.2)];
    Stance { base: [-0.708, -0.004, 1.047], height: 0.0, held }
}

/// A part of the seat, the rest of the chair in the way.
fn scene() -> Scene {
    let view = simulate::chair(1);
    let (placed, _) = place(&view.scan, &Placement::SensorPose(view.sensor_pose));
    let part = "-0.15,-0.10,0.35,0.05,0.10,0.60".parse().expect("a box");
    Scene::seen(&placed, Some(&part), &CleanConfig::default()).expect("it is there").0
}

fn seat(end: End, profile: Profile) -> Plan {
    let job = Job {
        stance: StanceChoice::Given(stance()),
        end,
        profile,
        ik_samples: 10,
        refinements: 0,
        ..Job::new(ArmSpec::pr2(Side::Right))
    };
    let outcome = run(&Robot::pr2(), &scene(), &job, &Silent).expect("a plan");
    assert_eq!(outcome.figures.verification.violations, []);
    outcome.plan
}

fn way(from: JointVector, to: JointVector, profile: Profile) -> Result<Plan, TransitError> {
    let job = Transit {
        arm: ArmSpec::pr2(Side::Right),
        tool: Tool::default(),
        stance: stance(),
        from,
        to,
        unwinds: false,
        profile,
        v_max: None,
        collision: Options::default(),
        seed: 1,
    };
    let outcome = transit::run(&Robot::pr2(), &scene(), &job, &Silent)?;
    let room = outcome.clearance;
    assert!(room.arm > 0.0 && room.hand > 0.0, "{room:?}");
    assert!(room.arm.min(room.hand) < transit::FARTHEST, "{room:?}");
    assert_eq!(outcome.verification.violations, []);
    Ok(outcome.plan)
}

/// Whether two joint vectors are the same posture.
fn same(a: &JointVector, b: &JointVector) -> bool {
    let arm = Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).expect("an arm");
    arm.continuous().displacement(a, b).iter().all(|apart| apart.abs() < 1e-9)
}

/// Height of the pad over where the plan last touched the surface. \[m\]
fn lift(plan: &Plan) -> f64 {
    let arm = Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).expect("an arm");
    let arm = stance().bind(&arm).expect("a torso");
    let pad = plan.tool.on(&arm);
    let touched = plan.knots.iter().rev().find(|k| k.line.is_some()).expect("a stop");
    let last = plan.knots.last().expect("knots");
    (pad.centre(&last.q) - pad.centre(&touched.q)).norm()
}

#[test]
fn a_plan_ends_where_it_is_asked_to() {
    let last = |plan: &Plan| plan.knots.last().expect("knots").q;
    let contact = seat(End::Contact, Profile::Velocity);
    assert!(contact.knots.last().expect("knots").line.is_some());
    for profile in [Profile::Velocity, Profile::Acceleration] {
        let lifted = seat(End::Lifted, profile);
        // By 5 cm, or as far as that goes, at the least out of touch.
        assert!((0.01..0.051).contains(&lift(&lifted)), "{}", lift(&lifted));
        assert!(lifted.knots.last().expect("knots").line.is_none());
    }
    let start = seat(End::Start, Profile::Velocity);
    assert!(same(&last(&start), &start.knots[0].q));
    // What is swept, and how, is the same.
    let swept = |plan: &Plan| plan.knots.iter().filter(|k| k.line.is_some()).count();
    assert_eq!(swept(&contact), swept(&start));
}

#[test]
fn the_arm_comes_back_from_the_surface_and_to_it() {
    let plan = seat(End::Contact, Profile::Velocity);
    let (first, last) = (plan.knots[0].q, plan.knots.last().expect("knots").q);
    for profile in [Profile::Velocity, Profile::Acceleration] {
        let back = way(last, first, profile).expect("a way back");
        assert_eq!((back.profile, back.knots[0].q), (profile, last));
        let there = way(first, last, profile).expect("a way there");
        let end = there.knots.last().expect("knots");
        assert!(end.line.is_some(), "it ends on the surface");
        assert!(same(&end.q, &last), "{:?}", end.q);
    }
}

#[test]
fn ends_where_the_arm_may_not_be_are_told() {
    let plan = seat(End::Lifted, Profile::Velocity);
    let (first, last) = (plan.knots[0].q, plan.knots.last().expect("knots").q);
    let fails = |from, to| way(from, to, Profile::Velocity).map(|_| ()).expect_err("no way");
    // Down into the seat by the shoulder.
    let mut deep = plan.knots[plan.knots.len() / 2].q;
    deep[1] += 0.25;
    let hit = fails(first, deep);
    assert!(matches!(hit, TransitError::Hit { place: Place::There, .. }), "{hit}");
    let hit = fails(deep, first);
    assert!(matches!(hit, TransitError::Hit { place: Place::Here, .. }), "{hit}");
    let mut bent = first;
    bent[3] = 1.0;
    let error = fails(last, bent);
    assert!(error.to_string().contains("r_elbow_flex_joint"), "{error}");
}
