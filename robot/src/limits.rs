//! Joint limits of an arm, and the braking margin at soft limits.

use crate::urdf::{Joint, JointKind};

/// Limits of one active joint. [rad, rad/s, rad/s², rad/s³; m for prismatic joints]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointLimits {
    /// Lower end: the soft limit where the URDF has a safety controller, else the hard one; −∞
    /// for continuous joints.
    pub lower: f64,
    /// Upper end, likewise.
    pub upper: f64,
    /// Largest speed.
    pub velocity: f64,
    /// Largest acceleration: the URDF's, else from
    /// [`JointLimits::DEFAULT_ACCELERATION_TIME`].
    pub acceleration: f64,
    /// Largest jerk, where the URDF has one.
    pub jerk: Option<f64>,
    /// Gain of the safety controller: at a distance d from a soft limit it allows a speed of
    /// k_position · d towards it. [1/s]
    pub k_position: Option<f64>,
    /// Turns without end.
    pub continuous: bool,
}

impl JointLimits {
    /// Where the URDF has no acceleration, a joint reaches its largest speed in this time:
    /// acceleration = velocity / 0.5 s. \[s\]
    pub const DEFAULT_ACCELERATION_TIME: f64 = 0.5;

    /// The limits of a joint, or `None` without a usable `<limit>`.
    pub(crate) fn of(joint: &Joint) -> Option<Self> {
        let hard = joint.limits?;
        if !(hard.velocity > 0.0 && hard.velocity.is_finite()) {
            return None;
        }
        let continuous = joint.kind == JointKind::Continuous;
        let soft = joint.safety.and_then(|s| s.soft);
        // A soft range that reaches past the hard one does not widen it.
        let (lower, upper) = match soft {
            Some((lower, upper)) => (lower.max(hard.lower), upper.min(hard.upper)),
            None => (hard.lower, hard.upper),
        };
        let bounded = lower.is_finite() && upper.is_finite();
        if lower > upper || !(continuous || bounded) {
            return None;
        }
        Some(Self {
            lower,
            upper,
            velocity: hard.velocity,
            acceleration: hard
                .acceleration
                .unwrap_or(hard.velocity / Self::DEFAULT_ACCELERATION_TIME),
            jerk: hard.jerk,
            // Without soft limits there is nothing that the gain could act on.
            k_position: joint.safety.and_then(|s| s.k_position).filter(|_| soft.is_some()),
            continuous,
        })
    }

    /// The range in which a speed is allowed: the soft limits moved in by |velocity| / k_position.
    ///
    /// The PR2's safety controller turns the effort against a motion that is faster towards a
    /// soft limit than k_position times the distance that is left, so a setpoint nearer than that
    /// cannot be followed. Where the margin leaves nothing, both ends are the middle.
    #[must_use]
    pub fn braking(&self, velocity: f64) -> (f64, f64) {
        let Some(k) = self.k_position.filter(|_| !self.continuous) else {
            return (self.lower, self.upper);
        };
        let margin = velocity.abs() / k;
        let (lower, upper) = (self.lower + margin, self.upper - margin);
        if lower <= upper {
            (lower, upper)
        } else {
            let middle = 0.5 * (self.lower + self.upper);
            (middle, middle)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wrist_flex() -> JointLimits {
        JointLimits {
            lower: -2.0,
            upper: -0.1,
            velocity: 3.078,
            acceleration: 8.0,
            jerk: None,
            k_position: Some(20.0),
            continuous: false,
        }
    }

    #[test]
    fn braking_margin_is_speed_over_gain() {
        let limits = wrist_flex();
        assert_eq!(limits.braking(0.0), (-2.0, -0.1));
        let (lower, upper) = limits.braking(-3.078);
        assert!((lower + 2.0 - 0.1539).abs() < 1e-12 && (-0.1 - upper - 0.1539).abs() < 1e-12);
        assert_eq!(limits.braking(3.078), limits.braking(-3.078));
        // A margin wider than the range leaves its middle, not an inverted range.
        let (lower, upper) = limits.braking(100.0);
        assert_eq!((lower, upper), (-1.05, -1.05));
        let free = JointLimits { k_position: None, ..limits };
        assert_eq!(free.braking(3.0), (-2.0, -0.1));
    }
}
