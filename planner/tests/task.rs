//! Plans through given poses: `planner task`.

mod common;

use std::path::Path;

use nalgebra::{Isometry3, Point3, Vector3};
use nullsweep_collision::{Obstacle, ObstacleShape, Options};
use nullsweep_planner::plan::Profile;
use nullsweep_planner::poses::{self, ReadOptions, Setup, SetupError, Tolerance};
use nullsweep_planner::progress::Silent;
use nullsweep_planner::task::{self, TaskConfig, TaskError, TaskOutcome};
use nullsweep_planner::timing::Speed;
use nullsweep_planner::verify::{Given, verify};
use nullsweep_planner::workcell::{Scene, Stance};
use nullsweep_robot::{ArmSpec, Geometry, Robot, Side};

fn config(tolerance: Tolerance) -> TaskConfig {
    TaskConfig { setup: common::setup(tolerance), rounds: 2, trials: 10 }
}

/// Another one, met as is given.
fn with(setup: Setup) -> TaskConfig {
    TaskConfig { setup, ..config(Tolerance::AXIS) }
}

/// Not even a floor.
fn nothing() -> Scene {
    Scene::of_obstacles(Vec::new())
}

fn plan(tolerance: Tolerance) -> TaskOutcome {
    task::run(&Robot::pr2(), &common::dome(), &nothing(), &config(tolerance), &Silent).unwrap()
}

#[test]
fn every_pose_is_met_and_tolerance_saves_movement() {
    let poses = common::dome();
    let exact = plan(Tolerance::AXIS);
    let loose = plan(Tolerance([0.02, 0.02, 0.0, 0.0, 0.0, f64::INFINITY]));
    let arm = Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).unwrap();
    let contact = config(Tolerance::AXIS).setup.tool.contact_in_tip();
    for (outcome, reach) in [(&exact, 1e-6), (&loose, 0.02 + 1e-6)] {
        assert_eq!(outcome.verification.violations, []);
        assert_eq!((outcome.figures.met, outcome.figures.reconfigurations), (25, 0));
        // From the plan's knots alone.
        let mut met = vec![false; poses.len()];
        for knot in &outcome.plan.knots {
            let Some(pose) = knot.patch.map(|p| p as usize) else { continue };
            let off = poses[pose].inverse() * arm.tip_pose(&knot.q) * contact;
            let t = off.translation.vector;
            assert!(t.x.abs() < reach && t.y.abs() < reach && t.z.abs() < 1e-6, "{t:?}");
            assert!((off.rotation * Vector3::z()).angle(&Vector3::z()) < 1e-6);
            met[pose] = true;
        }
        assert!(met.iter().all(|m| *m));
    }
    let (exact, loose) = (exact.figures.movement_rad, loose.figures.movement_rad);
    assert!(loose < 0.9 * exact, "{loose} rad with tolerance, {exact} without");
}

#[test]
fn a_seed_gives_the_same_plan() {
    let (one, two) = (plan(Tolerance::AXIS), plan(Tolerance::AXIS));
    assert_eq!(one.plan, two.plan);
    let other = with(Setup { seed: 2, ..config(Tolerance::AXIS).setup });
    let other = task::run(&Robot::pr2(), &common::dome(), &nothing(), &other, &Silent).unwrap();
    assert_ne!(one.plan.knots, other.plan.knots);
}

#[test]
fn poses_out_of_reach_are_an_error() {
    let far = [Isometry3::translation(9.0, 0.0, 1.0)];
    let result = task::run(&Robot::pr2(), &far, &nothing(), &config(Tolerance::AXIS), &Silent);
    assert!(matches!(result, Err(TaskError::NothingMet { poses: 1 })), "{result:?}");
}

