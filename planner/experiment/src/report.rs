//! Runs an experiment and holds what came of it.

use nalgebra::Point3;
use nullsweep_collision::{Options, ToolContact, World};
use nullsweep_planner::pipeline::{self, Job, PipelineError, StanceChoice};
use nullsweep_planner::plan::{CostKind, Method};
use nullsweep_planner::progress::{Progress, Silent};
use nullsweep_planner::tour::formulation::{FormulationConfig, FormulationError};
use nullsweep_planner::tour::joint::JointConfig;
use nullsweep_planner::workcell::{Scene, Stance};
use nullsweep_robot::Robot;
use serde::{Deserialize, Serialize};

use crate::methods::{MethodRun, PathFigures, Task, V_MAX, plan};
use crate::setting::Setting;
use crate::{Object, Published, Quantity, paper};

/// What is repeated how often.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Which of the paper's objects it is, so that its figures stand beside ours.
    pub object: Option<Object>,
    /// Heading.
    pub title: String,
    /// Numbers of samples.
    pub samples: Vec<usize>,
    /// Runs of each cell, with seeds from `seed` on.
    pub repeats: usize,
    /// Seed of the first run.
    pub seed: u64,
    /// Weights and the order's search.
    pub formulation: FormulationConfig,
    /// The search of the Joint-GTSP.
    pub joint: JointConfig,
}

/// An experiment's figures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Heading.
    pub title: String,
    /// Which of the paper's objects it is.
    pub object: Option<Object>,
    /// Whether a heading and its opposite are the same contact.
    pub symmetric: bool,
    /// Seed of the first run.
    pub seed: u64,
    /// Runs of each cell.
    pub repeats: usize,
    /// Numbers of samples.
    pub samples: Vec<usize>,
    /// Where all methods planned.
    pub setting: SettingFigures,
    /// Cells of the paper.
    pub cells: Vec<Cell>,
    /// What the straight model leaves out.
    pub straight: Option<Straight>,
    /// Runs in the tracked model.
    pub tracked: Vec<Tracked>,
    /// The most memory that the process held, where that is known.
    pub peak_memory_bytes: Option<u64>,
}

/// Size of the setting.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SettingFigures {
    /// Scanned points.
    pub points: usize,
    /// Patches.
    pub patches: usize,
    /// Patches with inverse kinematics solutions inside the limits.
    pub reached: usize,
    /// Edges of the graph.
    pub edges: usize,
    /// Patches of each connected component.
    pub components: Vec<usize>,
    /// x, y \[m\] and yaw \[rad\] of the robot's root frame in the floor frame.
    pub base: [f64; 3],
}

/// A cell of the paper: every run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// What was minimised.
    pub optimised: CostKind,
    /// Samples of the inverse kinematics at each pose.
    pub samples: usize,
    /// Method.
    pub method: Method,
    /// Its runs.
    pub runs: Vec<PathFigures>,
}

/// A path of the straight model looked at between its poses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Straight {
    /// How far the pad's centre leaves the scanned surface: median, 95th percentile, largest. \[m\]
    pub off_surface_m: [f64; 3],
    /// Motions between patches that an edge joins.
    pub motions: usize,
    /// Those that are not free of collision.
    pub colliding_motions: usize,
    /// Poses.
    pub poses: usize,
    /// Those that are not free of collision.
    pub colliding_poses: usize,
}

