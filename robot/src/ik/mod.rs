//! Inverse kinematics behind one trait.

mod analytic;
mod closed;
mod folds;
mod lanes;
mod numeric;
mod pan;
mod roll;
mod shape;
mod six;
mod subproblem;

use std::f64::consts::PI;
use std::sync::Arc;

use nalgebra::Isometry3;

use crate::chain::Chain;
use crate::limits::JointLimits;
use crate::{JointVector, MAX_DOF};
use analytic::Analytic;
use closed::ClosedForm;
pub(crate) use numeric::Numeric;
use pan::ShoulderPan;
use roll::UpperArmRoll;
use shape::Pr2Shape;

/// Names one family of solutions that changes continuously with the target.
///
/// Following one branch with [`InverseKinematics::solve_on`] never changes over to another posture:
/// the branch ends (`None`) where it leaves the reachable space. Where two branches meet (a fold)
/// a joint path may go over from one to the other, while each branch turns back; and near a
/// singularity joints move fast however little the target moves. So whoever follows a branch
/// compares neighbouring solutions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Branch(pub u8);

/// Joint positions that put the tip at a target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// Joint positions in chain order.
    pub q: JointVector,
    /// The family that the solution belongs to.
    pub branch: Branch,
    /// Position of the redundant joint; 0 without redundancy. \[rad\]
    pub redundancy: f64,
}

/// All solutions of one call.
pub type Solutions = heapless::Vec<Solution, 32>;

/// Finds joint positions for a pose of the tip.
pub trait InverseKinematics: Send + Sync {
    /// Range of the redundant joint inside the margined limits \[rad\]; ±π for a continuous one;
    /// `None` for an arm without redundancy.
    fn redundancy_range(&self) -> Option<(f64, f64)>;

    /// Index in the chain of the joint that is the redundancy.
    fn redundant_joint(&self) -> Option<usize>;

    /// All solutions for a pose of the tip in the root frame at one value of the redundancy.
    ///
    /// `out` is cleared first. Joints with limits take the value nearest to the middle of their
    /// range, continuous joints one in (−π, π]. The closed form of the PR2's shape does not filter
    /// by limits; the other solvers give only solutions inside the margined ones.
    fn solve(&self, target: &Isometry3<f64>, redundancy: f64, out: &mut Solutions);

    /// The solution on one branch, continuous joints unwrapped nearest to `near`.
    fn solve_on(
        &self,
        branch: Branch,
        target: &Isometry3<f64>,
        redundancy: f64,
        near: &JointVector,
    ) -> Option<Solution>;
}

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

    pub(crate) fn is_pr2_shaped(&self) -> bool {
        matches!(self, Self::Pr2 { .. })
    }
}

/// The k-th joint vector of a sequence that fills the ranges evenly; joints without an end take
/// −π … π.
pub(crate) fn spread_over(ranges: &[(f64, f64)], k: usize) -> JointVector {
    let mut q = [0.0; MAX_DOF];
    for (i, &(lower, upper)) in ranges.iter().enumerate() {
        let (lower, upper) = if lower.is_finite() { (lower, upper) } else { (-PI, PI) };
        q[i] = lower + (upper - lower) * folds::spread(k, i);
    }
    JointVector::new(q)
}
