//! A trajectory that is to be followed.

use std::time::Instant;

use nullsweep_bridge::Waypoint;
use nullsweep_ipc_types::ports::now_ns;
use nullsweep_robot::JointVector;
use ros2_client::action::GoalId;
use ros2_client::service::RmwRequestId;

use crate::messages::JointTrajectory;

/// What is to be followed next.
pub(crate) struct Wish {
    /// `None`: it came on the topic, and nobody waits for its end.
    pub(crate) goal: Option<(RmwRequestId, GoalId)>,
    pub(crate) points: Vec<Waypoint>,
    /// When it is to begin. \[ns\]
    pub(crate) begins_ns: u64,
    /// From when on it waits: it came, and is to begin.
    pub(crate) since: Instant,
}

impl Wish {
    /// Whether its time has come.
    pub(crate) fn is_due(&self) -> bool {
        now_ns() >= self.begins_ns
    }
}

/// A trajectory's points in the arm's order; `None` for one of other joints.
pub(crate) fn waypoints(trajectory: &JointTrajectory, names: &[String]) -> Option<Vec<Waypoint>> {
    let count = trajectory.joint_names.len();
    if count != names.len() {
        return None;
    }
    let place = |name: &String| trajectory.joint_names.iter().position(|n| n == name);
    let order: Vec<usize> = names.iter().map(place).collect::<Option<_>>()?;
    let read =
        |values: &[f64]| JointVector::from_fn(|j| order.get(j).map_or(0.0, |&from| values[from]));
    let points = trajectory.points.iter().map(|p| {
        let sized = p.positions.len() == count
            && (p.velocities.is_empty() || p.velocities.len() == count)
            && p.time_from_start.sec >= 0;
        sized.then(|| Waypoint {
            after_ns: p.time_from_start.sec as u64 * 1_000_000_000
                + u64::from(p.time_from_start.nanosec),
            q: read(&p.positions),
            v: (!p.velocities.is_empty()).then(|| read(&p.velocities)),
        })
    });
    points.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::{Duration, JointTrajectoryPoint};

    #[test]
    fn joints_come_in_any_order_and_all_of_them() {
        let names = ["a", "b", "c"].map(String::from);
        let point = |positions: &[f64], velocities: &[f64]| JointTrajectoryPoint {
            positions: positions.to_vec(),
            velocities: velocities.to_vec(),
            time_from_start: Duration { sec: 1, nanosec: 5 },
            ..JointTrajectoryPoint::default()
        };
        let trajectory = |joints: &[&str], points: Vec<JointTrajectoryPoint>| JointTrajectory {
            joint_names: joints.iter().map(|j| j.to_string()).collect(),
            points,
            ..JointTrajectory::default()
        };
        let turned = trajectory(&["c", "a", "b"], vec![point(&[3.0, 1.0, 2.0], &[0.3, 0.1, 0.2])]);
        let found = waypoints(&turned, &names).expect("points");
        assert_eq!(
            (found[0].q[..3].to_vec(), found[0].after_ns),
            (vec![1.0, 2.0, 3.0], 1_000_000_005)
        );
        assert_eq!(found[0].v.expect("some")[..3], [0.1, 0.2, 0.3]);
        for other in [
            trajectory(&["a", "b"], vec![point(&[1.0, 2.0], &[])]),
            trajectory(&["a", "b", "d"], vec![point(&[1.0, 2.0, 3.0], &[])]),
            trajectory(&["a", "b", "c"], vec![point(&[1.0, 2.0], &[])]),
            trajectory(&["a", "b", "c"], vec![point(&[1.0, 2.0, 3.0], &[1.0])]),
        ] {
            assert!(waypoints(&other, &names).is_none(), "{other:?}");
        }
    }
}
