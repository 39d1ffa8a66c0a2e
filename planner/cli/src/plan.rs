//! `planner plan`.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use anyhow::Context;
use clap::Args;
use nullsweep_collision::Options;
use nullsweep_planner::link::Site;
use nullsweep_planner::pipeline::{self, After, End, Job, Outcome, StanceChoice, sizes};
use nullsweep_planner::plan::Plan;
use nullsweep_planner::progress::Progress;
use nullsweep_planner::roadmap::GraphConfig;
use nullsweep_planner::tour::formulation::FormulationConfig;
use nullsweep_planner::workcell::Scene;
use nullsweep_planner::workcell::stance::{Stance, StanceSearch};
use nullsweep_report::{self as report, ReportData};
use nullsweep_robot::{Robot, Tool};
use nullsweep_surface::PatchConfig;

use crate::bars::Bars;
use crate::choices::{CostArg, MethodArg, ProfileArg, SmoothArg};
use crate::exit::OK;
use crate::figures::{figures_table, table};
use crate::floor::Placed;
use crate::jerk::JerkArg;
use crate::json::write_json;
use crate::numbers::{Held, Place, finite, not_negative, positive, velocity};
use crate::output::{say, writable};
use crate::picture::{Sitter, picture};
use crate::posture_arg::PostureArg;
use crate::refusal::write_unless_broken;
use crate::robot::{RobotArgs, tool_file};
use crate::scene::{Demo, SceneArgs, seen};

#[derive(Debug, Args)]
pub(super) struct PlanArgs {
    /// Scan files: PCD, PLY, XYZ/CSV, STL, OBJ, glTF/GLB, LAS/LAZ, E57, PTX or NPY; or one scene file that `planner scene` wrote.
    #[arg(required_unless_present = "demo", conflicts_with = "demo")]
    scans: Vec<PathBuf>,
    /// Plan for a simulated scan instead.
    #[arg(long, value_enum)]
    demo: Option<Demo>,

    #[command(flatten)]
    pub(super) scene: SceneArgs,

    #[command(flatten)]
    pub(super) robot: RobotArgs,
    /// The tool, a TOML file; without it a sponge of 0.10 × 0.07 m.
    #[arg(long, value_name = "FILE")]
    tool: Option<PathBuf>,
    /// Where the robot stands in the floor frame: x,y,yaw (in radians, or degrees with
    /// ° or deg behind them), or x,y,yaw,z where it is raised so far above the floor; or `auto`:
    /// where it reaches most.
    #[arg(long, default_value = "auto", allow_hyphen_values = true)]
    base: Base,
    /// Height of the PR2's torso joint; without it `--base auto` chooses it too. [m]
    #[arg(long, value_name = "M", value_parser = finite)]
    torso: Option<f64>,
    /// Position of another held joint: NAME=VALUE.
    #[arg(long, value_name = "NAME=VALUE", allow_hyphen_values = true)]
    held: Vec<Held>,
    /// Where the arm starts: its joints, comma-separated; a posture by its name; or `measured`, where
    /// the executor holds it. Without it a posture that the SRDF names (home before others), or the
    /// middle of its ranges, or the nearest free of collision.
    #[arg(long, value_name = "POSTURE", allow_hyphen_values = true)]
    start: Option<PostureArg>,
    /// Where the arm is left: with the tool lifted off the surface, on it (contact), where it started
    /// (start), or in a posture as for --start.
    #[arg(long, value_name = "END", allow_hyphen_values = true, default_value = "lifted")]
    end: EndArg,

    /// Go on from knot K of a plan, for the patches that it has not swept by then.
    #[arg(long = "continue", value_name = "PLAN@K")]
    after: Option<KnotOf>,
    /// With --continue: sweep everything again.
    #[arg(long, requires = "after")]
    again: bool,

