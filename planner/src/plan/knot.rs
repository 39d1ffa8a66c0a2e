//! One knot of a plan.

use nullsweep_robot::JointVector;
use serde::{Deserialize, Serialize};

/// One knot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlanKnot {
    /// Time since the plan's start. \[ns\]
    #[serde(rename = "t")]
    pub time_ns: u64,
    /// Joint vector, continuous joints unwrapped along the plan. \[rad\] or \[m\]
    pub q: JointVector,
    /// Joint velocities, of a plan with limited acceleration; else zero. \[rad/s\] or \[m/s\]
    #[serde(skip_serializing_if = "is_zero", default)]
    pub v: JointVector,
    /// The planned pad centre in the root frame while the pad is on the surface. \[m\]
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub line: Option<[f64; 3]>,
    /// The patch that is reached in this knot.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub patch: Option<u32>,
}

impl PlanKnot {
    /// At a joint vector, off the surface, before it has a time and a speed.
    #[must_use]
    pub(crate) fn free(q: JointVector) -> Self {
        Self { time_ns: 0, q, v: JointVector::ZERO, line: None, patch: None }
    }
}

fn is_zero(v: &JointVector) -> bool {
    *v == JointVector::default()
}
