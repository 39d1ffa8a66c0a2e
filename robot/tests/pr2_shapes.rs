//! The collision shapes of our PR2: around the real robot's extents, and clear of each other.

use nalgebra::{Isometry3, Point3, Vector3};
use nullsweep_robot::{Arm, ArmSpec, CollisionShape, Geometry, JointVector, Robot, Side};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Extents of the real robot's collision meshes in the link frames, min and max \[m\], measured.
const EXTENTS: [(&str, [f64; 3], [f64; 3]); 12] = [
    ("base_link", [-0.3341, -0.3341, 0.0], [0.3341, 0.3341, 0.6562]),
    ("torso_lift_link", [-0.2877, -0.2636, -0.5060], [0.1116, 0.2636, 0.3140]),
    ("shoulder_pan_link", [-0.1270, -0.1269, -0.4913], [0.2287, 0.1270, 0.1420]),
    ("shoulder_lift_link", [-0.1269, -0.0767, -0.1266], [0.1215, 0.0761, 0.1274]),
    // The rod that reaches back into the shoulder, x < 0.1404, is inside the shoulder's lift link.
    ("upper_arm_link", [0.1404, -0.0769, -0.0860], [0.4837, 0.0756, 0.0825]),
    ("elbow_flex_link", [-0.0803, -0.0470, -0.0800], [0.0925, 0.0459, 0.0802]),
    // The part inside the elbow, x < 0.0925, is left out.
    ("forearm_roll_link", [0.0925, -0.0412, -0.0410], [0.1065, 0.0411, 0.0410]),
    ("forearm_link", [0.0945, -0.0596, -0.0539], [0.3572, 0.0600, 0.0659]),
    ("wrist_flex_link", [-0.0370, -0.0213, -0.0405], [0.0275, 0.0212, 0.0374]),
    // The part inside the wrist, x < 0.0368, is left out.
    ("wrist_roll_link", [0.0368, -0.0189, -0.0191], [0.0417, 0.0189, 0.0189]),
    // Its first 12 mm are inside the wrist roll link's neighbourhood.
    ("gripper_palm_link", [0.0417, -0.0503, -0.0242], [0.1254, 0.0506, 0.0242]),
    // Both fingers and their tips, closed: origin 0.0768 m ahead of the palm's.
    ("gripper_fingers_link", [-0.0089, -0.0556, -0.0276], [0.1222, 0.0556, 0.0276]),
];

/// Extents of slabs of the meshes along x.
const SLABS: [(&str, [f64; 3], [f64; 3]); 8] = [
    ("upper_arm_link", [0.18, -0.0701, -0.0860], [0.24, 0.0706, 0.0757]),
    ("upper_arm_link", [0.24, -0.0643, -0.0860], [0.30, 0.0649, 0.0542]),
    ("upper_arm_link", [0.30, -0.0656, -0.0852], [0.36, 0.0663, 0.0709]),
    ("upper_arm_link", [0.36, -0.0692, -0.0848], [0.42, 0.0703, 0.0825]),
    ("forearm_link", [0.13, -0.0589, -0.0513], [0.17, 0.0588, 0.0659]),
    ("forearm_link", [0.21, -0.0596, -0.0480], [0.25, 0.0593, 0.0286]),
    ("forearm_link", [0.25, -0.0596, -0.0480], [0.29, 0.0594, 0.0215]),
    ("forearm_link", [0.29, -0.0593, -0.0476], [0.33, 0.0594, 0.0361]),
];

#[test]
fn shapes_reach_as_far_as_the_real_links() {
    let robot = Robot::pr2();
    for (name, min, max) in &EXTENTS {
        for side in ["r_", "l_"] {
            let plain = matches!(*name, "base_link" | "torso_lift_link");
            let link = if plain { (*name).to_owned() } else { format!("{side}{name}") };
            let link = &robot.links()[robot.link_index(&link).unwrap()];
            for axis in 0..3 {
                // The middle of each face of the extents is reached by some shape: its extent
                // along the axis goes as far.
                let (low, high) = extent(&link.collisions, axis);
                assert!(
                    low <= min[axis] + 1e-9,
                    "{} axis {axis}: {low} > {}",
                    link.name,
                    min[axis]
                );
                assert!(
                    high >= max[axis] - 1e-9,
                    "{} axis {axis}: {high} < {}",
                    link.name,
                    max[axis]
                );
            }
        }
    }
}

#[test]
fn shapes_reach_as_far_as_the_real_links_in_each_slab() {
    let robot = Robot::pr2();
    for (name, min, max) in &SLABS {
        let shapes = &robot.links()[robot.link_index(&format!("r_{name}")).unwrap()].collisions;
        // Some point of each face of the slab's extents is inside a shape.
        for axis in [1, 2] {
            let other = 3 - axis;
            for face in [min[axis], max[axis]] {
                let between =
                    |axis: usize, k: i32| min[axis] + (max[axis] - min[axis]) * f64::from(k) / 20.0;
                let inside = (0..=20).flat_map(|i| (0..=20).map(move |j| (i, j))).any(|(i, j)| {
                    let mut p = Point3::new(between(0, i), 0.0, 0.0);
                    (p[axis], p[other]) = (face, between(other, j));
                    let local = |s: &CollisionShape| s.origin.inverse_transform_point(&p);
                    shapes.iter().any(|s| signed_distance(s, &local(s)) <= 1e-9)
                });
                assert!(inside, "{name} from x = {}: {face} along axis {axis}", min[0]);
            }
        }
    }
}