    /// How the order is found; without it by Curvature, for a roller and a nozzle in strips (raster).
    #[arg(long, value_enum)]
    method: Option<MethodArg>,
    /// What is minimised.
    #[arg(long, value_enum, default_value = "time")]
    cost: CostArg,
    /// Samples of the inverse kinematics at each tool pose.
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=1000))]
    ik_samples: u32,
    /// One velocity for all joints, where the robot's own limits are higher. [rad/s]
    #[arg(long, value_parser = velocity)]
    v_max: Option<f64>,
    /// How fast the plan goes along its path: at bang-bang velocity, or as fast as velocity and
    /// acceleration allow, corners blended within the line's tolerance.
    #[arg(long, value_enum, default_value = "velocity")]
    profile: ProfileArg,
    /// Jerk limits for --profile jerk, in place of the URDF's: `franka` (libfranka's), `pr2` or `ur`
    /// (none are published: full acceleration in 0.1 s), or a TOML file with a table `jerk` of joint
    /// names. [rad/s³]
    #[arg(long, value_name = "NAME|FILE")]
    jerk: Option<JerkArg>,
    /// Speed of the pad's centre on the surface, wherever the joints allow it; not at bang-bang
    /// velocity. Without it as fast as they allow, or as a nozzle's deposit asks. [m/s]
    #[arg(long, value_name = "M/S", value_parser = positive)]
    tool_speed: Option<f64>,
    /// Whether the pad's way on the surface is made a fair curve, as far as it sweeps as much: `on`,
    /// `off`, or `auto`: with limited accelerations or jerks.
    #[arg(long, value_enum, default_value = "auto")]
    smooth: SmoothArg,
    /// Radius of a patch's neighbourhood; without it from the tool's size (0.04 for the sponge). [m]
    #[arg(long, value_name = "M", value_parser = positive)]
    patch_radius: Option<f64>,
    /// Nearest neighbours of each patch that are tried as edges.
    #[arg(long, default_value_t = GraphConfig::default().neighbours)]
    neighbours: usize,
    /// Longest edge; without it from the tool's size (0.1 for the sponge). [m]
    #[arg(long, value_name = "M", value_parser = positive)]
    radius: Option<f64>,
    /// Weight of turning against distance in the Curvature-GTSP (Eq. 4).
    #[arg(long, default_value_t = FormulationConfig::default().beta, value_parser = not_negative)]
    beta: f64,
    /// Trials of the order's search for each patch.
    #[arg(long, default_value_t = FormulationConfig::default().trials_per_cluster)]
    trials: u64,
    /// How often patches are put over what the plan has not swept, and the plan is made again.
    #[arg(long, default_value_t = 2)]
    refinements: usize,
    /// Seed of every random choice: the same seed gives the same plan.
    #[arg(long, default_value_t = 1)]
    seed: u64,

    /// Where the plan is written.
    #[arg(long, short, value_name = "FILE", default_value = "plan.json")]
    out: PathBuf,
    /// Write every figure of the run as JSON to a file, or `-`.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write a page that shows the arm moving along the plan, what it sweeps and what is left.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

/// What lies farther before a pad than this does not touch it. [m]
const HOVERS: f64 = 0.005;

#[derive(Clone, Copy, Debug)]
enum Base {
    Auto,
    At(Place),
}

impl FromStr for Base {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "auto" { Ok(Self::Auto) } else { Ok(Self::At(Place::from_str(text)?)) }
    }
}

/// Where a plan leaves the arm, as it is asked for.
#[derive(Clone, Debug)]
enum EndArg {
    Lifted,
    Contact,
    Start,
    At(PostureArg),
}

impl FromStr for EndArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Ok(match text {
            "lifted" => Self::Lifted,
            "contact" => Self::Contact,
            "start" => Self::Start,
            posture => Self::At(posture.parse()?),
        })
    }
}

#[derive(Clone, Debug)]
struct KnotOf {
    plan: PathBuf,
    knot: usize,
}

impl FromStr for KnotOf {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (plan, knot) = text.rsplit_once('@').ok_or("PLAN@K is wanted")?;
        let knot = knot.parse().map_err(|e| format!("`{knot}`: {e}"))?;
        Ok(Self { plan: plan.into(), knot })
    }
}

/// Makes a plan, writes what was asked for, and gives the exit code with it.
pub(super) fn make(
    args: &PlanArgs,
    site: Site<'_>,
    after: Option<After>,
) -> anyhow::Result<(u8, Plan)> {
    args.writable()?;
    let made = args.work(site, after, &Bars::new())?;
    Ok((finish(args, &made)?, made.outcome.plan))
}

