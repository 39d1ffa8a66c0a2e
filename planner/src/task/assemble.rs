//! A route through given poses as a plan.

use nalgebra::{Isometry3, UnitVector3, Vector3};
use nullsweep_robot::{Arm, JointVector, Robot};

use super::config::TaskConfig;
use super::route::Route;
use crate::plan::{Plan, PlanKnot, SurfaceSample};
use crate::{cost, timing};

/// Where a route leaves its poses: joint paths through free space.
pub(super) struct Way {
    /// From where the arm is to the first pose, if it is not said to be there.
    pub(super) approach: Option<Vec<JointVector>>,
    /// Between each pose and the next, where the arm does not go straight.
    pub(super) edges: Vec<Option<Vec<JointVector>>>,
}

/// The route as a plan.
pub(super) fn assemble(
    robot: &Robot,
    arm: &Arm,
    poses: &[Isometry3<f64>],
    route: &Route,
    way: &Way,
    config: &TaskConfig,
) -> Plan {
    let knot = |q, line, patch| PlanKnot { time_ns: 0, q, v: JointVector::default(), line, patch };
    let mut knots: Vec<PlanKnot> = Vec::new();
    // Whole turns of continuous joints that the ways through free space have left out.
    let mut turns = JointVector::ZERO;
    if let Some((last, approach)) = way.approach.as_ref().and_then(|path| path.split_last()) {
        knots.extend(approach.iter().map(|q| knot(*q, None, None)));
        turns = route.order.first().map_or(turns, |&pose| *last - route.points[pose].q);
    }
    for (k, &pose) in route.order.iter().enumerate() {
        let point = &route.points[pose];
        if let Some(through) = k.checked_sub(1).and_then(|e| way.edges[e].as_ref()) {
            let (first, last) = (through[0], through[through.len() - 1]);
            let between = &through[1..through.len() - 1];
            // A straight one too is marked as one that leaves the surface.
            let middle = [first.lerp(&last, 0.5)];
            let between = if between.is_empty() { &middle } else { between };
            knots.extend(between.iter().map(|q| knot(*q + turns, None, None)));
            turns = turns + (last - point.q);
        }
        let at = point.tool.translation.vector;
        let line = Some([at.x, at.y, at.z]);
        knots.push(knot(point.q + turns, line, Some(pose as u32)));
    }
    timing::set_times(&mut knots, &cost::velocities(arm, config.v_max));
    Plan {
        base: config.stance.base,
        base_height: config.stance.height,
        seed: config.seed,
        patches: poses.iter().map(|p| p.translation.vector.into()).collect(),
        surface: poses.iter().map(place).collect(),
        ..Plan::of(robot, arm, &config.tool, knots)
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
