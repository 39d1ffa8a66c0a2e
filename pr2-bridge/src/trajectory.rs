//! Messages to the arm's controller.

use crate::link::msgs::trajectory_msgs;
use crate::link::ros_time;
use crate::stream::{Joints, Message};

/// A message as the controller takes it.
pub fn trajectory(message: &Message, names: &[String]) -> trajectory_msgs::JointTrajectory {
    let mut out = trajectory_msgs::JointTrajectory::default();
    out.header.seq = message.sequence;
    out.header.stamp = ros_time(message.start_ns);
    out.joint_names = names.to_vec();
    out.points = message.points.iter().map(|p| point(&p.q, Some(&p.v), p.after_ns)).collect();
    out
}

/// A point; without velocities the controller goes straight.
pub fn point(
    q: &Joints,
    v: Option<&Joints>,
    after_ns: u64,
) -> trajectory_msgs::JointTrajectoryPoint {
    let time_from_start = roslibrust::codegen::integral_types::Duration {
        sec: (after_ns / 1_000_000_000) as i32,
        nsec: (after_ns % 1_000_000_000) as i32,
    };
    trajectory_msgs::JointTrajectoryPoint {
        positions: q.to_vec(),
        velocities: v.map_or_else(Vec::new, |v| v.to_vec()),
        time_from_start,
        ..Default::default()
    }
}
