//! The whole of the crate: the fast check against the exact one, and what both are built from.

mod agree;
mod pairs;
mod scene;

use std::fmt::Write as _;
use std::io::Write as _;

use nalgebra::{Isometry3, Point3, Vector3};
use nullsweep_robot::{Arm, ArmSpec, Geometry, JointVector, Robot, Side, Tool};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::*;

/// A wavy wall in front of the robot, seen with ±2 mm of noise.
fn wall(count: usize, seed: u64) -> Vec<Point3<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..count)
        .map(|_| {
            let (y, z) = (rng.random_range(-0.7..0.3), rng.random_range(0.4..1.2));
            let x = 0.7 + 0.05 * libm::sin(5.0_f64 * y) + rng.random_range(-0.002..0.002);
            Point3::new(x, y, z)
        })
        .collect()
}

fn random_configuration(arm: &Arm, rng: &mut ChaCha8Rng) -> JointVector {
    let mut q = JointVector::default();
    for (value, limits) in q.iter_mut().zip(arm.limits()) {
        *value = if limits.continuous {
            rng.random_range(-7.0..7.0)
        } else {
            rng.random_range(limits.lower..=limits.upper)
        };
    }
    q
}

/// Configurations with the pad near the wall: where contact, noise and margins matter.
fn near_wall(arm: &Arm, tool: &Tool, scan: &[Point3<f64>], rng: &mut ChaCha8Rng) -> JointVector {
    let mut solutions = nullsweep_robot::Solutions::new();
    loop {
        let p = scan[rng.random_range(0..scan.len())];
        let mut offset = || rng.random_range(-0.02..0.02);
        let at = p + Vector3::new(offset(), offset(), offset());
        let turn = nalgebra::UnitQuaternion::from_euler_angles(
            rng.random_range(-3.1..3.1),
            rng.random_range(-0.3..0.3),
            rng.random_range(-0.3..0.3),
        );
        // Contact frame: z into the wall (root x).
        let into = nalgebra::UnitQuaternion::from_axis_angle(
            &Vector3::y_axis(),
            std::f64::consts::FRAC_PI_2,
        );
        let pose = Isometry3::from_parts(at.into(), turn * into);
        let (low, high) = arm.ik().redundancy_range().unwrap_or((0.0, 0.0));
        let redundancy = rng.random_range(low..=high);
        arm.ik().solve(&(pose * tool.contact_in_tip().inverse()), redundancy, &mut solutions);
        solutions.retain(|s| arm.within_margins(&s.q));
        if !solutions.is_empty() {
            return solutions[rng.random_range(0..solutions.len())].q;
        }
    }
}

fn pr2() -> (Robot, Arm, Tool) {
    let robot = Robot::pr2();
    let arm = robot.arm(&ArmSpec::pr2(Side::Right)).unwrap();
    (robot, arm, Tool::default())
}

fn table() -> Obstacle {
    Obstacle {
        name: "table".into(),
        shape: Geometry::Box { half_extents: Vector3::new(0.3, 0.3, 0.02) }.into(),
        pose: Isometry3::translation(0.7, -0.9, 0.5),
        carries_robot: false,
    }
}

fn pr2_world(points: usize) -> (Arm, Tool, Vec<Point3<f64>>, World) {
    let (robot, arm, tool) = pr2();
    let scan = wall(points, 1);
    let obstacles = [table(), Obstacle::floor(Isometry3::identity())];
    let world = World::new(&robot, &arm, &tool, &scan, &obstacles, &Options::default()).unwrap();
    (arm, tool, scan, world)
}

/// A binary STL of a blob: random points about an ellipsoid, as triangles that hold all of them.
fn write_blob(path: &std::path::Path, half: Vector3<f64>, centre: Vector3<f64>, seed: u64) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut points = Vec::new();
    while points.len() < 60 {
        let mut unit = || rng.random_range(-1.0..1.0);
        let v = Vector3::new(unit(), unit(), unit());
        if v.norm() > 0.2 && v.norm() < 1.0 {
            points.push((v.normalize().component_mul(&half) + centre).cast::<f32>());
        }
    }
    let mut file = std::fs::File::create(path).unwrap();
    file.write_all(&[b' '; 80]).unwrap();
    file.write_all(&(points.len() as u32 / 3).to_le_bytes()).unwrap();
    for triangle in points.chunks_exact(3) {
        file.write_all(&[0; 12]).unwrap();
        for x in triangle.iter().flat_map(|v| v.iter()) {
            file.write_all(&x.to_le_bytes()).unwrap();
        }
        file.write_all(&[0; 2]).unwrap();
    }
}

/// A six-joint arm on a column, every link but the column a mesh.
fn mesh_robot(folder: &std::path::Path) -> Robot {
    let mut xml = String::from(
        "<robot name='blobs'><link name='l0'><collision><origin xyz='0 0 0.2'/><geometry>\
         <box size='0.2 0.2 0.4'/></geometry></collision></link>",
    );
    let axes = ["0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0"];
    for (n, axis) in axes.iter().enumerate() {
        let (parent, link) = (n, n + 1);
        write_blob(
            &folder.join(format!("l{link}.stl")),
            Vector3::new(0.13, 0.05, 0.06),
            Vector3::new(0.12, 0.0, 0.0),
            link as u64,
        );
        let (x, z) = if n == 0 { (0.0, 0.5) } else { (0.25, 0.0) };
        write!(
            xml,
            "<link name='l{link}'><collision><geometry><mesh filename='package://blobs/l{link}.stl'\
             /></geometry></collision></link><joint name='j{n}' type='revolute'><parent \
             link='l{parent}'/><child link='l{link}'/><origin xyz='{x} 0 {z}'/><axis xyz='{axis}'/>\
             <limit lower='-2.5' upper='2.5' velocity='1' effort='1'/></joint>"
        )
        .unwrap();
    }
    Robot::from_urdf_str(&(xml + "</robot>")).unwrap()
}
