//! The whole way from a scene to a verified plan, on one page.

use nullsweep_collision::World;
use nullsweep_robot::{Arm, JointVector, Robot};
use nullsweep_surface::{Patch, Scan, patches};
use rayon::prelude::*;

use super::attempt::{Attempt, Planning};
use super::clock::Clock;
use super::elsewhere::{Floor, advise};
use super::error::PipelineError;
use super::figures::{Figures, figures};
use super::job::{After, Job};
use super::left_out::{Known, LeftOut, in_words, left_out};
use super::setting::{Setting, settle};
use super::start::{rest_before, start};
use super::swept::{leave_out_swept, points_of, swept_before};
use crate::cost;
use crate::fairing::{Keep, fair};
use crate::motion::Memo;
use crate::plan::{Left, Plan, Profile};
use crate::progress::Progress;
use crate::roadmap::Graph;
use crate::sweep::{Held, passes};
use crate::timing::{self, Limits, Pace, Rest, paced};
use crate::verify::{Given, verify};
use crate::workcell::{Bed, Sample, Scene, Workcell, reach};

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

/// Plans the job for a scene in the floor frame.
///
/// # Errors
/// See [`PipelineError`]. A plan that breaks a rule is no error: it comes with its violations.
pub fn run(
    robot: &Robot,
    scene: &Scene,
    job: &Job,
    progress: &dyn Progress,
) -> Result<Outcome, PipelineError> {
    if let Some(After { plan, .. }) = &job.after {
        plan.check_bounds()?;
    }
    let mut clock = Clock::default();
    let free_arm = robot.arm(&job.arm)?;
    progress.stage("patches", None);
    let all = clock.time("patches", || {
        let found = patches::find(&scene.surface, &job.patches, job.seed);
        let bed = Bed::new(scene, &job.tool);
        found.into_par_iter().filter_map(|patch| bed.laid(patch)).collect::<Vec<_>>()
    });
    if all.is_empty() {
        return Err(PipelineError::NoPatches { points: scene.surface.points.len() });
    }

    progress.stage("stance", None);
    let setting = clock.time("stance", || settle(robot, &free_arm, scene, &all, job))?;
    let Setting { stance, arm, scene: here, patches, world, others } = setting;
    let scan = &here.surface;
    for note in world.notes() {
        progress.note(note);
    }
    let (start, rest) = begin(job, &arm, &world, progress)?;
    let already = swept_before(job, rest.as_ref(), &arm, scan)?;

    let cell = Workcell { arm: &arm, tool: &job.tool, world: &world };
    progress.stage("reach", Some(patches.len()));
    let reached =
        clock.time("reach", || reach(cell, &patches, job.ik_samples, &|| progress.tick()));
    let mut reachable: Vec<bool> = reached.iter().map(Option::is_some).collect();
    if !reachable.contains(&true) {
        let none = vec![false; scan.points.len().max(patches.len())];
        let why = in_words(&left_out(cell, &Known::unreached(scan, &patches, &none)));
        let (patches, base) = (patches.len(), stance.base);
        return Err(PipelineError::NothingReached { patches, base, why });
    }
    let (found, samples) = (patches.clone(), reached);
    let bed = clock.time("surface", || Bed::new(&here, &job.tool));
    let planning = Planning {
        robot,
        job,
        stance: &stance,
        cell,
        scan,
        bed: &bed,
        start,
        velocity: cost::velocities(&arm, job.v_max),
        continues: job.after.as_ref().map_or(Ok(None), After::continues)?,
        to_sweep: &points_of(scan, &patches, &reachable),
        already: &already,
        progress,
        memo: Memo::new(job.seed),
    };
    let best = search(&planning, patches, samples, &mut clock)?;
    let Attempt { patches, graph, sequence, mut plan, .. } = best;
    planning.leave(&mut plan);
    let mut plan = moved(&planning, plan, rest, &mut clock);

    progress.stage("verify", Some(plan.knots.len()));
    let given = Given { robot, arm: &job.arm, scene, collision: &job.collision };
    let verification = clock.time("verify", || verify(&plan, given, &|| progress.tick()))?;
    let known = Known {
        scan,
        patches: &found,
        reachable: &reachable,
        dropped: &sequence.dropped,
        swept: &verification.swept,
    };
    let floor = Floor { robot, arm: &free_arm, scene, patches: &all, job };
    let left_out = clock.time("causes", || advise(left_out(cell, &known), &others, &floor))?;
    let of = |row: &LeftOut| Left { cause: row.cause.to_string(), points: row.points.clone() };
    plan.left = left_out.iter().map(of).collect();
    // A stroke leads to a place that has no points of its own.
    let strokes = patches[found.len()..].iter().filter(|patch| patch.points.is_empty()).count();
    let figures = Figures {
        points: scan.points.len(),
        patches: found.len(),
        left_out,
        reachable: reachable.iter().filter(|r| **r).count(),
        fill_in_patches: patches.len() - found.len() - strokes,
        strokes,
        base: stance.base,
        base_height_m: stance.height,
        held: stance.held.into_iter().collect(),
        calc_time_total_s: clock.0.values().sum(),
        calc_time_s: clock.0,
        passes: passes(scan, plan.trajectory(), &arm),
        tool_speed: job.tool_speed.map(|speed| Held::of(plan.trajectory(), &arm, speed)),
        verification,
        seed: job.seed,
        ..figures(&plan, &arm, &graph, &sequence)
    };
    reachable.resize(patches.len(), true);
    let scan = here.surface;
    Ok(Outcome { plan, figures, arm, scan, patches, reached: reachable, graph })
}

