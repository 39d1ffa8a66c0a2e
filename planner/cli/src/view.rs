//! `planner view`.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, bail};
use clap::Args;
use nalgebra::Isometry3;
use nullsweep_collision::Obstacle;
use nullsweep_planner::plan::{Plan, Program};
use nullsweep_planner::progress::Progress;
use nullsweep_planner::verify::{Given, verify};
use nullsweep_recording::Recording;
use nullsweep_report::{self as report, ReportData};
use nullsweep_robot::{Arm, Robot, Tool};
use nullsweep_surface::room::Room;

use crate::bars::Bars;
use crate::exit::{OK, Usage};
use crate::figures::verified_table;
use crate::output::{say, tell, writable};
use crate::picture::{self, Flight, Posed, Sitter, picture, recorded};
use crate::placed::{Gravity, read_scans};
use crate::robot::{RobotArgs, differs, tool_file};
use crate::scene::{Demo, SceneArgs, scene};
use crate::scene_command;

#[derive(Debug, Args)]
pub(super) struct ViewArgs {
    /// Plan files, in the order in which one takes over from another; the scan files that they were
    /// made for (or the scene file), given as they were to `plan`; flight recordings (`.nswrec`) of
    /// when they ran. Scans or a scene file alone show planes and objects, a recording alone what was
    /// commanded and measured.
    #[arg(required_unless_present = "demo")]
    files: Vec<PathBuf>,
    /// The plans were made for a simulated scan.
    #[arg(long, value_enum)]
    demo: Option<Demo>,
    /// The tool of a recording without a plan, a TOML file; else a sponge of 0.10 × 0.07 m.
    #[arg(long, value_name = "FILE")]
    tool: Option<PathBuf>,
    #[command(flatten)]
    scene: SceneArgs,
    #[command(flatten)]
    robot: RobotArgs,
    /// Seed of the simulated scan, or of the points laid on a mesh; without it the plan's, or 1.
    #[arg(long)]
    seed: Option<u64>,
    /// Where the page is written; without it beside the first file, its name with `.view.html` behind.
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Write the same as an MCAP log as well, for Foxglove, rerun and whatever reads ROS 2 messages.
    #[arg(long, value_name = "FILE")]
    mcap: Option<PathBuf>,
    /// Only write the page, open nothing.
    #[arg(long)]
    no_open: bool,
}

pub(super) fn run(args: &ViewArgs) -> anyhow::Result<u8> {
    let bars = Bars::new();
    let out = args.out.clone().unwrap_or_else(|| beside(args.files.first()));
    writable(&out)?;
    args.mcap.as_deref().map_or(Ok(()), writable)?;
    if let Some(absent) = args.files.iter().find(|file| !file.exists()) {
        return Err(Usage(format!("{}: there is no such file", absent.display())).into());
    }
    let (plans, rest): (Vec<&PathBuf>, Vec<&PathBuf>) =
        args.files.iter().partition(|file| is_plan(file));
    let (recordings, scans): (Vec<&PathBuf>, Vec<&PathBuf>) =
        rest.into_iter().partition(|file| has_extension(file, "nswrec"));
    let scans: Vec<PathBuf> = scans.into_iter().cloned().collect();
    if let (Some(_), Some(scan)) = (args.demo, scans.first()) {
        let why = "a scan beside --demo: the scene is one or the other";
        return Err(Usage(format!("{}: {why}", scan.display())).into());
    }
    if let [file] = plans[..]
        && let Some(program) = Program::read(file)?
    {
        let data = of_program(args, &program, &scans, &bars)?;
        return finish(args, &out, &data, &bars);
    }
    let plans = plans.into_iter().map(|file| Plan::read(file)).collect::<Result<Vec<_>, _>>()?;
    let data = if let (Some(recording), true) = (recordings.first(), plans.is_empty()) {
        if recordings.len() > 1 || !scans.is_empty() || args.demo.is_some() {
            return Err(Usage(format!(
                "beside {} there is more to show: name the plan that ran too, its file says where the \
                 robot stands",
                recording.display()
            ))
            .into());
        }
        of_recording(args, recording, &bars)?
    } else if plans.is_empty() {
        if args.demo.is_some() {
            let why = "--demo says what a plan was made for: name the plan's file";
            return Err(Usage(why.into()).into());
        }
        let seed = args.seed.unwrap_or(1);
        let found = read_scans(args.scene.placed(), &scans, seed, Gravity::Found, &bars)?;
        let room = Room::find(&found.scan, found.seed.unwrap_or(seed));
        scene_command::picture(&scans, &found.scan, &room)
    } else {
        of_plans(args, &plans, &scans, &recordings, &bars)?
    };
    finish(args, &out, &data, &bars)
}

/// Writes the page and what else was asked for.
fn finish(args: &ViewArgs, out: &Path, data: &ReportData, bars: &Bars) -> anyhow::Result<u8> {
    bars.clear();
    report::write(out, data)?;
    say!("page: {}", out.display());
    if let Some(path) = &args.mcap {
        let there = || format!("cannot write {}", path.display());
        report::write_log(path, data).with_context(there)?;
        say!("log: {}", path.display());
    }
    if !args.no_open {
        open(out);
    }
    Ok(OK)
}

