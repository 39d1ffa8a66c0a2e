//! Motions through free space: lifting the tool off, going elsewhere, setting it down again.
//!
//! Every segment of a returned path is a straight joint line that
//! [`World::motion_free`](nullsweep_collision::World::motion_free) has proven. Paths start at the
//! given joint vector and end at the other one but for whole turns of continuous joints, which are
//! left out wherever that is nearer: paths are unwrapped. No path is a result, not an error.

use std::f64::consts::PI;

use nalgebra::{Matrix6, Vector3, Vector6};
use nullsweep_collision::{ToolContact, World};
use nullsweep_robot::{Arm, JointVector, MAX_DOF, Tool};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::workcell::Workcell;

/// How hard to look for a path. All limits are counts, so a seed gives the same path anywhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Samples drawn by RRT-Connect.
    pub samples: usize,
    /// Longest segment of a tree, Euclidean over the joints. \[rad\]
    pub step: f64,
    /// Shortcuts tried on the path found.
    pub shortcuts: usize,
    /// How far the tool is lifted off before it travels. \[m\]
    pub lift: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self { samples: 600, step: 0.8, shortcuts: 60, lift: 0.05 }
    }
}

/// Spacing of the waypoints while the tool is lifted off. \[m\]
const LIFT_STEP: f64 = 0.005;
/// A lift that is blocked counts as done if the tool is clear of the surface by then.
const LIFT_ITERATIONS: usize = 12;
/// A waypoint of the lift is on the line to this. \[m, rad\]
const LIFT_TOLERANCE: f64 = 1e-6;
/// Damping of the lift's steps near a singularity.
const DAMPING: f64 = 1e-3;

/// The way from one contact (or free configuration) to another: lift off, transfer, set down.
///
/// An end that is free with the tool's margin kept needs no lift.
#[must_use]
pub fn jump(
    cell: Workcell<'_>,
    from: &JointVector,
    to: &JointVector,
    seed: u64,
) -> Option<Vec<JointVector>> {
    let options = Options::default();
    let to = cell.arm.continuous().nearest_turn(to, from);
    let mut path = lift(cell, from)?;
    let mut down = lift(cell, &to)?;
    down.reverse();
    let (above, goal) = (path.pop()?, down[0]);
    let across = plan(cell.world, cell.arm, &above, &goal, &options, seed)?;
    let arrived = *across.last()?;
    path.extend(across);
    // The set-down turns with the transfer's end.
    let turns = arrived - goal;
    path.extend(down[1..].iter().map(|q| *q + turns));
    Some(path)
}

