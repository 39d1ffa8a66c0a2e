//! The pad's motion on the surface, as the executor will interpolate it.

use nalgebra::{Isometry3, Point3};
use nullsweep_robot::Arm;
use rayon::prelude::*;

use crate::plan::Plan;

/// Joints move at most this far between two looks at the pad. \[rad\] or \[m\]
const PAD_STEP: f64 = 0.01;

/// A pad pose on the surface and how far its centre is from the planned line.
pub struct Pad {
    /// Contact pose, root frame.
    pub pose: Isometry3<f64>,
    /// \[m\]
    pub deviation: f64,
}

/// The pad along every segment on the surface, as the executor will interpolate it.
#[must_use]
pub fn pad_motion(plan: &Plan, arm: &Arm) -> Vec<Pad> {
    let contact_in_tip = plan.tool.contact_in_tip();
    (1..plan.knots.len())
        .into_par_iter()
        .flat_map_iter(|k| {
            let curve = plan.curve(k);
            let line = plan.line(k - 1).zip(plan.line(k));
            let steps = if line.is_some() { curve.steps(PAD_STEP) } else { 0 };
            let first = usize::from(k > 1 && plan.knots[k - 1].line.is_some());
            (first..=steps).filter_map(move |s| {
                let (from, to) = line?;
                let q = curve.at(s as f64 / steps as f64);
                let pose = arm.tip_pose(&q) * contact_in_tip;
                let pad = Point3::from(pose.translation.vector);
                // Between knots the pad may be a little ahead of the line's points, or behind.
                let around = [(k.checked_sub(2), k - 1), (Some(k), k + 1)];
                let deviation = around
                    .into_iter()
                    .filter_map(|(a, b)| Some((plan.line(a?)?, plan.line(b)?)))
                    .chain([(from, to)])
                    .map(|(a, b)| to_segment(&pad, &a, &b))
                    .fold(f64::INFINITY, f64::min);
                Some(Pad { pose, deviation })
            })
        })
        .collect()
}

/// The dense contact poses of the plan's motion on the surface, root frame.
#[must_use]
pub fn contact_motion(plan: &Plan, arm: &Arm) -> Vec<Isometry3<f64>> {
    pad_motion(plan, arm).into_iter().map(|p| p.pose).collect()
}

fn to_segment(p: &Point3<f64>, a: &Point3<f64>, b: &Point3<f64>) -> f64 {
    let along = b - a;
    let length = along.norm_squared();
    let share = if length > 0.0 { ((p - a).dot(&along) / length).clamp(0.0, 1.0) } else { 0.0 };
    (p - (a + along * share)).norm()
}