/// The wok of Wang and Gleicher (ICRA 2025), whose planner takes 42.2 rad.
#[test]
fn the_wok_takes_less_than_forty_radians() {
    let data = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/coverage-tasks"));
    if !data.exists() {
        println!("skipped: {} is not there", data.display());
        return;
    }
    let poses = poses::read(&data.join("ur5_20240819_164816_wok.csv"), &ReadOptions::default())
        .unwrap()
        .all();
    let robot = Robot::from_urdf_file(&data.join("ur5.urdf")).unwrap();
    let config = with(Setup {
        arm: ArmSpec { base: "base_link".into(), tip: "tool_tip".into() },
        tool: poses::tip_tool(),
        collision: Options { fit_capsules: Some(0.05), ..Options::default() },
        ..config("0.05,0.05,0,0,0,free".parse().unwrap()).setup
    });
    let outcome = task::run(&robot, &poses, &nothing(), &config, &Silent).unwrap();
    let figures = &outcome.figures;
    println!("{figures:?}");
    assert_eq!(outcome.verification.violations, []);
    assert_eq!((figures.met, figures.reconfigurations), (209, 0));
    assert!(figures.movement_rad < 40.0, "{} rad", figures.movement_rad);
    // Between poses too the tool keeps to the straight line.
    assert!(figures.edge_deviation_max_m < 5e-4, "{} m", figures.edge_deviation_max_m);
}

/// The hand turns once round along a line: no one posture meets all of it.
#[test]
fn postures_that_complement_each_other_meet_all_poses() {
    let data = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data"));
    if !data.exists() {
        println!("skipped: {} is not there", data.display());
        return;
    }
    let path = data.join("reports/line_with_turn.csv");
    let poses = poses::read(&path, &ReadOptions::default()).unwrap().all();
    let robot = Robot::from_urdf_file(&data.join("coverage-tasks/panda.urdf")).unwrap();
    let config = with(Setup {
        arm: ArmSpec { base: "world".into(), tip: "panda_hand".into() },
        tool: poses::tip_tool(),
        collision: Options { fit_capsules: Some(0.05), ..Options::default() },
        ..config(Tolerance([0.0; 6])).setup
    });
    let outcome = task::run(&robot, &poses, &nothing(), &config, &Silent).unwrap();
    assert_eq!(outcome.verification.violations, []);
    assert!(outcome.figures.met >= 199, "{:?}", outcome.figures);
    assert!(outcome.figures.edge_deviation_max_m < 5e-4, "{:?}", outcome.figures);
}

/// A post keeps the arm from some poses: only those are left out, and it is told why.
#[test]
fn a_pose_is_left_out_for_what_is_in_the_way() {
    let dome = common::dome();
    let at = dome[12].translation.vector;
    let post = Obstacle {
        name: "post".into(),
        shape: ObstacleShape::Geometry(Geometry::Box { half_extents: Vector3::repeat(0.02) }),
        pose: Isometry3::from(at),
        carries_robot: false,
    };
    let scene = Scene { obstacles: vec![post], ..nothing() };
    let notes = common::Notes::default();
    let config = config(Tolerance::AXIS);
    let outcome = task::run(&Robot::pr2(), &dome, &scene, &config, &notes).unwrap();
    assert_eq!(outcome.verification.violations, []);
    let notes = notes.0.into_inner().unwrap();
    assert!(notes.iter().any(|n| n.contains("left out") && n.contains("post")), "{notes:?}");
    assert!(!notes.iter().any(|n| n.contains("inside the arm's limits")), "{notes:?}");
    assert!((15..25).contains(&outcome.figures.met), "{:?}", outcome.figures);
}

/// What the check of a plan says of it in a scene.
fn verified(outcome: &TaskOutcome, scene: &Scene) -> usize {
    let (robot, arm, collision) = (Robot::pr2(), ArmSpec::pr2(Side::Right), Options::default());
    let given = Given { robot: &robot, arm: &arm, scene, collision: &collision };
    verify(&outcome.plan, given, &|| ()).expect("it can be checked").violations.len()
}

/// A few points as a camera might see them, where the elbow is half-way along a plan.
fn at_the_elbow(outcome: &TaskOutcome) -> Scene {
    let robot = Robot::pr2();
    let arm = robot.arm(&ArmSpec::pr2(Side::Right)).unwrap();
    let elbow = robot.links().iter().position(|link| link.name == "r_elbow_flex_link").unwrap();
    let mut links = vec![Isometry3::identity(); robot.links().len()];
    arm.link_poses(&outcome.plan.knots[outcome.plan.knots.len() / 2].q, &mut links);
    let at = Point3::from(links[elbow].translation.vector);
    let points = (-4..=4).map(|i| at + Vector3::z() * (0.005 * f64::from(i)));
    Scene { surroundings: points.collect(), ..nothing() }
}

