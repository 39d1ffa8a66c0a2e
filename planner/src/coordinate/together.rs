//! Two plans of one stance, each with the waits that keep it clear of the other.

use nullsweep_collision::{Arms, Options, World};
use nullsweep_robot::{Arm, ArmSpec, JointVector, Robot};

use super::clock::{Clocked, Wait};
use super::diagram::Diagram;
use super::error::CoordinateError;
use super::least_time::{Move, Room, least_time};
use crate::plan::{Plan, PlanKnot};

/// A step of the clock. \[ns\]
const STEP_NS: u64 = 20_000_000;
/// Most steps of a plan: longer ones go by longer steps.
const MOST_STEPS: u64 = 4096;

/// What counts as the same place. \[rad\] or \[m\]
const SAME: f64 = 1e-6;

/// Two plans on one clock.
#[derive(Clone, Debug)]
pub struct Together {
    /// The plans, with waits. Both begin at the same time; the one that ends first rests then.
    pub plans: [Plan; 2],
    /// How long both take. \[s\]
    pub seconds: f64,
    /// How long each waits before its end. \[s\]
    pub waited: [f64; 2],
}

/// Puts waits into two arms' plans so that both may be gone along at once, in the least time that waits
/// allow; the second one is gone along backwards where that takes less and its order is free. Both are
/// of one stance, and hold the joints outside both arms in the same places. `None` where no way through
/// the coordination diagram is proven free.
///
/// # Errors
/// See [`CoordinateError`].
pub fn coordinate(
    robot: &Robot,
    arms: [&ArmSpec; 2],
    plans: [&Plan; 2],
    collision: &Options,
) -> Result<Option<Together>, CoordinateError> {
    let [first, second] = [arm_of(robot, arms[0], plans[0])?, arm_of(robot, arms[1], plans[1])?];
    let mut moved = first.moving_links().iter();
    if let Some(&link) = moved.find(|link| second.moving_links().contains(link)) {
        return Err(CoordinateError::Shared {
            first: arms[0].to_string(),
            second: arms[1].to_string(),
            link: robot.links()[link].name.clone(),
        });
    }
    let world = |arm: &Arm, plan: &Plan| {
        let nothing: &[nalgebra::Point3<f64>] = &[];
        World::new(robot, arm, &plan.tool, nothing, &[], collision)
    };
    let worlds = [world(&first, plans[0])?, world(&second, plans[1])?];
    let both = Arms::new(&worlds[0], &worlds[1]);
    let longest_s = plans[0].duration().max(plans[1].duration());
    let longer = (longest_s * 1e9 / (MOST_STEPS * STEP_NS) as f64).ceil().max(1.0) as u64;
    let step_ns = STEP_NS * longer;
    let forwards = waited(&both, plans, step_ns);
    let backwards = backwards(plans[1]).and_then(|back| waited(&both, [plans[0], &back], step_ns));
    let found = forwards.into_iter().chain(backwards);
    Ok(found.reduce(|best, next| if next.seconds < best.seconds { next } else { best }))
}

/// The plans as they are, with waits.
fn waited(arms: &Arms<'_>, plans: [&Plan; 2], step_ns: u64) -> Option<Together> {
    let clocked = plans.map(|plan| Clocked::new(plan, step_ns));
    let diagram = Diagram::new(arms, [&clocked[0], &clocked[1]]);
    let may_wait = [&clocked[0].may_wait[..], &clocked[1].may_wait[..]];
    let moves = least_time(&Room { diagram: &diagram, may_wait })?;
    let waits = [
        waits(&moves, Move::First, Move::Second, step_ns),
        waits(&moves, Move::Second, Move::First, step_ns),
    ];
    let plans = [0, 1].map(|arm| clocked[arm].with_waits(&waits[arm]));
    let seconds = plans[0].duration().max(plans[1].duration());
    let sum = |waits: &[Wait]| waits.iter().map(|(_, wait_ns)| *wait_ns as f64 * 1e-9).sum();
    Some(Together { plans, seconds, waited: [sum(&waits[0]), sum(&waits[1])] })
}

/// The plan from its end to its start; `None` where that is another task: regions have an order, and what
/// begins and ends in different places would not begin where the arm is.
fn backwards(plan: &Plan) -> Option<Plan> {
    let (first, last) = (plan.knots.first()?, plan.knots.last()?);
    let is_free = plan.regions.is_empty()
        && plan.continues.is_none()
        && plan.tool.touches()
        && first.q.displacement(&last.q).iter().all(|apart| *apart < SAME);
    let back = |knot: &PlanKnot| PlanKnot {
        time_ns: last.time_ns - knot.time_ns,
        v: JointVector::from_fn(|j| 0.0 - knot.v[j]),
        ..*knot
    };
    let knots = plan.knots.iter().rev().map(back).collect();
    is_free.then(|| Plan { knots, ..plan.clone() })
}

/// Where the arm that moves by `own` waits, and how long; not after its end.
fn waits(moves: &[Move], own: Move, other: Move, step_ns: u64) -> Vec<Wait> {
    let (mut node, mut waits): (u64, Vec<Wait>) = (0, Vec::new());
    let last = moves.iter().rposition(|m| *m != other).map_or(0, |last| last + 1);
    for m in &moves[..last] {
        if *m == own || *m == Move::Both {
            node += 1;
            continue;
        }
        match waits.last_mut() {
            Some((time_ns, wait_ns)) if *time_ns == node * step_ns => *wait_ns += step_ns,
            _ => waits.push((node * step_ns, step_ns)),
        }
    }
    waits
}

/// The arm as the plan has it.
fn arm_of(robot: &Robot, spec: &ArmSpec, plan: &Plan) -> Result<Arm, CoordinateError> {
    let held: Vec<(&str, f64)> = plan.held.iter().map(|h| (h.name.as_str(), h.position)).collect();
    Ok(robot.arm(spec)?.with_held(&held)?)
}
