//! Messages to the arm's controller.

use nullsweep_bridge::{Goal, Message, Point};
use nullsweep_ipc_types::ports::now_ns;

use crate::link::msgs::{control_msgs, trajectory_msgs};
use crate::link::ros_time;

/// A message as the controller takes it.
pub fn trajectory(message: &Message, names: &[String]) -> trajectory_msgs::JointTrajectory {
    let mut out = trajectory_msgs::JointTrajectory::default();
    out.header.seq = message.sequence;
    out.header.stamp = ros_time(message.start_ns);
    out.joint_names = names.to_vec();
    out.points = message.points.iter().map(|p| point(p, names.len(), true)).collect();
    out
}

/// A whole plan as the controller's action takes it.
pub fn action_goal(goal: &Goal, names: &[String]) -> control_msgs::FollowJointTrajectoryActionGoal {
    let mut out = control_msgs::FollowJointTrajectoryActionGoal::default();
    out.header.stamp = ros_time(now_ns());
    out.goal_id.stamp = out.header.stamp.clone();
    out.goal_id.id = goal.id.clone();
    out.goal.trajectory.header.stamp = ros_time(goal.start_ns);
    out.goal.trajectory.joint_names = names.to_vec();
    out.goal.trajectory.points =
        goal.points.iter().map(|p| point(p, names.len(), goal.curved)).collect();
    out
}

/// A point of so many joints; without velocities the controller goes straight.
fn point(point: &Point, dof: usize, curved: bool) -> trajectory_msgs::JointTrajectoryPoint {
    let time_from_start = roslibrust::codegen::integral_types::Duration {
        sec: (point.after_ns / 1_000_000_000) as i32,
        nsec: (point.after_ns % 1_000_000_000) as i32,
    };
    trajectory_msgs::JointTrajectoryPoint {
        positions: point.q[..dof].to_vec(),
        velocities: if curved { point.v[..dof].to_vec() } else { Vec::new() },
        time_from_start,
        ..Default::default()
    }
}
