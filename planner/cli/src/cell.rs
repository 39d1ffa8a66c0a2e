//! `planner cell`: a cell file for a robot, and whether it holds.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use clap::{Args, Subcommand};
use nullsweep_cell::{Cell, is_program, named_in};
use nullsweep_collision::{ToolContact, World};
use nullsweep_ipc_types::service::DEFAULT_ROBOT;
use nullsweep_planner::progress::Progress;
use nullsweep_planner::workcell::{Scene, nearest_free};
use nullsweep_robot::{Arm, ArmSpec, JointKind, JointVector, MAX_DOF, Robot, Tool};

use crate::bars::Bars;
use crate::exit::{FAILED, OK, Usage};
use crate::numbers::Held;
use crate::output::{say, say_on};
use crate::posture_arg::PostureArg;
use crate::robot::{RobotArgs, tool_file};
use crate::site::SiteArgs;

#[derive(Debug, Args)]
pub(super) struct CellArgs {
    #[command(subcommand)]
    deed: Deed,
}

#[derive(Debug, Subcommand)]
enum Deed {
    /// Write a cell file with comments for a robot, and check it. Takes nothing from another cell file.
    Init(InitArgs),
    /// Check a cell: meshes, how far the arm reaches, whether its postures are free of collision.
    Check(CheckArgs),
}

#[derive(Debug, Args)]
struct InitArgs {
    #[command(flatten)]
    check: CheckArgs,
    /// Where the cell file is written.
    #[arg(long, short, value_name = "FILE", default_value = nullsweep_cell::FILE_NAME)]
    out: PathBuf,
}

#[derive(Debug, Args)]
struct CheckArgs {
    #[command(flatten)]
    robot: RobotArgs,
    /// The tool, a TOML file; without it a sponge of 0.10 × 0.07 m.
    #[arg(long, value_name = "FILE")]
    tool: Option<PathBuf>,
    /// Position of a joint outside the arm: NAME=VALUE.
    #[arg(long, value_name = "NAME=VALUE", allow_hyphen_values = true)]
    held: Vec<Held>,
    #[command(flatten)]
    site: SiteArgs,
}

pub(super) fn run(args: &CellArgs) -> anyhow::Result<u8> {
    match &args.deed {
        Deed::Init(args) => init(args),
        Deed::Check(args) => {
            let robot = args.robot.robot()?;
            let arm = args.arm(&robot, &args.robot.spec())?;
            let found = args.look(&robot, &arm)?;
            say_on!("{}", found.text);
            let endpoint = endpoint()?;
            if let Some((told, _)) = &endpoint {
                say!("  endpoint  {told}");
            }
            let there = endpoint.is_none_or(|(_, there)| there);
            Ok(if found.sound && there { OK } else { FAILED })
        }
    }
}

/// The endpoint that the cell file names, if there is one, and whether it is a program.
fn endpoint() -> anyhow::Result<Option<(String, bool)>> {
    let mut args = std::env::args_os().collect();
    let Some(file) = nullsweep_cell::take(&mut args) else { return Ok(None) };
    let Some(command) = Cell::read(&file)?.endpoint else { return Ok(None) };
    let Some(program) = command.first() else { return Ok(None) };
    let there = is_program(&named_in(file.parent().unwrap_or(Path::new("")), program));
    let told = match there {
        true => command.join(" "),
        false => format!(
            "there is no program `{program}`, neither beside this one nor on the PATH; one with a path is \
             looked for from the cell file's folder on"
        ),
    };
    Ok(Some((told, there)))
}

fn init(args: &InitArgs) -> anyhow::Result<u8> {
    let out = &args.out;
    ensure!(
        !out.exists(),
        "{} is there already: remove it, or choose another --out",
        out.display()
    );
    crate::output::writable(out)?;
    let robot = args.check.robot.robot()?;
    let spec = spec_for(&robot, &args.check.robot)?;
    let arm = args.check.arm(&robot, &spec)?;
    let found = args.check.look(&robot, &arm)?;
    let text = args.check.file(&robot, &arm, found.home, out.parent().unwrap_or(Path::new("")))?;
    std::fs::write(out, text).with_context(|| format!("cannot write {}", out.display()))?;
    say_on!("{}", found.text);
    say!("cell: {}", out.display());
    Ok(OK)
}

