//! A way through given poses as a plan.

use nalgebra::{Isometry3, UnitVector3, Vector3};
use nullsweep_robot::{Arm, JointVector, Robot};

use super::setup::Setup;
use super::space::Point;
use crate::plan::{Plan, PlanKnot, SurfaceSample};
use crate::timing;

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
    pub(crate) setup: &'a Setup,
    /// All poses, those that are left out too.
    pub(crate) poses: &'a [Isometry3<f64>],
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
    let Setup { tool, stance, speed, seed, .. } = given.setup;
    timing::set_times(&mut knots, &speed.velocity(given.arm));
    Plan {
        base: stance.base,
        base_height: stance.height,
        seed: *seed,
        patches: given.poses.iter().map(|p| p.translation.vector.into()).collect(),
        surface: given.poses.iter().map(place).collect(),
        ..Plan::of(given.robot, given.arm, tool, knots)
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