#[test]
fn shapes_are_at_most_two_centimetres_larger_than_the_real_links() {
    let robot = Robot::pr2();
    // The base includes the casters below and the bellow above.
    for (name, min, max) in EXTENTS.iter().filter(|(name, ..)| *name != "base_link") {
        let link =
            if *name == "torso_lift_link" { (*name).to_owned() } else { format!("r_{name}") };
        let link = &robot.links()[robot.link_index(&link).unwrap()];
        for axis in 0..3 {
            let (low, high) = extent(&link.collisions, axis);
            assert!(low >= min[axis] - 0.02 && high <= max[axis] + 0.02, "{} {axis}", link.name);
        }
    }
}

#[test]
fn home_is_clear_of_everything() {
    for side in [Side::Right, Side::Left] {
        let arm = Robot::pr2().arm(&ArmSpec::pr2(side)).unwrap();
        assert!(arm.within_margins(&arm.home()));
        // The shoulder is always 15 mm from torso and base, wherever the arm is.
        for torso in [0.0115, 0.325] {
            let arm = arm.with_held(&[("torso_lift_joint", torso)]).unwrap();
            let (distance, one, other) = nearest_pair(&arm, &arm.home(), "shoulder");
            println!("{side:?}, torso {torso}: {distance:.3} m between {one} and {other}");
            assert!(distance > 0.04, "{distance} m between {one} and {other}");
        }
        let tip = arm.tip_pose(&arm.home());
        let into = tip.rotation * Vector3::x();
        println!(
            "tip {:.3?}, pad towards {:.3?}",
            tip.translation.vector.data.0[0], into.data.0[0]
        );
        assert!(tip.translation.x > 0.5 && into.x > 0.3 && into.z < -0.3);
    }
}

#[test]
fn the_held_arm_is_out_of_the_way() {
    let robot = Robot::pr2();
    for (side, other) in [(Side::Right, Side::Left), (Side::Left, Side::Right)] {
        let arm = robot.arm(&ArmSpec::pr2(side)).unwrap();
        assert_eq!(arm.held_joints().len(), 8, "the torso and the other arm");
        let held = robot.arm(&ArmSpec::pr2(other)).unwrap();
        let q: JointVector = JointVector::from_fn(|i| {
            held.joint_names().get(i).map_or(0.0, |name| {
                arm.held_joints().iter().find(|h| h.name == *name).unwrap().position
            })
        });
        assert!(held.within_margins(&q));
        let (distance, one, another) = nearest_pair(&held, &q, "shoulder");
        println!("{other:?} held: {distance:.3} m between {one} and {another}");
        assert!(distance > 0.03, "{distance} m between {one} and {another}");
    }
}

#[test]
fn working_postures_do_not_touch_themselves() {
    let arm = Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut counts = std::collections::BTreeMap::new();
    let total = 100;
    let mut touching = 0;
    for _ in 0..total {
        let mut q = JointVector::ZERO;
        for (i, q) in q.iter_mut().enumerate().take(7) {
            let (lower, upper) = arm.margined_limits()[i];
            *q = rng.random_range(lower.max(-3.1)..upper.min(3.1));
        }
        let (distance, one, other) = nearest_pair(&arm, &q, "none");
        if distance < 0.0 {
            touching += 1;
            *counts.entry((one, other)).or_insert(0) += 1;
        }
    }
    println!("{touching} of {total} random postures touch: {counts:#?}");
    assert!(touching * 3 < total);
}

/// Extent of shapes along an axis of the link.
fn extent(shapes: &[CollisionShape], axis: usize) -> (f64, f64) {
    let direction = Vector3::ith(axis, 1.0);
    shapes.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), shape| {
        let local = shape.origin.rotation.inverse() * direction;
        let half = match shape.geometry {
            Geometry::Box { half_extents } => half_extents.dot(&local.abs()),
            Geometry::Cylinder { radius, half_length } => {
                half_length * local.z.abs() + radius * local.xy().norm()
            }
            Geometry::Sphere { radius } => radius,
            _ => panic!("only boxes, cylinders and spheres"),
        };
        let centre = shape.origin.translation.vector[axis];
        (low.min(centre - half), high.max(centre + half))
    })
}

/// Groups of links that do not move against each other, by link index.
fn groups(robot: &Robot) -> (Vec<usize>, Vec<(usize, usize)>) {
    let mut group: Vec<usize> = (0..robot.links().len()).collect();
    let mut adjacent = Vec::new();
    // Links come parents first in this file.
    for joint in robot.joints() {
        if joint.is_independent() {
            adjacent.push((group[joint.parent], joint.child));
        } else {
            group[joint.child] = group[joint.parent];
        }
    }
    (group, adjacent)
}

