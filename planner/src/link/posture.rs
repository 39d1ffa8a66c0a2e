//! Where the arm is.

use std::time::Duration;

use nullsweep_ipc_types::ports::{Ipc, IpcError};
use nullsweep_ipc_types::{JointArray, Mode};
use nullsweep_robot::{Arm, Joint, JointKind, JointVector, MAX_DOF};

use crate::link::publish::{PublishError, newest_telemetry};
use crate::link::site::Site;

/// A difference between where a joint is held and where it is measured that a user should know.
/// \[rad\] or \[m\]
const NOTABLE: f64 = 0.02;

/// An arm at rest.
#[derive(Clone, Debug, PartialEq)]
pub struct Posture {
    /// Where the executor holds it, from where it begins every motion. \[rad\] or \[m\]
    pub q: JointVector,
    /// The knot in which the last plan was ended before its end, if it was.
    pub stopped: Option<usize>,
    /// Where the held joints are measured, in the URDF's order. \[rad\] or \[m\]
    pub held: Vec<f64>,
    /// What a user should know: joints that are measured elsewhere.
    pub notes: Vec<String>,
}

/// Why nobody knows where the arm is.
#[derive(Debug, thiserror::Error)]
pub enum PostureError {
    /// The services cannot be opened.
    #[error(transparent)]
    Ipc(#[from] IpcError),
    /// The executor says nothing.
    #[error(transparent)]
    Publish(#[from] PublishError),
    /// The arm moves, or is not held.
    #[error("the arm is not at rest in the executor's hold: its mode is {}", .0.text())]
    NotHeld(Mode),
    /// Another arm is executed for.
    #[error("the executor's arm has {found} joints, the arm given has {joints}")]
    OtherArm {
        /// Joints of the executor's arm.
        found: u32,
        /// Joints of the arm given.
        joints: usize,
    },
}

/// Where the executor holds the arm, and that it is measured there: the executor itself sees to that
/// within its following error.
///
/// # Errors
/// See [`PostureError`].
pub fn posture(site: Site<'_>, arm: &Arm, patience: Duration) -> Result<Posture, PostureError> {
    let telemetry = newest_telemetry(&Ipc::open(site.robot, site.root)?, patience)?;
    let mode = Mode::from_wire(telemetry.mode).unwrap_or(Mode::Init);
    if mode != Mode::Hold {
        return Err(PostureError::NotHeld(mode));
    }
    let (found, joints) = (telemetry.joint_count, arm.dof());
    if found as usize != joints {
        return Err(PostureError::OtherArm { found, joints });
    }
    let (q, measured) = (vector(&telemetry.commanded), vector(&telemetry.measured));
    let apart = arm.continuous().displacement(&q, &measured);
    let notes = arm.joint_names().iter().zip(&apart).enumerate();
    let notes = notes.filter(|(_, (_, apart))| apart.abs() > NOTABLE).map(|(j, (name, apart))| {
        let unit = unit(arm, j);
        format!("{name} is measured {:.3} {unit} from where it is held", apart.abs())
    });
    let stopped = (telemetry.stopped != 0).then_some(telemetry.knot as usize);
    let held =
        telemetry.held_positions.iter().take(telemetry.held_count as usize).copied().collect();
    Ok(Posture { q, stopped, held, notes: notes.collect() })
}

/// What a held joint's position is counted in.
#[must_use]
pub fn unit_of_held(arm: &Arm, name: &str) -> &'static str {
    let is = |j: &Joint| j.name == name && j.kind == JointKind::Prismatic;
    if arm.robot().joints().iter().any(is) { "m" } else { "rad" }
}

/// What a joint's position is counted in.
#[must_use]
pub fn unit(arm: &Arm, joint: usize) -> &'static str {
    if arm.is_revolute(joint) { "rad" } else { "m" }
}

fn vector(array: &JointArray) -> JointVector {
    let mut q = JointVector::ZERO;
    q.copy_from_slice(&array[..MAX_DOF]);
    q
}
