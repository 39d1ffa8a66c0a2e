//! Lifts, jumps and paths through free space.

use std::f64::consts::PI;

use nalgebra::{Isometry3, Point3, UnitQuaternion, UnitVector3, Vector3};
use nullsweep_collision::{self as collision, Obstacle, ToolContact, World};
use nullsweep_robot::{Arm, ArmSpec, Geometry, JointVector, Robot, Side, Solutions, Tool};
use nullsweep_surface::{Patch, Scan, Surface};

use super::layered::{Link, Motion, Moves};
use super::retreat::retract;
use super::rrt_connect::{Options, length, rrt_connect};
use super::{Leg, Memo, Mover, jump};
use crate::cost::Effort;
use crate::progress::Silent;
use crate::roadmap::{GraphConfig, Nodes, graph};
use crate::workcell::{Bed, Sample, Workcell, contact_pose, direction, reach, redundancies};

/// A flat board before the robot, a post standing on its right half.
fn setting() -> (Arm, Tool, World) {
    let robot = Robot::pr2();
    let arm = robot.arm(&ArmSpec::pr2(Side::Right)).unwrap();
    let tool = Tool::default();
    let mut board = Vec::new();
    for i in 0..80 {
        for k in 0..50 {
            board.push(Point3::new(0.70, -0.60 + 0.01 * f64::from(i), 0.60 + 0.01 * f64::from(k)));
        }
    }
    let post = Obstacle {
        name: "post".into(),
        shape: Geometry::Box { half_extents: Vector3::new(0.06, 0.02, 0.25) }.into(),
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
    assert_eq!(rrt_connect(&world, &arm, &q, &arm.home(), &Options::default(), 1), None);
    // The post blocks the straight line, and without samples there is nothing else.
    let lift = |y: f64| {
        let q = contact(&arm, &tool, &world, y, 0.85);
        *retract(&world, &arm, &tool, &q, 0.05).unwrap().last().unwrap()
    };
    let options = Options { samples: 0, ..Options::default() };
    assert_eq!(rrt_connect(&world, &arm, &lift(-0.42), &lift(0.02), &options, 1), None);
}

/// Asks for a motion along an edge, or beside it.
type Way = fn(&Mover<'_, Effort>, (usize, bool), &Sample, &Sample) -> Result<Motion<Leg>, String>;

/// What there is to a motion, to the bit.
fn told(motion: Motion<Leg>) -> (u64, Vec<JointVector>, Vec<Option<Point3<f64>>>) {
    (motion.cost.to_bits(), motion.path.joints, motion.path.line)
}

#[test]
fn a_motion_is_the_same_whether_it_was_asked_for_before_or_not() {
    let (arm, tool, world) = setting();
    let cell = Workcell { arm: &arm, tool: &tool, world: &world };
    let points: Vec<Point3<f64>> = (0..80 * 50)
        .map(|n| {
            let (i, k) = (f64::from(n % 80), f64::from(n / 80));
            Point3::new(0.70, -0.60 + 0.01 * i, 0.60 + 0.01 * k)
        })
        .collect();
    let outward = UnitVector3::new_normalize(-Vector3::x());
    let normals = vec![outward; points.len()];
    let bed =
        Bed::soft(Surface::new(&Scan { raw: points.clone(), points, normals, spacing: 0.01 }));
    // Beside the post, the pad meets it at some headings and redundancy values and not at others.
    let patches: Vec<Patch> = [-0.36, -0.29]
        .map(|y| Patch {
            centre: Point3::new(0.70, y, 0.85),
            normal: outward,
            points: Vec::new(),
            rmse: 0.0,
        })
        .into();
    let reached = reach(cell, &patches, 24, &|| ());
    assert!(reached.iter().all(Option::is_some));
    let nodes = Nodes { bed: &bed, patches: &patches, reached: &reached };
    let graph = graph::build(cell, nodes, &GraphConfig::default(), None, &Silent);
    let values = redundancies(arm.ik().redundancy_range(), 12);
    let layer = |patch: usize| {
        let heading = graph.edges[0].heading_a;
        let Patch { centre, normal, .. } = &patches[patch];
        let pose = contact_pose(centre, normal, &direction(normal, heading), tool.stand_off);
        let mut samples = Vec::new();
        cell.samples(&pose, heading, &values, &mut samples);
        samples
    };
    let (from, to) = (layer(0), layer(1));
    let stops = [0, 1];
    let source = arm.home();
    let seed = 5;
    let kept = Memo::new(seed);
    let warm = Mover::new(cell, &graph, &stops, &Effort, source, &kept);
    let Link::Surface { edge, reversed } = warm.link(0, 1) else { panic!("an edge") };
    let (mut made, mut failed) = ([0; 3], [0; 3]);
    // What is asked for again comes after other motions.
    for round in 0..2 {
        let pairs = from.iter().flat_map(|a| to.iter().map(move |b| (a, b)));
        // No track arrives beside a sample.
        let beside = |b: &Sample| Sample { q: b.q + JointVector::from_fn(|_| 0.05), ..*b };
        let ends = |(a, b): (&Sample, &Sample)| [(*a, *b), (*a, beside(b))];
        for (a, b) in pairs.step_by(5).take(40).flat_map(ends) {
            let (a, b) = (&a, &b);
            let fresh = Memo::new(seed);
            let cold = Mover::new(cell, &graph, &stops, &Effort, source, &fresh);
            let ways: [Way; 3] = [
                |mover, link, a, b| mover.track(link, a, b).map_err(|b| format!("{b:?}")),
                |mover, link, a, b| mover.around(link, a, b).ok_or_else(String::new),
                |mover, _, a, b| mover.jump(Some(a), b).ok_or_else(String::new),
            ];
            for (kind, way) in ways.into_iter().enumerate() {
                let [one, other] = [&warm, &cold].map(|m| way(m, (edge, reversed), a, b).map(told));
                assert_eq!(one, other, "round {round}");
                made[kind] += usize::from(one.is_ok());
                failed[kind] += usize::from(one.is_err());
            }
        }
        let fresh = Memo::new(seed);
        let cold = Mover::new(cell, &graph, &stops, &Effort, source, &fresh);
        let [one, other] = [&warm, &cold].map(|mover| mover.jump(None, &to[0]).map(told));
        assert_eq!(one, other);
    }
    assert!(made.iter().all(|n| *n > 0) && failed[0] > 0, "{made:?} made, {failed:?} not");
}
