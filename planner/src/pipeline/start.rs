//! The posture that a plan starts from.

use nullsweep_collision::{self as collision, CollisionError, ToolContact, World};
use nullsweep_robot::{Arm, JointVector, MAX_DOF};

use super::error::PipelineError;
use super::job::{After, Job};
use crate::plan::Profile;
use crate::timing::{Limits, Rest};
use crate::workcell::nearest_free;

/// The way to rest on the path of the plan that a job joins in motion; `None` where it does not.
pub(super) fn rest_before(job: &Job, arm: &Arm) -> Option<Rest> {
    let After { plan, knot, held, .. } = job.after.as_ref()?;
    let smooth = Profile::Acceleration;
    let joins = job.profile == smooth && plan.profile == smooth && held.is_none();
    if joins { Rest::after(plan, *knot, &Limits::of(arm, None)) } else { None }
}

/// Where the arm is before the first motion.
pub(super) struct Start {
    pub(super) q: JointVector,
    /// Whether that is another posture than would have been taken, as the arm collides there.
    pub(super) is_makeshift: bool,
    /// What a user should know who did not say where the arm is.
    pub(super) note: Option<String>,
}

/// The joint vector that the plan starts from: that of the plan it goes on from, the one asked for,
/// or a posture inside the limits and free of collision, the nearest to home that is found.
pub(super) fn start(job: &Job, arm: &Arm, world: &World) -> Result<Start, PipelineError> {
    if let Some(after) = &job.after
        && after.held.is_none()
    {
        let knots = after.plan.knots.len();
        let knot = after.plan.knots.get(after.knot);
        let q = knot.ok_or(PipelineError::NoSuchKnot { knots, knot: after.knot })?.q;
        return Ok(Start { q, is_makeshift: false, note: None });
    }
    if let Some(q) = job.after.as_ref().and_then(|after| after.held).or(job.start) {
        check(arm, world, &q)?;
        return Ok(Start { q, is_makeshift: false, note: None });
    }
    let states = match &job.collision.srdf {
        Some(path) => collision::group_states(path).map_err(CollisionError::from)?,
        None => Vec::new(),
    };
    let named = states.iter().find_map(|state| Some((state.name.as_str(), posture(arm, state)?)));
    let (name, home) = named.unwrap_or(("home", arm.home()));
    let Err(error) = check(arm, world, &home) else {
        let note = named.map(|(name, _)| format!("the arm starts in the SRDF's posture {name}"));
        return Ok(Start { q: home, is_makeshift: false, note });
    };
    let Some(q) = nearest_free(arm, world, &home) else { return Err(error) };
    let joints: Vec<String> = q[..arm.dof()].iter().map(|v| format!("{v:.2}")).collect();
    let joints = joints.join(",");
    let note =
        format!("the arm cannot start at {name} ({error}): planned from joints {joints} instead");
    Ok(Start { q, is_makeshift: true, note: Some(note) })
}

/// Inside the margined limits and free of collision.
fn check(arm: &Arm, world: &World, q: &JointVector) -> Result<(), PipelineError> {
    for (j, &(low, high)) in arm.margined_limits().iter().enumerate() {
        if !(low..=high).contains(&q[j]) {
            let joint = arm.joint_names()[j].clone();
            return Err(PipelineError::StartLimit { joint, value: q[j], low, high });
        }
    }
    match world.why_not(q, ToolContact::Allowed) {
        Some(hit) => Err(PipelineError::StartHit { hit: hit.to_string() }),
        None => Ok(()),
    }
}

/// A state's joint vector, if it says where every joint of the arm is.
fn posture(arm: &Arm, state: &collision::GroupState) -> Option<JointVector> {
    let mut q = [0.0; MAX_DOF];
    for (value, name) in q.iter_mut().zip(arm.joint_names()) {
        *value = state.joints.iter().find(|(joint, _)| joint == name)?.1;
    }
    Some(JointVector::new(q))
}
