//! `planner verify`.

use std::path::PathBuf;

use anyhow::Context;
use clap::Args;
use nalgebra::{Isometry3, Point3};
use nullsweep_collision::{Obstacle, Options};
use nullsweep_planner::plan::{Plan, Program, Work};
use nullsweep_planner::progress::Progress;
use nullsweep_planner::verify::{Given, Verification, between, verify};
use nullsweep_planner::workcell::Scene;
use nullsweep_report::ReportData;
use nullsweep_robot::{ArmSpec, Robot};

use crate::bars::Bars;
use crate::exit::{OK, Usage, VIOLATIONS};
use crate::figures::{verified_rows, verified_table};
use crate::json::write_json;
use crate::numbers::percent;
use crate::output::{complain, say, writable};
use crate::picture::{Sitter, picture};
use crate::program::tip;
use crate::refusal::tell;
use crate::robot::RobotArgs;
use crate::scene::{Demo, SceneArgs, scene};
use crate::sheet::sheet;

#[derive(Debug, Args)]
pub(super) struct VerifyArgs {
    /// The plan file.
    plan: PathBuf,
    #[command(flatten)]
    against: AgainstArgs,
    /// Where nothing is found wrong, write the plan here as verified, so that `publish` takes it.
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Write the figures as JSON to a file, or `-`, instead of a table.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// What a plan is held against.
#[derive(Debug, Args)]
pub(super) struct AgainstArgs {
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
}

pub(super) fn run(args: &VerifyArgs) -> anyhow::Result<u8> {
    for out in args.out.iter().chain(&args.json) {
        writable(out)?;
    }
    let bars = Bars::new();
    if let Some(program) = Program::read(&args.plan)? {
        return program_run(args, program, &bars);
    }
    let plan = Plan::read(&args.plan)?;
    let found = args.against.check(&plan, &bars)?.verification;
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
        complain!("planner: the plan breaks {} rules", found.violations.len());
        return Ok(VIOLATIONS);
    }
    if let Some(out) = &args.out {
        plan.sealed().write(out)?;
    }
    Ok(OK)
}

/// The same of every plan of a program, each in what is near its stop.
fn program_run(args: &VerifyArgs, program: Program, bars: &Bars) -> anyhow::Result<u8> {
    let against = &args.against;
    let robot = against.robot.robot()?;
    let collision = against.robot.collision();
    let first = program.stops.iter().flat_map(|stop| &stop.works).map(|work| &work.plan).next();
    let scene = first.map(|plan| against.scene(plan, bars)).transpose()?;
    let Some(scene) = scene else { return Ok(OK) };
    let mut swept = vec![false; scene.surface.points.len()];
    let mut table = sheet(["stop", "arm", "violations", "adds"]);
    let (mut broken, mut all) = (0, Vec::new());
    for (s, work) in program.works() {
        let [x, y, _] = work.plan.base;
        let (here, kept) = scene.near([x, y], program.near_m);
        let arm = arm_of(work)?;
        bars.stage("verify", Some(work.plan.knots.len()));
        let given = Given { robot: &robot, arm: &arm, scene: &here, collision: &collision };
        let found = verify(&work.plan, given, &|| bars.tick());
        bars.clear();
        let found = found.with_context(|| format!("stop {}", s + 1))?;
        let mut new = 0;
        for point in kept.iter().zip(&found.swept).filter(|(_, s)| **s).map(|(p, _)| *p as usize) {
            new += usize::from(!std::mem::replace(&mut swept[point], true));
        }
        let share = new as f64 / swept.len().max(1) as f64;
        let (stop, count) = ((s + 1).to_string(), found.violations.len().to_string());
        table.add_row([stop, work.arm.clone(), count, percent(share)]);
        tell(&found.violations);
        broken += found.violations.len();
        all.push(found);
    }
    for (s, stop) in program.stops.iter().enumerate() {
        for pair in &stop.together {
            let works = pair.map(|work| &stop.works[work]);
            let arms: [ArmSpec; 2] = [arm_of(works[0])?, arm_of(works[1])?];
            let given = [0, 1].map(|arm| Given {
                robot: &robot,
                arm: &arms[arm],
                scene: &scene,
                collision: &collision,
            });
            let found = between([&works[0].plan, &works[1].plan], given);
            let (violations, collision_checks) =
                found.with_context(|| format!("stop {}, both arms at once", s + 1))?;
            let (stop, count) = ((s + 1).to_string(), violations.len().to_string());
            let names = format!("{} and {} at once", tip(works[0]), tip(works[1]));
            table.add_row([stop, names, count, String::new()]);
            tell(&violations);
            broken += violations.len();
            all.push(Verification { violations, collision_checks, ..Verification::default() });
        }
    }
    let share = swept.iter().filter(|s| **s).count() as f64 / swept.len().max(1) as f64;
    match &args.json {
        Some(path) => write_json(&all, path)?,
        None => say!("{table}\nswept of all points: {} of {}", percent(share), swept.len()),
    }
    if broken > 0 {
        complain!("planner: the program breaks {broken} rules");
        return Ok(VIOLATIONS);
    }
    if let Some(out) = &args.out {
        program.sealed().write(out)?;
    }
    Ok(OK)
}