/// The page of a program, in its scene if that is given.
fn of_program(
    args: &ViewArgs,
    program: &Program,
    scans: &[PathBuf],
    bars: &Bars,
) -> anyhow::Result<ReportData> {
    let seed = program.works().map(|(_, work)| work.plan.seed).next().unwrap_or(1);
    let is_given = args.demo.is_some() || !scans.is_empty();
    let read = || {
        bars.stage("scan", None);
        scene(&args.scene, args.demo, scans, args.seed.unwrap_or(seed), bars)
    };
    let scene = is_given.then(read).transpose()?;
    bars.stage("picture", None);
    let (robot, collision) = (args.robot.robot()?, args.robot.collision());
    picture::of_program(program, &robot, &collision, scene.as_ref())
}

/// The page of plans, in their scene if that is given.
fn of_plans(
    args: &ViewArgs,
    plans: &[Plan],
    scans: &[PathBuf],
    recordings: &[&PathBuf],
    bars: &Bars,
) -> anyhow::Result<ReportData> {
    let plan = &plans[plans.len() - 1];
    let robot = args.robot.robot()?;
    let arm = arm(args, &robot, plan)?;
    let collision = args.robot.collision();
    let scene = if args.demo.is_some() || !scans.is_empty() {
        bars.stage("scan", None);
        Some(scene(&args.scene, args.demo, scans, args.seed.unwrap_or(plan.seed), bars)?)
    } else if plan.is_of_poses() && args.scene.has_obstacles() {
        Some(args.scene.unscanned(Obstacle::floor(Isometry3::identity()))?)
    } else {
        None
    };
    let verification = match &scene {
        None => None,
        Some(scene) => {
            bars.stage("verify", Some(plan.knots.len()));
            let given = Given { robot: &robot, arm: arm.spec(), scene, collision: &collision };
            Some(verify(plan, given, &|| bars.tick())?)
        }
    };
    let flights = recordings.iter().map(|file| flight(file, &arm, &plan.tool, plans));
    let flights = flights.collect::<anyhow::Result<Vec<_>>>()?;
    bars.stage("picture", None);
    picture(Sitter {
        plans,
        robot: &robot,
        arm: &arm,
        collision: &collision,
        scene: scene.as_ref(),
        verification: verification.as_ref(),
        flights: &flights,
        tables: verification.as_ref().map(verified_table).into_iter().collect(),
        lines: Vec::new(),
    })
}

/// The page of a recording, of the arm that the cell or the flags name.
fn of_recording(args: &ViewArgs, file: &Path, bars: &Bars) -> anyhow::Result<ReportData> {
    let (robot, arm) = (args.robot.robot()?, args.robot.arm()?);
    let tool = args.tool.as_deref().map_or(Ok(Tool::default()), tool_file)?;
    let flight = flight(file, &arm, &tool, &[])?;
    bars.stage("picture", None);
    let collision = args.robot.collision();
    recorded(file, flight, Posed { robot: &robot, arm: &arm, tool: &tool, collision: &collision })
}

/// What a recording says of plans.
fn flight(file: &Path, arm: &Arm, tool: &Tool, plans: &[Plan]) -> anyhow::Result<Flight> {
    let recording = Recording::read(file)?;
    Flight::of(&recording, arm, tool, plans).with_context(|| file.display().to_string())
}

/// The arm that the plan is for, its held joints where the plan holds them.
fn arm(args: &ViewArgs, robot: &Robot, plan: &Plan) -> anyhow::Result<Arm> {
    let arm = robot.arm(&args.robot.spec())?;
    if plan.fingerprint != arm.fingerprint() || plan.joints != arm.joint_names() {
        bail!("{}: say which one by --urdf and --arm BASE,TIP, or left", differs(plan, &arm));
    }
    let held: Vec<(&str, f64)> = plan.held.iter().map(|h| (h.name.as_str(), h.position)).collect();
    Ok(arm.with_held(&held)?)
}

/// Whether a file is a plan, by its name: no scan is JSON.
fn is_plan(file: &Path) -> bool {
    has_extension(file, "json") || has_extension(file, "plan")
}

fn has_extension(file: &Path, wanted: &str) -> bool {
    file.extension().is_some_and(|e| e.eq_ignore_ascii_case(wanted))
}

fn beside(file: Option<&PathBuf>) -> PathBuf {
    file.map_or_else(|| "view.html".into(), |file| file.with_extension("view.html"))
}

/// Opens the page in the user's browser, or says why not.
fn open(page: &Path) {
    let has_screen = cfg!(target_os = "macos")
        || ["DISPLAY", "WAYLAND_DISPLAY"].iter().any(|name| std::env::var_os(name).is_some());
    if !has_screen {
        tell!("there is no screen here: open the page in a browser");
        return;
    }
    let program = if cfg!(target_os = "macos") { "open" } else { "xdg-open" };
    let started = Command::new(program)
        .arg(page)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .with_context(|| format!("{program} cannot be started"));
    if let Err(error) = started {
        tell!("{error:#}: open the page in a browser");
    }
}
