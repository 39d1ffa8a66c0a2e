//! `planner task`.

use std::path::PathBuf;

use anyhow::Context;
use clap::Args;
use nalgebra::Isometry3;
use nullsweep_collision::{Obstacle, Options};
use nullsweep_planner::link::Site;
use nullsweep_planner::progress::Progress;
use nullsweep_planner::task::{self, TaskConfig, TaskFigures, TaskOutcome, Tolerance};
use nullsweep_planner::workcell::{Scene, Stance};
use nullsweep_report::{self as report, ReportData};
use nullsweep_robot::{Arm, Robot, Tool};

use crate::bars::Bars;
use crate::choices::ProfileArg;
use crate::exit::OK;
use crate::figures::{held_against, violations};
use crate::json::write_json;
use crate::numbers::{Held, Place, finite, velocity};
use crate::output::{say, writable};
use crate::picture::{Sitter, picture};
use crate::posture_arg::PostureArg;
use crate::refusal::write_unless_broken;
use crate::robot::{RobotArgs, tool_file};
use crate::scene::{SceneArgs, scene};
use crate::sheet::sheet;
use crate::site::SiteArgs;

#[derive(Debug, Args)]
pub(super) struct TaskArgs {
    /// Poses of the tool in the robot's root frame: time,x,y,z,qx,qy,qz,qw a line, apart by commas or
    /// blanks, time optional; names in the first line decide which column is which.
    poses: PathBuf,
    #[command(flatten)]
    task: PoseArgs,
    /// Where the plan is written.
    #[arg(long, short, value_name = "FILE", default_value = "plan.json")]
    out: PathBuf,
    /// Write every figure of the run as JSON to a file, or `-`.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write a page that shows the arm moving along the plan.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    #[command(flatten)]
    site: SiteArgs,
}

/// How poses are met.
#[derive(Debug, Args)]
pub(super) struct PoseArgs {
    #[command(flatten)]
    robot: RobotArgs,
    /// The tool, a TOML file, whose contact frame meets the poses; without it the tip frame itself.
    #[arg(long, value_name = "FILE")]
    tool: Option<PathBuf>,
    /// How far the tool may be from a pose, along and about its axes: X,Y,Z,RX,RY,RZ, in metres
    /// and radians or `free`.
    #[arg(long, value_name = "TOLERANCE", default_value = "0,0,0,0,0,free")]
    tolerance: Tolerance,
    /// Scan files of what is around the arm, or one scene file that `planner scene` wrote: all that
    /// was measured is in the way, but for the tool at a pose. The option may be given several times.
    #[arg(long = "scene", value_name = "FILE")]
    scans: Vec<PathBuf>,
    #[command(flatten)]
    around: SceneArgs,
    /// Height of the floor in the robot's root frame, without a scene; else 0, or just under the lowest
    /// pose where that is lower. [m]
    #[arg(long, value_name = "M", allow_hyphen_values = true, value_parser = finite)]
    #[arg(conflicts_with = "scans")]
    floor: Option<f64>,
    /// Where the robot stands in the scene's floor frame: x,y,yaw (in radians, or degrees with ° or deg
    /// behind them). The poses are in its root frame all the same.
    #[arg(long, value_name = "X,Y,YAW", default_value = "0,0,0", allow_hyphen_values = true)]
    base: Place,
    /// Height of the PR2's torso joint. [m]
    #[arg(long, value_name = "M", value_parser = finite)]
    torso: Option<f64>,
    /// Position of another held joint: NAME=VALUE.
    #[arg(long, value_name = "NAME=VALUE", allow_hyphen_values = true)]
    held: Vec<Held>,
    /// Where the arm starts: its joints, comma-separated; a posture by its name; or `measured`, where
    /// the executor holds it. Without it the plan begins at the pose that comes first.
    #[arg(long, value_name = "POSTURE", allow_hyphen_values = true)]
    start: Option<PostureArg>,
    /// How fast the plan goes along its path: at bang-bang velocity, or as fast as velocity and
    /// acceleration allow, corners blended, at rest in every pose.
    #[arg(long, value_enum, default_value = "velocity")]
    profile: ProfileArg,
    /// One velocity for all joints, where the robot's own limits are higher. [rad/s]
    #[arg(long, value_parser = velocity)]
    v_max: Option<f64>,
    /// Rounds of order and relaxation.
    #[arg(long, default_value_t = 4)]
    rounds: usize,
    /// Trials of the order's search for each pose in each round.
    #[arg(long, default_value_t = 20)]
    trials: u64,
    /// Seed of every random choice: the same seed gives the same plan.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

pub(super) fn run(args: &TaskArgs) -> anyhow::Result<u8> {
    for out in [Some(&args.out), args.json.as_ref(), args.report.as_ref()].into_iter().flatten() {
        writable(out)?;
    }
    let bars = Bars::new();
    let made = args.task.work(task::read(&args.poses)?, args.site.site(), &bars)?;
    args.finish(&made)
}

/// What was made, and of what.
pub(super) struct Made {
    robot: Robot,
    arm: Arm,
    scene: Scene,
    collision: Options,
    pub(super) outcome: TaskOutcome,
}

impl Made {
    /// The page that shows it.
    pub(super) fn page(&self) -> anyhow::Result<ReportData> {
        let outcome = &self.outcome;
        picture(Sitter {
            plans: std::slice::from_ref(&outcome.plan),
            robot: &self.robot,
            arm: &self.arm,
            collision: &self.collision,
            scene: Some(&self.scene),
            verification: Some(&outcome.verification),
            flights: &[],
            left_out: &[],
            tables: vec![report::Table {
                title: "Figures".into(),
                columns: vec!["figure".into(), "value".into()],
                rows: rows(&outcome.figures).into_iter().map(Vec::from).collect(),
            }],
            lines: Vec::new(),
        })
    }
}

impl PoseArgs {
    /// Makes the plan through some poses.
    pub(super) fn work(
        &self,
        found: task::Poses,
        site: Site<'_>,
        bars: &Bars,
    ) -> anyhow::Result<Made> {
        let task::Poses { poses, notes } = found;
        let robot = self.robot.robot()?;
        self.robot.tell(&robot, bars)?;
        for note in &notes {
            bars.note(note);
        }
        let tool = self.tool.as_deref().map_or(Ok(task::tip_tool()), tool_file)?;
        let scene = self.scene(&poses, &tool, bars)?;
        self.base.tell(bars);
        let stance = self.stance();
        let arm = stance.bind(&robot.arm(&self.robot.spec())?)?;
        let start = |posture: &PostureArg| {
            posture.resolve(&arm, &self.robot, site, bars).context("--start")
        };
        let config = TaskConfig {
            arm: self.robot.spec(),
            tool,
            tolerance: self.tolerance,
            start: self.start.as_ref().map(start).transpose()?,
            stance,
            profile: self.profile.into(),
            collision: self.robot.collision(),
            v_max: self.v_max,
            rounds: self.rounds.max(1),
            trials: self.trials.max(1),
            seed: self.seed,
        };
        let outcome = task::run(&robot, &poses, &scene, &config, bars);
        bars.clear();
        let outcome = outcome?;
        for note in &outcome.figures.notes {
            bars.note(note);
        }
        Ok(Made { robot, arm, scene, collision: config.collision, outcome })
    }

