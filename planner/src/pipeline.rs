//! The whole way from a scan to a verified plan, on one page.

use std::collections::BTreeMap;
use std::time::Instant;

use nalgebra::{Isometry3, Point3};
use nullsweep_robot::{Arm, ArmError, ArmSpec, JointVector, MAX_DOF, Robot};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::collision::{self, CollisionError, Obstacle, ToolContact, World};
use crate::cost::{self, Cost, CostKind, Effort, TaskTime};
use crate::coverage;
use crate::formulation::{self, FormulationConfig, FormulationError, Method, Stop};
use crate::graph::{self, Graph, GraphConfig};
use crate::layered;
use crate::motion::{Leg, Mover};
use crate::patches::{self, Patch, PatchConfig};
use crate::plan::{Continues, FORMAT, Held, Plan, PlanKnot, SurfaceSample};
use crate::progress::Progress;
use crate::reach::{Sample, Workcell, reach, redundancies};
use crate::scan::Scan;
use crate::stance::{self, Stance, StanceSearch};
use crate::surface::Surface;
use crate::timing;
use crate::tool::Tool;
use crate::verify::{self, Verification};

/// What is to be planned.
#[derive(Clone, Debug)]
pub struct Job {
    /// Base and tip link of the arm.
    pub arm: ArmSpec,
    /// The tool at its tip.
    pub tool: Tool,
    /// Where the robot stands.
    pub stance: StanceChoice,
    /// Points that were scanned but are not to be swept, in the floor frame. [m]
    pub surroundings: Vec<Point3<f64>>,
    /// Solid things besides the scan, posed in the floor frame.
    pub obstacles: Vec<Obstacle>,
    /// Where the arm is; `None`: its home posture. [rad] or [m]
    pub start: Option<JointVector>,
    /// A plan that this one goes on from.
    pub after: Option<After>,
    /// How the order is found.
    pub method: Method,
    /// What is minimised.
    pub cost: CostKind,
    /// Samples of the inverse kinematics at each tool pose, 1…
    pub ik_samples: usize,
    /// One velocity for all joints; `None`: the robot's limits. [rad/s]
    pub v_max: Option<f64>,
    /// Patch extraction.
    pub patches: PatchConfig,
    /// Graph construction.
    pub graph: GraphConfig,
    /// Formulation.
    pub formulation: FormulationConfig,
    /// Collision margins and meshes.
    pub collision: collision::Options,
    /// Seed of every random choice.
    pub seed: u64,
}

/// Where the robot stands.
#[derive(Clone, Debug, PartialEq)]
pub enum StanceChoice {
    /// Here.
    Given(Stance),
    /// Where it reaches most.
    Search(StanceSearch),
}

/// The plan and the knot that a new plan goes on from.
#[derive(Clone, Debug, PartialEq)]
pub struct After {
    /// The other plan.
    pub plan: Plan,
    /// The new plan's start.
    pub knot: usize,
    /// Whether patches that the other plan has swept by then are swept again.
    pub again: bool,
}

/// Every figure of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    /// Scanned points.
    pub points: usize,
    /// Patches.
    pub patches: usize,
    /// Patches that the arm reaches.
    pub reachable: usize,
    /// Pairs of neighbouring patches.
    pub edge_candidates: usize,
    /// Edges of the graph.
    pub edges: usize,
    /// Connected components of the graph.
    pub components: usize,
    /// x, y [m] and yaw [rad] of the robot's root frame in the floor frame.
    pub base: [f64; 3],
    /// Held joints that the stance sets. [rad] or [m]
    pub held: BTreeMap<String, f64>,
    /// Samples of the inverse kinematics that the layered graph had.
    pub ik_samples_total: usize,
    /// Sum of all joint displacements. [rad]
    pub effort_rad: f64,
    /// Duration of the plan. [s]
    pub task_time_s: f64,
    /// Way of the pad on the surface. [m]
    pub distance_m: f64,
    /// Way of the pad through free space. [m]
    pub transfer_m: f64,
    /// Seconds that each stage took.
    pub calc_time_s: BTreeMap<String, f64>,
    /// Seconds that all took.
    pub calc_time_total_s: f64,
    /// Knots of the plan.
    pub knots: usize,
    /// Motions through free space.
    pub jumps: usize,
    /// Reachable patches that no motion was found to.
    pub dropped_patches: usize,
    /// What the finished plan's check found.
    #[serde(flatten)]
    pub verification: Verification,
    /// Seed.
    pub seed: u64,
}

