//! The bounds within which a plan can be gone through: whatever its file says, that ends.

use nullsweep_ipc_types::Knot;

use super::error::PlanError;
use super::file::Plan;
use super::trajectory::Trajectory;

/// The most that the farthest joints of all segments move in all, with what was followed before:
/// nine hours at 3 rad/s. \[rad\] or \[m\]
const MOST: f64 = 1e5;

/// The greatest number: with no greater ones nothing that is made of them overflows.
const GREATEST: f64 = 1e15;

impl Plan {
    /// Whether the plan, and what was followed before it, can be gone through: finite numbers, times
    /// that rise, and no farther than the executor takes it. Limits are another matter.
    ///
    /// # Errors
    /// [`PlanError::NotFinite`], [`PlanError::TimeOrder`] and [`PlanError::TooFar`].
    pub fn check_bounds(&self) -> Result<(), PlanError> {
        let mut moved = bounded(self.trajectory(), "")?;
        for stretch in &self.past {
            moved += bounded(stretch.trajectory(), " of what was followed before")?;
        }
        if moved <= MOST { Ok(()) } else { Err(PlanError::TooFar { moved, most: MOST }) }
    }
}

/// How far the farthest joints move, segment by segment. \[rad\] or \[m\]
fn bounded(path: Trajectory<'_>, of: &'static str) -> Result<f64, PlanError> {
    let mut moved = 0.0;
    for (knot, here) in path.knots.iter().enumerate() {
        let numbers = || here.q.iter().chain(&here.v).chain(here.line.iter().flatten());
        if let Some(&value) = numbers().find(|x| !(-GREATEST..=GREATEST).contains(*x)) {
            return Err(PlanError::NotFinite { knot, of, value });
        }
        let before = knot.checked_sub(1).map(|k| path.knots[k].time_ns);
        let time_ns = here.time_ns;
        if before.is_some_and(|before| time_ns <= before) || time_ns > Knot::LATEST_NS {
            let before = before.unwrap_or(0);
            return Err(PlanError::TimeOrder { knot, of, time_ns, before });
        }
        if knot > 0 {
            moved += path.curve(knot).reach();
        }
    }
    Ok(moved)
}

#[cfg(test)]
mod tests {
    use nullsweep_robot::{ArmSpec, JointVector, Robot, Side, Tool};

    use super::*;
    use crate::plan::{PlanKnot, Profile};

    fn plan() -> Plan {
        let robot = Robot::pr2();
        let arm = robot.arm(&ArmSpec::pr2(Side::Right)).expect("an arm");
        let knots = (0..3).map(|k| PlanKnot {
            time_ns: 1_000_000_000 * k,
            q: JointVector::new([0.1 * k as f64; 8]),
            v: JointVector::ZERO,
            line: Some([0.1, 0.2, 0.3]),
            patch: None,
        });
        Plan::of(&robot, &arm, &Tool::default(), knots.collect())
    }

    type Spoil = fn(&mut [PlanKnot]);

    /// Each spoils a path of three knots.
    const SPOILT: [(&str, Spoil); 9] = [
        ("knot 1", |k| k[1].q[2] = f64::NAN),
        ("knot 2", |k| k[2].v[0] = f64::INFINITY),
        ("knot 0", |k| k[0].line = Some([0.0, f64::NEG_INFINITY, 0.0])),
        ("does not come after 1000000000 ns", |k| k[2].time_ns = 5),
        ("does not come after 2000000000 ns", |k| k[1].time_ns = 2_000_000_000),
        (": time 18446744073709551615 ns", |k| k[2].time_ns = u64::MAX),
        ("100000 rad are gone through", |k| k[1].q[4] = 1e12),
        ("knot 2", |k| k[2].q[0] = -1e300),
        ("knot 1", |k| k[1].v[0] = f64::MAX),
    ];

    #[test]
    fn what_never_ends_is_refused() {
        let sound = plan();
        assert!(sound.check_bounds().is_ok());
        for (says, spoil) in SPOILT {
            let mut own = sound.clone();
            spoil(&mut own.knots);
            let mut past = sound.clone();
            past.past = sound.followed(2);
            assert!(past.check_bounds().is_ok());
            spoil(&mut past.past[0].knots);
            past.past[0].profile = Profile::Acceleration;
            for plan in [own, past] {
                let said = plan.check_bounds().expect_err(says).to_string();
                assert!(said.contains(says), "{says}: {said}");
            }
        }
    }
}
