//! The whole way from a scene to a verified plan, on one page.

use nullsweep_collision::World;
use nullsweep_robot::{Arm, JointVector, Robot, Tool};
use nullsweep_surface::{Patch, Scan, patches};
use rayon::prelude::*;

use super::attempt::{Attempt, Planning, Visit};
use super::choice::Made;
use super::clock::Clock;
use super::elsewhere::{Floor, advise};
use super::error::PipelineError;
use super::figures::{Figures, figures};
use super::idle::idle;
use super::job::{After, Job};
use super::left_out::{Known, LeftOut, in_words, left_out, missed_by};
use super::rounds::Course;
use super::setting::{Setting, settle};
use super::start::{rest_before, start};
use super::stick::longer;
use super::swept::{passed_before, points_of, without_swept};
use crate::cost;
use crate::motion::Memo;
use crate::plan::Plan;
use crate::progress::Progress;
use crate::regions::Label;
use crate::roadmap::Graph;
use crate::sweep::{Held, Passes, Sight, passes_over, solids};
use crate::timing::Rest;
use crate::verify::{Given, verify};
use crate::workcell::{Bed, Scene, Workcell, reach};

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
    /// What the arm may collide with.
    pub world: World,
    /// Where the arm is before the first motion.
    pub start: JointVector,
    /// The stops of the plan with the ways to them, before they were made fair and timed.
    pub visits: Vec<Visit>,
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
    check(job)?;
    let mut clock = Clock::default();
    let free_arm = robot.arm(&job.arm)?;
    progress.stage("patches", None);
    let all = without_swept(clock.time("patches", || patches_of(scene, job))?, &job.spared);
    if all.is_empty() {
        return Err(PipelineError::AllSpared);
    }
    progress.stage("stance", None);
    let setting = clock.time("stance", || settle(robot, &free_arm, scene, &all, job))?;
    let Setting { stance, arm, scene: here, patches, world, others } = setting;
    let scan = &here.surface;
    world.notes().iter().for_each(|note| progress.note(note));
    let (start, rest) = begin(job, &arm, &world, progress)?;
    let course = Course::new(scene, job, passed_before(job, rest.as_ref(), &arm, scan)?);

    let cell = Workcell { arm: &arm, tool: &job.tool, world: &world };
    progress.stage("reach", Some(patches.len()));
    let reached =
        clock.time("reach", || reach(cell, &patches, job.ik_samples, &|| progress.tick()));
    let mut reachable: Vec<bool> = reached.iter().map(Option::is_some).collect();
    if !reachable.contains(&true) {
        return Err(nothing_reached(cell, scan, &patches, stance.base));
    }
    let (found, samples) = (patches.clone(), reached);
    let bed = clock.time("surface", || Bed::new(&here, &job.tool));
    let solids = solids(&here, &job.tool, &job.collision)?;
    let sight = Sight::of(&here, solids.as_ref());
    let planning = Planning {
        robot,
        job,
        stance: &stance,
        cell,
        scan,
        sight,
        bed: &bed,
        start,
        velocity: cost::velocities(&arm, job.v_max),
        continues: job.after.as_ref().map_or(Ok(None), After::continues)?,
        to_sweep: &points_of(scan, &patches, &reachable),
        already: &course.already(),
        progress,
        memo: Memo::new(job.seed),
    };
    let (Made { attempt, mut plan }, rounds) =
        course.made(&planning, (patches, samples), rest.as_ref(), &mut clock)?;
    course.mark(&mut plan, planning.to_sweep);
    tell_idle(idle(&mut plan, &arm, scan), &job.tool, progress);
    let Attempt { patches, graph, sequence, places, .. } = attempt;

    progress.stage("verify", Some(plan.knots.len()));
    let given = Given { robot, arm: &job.arm, scene, collision: &job.collision };
    let verification = clock.time("verify", || verify(&plan, given, &|| progress.tick()))?;
    let done = course.done(&verification.swept);
    let dropped = &sequence.dropped;
    let known = Known { scan, patches: &found, reachable: &reachable, dropped, swept: &done };
    let floor = Floor { robot, arm: &free_arm, scene, patches: &all, job };
    let left_out = clock.time("causes", || advise(left_out(cell, &known), &others, &floor))?;
    let left_out = clock.time("causes", || longer(left_out, &stance, &floor))?;
    plan.left = left_out.iter().map(LeftOut::told).collect();
    plan.left.extend(course.unwanted(&verification.swept));
    // A stroke leads to a place that has no points of its own.
    let strokes = patches[found.len()..].iter().filter(|patch| patch.points.is_empty()).count();
    let figures = Figures {
        patches: found.len(),
        left_out,
        missed: missed_by(&plan, &done, &arm),
        reachable: reachable.iter().filter(|r| **r).count(),
        fill_in_patches: patches.len() - found.len() - strokes - places,
        places,
        strokes,
        held: stance.held.into_iter().collect(),
        calc_time_total_s: clock.0.values().sum(),
        calc_time_s: clock.0,
        passes: Passes::of(&passes_over(sight, [plan.trajectory()], &arm)),
        rounds,
        tool_speed: job.tool_speed.map(|speed| Held::of(plan.trajectory(), &arm, speed)),
        verification,
        ..figures(&plan, &arm, &graph, &sequence)
    };
    reachable.resize(patches.len(), true);
    Ok(Outcome {
        plan,
        figures,
        arm,
        scan: here.surface,
        patches,
        reached: reachable,
        graph,
        world,
        start,
        visits: sequence.visits,
    })
}

