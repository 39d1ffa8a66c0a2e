//! What is left of a plan of a program that was left on its way.

use nullsweep_collision::Options;
use nullsweep_robot::{Arm, JointVector, Robot};

use super::error::StopsError;
use super::share::Notes;
use crate::pipeline::{self, After, End, Job, Outcome, PipelineError, StanceChoice};
use crate::plan::{Plan, Profile, Program, Stretch, Work};
use crate::sweep::{DIP, Pace, coverage};
use crate::workcell::{Scene, Stance};

/// Where a plan of a program was left.
#[derive(Clone, Copy, Debug)]
pub struct LeftOff<'a> {
    /// The program.
    pub program: &'a Program,
    /// Its plan that was begun.
    pub work: &'a Work,
    /// The plan that was left: that one, or what was made of its rest before.
    pub plan: &'a Plan,
    /// The last knot of it that was passed.
    pub knot: usize,
    /// Where the arm is held. \[rad\] or \[m\]
    pub at: JointVector,
}

/// What was made of it.
#[derive(Clone, Debug)]
pub enum Rest {
    /// A verified plan that begins where the arm is held and ends where the first one does, and what its
    /// making had to tell.
    Plan(Box<Plan>, Vec<String>),
    /// Nothing is left that could be swept: the arm need only be brought to where the plan ends.
    Swept,
}

/// Why there is no plan of the rest.
#[derive(Debug, thiserror::Error)]
pub enum RestError {
    /// It cannot be planned.
    #[error(transparent)]
    Stops(#[from] StopsError),
    /// It breaks rules.
    #[error("the plan of what is left breaks {count} rules: {first}")]
    Broken {
        /// How many.
        count: usize,
        /// The first one.
        first: String,
    },
    /// It does not end where the next plans need the arm.
    #[error("no way back to where the plan was to end was found")]
    NoWayBack,
}

/// What counts as the same place. \[rad\] or \[m\]
const SAME: f64 = 1e-6;

/// Plans what is left: the points that the program's plan sweeps and that were not swept yet, of the same
/// order, cost, profile and seed, no joint and no pad faster than in the plan that was left. The scene is
/// in the floor frame.
///
/// # Errors
/// See [`RestError`].
pub fn rest(
    robot: &Robot,
    scene: &Scene,
    of: LeftOff<'_>,
    collision: Options,
) -> Result<Rest, RestError> {
    let LeftOff { program, work, plan, knot, at } = of;
    let stops = |error: PipelineError| RestError::Stops(error.into());
    let spec = work.arm.parse().map_err(|_| RestError::Stops(StopsError::OtherScene))?;
    let held = plan.held.iter().map(|h| (h.name.clone(), h.position)).collect();
    let stance = Stance { base: plan.base, height: plan.base_height, held };
    let arm =
        stance.bind(&robot.arm(&spec).map_err(StopsError::from)?).map_err(StopsError::from)?;
    let [x, y, _] = plan.base;
    let (here, _) = scene.near([x, y], program.near_m);
    let spared = spared(&here, &stance, work, (plan, knot), &arm)?;
    if spared.iter().all(|spared| *spared) {
        return Ok(Rest::Swept);
    }
    let end = work.plan.knots.last().map_or(at, |knot| knot.q);
    let after = After { plan: plan.clone(), knot, held: Some(at), again: false };
    let is_curved = plan.profile != Profile::Velocity;
    let pace = Pace::of(work.plan.trajectory(), false, &arm, DIP);
    let fastest = pace.joints.iter().map(|joint| joint.velocity).fold(0.0, f64::max);
    let job = Job {
        tool: plan.tool.clone(),
        stance: StanceChoice::Given(stance),
        end: End::At(end),
        after: Some(after),
        spared,
        method: Some(plan.method),
        cost: plan.cost,
        v_max: (fastest > 0.0).then_some(fastest),
        profile: plan.profile,
        jerk: plan.jerk,
        tool_speed: (is_curved && pace.tool_speed_p95 > 0.0).then_some(pace.tool_speed_p95),
        smooth: is_curved,
        collision,
        seed: plan.seed,
        ..Job::new(spec)
    };
    let notes = Notes::default();
    let Outcome { plan: made, figures, arm, .. } = match pipeline::run(robot, &here, &job, &notes) {
        Ok(outcome) => outcome,
        Err(PipelineError::AllSpared | PipelineError::NothingReached { .. }) => {
            return Ok(Rest::Swept);
        }
        Err(error) => return Err(stops(error)),
    };
    let violations = &figures.verification.violations;
    if let Some(first) = violations.first() {
        let (count, first) = (violations.len(), first.detail.clone());
        return Err(RestError::Broken { count, first });
    }
    let last = made.knots.last().map_or(at, |knot| knot.q);
    if arm.continuous().displacement(&last, &end).iter().any(|apart| apart.abs() > SAME) {
        return Err(RestError::NoWayBack);
    }
    Ok(Rest::Plan(Box::new(made.sealed()), notes.told()))
}

/// Of each point of the scene whether it is no more to be swept: swept by now, or never by this plan.
fn spared(
    here: &Scene,
    stance: &Stance,
    work: &Work,
    (plan, knot): (&Plan, usize),
    arm: &Arm,
) -> Result<Vec<bool>, RestError> {
    let scan = here.surface.transformed(&stance.pose().inverse());
    let planned = work.plan.surface.len();
    if scan.points.len() != planned {
        return Err(RestError::Stops(StopsError::OtherScene));
    }
    let own = coverage::swept_by(&scan, [work.plan.trajectory()], arm);
    let followed = plan.followed(knot);
    let done = coverage::swept_by(&scan, followed.iter().map(Stretch::trajectory), arm);
    Ok(own.into_iter().zip(done).map(|(own, done)| !own || done).collect())
}
