//! How often the pad passes over each point.

use nullsweep_robot::Arm;
use serde::{Deserialize, Serialize};

use super::pads::contact_motion;
use super::percentile::percentile;
use super::sight::Sight;
use super::visit::{enough, visit_swept};
use crate::plan::Trajectory;

/// So many passes and more are counted together.
const MANY: usize = 8;

/// How often the pad passes over the points of the scan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Passes {
    /// In the median, of those that it sweeps.
    pub passes_p50: f64,
    /// 95th percentile.
    pub passes_p95: f64,
    /// How many points it passes over 0, 1, 2 … times; the last one: 8 times or more.
    #[serde(default)]
    pub passes_histogram: [usize; MANY + 1],
}

/// How often the pad passes over each point of a scan in some motions, all in one frame: a pass lasts from
/// when the pad comes over a point to when it has left it.
#[must_use]
pub fn passes_over<'a>(
    sight: impl Into<Sight<'a>>,
    motions: impl IntoIterator<Item = Trajectory<'a>>,
    arm: &Arm,
) -> Vec<u32> {
    let sight = sight.into();
    let points = sight.scan.points.len();
    let mut counts = vec![0; points];
    for motion in motions {
        let mut last = vec![None; points];
        let poses = enough(&contact_motion(motion, arm), motion.tool);
        visit_swept(sight, &poses, motion.tool, |pose, point| {
            counts[point] += u32::from(last[point].is_none_or(|last: usize| last + 1 != pose));
            last[point] = Some(pose);
        });
    }
    counts
}

impl Passes {
    /// Of how often the pad passes over each point.
    #[must_use]
    pub fn of(counts: &[u32]) -> Self {
        let mut passes_histogram = [0; MANY + 1];
        counts.iter().for_each(|count| passes_histogram[(*count as usize).min(MANY)] += 1);
        let swept = counts.iter().filter(|count| **count > 0).map(|count| f64::from(*count));
        let mut swept: Vec<f64> = swept.collect();
        swept.sort_by(f64::total_cmp);
        let [passes_p50, passes_p95] = [0.5, 0.95].map(|share| percentile(&swept, share));
        Self { passes_p50, passes_p95, passes_histogram }
    }
}