/// A plan with all that led to it, in the root frame.
pub struct Outcome {
    /// The plan. It may be published if `figures.verification.violations` is empty.
    pub plan: Plan,
    /// What it is like.
    pub figures: Figures,
    /// The arm in its stance.
    pub arm: Arm,
    /// The scan.
    pub scan: Scan,
    /// The patches.
    pub patches: Vec<Patch>,
    /// Which patches are reached.
    pub reached: Vec<bool>,
    /// The graph.
    pub graph: Graph,
}

/// Why there is no plan.
#[derive(Debug, thiserror::Error)]
pub enum PipelineError {
    /// The arm cannot be made from the robot.
    #[error(transparent)]
    Arm(#[from] ArmError),
    /// No order was found.
    #[error(transparent)]
    Formulation(#[from] FormulationError),
    /// The collision world cannot be made.
    #[error(transparent)]
    Collision(#[from] CollisionError),
    /// No patch was found.
    #[error(
        "no locally planar patch among {points} points: is the scale metres? try a larger patch (--patch-radius)"
    )]
    NoPatches {
        /// How many points.
        points: usize,
    },
    /// No stance reaches anything.
    #[error(
        "no stance of {tried} reaches any of the {patches} patches: is the object within the arm's height? try --torso or --base x,y,yaw"
    )]
    NoStance {
        /// Stances tried with an exact look.
        tried: usize,
        /// How many patches.
        patches: usize,
    },
    /// The body collides where it stands.
    #[error("the robot collides where it stands: {hit}; choose another --base")]
    StanceHit {
        /// With what.
        hit: String,
    },
    /// The arm collides where it starts.
    #[error("the arm collides in its start posture: {hit}; give another --start")]
    StartHit {
        /// With what.
        hit: String,
    },
    /// The start is outside the limits.
    #[error(
        "the start posture leaves the margined soft limits: {joint} at {value:.4}, limits {low:.4} … {high:.4}"
    )]
    StartLimit {
        /// Which joint.
        joint: String,
        /// Where it is.
        value: f64,
        /// Its lower bound.
        low: f64,
        /// Its upper bound.
        high: f64,
    },
    /// No patch can be reached.
    #[error("none of the {patches} patches can be reached from base {base:?}: try --base auto")]
    NothingReached {
        /// How many patches.
        patches: usize,
        /// The stance.
        base: [f64; 3],
    },
    /// No motion to any patch was found.
    #[error(
        "no motion from the start posture to any of the {reachable} reachable patches was found; give another --start"
    )]
    NoMotion {
        /// How many patches are reachable.
        reachable: usize,
    },
    /// The knot to go on from does not exist.
    #[error("the plan to continue has {knots} knots, there is no knot {knot}")]
    NoSuchKnot {
        /// How many knots.
        knots: usize,
        /// Which was asked for.
        knot: usize,
    },
}

