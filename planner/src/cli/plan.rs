//! `planner plan`.

use std::path::PathBuf;
use std::str::FromStr;

use anyhow::{Context, ensure};
use clap::Args;
use comfy_table::{Table, presets::UTF8_FULL_CONDENSED};
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, UnitVector3, Vector3};
use nullsweep_robot::{JointVector, MAX_DOF};

use super::bars::Bars;
use super::picture::picture;
use super::robot::RobotArgs;
use super::{OK, VIOLATIONS, write_json};
use crate::collision::{Obstacle, ObstacleShape};
use crate::cost::CostKind;
use crate::formulation::{FormulationConfig, Method};
use crate::graph::GraphConfig;
use crate::patches::PatchConfig;
use crate::pipeline::{self, After, Figures, Job, Outcome, StanceChoice};
use crate::plan::Plan;
use crate::progress::Progress;
use crate::report;
use crate::scan::{self, CleanConfig, CropBox, PlacedScan, Placement, ReadOptions, Scan};
use crate::simulate;
use crate::stance::{Stance, StanceSearch};
use crate::timing::Profile;
use crate::tool::Tool;

#[derive(Debug, Args)]
pub(super) struct PlanArgs {
    /// Scan files: PCD, PLY, XYZ/CSV, STL or OBJ.
    #[arg(required_unless_present = "demo", conflicts_with = "demo")]
    scans: Vec<PathBuf>,
    /// Plan for a simulated scan instead.
    #[arg(long, value_enum)]
    demo: Option<Demo>,

    /// Pose of a scan's sensor in the floor frame: x,y,z,qx,qy,qz,qw; once for each scan.
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    sensor_pose: Vec<Numbers<7>>,
    /// Direction against gravity in the scans' frame: x,y,z.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, conflicts_with = "sensor_pose")]
    up: Option<Numbers<3>>,
    /// Height of the sensor above what the object stands on. [m]
    #[arg(long, value_name = "M", requires = "up")]
    sensor_height: Option<f64>,
    /// Height above the floor of what the object stands on; above 0 it becomes a table. [m]
    #[arg(long, value_name = "M", default_value_t = 0.0)]
    support_height: f64,
    /// Factor from the file's unit to metres: 0.001 for millimetres.
    #[arg(long, default_value_t = 1.0)]
    scale: f64,
    /// Keep only this box of the floor frame as the surface to sweep, the rest stays an obstacle:
    /// xmin,ymin,zmin,xmax,ymax,zmax.
    #[arg(long, value_name = "BOX", allow_hyphen_values = true)]
    crop: Option<CropBox>,

    #[command(flatten)]
    robot: RobotArgs,
    /// The tool, a TOML file; without it a sponge of 0.10 × 0.07 m.
    #[arg(long, value_name = "FILE")]
    tool: Option<PathBuf>,
    /// Where the robot stands in the floor frame: x,y,yaw, or `auto`: where it reaches most.
    #[arg(long, default_value = "auto", allow_hyphen_values = true)]
    base: Base,
    /// Height of the PR2's torso joint, with a given base. [m]
    #[arg(long, value_name = "M")]
    torso: Option<f64>,
    /// Position of another held joint: NAME=VALUE.
    #[arg(long, value_name = "NAME=VALUE", allow_hyphen_values = true)]
    held: Vec<HeldArg>,
    /// Where the arm starts: its joints, comma-separated; without it its home posture.
    #[arg(long, value_name = "Q1,Q2,…", allow_hyphen_values = true, value_delimiter = ',')]
    start: Vec<f64>,

    /// Go on from knot K of a plan, for the patches that it has not swept by then.
    #[arg(long = "continue", value_name = "PLAN@K")]
    after: Option<KnotOf>,
    /// With --continue: sweep everything again.
    #[arg(long, requires = "after")]
    again: bool,