/// The plan as it is gone along: made smooth and timed as the job asks, after what comes to rest first.
fn moved(of: &Planning<'_>, mut plan: Plan, rest: Option<Rest>, clock: &mut Clock) -> Plan {
    let Planning { job, cell, progress, .. } = *of;
    if job.smooth {
        progress.stage("fairing", None);
        let keep = Keep { scan: of.scan, points: of.to_sweep };
        plan = clock.time("fairing", || fair(&plan, cell, of.bed, keep));
        timing::set_times(&mut plan.knots, &of.velocity);
    }
    if job.profile.is_curved() {
        progress.stage("timing", None);
        let pace = pace(job, cell.arm, progress);
        let limits = Limits::of(cell.arm, job.v_max);
        plan = clock.time("timing", || paced(&plan, cell, &limits, &pace));
        if let Some(rest) = rest {
            plan = rest.then(plan);
        }
    }
    plan
}

/// What the plan keeps to besides velocity and acceleration.
fn pace(job: &Job, arm: &Arm, progress: &dyn Progress) -> Pace<'static> {
    let known = job.jerk.is_some() || arm.limits().iter().all(|joint| joint.jerk.is_some());
    if job.profile == Profile::Jerk && !known {
        progress.note(&format!(
            "the URDF has no jerk limits: each joint is taken to come to its full acceleration in \
             {} s",
            timing::DEFAULT_JERK_TIME
        ));
    }
    let limited = job.profile == Profile::Jerk;
    let jerk = limited.then(|| job.jerk.unwrap_or_else(|| timing::jerks(arm)));
    Pace { stops: &[], jerk, tool_speed: job.tool_speed }
}

/// Where the arm begins; for a plan that joins another one in motion, after the way to rest on the
/// other one's path.
fn begin(
    job: &Job,
    arm: &Arm,
    world: &World,
    progress: &dyn Progress,
) -> Result<(JointVector, Option<Rest>), PipelineError> {
    let start = start(job, arm, world)?;
    if let Some(note) = start.note {
        progress.note(&note);
    }
    let rest = rest_before(job, arm);
    let at_rest = rest.as_ref().and_then(|rest| rest.knots.last()).map(|knot| knot.q);
    Ok((at_rest.unwrap_or(start.q), rest))
}

/// The best of some attempts, each with patches over what the one before has left out, and side
/// trips to what remains.
fn search(
    planning: &Planning<'_>,
    patches: Vec<Patch>,
    mut visit: Vec<Option<Sample>>,
    clock: &mut Clock,
) -> Result<Attempt, PipelineError> {
    let job = planning.job;
    if let Some(after) = job.after.as_ref().filter(|after| !after.again) {
        leave_out_swept(&mut visit, &patches, planning.already);
        if !visit.iter().any(Option::is_some) {
            return Err(PipelineError::NothingLeft { knot: after.knot });
        }
    }
    let mut best = planning.attempt(patches, visit, None, clock)?;
    for _ in 0..job.refinements {
        let Some((patches, visit)) = planning.refine(&best, clock) else { break };
        let next = planning.attempt(patches, visit, Some(&best), clock)?;
        if next.swept_points() <= best.swept_points() {
            break;
        }
        best = next;
    }
    planning.complete(&mut best, clock);
    Ok(best)
}
