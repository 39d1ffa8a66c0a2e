//! Which plan is made: by the method that was asked for, or the one that takes the least time.

use nullsweep_robot::Arm;
use nullsweep_surface::Patch;

use super::attempt::{Attempt, Planning};
use super::clock::Clock;
use super::error::PipelineError;
use super::job::Job;
use super::swept::leave_out_swept;
use crate::fairing::{Keep, fair};
use crate::plan::{Method, Plan, Profile};
use crate::progress::Progress;
use crate::sweep::coverage;
use crate::timing::{self, Limits, Pace, Rest, paced};
use crate::workcell::Sample;

/// Share of the points, of those to sweep and of all, that a faster plan may sweep less than another.
const LOSS: f64 = 0.003;
/// Angles of strips that are tried.
const ANGLES: usize = 4;

/// An attempt, and the plan that came of it, as it is gone along.
pub(super) struct Made {
    pub(super) attempt: Attempt,
    pub(super) plan: Plan,
}

/// The plan that visits the patches for which `visit` has a sample.
pub(super) fn made(
    planning: &Planning<'_>,
    patches: Vec<Patch>,
    mut visit: Vec<Option<Sample>>,
    rest: Option<&Rest>,
    clock: &mut Clock,
) -> Result<Made, PipelineError> {
    let job = planning.job;
    if let Some(after) = job.after.as_ref().filter(|after| !after.again) {
        leave_out_swept(&mut visit, &patches, planning.already);
        if !visit.iter().any(Option::is_some) {
            return Err(PipelineError::NothingLeft { knot: after.knot });
        }
    }
    tell_jerk(job, planning.cell.arm, planning.progress);
    let of = Choice { planning, patches, visit, rest };
    match job.method {
        Some(Method::Raster) => match of.fastest(of.along_strips(clock), None) {
            Some(made) => {
                planning.tell_left_out(&made.attempt);
                Ok(made)
            }
            None => {
                planning.progress.note("there are no strips that the arm could go along");
                of.over_patches(Method::Curvature, clock)
            }
        },
        Some(method) => of.over_patches(method, clock),
        None => {
            let mut all = vec![of.over_patches(Method::Curvature, clock)?];
            let least = of.swept(&all[0].plan);
            all.extend(of.over_patches(Method::Joint, clock));
            all.extend(of.along_strips(clock));
            of.fastest(all, Some(least)).ok_or(PipelineError::NoMotion { reachable: 0 })
        }
    }
}

struct Choice<'a> {
    planning: &'a Planning<'a>,
    patches: Vec<Patch>,
    visit: Vec<Option<Sample>>,
    rest: Option<&'a Rest>,
}

