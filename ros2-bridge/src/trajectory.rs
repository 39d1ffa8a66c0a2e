//! Messages to the arm's controller.

use nullsweep_bridge::{Goal, Message, Point, thin, wall_time};
use nullsweep_robot::JointVector;

use crate::messages::{
    Duration, Float64MultiArray, Header, JointTrajectory, JointTrajectoryPoint,
    MultiArrayDimension, MultiArrayLayout, Time,
};

/// ROS time of a moment on `CLOCK_MONOTONIC`.
pub fn ros_time(at_ns: u64) -> Time {
    let (sec, nanosec) = wall_time(at_ns);
    Time { sec, nanosec }
}

/// A message as a joint_trajectory_controller takes it. Its number goes as the frame, which no
/// controller reads: whoever records them sees one that was lost.
pub fn trajectory(message: &Message, names: &[String]) -> JointTrajectory {
    JointTrajectory {
        header: Header {
            stamp: ros_time(message.start_ns),
            frame_id: format!("nullsweep {}", message.sequence),
        },
        joint_names: names.to_vec(),
        points: message.points.iter().map(|p| point(p, names.len())).collect(),
    }
}

/// How far a whole plan's points may be from the motion that the controller makes of fewer. \[rad\] or \[m\]
const WITHIN: f64 = 2e-4;

/// A whole plan as a joint_trajectory_controller's action takes it; without velocities it goes straight.
/// Long messages are lost on the way to a busy machine, so points that the others explain are left out.
pub fn whole(goal: &Goal, names: &[String]) -> JointTrajectory {
    let point = |p: &Point| {
        let point = point(p, names.len());
        if goal.curved { point } else { JointTrajectoryPoint { velocities: Vec::new(), ..point } }
    };
    JointTrajectory {
        header: Header { stamp: ros_time(goal.start_ns), frame_id: goal.id.clone() },
        joint_names: names.to_vec(),
        points: thin(&goal.points, goal.curved, WITHIN).iter().map(point).collect(),
    }
}

/// Positions as a forward_position_controller takes them. Their number goes as the label, which no
/// controller reads either.
pub fn positions(number: u64, q: &JointVector, joints: usize) -> Float64MultiArray {
    let size = joints as u32;
    let row = MultiArrayDimension { label: format!("nullsweep {number}"), size, stride: size };
    Float64MultiArray {
        layout: MultiArrayLayout { dim: vec![row], data_offset: 0 },
        data: q[..joints].to_vec(),
    }
}

fn point(point: &Point, joints: usize) -> JointTrajectoryPoint {
    JointTrajectoryPoint {
        positions: point.q[..joints].to_vec(),
        velocities: point.v[..joints].to_vec(),
        time_from_start: Duration::from_ns(point.after_ns),
        ..JointTrajectoryPoint::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_has_its_joints_times_and_number() {
        let joint = |x: f64| JointVector::from_fn(|j| if j < 6 { x + j as f64 } else { 0.0 });
        let start_ns = nullsweep_ipc_types::ports::now_ns() + 50_000_000;
        let message = Message {
            sequence: 7,
            start_ns,
            points: vec![
                Point { after_ns: 10_000, q: joint(0.1), v: joint(0.5) },
                Point { after_ns: 1_250_000_000, q: joint(0.2), v: JointVector::ZERO },
            ],
        };
        let names: Vec<String> = (0..6).map(|j| format!("joint_{j}")).collect();
        let sent = trajectory(&message, &names);
        assert_eq!((sent.joint_names, sent.header.frame_id.as_str()), (names, "nullsweep 7"));
        let stamp = nullsweep_bridge::moment(sent.header.stamp.sec, sent.header.stamp.nanosec);
        assert!(stamp.abs_diff(start_ns) < 1_000_000, "{stamp} for {start_ns}");
        assert_eq!(sent.points[0].positions, [0.1, 1.1, 2.1, 3.1, 4.1, 5.1]);
        assert_eq!(sent.points[0].time_from_start, Duration { sec: 0, nanosec: 10_000 });
        assert_eq!(sent.points[1].time_from_start, Duration { sec: 1, nanosec: 250_000_000 });
        assert_eq!(sent.points[1].velocities, [0.0; 6]);
        let placed = positions(8, &joint(0.1), 6);
        assert_eq!(placed.data, sent.points[0].positions);
        assert_eq!(
            (placed.layout.dim[0].label.as_str(), placed.layout.dim[0].size),
            ("nullsweep 8", 6)
        );
    }
}