/// What is written, and where.
#[derive(Clone, Copy)]
pub(super) struct Files<'a> {
    pub(super) out: &'a Path,
    pub(super) json: Option<&'a Path>,
    pub(super) report: Option<&'a Path>,
}

/// What was made, and of what.
pub(super) struct Made {
    robot: Robot,
    pub(super) scene: Scene,
    collision: Options,
    pub(super) outcome: Outcome,
}

impl PlanArgs {
    /// Makes the plan.
    pub(super) fn work(
        &self,
        site: Site<'_>,
        after: Option<After>,
        bars: &Bars,
    ) -> anyhow::Result<Made> {
        let robot = self.robot.robot()?;
        self.robot.tell(&robot, bars)?;
        let job = job(self, &robot, site, after, bars)?;
        let scene = self.scene(bars)?;
        self.planned(robot, scene, job, bars)
    }

    /// Makes the plan of a job in a scene.
    pub(super) fn planned(
        &self,
        robot: Robot,
        scene: Scene,
        job: Job,
        bars: &Bars,
    ) -> anyhow::Result<Made> {
        if job.tool.touches() && job.tool.stand_off <= 0.0 && job.tool.hover() > HOVERS {
            let hover = 1e3 * job.tool.hover();
            bars.note(&format!(
                "points up to {hover:.0} mm before the pad count as swept: its stand_off and \
                 reach_normal say so"
            ));
        }
        let outcome = pipeline::run(&robot, &scene, &job, bars);
        bars.clear();
        Ok(Made { robot, scene, collision: job.collision, outcome: outcome? })
    }

    /// The plan that this one goes on from, if one is named.
    pub(super) fn after(&self) -> anyhow::Result<Option<After>> {
        let Some(KnotOf { plan, knot }) = &self.after else { return Ok(None) };
        let plan = Plan::read(plan)?;
        Ok(Some(After { plan, knot: *knot, held: None, again: self.again }))
    }

    /// What is to be planned.
    pub(super) fn job(
        &self,
        robot: &Robot,
        site: Site<'_>,
        after: Option<After>,
        bars: &Bars,
    ) -> anyhow::Result<Job> {
        job(self, robot, site, after, bars)
    }

    /// What is written, and where.
    pub(super) fn files(&self) -> Files<'_> {
        let [json, report] = [&self.json, &self.report].map(Option::as_deref);
        Files { out: &self.out, json, report }
    }

    /// Held joints that are given.
    pub(super) fn held(&self) -> Vec<(String, f64)> {
        held(self)
    }

    /// What is there, in the floor frame.
    pub(super) fn scene(&self, bars: &Bars) -> anyhow::Result<Scene> {
        Ok(self.seen(bars)?.0)
    }

    /// The same with the scans as they were read.
    pub(super) fn seen(&self, bars: &Bars) -> anyhow::Result<(Scene, Placed)> {
        bars.stage("scan", None);
        seen(&self.scene, self.demo, &self.scans, self.seed, bars)
    }

    /// Refuses before the work what cannot be written after it.
    pub(super) fn writable(&self) -> anyhow::Result<()> {
        let outs = [Some(&self.out), self.json.as_ref(), self.report.as_ref()];
        outs.into_iter().flatten().try_for_each(|out| writable(out))
    }

    /// Whether they say where the plan begins or where the robot stands.
    pub(super) fn is_placed(&self) -> bool {
        let stands = !matches!(self.base, Base::Auto) || self.torso.is_some();
        self.after.is_some() || self.start.is_some() || !self.held.is_empty() || stands
    }
}

impl Made {
    /// The page that shows it.
    pub(super) fn page(&self) -> anyhow::Result<ReportData> {
        let (outcome, figures) = (&self.outcome, &self.outcome.figures);
        let edges = outcome.graph.edges.iter();
        picture(Sitter {
            plans: std::slice::from_ref(&outcome.plan),
            robot: &self.robot,
            arm: &outcome.arm,
            collision: &self.collision,
            scene: Some(&self.scene),
            verification: Some(&figures.verification),
            flights: &[],
            tables: vec![figures_table(figures)],
            lines: vec![report::LineSet {
                name: "graph".into(),
                lines: edges.map(|e| e.line.iter().map(|s| s.point).collect()).collect(),
                shown: false,
            }],
        })
    }
}