impl Choice<'_> {
    /// The best of some attempts, each with patches over what the one before has left out, and side
    /// trips to what remains.
    fn over_patches(&self, method: Method, clock: &mut Clock) -> Result<Made, PipelineError> {
        let Self { planning, patches, visit, .. } = self;
        let mut best = planning.attempt(method, patches.clone(), visit.clone(), None, clock)?;
        planning.tell_left_out(&best);
        for _ in 0..planning.job.refinements {
            let Some((patches, visit)) = planning.refine(&best, clock) else { break };
            let next = planning.attempt(method, patches, visit, Some(&best), clock)?;
            planning.tell_left_out(&next);
            if next.swept_points() <= best.swept_points() {
                break;
            }
            best = next;
        }
        Ok(self.finished(best, clock))
    }

    /// Along strips at some angles; not at those at which the arm comes to none.
    fn along_strips(&self, clock: &mut Clock) -> Vec<Made> {
        let marked: Vec<bool> = self.visit.iter().map(Option::is_some).collect();
        let rasters = clock.time("strips", || self.planning.rasters(&self.patches, &marked));
        let mut all = Vec::new();
        for strips in (0..ANGLES).map_while(|rank| rasters.at(rank)) {
            if let Ok(Some(attempt)) = self.planning.along_strips(&self.patches, strips, clock) {
                all.push(self.finished(attempt, clock));
            }
        }
        all
    }

    /// With side trips and the way to where the arm is left, as it is gone along.
    fn finished(&self, mut attempt: Attempt, clock: &mut Clock) -> Made {
        let left = attempt.left.iter().filter(|left| **left).count();
        let stops_cost = self.planning.job.profile.is_curved();
        if !stops_cost || left > self.planning.spare() {
            self.planning.complete(&mut attempt, clock);
        }
        if stops_cost {
            clock.time("side trips", || self.planning.prune(&mut attempt));
        }
        let mut plan = attempt.plan.clone();
        self.planning.leave(&mut plan);
        let plan = moved(self.planning, plan, self.rest, clock);
        Made { attempt, plan }
    }

    /// The fastest of those that sweep about as much as is asked for, of the points to sweep and of
    /// all; without that as the one that sweeps most of those to sweep.
    fn fastest(&self, mut all: Vec<Made>, asked: Option<[f64; 2]>) -> Option<Made> {
        let counts: Vec<[f64; 2]> = all.iter().map(|made| self.swept(&made.plan)).collect();
        let to_sweep = self.planning.to_sweep;
        let whole = [to_sweep.iter().filter(|counts| **counts).count(), to_sweep.len()];
        let most = counts.iter().map(|count| count[0]).fold(0.0, f64::max);
        let asked = asked.unwrap_or([most, 0.0]);
        let fits = |k: &usize| (0..2).all(|i| counts[*k][i] >= asked[i] - LOSS * whole[i] as f64);
        let time = |k: &usize| all[*k].plan.duration();
        let best = (0..all.len()).filter(fits).min_by(|a, b| time(a).total_cmp(&time(b)))?;
        Some(all.swap_remove(best))
    }

    /// How many points a plan sweeps: of those to sweep, and of all.
    fn swept(&self, plan: &Plan) -> [f64; 2] {
        let Planning { sight, cell, to_sweep, already, .. } = *self.planning;
        let swept = coverage::swept_by(sight, [plan.trajectory()], cell.arm);
        let swept: Vec<usize> = (0..swept.len()).filter(|&i| swept[i] || already[i]).collect();
        [swept.iter().filter(|&&i| to_sweep[i]).count(), swept.len()].map(|count| count as f64)
    }
}

/// The plan as it is gone along: made smooth and timed as the job asks, after what comes to rest first.
fn moved(of: &Planning<'_>, mut plan: Plan, rest: Option<&Rest>, clock: &mut Clock) -> Plan {
    let Planning { job, cell, progress, .. } = *of;
    // A fair way is one of a pad on the surface: it may turn from its heading, which a roller's must not,
    // and what is worked on from afar lies elsewhere than the tool.
    if job.smooth && job.tool.touches() && !job.tool.rolls() {
        progress.stage("fairing", None);
        let keep = Keep { scan: of.scan, points: of.to_sweep };
        let limits = job.profile.is_curved().then(|| Limits::of(cell.arm, job.v_max));
        plan = clock.time("fairing", || fair(&plan, cell, of.bed, keep, limits.as_ref()));
        timing::set_times(&mut plan.knots, &of.velocity);
    }
    if job.profile.is_curved() {
        progress.stage("timing", None);
        let pace = pace(job, cell.arm);
        let limits = Limits::of(cell.arm, job.v_max);
        plan = clock.time("timing", || paced(&plan, cell, &limits, &pace));
        if let Some(rest) = rest {
            plan = rest.then(plan);
        }
    }
    plan
}

/// What the plan keeps to besides velocity and acceleration.
fn pace(job: &Job, arm: &Arm) -> Pace<'static> {
    let limited = job.profile == Profile::Jerk;
    let jerk = limited.then(|| job.jerk.unwrap_or_else(|| timing::jerks(arm)));
    Pace { stops: &[], jerk, tool_speed: job.tool_speed }
}

/// Says where limits of jerk are taken to be something.
fn tell_jerk(job: &Job, arm: &Arm, progress: &dyn Progress) {
    let known = job.jerk.is_some() || arm.limits().iter().all(|joint| joint.jerk.is_some());
    if job.profile == Profile::Jerk && !known {
        progress.note(&format!(
            "the URDF has no jerk limits: each joint is taken to come to its full acceleration in \
             {} s",
            timing::DEFAULT_JERK_TIME
        ));
    }
}