/// Whether the job can be planned at all.
fn check(job: &Job) -> Result<(), PipelineError> {
    job.after.as_ref().map_or(Ok(()), |after| after.plan.check_bounds())?;
    if job.tool.own_speed().is_some() && !job.profile.is_curved() {
        return Err(PipelineError::NoSpeed { tool: job.tool.name.clone() });
    }
    Ok(())
}

/// Says that a tool does not work over some pieces of its way.
fn tell_idle(pieces: usize, tool: &Tool, progress: &dyn Progress) {
    if pieces > 0 {
        progress.note(&format!(
            "{} does not work over {pieces} {} of its way: it would be too near, too far or too aslant",
            tool.name,
            if pieces == 1 { "piece" } else { "pieces" }
        ));
    }
}

/// Why no patch is reached from where the robot stands.
fn nothing_reached(
    cell: Workcell<'_>,
    scan: &Scan,
    patches: &[Patch],
    base: [f64; 3],
) -> PipelineError {
    let none = vec![false; scan.points.len().max(patches.len())];
    let why = in_words(&left_out(cell, &Known::unreached(scan, patches, &none)));
    PipelineError::NothingReached { patches: patches.len(), base, why }
}

/// The patches of a scene as the pad lies on them, in its frame: what a plan visits.
///
/// # Errors
/// [`PipelineError::NoPatches`].
pub fn patches_of(scene: &Scene, job: &Job) -> Result<Vec<Patch>, PipelineError> {
    let found = wanted_patches(scene, job);
    let bed = Bed::new(scene, &job.tool);
    let laid: Vec<Patch> = found.into_par_iter().filter_map(|patch| bed.laid(patch)).collect();
    if laid.is_empty() {
        return Err(PipelineError::NoPatches { points: scene.surface.points.len() });
    }
    Ok(laid)
}

/// The patches of what is to be swept, region by region.
fn wanted_patches(scene: &Scene, job: &Job) -> Vec<Patch> {
    let Scene { surface, regions, .. } = scene;
    if regions.is_empty() {
        return patches::find(surface, &job.patches, job.seed);
    }
    let labels = regions.labels(&surface.points);
    let all = std::iter::once(Label::None).chain((0..regions.all().len()).map(Label::Sweep));
    let wanted = all.filter(|label| regions.is_wanted(*label));
    let of = |label: Label| {
        let own: Vec<bool> = labels.iter().map(|l| *l == label).collect();
        patches::find_among(surface, &own, &job.patches, job.seed)
    };
    wanted.flat_map(of).collect()
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
