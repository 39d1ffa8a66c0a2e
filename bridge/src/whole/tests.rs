//! Which plans a controller is given, and when.

use bytemuck::Zeroable;
use nullsweep_ipc_types::{JoinRule, MAX_HELD_JOINTS, PlanHeader, PlanMessage, checksum};
use nullsweep_robot::{ArmSpec, Robot, Side};

use super::*;

const MS: u64 = 1_000_000;
const NOW: u64 = 5_000 * MS;
const HOME: [f64; 7] = [-0.5, 0.3, -1.0, -1.2, 0.4, -1.0, 0.2];

fn guard() -> Guard {
    Guard::new(Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).expect("an arm").limits())
}

fn home(by: f64) -> JointVector {
    JointVector::from_fn(|j| HOME.get(j).map_or(0.0, |q| if j == 0 { q + by } else { *q }))
}

fn id(number: u64) -> PlanId {
    PlanId { epoch: 1000, number }
}

/// Joint 0 at these times [ms], places beside home [rad] and velocities [rad/s].
fn plan(
    number: u64,
    joins: Option<usize>,
    points: &[(u64, f64, f64)],
    edit: impl FnOnce(&mut PlanHeader),
) -> ValidPlan {
    let knots: Vec<Knot> = points
        .iter()
        .map(|&(ms, by, v)| {
            let mut knot = Knot { time_from_start_ns: ms * MS, ..Knot::zeroed() };
            knot.positions[..7].copy_from_slice(&home(by)[..7]);
            knot.velocities[0] = v;
            knot
        })
        .collect();
    let mut header = PlanHeader {
        id: id(number),
        fingerprint: 7,
        joint_count: 7,
        knot_count: knots.len() as u32,
        interpolation: Interpolation::Cubic.wire(),
        ..PlanHeader::default()
    };
    if let Some(knot) = joins {
        header.join_rule = JoinRule::AtKnot.wire();
        (header.join_plan, header.join_knot) = (id(1), knot as u32);
    }
    edit(&mut header);
    header.checksum = checksum(PlanMessage { header: &header, knots: &knots });
    let rules = Rules {
        guard: guard(),
        fingerprint: 7,
        held_continuous: Vec::new(),
        held_tolerance: Guard::HELD_TOLERANCE,
        since_ns: 100,
    };
    let held = Held { positions: [0.0; MAX_HELD_JOINTS], count: 0 };
    admit(&header, &knots, Some(&held), &rules, NOW).expect("a plan")
}

/// There in four seconds, at 0.1 rad/s half-way.
fn running() -> ValidPlan {
    plan(1, None, &[(0, 0.0, 0.0), (2000, 0.1, 0.1), (4000, 0.2, 0.0)], |_| {})
}

fn judge(plan: &ValidPlan, running: Option<(&ValidPlan, u64)>, by: f64) -> Result<u64, Reason> {
    fit(plan, running, &home(by), &guard(), NOW).map_err(|why| why.reason)
}

#[test]
fn a_plan_begins_where_the_arm_is() {
    let plan = running();
    assert_eq!(judge(&plan, None, 0.01), Ok(NOW + AHEAD_NS + CONNECT_NS));
    assert_eq!(judge(&plan, None, 0.03), Err(Reason::Start));
    // A controller stops on no path and keeps nothing for later.
    assert_eq!(judge(&plan, Some((&plan, NOW)), 0.0), Err(Reason::QueueFull));
}

