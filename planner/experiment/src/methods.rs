//! The three methods in the paper's model: a motion is the straight line between two joint
//! vectors, and nothing is checked between them.

use std::time::Instant;

use nullsweep_planner::cost::{Cost, Effort, TaskTime};
use nullsweep_planner::plan::{CostKind, Method};
use nullsweep_planner::tour::formulation::{self, FormulationConfig, FormulationError, JUMP, Stop};
use nullsweep_planner::tour::joint::{self, Cluster, JointConfig, Layers, Metric, Problem};
use nullsweep_planner::workcell::Sample;
use nullsweep_robot::JointVector;
use rayon::prelude::*;
use rustix::time::{ClockId, clock_gettime};
use serde::{Deserialize, Serialize};

use crate::setting::Setting;

/// The velocity of every joint (§V). \[rad/s\]
pub const V_MAX: f64 = 2.0;

/// What is asked of a method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Task {
    /// Which one.
    pub method: Method,
    /// What is minimised.
    pub cost: CostKind,
    /// Samples of the inverse kinematics at each pose.
    pub samples: usize,
    /// Weights and the order's search.
    pub formulation: FormulationConfig,
    /// The search of the Joint-GTSP.
    pub joint: JointConfig,
    /// Seed of the searches.
    pub seed: u64,
}

/// The figures of a run, over the motions between the poses of the tour: the way from the start
/// posture to the first is left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PathFigures {
    /// Euclidean distance from patch to patch. \[m\]
    pub distance_m: f64,
    /// Sum of all joint displacements (Eq. 1). \[rad\]
    pub effort_rad: f64,
    /// Sum of the slowest joints' times (Eq. 2). \[s\]
    pub task_time_s: f64,
    /// Time from the graph to the joint path. \[s\]
    pub calculation_s: f64,
    /// Processor time of all threads in it: what the machine's other work does not change. \[s\]
    pub processor_s: f64,
    /// Motions between patches that no edge joins.
    pub jumps: usize,
    /// Samples among which the method chose.
    pub samples: usize,
    /// Bytes of samples, labels and stored costs; 0 but for the Joint-GTSP.
    pub bytes: usize,
}

/// A coverage path.
#[derive(Clone, Debug)]
pub struct MethodRun {
    /// Poses with their joint vectors, in visiting order.
    pub path: Vec<(Stop, JointVector)>,
    /// Its figures.
    pub figures: PathFigures,
}

/// Plans the task.
///
/// # Errors
/// A cost that is not a number.
pub fn plan(setting: &Setting, task: &Task) -> Result<MethodRun, FormulationError> {
    match task.cost {
        CostKind::Effort => by_cost(setting, task, &Effort),
        CostKind::Time => by_cost(setting, task, &time(setting)),
    }
}

fn time(setting: &Setting) -> TaskTime {
    let mut velocity = JointVector::ZERO;
    velocity[..setting.arm.dof()].fill(V_MAX);
    TaskTime::new(&velocity)
}

/// [`plan`] for any cost.
///
/// # Errors
/// A cost that is not a number.
pub fn by_cost<C: Cost>(
    setting: &Setting,
    task: &Task,
    cost: &C,
) -> Result<MethodRun, FormulationError> {
    let (begin, processor) = (Instant::now(), processor_time());
    let metric = Metric::new(cost, setting.arm.continuous(), setting.arm.dof(), 0.0);
    let graph = &setting.graph;
    let (patches, tool, here) = (&setting.patches, &setting.tool, setting.tool_pose());
    let config = FormulationConfig { from_nearest: true, ..task.formulation };
    let mut bytes = 0;
    let (stops, clusters): (Vec<Stop>, Vec<Cluster>) = match task.method {
        Method::Tsp | Method::Curvature => {
            let order = match task.method {
                Method::Tsp => formulation::shortest,
                _ => formulation::smoothest,
            };
            let stops = order(graph, patches, tool, &here, &config, task.seed)?;
            let clusters =
                stops.par_iter().map(|stop| cluster(setting, &[*stop], task.samples)).collect();
            (stops, clusters)
        }
        Method::Raster => return Err(FormulationError::NoOrder),
        Method::Joint => {
            let clusters: Vec<Cluster> = (0..patches.len())
                .into_par_iter()
                .map(|patch| match setting.reached[patch] {
                    None => Cluster::new(Vec::new()),
                    Some(_) => {
                        let stops = formulation::incident_stops(graph, patch, &setting.tool);
                        cluster(setting, &stops, task.samples)
                    }
                })
                .collect();
            let mut source = Some(setting.start);
            let stops =
                formulation::over_components(graph, patches, tool, &here, |members, here| {
                    let own: Vec<Cluster> = members.iter().map(|&p| clusters[p].clone()).collect();
                    let problem = Problem {
                        metric: &metric,
                        clusters: &own,
                        adjacent: &joint::adjacent(graph, members),
                        jump: JUMP,
                        jump_extra: 0.0,
                        source: source.take(),
                        first: formulation::nearest(patches, members, here),
                    };
                    let tour = joint::solve(&problem, &task.joint, task.seed)?;
                    bytes = bytes.max(tour.bytes);
                    let stops = tour.order.iter().zip(&tour.choice).map(|(&c, &k)| Stop {
                        patch: members[c],
                        heading: own[c].samples()[k].heading,
                    });
                    Ok::<_, FormulationError>(stops.collect())
                })?;
            let visited = stops.iter().map(|s: &Stop| clusters[s.patch].clone()).collect();
            (stops, visited)
        }
    };
    let layers = Layers {
        metric: &metric,
        extra: vec![0.0; clusters.len()],
        clusters: clusters.iter().collect(),
        source: Some(Cluster::at(setting.start)),
    };
    let (choice, _) = layers.cheapest(&layers.forward());
    let chosen: Vec<Sample> =
        clusters.iter().zip(choice).map(|(cluster, k)| cluster.samples()[k]).collect();
    let path: Vec<(Stop, JointVector)> = stops
        .iter()
        .zip(&chosen)
        .map(|(stop, sample)| (Stop { heading: sample.heading, ..*stop }, sample.q))
        .collect();
    let calculation_s = begin.elapsed().as_secs_f64();
    let processor_s = processor_time() - processor;
    let samples = clusters.iter().map(|c| c.samples().len()).sum();
    let figures =
        PathFigures { calculation_s, processor_s, samples, bytes, ..measure(setting, &path) };
    Ok(MethodRun { path, figures })
}

/// What this process has used. \[s\]
fn processor_time() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

/// The figures of a path that lie in it alone.
fn measure(setting: &Setting, path: &[(Stop, JointVector)]) -> PathFigures {
    let (continuous, time) = (setting.arm.continuous(), time(setting));
    let mut figures = PathFigures::default();
    for pair in path.windows(2) {
        let [(a, p), (b, q)] = [pair[0], pair[1]];
        let moved = continuous.displacement(&p, &q);
        figures.effort_rad += Effort.of(&moved);
        figures.task_time_s += time.of(&moved);
        figures.distance_m +=
            (setting.patches[b.patch].centre - setting.patches[a.patch].centre).norm();
        figures.jumps += usize::from(setting.graph.between(a.patch, b.patch).is_none());
    }
    figures
}

/// Every sample at some stops of one patch.
fn cluster(setting: &Setting, stops: &[Stop], count: usize) -> Cluster {
    let mut samples = Vec::new();
    for stop in stops {
        setting.samples(stop, count, &mut samples);
    }
    Cluster::new(samples)
}
