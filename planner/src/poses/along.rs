//! What a way along poses is like.

use nalgebra::{Isometry3, Point3};

use super::assemble::{Piece, Stop};
use super::space::{Point, RESIDUAL, Space};
use crate::sweep::{distance_to_segment, percentile};

/// The figures of a way, by its joint vectors alone.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Along {
    /// Poses that it meets.
    pub(crate) met: usize,
    /// Euclidean joint movement along the poses. \[rad\]
    pub(crate) movement: f64,
    /// Ways through free space.
    pub(crate) ways: usize,
    /// Farthest of any pose from being met, beyond its tolerance. \[m\] or \[rad\]
    pub(crate) excess: f64,
    /// How far the tool leaves the straight line between its places at two poses: 90th percentile over
    /// the largest of each two, and the largest. \[m\]
    pub(crate) deviation_p90: f64,
    pub(crate) deviation_max: f64,
    /// The largest change of a joint from a pose to the next, turning and sliding. \[rad\], \[m\]
    pub(crate) step: [f64; 2],
}

/// Looks between two knots.
const LOOKS: u32 = 8;

impl Along {
    /// Of pieces through these poses.
    pub(crate) fn of(space: &Space<'_>, poses: &[Isometry3<f64>], pieces: &[Piece]) -> Self {
        let mut all = Self::default();
        let (mut met, mut off) = (vec![false; poses.len()], Vec::new());
        for piece in pieces {
            let Piece::Along(stops) = piece else {
                all.ways += 1;
                continue;
            };
            for pair in stops.windows(2) {
                all.movement += pair[0].point.q.distance(&pair[1].point.q);
            }
            for stop in stops {
                let Some(pose) = stop.pose else { continue };
                let excess = space.excess(&poses[pose], &stop.point.tool).amax();
                all.excess = all.excess.max(excess);
                met[pose] |= excess < 10.0 * RESIDUAL;
            }
            for edge in edges(stops) {
                all.look(space, edge, &mut off);
            }
        }
        off.sort_by(f64::total_cmp);
        all.met = met.into_iter().filter(|met| *met).count();
        all.deviation_p90 = percentile(&off, 0.9);
        all.deviation_max = off.last().copied().unwrap_or(0.0);
        all
    }

    /// Looks at the way from a pose to the next.
    fn look(&mut self, space: &Space<'_>, edge: &[Stop], off: &mut Vec<f64>) {
        let (a, b) = (&edge[0].point, &edge[edge.len() - 1].point);
        for (j, limits) in space.arm.limits().iter().enumerate() {
            let step = (b.q[j] - a.q[j]).abs();
            let kind = usize::from(!(limits.continuous || space.arm.is_revolute(j)));
            self.step[kind] = self.step[kind].max(step);
        }
        let at = |point: &Point| Point3::from(point.tool.translation.vector);
        let looks = edge.windows(2).flat_map(|pair| {
            (0..LOOKS)
                .map(|k| pair[0].point.q.lerp(&pair[1].point.q, f64::from(k) / f64::from(LOOKS)))
        });
        let from_line = |q| distance_to_segment(&at(&space.point(q)), &at(a), &at(b));
        off.push(looks.map(from_line).fold(0.0, f64::max));
    }
}

/// The ways from each pose to the next, with what is between.
fn edges(stops: &[Stop]) -> impl Iterator<Item = &[Stop]> {
    let met: Vec<usize> = (0..stops.len()).filter(|&k| stops[k].pose.is_some()).collect();
    let pairs: Vec<[usize; 2]> = met.windows(2).map(|w| [w[0], w[1]]).collect();
    pairs.into_iter().map(|[a, b]| &stops[a..=b])
}
