//! Inverse kinematics behind one trait.

mod analytic;
mod closed;
mod damped;
mod folds;
mod numeric;
mod pan;
mod real;
mod redundancy;
mod roll;
mod shape;
mod six;
mod solution;
mod spread;
mod subproblem;

use std::sync::Arc;

use crate::chain::Chain;
use crate::limits::JointLimits;
use analytic::Analytic;
use closed::ClosedForm;
pub use damped::{damped_step, pose_error};
pub(crate) use numeric::Numeric;
use pan::ShoulderPan;
use roll::UpperArmRoll;
use shape::Pr2Shape;
pub use solution::{Branch, InverseKinematics, Solution, Solutions};
pub(crate) use spread::spread_over;

/// Which joint of a PR2-shaped arm is the redundancy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RedundantJoint {
    /// The third joint, the default: eight solutions at most, two inside the PR2's limits.
    UpperArmRoll,
    /// The first joint: eight solutions at most, two inside the PR2's limits. Its branches end
    /// elsewhere than those of the roll.
    ShoulderPan,
}

/// The solvers that fit an arm.
#[derive(Clone)]
pub(crate) enum Solvers {
    Pr2 { roll: Arc<ClosedForm<UpperArmRoll>>, pan: Arc<ClosedForm<ShoulderPan>> },
    Analytic(Arc<Analytic>),
    Numeric(Arc<Numeric>),
}

impl Solvers {
    pub(crate) fn new(chain: &Chain, limits: &[JointLimits], margined: &[(f64, f64)]) -> Self {
        let Some(shape) = Pr2Shape::recognise(chain, limits) else {
            return match Analytic::recognise(chain, limits, margined) {
                Some(analytic) => Self::Analytic(Arc::new(analytic)),
                None => Self::Numeric(Arc::new(Numeric::new(chain, limits, margined))),
            };
        };
        let (roll, pan) = (UpperArmRoll::new(&shape), ShoulderPan::new(&shape));
        Self::Pr2 {
            roll: Arc::new(ClosedForm::new(shape.clone(), margined, roll)),
            pan: Arc::new(ClosedForm::new(shape, margined, pan)),
        }
    }

    pub(crate) fn default(&self) -> &dyn InverseKinematics {
        match self {
            Self::Pr2 { roll, .. } => roll.as_ref(),
            Self::Analytic(analytic) => analytic.as_ref(),
            Self::Numeric(numeric) => numeric.as_ref(),
        }
    }

    pub(crate) fn by(&self, joint: RedundantJoint) -> Option<&dyn InverseKinematics> {
        match (self, joint) {
            (Self::Pr2 { roll, .. }, RedundantJoint::UpperArmRoll) => Some(roll.as_ref()),
            (Self::Pr2 { pan, .. }, RedundantJoint::ShoulderPan) => Some(pan.as_ref()),
            (Self::Analytic(_) | Self::Numeric(_), _) => None,
        }
    }

    pub(crate) fn is_numeric(&self) -> bool {
        matches!(self, Self::Numeric(_))
    }

    pub(crate) fn is_pr2_shaped(&self) -> bool {
        matches!(self, Self::Pr2 { .. })
    }
}