/// Plans the job for a cleaned scan in the floor frame.
///
/// # Errors
/// See [`PipelineError`]. A plan that breaks a rule is no error: it comes with its violations.
pub fn run(
    robot: &Robot,
    scan: &Scan,
    job: &Job,
    progress: &dyn Progress,
) -> Result<Outcome, PipelineError> {
    let mut clock = Clock::default();
    let free_arm = robot.arm(&job.arm)?;
    progress.stage("patches", None);
    let patches = clock.time("patches", || patches::find(scan, &job.patches, job.seed));
    if patches.is_empty() {
        return Err(PipelineError::NoPatches { points: scan.points.len() });
    }

    progress.stage("stance", None);
    let setting = clock.time("stance", || settle(robot, &free_arm, scan, &patches, job))?;
    let Setting { stance, arm, scan, patches, world } = setting;
    let start = start(job, &arm, &world)?;
    let cell = Workcell { arm: &arm, tool: &job.tool, world: &world };

    let already = job.after.as_ref().map_or_else(
        || Ok(vec![false; scan.points.len()]),
        |after| swept_before(after, &arm, &scan),
    )?;
    progress.stage("reach", Some(patches.len()));
    let mut reached =
        clock.time("reach", || reach(cell, &patches, job.ik_samples, &|| progress.tick()));
    let reachable: Vec<bool> = reached.iter().map(Option::is_some).collect();
    if !reachable.contains(&true) {
        return Err(PipelineError::NothingReached { patches: patches.len(), base: stance.base });
    }
    if job.after.as_ref().is_some_and(|after| !after.again) {
        leave_out_swept(&mut reached, &patches, &already);
    }

    let surface = clock.time("surface", || Surface::new(&scan));
    progress.stage("graph", None);
    let graph = clock.time("graph", || {
        graph::build(
            cell,
            &surface,
            &patches,
            &reached,
            &job.graph,
            &|total| progress.stage("graph", Some(total)),
            &|| progress.tick(),
        )
    });

    progress.stage("tour", None);
    let tool_pose = arm.tip_pose(&start) * job.tool.contact_in_tip();
    let tour = clock.time("gtsp", || {
        formulation::tour(
            job.method,
            &graph,
            &patches,
            &job.tool,
            &tool_pose,
            &job.formulation,
            job.seed,
        )
    })?;

    progress.stage("layered graph and transfers", None);
    let velocity = cost::velocities(&arm, job.v_max);
    let context =
        Context { cell, graph: &graph, patches: &patches, reached: &reached, start, job, progress };
    let sequence = clock.time("layered", || match job.cost {
        CostKind::Effort => context.sequence(&Effort, &tour),
        CostKind::Time => context.sequence(&TaskTime::new(&velocity), &tour),
    })?;

    let plan =
        assemble(robot, &arm, job, &stance, &scan, &patches, &reachable, &sequence, &velocity);
    progress.stage("verify", Some(plan.knots.len().saturating_sub(1)));
    let verification = clock.time("verify", || {
        verify::verify(&plan, &arm, &world, &scan, &surface, &already, &|| progress.tick())
    });
    let figures = Figures {
        points: scan.points.len(),
        patches: patches.len(),
        reachable: reachable.iter().filter(|r| **r).count(),
        edge_candidates: graph.candidates,
        edges: graph.edges.len(),
        components: graph.components.len(),
        base: stance.base,
        held: stance.held.into_iter().collect(),
        ik_samples_total: sequence.samples,
        effort_rad: cost::of_path(&Effort, &plan.knots.iter().map(|k| k.q).collect::<Vec<_>>()),
        task_time_s: plan.duration(),
        distance_m: way(&plan, &arm, true),
        transfer_m: way(&plan, &arm, false),
        calc_time_total_s: clock.0.values().sum(),
        calc_time_s: clock.0,
        knots: plan.knots.len(),
        jumps: sequence.jumps,
        dropped_patches: sequence.dropped.len(),
        verification,
        seed: job.seed,
    };
    Ok(Outcome { plan, figures, arm, scan, patches, reached: reachable, graph })
}

/// Seconds by stage.
#[derive(Default)]
struct Clock(BTreeMap<String, f64>);

impl Clock {
    fn time<T>(&mut self, stage: &str, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        *self.0.entry(stage.into()).or_default() += start.elapsed().as_secs_f64();
        result
    }
}

/// The robot in its place: everything in its root frame.
struct Setting {
    stance: Stance,
    arm: Arm,
    scan: Scan,
    patches: Vec<Patch>,
    world: World,
}

