//! The choices that a plan is made by, which its file keeps, and the lengths that all who make or
//! check plans go by.

use serde::{Deserialize, Serialize};

/// How far the pad is lifted off the surface before it travels; from there on the tool keeps its
/// margin. \[m\]
pub const LIFT: f64 = 0.05;
/// Farthest that the pad's centre may leave the planned line between two knots of a tracked edge.
/// \[m\]
pub const LINE_TOLERANCE: f64 = 1e-4;
/// The same where a corner is blended: half as much again, what straight joint lines between knots
/// leave it by included. \[m\]
pub const BLEND_TOLERANCE: f64 = 1.5e-4;

/// How the order is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Shortest Euclidean way; the headings follow from it.
    Tsp,
    /// A node for each patch and incident edge; distance and turning are weighed (Eq. 4).
    Curvature,
    /// A node for each patch, incident edge and sample of the inverse kinematics; the cost of the
    /// joint motion is weighed (Eq. 1–3) (the paper's Joint-GTSP).
    Joint,
    /// Strips side by side over each piece of the surface that bends little, the pad across them.
    Raster,
}

/// What a plan minimises.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CostKind {
    /// [`Effort`](crate::cost::Effort).
    Effort,
    /// [`TaskTime`](crate::cost::TaskTime).
    Time,
}

/// How fast a plan goes along its path.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Profile {
    /// Every straight segment as fast as its slowest joint allows: bang-bang velocity, as in the
    /// paper. Joints change their speed at once, so a real arm lags.
    #[default]
    Velocity,
    /// As fast as velocity and acceleration allow, corners blended.
    Acceleration,
    /// As fast as velocity, acceleration and jerk allow, corners blended.
    Jerk,
}

impl Profile {
    /// Whether the joints follow cubics between knots, which have velocities; else straight lines.
    #[must_use]
    pub fn is_curved(self) -> bool {
        self != Self::Velocity
    }
}
