//! What is asked of a solver, and what it answers.

use nalgebra::Isometry3;

use crate::JointVector;

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
