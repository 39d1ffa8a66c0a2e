//! The pad's motion on the surface, as the executor will interpolate it.

use nalgebra::{Isometry3, Point3};
use nullsweep_robot::Arm;
use rayon::prelude::*;

use super::segment::distance_to_segment;
use crate::plan::Trajectory;

/// Joints move at most this far between two looks at the pad. \[rad\] or \[m\]
const PAD_STEP: f64 = 0.01;

/// A pad pose on the surface and how far its centre is from the planned line.
#[derive(Clone, Copy, Debug)]
pub struct Pad {
    /// Contact pose, root frame.
    pub pose: Isometry3<f64>,
    /// \[m\]
    pub deviation: f64,
}

/// The pad along every segment on the surface.
#[must_use]
pub fn pad_motion(path: Trajectory<'_>, arm: &Arm) -> Vec<Pad> {
    let tool = path.tool.on(arm);
    (1..path.knots.len())
        .into_par_iter()
        .flat_map_iter(|k| {
            let curve = path.curve(k);
            let line = path.line(k - 1).zip(path.line(k));
            let steps = if line.is_some() { curve.steps(PAD_STEP) } else { 0 };
            // Where the pad comes down, the segment's beginning is no other's end.
            let goes_on = k > 1 && path.knots[k - 2].line.is_some();
            let first = usize::from(goes_on);
            (first..=steps).filter_map(move |s| {
                let (from, to) = line?;
                let q = curve.at(s as f64 / steps as f64);
                let pose = tool.pose(&q);
                let pad = Point3::from(pose.translation.vector);
                // Between knots the pad may be a little ahead of the line's points, or behind.
                let around = [(k.checked_sub(2), k - 1), (Some(k), k + 1)];
                let deviation = around
                    .into_iter()
                    .filter_map(|(a, b)| Some((path.line(a?)?, path.line(b)?)))
                    .chain([(from, to)])
                    .map(|(a, b)| distance_to_segment(&pad, &a, &b))
                    .fold(f64::INFINITY, f64::min);
                Some(Pad { pose, deviation })
            })
        })
        .collect()
}

/// The dense contact poses of the motion on the surface, root frame.
#[must_use]
pub fn contact_motion(path: Trajectory<'_>, arm: &Arm) -> Vec<Isometry3<f64>> {
    pad_motion(path, arm).into_iter().map(|p| p.pose).collect()
}

#[cfg(test)]
mod tests {
    use nullsweep_robot::{ArmSpec, JointVector, Robot, Side, Tool};

    use super::*;
    use crate::plan::{PlanKnot, Profile};

    #[test]
    fn the_pad_is_seen_where_it_comes_down_each_time() {
        let arm = Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).expect("an arm");
        let tool = Tool::default();
        let knot = |index: u64, angle: f64, down: bool| {
            let mut q = JointVector::ZERO;
            q[0] = angle;
            let line = down.then(|| tool.on(&arm).pose(&q).translation.vector.into());
            let time_ns = index * 1_000_000_000;
            PlanKnot { time_ns, q, v: JointVector::ZERO, line, patch: None }
        };
        // Down twice, the second time over two segments.
        let down = [true, true, false, true, true, true];
        let knots: Vec<PlanKnot> =
            (0..6).map(|k| knot(k, 0.008 * k as f64, down[k as usize])).collect();
        let path = Trajectory { tool: &tool, profile: Profile::Velocity, knots: &knots };
        let seen = contact_motion(path, &arm);
        let touching = knots.iter().filter(|k| k.line.is_some()).map(|k| tool.on(&arm).pose(&k.q));
        let expected: Vec<Isometry3<f64>> = touching.collect();
        assert_eq!(seen.len(), expected.len(), "one look a knot, each of them once");
        for (seen, expected) in seen.iter().zip(&expected) {
            assert!((seen.translation.vector - expected.translation.vector).norm() < 1e-12);
        }
    }
}
