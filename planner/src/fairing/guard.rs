//! A point of the surface that the pad must come over at a place of its way.

use nalgebra::{Isometry3, Point3, Vector2};
use nullsweep_robot::Tool;

/// How much within its rectangle the pad is to have the point. \[m\]
const WITHIN: f64 = 0.001;

/// A point that the pad must come over.
#[derive(Clone, Copy, Debug)]
pub(super) struct Guard {
    /// Where along the piece. \[m\]
    pub(super) u: f64,
    pub(super) point: Point3<f64>,
}

impl Guard {
    /// How far along its x and y a pad at a pose would have to go to come over the point.
    pub(super) fn short(&self, pose: &Isometry3<f64>, tool: &Tool) -> Vector2<f64> {
        short(&self.point, pose, tool, WITHIN)
    }
}

/// How far a pad at a pose is from being over a point; 0 where it is. \[m\]
pub(super) fn missed_by(point: &Point3<f64>, pose: &Isometry3<f64>, tool: &Tool) -> f64 {
    short(point, pose, tool, 0.0).norm()
}

fn short(point: &Point3<f64>, pose: &Isometry3<f64>, tool: &Tool, within: f64) -> Vector2<f64> {
    let at = pose.inverse_transform_point(point);
    let over = |offset: f64, side: f64| {
        let most = (0.5 * side - within).max(0.0);
        offset - offset.clamp(-most, most)
    };
    Vector2::new(over(at.x, tool.width), over(at.y, tool.length))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_beside_the_pad_is_missed_by_its_distance_from_the_border() {
        let tool = Tool::default();
        let pose = Isometry3::translation(1.0, 0.0, 0.0);
        let guard = |x: f64, y: f64| Guard { u: 0.0, point: Point3::new(1.0 + x, y, 0.002) };
        assert_eq!(guard(0.03, -0.045).short(&pose, &tool), Vector2::zeros());
        let short = guard(0.02, -0.06).short(&pose, &tool);
        assert!(short.x == 0.0 && (short.y + 0.011).abs() < 1e-12, "{short}");
        let missed = missed_by(&guard(0.038, 0.054).point, &pose, &tool);
        assert!((missed - 0.005).abs() < 1e-12, "{missed}");
    }
}
