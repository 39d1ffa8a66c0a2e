//! Plans through given poses: `planner task`.

mod common;

use std::path::Path;

use nalgebra::{Isometry3, Vector3};
use nullsweep_collision::Options;
use nullsweep_planner::progress::Silent;
use nullsweep_planner::task::{self, TaskConfig, TaskOutcome, Tolerance};
use nullsweep_robot::{ArmSpec, Robot, Side, Tool};

fn config(tolerance: Tolerance) -> TaskConfig {
    TaskConfig {
        arm: ArmSpec::pr2(Side::Right),
        // Poses of the gripper's tool frame, its x axis ahead.
        tool: Tool { approach: [1.0, 0.0, 0.0], ..task::tip_tool() },
        tolerance,
        held: Vec::new(),
        obstacles: Vec::new(),
        collision: Options::default(),
        v_max: None,
        rounds: 2,
        trials: 10,
        seed: 1,
    }
}

fn plan(tolerance: Tolerance) -> TaskOutcome {
    task::run(&Robot::pr2(), &common::dome(), &config(tolerance), &Silent).unwrap()
}

#[test]
fn every_pose_is_met_and_tolerance_saves_movement() {
    let poses = common::dome();
    let exact = plan(Tolerance::AXIS);
    let loose = plan(Tolerance([0.02, 0.02, 0.0, 0.0, 0.0, f64::INFINITY]));
    let arm = Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).unwrap();
    let contact = config(Tolerance::AXIS).tool.contact_in_tip();
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
    let other = TaskConfig { seed: 2, ..config(Tolerance::AXIS) };
    let other = task::run(&Robot::pr2(), &common::dome(), &other, &Silent).unwrap();
    assert_ne!(one.plan.knots, other.plan.knots);
}

#[test]
fn poses_out_of_reach_are_an_error() {
    let far = [Isometry3::translation(9.0, 0.0, 1.0)];
    let result = task::run(&Robot::pr2(), &far, &config(Tolerance::AXIS), &Silent);
    assert!(matches!(result, Err(task::TaskError::NothingMet { poses: 1 })), "{result:?}");
}

/// The wok of Wang and Gleicher (ICRA 2025), whose planner takes 42.2 rad.
#[test]
fn the_wok_takes_less_than_forty_radians() {
    let data = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/coverage-tasks"));
    if !data.exists() {
        println!("skipped: {} is not there", data.display());
        return;
    }
    let poses = task::read(&data.join("ur5_20240819_164816_wok.csv")).unwrap().poses;
    let robot = Robot::from_urdf_file(&data.join("ur5.urdf")).unwrap();
    let config = TaskConfig {
        arm: ArmSpec { base: "base_link".into(), tip: "tool_tip".into() },
        tool: task::tip_tool(),
        collision: Options { fit_capsules: Some(0.05), ..Options::default() },
        ..config("0.05,0.05,0,0,0,free".parse().unwrap())
    };
    let outcome = task::run(&robot, &poses, &config, &Silent).unwrap();
    let figures = &outcome.figures;
    assert_eq!(outcome.verification.violations, []);
    assert_eq!((figures.met, figures.reconfigurations), (209, 0));
    assert!(figures.movement_rad < 40.0, "{} rad", figures.movement_rad);
}
