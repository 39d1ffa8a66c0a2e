//! A way through given poses as a plan.

use nalgebra::{Isometry3, UnitVector3, Vector3};
use nullsweep_robot::{Arm, JointVector, Robot, Tool};

use super::space::Point;
use crate::plan::{Plan, PlanKnot, SurfaceSample};
use crate::timing;
use crate::workcell::Stance;

/// A place on the way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stop {
    /// The joint vector, and where the tool is.
    pub(crate) point: Point,
    /// The pose that is met there.
    pub(crate) pose: Option<usize>,
}

/// A piece of the way.
#[derive(Clone, Debug)]
pub(crate) enum Piece {
    /// The tool goes through places, in straight joint lines.
    Along(Vec<Stop>),
    /// Through free space: from where the arm was to where the next piece begins, but for whole turns of
    /// continuous joints, both ends included.
    Through(Vec<JointVector>),
}

/// What a plan is of.
#[derive(Clone, Copy)]
pub(crate) struct Given<'a> {
    pub(crate) robot: &'a Robot,
    pub(crate) arm: &'a Arm,
    pub(crate) tool: &'a Tool,
    pub(crate) stance: &'a Stance,
    /// All poses, those that are left out too.
    pub(crate) poses: &'a [Isometry3<f64>],
    pub(crate) seed: u64,
    /// Each joint's velocity. \[rad/s\] or \[m/s\]
    pub(crate) velocity: JointVector,
}

/// The pieces, one after the other, none of them empty and none through free space at the end, as a
/// bang-bang plan. Whole turns of continuous joints that a way through free space has left out are left
/// out of all behind it.
pub(crate) fn assemble(given: Given<'_>, pieces: &[Piece]) -> Plan {
    let mut knots: Vec<PlanKnot> = Vec::new();
    let mut turns = JointVector::ZERO;
    for (k, piece) in pieces.iter().enumerate() {
        match piece {
            Piece::Through(path) => {
                let (first, last) = (path[0], path[path.len() - 1]);
                let Some(Piece::Along(next)) = pieces.get(k + 1) else { continue };
                // A straight one too is marked as one that leaves the poses.
                let middle = [first.lerp(&last, 0.5)];
                let between = &path[usize::from(k > 0)..path.len() - 1];
                let between = if between.is_empty() { &middle } else { between };
                knots.extend(between.iter().map(|q| PlanKnot::free(*q + turns)));
                turns = turns + (last - next[0].point.q);
            }
            Piece::Along(stops) => knots.extend(stops.iter().map(|stop| {
                let at = stop.point.tool.translation.vector;
                PlanKnot {
                    line: Some(at.into()),
                    patch: stop.pose.map(|pose| pose as u32),
                    ..PlanKnot::free(stop.point.q + turns)
                }
            })),
        }
    }
    timing::set_times(&mut knots, &given.velocity);
    Plan {
        base: given.stance.base,
        base_height: given.stance.height,
        seed: given.seed,
        patches: given.poses.iter().map(|p| p.translation.vector.into()).collect(),
        surface: given.poses.iter().map(place).collect(),
        ..Plan::of(given.robot, given.arm, given.tool, knots)
    }
}

/// A pose's origin, its normal against the tool's axis.
fn place(pose: &Isometry3<f64>) -> SurfaceSample {
    let normal = UnitVector3::new_normalize(pose.rotation * -Vector3::z());
    SurfaceSample {
        point: pose.translation.vector.into(),
        normal: normal.into_inner().into(),
        reachable: true,
    }
}