/// Writes what was asked for and prints the table.
pub(super) fn finish(args: &PlanArgs, made: &Made) -> anyhow::Result<u8> {
    let figures = &made.outcome.figures;
    let violations = &figures.verification.violations;
    // The plan first: it is there whatever becomes of the rest.
    let code = write_unless_broken(&made.outcome.plan, violations, &args.out)?;
    if let Some(path) = &args.report {
        report::write(path, &made.page()?)?;
    }
    if let Some(path) = &args.json {
        write_json(figures, path)?;
    }
    let to_stdout = args.json.as_deref() == Some(Path::new("-"));
    if !to_stdout {
        say!("{}", table(figures));
    }
    if code == OK && !to_stdout {
        say!("plan: {}", args.out.display());
        if let Some(path) = &args.report {
            say!("report: {}", path.display());
        }
    }
    Ok(code)
}

fn job(
    args: &PlanArgs,
    robot: &Robot,
    site: Site<'_>,
    after: Option<After>,
    bars: &Bars,
) -> anyhow::Result<Job> {
    let arm = robot.arm(&args.robot.spec())?;
    let posture = |posture: &PostureArg, flag: &'static str| {
        posture.resolve(&arm, &args.robot, site, bars).context(flag)
    };
    let tool = args.tool.as_deref().map_or(Ok(Tool::default()), tool_file)?;
    let stance = match (&after, args.base) {
        (Some(after), _) => StanceChoice::Given(Stance {
            base: after.plan.base,
            height: after.plan.base_height,
            held: crate::numbers::moved(&after.plan.held, &arm),
        }),
        (None, Base::At(place)) => {
            place.tell(bars);
            StanceChoice::Given(place.stance(held(args)))
        }
        (None, Base::Auto) => {
            let mut search =
                StanceSearch { held: held(args), ..StanceSearch::of(robot, &arm, &tool) };
            if let Some((lift, _)) = search.lift.clone() {
                if search.held.iter().any(|(name, _)| *name == lift) {
                    search.lift = None;
                } else {
                    bars.note(&format!(
                        "{lift} is chosen with the base, and is to be moved there before the plan \
                         runs: --held {lift}=VALUE says where it stands"
                    ));
                }
            }
            if arm.has_numeric_ik() {
                bars.note(
                    "the arm has no closed inverse kinematics that is known: to search for its \
                     stance takes many minutes; --base x,y,yaw says where it stands",
                );
            }
            StanceChoice::Search(search)
        }
    };
    Ok(Job {
        arm: args.robot.spec(),
        stance,
        start: args.start.as_ref().map(|start| posture(start, "--start")).transpose()?,
        end: match &args.end {
            EndArg::Lifted => End::Lifted,
            EndArg::Contact => End::Contact,
            EndArg::Start => End::Start,
            EndArg::At(end) => End::At(posture(end, "--end")?),
        },
        after,
        spared: Vec::new(),
        method: MethodArg::suiting(args.method, &tool),
        cost: args.cost.into(),
        ik_samples: args.ik_samples as usize,
        v_max: args.v_max,
        profile: args.profile.into(),
        jerk: args.jerk.as_ref().map(|jerk| jerk.of(&arm)).transpose()?,
        tool_speed: args.tool_speed.or(tool.own_speed()),
        smooth: args.smooth.with(args.profile.into()),
        patches: match args.patch_radius {
            Some(epsilon) => PatchConfig { epsilon, ..sizes::patches(&tool) },
            None => sizes::patches(&tool),
        },
        graph: GraphConfig {
            neighbours: args.neighbours,
            radius: args.radius.unwrap_or(sizes::graph(&tool).radius),
            ..sizes::graph(&tool)
        },
        formulation: FormulationConfig {
            beta: args.beta,
            trials_per_cluster: args.trials,
            ..FormulationConfig::default()
        },
        refinements: args.refinements,
        collision: args.robot.collision(),
        seed: args.seed,
        tool,
    })
}

fn held(args: &PlanArgs) -> Vec<(String, f64)> {
    crate::numbers::held(&args.held, args.torso)
}
