//! Joint limits of an arm, and the braking margin at soft limits.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use serde::Deserialize;

use crate::urdf::{Joint, JointKind};

/// Limits of one active joint. [rad, rad/s, rad/s²; m for prismatic joints]
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
    /// Gain of the safety controller: at a distance d from a soft limit it allows a speed of
    /// k_position · d towards it. [1/s]
    pub k_position: Option<f64>,
    /// Turns without end.
    pub continuous: bool,
}

/// Why a limits file was refused.
#[derive(Debug, thiserror::Error)]
pub enum LimitsError {
    /// Not TOML of the expected form.
    #[error("not a limits file: {0}")]
    Toml(#[from] Box<toml::de::Error>),
    /// A joint that the arm does not move.
    #[error("limits for {joint}, but the arm moves only {}", known.join(", "))]
    UnknownJoint {
        /// The joint in the file.
        joint: String,
        /// The arm's joints.
        known: Vec<String>,
    },
    /// A limit that is not a positive number, or a velocity above the URDF's.
    #[error("{what} = {value} of {joint}: must be positive and at most {most}")]
    BadValue {
        /// The joint.
        joint: String,
        /// `velocity` or `acceleration`.
        what: &'static str,
        /// The value in the file.
        value: f64,
        /// The largest value that is allowed.
        most: f64,
    },
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

/// One joint of a limits file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct JointEntry {
    /// At most the URDF's. \[rad/s\]
    velocity: Option<f64>,
    /// Replaces the URDF's or the default. \[rad/s²\]
    acceleration: Option<f64>,
}

/// Applies a limits file: one table a joint, with `velocity`, `acceleration` or both.
pub(crate) fn apply_toml(
    text: &str,
    names: &[String],
    limits: &mut [JointLimits],
) -> Result<(), LimitsError> {
    let entries: BTreeMap<String, JointEntry> = toml::from_str(text).map_err(Box::new)?;
    for (joint, entry) in entries {
        let Some(index) = names.iter().position(|n| *n == joint) else {
            return Err(LimitsError::UnknownJoint { joint, known: names.to_vec() });
        };
        let check = |what, value: f64, most: f64| {
            if value > 0.0 && value.is_finite() && value <= most {
                Ok(value)
            } else {
                Err(LimitsError::BadValue { joint: joint.clone(), what, value, most })
            }
        };
        let limit = &mut limits[index];
        if let Some(value) = entry.velocity {
            limit.velocity = check("velocity", value, limit.velocity)?;
        }
        if let Some(value) = entry.acceleration {
            limit.acceleration = check("acceleration", value, f64::INFINITY)?;
        }
    }
    Ok(())
}

/// The representative of an angle nearest to `near`, by whole turns. \[rad\]
#[inline]
pub(crate) fn unwrap_near(angle: f64, near: f64) -> f64 {
    let ahead = near - angle;
    // Nearly always true, and rounding is a call where the processor has no instruction for it.
    if ahead.abs() <= PI {
        return angle;
    }
    angle + (ahead / TAU).round_ties_even() * TAU
}

/// The representative of an angle in (−π, π]. \[rad\]
#[inline]
pub(crate) fn wrap(angle: f64) -> f64 {
    if angle > -PI && angle <= PI {
        return angle;
    }
    let wrapped = unwrap_near(angle, 0.0);
    if wrapped <= -PI { wrapped + TAU } else { wrapped }
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

    #[test]
    fn angles_wrap_into_their_ranges() {
        assert_eq!(wrap(PI), PI);
        assert_eq!(wrap(-PI), PI);
        assert!((wrap(7.0) - (7.0 - TAU)).abs() < 1e-15);
        assert!((wrap(-100.0) + 100.0 - 16.0 * TAU).abs() < 1e-12);
        assert!((unwrap_near(0.1, 13.0) - (0.1 + 2.0 * TAU)).abs() < 1e-12);
        assert_eq!(unwrap_near(3.0, 0.0), 3.0);
    }

    #[test]
    fn limits_files_tighten_only() {
        let names = ["one".to_owned()];
        let apply = |text: &str| {
            let mut limits = [wrist_flex()];
            apply_toml(text, &names, &mut limits).map(|()| limits[0])
        };
        let slow = apply("[one]\nvelocity = 1.0\nacceleration = 20").unwrap();
        assert_eq!((slow.velocity, slow.acceleration), (1.0, 20.0));
        assert!(matches!(apply("[one]\nvelocity = 9.0"), Err(LimitsError::BadValue { .. })));
        assert!(matches!(apply("[one]\nacceleration = nan"), Err(LimitsError::BadValue { .. })));
        assert!(matches!(apply("[one]\nacceleration = 0"), Err(LimitsError::BadValue { .. })));
        assert!(matches!(apply("[two]\nvelocity = 1.0"), Err(LimitsError::UnknownJoint { .. })));
        assert!(matches!(apply("[one]\njerk = 1.0"), Err(LimitsError::Toml(_))));
        assert!(matches!(apply("not toml"), Err(LimitsError::Toml(_))));
    }
}