/// Puts the robot where it is asked to stand, or where it reaches most.
fn settle(
    robot: &Robot,
    arm: &Arm,
    scan: &Scan,
    patches: &[Patch],
    job: &Job,
) -> Result<Setting, PipelineError> {
    match &job.stance {
        StanceChoice::Given(stance) => {
            let setting = Setting::new(robot, arm, scan, patches, job, stance.clone())?;
            match setting.world.stance_hit() {
                Some(hit) => Err(PipelineError::StanceHit { hit: hit.to_string() }),
                None => Ok(setting),
            }
        }
        StanceChoice::Search(search) => {
            let candidates = stance::candidates(robot, arm, &job.tool, scan, patches, search)?;
            let tried = candidates.len();
            // Candidates are looked at side by side, each by itself; the best share of points
            // whose patch is reached without a collision wins, ties go to the earlier one.
            let judged: Vec<Result<Option<(usize, Setting)>, PipelineError>> = candidates
                .into_par_iter()
                .map(|c| {
                    let setting = Setting::new(robot, arm, scan, patches, job, c.stance)?;
                    Ok(setting.score(job).map(|score| (score, setting)))
                })
                .collect();
            let mut best: Option<(usize, Setting)> = None;
            for entry in judged {
                if let Some((score, setting)) = entry?
                    && best.as_ref().is_none_or(|(s, _)| score > *s)
                {
                    best = Some((score, setting));
                }
            }
            best.map(|(_, setting)| setting)
                .ok_or(PipelineError::NoStance { tried, patches: patches.len() })
        }
    }
}

impl Setting {
    fn new(
        robot: &Robot,
        arm: &Arm,
        scan: &Scan,
        patches: &[Patch],
        job: &Job,
        stance: Stance,
    ) -> Result<Self, PipelineError> {
        let arm = stance.bind(arm)?;
        let to_root = stance.pose().inverse();
        let scan = scan.transformed(&to_root);
        let patches: Vec<Patch> = patches.iter().map(|p| p.transformed(&to_root)).collect();
        let obstacles: Vec<Obstacle> = job
            .obstacles
            .iter()
            .map(|o| Obstacle { pose: to_root * o.pose, ..o.clone() })
            .collect();
        let surroundings = job.surroundings.iter().map(|p| to_root * p);
        let points: Vec<Point3<f64>> = scan.points.iter().copied().chain(surroundings).collect();
        let world = World::new(robot, &arm, &job.tool, &points, &obstacles, &job.collision)?;
        Ok(Self { stance, arm, scan, patches, world })
    }

    /// Points of reached patches, each weighed by the edges that lead on from its patch, up to
    /// [`WELL_JOINED`]; `None` where body or start posture collide, or nothing is reached.
    fn score(&self, job: &Job) -> Option<usize> {
        start(job, &self.arm, &self.world).ok()?;
        if self.world.stance_hit().is_some() {
            return None;
        }
        let cell = Workcell { arm: &self.arm, tool: &job.tool, world: &self.world };
        let reached = reach(cell, &self.patches, job.ik_samples, &|| ());
        let surface = Surface::new(&self.scan);
        let config = GraphConfig { edge_samples: 24, ..job.graph };
        let graph =
            graph::build(cell, &surface, &self.patches, &reached, &config, &|_| (), &|| ());
        let score = (0..self.patches.len())
            .filter(|&i| reached[i].is_some())
            .map(|i| self.patches[i].points.len() * (1 + graph.incident[i].len().min(WELL_JOINED)))
            .sum();
        (score > 0).then_some(score)
    }
}

/// Edges from a patch from which on a stance gains nothing by more of them.
const WELL_JOINED: usize = 4;

/// The joint vector that the plan starts from.
fn start(job: &Job, arm: &Arm, world: &World) -> Result<JointVector, PipelineError> {
    if let Some(after) = &job.after {
        let knots = after.plan.knots.len();
        return after
            .plan
            .knots
            .get(after.knot)
            .map(|k| k.q)
            .ok_or(PipelineError::NoSuchKnot { knots, knot: after.knot });
    }
    let start = job.start.unwrap_or_else(|| arm.home());
    for (j, &(low, high)) in arm.margined_limits().iter().enumerate() {
        if !(low..=high).contains(&start[j]) {
            let joint = arm.joint_names()[j].clone();
            return Err(PipelineError::StartLimit { joint, value: start[j], low, high });
        }
    }
    match world.why_not(&start, ToolContact::Allowed) {
        Some(hit) => Err(PipelineError::StartHit { hit: hit.to_string() }),
        None => Ok(start),
    }
}

