//! Whether the arm can be where it is said to be.

use nullsweep_collision::{ToolContact, World};
use nullsweep_robot::{Arm, JointVector};

/// Why the arm cannot be at a joint vector: the joint beyond its limits, or what is too near to what.
pub(super) fn why_not_start(arm: &Arm, world: &World, q: &JointVector) -> Option<String> {
    let limits = arm.margined_limits().iter().zip(q.iter()).zip(arm.joint_names());
    let outside = limits.into_iter().find_map(|((&(low, high), q), name)| {
        let inside = (low..=high).contains(q);
        (!inside).then(|| format!("{name} is at {q:.4}, its range is {low:.4} to {high:.4}"))
    });
    outside.or_else(|| world.why_not(q, ToolContact::Allowed).map(|hit| hit.to_string()))
}
