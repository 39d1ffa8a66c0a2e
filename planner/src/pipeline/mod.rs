//! The whole way from a scan to a verified plan, on one page.

mod attempt;
mod completion;
mod joint;
mod setting;
mod start;

use std::collections::BTreeMap;
use std::time::Instant;

use attempt::{Attempt, Shop};
use nalgebra::{Isometry3, Point3};
use nullsweep_collision::{self as collision, CollisionError, Obstacle};
use nullsweep_robot::{Arm, ArmError, ArmSpec, JointVector, Robot, Tool};
use nullsweep_surface::patches::{self, Patch, PatchConfig};
use nullsweep_surface::scan::Scan;
use nullsweep_surface::sheet::Surface;
use serde::{Deserialize, Serialize};
use setting::{Setting, settle};
use start::{Start, start};

use crate::cost::{self, Effort};
use crate::plan::{CostKind, Method, Plan, Profile, Stretch};
use crate::progress::Progress;
use crate::roadmap::{Graph, GraphConfig};
use crate::sweep::{contact_motion, coverage};
use crate::timing::{Limits, Rest, accelerate};
use crate::tour::formulation::{FormulationConfig, FormulationError};
use crate::verify::{self, Verification};
use crate::workcell::stance::{Stance, StanceSearch};
use crate::workcell::{Sample, Workcell, reach};

