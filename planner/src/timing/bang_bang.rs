//! Joint path to timed knots: bang-bang velocity.

use nullsweep_robot::{JointVector, MAX_DOF};

use crate::plan::PlanKnot;

/// The time that each knot is reached, from 0, when every straight segment runs as fast as its
/// slowest joint allows and all joints arrive together (Eq. 2): the joint path stays the chord
/// that was checked. Rounded up to whole nanoseconds a segment, at least 1 ns, so that times rise
/// strictly and no joint exceeds its velocity. \[ns\]
///
/// `velocity` holds each joint's velocity, 0 in unused lanes. \[rad/s\] or \[m/s\]
#[must_use]
pub fn bang_bang(path: &[JointVector], velocity: &JointVector) -> Vec<u64> {
    let mut times = Vec::with_capacity(path.len());
    let mut now = 0u64;
    for (i, q) in path.iter().enumerate() {
        if i > 0 {
            now = now.saturating_add(segment_ns(&path[i - 1], q, velocity));
        }
        times.push(now);
    }
    times
}

/// Sets the times of knots as [`bang_bang`] has them.
pub fn set_times(knots: &mut [PlanKnot], velocity: &JointVector) {
    let joints: Vec<JointVector> = knots.iter().map(|k| k.q).collect();
    for (knot, time) in knots.iter_mut().zip(bang_bang(&joints, velocity)) {
        knot.time_ns = time;
    }
}

/// The least time from `a` to `b`. \[ns\]
#[must_use]
pub fn segment_ns(a: &JointVector, b: &JointVector, velocity: &JointVector) -> u64 {
    let mut seconds = 0.0f64;
    for j in 0..MAX_DOF {
        if velocity[j] > 0.0 {
            seconds = seconds.max((b[j] - a[j]).abs() / velocity[j]);
        }
    }
    // One part in 10⁹ more, so that rounding never asks for more than the limit.
    ((seconds * 1e9 * (1.0 + 1e-9)).ceil() as u64).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slowest_joint_sets_the_time_and_no_joint_exceeds_its_velocity() {
        let mut velocity = JointVector::ZERO;
        velocity[0] = 2.0;
        velocity[1] = 3.6;
        let mut path = vec![JointVector::ZERO; 4];
        path[1][0] = 1.0;
        path[1][1] = -0.5;
        path[2][0] = 1.0 + 1e-13;
        path[2][1] = -0.5;
        path[3][0] = 0.5;
        path[3][1] = 3.1;
        let times = bang_bang(&path, &velocity);
        assert_eq!(times[0], 0);
        assert_eq!(times[1], 500_000_001);
        for (w, t) in path.windows(2).zip(times.windows(2)) {
            assert!(t[1] > t[0]);
            let seconds = (t[1] - t[0]) as f64 * 1e-9;
            for j in 0..2 {
                assert!((w[1][j] - w[0][j]).abs() / seconds <= velocity[j]);
            }
        }
        assert!(times[3] - times[2] < 1_000_001_000);
    }
}
