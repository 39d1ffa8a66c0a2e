//! Checksums of a plan as it was verified: what tells that it was changed since.

use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::xxh3_64;

use super::error::PlanError;
use super::knot::PlanKnot;

/// Checksums of a plan that passed the last gate. They tell a change, an edit by hand say; they keep
/// out nobody who means to deceive.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Seal {
    /// Of each knot.
    knots: Vec<u32>,
    /// Of all else: robot, held joints, tool, place, surface, past.
    rest: u32,
}

impl Seal {
    /// Of a plan's knots, and of all else of it.
    pub(super) fn new(knots: &[PlanKnot], rest: &impl Serialize) -> Self {
        Self { knots: knots.iter().map(checksum).collect(), rest: checksum(rest) }
    }

    /// Whether what is found now is what was sealed.
    ///
    /// # Errors
    /// [`PlanError::KnotChanged`] or [`PlanError::Changed`].
    pub(super) fn check(&self, found: &Self) -> Result<(), PlanError> {
        let knots = self.knots.len().max(found.knots.len());
        let differs = |k: &usize| self.knots.get(*k) != found.knots.get(*k);
        if let Some(knot) = (0..knots).find(differs) {
            return Err(PlanError::KnotChanged { knot });
        }
        if self.rest == found.rest { Ok(()) } else { Err(PlanError::Changed) }
    }
}

/// Of a value as it is written.
fn checksum<T: Serialize>(value: &T) -> u32 {
    xxh3_64(&serde_json::to_vec(value).unwrap_or_default()) as u32
}

#[cfg(test)]
mod tests {
    use nullsweep_robot::{ArmSpec, JointVector, Robot, Side, Tool};

    use super::*;
    use crate::plan::Plan;

    #[test]
    fn a_change_is_told_by_its_knot() {
        let robot = Robot::pr2();
        let arm = robot.arm(&ArmSpec::pr2(Side::Right)).unwrap();
        let knot = |time_ns| PlanKnot {
            time_ns,
            q: JointVector::default(),
            v: JointVector::default(),
            line: None,
            patch: None,
        };
        let plan = Plan::of(&robot, &arm, &Tool::default(), vec![knot(0), knot(5), knot(9)]);
        assert!(matches!(plan.check_seal(), Err(PlanError::Unverified)));
        let sealed = plan.sealed();
        // As it comes back from its file.
        let text = serde_json::to_string(&sealed).unwrap();
        let read: Plan = serde_json::from_str(&text).unwrap();
        assert!(read.check_seal().is_ok());

        let mut moved = read.clone();
        moved.knots[1].q[3] += 1e-9;
        assert!(matches!(moved.check_seal(), Err(PlanError::KnotChanged { knot: 1 })));
        let mut shorter = read.clone();
        shorter.knots.pop();
        assert!(matches!(shorter.check_seal(), Err(PlanError::KnotChanged { knot: 2 })));
        let mut held = read;
        held.held[0].position += 0.01;
        assert!(matches!(held.check_seal(), Err(PlanError::Changed)));
    }
}
