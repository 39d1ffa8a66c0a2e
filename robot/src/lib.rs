//! Robot description for Nullsweep: URDF to chain, limits, forward and inverse kinematics.
//!
//! ```
//! use nullsweep_robot::{ArmSpec, Robot, Side, Solutions};
//!
//! let arm = Robot::pr2().arm(&ArmSpec::pr2(Side::Right))?;
//! let target = arm.tip_pose(&arm.home());
//! let mut solutions = Solutions::new();
//! arm.ik().solve(&target, arm.home()[2], &mut solutions);
//! assert!(solutions.iter().any(|s| arm.within_margins(&s.q)));
//! # Ok::<(), nullsweep_robot::ArmError>(())
//! ```
//!
//! Read the modules in this order, from the bottom: `urdf` (text to tree), `limits` (soft limits
//! and the braking margin that planner and executor share), `joints` (joint vectors), `lanes`
//! (elementary functions of four numbers at once), `chain`
//! (serial chain, poses, Jacobian), `ik` (closed forms for arms of known shapes, numeric for all
//! others), `arm` (tree and [`ArmSpec`] to chain and solvers). `fingerprint` names a robot and arm
//! in 64 bits so that a plan reaches only the robot it was made for. `pr2` is the PR2's own
//! description, `tool` the pad at the end of the arm.
//!
//! Everything speaks the robot's *root frame* (the one link without a parent joint; the PR2's
//! base_footprint: z up, x ahead) in SI units: metres, radians, seconds.

mod arm;
mod chain;
mod fingerprint;
mod ik;
mod joints;
mod lanes;
mod limits;
mod named;
mod pr2;
mod spec;
mod tool;
mod urdf;

pub use arm::{Arm, ArmError};
pub use chain::Jacobian;
pub use ik::{
    Branch, InverseKinematics, RedundantJoint, Solution, Solutions, damped_step, pose_error,
};
pub use joints::{Continuous, JointVector, MAX_DOF, wrap};
pub use limits::JointLimits;
pub use pr2::Side;
pub use spec::{ArmSpec, HeldJoint};
pub use tool::{Camera, Footprint, Mounted, Nozzle, Roller, Tool, ToolBody, ToolError};
pub use urdf::{
    CollisionShape, Geometry, HardLimits, Joint, JointKind, Link, Mimic, Robot, SafetyController,
    UrdfError,
};
