//! What is given to the search and to the smoothing.

use nullsweep_robot::JointVector;

use super::station::Station;
use crate::poses::{Point, Space};
use crate::workcell::Workcell;

/// A path and the arm that is to follow it.
pub(super) struct Problem<'a> {
    pub(super) space: Space<'a>,
    pub(super) cell: Workcell<'a>,
    pub(super) segments: &'a [Vec<Station>],
    pub(super) start: Option<JointVector>,
    /// See [`FollowConfig::step`](super::FollowConfig::step).
    pub(super) step: [f64; 2],
    pub(super) seed: u64,
}

impl Problem<'_> {
    /// The edge from a place to the next, if no joint jumps on it.
    pub(super) fn step(&self, a: &Point, b: &Point) -> Option<Vec<Point>> {
        let arm = self.cell.arm;
        let most = |j: usize| self.step[usize::from(!arm.is_revolute(j))];
        let jumps = (0..arm.dof()).any(|j| (b.q[j] - a.q[j]).abs() > most(j));
        if jumps { None } else { self.space.edge(a, b) }
    }
}