/// Which points the other plan has swept up to its knot.
fn swept_before(after: &After, arm: &Arm, scan: &Scan) -> Result<Vec<bool>, PipelineError> {
    let knots = after.plan.knots.len();
    let mut prefix = after.plan.clone();
    if after.knot >= knots {
        return Err(PipelineError::NoSuchKnot { knots, knot: after.knot });
    }
    prefix.knots.truncate(after.knot + 1);
    let poses = verify::contact_motion(&prefix, arm);
    Ok(coverage::swept(scan, &poses, &after.plan.tool))
}

/// Share of a patch's points from which on it counts as swept.
const SWEPT_SHARE: f64 = 0.9;

/// Takes patches that are swept already out of what is to be visited.
fn leave_out_swept(reached: &mut [Option<Sample>], patches: &[Patch], already: &[bool]) {
    for (entry, patch) in reached.iter_mut().zip(patches) {
        let swept = patch.points.iter().filter(|&&i| already[i as usize]).count();
        if swept as f64 >= SWEPT_SHARE * patch.points.len() as f64 {
            *entry = None;
        }
    }
}

/// What the layered search needs.
struct Context<'a> {
    cell: Workcell<'a>,
    graph: &'a Graph,
    patches: &'a [Patch],
    reached: &'a [Option<Sample>],
    start: JointVector,
    job: &'a Job,
    progress: &'a dyn Progress,
}

/// The joint path of the whole tour.
struct Sequence {
    /// One leg into each stop.
    legs: Vec<(usize, Leg)>,
    samples: usize,
    jumps: usize,
    dropped: Vec<usize>,
}

impl Context<'_> {
    /// The cheapest joint path through the tour's poses. A stop into which no motion is found is
    /// left out.
    fn sequence<C: Cost>(&self, cost: &C, tour: &[Stop]) -> Result<Sequence, PipelineError> {
        let arm = self.cell.arm;
        let mut continuous = [false; MAX_DOF];
        for (c, limits) in continuous.iter_mut().zip(arm.limits()) {
            *c = limits.continuous;
        }
        let values = redundancies(arm.ik().redundancy_range(), self.job.ik_samples);
        let layers: Vec<Vec<Sample>> =
            tour.par_iter().map(|stop| self.layer(stop, &values)).collect();
        let stops: Vec<usize> = tour.iter().map(|stop| stop.patch).collect();
        let mover = Mover::new(self.cell, self.graph, &stops, cost, self.start, self.job.seed);
        let mut dropped = Vec::new();
        let path =
            layered::shortest(cost, &continuous, &self.start, &layers, &mover, &mut |layer| {
                let patch = stops[layer];
                self.progress
                    .note(&format!("patch {patch} is left out: no motion to it was found"));
                dropped.push(patch);
            });
        if path.layers.is_empty() {
            return Err(PipelineError::NoMotion { reachable: tour.len() });
        }
        let legs: Vec<(usize, Leg)> = path
            .layers
            .iter()
            .map(|&layer| stops[layer])
            .zip(path.motions.into_iter().map(|motion| motion.path))
            .collect();
        Ok(Sequence {
            jumps: legs.iter().filter(|(_, leg)| leg.is_jump()).count(),
            legs,
            samples: layers.iter().map(Vec::len).sum(),
            dropped,
        })
    }

    /// All samples at a stop, or where it has none at the heading that reached the patch.
    fn layer(&self, stop: &Stop, values: &[f64]) -> Vec<Sample> {
        let layer = self.layer_at(stop, values);
        match self.reached[stop.patch] {
            Some(sample) if layer.is_empty() => {
                self.layer_at(&Stop { heading: sample.heading, ..*stop }, values)
            }
            _ => layer,
        }
    }

    /// All samples at a stop; for a symmetric pad also those of the opposite heading.
    fn layer_at(&self, stop: &Stop, values: &[f64]) -> Vec<Sample> {
        let mut layer = Vec::new();
        let turns: &[f64] =
            if self.cell.tool.symmetric { &[0.0, std::f64::consts::PI] } else { &[0.0] };
        for turn in turns {
            let stop = Stop { heading: stop.heading + turn, ..*stop };
            let contact = formulation::pose(self.patches, self.cell.tool, &stop);
            self.cell.samples(&contact, stop.heading, values, &mut layer);
        }
        layer
    }
}

