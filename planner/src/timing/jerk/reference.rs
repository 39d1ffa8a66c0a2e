//! The run that is gone through: at even times, averaged.

use nullsweep_robot::JointVector;

use super::super::sampled::Timed;
use crate::plan::Curve;

/// The reference is averaged over so many nodes, one average after the other.
const AVERAGED: [usize; 2] = [7, 3];

/// A place of the reference.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) q: JointVector,
    pub(super) source: f64,
}

/// The run at even times, averaged, with as many places at rest at either end as the derivatives
/// and the spline's ends need.
pub(super) fn reference(run: &[Timed], step_ns: u64) -> Vec<Place> {
    let (first, last) = (&run[0], &run[run.len() - 1]);
    let span_ns = last.time_ns - first.time_ns;
    let count = span_ns.div_ceil(step_ns) as usize;
    let widest: usize = AVERAGED.iter().map(|width| width / 2).sum();
    let pad = 2 * widest + 3;
    let mut after = 1;
    let place = |k: usize| {
        let since = (k.saturating_sub(pad) as u64 * step_ns).min(span_ns) + first.time_ns;
        while after + 1 < run.len() && run[after].time_ns < since {
            after += 1;
        }
        let (a, b) = (&run[after - 1], &run[after]);
        let seconds = (b.time_ns - a.time_ns) as f64 * 1e-9;
        let share = ((since - a.time_ns) as f64 * 1e-9 / seconds).clamp(0.0, 1.0);
        let q = Curve::cubic((&a.q, &a.v), (&b.q, &b.v), seconds).at(share);
        Place { q, source: a.source + share * (b.source - a.source) }
    };
    let mut places: Vec<Place> = (0..=count + 2 * pad).map(place).collect();
    for width in AVERAGED {
        let half = width / 2;
        let whole = places.clone();
        for k in half..places.len() - half {
            let mut sum = JointVector::ZERO;
            // About the middle one, so that a place at rest stays bit for bit.
            for other in &whole[k - half..=k + half] {
                sum = sum + (other.q - whole[k].q);
            }
            places[k].q = JointVector::from_fn(|j| whole[k].q[j] + sum[j] / width as f64);
        }
    }
    // At rest there is nothing to go through.
    let trim = pad - widest - 3;
    places[trim..places.len() - trim].to_vec()
}
