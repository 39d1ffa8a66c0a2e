//! What `task` and `follow` share: poses of the tool, how exactly they are met, and what is around.

use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::Args;
use nalgebra::Isometry3;
use nullsweep_collision::Obstacle;
use nullsweep_planner::link::Site;
use nullsweep_planner::plan::Plan;
use nullsweep_planner::poses::{self, Poses, QuaternionOrder, ReadOptions, Setup, Tolerance};
use nullsweep_planner::progress::Progress;
use nullsweep_planner::timing::Speed;
use nullsweep_planner::verify::Verification;
use nullsweep_planner::workcell::Scene;
use nullsweep_report::{self as report, ReportData};
use nullsweep_robot::{Arm, Robot, Tool};
use serde::Serialize;

use crate::bars::Bars;
use crate::choices::ProfileArg;
use crate::exit::{OK, Usage};
use crate::jerk::JerkArg;
use crate::json::write_json;
use crate::numbers::{Held, Offset, Place, finite, positive, velocity};
use crate::output::{say, writable};
use crate::picture::{Sitter, picture};
use crate::posture_arg::PostureArg;
use crate::refusal::write_unless_broken;
use crate::robot::{RobotArgs, tool_file};
use crate::scene::{SceneArgs, scene};
use crate::sheet::sheet;

/// How a file of poses is read.
#[derive(Debug, Args)]
pub(super) struct ReadArgs {
    /// Order of quaternions where no names tell it: xyzw, or wxyz with the scalar first.
    #[arg(long, value_name = "ORDER")]
    quat: Option<QuaternionOrder>,
    /// Where the file's frame is in the robot's root frame, a work offset: X,Y,Z, or with turns about
    /// the fixed axes X,Y,Z,ROLL,PITCH,YAW. [m], [rad]
    #[arg(long, value_name = "OFFSET", allow_hyphen_values = true)]
    offset: Option<Offset>,
}

impl ReadArgs {
    pub(super) fn read(&self, path: &Path) -> anyhow::Result<Poses> {
        let offset = self.offset.map_or_else(Isometry3::identity, |offset| offset.0);
        Ok(poses::read(path, &ReadOptions { order: self.quat, offset })?)
    }
}

/// How poses are met, and what is around.
#[derive(Debug, Args)]
pub(super) struct GivenArgs {
    /// Keep the tool so far off each pose, against its z axis. [m]
    #[arg(long, value_name = "M", allow_hyphen_values = true, value_parser = finite)]
    #[arg(default_value_t = 0.0)]
    stand_off: f64,
    #[command(flatten)]
    robot: RobotArgs,
    /// The tool, a TOML file, whose contact frame meets the poses; without it the tip frame itself.
    #[arg(long, value_name = "FILE")]
    tool: Option<PathBuf>,
    /// How far the tool may be from a pose, along and about its axes: X,Y,Z,RX,RY,RZ, in metres
    /// and radians or `free`. RX and RY are the half angles of the cone that its z axis may tilt in.
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
    #[arg(long, value_name = "X,Y,YAW[,Z]", default_value = "0,0,0", allow_hyphen_values = true)]
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
    /// acceleration, or jerk too, allow, corners blended.
    #[arg(long, value_enum, default_value = "velocity")]
    profile: ProfileArg,
    /// Jerk limits for --profile jerk, in place of the URDF's: `franka`, `pr2`, `ur`, or a TOML file
    /// with a table `jerk` of joint names. [rad/s³]
    #[arg(long, value_name = "NAME|FILE")]
    jerk: Option<JerkArg>,
    /// Speed of the tool on its line, wherever the joints allow it; not at bang-bang velocity. [m/s]
    #[arg(long, value_name = "M/S", value_parser = positive)]
    tool_speed: Option<f64>,
    /// One velocity for all joints, where the robot's own limits are higher. [rad/s]
    #[arg(long, value_parser = velocity)]
    v_max: Option<f64>,
    /// Seed of every random choice: the same seed gives the same plan.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// What is written of a plan.
#[derive(Debug, Args)]
pub(super) struct OutArgs {
    /// Where the plan is written.
    #[arg(long, short, value_name = "FILE", default_value = "plan.json")]
    out: PathBuf,
    /// Write every figure of the run as JSON to a file, or `-`.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write a page that shows the arm moving along the plan.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

/// What the arguments say, read and bound.
pub(super) struct Setting {
    pub(super) robot: Robot,
    arm: Arm,
    pub(super) scene: Scene,
    pub(super) setup: Setup,
    /// Of the tool in the robot's root frame.
    pub(super) segments: Vec<Vec<Isometry3<f64>>>,
}

impl GivenArgs {
    /// Reads all that is named, for these poses.
    pub(super) fn setting(
        &self,
        poses: Poses,
        site: Site<'_>,
        bars: &Bars,
    ) -> anyhow::Result<Setting> {
        let Poses { mut segments, notes } = poses;
        let robot = self.robot.robot()?;
        self.robot.tell(&robot, bars)?;
        for note in &notes {
            bars.note(note);
        }
        for pose in segments.iter_mut().flatten() {
            *pose *= nalgebra::Translation3::new(0.0, 0.0, -self.stand_off);
        }
        let tool = self.tool.as_deref().map_or(Ok(poses::tip_tool()), tool_file)?;
        let scene = self.scene(&segments.concat(), &tool, bars)?;
        self.base.tell(bars);
        let stance = self.base.stance(crate::numbers::held(&self.held, self.torso));
        let arm = stance.bind(&robot.arm(&self.robot.spec())?)?;
        let start = |posture: &PostureArg| {
            posture.resolve(&arm, &self.robot, site, bars).context("--start")
        };
        let start = self.start.as_ref().map(start).transpose()?;
        let speed = Speed {
            profile: self.profile.into(),
            v_max: self.v_max,
            jerk: self.jerk.as_ref().map(|jerk| jerk.of(&arm)).transpose()?,
            tool: self.tool_speed,
        };
        let (tolerance, collision) = (self.tolerance, self.robot.collision());
        let setup = Setup {
            arm: self.robot.spec(),
            tool,
            tolerance,
            stance,
            start,
            speed,
            collision,
            seed: self.seed,
        };
        Ok(Setting { robot, arm, scene, setup, segments })
    }