fn arm_of(work: &Work) -> anyhow::Result<ArmSpec> {
    Ok(work.arm.parse().map_err(Usage)?)
}

/// What was found, and of what.
pub(super) struct Checked {
    robot: Robot,
    arm: ArmSpec,
    collision: Options,
    scene: Scene,
    pub(super) verification: Verification,
}

impl AgainstArgs {
    /// Checks a plan.
    pub(super) fn check(&self, plan: &Plan, bars: &Bars) -> anyhow::Result<Checked> {
        let robot = self.robot.robot()?;
        let scene = self.scene(plan, bars)?;
        let (arm, collision) = (self.robot.spec(), self.robot.collision());
        let given = Given { robot: &robot, arm: &arm, scene: &scene, collision: &collision };
        bars.stage("verify", Some(plan.knots.len()));
        let found = verify(plan, given, &|| bars.tick());
        bars.clear();
        Ok(Checked { verification: found?, robot, arm, collision, scene })
    }

    /// What is there, in the floor frame.
    fn scene(&self, plan: &Plan, bars: &Bars) -> anyhow::Result<Scene> {
        let seed = self.seed.unwrap_or(plan.seed);
        let found = if let Some(file) = &self.scene_file {
            let first = plan.surface.first().filter(|_| !plan.is_of_poses());
            let swept = first.map(|s| plan.base_pose() * Point3::from(s.point));
            let choice = swept.map_or_else(|| self.scene.clone(), |point| self.scene.or_at(point));
            scene(&choice, None, std::slice::from_ref(file), seed, bars)?
        } else if self.demo.is_none() && self.scans.is_empty() {
            self.scene.unscanned(Obstacle::floor(Isometry3::identity()))?
        } else {
            scene(&self.scene, self.demo, &self.scans, seed, bars)?
        };
        let in_the_way = plan.surface.is_empty() || plan.is_of_poses();
        Ok(if in_the_way { found.in_the_way() } else { found })
    }
}

impl Checked {
    /// The page that shows the plan with what was found.
    pub(super) fn page(&self, plan: &Plan) -> anyhow::Result<ReportData> {
        let held: Vec<_> = plan.held.iter().map(|h| (h.name.as_str(), h.position)).collect();
        picture(Sitter {
            plans: std::slice::from_ref(plan),
            robot: &self.robot,
            arm: &self.robot.arm(&self.arm)?.with_held(&held)?,
            collision: &self.collision,
            scene: Some(&self.scene),
            verification: Some(&self.verification),
            flights: &[],
            tables: vec![verified_table(&self.verification)],
            lines: Vec::new(),
        })
    }
}
