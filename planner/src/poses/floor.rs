//! What is taken where nothing is said: the floor, and the tool.

use nalgebra::{Isometry3, Vector3};
use nullsweep_robot::Tool;

/// The floor where nothing is said of it, in the robot's root frame: z = 0, or so far under the tool
/// at the lowest pose that it keeps its margin. \[m\]
#[must_use]
pub fn floor_under(poses: &[Isometry3<f64>], tool: &Tool, margin: f64) -> f64 {
    let half = Vector3::new(0.5 * tool.width, 0.5 * tool.length, 0.0);
    let lowest = |pose: &Isometry3<f64>| {
        let down = pose.rotation.inverse_transform_vector(&-Vector3::z());
        let front = pose.translation.vector.z - down.abs().dot(&half);
        // The pad's back lies its thickness behind its plane, against z.
        front - (tool.thickness * -down.z).max(0.0)
    };
    poses.iter().map(lowest).fold(0.0, |floor, lowest| floor.min(lowest - FLOOR_SLACK - margin))
}

/// What a tool may be lower than its pose asks, by the tolerance of the pose. \[m\]
const FLOOR_SLACK: f64 = 0.001;

/// A tool for poses that speak of the tip frame itself: a cube of 1 cm behind its origin, z ahead.
#[must_use]
pub fn tip_tool() -> Tool {
    Tool {
        name: "tip".into(),
        length: 0.01,
        width: 0.01,
        thickness: 0.01,
        centre: [0.0; 3],
        approach: [0.0, 0.0, 1.0],
        across: [0.0, 1.0, 0.0],
        symmetric: false,
        ..Tool::default()
    }
}