/// What is to be planned.
#[derive(Clone, Debug)]
pub struct Job {
    /// Base and tip link of the arm.
    pub arm: ArmSpec,
    /// The tool at its tip.
    pub tool: Tool,
    /// Where the robot stands.
    pub stance: StanceChoice,
    /// Points that were scanned but are not to be swept, in the floor frame. \[m\]
    pub surroundings: Vec<Point3<f64>>,
    /// Solid things besides the scan, posed in the floor frame.
    pub obstacles: Vec<Obstacle>,
    /// Where the arm is; `None`: a posture that the SRDF names (home before others), else the middle
    /// of its ranges, or where it collides there the nearest free posture found. \[rad\] or \[m\]
    pub start: Option<JointVector>,
    /// A plan that this one goes on from.
    pub after: Option<After>,
    /// How the order is found.
    pub method: Method,
    /// What is minimised.
    pub cost: CostKind,
    /// Samples of the inverse kinematics at each tool pose, 1…
    pub ik_samples: usize,
    /// One velocity for all joints; `None`: the robot's limits. \[rad/s\]
    pub v_max: Option<f64>,
    /// How fast the plan goes along its path.
    pub profile: Profile,
    /// Patch extraction.
    pub patches: PatchConfig,
    /// Graph construction.
    pub graph: GraphConfig,
    /// Formulation.
    pub formulation: FormulationConfig,
    /// How often the plan is made again with patches over what it has not swept.
    pub refinements: usize,
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
    /// The new plan's start, or the last knot that was passed.
    pub knot: usize,
    /// Where the arm was stopped past that knot and is held: then the plan starts there. \[rad\] or
    /// \[m\]
    pub held: Option<JointVector>,
    /// Whether patches that the other plan, and those that led to it, have swept by then are swept
    /// again.
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
    /// Patches put over what the others' sweep left out.
    pub fill_in_patches: usize,
    /// Pairs of neighbouring patches.
    pub edge_candidates: usize,
    /// Edges of the graph.
    pub edges: usize,
    /// Connected components of the graph.
    pub components: usize,
    /// x, y \[m\] and yaw \[rad\] of the robot's root frame in the floor frame.
    pub base: [f64; 3],
    /// Held joints that the stance sets. \[rad\] or \[m\]
    pub held: BTreeMap<String, f64>,
    /// Samples of the inverse kinematics that the layered graph had.
    pub ik_samples_total: usize,
    /// Sum of all joint displacements. \[rad\]
    pub effort_rad: f64,
    /// Duration of the plan. \[s\]
    pub task_time_s: f64,
    /// Way of the pad on the surface. \[m\]
    pub distance_m: f64,
    /// Way of the pad through free space. \[m\]
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
    /// The plan to go on from has swept everything.
    #[error("every reachable patch is swept by knot {knot}: nothing is left to plan")]
    NothingLeft {
        /// The knot to go on from.
        knot: usize,
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
    for note in world.notes() {
        progress.note(note);
    }
    let Start { q: mut start, note } = start(job, &arm, &world)?;
    if let Some(note) = note {
        progress.note(&note);
    }
    let cell = Workcell { arm: &arm, tool: &job.tool, world: &world };

    // A plan that joins another one in motion first comes to rest on the other one's path.
    let mut rest = None;
    if let (Some(after), Profile::Acceleration) = (&job.after, job.profile)
        && after.plan.profile == Profile::Acceleration
        && after.held.is_none()
    {
        rest = Rest::after(&after.plan, after.knot, &Limits::of(&arm, None));
    }
    if let Some(last) = rest.as_ref().and_then(|rest| rest.knots.last()) {
        start = last.q;
    }
    let already = job.after.as_ref().map_or_else(
        || Ok(vec![false; scan.points.len()]),
        |after| {
            let knot = rest.as_ref().map_or(after.knot, |rest| rest.at);
            swept_before(&after.plan, knot, &arm, &scan)
        },
    )?;
    progress.stage("reach", Some(patches.len()));
    let reached =
        clock.time("reach", || reach(cell, &patches, job.ik_samples, &|| progress.tick()));
    let reachable: Vec<bool> = reached.iter().map(Option::is_some).collect();
    if !reachable.contains(&true) {
        return Err(PipelineError::NothingReached { patches: patches.len(), base: stance.base });
    }
    let surface = clock.time("surface", || Surface::new(&scan));
    let to_sweep = points_of(&scan, &patches, &reachable);
    let shop = Shop {
        robot,
        job,
        stance: &stance,
        cell,
        scan: &scan,
        surface: &surface,
        start,
        velocity: cost::velocities(&arm, job.v_max),
        to_sweep: &to_sweep,
        already: &already,
        progress,
    };
    let patch_count = patches.len();
    let mut visit = reached.clone();
    if job.after.as_ref().is_some_and(|after| !after.again) {
        leave_out_swept(&mut visit, &patches, &already);
        if let (Some(after), false) = (&job.after, visit.iter().any(Option::is_some)) {
            return Err(PipelineError::NothingLeft { knot: after.knot });
        }
    }
    let mut best = shop.attempt(patches, visit, None, &mut clock)?;
    for _ in 0..job.refinements {
        let Some((patches, visit)) = shop.refine(&best, &mut clock) else { break };
        let next = shop.attempt(patches, visit, Some(&best), &mut clock)?;
        if next.swept_points() <= best.swept_points() {
            break;
        }
        best = next;
    }
    shop.complete(&mut best, &mut clock);
    let Attempt { patches, graph, sequence, mut plan, .. } = best;
    if job.profile == Profile::Acceleration {
        progress.stage("timing", None);
        plan = clock.time("timing", || accelerate(&plan, cell, &Limits::of(&arm, job.v_max), &[]));
        if let Some(rest) = rest {
            plan = rest.then(plan);
        }
    }

    progress.stage("verify", Some(plan.knots.len().saturating_sub(1)));
    let verification = clock.time("verify", || {
        verify::verify(&plan, &arm, &world, &scan, &surface, &already, &|| progress.tick())
    });
    let figures = Figures {
        points: scan.points.len(),
        patches: patch_count,
        reachable: reachable.iter().filter(|r| **r).count(),
        fill_in_patches: patches.len() - patch_count,
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
        jumps: sequence.jumps(),
        dropped_patches: sequence.dropped.len(),
        verification,
        seed: job.seed,
    };
    let mut reached = reachable;
    reached.resize(patches.len(), true);
    Ok(Outcome { plan, figures, arm, scan, patches, reached, graph })
}

/// Which points belong to one of the marked patches.
fn points_of(scan: &Scan, patches: &[Patch], marked: &[bool]) -> Vec<bool> {
    let mut points = vec![false; scan.points.len()];
    for (patch, _) in patches.iter().zip(marked).filter(|(_, m)| **m) {
        for &i in &patch.points {
            points[i as usize] = true;
        }
    }
    points
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

/// Which points the other plan, and those that led to it, have swept up to its knot.
fn swept_before(
    plan: &Plan,
    knot: usize,
    arm: &Arm,
    scan: &Scan,
) -> Result<Vec<bool>, PipelineError> {
    let knots = plan.knots.len();
    if knot >= knots {
        return Err(PipelineError::NoSuchKnot { knots, knot });
    }
    let mut swept = vec![false; scan.points.len()];
    for Stretch { tool, profile, knots } in plan.followed(knot) {
        let part = Plan { tool, profile, knots, ..plan.clone() };
        let poses = contact_motion(&part, arm);
        for (before, now) in swept.iter_mut().zip(coverage::swept(scan, &poses, &part.tool)) {
            *before |= now;
        }
    }
    Ok(swept)
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

/// Way of the pad's centre on the surface or off it. \[m\]
fn way(plan: &Plan, arm: &Arm, on_surface: bool) -> f64 {
    let contact: Isometry3<f64> = plan.tool.contact_in_tip();
    let centre = |q: &JointVector| Point3::from((arm.tip_pose(q) * contact).translation.vector);
    plan.knots
        .windows(2)
        .filter(|w| (w[0].line.is_some() && w[1].line.is_some()) == on_surface)
        .map(|w| (centre(&w[1].q) - centre(&w[0].q)).norm())
        .sum()
}
