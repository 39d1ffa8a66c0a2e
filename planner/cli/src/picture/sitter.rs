//! What a page is made of.

use nullsweep_collision::Options;
use nullsweep_planner::plan::Plan;
use nullsweep_planner::verify::Verification;
use nullsweep_planner::workcell::Scene;
use nullsweep_report::{LineSet, Table};
use nullsweep_robot::{Arm, Robot};

use super::flight::Flight;

/// Plans with what they are shown in.
pub(crate) struct Sitter<'a> {
    /// Plans as they follow each other; the last one's scan, figures and stance are shown.
    pub(crate) plans: &'a [Plan],
    pub(crate) robot: &'a Robot,
    /// The arm in the plans' stance.
    pub(crate) arm: &'a Arm,
    pub(crate) collision: &'a Options,
    /// What is there, in the floor frame, if that is known.
    pub(crate) scene: Option<&'a Scene>,
    /// What the last plan's check found, if it was checked.
    pub(crate) verification: Option<&'a Verification>,
    /// What was measured while they ran.
    pub(crate) flights: &'a [Flight],
    pub(crate) tables: Vec<Table>,
    pub(crate) lines: Vec<LineSet>,
}
