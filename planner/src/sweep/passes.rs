//! How often the pad passes over each point.

use nullsweep_robot::{Arm, Tool};
use nullsweep_surface::Scan;
use serde::{Deserialize, Serialize};

use super::coverage::visit_swept;
use super::pads::contact_motion;
use super::percentile::percentile;
use crate::plan::Trajectory;

/// How often the pad passes over the points that it sweeps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Passes {
    /// In the median.
    pub passes_p50: f64,
    /// 95th percentile.
    pub passes_p95: f64,
}

/// Counts the passes of a motion over the swept points of a scan, both in one frame: a pass lasts
/// from when the pad comes over a point to when it has left it.
#[must_use]
pub fn passes(scan: &Scan, motion: Trajectory<'_>, arm: &Arm) -> Passes {
    let tool: &Tool = motion.tool;
    let mut counts = vec![(0usize, usize::MAX); scan.points.len()];
    visit_swept(scan, &contact_motion(motion, arm), tool, |pose, point| {
        let (count, last) = &mut counts[point];
        *count += usize::from(last.wrapping_add(1) != pose || *count == 0);
        *last = pose;
    });
    let swept = counts.iter().map(|(count, _)| *count as f64).filter(|count| *count > 0.0);
    let mut swept: Vec<f64> = swept.collect();
    swept.sort_by(f64::total_cmp);
    Passes { passes_p50: percentile(&swept, 0.5), passes_p95: percentile(&swept, 0.95) }
}
