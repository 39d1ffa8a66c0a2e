//! What a joint motion costs.

use nullsweep_robot::{Arm, JointVector, MAX_DOF};
use serde::{Deserialize, Serialize};

/// The cost of a straight joint motion. Implement it for a cost of your own; every search in
/// this crate is generic over it.
///
/// A cost must be non-negative, zero for no motion and must not fall when a displacement grows,
/// so that the straight line between two ends is a lower bound for every path between them.
pub trait Cost: Send + Sync {
    /// The cost of moving each joint by `displacement` (absolute values, unused lanes 0).
    /// \[rad\] or \[m\] in, the cost's own unit out.
    fn of(&self, displacement: &JointVector) -> f64;
}

/// Manipulation effort: the sum of all joint displacements (Eq. 1). \[rad\]
#[derive(Clone, Copy, Debug)]
pub struct Effort;

impl Cost for Effort {
    #[inline]
    fn of(&self, displacement: &JointVector) -> f64 {
        displacement.iter().sum()
    }
}

/// Time to completion at bounded joint velocities: the slowest joint's time (Eq. 2, with a
/// velocity for each joint). \[s\]
#[derive(Clone, Copy, Debug)]
pub struct TaskTime {
    /// One over each joint's velocity; 0 in unused lanes. \[s/rad\] or \[s/m\]
    seconds_per_unit: JointVector,
}

impl TaskTime {
    /// With the given velocity of each joint. \[rad/s\] or \[m/s\]
    #[must_use]
    pub fn new(velocity: &JointVector) -> Self {
        Self { seconds_per_unit: velocity.map(|v| if v > 0.0 { 1.0 / v } else { 0.0 }) }
    }
}

impl Cost for TaskTime {
    #[inline]
    fn of(&self, displacement: &JointVector) -> f64 {
        let mut time = 0.0f64;
        for j in 0..MAX_DOF {
            time = time.max(displacement[j] * self.seconds_per_unit[j]);
        }
        time
    }
}

/// A weighted sum of two costs.
#[derive(Clone, Copy, Debug)]
pub struct Weighted<A, B>(pub f64, pub A, pub f64, pub B);

impl<A: Cost, B: Cost> Cost for Weighted<A, B> {
    #[inline]
    fn of(&self, displacement: &JointVector) -> f64 {
        self.0 * self.1.of(displacement) + self.2 * self.3.of(displacement)
    }
}

/// The costs that have a name on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum CostKind {
    /// [`Effort`].
    Effort,
    /// [`TaskTime`].
    Time,
}

/// The velocity of each joint: the robot's limits, or one `v_max` for all where that is lower
/// or where it is asked for. Unused lanes are 0. \[rad/s\] or \[m/s\]
#[must_use]
pub fn velocities(arm: &Arm, v_max: Option<f64>) -> JointVector {
    let mut velocity = [0.0; MAX_DOF];
    for (v, limits) in velocity.iter_mut().zip(arm.limits()) {
        *v = v_max.map_or(limits.velocity, |cap| cap.min(limits.velocity));
    }
    velocity
}

/// Absolute joint displacements from `a` to `b`, continuous joints the short way round.
#[must_use]
#[inline]
pub fn displacement(continuous: &[bool; MAX_DOF], a: &JointVector, b: &JointVector) -> JointVector {
    let mut d = [0.0; MAX_DOF];
    for j in 0..MAX_DOF {
        let raw = b[j] - a[j];
        let turns = if continuous[j] { (raw / std::f64::consts::TAU).round() } else { 0.0 };
        d[j] = (raw - turns * std::f64::consts::TAU).abs();
    }
    d
}

/// The cost of a polyline of joint vectors.
#[must_use]
pub fn of_path<C: Cost>(cost: &C, path: &[JointVector]) -> f64 {
    path.windows(2).map(|w| cost.of(&std::array::from_fn(|j| (w[1][j] - w[0][j]).abs()))).sum()
}