/// The arm that is asked for, or for a robot that has no `right` one the longest chain of joints, which
/// is told.
fn spec_for(robot: &Robot, args: &RobotArgs) -> anyhow::Result<ArmSpec> {
    let asked = args.spec();
    if robot.arm(&asked).is_ok() || !args.is_default_arm() {
        return Ok(asked);
    }
    let root = robot.links()[robot.root()].name.clone();
    let joints_to = |mut link: usize| {
        let mut count = 0;
        while let Some(joint) = robot.links()[link].parent_joint {
            let joint = &robot.joints()[joint];
            count += usize::from(joint.kind != JointKind::Fixed);
            link = joint.parent;
        }
        count
    };
    // The first of those that are moved by most joints: what hangs on fixed joints behind it is a tool.
    let mut best: Option<(usize, usize)> = None;
    for link in 0..robot.links().len() {
        let count = joints_to(link);
        if (1..=MAX_DOF).contains(&count) && best.is_none_or(|(most, _)| count > most) {
            best = Some((count, link));
        }
    }
    let (count, link) = best.ok_or_else(|| {
        Usage(format!("no chain of 1 to {MAX_DOF} joints was found: --arm BASE,TIP names the arm"))
    })?;
    let tip = robot.links()[link].name.clone();
    Bars::new().note(&format!(
        "the arm is taken to be the {count} joints from {root} to {tip}: --arm BASE,TIP says it"
    ));
    Ok(ArmSpec { base: root, tip })
}

/// What a look at a cell found.
struct Found {
    text: String,
    home: JointVector,
    sound: bool,
}

/// Joint vectors by which the reach is measured.
const REACHES: usize = 5000;

impl CheckArgs {
    fn arm(&self, robot: &Robot, spec: &ArmSpec) -> anyhow::Result<Arm> {
        let held: Vec<_> = self.held.iter().map(|h| (h.0.as_str(), h.1)).collect();
        Ok(robot.arm(spec)?.with_held(&held)?)
    }

    fn tool(&self) -> anyhow::Result<Tool> {
        self.tool.as_deref().map_or(Ok(Tool::default()), tool_file)
    }

    /// What it is like.
    fn look(&self, robot: &Robot, arm: &Arm) -> anyhow::Result<Found> {
        let mut text = String::new();
        let mut line = |name: &str, value: String| {
            let _ = writeln!(text, "  {name:<9} {value}");
        };
        line("robot", format!("{}, {} links", robot.name(), robot.links().len()));
        let spec = arm.spec();
        line("arm", format!("{} joints from {} to {}", arm.dof(), spec.base, spec.tip));
        line("joints", arm.joint_names().join(", "));
        let tool = self.tool()?;
        let [across, along] = tool.track();
        let shape = tool.footprint.shape();
        line("tool", format!("{}, {shape}, {across:.3} × {along:.3} m", tool.name));
        let pad = tool.on(arm);
        let first = arm.moving_links().first().map_or(0, |link| *link);
        let mut poses = vec![nalgebra::Isometry3::identity(); robot.links().len()];
        let (mut far, mut low, mut high) = (0.0f64, f64::INFINITY, f64::NEG_INFINITY);
        for q in (0..REACHES).map(|k| arm.spread(k)) {
            arm.link_poses(&q, &mut poses);
            let at = pad.centre(&q);
            far = far.max((at.coords - poses[first].translation.vector).norm());
            (low, high) = (low.min(at.z), high.max(at.z));
        }
        line(
            "reach",
            format!("the pad {far:.2} m from the first joint, {low:.2} to {high:.2} m high"),
        );
        let obstacles = Scene::empty().obstacles;
        let world = World::new(robot, arm, &tool, &[], &obstacles, &self.robot.collision())?;
        for note in world.notes() {
            line("note", note.clone());
        }
        let mut sound = true;
        if let Some(hit) = world.stance_hit() {
            sound = false;
            line("stands", format!("in collision: {hit}"));
        }
        let bars = Bars::new();
        let home = PostureArg::Named("home".into());
        let home = home.resolve(arm, &self.robot, self.site.site(), &bars)?;
        let names = self.robot.postures().iter().map(|p| p.name().to_owned());
        let mut free = home;
        for name in std::iter::once("home".to_owned()).chain(names.filter(|n| n != "home")) {
            let posture = PostureArg::Named(name.clone());
            let q = posture.resolve(arm, &self.robot, self.site.site(), &bars)?;
            let Some(why) = trouble(arm, &world, &q) else {
                line(&name, "free of collision".into());
                continue;
            };
            sound = false;
            line(&name, why);
            if name == "home"
                && let Some(q) = nearest_free(arm, &world, &home)
            {
                line("", format!("the nearest free posture found: {}", list(arm, &q, 2)));
                free = q;
            }
        }
        Ok(Found { text, home: free, sound })
    }

    /// The robot's name in its services' names: as it was given, else by its URDF.
    fn name(&self, robot: &Robot) -> String {
        let given = self.site.site().robot;
        if given != DEFAULT_ROBOT {
            return given.to_owned();
        }
        let sound = |c: char| c.is_ascii_alphanumeric() || "_-.".contains(c);
        robot.name().chars().map(|c| if sound(c) { c } else { '_' }).collect()
    }