/// Whether two links are on either side of shoulder, elbow or wrist: always close, and kept apart by
/// the limits of the one joint between them.
fn across_a_joint(one: &str, other: &str) -> bool {
    let before_after = [
        ("shoulder_pan", "upper_arm"),
        ("upper_arm", "forearm"),
        ("forearm", "wrist_roll"),
        ("forearm", "gripper"),
    ];
    before_after.iter().any(|(a, b)| {
        let is = |link: &str, part: &str| link.get(2..).is_some_and(|rest| rest.starts_with(part));
        is(one, a) && is(other, b) || is(other, a) && is(one, b)
    })
}

/// Smallest distance of two links that are no neighbours and of which one moves, by surface points
/// about a centimetre apart. Negative: they overlap. Leaves out moving links named `without`.
fn nearest_pair(arm: &Arm, q: &JointVector, without: &str) -> (f64, String, String) {
    let robot = arm.robot();
    let (group, adjacent) = groups(&robot);
    let mut poses = vec![Isometry3::identity(); robot.links().len()];
    arm.link_poses(q, &mut poses);
    let mut best = (f64::INFINITY, String::new(), String::new());
    for &moving in arm.moving_links() {
        for other in 0..robot.links().len() {
            let pair = (group[moving], group[other]);
            let near = adjacent.contains(&pair) || adjacent.contains(&(pair.1, pair.0));
            let links = robot.links();
            let across = across_a_joint(&links[moving].name, &links[other].name);
            if near || across || pair.0 == pair.1 || links[moving].name.contains(without) {
                continue;
            }
            for a in &robot.links()[moving].collisions {
                for b in &robot.links()[other].collisions {
                    let between = (poses[other] * b.origin).inv_mul(&(poses[moving] * a.origin));
                    let distance = sampled_distance(a, b, &between).min(sampled_distance(
                        b,
                        a,
                        &between.inverse(),
                    ));
                    if distance < best.0 {
                        let name = |i: usize| robot.links()[i].name.clone();
                        best = (distance, name(moving), name(other));
                    }
                }
            }
        }
    }
    best
}

/// Smallest signed distance of the surface points of `a` to `b`; `between` takes a to b.
fn sampled_distance(a: &CollisionShape, b: &CollisionShape, between: &Isometry3<f64>) -> f64 {
    let radius = bounding_radius(a) + bounding_radius(b);
    let far = between.translation.vector.norm() - radius;
    if far > 0.15 {
        return far;
    }
    surface(a).iter().map(|p| signed_distance(b, &(between * p))).fold(f64::INFINITY, f64::min)
}

fn bounding_radius(shape: &CollisionShape) -> f64 {
    match shape.geometry {
        Geometry::Box { half_extents } => half_extents.norm(),
        Geometry::Cylinder { radius, half_length } => radius.hypot(half_length),
        _ => panic!("only boxes and cylinders"),
    }
}

fn surface(shape: &CollisionShape) -> Vec<Point3<f64>> {
    let grid = |half: f64| {
        let n = (half / 0.01).ceil().max(1.0) as i32;
        (-n..=n).map(move |i| half * f64::from(i) / f64::from(n))
    };
    let mut points = Vec::new();
    match shape.geometry {
        Geometry::Box { half_extents: h } => {
            for axis in 0..3 {
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                for a in grid(h[u]) {
                    for b in grid(h[v]) {
                        for end in [-h[axis], h[axis]] {
                            let mut p = Point3::origin();
                            (p[axis], p[u], p[v]) = (end, a, b);
                            points.push(p);
                        }
                    }
                }
            }
        }
        Geometry::Cylinder { radius, half_length } => {
            for k in 0..24 {
                let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / 24.0).sin_cos();
                for z in grid(half_length) {
                    points.push(Point3::new(radius * cos, radius * sin, z));
                }
                for ring in [0.0, 0.25, 0.5, 0.75] {
                    for z in [-half_length, half_length] {
                        points.push(Point3::new(ring * radius * cos, ring * radius * sin, z));
                    }
                }
            }
        }
        _ => panic!("only boxes and cylinders"),
    }
    points
}

fn signed_distance(shape: &CollisionShape, p: &Point3<f64>) -> f64 {
    let outside = |d: &[f64]| {
        let beyond = d.iter().map(|d| d.max(0.0).powi(2)).sum::<f64>().sqrt();
        beyond + d.iter().copied().fold(f64::NEG_INFINITY, f64::max).min(0.0)
    };
    match shape.geometry {
        Geometry::Box { half_extents: h } => outside((p.coords.abs() - h).as_slice()),
        Geometry::Cylinder { radius, half_length } => {
            outside(&[p.coords.xy().norm() - radius, p.z.abs() - half_length])
        }
        _ => panic!("only boxes and cylinders"),
    }
}
