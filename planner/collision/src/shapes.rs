//! The parts' shapes placed by the robot crate's kinematics: what the exact check and the search for
//! the pairs to leave out measure.

use nalgebra::Isometry3;
use nullsweep_robot::{Arm, JointVector};
use parry3d_f64::math::{Pose, Rot3, Vec3};
use parry3d_f64::query;
use parry3d_f64::shape::Shape;

use crate::parts::Part;

/// The pose of every part in the root frame of a robot with so many links.
pub(crate) fn poses(parts: &[Part], links: usize, arm: &Arm, q: &JointVector) -> Vec<Pose> {
    let mut link_poses = vec![Isometry3::identity(); links];
    arm.link_poses(q, &mut link_poses);
    let tip = arm.tip_pose(q);
    let of = |part: &Part| part.link.map_or(tip, |link| link_poses[link]) * part.origin;
    parts.iter().map(|part| pose(&of(part))).collect()
}

/// The pose in parry's own mathematics (glam).
pub(crate) fn pose(pose: &Isometry3<f64>) -> Pose {
    let (t, r) = (pose.translation.vector, pose.rotation);
    Pose::from_parts(Vec3::new(t.x, t.y, t.z), Rot3::from_xyzw(r.i, r.j, r.k, r.w))
}

/// Distance between two shapes, 0 if they overlap. \[m\]
pub(crate) fn distance(at_a: &Pose, a: &dyn Shape, at_b: &Pose, b: &dyn Shape) -> f64 {
    // Every shape here is supported; a pair that were not would count as touching.
    query::distance(at_a, a, at_b, b).map_or(0.0, |found| found.distance)
}
