//! The subproblems into which closed forms fall apart: one rotation, one condition.
//!
//! Known since Paden (1986) and Kahan; see Murray, Li and Sastry, *A Mathematical Introduction to
//! Robotic Manipulation* (1994), §3.3, and Elias and Wen, *IK-Geo* (2022).

use nalgebra::Vector3;

/// Below this amplitude a rotation does not change what it is to bring about. [m, or none]
const FREE: f64 = 1e-9;

/// The vector turned about a unit axis.
#[inline]
pub(super) fn turned(axis: &Vector3<f64>, angle: f64, v: &Vector3<f64>) -> Vector3<f64> {
    let (sin, cos) = libm::sincos(angle);
    v * cos + axis.cross(v) * sin + axis * (axis.dot(v) * (1.0 - cos))
}

/// The angle about a unit axis that turns `from` nearest to `to`. \[rad\]
#[inline]
pub(super) fn turn_between(axis: &Vector3<f64>, from: &Vector3<f64>, to: &Vector3<f64>) -> f64 {
    let across = axis.cross(from);
    libm::atan2(across.dot(to), from.dot(to) - axis.dot(from) * axis.dot(to))
}

/// How a subproblem at its end is taken, as shares of the largest component.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slack {
    /// How far past the end still counts as the end.
    pub(super) past: f64,
    /// How far short of it both angles stay, so that each is on its own side.
    pub(super) short: f64,
}

impl Slack {
    /// For components that are `share` off.
    pub(super) fn calibrated(share: f64) -> Self {
        Self { past: share, short: share }
    }
}

/// The angles about a unit axis that give the turned `v` the component `wanted` along `along`.
#[derive(Clone, Copy, Debug)]
pub(super) enum Turns {
    /// On either side of the angle of the largest component. \[rad\]
    Two(f64, f64),
    /// Both in one place: the branches end here.
    One(f64),
    /// Any angle.
    Any,
    /// None.
    None,
}

impl Turns {
    #[inline]
    pub(super) fn to_component(
        axis: &Vector3<f64>,
        v: &Vector3<f64>,
        along: &Vector3<f64>,
        wanted: f64,
        slack: Slack,
    ) -> Self {
        let fixed = along.dot(axis) * axis.dot(v);
        let sine = along.dot(&axis.cross(v));
        let cosine = along.dot(v) - fixed;
        let amplitude = libm::hypot(sine, cosine);
        let rest = wanted - fixed;
        if amplitude < FREE {
            return if rest.abs() < FREE { Self::Any } else { Self::None };
        }
        let share = rest / amplitude;
        if share.is_nan() || share.abs() > 1.0 + slack.past {
            return Self::None;
        }
        let middle = libm::atan2(sine, cosine);
        let most = 1.0 - slack.short;
        let aside = libm::acos(share.clamp(-most, most));
        if share.abs() < 1.0 || slack.short > 0.0 {
            Self::Two(middle + aside, middle - aside)
        } else {
            Self::One(middle + aside)
        }
    }

    /// The angles that bring the turned `v` to a distance from a point; all from a point on the
    /// axis.
    #[inline]
    pub(super) fn to_distance(
        axis: &Vector3<f64>,
        v: &Vector3<f64>,
        point: &Vector3<f64>,
        distance: f64,
        slack: Slack,
    ) -> Self {
        let wanted = 0.5 * (v.norm_squared() + point.norm_squared() - distance * distance);
        Self::to_component(axis, v, point, wanted, slack)
    }

    /// The angle on one side; `free` where any will do. Where both are one it is on the first
    /// side, and with `ends` on the other one as well.
    #[inline]
    pub(super) fn on(self, second: bool, free: f64, ends: bool) -> Option<f64> {
        match self {
            Self::Two(first, other) => Some(if second { other } else { first }),
            Self::One(angle) => (!second || ends).then_some(angle),
            Self::Any => (!second || ends).then_some(free),
            Self::None => None,
        }
    }
}
