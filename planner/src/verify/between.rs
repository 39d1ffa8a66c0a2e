//! Two arms that go along their plans at once, against each other.

use nullsweep_collision::{Exact, ExactArms};
use rayon::prelude::*;

use super::gate::{Given, VerifyError, arm_of};
use super::violation::{Violation, ViolationKind};
use crate::plan::{Plan, TrajectoryCursor};

/// Joints of neither arm move farther than this between two looks. \[rad\] or \[m\]
const STEP: f64 = 0.01;
/// So many looks are taken in one go.
const STRETCH: usize = 256;

/// Where the two of them come too near to each other, both plans begun at the same time and each arm
/// resting after its end; a violation's knot is the first plan's. Each plan by itself is
/// [`verify`](super::verify)'s.
///
/// # Errors
/// A plan is of another robot, the two are not of one place, or the collision check cannot be built.
pub fn between(
    plans: [&Plan; 2],
    given: [Given<'_>; 2],
) -> Result<(Vec<Violation>, usize), VerifyError> {
    of_one_place(plans)?;
    for plan in plans {
        plan.check_bounds()?;
        if plan.knots.len() < 2 {
            return Err(VerifyError::NoMotion);
        }
    }
    let exact = |arm: usize| {
        let (plan, Given { robot, collision, .. }) = (plans[arm], given[arm]);
        let nothing: &[nalgebra::Point3<f64>] = &[];
        let arm = arm_of(plan, given[arm])?;
        Ok::<_, VerifyError>(Exact::new(robot, &arm, &plan.tool, nothing, &[], collision)?)
    };
    let [first, second] = [exact(0)?, exact(1)?];
    let arms = ExactArms::new(&first, &second);
    let times = times(plans);
    let found: Vec<Vec<Violation>> = times
        .par_chunks(STRETCH)
        .map(|times| {
            let mut cursors = plans.map(|plan| TrajectoryCursor::new(plan.trajectory()));
            let mut found: Vec<Violation> = Vec::new();
            for &time_ns in times {
                let [(knot, one), (_, other)] = cursors.each_mut().map(|cursor| cursor.at(time_ns));
                if let Some(hit) = arms.first_hit([&one, &other])
                    && found.last().is_none_or(|last| last.knot != knot)
                {
                    let detail = format!("{hit}, {:.3} s after both began", time_ns as f64 * 1e-9);
                    found.push(Violation { knot, kind: ViolationKind::Collision, detail });
                }
            }
            found
        })
        .collect();
    Ok((found.into_iter().flatten().collect(), times.len()))
}

/// When it is looked: at every knot of both, and between two of them as often as either's joints ask.
/// \[ns\]
fn times(plans: [&Plan; 2]) -> Vec<u64> {
    let mut knots: Vec<u64> =
        plans.iter().flat_map(|plan| plan.knots.iter().map(|knot| knot.time_ns)).collect();
    knots.sort_unstable();
    knots.dedup();
    let mut times = vec![0];
    let mut at = [1, 1];
    for pair in knots.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        let mut steps = 1;
        for (plan, k) in plans.iter().zip(&mut at) {
            while *k < plan.knots.len() && plan.knots[*k].time_ns <= from {
                *k += 1;
            }
            if *k < plan.knots.len() {
                let curve = plan.curve(*k);
                let share = (to - from) as f64 * 1e-9 / curve.seconds();
                steps = steps.max((curve.reach() * share / STEP).ceil() as u64);
            }
        }
        times.extend((1..=steps).map(|step| from + (to - from) * step / steps));
    }
    times
}

/// Whether both are of the same stance, with what is outside both arms in the same places.
fn of_one_place([first, second]: [&Plan; 2]) -> Result<(), VerifyError> {
    if first.base != second.base || first.base_height != second.base_height {
        return Err(VerifyError::OtherPlace { what: "base".into() });
    }
    for held in &first.held {
        let other = second.held.iter().find(|other| other.name == held.name);
        if other.is_some_and(|other| other.position != held.position) {
            return Err(VerifyError::OtherPlace { what: held.name.clone() });
        }
    }
    Ok(())
}