    /// The cell file, its paths from `folder` on.
    fn file(
        &self,
        robot: &Robot,
        arm: &Arm,
        home: JointVector,
        folder: &Path,
    ) -> anyhow::Result<String> {
        let path = |path: &Path| -> anyhow::Result<String> {
            let at = path.canonicalize().with_context(|| path.display().to_string())?;
            let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
            let own = folder.canonicalize()?;
            let from = at.strip_prefix(&own).map_or(at.clone(), Path::to_path_buf);
            Ok(format!("{:?}", from.display().to_string()))
        };
        let files = self.robot.files();
        let mut text = String::from(
            "# Which robot is meant, and what is around it, for planner, executor, mock-hardware and\n\
             # conformance. They find this file in the folder where they are started and above; what is\n\
             # given on the command line wins. Paths are from this file's folder on, lengths in m, angles\n\
             # in rad.\n\n",
        );
        let mut put = |about: &str, name: &str, value: Option<String>, example: &str| {
            let line = value.map_or(format!("# {name} = {example}"), |v| format!("{name} = {v}"));
            let _ = writeln!(text, "# {about}\n{line}");
        };
        let quoted = |text: &str| format!("{text:?}");
        let name = quoted(&self.name(robot));
        put("Name of the robot in the names of its services.", "robot", Some(name), "");
        let urdf = files.urdf.map(path).transpose()?;
        put("The robot; without it a PR2.", "urdf", urdf, "\"robot.urdf\"");
        let spec = arm.spec();
        let arm_name = quoted(&format!("{},{}", spec.base, spec.tip));
        put("The arm: its base and tip link.", "arm", Some(arm_name), "");
        let tool = self.tool.as_deref().map(path).transpose()?;
        put("The tool at the tip; without it a sponge.", "tool", tool, "\"tool.toml\"");
        let srdf = files.srdf.map(path).transpose()?;
        put("Which links may touch.", "srdf", srdf, "\"robot.srdf\"");
        let capsules = files.fit_capsules.map(|r| r.to_string());
        put("Capsules of this radius where meshes are missing.", "fit_capsules", capsules, "0.05");
        // It need not be there yet.
        let root = self.site.site().root.map(std::path::absolute).transpose()?;
        let root = root.map(|root| quoted(&root.display().to_string()));
        put("Folder that keeps its services apart.", "ipc_root", root, "\"/run/user/1000/cell\"");
        let endpoint = "[\"mock-hardware\"]";
        put("What `nullsweep endpoint` starts.", "endpoint", Some(endpoint.into()), "");
        let _ = writeln!(text, "\n# Where `package://NAME/` is.\n[packages]");
        for (name, folder) in files.packages {
            let _ = writeln!(text, "{name:?} = {}", path(folder)?);
        }
        let _ = writeln!(text, "\n# Joints outside the arm, as they stand.\n[held]");
        for held in arm.held_joints() {
            let given = self.held.iter().any(|h| h.0 == held.name);
            let mark = if given { "" } else { "# " };
            let _ = writeln!(text, "{mark}{:?} = {}", held.name, held.position);
        }
        let names = arm.joint_names().join(", ");
        let _ = writeln!(
            text,
            "\n# Joint vectors by name: {names}.\n# Plans begin at `start`, or at `home` where there is \
             none.\n[postures]\nhome = [{}]\n# start = [{}]",
            list(arm, &home, 4),
            list(arm, &home, 4)
        );
        let _ = writeln!(
            text,
            "\n# How fast: one velocity for all joints, and whether accelerations or jerks are limited\n\
             # (velocity, acceleration, jerk).\n\
             [limits]\n# v_max = 0.5\nprofile = \"acceleration\"\n\n\
             # How scans stand, and where the robot stands before them.\n\
             [scene]\n# up = [0, -1, 0]\n# sensor_height = 0.83\n# support_height = 0.72\n\
             # table = [1.2, 0.8]\n# base = [-0.7, 0, 0]\n\n\
             # How `executor run` runs.\n[executor]\n# rate = 1000\n# cpu = 3\n# record = \"recordings\""
        );
        Ok(text)
    }
}

/// What keeps the arm from being there.
fn trouble(arm: &Arm, world: &World, q: &JointVector) -> Option<String> {
    for (j, &(low, high)) in arm.margined_limits().iter().enumerate() {
        if !(low..=high).contains(&q[j]) {
            let name = &arm.joint_names()[j];
            return Some(format!(
                "{name} at {:.3} is outside its limits {low:.3} … {high:.3}",
                q[j]
            ));
        }
    }
    world.why_not(q, ToolContact::Forbidden).map(|hit| format!("in collision: {hit}"))
}

fn list(arm: &Arm, q: &JointVector, digits: usize) -> String {
    let joints: Vec<String> = q[..arm.dof()].iter().map(|v| format!("{v:.digits$}")).collect();
    joints.join(", ")
}