/// One that is under way in its first knot does not begin from a stand-still: the controller would
/// go there by a jump.
#[test]
fn a_plan_that_begins_at_speed_needs_one_that_brings_it_there() {
    let moving = [(0, 0.1, 0.1), (2000, 0.2, 0.0)];
    let alone = plan(2, None, &moving, |_| {});
    assert_eq!(judge(&alone, None, 0.1), Err(Reason::Speed));
    let line = |h: &mut PlanHeader| {
        h.interpolation = Interpolation::Linear.wire();
        h.corners = 0;
    };
    // So do straight segments without leave for corners: 0.1 rad in 40 s are slow enough.
    let slow = plan(3, None, &[(0, 0.0, 0.0), (40_000, 0.1, 0.0)], line);
    assert!(judge(&slow, None, 0.0).is_ok());
    let runs = running();
    let start = NOW - 1000 * MS;
    let joins = |knot, points: &[(u64, f64, f64)]| {
        judge(&plan(4, Some(knot), points, |_| {}), Some((&runs, start)), 0.0)
    };
    assert_eq!(joins(1, &moving), Ok(start + 2000 * MS));
    // It is there at another speed, elsewhere, or too late.
    assert_eq!(joins(1, &[(0, 0.1, 0.0), (2000, 0.2, 0.0)]), Err(Reason::Speed));
    assert_eq!(joins(1, &[(0, 0.1, -0.1), (2000, 0.1, 0.0)]), Err(Reason::Speed));
    assert_eq!(joins(1, &[(0, 0.11, 0.1), (2000, 0.2, 0.0)]), Err(Reason::Start));
    assert_eq!(joins(0, &[(0, 0.0, 0.0), (2000, 0.2, 0.0)]), Err(Reason::JoinKnot));
    assert_eq!(joins(7, &moving), Err(Reason::JoinKnot));
    let after = plan(5, Some(1), &moving, |_| {});
    assert_eq!(judge(&after, None, 0.0), Err(Reason::JoinPlan));
}

fn given(plan: ValidPlan, start_ns: u64) -> Running {
    let goal = Goal { id: String::new(), start_ns, until_ns: 0, points: Vec::new(), curved: true };
    Running { plan, goal, start_ns, started: true, ended_ns: None, there_ns: None }
}

/// A controller's word is no measurement: a plan is finished once the arm has been at its end for a
/// while, and not at all where it does not come there.
#[test]
fn a_plan_is_finished_where_the_arm_is_measured() {
    let guard = guard();
    let mut running = given(running(), NOW);
    let end = home(0.2);
    let mut at = |by: f64, ms: u64, said: bool| {
        running.ended_ns = said.then_some(NOW + 4000 * MS);
        let measured = JointVector::from_fn(|j| end[j] + if j == 0 { by } else { 0.0 });
        running.judge(Some(&measured), &guard, NOW + ms * MS).map(|why| (why.reason, why.joint))
    };
    // There, and the controller is not done; said, and still on its way.
    assert_eq!(at(0.0, 3990, false), None);
    assert_eq!(at(0.05, 4000, true), None);
    assert_eq!(at(0.01, 4200, true), None);
    assert_eq!(at(0.03, 4230, true), None);
    assert_eq!(at(0.01, 4300, true), None);
    assert_eq!(at(0.01, 4349, true), None);
    assert_eq!(at(0.01, 4350, true), Some((Reason::None, u32::MAX)));
    assert_eq!(at(0.03, 4999, true), None);
    assert_eq!(at(0.03, 5000, true), Some((Reason::Goal, 0)));
    assert_eq!(at(f64::NAN, 5000, true), Some((Reason::Goal, 0)));
    assert!(running.judge(None, &guard, NOW + 4000 * MS).is_some());
}

/// Until the splice the arm moves on the old plan.
#[test]
fn what_the_arm_is_on_is_told_until_the_splice() {
    let (old, new) = (
        given(running(), NOW),
        given(plan(2, None, &[(0, 0.1, 0.0), (900, 0.1, 0.0)], |_| {}), NOW + 2000 * MS),
    );
    let on = |before, ms| moving(Some(&new), before, NOW + ms * MS).map(|r| r.plan.id().number);
    assert_eq!([1999, 2000].map(|ms| on(Some(&old), ms)), [Some(1), Some(2)]);
    assert_eq!([1999, 2000].map(|ms| on(None, ms)), [None, Some(2)]);
}
