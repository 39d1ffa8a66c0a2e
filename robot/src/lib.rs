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
//! The way through the crate: `urdf` (text to tree) → `arm` (tree to serial chain, poses,
//! Jacobian) → `limits` (soft limits and the braking margin that planner and executor share) →
//! `ik` (closed forms for arms of known shapes, numeric for all others). `fingerprint` names a robot
//! and arm in 64 bits so that a plan reaches only the robot it was made for.
//!
//! Everything speaks the robot's *root frame* (the one link without a parent joint; the PR2's
//! base_footprint: z up, x ahead) in SI units: metres, radians, seconds.

mod arm;
mod chain;
mod fingerprint;
mod ik;
mod joints;
mod limits;
mod pr2;
mod tool;
mod urdf;

pub use arm::{Arm, ArmError, ArmSpec, HeldJoint, Jacobian};
pub use ik::{Branch, InverseKinematics, RedundantJoint, Solution, Solutions};
pub use joints::{Continuous, JointVector, MAX_DOF, wrap};
pub use limits::{JointLimits, LimitsError};
pub use pr2::Side;
pub use tool::{Mounted, Tool};
pub use urdf::{
    CollisionShape, Geometry, HardLimits, Joint, JointKind, Link, Mimic, Robot, SafetyController,
    UrdfError,
};