    /// What is around the arm, in the floor frame: with nothing scanned the floor alone.
    fn scene(&self, poses: &[Isometry3<f64>], tool: &Tool, bars: &Bars) -> anyhow::Result<Scene> {
        if !self.scans.is_empty() {
            bars.stage("scan", None);
            return Ok(scene(&self.around, None, &self.scans, self.seed, bars)?.in_the_way());
        }
        let floor = self.floor.unwrap_or_else(|| {
            let floor = task::floor_under(poses, tool, self.robot.collision().margins.environment);
            bars.note(&format!(
                "the floor is taken to be at z = {floor:.3} m: --floor says where it is"
            ));
            floor
        });
        let floor = Obstacle::floor(Isometry3::translation(0.0, 0.0, floor));
        Ok(Scene::of_obstacles(vec![floor]))
    }

    fn stance(&self) -> Stance {
        self.base.stance(crate::numbers::held(&self.held, self.torso))
    }
}

impl TaskArgs {
    /// Writes what was asked for and prints the table.
    fn finish(&self, made: &Made) -> anyhow::Result<u8> {
        let (plan, figures) = (&made.outcome.plan, &made.outcome.figures);
        let code = write_unless_broken(plan, &made.outcome.verification.violations, &self.out)?;
        if let Some(path) = &self.report {
            report::write(path, &made.page()?)?;
        }
        if let Some(path) = &self.json {
            write_json(figures, path)?;
        }
        let to_stdout = self.json.as_deref() == Some(std::path::Path::new("-"));
        if !to_stdout {
            let mut table = sheet(["figure", "value"]);
            table.add_rows(rows(figures));
            say!("{table}");
        }
        if code == OK && !to_stdout {
            say!("plan: {}", self.out.display());
            if let Some(path) = &self.report {
                say!("report: {}", path.display());
            }
        }
        Ok(code)
    }
}
/// The figures as name and value, for people.
fn rows(f: &TaskFigures) -> Vec<[String; 2]> {
    let mm = |metres: f64| format!("{:.2}", metres * 1e3);
    let deviation = format!("{}, {} mm", mm(f.edge_deviation_p90_m), mm(f.edge_deviation_max_m));
    vec![
        ["poses, met".to_owned(), format!("{}, {}", f.poses, f.met)],
        ["joint movement (L2)".to_owned(), format!("{:.2} rad", f.movement_rad)],
        ["reconfigurations".to_owned(), f.reconfigurations.to_string()],
        ["effort, transfers included".to_owned(), format!("{:.2} rad", f.effort_rad)],
        ["task time".to_owned(), format!("{:.2} s", f.task_time_s)],
        ["beyond the tolerance, max".to_owned(), format!("{:.1e}", f.excess_max)],
        ["edge deviation, p90, max".to_owned(), deviation],
        ["violations".to_owned(), violations(f.violations, &f.against.guessed_links)],
        ["  against".to_owned(), held_against(&f.against)],
        ["calculation".to_owned(), format!("{:.2} s", f.calc_time_s)],
        ["verification".to_owned(), format!("{:.2} s", f.verify_time_s)],
    ]
}