/// A plan in the tracked model.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tracked {
    /// What was minimised.
    pub optimised: CostKind,
    /// Samples of the inverse kinematics at each pose.
    pub samples: usize,
    /// Method.
    pub method: Method,
    /// Which run.
    pub repeat: usize,
    /// Patches that are reached without collision.
    pub reachable: usize,
    /// Sum of all joint displacements. \[rad\]
    pub effort_rad: f64,
    /// Duration. \[s\]
    pub task_time_s: f64,
    /// Way of the pad on the surface. \[m\]
    pub distance_m: f64,
    /// Motions through free space.
    pub jumps: usize,
    /// Reachable patches that no motion was found to.
    pub dropped: usize,
    /// Share of the reachable patches' points that are swept.
    pub coverage_reachable: f64,
    /// Share of all points that are swept.
    pub coverage_all: f64,
    /// Farthest that the pad leaves the planned line. \[m\]
    pub line_deviation_max_m: f64,
    /// 95th percentile of the pad's distance from the scan. \[m\]
    pub scan_distance_p95_m: f64,
    /// Rules broken.
    pub violations: usize,
    /// Time from the graph to the joint path. \[s\]
    pub calculation_s: f64,
}

/// The methods in the order of the paper's columns.
pub const METHODS: [Method; 3] = [Method::Tsp, Method::Curvature, Method::Joint];

impl Report {
    /// Mean and standard deviation of a cell.
    #[must_use]
    pub fn statistic(
        &self,
        optimised: CostKind,
        samples: usize,
        method: Method,
        quantity: Quantity,
    ) -> Option<Published> {
        let cell = self
            .cells
            .iter()
            .find(|c| c.optimised == optimised && c.samples == samples && c.method == method)?;
        let values = cell.runs.iter().map(|run| match quantity {
            Quantity::Distance => run.distance_m,
            Quantity::Effort => run.effort_rad,
            Quantity::Time => run.task_time_s,
            Quantity::Calculation => run.calculation_s,
            Quantity::Processor => run.processor_s,
        });
        Some(paper::statistic(values))
    }
}

/// Runs everything in the paper's model: the report and, for each method, the first run with the
/// most samples optimised for task time.
///
/// # Errors
/// A cost that is not a number.
pub fn run(
    setting: &Setting,
    plan_of: &Plan,
    progress: &dyn Progress,
) -> Result<(Report, Vec<(Method, MethodRun)>), FormulationError> {
    let most = plan_of.samples.iter().copied().max().unwrap_or(1);
    let mut cells = Vec::new();
    let mut shown = Vec::new();
    progress.stage("experiment", Some(2 * plan_of.samples.len() * 3 * plan_of.repeats));
    for optimised in [CostKind::Time, CostKind::Effort] {
        for &samples in &plan_of.samples {
            for method in METHODS {
                let mut runs = Vec::new();
                for repeat in 0..plan_of.repeats {
                    let task = Task {
                        method,
                        cost: optimised,
                        samples,
                        formulation: plan_of.formulation,
                        joint: plan_of.joint,
                        seed: plan_of.seed + repeat as u64,
                    };
                    let run = plan(setting, &task)?;
                    progress.tick();
                    runs.push(run.figures);
                    if repeat == 0 && samples == most && optimised == CostKind::Time {
                        shown.push((method, run));
                    }
                }
                cells.push(Cell { optimised, samples, method, runs });
            }
        }
    }
    let report = Report {
        title: plan_of.title.clone(),
        object: plan_of.object,
        symmetric: setting.tool.symmetric,
        seed: plan_of.seed,
        repeats: plan_of.repeats,
        samples: plan_of.samples.clone(),
        setting: SettingFigures {
            points: setting.scan.points.len(),
            patches: setting.patches.len(),
            reached: setting.reached.iter().flatten().count(),
            edges: setting.graph.edges.len(),
            components: setting.graph.components.iter().map(Vec::len).collect(),
            base: setting.stance.base,
        },
        cells,
        straight: None,
        tracked: Vec::new(),
        peak_memory_bytes: None,
    };
    Ok((report, shown))
}

/// Steps in which a straight motion is looked at.
const STEPS: usize = 10;