    /// How the order is found.
    #[arg(long, value_enum, default_value = "curvature")]
    method: Method,
    /// What is minimised.
    #[arg(long, value_enum, default_value = "time")]
    cost: CostKind,
    /// Samples of the inverse kinematics at each tool pose.
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=1000))]
    ik_samples: u32,
    /// One velocity for all joints, where the robot's own limits are higher. [rad/s]
    #[arg(long)]
    v_max: Option<f64>,
    /// How fast the plan goes along its path: at bang-bang velocity, or as fast as velocity and
    /// acceleration allow, corners blended within the line's tolerance.
    #[arg(long, value_enum, default_value = "velocity")]
    profile: Profile,
    /// Radius of a patch's neighbourhood. [m]
    #[arg(long, default_value_t = PatchConfig::default().epsilon)]
    patch_radius: f64,
    /// Nearest neighbours of each patch that are tried as edges.
    #[arg(long, default_value_t = GraphConfig::default().neighbours)]
    neighbours: usize,
    /// Longest edge. [m]
    #[arg(long, default_value_t = GraphConfig::default().radius)]
    radius: f64,
    /// Weight of turning against distance in the Curvature-GTSP (Eq. 4).
    #[arg(long, default_value_t = FormulationConfig::default().beta)]
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
    /// Write a page with pictures of scan, graph, tool path and joints.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Demo {
    /// A kitchen chair.
    Chair,
    /// The chair's seat alone; the rest of it is an obstacle.
    ChairSeat,
    /// A ride-on toy car.
    BobbyCar,
}

/// N comma-separated finite numbers.
#[derive(Clone, Copy, Debug)]
struct Numbers<const N: usize>([f64; N]);

impl<const N: usize> FromStr for Numbers<N> {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let values: Vec<f64> = text
            .split(',')
            .map(|part| part.trim().parse::<f64>().map_err(|e| format!("`{part}`: {e}")))
            .collect::<Result<_, _>>()?;
        let numbers: [f64; N] =
            values.try_into().map_err(|v: Vec<f64>| format!("{} numbers, not {N}", v.len()))?;
        if numbers.iter().all(|v| v.is_finite()) {
            Ok(Self(numbers))
        } else {
            Err("the numbers must be finite".into())
        }
    }
}

#[derive(Clone, Copy, Debug)]
enum Base {
    Auto,
    At([f64; 3]),
}

impl FromStr for Base {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "auto" { Ok(Self::Auto) } else { Ok(Self::At(Numbers::from_str(text)?.0)) }
    }
}

#[derive(Clone, Debug)]
struct HeldArg(String, f64);

impl FromStr for HeldArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, value) = text.split_once('=').ok_or("NAME=VALUE is wanted")?;
        Ok(Self(name.into(), value.parse().map_err(|e| format!("`{value}`: {e}"))?))
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

pub(super) fn run(args: &PlanArgs) -> anyhow::Result<u8> {
    let after = match &args.after {
        None => None,
        Some(KnotOf { plan, knot }) => {
            let plan = Plan::read(plan)?;
            Some(After { plan, knot: *knot, held: None, again: args.again })
        }
    };
    Ok(make(args, after)?.0)
}

/// Makes a plan, writes what was asked for, and gives the exit code with it.
pub(super) fn make(args: &PlanArgs, after: Option<After>) -> anyhow::Result<(u8, Plan)> {
    let bars = Bars::new();
    let robot = args.robot.robot()?;
    bars.stage("scan", None);
    let scene = scene(args, &bars)?;
    let job = job(args, &scene, after)?;
    let outcome = pipeline::run(&robot, &scene.surface, &job, &bars);
    bars.clear();
    let outcome = outcome?;
    Ok((finish(args, &outcome)?, outcome.plan))
}

impl PlanArgs {
    /// Whether they say where the plan begins or where the robot stands.
    pub(super) fn is_placed(&self) -> bool {
        let stands = !matches!(self.base, Base::Auto) || self.torso.is_some();
        self.after.is_some() || !self.start.is_empty() || !self.held.is_empty() || stands
    }
}

/// Writes what was asked for and prints the table.
fn finish(args: &PlanArgs, outcome: &Outcome) -> anyhow::Result<u8> {
    let figures = &outcome.figures;
    if let Some(path) = &args.json {
        write_json(figures, path)?;
    }
    if let Some(path) = &args.report {
        report::write(path, &picture(outcome, figures_table(figures)))?;
    }
    let to_stdout = args.json.as_deref() == Some(std::path::Path::new("-"));
    if !to_stdout {
        println!("{}", table(figures));
    }
    let violations = &figures.verification.violations;
    if violations.is_empty() {
        outcome.plan.write(&args.out)?;
        if !to_stdout {
            println!("plan: {}", args.out.display());
            if let Some(path) = &args.report {
                println!("report: {}", path.display());
            }
        }
        return Ok(OK);
    }
    for v in violations.iter().take(10) {
        eprintln!("violation at knot {}: {:?}: {}", v.knot, v.kind, v.detail);
    }
    eprintln!("planner: the plan breaks {} rules and was not written", violations.len());
    Ok(VIOLATIONS)
}