    /// What is around the arm, in the floor frame: with nothing scanned the floor, and what is placed.
    fn scene(&self, poses: &[Isometry3<f64>], tool: &Tool, bars: &Bars) -> anyhow::Result<Scene> {
        if !self.scans.is_empty() {
            bars.stage("scan", None);
            let scene = scene(&self.around, None, &self.scans, self.seed, bars)?;
            if scene.regions.are_swept() {
                return Err(Usage(
                    "regions to sweep are of `plan`: given poses say themselves where the tool goes; \
                     leave such regions out of --regions"
                        .into(),
                )
                .into());
            }
            return Ok(scene.in_the_way());
        }
        let floor = self.floor.unwrap_or_else(|| {
            let margin = self.robot.collision().margins.environment;
            let floor = poses::floor_under(poses, tool, margin);
            bars.note(&format!(
                "the floor is taken to be at z = {floor:.3} m: --floor says where it is"
            ));
            floor
        });
        let floor = Obstacle::floor(Isometry3::translation(0.0, 0.0, floor));
        self.around.unscanned(floor)
    }
}

/// A plan through poses with what is known of it.
pub(super) struct Drawn<'a> {
    pub(super) setting: &'a Setting,
    pub(super) plan: &'a Plan,
    pub(super) verification: &'a Verification,
    /// The figures as name and value, for people.
    pub(super) rows: Vec<[String; 2]>,
}

impl Drawn<'_> {
    /// The page that shows it.
    pub(super) fn page(&self) -> anyhow::Result<ReportData> {
        let setting = self.setting;
        picture(Sitter {
            plans: std::slice::from_ref(self.plan),
            robot: &setting.robot,
            arm: &setting.arm,
            collision: &setting.setup.collision,
            scene: Some(&setting.scene),
            verification: Some(self.verification),
            flights: &[],
            tables: vec![report::Table {
                title: "Figures".into(),
                columns: vec!["figure".into(), "value".into()],
                rows: self.rows.iter().cloned().map(Vec::from).collect(),
            }],
            lines: Vec::new(),
        })
    }
}

impl OutArgs {
    /// Refuses before the work what cannot be written after it.
    pub(super) fn writable(&self) -> anyhow::Result<()> {
        let outs = [Some(&self.out), self.json.as_ref(), self.report.as_ref()];
        outs.into_iter().flatten().try_for_each(|out| writable(out))
    }

    /// Writes what was asked for and prints the table.
    pub(super) fn finish(&self, made: &Drawn<'_>, figures: &impl Serialize) -> anyhow::Result<u8> {
        let code = write_unless_broken(made.plan, &made.verification.violations, &self.out)?;
        if let Some(path) = &self.report {
            report::write(path, &made.page()?)?;
        }
        if let Some(path) = &self.json {
            write_json(figures, path)?;
        }
        let to_stdout = self.json.as_deref() == Some(Path::new("-"));
        if !to_stdout {
            let mut table = sheet(["figure", "value"]);
            table.add_rows(&made.rows);
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
