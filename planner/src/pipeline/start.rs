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

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Vector3};
    use nullsweep_collision::Obstacle;
    use nullsweep_robot::{ArmSpec, Geometry, Robot, Side};

    use super::*;

    fn around(obstacles: &[Obstacle], job: &Job) -> (Arm, World) {
        let robot = Robot::pr2();
        let arm = robot.arm(&job.arm).unwrap();
        let world = World::new(&robot, &arm, &job.tool, &[], obstacles, &job.collision).unwrap();
        (arm, world)
    }

    #[test]
    fn an_arm_that_cannot_start_at_home_starts_where_it_is_free_and_that_is_told() {
        let job = Job::new(ArmSpec::pr2(Side::Right));
        let (arm, free) = around(&[], &job);
        let Start { q, is_makeshift, note } = start(&job, &arm, &free).unwrap();
        assert!((q, is_makeshift) == (arm.home(), false) && note.is_none(), "{note:?}");

        // A box where the hand is at home.
        let block = Obstacle {
            name: "block".into(),
            shape: Geometry::Box { half_extents: Vector3::repeat(0.05) }.into(),
            pose: Isometry3::from(arm.tip_pose(&arm.home()).translation),
            carries_robot: false,
        };
        let (arm, world) = around(std::slice::from_ref(&block), &job);
        assert!(!world.is_free(&arm.home(), ToolContact::Forbidden));
        let Start { q, is_makeshift, note } = start(&job, &arm, &world).unwrap();
        assert!(is_makeshift && world.is_free(&q, ToolContact::Forbidden));
        assert!(check(&arm, &world, &q).is_ok(), "outside of the limits");
        let note = note.expect("it is told");
        assert!(note.contains("cannot start at home") && note.contains("block"), "{note}");
        let told = format!("{:.2},{:.2}", q[0], q[1]);
        assert!(note.contains(&told), "{note} does not say {told}");

        // Whoever says where the arm is means it.
        let given = Job { start: Some(arm.home()), ..job.clone() };
        assert!(matches!(start(&given, &arm, &world), Err(PipelineError::StartHit { .. })));
        // Shut in by a block that holds the whole arm, it can start nowhere.
        let shape = Geometry::Box { half_extents: Vector3::repeat(3.0) }.into();
        let (arm, world) = around(&[Obstacle { shape, ..block }], &job);
        assert!(matches!(start(&job, &arm, &world), Err(PipelineError::StartHit { .. })));
    }
}