/// The figures as name and value, for people.
fn rows(f: &Figures) -> Vec<[String; 2]> {
    let v = &f.verification;
    let mut rows = Vec::new();
    let mut row = |name: &str, value: String| rows.push([name.to_owned(), value]);
    row("points", f.points.to_string());
    row("patches, reachable", format!("{}, {}", f.patches, f.reachable));
    row("fill-in patches", f.fill_in_patches.to_string());
    row("edges, components", format!("{} of {}, {}", f.edges, f.edge_candidates, f.components));
    row("base x, y, yaw", format!("{:.3}, {:.3}, {:.3}", f.base[0], f.base[1], f.base[2]));
    for (name, position) in &f.held {
        row(name, format!("{position:.3}"));
    }
    row("effort", format!("{:.2} rad", f.effort_rad));
    row("task time", format!("{:.2} s", f.task_time_s));
    row("distance on the surface", format!("{:.2} m", f.distance_m));
    row("distance in transfers", format!("{:.2} m", f.transfer_m));
    row("jumps", f.jumps.to_string());
    row("dropped patches", f.dropped_patches.to_string());
    row("knots", f.knots.to_string());
    row("coverage of reachable points", format!("{:.4}", v.coverage_reachable));
    row("coverage of all points", format!("{:.4}", v.coverage_all));
    row("line deviation, max", format!("{:.3} mm", v.line_deviation_max_m * 1e3));
    let distance = (v.scan_distance_p95_m * 1e3, v.scan_distance_max_m * 1e3);
    row("distance to the scan, p95, max", format!("{:.2}, {:.2} mm", distance.0, distance.1));
    row("violations", v.violations.len().to_string());
    row("calculation", format!("{:.2} s", f.calc_time_total_s));
    for (stage, seconds) in &f.calc_time_s {
        row(&format!("  {stage}"), format!("{seconds:.2} s"));
    }
    rows
}

fn table(figures: &Figures) -> Table {
    let mut table = Table::new();
    table.load_style(UTF8_FULL_CONDENSED).set_header(["figure", "value"]);
    table.add_rows(rows(figures));
    table
}

fn figures_table(figures: &Figures) -> report::Table {
    report::Table {
        title: "Figures".into(),
        columns: vec!["figure".into(), "value".into()],
        rows: rows(figures).into_iter().map(Vec::from).collect(),
    }
}

/// The scan to sweep, and all else that is there, in the floor frame.
struct Scene {
    surface: Scan,
    surroundings: Vec<Point3<f64>>,
    obstacles: Vec<Obstacle>,
}

fn scene(args: &PlanArgs, bars: &Bars) -> anyhow::Result<Scene> {
    let (placed, region) = match args.demo {
        Some(demo) => simulated(demo, args.seed),
        None => (read_scans(args, bars)?, None),
    };
    let region = args.crop.or(region);
    let config = CleanConfig::default();
    let (surface, surroundings) = match region {
        None => (scan::clean(&placed, &config)?.0, Vec::new()),
        Some(region) => {
            let cut = scan::clean_region(&placed, &region, &config)?;
            (cut.surface, cut.surroundings)
        }
    };
    let mut obstacles = vec![Obstacle::floor(Isometry3::identity())];
    if args.support_height > 0.0 {
        obstacles.push(table_under(&surface, args.support_height));
    }
    Ok(Scene { surface, surroundings, obstacles })
}

fn simulated(demo: Demo, seed: u64) -> (PlacedScan, Option<CropBox>) {
    let (view, region) = match demo {
        Demo::Chair => (simulate::chair(seed), None),
        Demo::ChairSeat => (simulate::chair(seed), Some(simulate::chair_seat())),
        Demo::BobbyCar => (simulate::bobby_car(seed), None),
    };
    (scan::place(&view.scan, &Placement::SensorPose(view.sensor_pose)).0, region)
}

fn read_scans(args: &PlanArgs, bars: &Bars) -> anyhow::Result<PlacedScan> {
    ensure!(
        args.sensor_pose.is_empty() || args.sensor_pose.len() == args.scans.len(),
        "{} scans but {} sensor poses: give one --sensor-pose for each scan, in their order",
        args.scans.len(),
        args.sensor_pose.len()
    );
    let options = ReadOptions { scale: args.scale, seed: args.seed, ..ReadOptions::default() };
    let mut joined = PlacedScan::default();
    let mut shared: Option<Placement> = None;
    for (i, path) in args.scans.iter().enumerate() {
        let raw = scan::read(path, &options)?;
        for warning in &raw.warnings {
            bars.note(&format!("{}: {warning}", path.display()));
        }
        let placement = match (args.sensor_pose.get(i), &shared) {
            (Some(pose), _) => Placement::SensorPose(isometry(pose)?),
            // Further scans without a pose of their own share the first one's frame.
            (None, Some(frame)) => frame.clone(),
            (None, None) => upright(args)?,
        };
        let (placed, pose) = scan::place(&raw, &placement);
        let sensor = placed.views[0].sensor;
        shared.get_or_insert(Placement::Frame { pose, sensor });
        joined.join(placed);
    }
    Ok(joined)
}