/// Joins the legs, unwraps continuous joints and sets the times.
#[allow(clippy::too_many_arguments)] // Everything that a plan records.
fn assemble(
    robot: &Robot,
    arm: &Arm,
    job: &Job,
    stance: &Stance,
    scan: &Scan,
    patches: &[Patch],
    reachable: &[bool],
    sequence: &Sequence,
    velocity: &JointVector,
) -> Plan {
    let mut knots: Vec<PlanKnot> = Vec::new();
    for (patch, leg) in &sequence.legs {
        let shift = knots.last().map_or([0.0; MAX_DOF], |last| {
            std::array::from_fn(|j| {
                let turns = (last.q[j] - leg.joints[0][j]) / std::f64::consts::TAU;
                turns.round() * std::f64::consts::TAU
            })
        });
        let first = usize::from(!knots.is_empty());
        for (q, line) in leg.joints.iter().zip(&leg.line).skip(first) {
            let q = std::array::from_fn(|j| q[j] + shift[j]);
            let line = line.map(|p| [p.x, p.y, p.z]);
            knots.push(PlanKnot { time_ns: 0, q, line, patch: None });
        }
        if let Some(last) = knots.last_mut() {
            last.patch = Some(*patch as u32);
        }
    }
    // A knot that repeats its predecessor would take no time.
    knots.dedup_by(|b, a| {
        let same = a.q == b.q;
        if same {
            a.patch = a.patch.or(b.patch);
            a.line = a.line.or(b.line);
        }
        same
    });
    let joints: Vec<JointVector> = knots.iter().map(|k| k.q).collect();
    for (knot, time) in knots.iter_mut().zip(timing::bang_bang(&joints, velocity)) {
        knot.time_ns = time;
    }
    let mut point_reachable = vec![false; scan.points.len()];
    for (patch, _) in patches.iter().zip(reachable).filter(|(_, r)| **r) {
        for &i in &patch.points {
            point_reachable[i as usize] = true;
        }
    }
    Plan {
        format: FORMAT,
        robot: robot.name().into(),
        fingerprint: arm.fingerprint(),
        joints: arm.joint_names().to_vec(),
        held: arm
            .held_joints()
            .iter()
            .map(|h| Held { name: h.name.clone(), position: h.position })
            .collect(),
        tool: job.tool.clone(),
        base: stance.base,
        method: job.method,
        cost: job.cost,
        seed: job.seed,
        knots,
        patches: patches.iter().map(|p| p.centre.into()).collect(),
        surface: (0..scan.points.len())
            .map(|i| SurfaceSample {
                point: scan.points[i].into(),
                normal: scan.normals[i].into_inner().into(),
                reachable: point_reachable[i],
            })
            .collect(),
        continues: job
            .after
            .as_ref()
            .map(|a| Continues { digest: a.plan.digest(), knot: a.knot as u32 }),
    }
}

/// Way of the pad's centre on the surface or off it. [m]
fn way(plan: &Plan, arm: &Arm, on_surface: bool) -> f64 {
    let contact: Isometry3<f64> = plan.tool.contact_in_tip();
    let centre = |q: &JointVector| Point3::from((arm.tip_pose(q) * contact).translation.vector);
    plan.knots
        .windows(2)
        .filter(|w| (w[0].line.is_some() && w[1].line.is_some()) == on_surface)
        .map(|w| (centre(&w[1].q) - centre(&w[0].q)).norm())
        .sum()
}
