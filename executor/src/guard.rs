//! The limits that the executor enforces: from its own URDF and its own parameters, never from
//! the plan that it guards.

use nullsweep_robot::{Continuous, JointLimits, JointVector, MAX_DOF};

/// A joint that moves less than this to a plan's first knot stands: at no acceleration does it come
/// to a speed that matters. \[rad\]
const STILL: f64 = 1e-11;
/// What a planner's acceleration may exceed its limit by: as a share of it, and at all. \[rad/s²\]
const ROUNDING_SHARE: f64 = 1e-6;
const ROUNDING: f64 = 1e-9;

/// What one joint may do, as the robot crate reads it from the URDF.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointGuard {
    /// Soft limits, velocity, the gain that makes the braking margin.
    pub limits: JointLimits,
}

impl JointGuard {
    /// The soft limits at a speed: moved in by the distance that the PR2's position gain
    /// needs to brake from it. The planner asks the same function.
    #[must_use]
    pub fn limits_at(&self, speed: f64) -> (f64, f64) {
        self.limits.braking(speed)
    }

    /// Velocity limit. \[rad/s\] or \[m/s\]
    #[must_use]
    pub fn velocity(&self) -> f64 {
        self.limits.velocity
    }
}

/// All of the executor's own bounds. Made once at start, read by every part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Guard {
    /// Used entries of `joints`.
    pub dof: usize,
    /// Each joint's limits.
    pub joints: [JointGuard; MAX_DOF],
    /// Cycle time. \[ns\]
    pub period_ns: u64,
    /// Each joint's bound on the acceleration of a stop, pause, resume or change of speed along
    /// the path, on top of the plan's own. \[rad/s²\]
    pub stop_acceleration: f64,
    /// Most acceleration of the motion from where the arm holds to a plan's first knot, see
    /// [`Self::connector_acceleration`]. \[rad/s²\]
    pub connector_acceleration: f64,
    /// How far a plan's first knot may be from where the arm holds. \[rad\]
    pub start_tolerance: f64,
    /// How far a plan's first knot may be from the knot that it joins. \[rad\]
    pub join_tolerance: f64,
    /// Age of the joint state at which the arm stops on its path. \[ns\]
    pub stale_ns: u64,
    /// Age of the joint state at which communication counts as lost. \[ns\]
    pub lost_ns: u64,
    /// How far a held joint (torso, other arm) may move while a plan runs. \[rad\] or \[m\]
    pub held_drift: f64,
    /// Following error that is allowed at stand-still. \[rad\]
    pub following_error: f64,
    /// Following error that is allowed for each unit of commanded speed. \[s\]
    pub following_lag: f64,
    /// How far the arm may be from a plan's last knot for the plan to be finished. \[rad\]
    pub goal_tolerance: f64,
    /// How long it must have been measured there. \[ns\]
    pub settle_ns: u64,
    /// How long after its last knot was commanded a plan may take to finish, else it is aborted.
    /// \[ns\]
    pub goal_ns: u64,
    /// States in a row with too large a following error (or an endpoint that says that it got no
    /// setpoints) that make a fault.
    pub debounce: u32,
    /// Mean rate over 600 ms below which the arm is stopped. \[Hz\]
    pub min_rate: f64,
}

impl Guard {
    /// Default of [`Self::start_tolerance`]. \[rad\]
    pub const START_TOLERANCE: f64 = 0.02;
    /// The least share of its acceleration with which a joint is led to a first knot.
    pub const APPROACH: f64 = 0.1;
    /// Default of [`Self::goal_tolerance`]. \[rad\]
    pub const GOAL_TOLERANCE: f64 = 0.02;
    /// Default of [`Self::held_drift`], and of how far a held joint may be from where a plan takes it. A
    /// torso moves the whole arm by as much, and another arm's joint its hand by about as much: both
    /// together are less than the 5 mm that plans are proven to keep clear. \[rad\] or \[m\]
    pub const HELD_TOLERANCE: f64 = 0.002;

    /// Guards these joints with the default parameters at a 1 kHz cycle. At most
    /// [`MAX_DOF`] joints are used.
    #[must_use]
    pub fn new(joints: &[JointLimits]) -> Self {
        let none = JointLimits {
            lower: 0.0,
            upper: 0.0,
            velocity: 0.0,
            acceleration: 0.0,
            jerk: None,
            k_position: None,
            continuous: false,
        };
        let dof = joints.len().min(MAX_DOF);
        let mut all = [JointGuard { limits: none }; MAX_DOF];
        for (guard, limits) in all.iter_mut().zip(joints) {
            guard.limits = *limits;
        }
        Self {
            dof,
            joints: all,
            period_ns: 1_000_000,
            stop_acceleration: 10.0,
            connector_acceleration: 2.0,
            start_tolerance: Self::START_TOLERANCE,
            join_tolerance: 1e-9,
            stale_ns: 20_000_000,
            lost_ns: 100_000_000,
            held_drift: Self::HELD_TOLERANCE,
            following_error: 0.1,
            following_lag: 0.15,
            goal_tolerance: Self::GOAL_TOLERANCE,
            settle_ns: 50_000_000,
            goal_ns: 1_000_000_000,
            debounce: 20,
            min_rate: 750.0,
        }
    }

    /// Cycle time. \[s\]
    #[must_use]
    pub fn period(&self) -> f64 {
        self.period_ns as f64 * 1e-9
    }

    /// The used joints.
    #[must_use]
    pub fn used(&self) -> &[JointGuard] {
        &self.joints[..self.dof.min(MAX_DOF)]
    }

