//! Motions through free space: lifting the tool off, going elsewhere, setting it down again.
//!
//! Every segment of a returned path is a straight joint line that
//! [`World::motion_free`](nullsweep_collision::World::motion_free) has proven. Paths start at the
//! given joint vector and end at the other one but for whole turns of continuous joints, which are
//! left out wherever that is nearer: paths are unwrapped. No path is a result, not an error.

use nullsweep_robot::JointVector;

use super::retreat::{lift, retract};
use super::rrt_connect::{Options, rrt_connect};
use crate::plan::LIFT;
use crate::workcell::Workcell;

/// The path from one contact (or free configuration) to another: lift off, transfer, set down.
///
/// An end that is free with the tool's margin kept needs no lift.
#[must_use]
pub fn jump(
    cell: Workcell<'_>,
    from: &JointVector,
    to: &JointVector,
    seed: u64,
) -> Option<Vec<JointVector>> {
    let to = cell.arm.continuous().nearest_turn(to, from);
    across(cell, lift(cell, from)?, lift(cell, &to)?, &Options::default(), seed)
}

/// Whether some path leads from one contact (or free configuration) to another, as [`jump`] looks for
/// it: none is made short.
pub(super) fn is_joined(
    cell: Workcell<'_>,
    from: &JointVector,
    to: &JointVector,
    seed: u64,
) -> bool {
    let to = cell.arm.continuous().nearest_turn(to, from);
    let options = Options { shortcuts: 0, ..Options::default() };
    let ends = || Some((lift(cell, from)?, lift(cell, &to)?));
    ends().is_some_and(|(up, down)| across(cell, up, down, &options, seed).is_some())
}

/// As [`jump`], but the tool backs off even where it is free, as far as that goes.
#[must_use]
pub fn reconfigure(
    cell: Workcell<'_>,
    from: &JointVector,
    to: &JointVector,
    seed: u64,
) -> Option<Vec<JointVector>> {
    let to = cell.arm.continuous().nearest_turn(to, from);
    across(cell, back_away(cell, from)?, back_away(cell, &to)?, &Options::default(), seed)
}

/// The way off a pose, also where the tool is free: [`retract`] by the default lift, else [`lift`].
#[must_use]
pub fn back_away(cell: Workcell<'_>, q: &JointVector) -> Option<Vec<JointVector>> {
    retract(cell.world, cell.arm, cell.tool, q, LIFT).or_else(|| lift(cell, q))
}

/// The path that goes up the first way, through free space, and back the second way.
fn across(
    cell: Workcell<'_>,
    mut path: Vec<JointVector>,
    mut down: Vec<JointVector>,
    options: &Options,
    seed: u64,
) -> Option<Vec<JointVector>> {
    down.reverse();
    let (above, goal) = (path.pop()?, down[0]);
    let across = rrt_connect(cell.world, cell.arm, &above, &goal, options, seed)?;
    let arrived = *across.last()?;
    path.extend(across);
    // The set-down turns with the transfer's end.
    let turns = arrived - goal;
    path.extend(down[1..].iter().map(|q| *q + turns));
    Some(path)
}
