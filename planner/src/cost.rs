//! What a joint motion costs.

use nullsweep_robot::{Arm, JointVector, MAX_DOF};
use wide::f32x8;

/// The cost of a straight joint motion. The layered search, the motions and the Joint-GTSP
/// are generic over it; which cost a job takes is [`CostKind`](crate::plan::CostKind)'s to say.
///
/// A cost must be non-negative, zero for no motion and must not fall when a displacement grows,
/// so that the straight line between two ends is a lower bound for every path between them.
pub trait Cost: Send + Sync {
    /// The cost of moving each joint by `displacement` (absolute values, unused lanes 0).
    /// \[rad\] or \[m\] in, the cost's own unit out.
    fn of(&self, displacement: &JointVector) -> f64;

    /// The same for eight motions side by side, entry `j` holding joint `j` of each, in single
    /// precision: what the large searches ask. Without one of its own a cost is asked eight times.
    #[inline]
    fn of_eight(&self, displacement: &[f32x8; MAX_DOF]) -> f32x8 {
        let lanes = displacement.map(f32x8::to_array);
        f32x8::from(std::array::from_fn(|k| {
            self.of(&JointVector::from_fn(|j| f64::from(lanes[j][k]))) as f32
        }))
    }
}

/// Manipulation effort: the sum of all joint displacements (Eq. 1). \[rad\]
#[derive(Clone, Copy, Debug)]
pub struct Effort;

impl Cost for Effort {
    #[inline]
    fn of(&self, displacement: &JointVector) -> f64 {
        displacement.iter().sum()
    }

    #[inline]
    fn of_eight(&self, displacement: &[f32x8; MAX_DOF]) -> f32x8 {
        displacement.iter().fold(f32x8::ZERO, |sum, d| sum + *d)
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
        let slowness = |j: usize| if velocity[j] > 0.0 { 1.0 / velocity[j] } else { 0.0 };
        Self { seconds_per_unit: JointVector::from_fn(slowness) }
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

    #[inline]
    fn of_eight(&self, displacement: &[f32x8; MAX_DOF]) -> f32x8 {
        let mut time = f32x8::ZERO;
        for j in 0..MAX_DOF {
            time = time.fast_max(displacement[j] * self.seconds_per_unit[j] as f32);
        }
        time
    }
}

/// The velocity of each joint: the robot's limits, or one `v_max` for all where that is lower. Unused lanes are 0. \[rad/s\] or \[m/s\]
#[must_use]
pub fn velocities(arm: &Arm, v_max: Option<f64>) -> JointVector {
    let mut velocity = [0.0; MAX_DOF];
    for (v, limits) in velocity.iter_mut().zip(arm.limits()) {
        *v = v_max.map_or(limits.velocity, |cap| cap.min(limits.velocity));
    }
    JointVector::new(velocity)
}

/// The cost of a polyline of joint vectors.
#[must_use]
pub fn of_path<C: Cost>(cost: &C, path: &[JointVector]) -> f64 {
    path.windows(2).map(|w| cost.of(&w[0].displacement(&w[1]))).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cost that says nothing about eight motions at once.
    struct Squares;

    impl Cost for Squares {
        fn of(&self, displacement: &JointVector) -> f64 {
            displacement.iter().map(|d| d * d).sum()
        }
    }

    fn check(cost: &impl Cost) {
        let at = |j: usize, k: usize| libm::sin(1.7 * (j * 8 + k) as f64).abs();
        let lanes = std::array::from_fn(|j| f32x8::from(std::array::from_fn(|k| at(j, k) as f32)));
        for (k, found) in cost.of_eight(&lanes).to_array().into_iter().enumerate() {
            let expected = cost.of(&JointVector::from_fn(|j| at(j, k)));
            assert!((f64::from(found) - expected).abs() < 1e-5, "{k}: {found} {expected}");
        }
    }

    #[test]
    fn eight_motions_cost_what_each_of_them_does() {
        let velocity = JointVector::new([2.0, 1.0, 0.5, 3.0, 2.0, 2.0, 1.5, 0.0]);
        check(&Effort);
        check(&TaskTime::new(&velocity));
        check(&Squares);
    }
}
