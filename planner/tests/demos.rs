//! What tools other than the sponge are for: a door is sprayed, a chair inspected, a cup wiped.

mod common;

use std::path::{Path, PathBuf};

use nullsweep_planner::pipeline::{Job, Outcome, StanceChoice, run};
use nullsweep_planner::plan::{Method, Profile};
use nullsweep_planner::progress::Silent;
use nullsweep_planner::workcell::{Scene, Stance};
use nullsweep_robot::{ArmSpec, Robot, Side, Tool};
use nullsweep_surface::scan::{self, ReadOptions};
use nullsweep_surface::simulate::{self, SimulatedView};
use nullsweep_surface::{CleanConfig, Placement, place};

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(name)
}

fn tool(name: &str) -> Tool {
    let text = std::fs::read_to_string(file("docs/tools").join(name)).expect("a tool's file");
    toml::from_str(&text).expect("a tool")
}

/// What a simulated sensor has seen.
fn seen(view: &SimulatedView) -> Scene {
    let (placed, _) = place(&view.scan, &Placement::SensorPose(view.sensor_pose));
    Scene::seen(&placed, None, &CleanConfig::default()).expect("it is there").0
}

/// A job of few samples for a tool.
fn job(arm: ArmSpec, tool: &str, base: [f64; 3], held: &[(&str, f64)]) -> Job {
    let held = held.iter().map(|(name, position)| ((*name).to_owned(), *position)).collect();
    let stance = StanceChoice::Given(Stance { base, height: 0.0, held });
    Job { stance, ik_samples: 24, ..Job::new(arm) }.with_tool(self::tool(tool))
}

/// No rule is broken, and what is reachable is done.
fn done(robot: &Robot, scene: &Scene, job: &Job, reachable: usize) -> Outcome {
    let outcome = run(robot, scene, job, &Silent).expect("a plan");
    let (figures, v) = (&outcome.figures, &outcome.figures.verification);
    println!(
        "{} of {} patches, {:.3} of their points, {:.3} of all, {:.1} s",
        figures.reachable,
        figures.patches,
        v.coverage_reachable,
        v.coverage_all,
        outcome.plan.duration()
    );
    assert!(v.violations.is_empty(), "{:?}", v.violations);
    assert!(figures.reachable >= reachable, "{} of {}", figures.reachable, figures.patches);
    assert!(v.coverage_reachable >= 0.97, "{}", v.coverage_reachable);
    assert!(v.line_deviation_max_m < 2e-4, "it works off its line: {}", v.line_deviation_max_m);
    outcome
}

#[test]
fn a_car_door_is_sprayed() {
    let right = ArmSpec::pr2(Side::Right);
    let held = [("torso_lift_joint", 0.02)];
    let own = job(right, "spray-nozzle.toml", [-0.9015, 0.1746, 0.1527], &held);
    let job = Job { method: Some(Method::Raster), profile: Profile::Acceleration, ..own };
    let outcome = done(&Robot::pr2(), &seen(&simulate::car_door(1)), &job, 64);
    let stand_off = outcome.figures.verification.stand_off.expect("a surface before it");
    assert!(stand_off.distance_min_m >= 0.1 && stand_off.distance_max_m <= 0.2, "{stand_off:?}");
}

#[test]
fn a_chair_is_inspected() {
    let right = ArmSpec::pr2(Side::Right);
    let held = [("torso_lift_joint", 0.3)];
    let job = job(right, "inspection-camera.toml", [-0.613, -0.465, 1.635], &held);
    done(&Robot::pr2(), &seen(&simulate::chair(1)), &job, 24);
}

#[test]
fn a_cup_is_wiped() {
    let robot = Robot::from_urdf_file(&file("examples/sample/arm.urdf")).expect("the arm");
    let raw = scan::read(&file("examples/sample/cup.obj"), &ReadOptions::default()).expect("a cup");
    let up = Placement::Up { up: nalgebra::Vector3::z_axis(), support_height: 0.0 };
    let (placed, _) = place(&raw, &up);
    let scene = Scene::seen(&placed, None, &CleanConfig::default()).expect("it is there").0;
    let arm = ArmSpec { base: "base_link".into(), tip: "flange".into() };
    done(&robot, &scene, &job(arm, "finger-pad.toml", [-0.327, 0.219, -0.588], &[]), 40);
}