fn upright(args: &PlanArgs) -> anyhow::Result<Placement> {
    let up = match args.up {
        None => Vector3::z_axis(),
        Some(Numbers(v)) => UnitVector3::try_new(Vector3::from(v), 1e-6)
            .context("--up must not be the zero vector")?,
    };
    Ok(match args.sensor_height {
        Some(sensor_height) => {
            Placement::UpAndHeight { up, sensor_height, support_height: args.support_height }
        }
        None => Placement::Up { up, support_height: args.support_height },
    })
}

fn isometry(&Numbers([x, y, z, qx, qy, qz, qw]): &Numbers<7>) -> anyhow::Result<Isometry3<f64>> {
    let rotation = UnitQuaternion::try_new(Quaternion::new(qw, qx, qy, qz), 1e-6)
        .context("--sensor-pose: the quaternion must not be zero")?;
    Ok(Isometry3::from_parts(Translation3::new(x, y, z), rotation))
}

/// How far a table top reaches beyond the object. [m]
const TABLE_RIM: f64 = 0.10;
/// Thickness of a table top. [m]
const TABLE_TOP: f64 = 0.03;

/// A table top under the scan.
fn table_under(scan: &Scan, height: f64) -> Obstacle {
    let mut low = Point3::new(f64::INFINITY, f64::INFINITY, height - TABLE_TOP);
    let mut high = Point3::new(f64::NEG_INFINITY, f64::NEG_INFINITY, height);
    for p in &scan.points {
        for axis in 0..2 {
            low[axis] = low[axis].min(p[axis] - TABLE_RIM);
            high[axis] = high[axis].max(p[axis] + TABLE_RIM);
        }
    }
    Obstacle {
        name: "table".into(),
        shape: ObstacleShape::Box { half_extents: (high - low) * 0.5 },
        pose: Isometry3::from(nalgebra::center(&low, &high).coords),
        carries_robot: false,
    }
}

fn job(args: &PlanArgs, scene: &Scene, after: Option<After>) -> anyhow::Result<Job> {
    let tool = match &args.tool {
        None => Tool::default(),
        Some(path) => {
            let text = std::fs::read_to_string(path)
                .with_context(|| format!("cannot read {}", path.display()))?;
            toml::from_str(&text).with_context(|| format!("{}: not a tool", path.display()))?
        }
    };
    let stance = match (&after, args.base) {
        (Some(after), _) => StanceChoice::Given(Stance {
            base: after.plan.base,
            held: after.plan.held.iter().map(|h| (h.name.clone(), h.position)).collect(),
        }),
        (None, Base::At(base)) => StanceChoice::Given(Stance { base, held: held(args) }),
        (None, Base::Auto) => {
            let mut search = StanceSearch { held: held(args), ..StanceSearch::default() };
            if args.torso.is_some() {
                search.lift = None;
            }
            StanceChoice::Search(search)
        }
    };
    ensure!(args.start.len() <= MAX_DOF, "--start has more than {MAX_DOF} joints");
    let mut start: JointVector = [0.0; MAX_DOF];
    start[..args.start.len()].copy_from_slice(&args.start);
    Ok(Job {
        arm: args.robot.spec()?,
        tool,
        stance,
        surroundings: scene.surroundings.clone(),
        obstacles: scene.obstacles.clone(),
        start: (!args.start.is_empty()).then_some(start),
        after,
        method: args.method,
        cost: args.cost,
        ik_samples: args.ik_samples as usize,
        v_max: args.v_max,
        profile: args.profile,
        patches: PatchConfig { epsilon: args.patch_radius, ..PatchConfig::default() },
        graph: GraphConfig {
            neighbours: args.neighbours,
            radius: args.radius,
            ..GraphConfig::default()
        },
        formulation: FormulationConfig { beta: args.beta, trials_per_cluster: args.trials },
        refinements: args.refinements,
        collision: args.robot.collision(),
        seed: args.seed,
    })
}

fn held(args: &PlanArgs) -> Vec<(String, f64)> {
    let torso = args.torso.map(|height| ("torso_lift_joint".to_owned(), height));
    torso.into_iter().chain(args.held.iter().map(|h| (h.0.clone(), h.1))).collect()
}