/// The way off the surface: none but `q` itself where the tool keeps its margin already, else
/// [`retract`] by the default lift.
#[must_use]
pub fn lift(cell: Workcell<'_>, q: &JointVector) -> Option<Vec<JointVector>> {
    match cell.world.is_free(q, ToolContact::Forbidden) {
        true => Some(vec![*q]),
        false => retract(cell.world, cell.arm, cell.tool, q, Options::default().lift),
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
    let contact = arm.tip_pose(q) * tool.contact_in_tip();
    let normal = contact.rotation * -Vector3::z();
    let up = Vector3::z();
    let home = -contact.translation.vector.component_mul(&Vector3::new(1.0, 1.0, 0.0)).normalize();
    [normal, normal + up, normal + home, normal + up + home]
        .into_iter()
        .filter_map(|way| way.try_normalize(0.1))
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
        let way = distance * step as f64 / steps as f64;
        let mut target = start;
        target.translation.vector += away * way;
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

/// A path from `from` to `to` on which the tool too keeps its margin: the straight joint line if
/// that is free, else RRT-Connect (Kuffner and LaValle, 2000) and shortcuts.
///
/// Samples are drawn inside the margined limits; `from` and `to` must be free, and may lie outside
/// of them.
#[must_use]
pub fn plan(
    world: &World,
    arm: &Arm,
    from: &JointVector,
    to: &JointVector,
    options: &Options,
    seed: u64,
) -> Option<Vec<JointVector>> {
    let goal = arm.continuous().nearest_turn(to, from);
    let free = |a: &JointVector, b: &JointVector| world.motion_free(a, b, ToolContact::Forbidden);
    if !world.is_free(from, ToolContact::Forbidden) || !world.is_free(&goal, ToolContact::Forbidden)
    {
        return None;
    }
    if free(from, &goal) {
        return Some(vec![*from, goal]);
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let ranges: Vec<(f64, f64)> = arm
        .limits()
        .iter()
        .zip(arm.margined_limits())
        .enumerate()
        .map(|(j, (limits, margined))| {
            // A turn to either side of the ends reaches every orientation.
            let wide = (from[j].min(goal[j]) - PI, from[j].max(goal[j]) + PI);
            if limits.continuous { wide } else { *margined }
        })
        .collect();

    let mut trees = [Tree::new(*from), Tree::new(goal)];
    let mut growing = 0;
    for _ in 0..options.samples {
        let mut sample = JointVector::default();
        for (value, (lower, upper)) in sample.iter_mut().zip(&ranges) {
            *value = rng.random_range(*lower..=*upper);
        }
        if let Some(new) = trees[growing].extend(&sample, options.step, free) {
            let target = trees[growing].nodes[new].0;
            if let Some(met) = trees[1 - growing].connect(&target, options.step, free) {
                let mut path = trees[growing].way_to(new);
                let mut rest = trees[1 - growing].way_to(met);
                rest.reverse();
                // Both trees hold the node where they meet.
                path.extend(&rest[1..]);
                if growing == 1 {
                    path.reverse();
                }
                shortcut(&mut path, options.shortcuts, &mut rng, free);
                return Some(path);
            }
        }
        growing = 1 - growing;
    }
    None
}

/// The joint vector near `from` that puts the tip on `target`, by damped least squares.
fn reach_for(
    arm: &Arm,
    target: &nalgebra::Isometry3<f64>,
    from: &JointVector,
) -> Option<JointVector> {
    let mut q = *from;
    for _ in 0..LIFT_ITERATIONS {
        let pose = arm.tip_pose(&q);
        let linear = target.translation.vector - pose.translation.vector;
        let angular = (target.rotation * pose.rotation.inverse()).scaled_axis();
        if linear.norm() < LIFT_TOLERANCE && angular.norm() < LIFT_TOLERANCE {
            return Some(q);
        }
        let error = Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z);
        let jacobian = arm.jacobian(&q);
        let damped = jacobian * jacobian.transpose() + Matrix6::identity() * (DAMPING * DAMPING);
        let step = jacobian.transpose() * damped.cholesky()?.solve(&error);
        for j in 0..MAX_DOF {
            q[j] += step[j];
        }
    }
    None
}

/// A tree of free configurations, each with the index of its parent (its own for the root).
struct Tree {
    nodes: Vec<(JointVector, usize)>,
}

impl Tree {
    fn new(root: JointVector) -> Self {
        Self { nodes: vec![(root, 0)] }
    }

    /// Adds a node at most one step towards `target`, from the nearest one.
    fn extend(
        &mut self,
        target: &JointVector,
        step: f64,
        free: impl Fn(&JointVector, &JointVector) -> bool,
    ) -> Option<usize> {
        let mut nearest = (f64::INFINITY, 0);
        for (index, (q, _)) in self.nodes.iter().enumerate() {
            let distance = q.distance(target);
            if distance < nearest.0 {
                nearest = (distance, index);
            }
        }
        self.step_from(nearest.1, target, step, free)
    }

    /// Steps towards `target` until it is reached; its node, unless something is in the way.
    fn connect(
        &mut self,
        target: &JointVector,
        step: f64,
        free: impl Fn(&JointVector, &JointVector) -> bool,
    ) -> Option<usize> {
        let mut at = self.extend(target, step, &free)?;
        while self.nodes[at].0 != *target {
            at = self.step_from(at, target, step, &free)?;
        }
        Some(at)
    }

    fn step_from(
        &mut self,
        parent: usize,
        target: &JointVector,
        step: f64,
        free: impl Fn(&JointVector, &JointVector) -> bool,
    ) -> Option<usize> {
        let from = self.nodes[parent].0;
        let length = from.distance(target);
        let next = if length <= step { *target } else { from.lerp(target, step / length) };
        free(&from, &next).then(|| {
            self.nodes.push((next, parent));
            self.nodes.len() - 1
        })
    }

    /// From the root to a node.
    fn way_to(&self, node: usize) -> Vec<JointVector> {
        let mut way = vec![self.nodes[node].0];
        let mut at = node;
        while at != self.nodes[at].1 {
            at = self.nodes[at].1;
            way.push(self.nodes[at].0);
        }
        way.reverse();
        way
    }
}

/// Replaces stretches of the path by straight lines where that is shorter and free.
fn shortcut(
    path: &mut Vec<JointVector>,
    tries: usize,
    rng: &mut ChaCha8Rng,
    free: impl Fn(&JointVector, &JointVector) -> bool,
) {
    for _ in 0..tries {
        if path.len() < 3 {
            return;
        }
        // Two places anywhere on the path, as segment and fraction.
        let mut place = || {
            let at = rng.random_range(0.0..(path.len() - 1) as f64);
            (at as usize, at.fract())
        };
        let (mut first, mut second) = (place(), place());
        if first.0 > second.0 {
            std::mem::swap(&mut first, &mut second);
        }
        if first.0 == second.0 {
            continue;
        }
        let on = |(segment, t): (usize, f64)| -> JointVector {
            let (a, b) = (&path[segment], &path[segment + 1]);
            a.lerp(b, t)
        };
        let (a, b) = (on(first), on(second));
        let mut around = vec![a];
        around.extend(&path[first.0 + 1..=second.0]);
        around.push(b);
        if a.distance(&b) < length(&around) - 1e-9 && free(&a, &b) {
            path.splice(first.0 + 1..=second.0, [a, b]);
        }
    }
    // Waypoints that nothing stands in the way of leaving out.
    let mut i = 1;
    while i + 1 < path.len() {
        if free(&path[i - 1], &path[i + 1]) {
            path.remove(i);
        } else {
            i += 1;
        }
    }
}

fn length(path: &[JointVector]) -> f64 {
    path.windows(2).map(|pair| pair[0].distance(&pair[1])).sum()
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Point3, UnitQuaternion};
    use nullsweep_collision::{self as collision, Obstacle, ObstacleShape};
    use nullsweep_robot::{ArmSpec, Robot, Side, Solutions};

    use super::*;

    /// A flat board before the robot, a post standing on its right half.
    fn setting() -> (Arm, Tool, World) {
        let robot = Robot::pr2();
        let arm = robot.arm(&ArmSpec::pr2(Side::Right)).unwrap();
        let tool = Tool::default();
        let mut board = Vec::new();
        for i in 0..80 {
            for k in 0..50 {
                board.push(Point3::new(
                    0.70,
                    -0.60 + 0.01 * f64::from(i),
                    0.60 + 0.01 * f64::from(k),
                ));
            }
        }
        let post = Obstacle {
            name: "post".into(),
            shape: ObstacleShape::Box { half_extents: Vector3::new(0.06, 0.02, 0.25) },
            pose: Isometry3::translation(0.63, -0.2, 0.85),
            carries_robot: false,
        };
        let options = collision::Options::default();
        let world = World::new(&robot, &arm, &tool, &board, &[post], &options).unwrap();
        (arm, tool, world)
    }

    /// A joint vector that holds the pad flat on the board.
    fn contact(arm: &Arm, tool: &Tool, world: &World, y: f64, z: f64) -> JointVector {
        let into = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), PI / 2.0);
        let mut solutions = Solutions::new();
        let (low, high) = arm.ik().redundancy_range().unwrap();
        for turn in 0..12 {
            let about = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), f64::from(turn) * 0.5);
            let pose = Isometry3::from_parts(Vector3::new(0.70, y, z).into(), about * into);
            for k in 0..40 {
                let redundancy = low + (high - low) * f64::from(k) / 39.0;
                let target = pose * tool.contact_in_tip().inverse();
                arm.ik().solve(&target, redundancy, &mut solutions);
                let works = |q: &JointVector| {
                    arm.within_margins(q)
                        && world.is_free(q, ToolContact::Allowed)
                        && retract(world, arm, tool, q, 0.05).is_some()
                };
                if let Some(s) = solutions.iter().find(|s| works(&s.q)) {
                    return s.q;
                }
            }
        }
        panic!("no contact at {y}, {z}");
    }

    #[test]
    fn a_lift_goes_straight_off_the_surface() {
        let (arm, tool, world) = setting();
        let q = contact(&arm, &tool, &world, -0.35, 0.8);
        let path = retract(&world, &arm, &tool, &q, 0.05).unwrap();
        assert_eq!(path[0], q);
        let pad = |q: &JointVector| (arm.tip_pose(q) * tool.contact_in_tip()).translation.vector;
        for (n, waypoint) in path.iter().enumerate() {
            let wanted = pad(&q) - Vector3::x() * 0.005 * n as f64;
            assert!((pad(waypoint) - wanted).norm() < 1e-5, "waypoint {n}");
        }
        assert!(!world.is_free(&q, ToolContact::Forbidden));
        assert!(world.is_free(path.last().unwrap(), ToolContact::Forbidden));
    }

    #[test]
    fn a_jump_over_a_post_is_free_all_along_and_depends_on_the_seed_alone() {
        let (arm, tool, world) = setting();
        let cell = Workcell { arm: &arm, tool: &tool, world: &world };
        let from = contact(&arm, &tool, &world, -0.42, 0.85);
        let to = contact(&arm, &tool, &world, 0.02, 0.85);
        let path = jump(cell, &from, &to, 3).expect("a way around the post");
        assert_eq!(path, jump(cell, &from, &to, 3).unwrap());
        assert_eq!(path[0], from);
        let end = path.last().unwrap();
        assert_eq!(arm.continuous().nearest_turn(&to, end), *end);
        let straight = [path[0], *end];
        assert!(length(&path) > length(&straight) + 0.1, "{} waypoints", path.len());
        for pair in path.windows(2) {
            for step in 0..=10 {
                let t = f64::from(step) / 10.0;
                let q = pair[0].lerp(&pair[1], t);
                let hit = world.exact().first_hit(&q, ToolContact::Allowed);
                assert!(hit.is_none(), "{}", hit.unwrap());
            }
        }
    }

    #[test]
    fn no_way_is_a_result() {
        let (arm, tool, world) = setting();
        let q = contact(&arm, &tool, &world, -0.42, 0.85);
        // In contact the tool does not keep its margin, so there is no transfer from there.
        assert_eq!(plan(&world, &arm, &q, &arm.home(), &Options::default(), 1), None);
        // The post blocks the straight line, and without samples there is nothing else.
        let lift = |y: f64| {
            let q = contact(&arm, &tool, &world, y, 0.85);
            *retract(&world, &arm, &tool, &q, 0.05).unwrap().last().unwrap()
        };
        let options = Options { samples: 0, ..Options::default() };
        assert_eq!(plan(&world, &arm, &lift(-0.42), &lift(0.02), &options, 1), None);
    }
}
