//! A spoilt plan.

use nullsweep_planner::plan::Plan;
use nullsweep_planner::verify::ViolationKind;
use nullsweep_planner::workcell::Scene;

/// A spoilt plan and what must be said of it.
pub(crate) struct Case {
    pub(crate) what: &'static str,
    pub(crate) plan: Plan,
    /// Instead of the stage's.
    pub(crate) scene: Option<Scene>,
    /// The first knot at which it is seen.
    pub(crate) knot: usize,
    /// Part of a detail.
    pub(crate) says: String,
    /// What else cannot but break with it.
    pub(crate) also: &'static [ViolationKind],
}

impl Case {
    pub(crate) fn new(
        what: &'static str,
        plan: Plan,
        knot: usize,
        says: impl Into<String>,
    ) -> Self {
        Self { what, plan, scene: None, knot, says: says.into(), also: &[] }
    }
}