/// Looks at the motions of a path, in the world that the setting leaves out.
///
/// # Errors
/// When the collision world cannot be made.
pub fn look_between(
    setting: &Setting,
    robot: &Robot,
    run: &MethodRun,
) -> Result<Straight, PipelineError> {
    let world = World::new(
        robot,
        &setting.arm,
        &setting.tool,
        &setting.scan.points,
        &[],
        &Options::default(),
    )?;
    let tool = setting.tool.on(&setting.arm);
    let continuous = setting.arm.continuous();
    let free = |run: &MethodRun, k: usize| world.is_free(&run.path[k].1, ToolContact::Allowed);
    let mut straight = Straight { poses: run.path.len(), ..Straight::default() };
    straight.colliding_poses = (0..run.path.len()).filter(|&k| !free(run, k)).count();
    let mut off = Vec::new();
    for pair in run.path.windows(2) {
        let [(a, p), (b, q)] = [pair[0], pair[1]];
        if setting.graph.between(a.patch, b.patch).is_none() {
            continue;
        }
        straight.motions += 1;
        // Continuous joints the short way round.
        let q = continuous.nearest_turn(&q, &p);
        straight.colliding_motions += usize::from(!world.motion_free(&p, &q, ToolContact::Allowed));
        for k in 1..STEPS {
            let t = k as f64 / STEPS as f64;
            let between = p.lerp(&q, t);
            off.push(off_surface(setting, &tool.centre(&between)));
        }
    }
    off.sort_by(f64::total_cmp);
    if let Some(last) = off.len().checked_sub(1) {
        straight.off_surface_m = [0.5, 0.95, 1.0].map(|share| off[(share * last as f64) as usize]);
    }
    Ok(straight)
}

/// How far the pad's centre is from the surface, less the stand-off where the tool has one. \[m\]
fn off_surface(setting: &Setting, pad: &Point3<f64>) -> f64 {
    let mut distance = setting.bed.surface().distance(pad);
    if distance.is_infinite() {
        // So far off, the nearest point will do.
        let points = setting.scan.points.iter();
        distance = points.map(|p| nalgebra::distance(p, pad)).fold(f64::INFINITY, f64::min);
    }
    (distance - setting.tool.stand_off.max(0.0)).abs()
}

/// Plans in the tracked model with all methods and costs. `job` says all but these; the stance that
/// its search finds first serves all.
///
/// # Errors
/// Those of the pipeline.
pub fn tracked(
    robot: &Robot,
    scene: &Scene,
    job: &Job,
    repeats: usize,
    progress: &dyn Progress,
) -> Result<Vec<Tracked>, PipelineError> {
    let mut job = job.clone();
    job.v_max = Some(V_MAX);
    let mut rows = Vec::new();
    progress.stage("tracked", Some(2 * 3 * repeats));
    for optimised in [CostKind::Time, CostKind::Effort] {
        for method in METHODS {
            for repeat in 0..repeats {
                let job_of = Job {
                    method: Some(method),
                    cost: optimised,
                    seed: job.seed + repeat as u64,
                    ..job.clone()
                };
                let outcome = pipeline::run(robot, scene, &job_of, &Silent)?;
                progress.tick();
                let f = &outcome.figures;
                let held = f.held.iter().map(|(name, &value)| (name.clone(), value)).collect();
                job.stance = StanceChoice::Given(Stance { base: f.base, height: 0.0, held });
                let spent = |stage: &str| f.calc_time_s.get(stage).copied().unwrap_or(0.0);
                rows.push(Tracked {
                    optimised,
                    samples: job.ik_samples,
                    method,
                    repeat,
                    reachable: f.reachable,
                    effort_rad: f.effort_rad,
                    task_time_s: f.task_time_s,
                    distance_m: f.distance_m,
                    jumps: f.jumps,
                    dropped: f.dropped_patches,
                    coverage_reachable: f.verification.coverage_reachable,
                    coverage_all: f.verification.coverage_all,
                    line_deviation_max_m: f.verification.line_deviation_max_m,
                    scan_distance_p95_m: f.verification.scan_distance_p95_m,
                    violations: f.verification.violations.len(),
                    calculation_s: spent("gtsp") + spent("layered"),
                });
            }
        }
    }
    Ok(rows)
}
