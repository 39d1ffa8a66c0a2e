//! The fast check against the exact one, on primitives and on meshes.

use std::fmt::Write as _;
use std::io::Write as _;

use nalgebra::{Isometry3, Point3, Vector3};
use nullsweep_robot::{Arm, ArmSpec, JointVector, Robot, Side, Tool};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::*;

/// A wavy wall in front of the robot, seen with ±2 mm of noise.
fn wall(count: usize, seed: u64) -> Vec<Point3<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..count)
        .map(|_| {
            let (y, z) = (rng.random_range(-0.7..0.3), rng.random_range(0.4..1.2));
            let x = 0.7 + 0.05 * (5.0_f64 * y).sin() + rng.random_range(-0.002..0.002);
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

/// Fast and exact agree on every configuration; returns how many are free.
fn agree(world: &World, configurations: &[JointVector], contact: ToolContact) -> usize {
    let free: Vec<bool> = configurations
        .par_iter()
        .map(|q| {
            let fast = world.is_free(q, contact);
            let exact = world.exact().first_hit(q, contact);
            let clearance = world.clearance(q, contact);
            match &exact {
                Some(hit) => {
                    assert!(!fast, "passed {q:?} with {contact:?}, but {hit}");
                    assert!(clearance <= 0.0, "clearance {clearance} at {q:?}, but {hit}");
                }
                // Nearer to a margin than the fast check's tolerance is the only excuse.
                None if !fast => assert!(clearance <= 1e-7, "refused {q:?}, {clearance} m clear"),
                None => {}
            }
            exact.is_none()
        })
        .collect();
    free.into_iter().filter(|&f| f).count()
}

fn pr2() -> (Robot, Arm, Tool) {
    let robot = Robot::pr2();
    let arm = robot.arm(&ArmSpec::pr2(Side::Right)).unwrap();
    (robot, arm, Tool::default())
}

fn table() -> Obstacle {
    Obstacle {
        name: "table".into(),
        shape: ObstacleShape::Box { half_extents: Vector3::new(0.3, 0.3, 0.02) },
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

#[test]
fn pr2_fast_check_agrees_with_exact_on_random_configurations() {
    let (arm, _, _, world) = pr2_world(500);
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let all: Vec<_> = (0..10_000).map(|_| random_configuration(&arm, &mut rng)).collect();
    let free = agree(&world, &all, ToolContact::Forbidden);
    assert!((500..9_500).contains(&free), "{free} of 10000 free: the test sees one side only");
}

#[test]
fn pr2_fast_check_agrees_with_exact_near_contact() {
    let (arm, tool, scan, world) = pr2_world(5_000);
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let all: Vec<_> = (0..500).map(|_| near_wall(&arm, &tool, &scan, &mut rng)).collect();
    let touching = agree(&world, &all, ToolContact::Allowed);
    let apart = agree(&world, &all, ToolContact::Forbidden);
    assert!(touching > 50 && touching < 450, "{touching} of 500 free with contact");
    assert!(apart < touching, "{apart} free without contact, {touching} with");
}

#[test]
fn bodies_follow_the_robot_crate() {
    let (robot, arm, tool) = pr2();
    let world = World::new(&robot, &arm, &tool, &[], &[], &Options::default()).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let mut links = vec![Isometry3::identity(); robot.links().len()];
    for _ in 0..200 {
        let q = random_configuration(&arm, &mut rng);
        arm.link_poses(&q, &mut links);
        let poses = world.bodies.poses(&q);
        for (pose, (body, frame)) in links.iter().zip(&world.bodies.links) {
            let ours = body.map_or(*frame, |b| poses[b].then(frame));
            let theirs = frame::Frame::from(pose);
            assert!((ours.translation - theirs.translation).norm() < 1e-12);
            assert!((ours.rotation - theirs.rotation).norm() < 1e-12);
        }
        let tip = poses[world.bodies.tip_body].then(&world.bodies.tip).translation;
        assert!((tip - arm.tip_pose(&q).translation.vector).norm() < 1e-12);
    }
}

#[test]
fn every_pair_is_checked_or_excluded_with_a_reason() {
    let (_, _, _, world) = pr2_world(0);
    let name = |i: usize| world.scene.parts[i].name.as_str();
    for b in 0..world.scene.parts.len() {
        for a in 0..b {
            if !world.scene.moves[a] && !world.scene.moves[b] {
                continue;
            }
            let checked = world.scene.pairs.contains(&(a, b));
            let shape = |i: usize| (0..i).filter(|&k| name(k) == name(i)).count();
            let excluded = world.excluded().iter().any(|e| {
                (e.first.as_str(), e.second.as_str()) == (name(a), name(b))
                    && e.shapes.is_none_or(|s| s == (shape(a), shape(b)))
            });
            let rigid = {
                let body = |i: usize| match world.scene.parts[i].link {
                    Some(link) => world.bodies.links[link].0,
                    None => Some(world.bodies.tip_body),
                };
                body(a) == body(b)
            };
            let ways = u8::from(checked) + u8::from(excluded) + u8::from(rigid);
            assert_eq!(ways, 1, "{} and {}", name(a), name(b));
        }
    }
    assert!(world.arm.home().iter().all(|x| x.is_finite()));
    assert!(
        world.is_free(&world.arm.home(), ToolContact::Forbidden),
        "{}",
        world.why_not(&world.arm.home(), ToolContact::Forbidden).unwrap()
    );
}

#[test]
fn free_motions_are_free_all_along() {
    let (arm, tool, scan, world) = pr2_world(2000);
    let mut rng = ChaCha8Rng::seed_from_u64(10);
    let (mut free, mut blocked) = (0, 0);
    for n in 0..60 {
        let contact = if n % 2 == 0 { ToolContact::Forbidden } else { ToolContact::Allowed };
        let mut draw = || {
            (0..1000)
                .map(|_| match n % 3 {
                    0 => near_wall(&arm, &tool, &scan, &mut rng),
                    _ => random_configuration(&arm, &mut rng),
                })
                .find(|q| world.is_free(q, contact))
                .unwrap()
        };
        let a = draw();
        let far = draw();
        // Short motions and long ones.
        let reach = if n % 4 < 2 { 0.1 } else { 1.0 };
        let b: JointVector = JointVector::from_fn(|j| a[j] + reach * (far[j] - a[j]));
        if !world.motion_free(&a, &b, contact) {
            blocked += 1;
            continue;
        }
        free += 1;
        for step in 0..=100 {
            let t = f64::from(step) / 100.0;
            let q: JointVector = JointVector::from_fn(|j| a[j] + t * (b[j] - a[j]));
            let hit = world.exact().first_hit(&q, contact);
            assert!(hit.is_none(), "motion {n} at {t}: {}", hit.unwrap());
        }
    }
    assert!(free >= 10 && blocked >= 5, "{free} free, {blocked} blocked");
}

#[test]
fn no_point_moves_farther_than_the_motion_bound() {
    let (arm, _, _, world) = pr2_world(0);
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    for _ in 0..50 {
        let (a, b) = (random_configuration(&arm, &mut rng), random_configuration(&arm, &mut rng));
        let bound = world.motion_bound(&a, &b);
        for shape in &world.moving {
            let (low, high) = shape.solid.bounds();
            for corner in [low, high] {
                let in_body = shape.place.apply(&corner);
                // Corners of a ball's bounds are outside of it: only those of boxes are points.
                if !matches!(shape.solid, solid::Solid::Box { .. }) {
                    continue;
                }
                let mut way = 0.0;
                let mut before: Option<Vector3<f64>> = None;
                for step in 0..=200 {
                    let t = f64::from(step) / 200.0;
                    let q: JointVector = JointVector::from_fn(|j| a[j] + t * (b[j] - a[j]));
                    let at = world.bodies.poses(&q)[shape.body].apply(&in_body);
                    way += before.map_or(0.0, |x| (at - x).norm());
                    before = Some(at);
                }
                assert!(way <= bound, "way {way} of a corner, bound {bound}");
            }
        }
    }
}

#[test]
fn not_a_number_is_never_free() {
    let (arm, _, _, world) = pr2_world(100);
    for bad in [f64::NAN, f64::INFINITY] {
        let mut q = arm.home();
        q[3] = bad;
        assert!(!world.is_free(&q, ToolContact::Forbidden));
        assert!(!world.exact().is_free(&q, ToolContact::Forbidden));
        assert!(world.clearance(&q, ToolContact::Allowed) < 0.0);
        assert!(!world.motion_free(&arm.home(), &q, ToolContact::Forbidden));
    }
    let (robot, arm, tool) = pr2();
    let scan = [Point3::new(0.0, f64::NAN, 0.0)];
    let world = World::new(&robot, &arm, &tool, &scan, &[], &Options::default());
    assert!(matches!(world, Err(CollisionError::NotFinite { index: 0 })));
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

#[test]
fn meshes_fast_check_agrees_with_exact() {
    let folder = tempfile::tempdir().unwrap();
    let robot = mesh_robot(folder.path());
    let arm = robot.arm(&ArmSpec { base: "l0".into(), tip: "l6".into() }).unwrap();
    let mut tool = Tool { centre: [0.3, 0.0, 0.0], ..Tool::default() };
    tool.thickness = 0.05;
    let mut options = Options::default();
    // Without the package's folder the error names link and package.
    let missing = World::new(&robot, &arm, &tool, &[], &[], &options).unwrap_err().to_string();
    assert!(missing.contains("l1") && missing.contains("blobs"), "{missing}");
    // With capsules it goes on and says so.
    options.fit_capsules = Some(0.05);
    let fitted = World::new(&robot, &arm, &tool, &[], &[], &options).unwrap();
    assert_eq!(fitted.notes().len(), 6, "{:?}", fitted.notes());

    options.fit_capsules = None;
    options.meshes.packages.insert("blobs".into(), folder.path().into());
    let block = folder.path().join("block.stl");
    write_blob(&block, Vector3::new(0.2, 0.3, 0.1), Vector3::new(-0.6, 0.0, 0.6), 77);
    let obstacle = Obstacle {
        name: "block".into(),
        shape: ObstacleShape::Mesh { path: block },
        pose: Isometry3::rotation(Vector3::new(0.1, 0.2, 0.3)),
        carries_robot: false,
    };
    let scan = wall(100, 2);
    let world = World::new(&robot, &arm, &tool, &scan, &[obstacle], &options).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(12);
    let all: Vec<_> = (0..10_000).map(|_| random_configuration(&arm, &mut rng)).collect();
    let free = agree(&world, &all, ToolContact::Forbidden);
    assert!((300..9_700).contains(&free), "{free} of 10000 free");
    assert!(agree(&world, &all[..1000], ToolContact::Allowed) > 0);
}

#[test]
fn srdf_pairs_take_the_place_of_sampling() {
    let (robot, arm, tool) = pr2();
    let mut srdf = tempfile::NamedTempFile::new().unwrap();
    write!(
        srdf,
        "<robot name='pr2'><disable_collisions link1='r_forearm_link' link2='base_link'/></robot>"
    )
    .unwrap();
    let options = Options { srdf: Some(srdf.path().into()), ..Options::default() };
    let world = World::new(&robot, &arm, &tool, &[], &[], &options).unwrap();
    let by_srdf: Vec<_> = world.excluded().iter().filter(|e| e.reason == Reason::Srdf).collect();
    assert_eq!(by_srdf.len(), 1);
    assert_eq!(
        (by_srdf[0].first.as_str(), by_srdf[0].second.as_str()),
        ("base_link", "r_forearm_link")
    );
}

#[test]
fn the_floor_carries_the_robot_but_stops_the_arm() {
    let (robot, arm, tool) = pr2();
    let floor = Obstacle::floor(Isometry3::identity());
    let world = World::new(&robot, &arm, &tool, &[], &[floor], &Options::default()).unwrap();
    assert_eq!(world.stance_hit(), None);
    let raised = Obstacle::floor(Isometry3::translation(0.0, 0.0, 3.0));
    let world = World::new(&robot, &arm, &tool, &[], &[raised], &Options::default()).unwrap();
    let hit = world.why_not(&arm.home(), ToolContact::Allowed).unwrap();
    assert_eq!(hit.with, With::Obstacle("floor".into()));
    assert!(!world.is_free(&arm.home(), ToolContact::Allowed));
    // A point inside the base is a matter of the stance.
    let scan = [Point3::new(0.0, 0.0, 0.2)];
    let world = World::new(&robot, &arm, &tool, &scan, &[], &Options::default()).unwrap();
    let hit = world.stance_hit().unwrap();
    assert!(hit.link == "base_link" && hit.distance < 0.0, "{hit}");
}

#[test]
fn capsules_stand_in_for_the_meshes_of_other_arms() {
    let data = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../../shared/data/coverage-tasks");
    if !data.exists() {
        println!("skipped: {} is not there", data.display());
        return;
    }
    for (file, base, tip) in
        [("ur5.urdf", "base_link", "tool0"), ("panda.urdf", "panda_link0", "panda_link8")]
    {
        let robot = Robot::from_urdf_file(&data.join(file)).unwrap();
        let arm = robot.arm(&ArmSpec { base: base.into(), tip: tip.into() }).unwrap();
        let options = Options { fit_capsules: Some(0.05), ..Options::default() };
        let tool = Tool { centre: [0.0, 0.0, 0.03], approach: [0.0, 0.0, 1.0], ..Tool::default() };
        let world = World::new(&robot, &arm, &tool, &wall(500, 4), &[], &options).unwrap();
        assert!(world.notes().len() >= 7, "{:?}", world.notes());
        let mut rng = ChaCha8Rng::seed_from_u64(13);
        let all: Vec<_> = (0..500).map(|_| random_configuration(&arm, &mut rng)).collect();
        let free = agree(&world, &all, ToolContact::Forbidden);
        assert!((100..480).contains(&free), "{file}: {free} of 500 free");
    }
}