    /// Which joints turn without end.
    #[must_use]
    pub fn continuous(&self) -> Continuous {
        Continuous::new(self.joints.map(|joint| joint.limits.continuous))
    }

    /// The acceleration of a joint from where the arm holds to a plan's first knot. Halfway it
    /// turns from speeding up to slowing down at once: twice the acceleration is within a cycle's
    /// [`Self::sudden`]. \[rad/s²\] or \[m/s²\]
    #[must_use]
    pub fn connector_acceleration(&self, joint: usize) -> f64 {
        let own = self.joints[joint].limits.acceleration;
        self.connector_acceleration.min(own).min(0.5 * self.sudden(joint))
    }

    /// How far two velocities of a joint may differ and still count as one: what its acceleration
    /// limit, the stop acceleration and its jerk limit change in one cycle. \[rad/s\]
    #[must_use]
    pub fn velocity_tolerance(&self, joint: usize) -> f64 {
        let own = self.joints[joint].limits.acceleration;
        self.stop_acceleration.min(own).min(self.sudden(joint)) * self.period()
    }

    /// By how much a joint's acceleration may change at once: what its jerk limit changes in a
    /// cycle, because setpoints a cycle apart show no more of it. Infinite without such a limit.
    /// \[rad/s²\] or \[m/s²\]
    #[must_use]
    pub fn sudden(&self, joint: usize) -> f64 {
        self.joints[joint].limits.jerk.map_or(f64::INFINITY, |jerk| jerk * self.period())
    }

    /// Whether a joint's acceleration may change like this within a cycle; else the jerk that the
    /// setpoints would show, and its limit. \[rad/s³\]
    ///
    /// # Errors
    /// Both, where it may not.
    pub fn allows_step(&self, joint: usize, from: f64, to: f64) -> Result<(), (f64, f64)> {
        let (step, most) = ((to - from).abs(), self.sudden(joint));
        // Written so that NaN is none that is allowed.
        if step <= most * (1.0 + ROUNDING_SHARE) + ROUNDING || most == f64::INFINITY {
            return Ok(());
        }
        Err((step / self.period(), most / self.period()))
    }

    /// The acceleration with which a joint of the motion from where the arm holds to a plan's first
    /// knot keeps the braking margin: slower where the knot is near the soft limit ahead. `None`
    /// where it would have to be slower than [`Self::APPROACH`] allows.
    #[must_use]
    pub fn approach(&self, joint: usize, from: f64, to: f64) -> Option<f64> {
        let most = self.connector_acceleration(joint);
        let limits = &self.joints[joint].limits;
        let Some(k) = limits.k_position.filter(|_| !limits.continuous) else { return Some(most) };
        let travel = (to - from).abs();
        if travel <= STILL {
            return Some(most);
        }
        // Braking with a towards a knot leaves a speed of √(2 a s) at a distance s from it. That is
        // within k (s + room) at every s where a is at most 2 k² room.
        let room = if to > from { limits.upper - to } else { to - limits.lower };
        let slow = 2.0 * k * k * room;
        if slow >= most { Some(most) } else { (slow >= Self::APPROACH * most).then_some(slow) }
    }

    /// Whether two velocities are one; else the first joint that differs, and by how much.
    ///
    /// # Errors
    /// That joint and its difference. \[rad/s\]
    pub fn matches_velocity(&self, a: &JointVector, b: &JointVector) -> Result<(), (usize, f64)> {
        for j in 0..self.used().len() {
            let step = (b[j] - a[j]).abs();
            if !(step <= self.velocity_tolerance(j)) {
                return Err((j, step));
            }
        }
        Ok(())
    }

    /// The joint that is further than `tolerance` from `from`, the farthest one, and by how much.
    #[must_use]
    pub fn farthest(
        &self,
        from: &JointVector,
        to: &JointVector,
        tolerance: f64,
    ) -> Option<(usize, f64)> {
        let mut worst: Option<(usize, f64)> = None;
        let displacement = self.continuous().displacement(from, to);
        for (j, &apart) in displacement.iter().enumerate().take(self.used().len()) {
            if apart.is_nan() {
                return Some((j, apart));
            }
            if !(apart <= worst.map_or(tolerance, |(_, d)| d)) {
                worst = Some((j, apart));
            }
        }
        worst
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use nullsweep_robot::{ArmSpec, Robot, Side};

    use super::*;

    /// The PR2's right arm.
    pub(crate) fn pr2() -> Guard {
        let arm = Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).unwrap();
        Guard::new(arm.limits())
    }

    #[test]
    fn whole_turns_are_no_distance_on_continuous_joints_only() {
        let guard = pr2();
        let apart = |joint: usize, from: f64, to: f64| {
            let mut ends = [JointVector::ZERO; 2];
            (ends[0][joint], ends[1][joint]) = (from, to);
            guard.farthest(&ends[0], &ends[1], 1e-9)
        };
        let (joint, by) = apart(4, 3.0, -3.0).unwrap();
        assert!(joint == 4 && (by - 0.283_185_307).abs() < 1e-8, "{joint} {by}");
        assert_eq!(apart(4, -9.0, -9.0 + 10.0 * core::f64::consts::TAU), None);
        assert_eq!(apart(0, 3.0, -3.0), Some((0, 6.0)));
        let mut to = JointVector::ZERO;
        to[5] = f64::NAN;
        assert_eq!(guard.farthest(&JointVector::ZERO, &to, 0.1).map(|(j, _)| j), Some(5));
    }
}
