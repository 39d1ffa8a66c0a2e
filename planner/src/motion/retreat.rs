//! Lifting the tool off the surface.

use nalgebra::{Isometry3, Vector3};
use nullsweep_collision::{ToolContact, World};
use nullsweep_robot::{Arm, JointVector, Tool, damped_step, pose_error};

use crate::plan::LIFT;
use crate::workcell::Workcell;

/// Spacing of the waypoints while the tool is lifted off. \[m\]
const LIFT_STEP: f64 = 0.005;
/// Most steps towards a waypoint.
const LIFT_ITERATIONS: usize = 12;
/// A waypoint of the lift is on the line to this. \[m, rad\]
const LIFT_TOLERANCE: f64 = 1e-6;
/// Damping of the lift's steps near a singularity.
const DAMPING: f64 = 1e-3;

/// The path off the surface: none but `q` itself where the tool keeps its margin already, else
/// [`retract`] by the default lift.
#[must_use]
pub fn lift(cell: Workcell<'_>, q: &JointVector) -> Option<Vec<JointVector>> {
    match cell.world.is_free(q, ToolContact::Forbidden) {
        true => Some(vec![*q]),
        false => retract(cell.world, cell.arm, cell.tool, q, LIFT),
    }
}

/// Backs the tool off by `distance` \[m\], its orientation kept, from the contact at `q`:
/// waypoints from `q` on, 5 mm apart. Along the surface normal (the contact frame's −z) if that
/// goes, else slanted upwards, towards the robot, or both.
///
/// The arm takes the shortest joint motion, so it stays on its branch. The pad may touch the
/// surface until it has left it. A lift that is blocked (a limit, a collision) is cut short there
/// if the tool keeps its margin by then; otherwise there is none.
#[must_use]
pub fn retract(
    world: &World,
    arm: &Arm,
    tool: &Tool,
    q: &JointVector,
    distance: f64,
) -> Option<Vec<JointVector>> {
    let contact = tool.on(arm).pose(q);
    let normal = contact.rotation * -Vector3::z();
    let up = Vector3::z();
    let home = -contact.translation.vector.component_mul(&Vector3::new(1.0, 1.0, 0.0)).normalize();
    [normal, normal + up, normal + home, normal + up + home]
        .into_iter()
        .filter_map(|direction| direction.try_normalize(0.1))
        .find_map(|away| back_off(world, arm, q, &away, distance))
}

/// [`retract`] in one direction.
fn back_off(
    world: &World,
    arm: &Arm,
    q: &JointVector,
    away: &Vector3<f64>,
    distance: f64,
) -> Option<Vec<JointVector>> {
    let start = arm.tip_pose(q);
    let mut path = vec![*q];
    // Waypoints up to here, the first one at which the tool keeps its margin.
    let mut left = None;
    let steps = (distance / LIFT_STEP).ceil().max(1.0) as usize;
    for step in 1..=steps {
        let lifted = distance * step as f64 / steps as f64;
        let mut target = start;
        target.translation.vector += away * lifted;
        let last = path[path.len() - 1];
        let rule = if left.is_some() { ToolContact::Forbidden } else { ToolContact::Allowed };
        let next = reach_for(arm, &target, &last)
            .filter(|next| arm.within_margins(next) && world.motion_free(&last, next, rule));
        let Some(next) = next else { break };
        path.push(next);
        if left.is_none() && world.is_free(&next, ToolContact::Forbidden) {
            left = Some(path.len());
        }
    }
    left.map(|_| path)
}

/// The joint vector near `from` that puts the tip on `target`, by damped least squares.
fn reach_for(arm: &Arm, target: &Isometry3<f64>, from: &JointVector) -> Option<JointVector> {
    let mut q = *from;
    for _ in 0..LIFT_ITERATIONS {
        let error = pose_error(&arm.tip_pose(&q), target);
        if error.fixed_rows::<3>(0).norm() < LIFT_TOLERANCE
            && error.fixed_rows::<3>(3).norm() < LIFT_TOLERANCE
        {
            return Some(q);
        }
        q = q + damped_step(&arm.jacobian(&q), &error, DAMPING * DAMPING)?;
    }
    None
}
