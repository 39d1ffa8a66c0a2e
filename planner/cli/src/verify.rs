//! `planner verify`.

use std::path::PathBuf;

use clap::Args;
use nalgebra::Point3;
use nullsweep_planner::plan::Plan;
use nullsweep_planner::progress::Progress;
use nullsweep_planner::verify::{Given, verify};
use nullsweep_planner::workcell::Scene;

use crate::bars::Bars;
use crate::exit::{OK, VIOLATIONS};
use crate::figures::verified_rows;
use crate::json::write_json;
use crate::output::{say, writable};
use crate::refusal::tell;
use crate::robot::RobotArgs;
use crate::scene::{Demo, SceneArgs, scene};
use crate::sheet::sheet;

#[derive(Debug, Args)]
pub(super) struct VerifyArgs {
    /// The plan file.
    plan: PathBuf,
    /// The scan files that it was made for, given as they were to `plan`; none: nothing but the floor
    /// is there.
    scans: Vec<PathBuf>,
    /// A scene file that `planner scene` wrote, in place of scan files: of its objects the one that
    /// the plan sweeps is taken, all else, and for a plan of given poses everything, is in the way.
    #[arg(long = "scene", value_name = "FILE", conflicts_with_all = ["scans", "demo"])]
    scene_file: Option<PathBuf>,
    /// It was made for a simulated scan.
    #[arg(long, value_enum, conflicts_with = "scans")]
    demo: Option<Demo>,
    #[command(flatten)]
    scene: SceneArgs,
    #[command(flatten)]
    robot: RobotArgs,
    /// Seed of the simulated scan, or of the points laid on a mesh; without it the plan's.
    #[arg(long)]
    seed: Option<u64>,
    /// Where nothing is found wrong, write the plan here as verified, so that `publish` takes it.
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Write the figures as JSON to a file, or `-`, instead of a table.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

pub(super) fn run(args: &VerifyArgs) -> anyhow::Result<u8> {
    for out in args.out.iter().chain(&args.json) {
        writable(out)?;
    }
    let bars = Bars::new();
    let plan = Plan::read(&args.plan)?;
    let robot = args.robot.robot()?;
    let seed = args.seed.unwrap_or(plan.seed);
    let mut scene = if let Some(file) = &args.scene_file {
        let first = plan.surface.first().filter(|_| !plan.is_of_poses());
        let swept = first.map(|s| plan.base_pose() * Point3::from(s.point));
        let choice = swept.map_or_else(|| args.scene.clone(), |point| args.scene.or_at(point));
        scene(&choice, None, std::slice::from_ref(file), seed, &bars)?
    } else if args.demo.is_none() && args.scans.is_empty() {
        let mut floor = Scene::empty();
        floor.obstacles.extend(args.scene.obstacles()?);
        floor
    } else {
        scene(&args.scene, args.demo, &args.scans, seed, &bars)?
    };
    if plan.surface.is_empty() || plan.is_of_poses() {
        scene = scene.in_the_way();
    }
    let (arm, collision) = (args.robot.spec(), args.robot.collision());
    let given = Given { robot: &robot, arm: &arm, scene: &scene, collision: &collision };
    bars.stage("verify", Some(plan.knots.len()));
    let found = verify(&plan, given, &|| bars.tick());
    bars.clear();
    let found = found?;
    match &args.json {
        Some(path) => write_json(&found, path)?,
        None => {
            let mut table = sheet(["figure", "value"]);
            table.add_rows(verified_rows(&found));
            say!("{table}");
        }
    }
    if !found.violations.is_empty() {
        tell(&found.violations);
        eprintln!("planner: the plan breaks {} rules", found.violations.len());
        return Ok(VIOLATIONS);
    }
    if let Some(out) = &args.out {
        plan.sealed().write(out)?;
    }
    Ok(OK)
}
