//! Plans how the scan in a file, or a simulated chair, is swept, and writes plan.json.
//!
//! `cargo run --release -p nullsweep-planner --example plan -- [SCAN.pcd]`

use std::error::Error;

use nalgebra::Vector3;
use nullsweep_planner::surface::{CleanConfig, Placement, ReadOptions, place, read, simulate};
use nullsweep_planner::{ArmSpec, CostKind, Job, Robot, Scene, Side, Silent, run};

fn main() -> Result<(), Box<dyn Error>> {
    // A camera 0.83 m above the floor that looks ahead: its y axis points down.
    let level =
        Placement::UpAndHeight { up: -Vector3::y_axis(), sensor_height: 0.83, support_height: 0.0 };
    let (raw, placement) = match std::env::args_os().nth(1) {
        Some(path) => (read(path.as_ref(), &ReadOptions::default())?, level),
        None => {
            let view = simulate::chair(1);
            (view.scan, Placement::SensorPose(view.sensor_pose))
        }
    };
    let (placed, _) = place(&raw, &placement);
    let (scene, _) = Scene::seen(&placed, None, &CleanConfig::default())?;

    let job = Job { cost: CostKind::Effort, ..Job::new(ArmSpec::pr2(Side::Right)) };
    let outcome = run(&Robot::pr2(), &scene, &job, &Silent)?;

    let figures = &outcome.figures;
    println!("{:.1} s, {:.1} rad", figures.task_time_s, figures.effort_rad);
    println!(
        "{:.1} % of what is reached is swept",
        100.0 * figures.verification.coverage_reachable
    );
    match figures.verification.violations.first() {
        Some(broken) => Err(format!("knot {}: {}", broken.knot, broken.detail).into()),
        None => Ok(outcome.plan.write("plan.json".as_ref())?),
    }
}