#[test]
fn what_was_scanned_is_in_the_way_of_given_poses() {
    let free = plan(Tolerance::AXIS);
    let scene = at_the_elbow(&free);
    assert!(verified(&free, &scene) > 0, "the points are where the arm passes without them");
    let config = config(Tolerance::AXIS);
    let outcome = task::run(&Robot::pr2(), &common::dome(), &scene, &config, &Silent).unwrap();
    assert_eq!(outcome.verification.violations, []);
    assert_eq!(verified(&outcome, &scene), 0);
    assert_eq!(outcome.figures.against.other_points, 9);
    assert!(outcome.plan.is_of_poses());
}

#[test]
fn a_scene_is_where_the_robot_does_not_stand() {
    let base = [1.0, -2.0, 0.7];
    let stance = Stance { base, height: 0.0, held: Vec::new() };
    let scene = at_the_elbow(&plan(Tolerance::AXIS)).transformed(&stance.pose());
    let moved = with(Setup { stance, ..config(Tolerance::AXIS).setup });
    let outcome = task::run(&Robot::pr2(), &common::dome(), &scene, &moved, &Silent).unwrap();
    assert_eq!(outcome.plan.base, base);
    assert_eq!(verified(&outcome, &scene), 0);
    // Standing in a wall is told.
    let wall = Obstacle {
        name: "wall".into(),
        shape: ObstacleShape::Geometry(Geometry::Box { half_extents: Vector3::repeat(0.2) }),
        pose: Isometry3::translation(1.0, -2.0, 0.3),
        carries_robot: false,
    };
    let scene = Scene { obstacles: vec![wall], ..nothing() };
    let result = task::run(&Robot::pr2(), &common::dome(), &scene, &moved, &Silent);
    assert!(
        matches!(&result, Err(TaskError::Setup(SetupError::StanceHit { hit })) if hit.contains("wall")),
        "{result:?}"
    );
}

#[test]
fn a_task_begins_where_the_arm_is_and_keeps_its_accelerations() {
    let robot = Robot::pr2();
    let arm = robot.arm(&ArmSpec::pr2(Side::Right)).unwrap();
    let start = arm.home();
    let from_home = with(Setup {
        start: Some(start),
        speed: Speed { profile: Profile::Acceleration, ..Speed::default() },
        ..config(Tolerance::AXIS).setup
    });
    let outcome = task::run(&robot, &common::dome(), &nothing(), &from_home, &Silent).unwrap();
    assert_eq!(outcome.verification.violations, []);
    let knots = &outcome.plan.knots;
    assert_eq!((knots[0].q, knots[0].line), (start, None));
    assert_eq!(outcome.plan.profile, Profile::Acceleration);
    let contact = from_home.setup.tool.contact_in_tip();
    let met = knots.iter().filter_map(|knot| Some((knot, knot.patch?)));
    let mut poses: Vec<u32> = met
        .map(|(knot, pose)| {
            let off = common::dome()[pose as usize].inverse() * arm.tip_pose(&knot.q) * contact;
            assert!(off.translation.vector.norm() < 1e-6, "{off}");
            pose
        })
        .collect();
    poses.sort_unstable();
    poses.dedup();
    assert_eq!(poses.len(), 25);
    // A start beyond a limit, or in the scene, is told.
    let mut beyond = start;
    beyond[3] = 0.2;
    let beyond = with(Setup { start: Some(beyond), ..config(Tolerance::AXIS).setup });
    let result = task::run(&robot, &common::dome(), &nothing(), &beyond, &Silent);
    assert!(
        matches!(&result, Err(TaskError::Setup(SetupError::Start { why })) if why.contains("r_elbow_flex_joint")),
        "{result:?}"
    );
}
