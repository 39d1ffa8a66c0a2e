//! A piece as it is averaged, at even distances, and how it is bent aside.

use rayon::prelude::*;

use super::bend::Bend;
use super::piece::{Mean, Piece};
use super::spline;
use super::window::{Window, Windows};
use crate::workcell::Bed;

/// Farthest between two nodes. Whatever is shorter than some of them is unevenness of the scan, at which
/// the arm would slow down. \[m\]
const SPACING: f64 = 0.006;
/// Terms of an average of shifts.
const TAPS: usize = 64;

/// A piece as it is averaged, at even distances.
pub(super) struct Averaged {
    length: f64,
    nodes: Vec<(Mean, Window)>,
}

impl Averaged {
    /// A piece averaged by some windows.
    pub(super) fn new(piece: &Piece, windows: &Windows) -> Self {
        let length = piece.length();
        let count = steps(length);
        let node = |k: usize| {
            let u = length * k as f64 / count as f64;
            let window = windows.at(u);
            (piece.mean(u, window), window)
        };
        Self { length, nodes: (0..=count).into_par_iter().map(node).collect() }
    }

    /// How many nodes there are.
    pub(super) fn count(&self) -> usize {
        self.nodes.len()
    }

    /// Where a node is. \[m\]
    pub(super) fn place(&self, node: usize) -> f64 {
        self.length * node as f64 / (self.nodes.len() - 1) as f64
    }

    /// The node nearest to a place.
    pub(super) fn nearest(&self, u: f64) -> usize {
        let last = self.nodes.len() - 1;
        ((u / self.length * last as f64).round() as usize).min(last)
    }

    /// A node as it is averaged.
    pub(super) fn mean(&self, node: usize) -> &Mean {
        &self.nodes[node].0
    }

    /// The nodes bent aside, and laid onto the surface again.
    pub(super) fn bent(&self, bend: &Bend, bed: &Bed) -> Vec<Mean> {
        let own = |(k, (mean, _)): (usize, &(Mean, Window))| {
            let moved = mean.moved(&bend.at(self.place(k)));
            (moved, moved.laid(bed).unwrap_or(0.0))
        };
        let laid: Vec<(Mean, f64)> = self.nodes.par_iter().enumerate().map(own).collect();
        let shifted = |(k, (mean, _)): (usize, &(Mean, f64))| mean.shifted(self.shift(&laid, k));
        laid.iter().enumerate().map(shifted).collect()
    }

    /// By how much a node is shifted: averaged over as much as the pad's place.
    fn shift(&self, laid: &[(Mean, f64)], node: usize) -> f64 {
        let last = (laid.len() - 1) as f64;
        let reach = 0.5 * self.nodes[node].1.place / self.length * last;
        let (mut sum, mut total) = (0.0, 0.0);
        for tap in 0..TAPS {
            let t = (2.0 * tap as f64 + 1.0) / TAPS as f64 - 1.0;
            let weight = (1.0 - t * t).powi(2);
            let place = (node as f64 + reach * t).clamp(0.0, last);
            let k = (place as usize).min(laid.len() - 2);
            let share = place - k as f64;
            sum += weight * (laid[k].1 * (1.0 - share) + laid[k + 1].1 * share);
            total += weight;
        }
        sum / total
    }
}

/// How many steps there are from node to node of a piece of some length. \[m\]
pub(super) fn steps(length: f64) -> usize {
    (length / SPACING).ceil().max(1.0) as usize
}

/// The smooth way by some nodes: a cubic B-spline, which begins and ends in the first and the last one.
pub(super) struct Smooth<'a> {
    length: f64,
    nodes: &'a [Mean],
}

impl<'a> Smooth<'a> {
    /// By nodes at even distances along a way of some length; at least two. \[m\]
    pub(super) fn new(length: f64, nodes: &'a [Mean]) -> Self {
        Self { length, nodes }
    }

    /// At a place of it.
    pub(super) fn at(&self, u: f64) -> Mean {
        let last = self.nodes.len() - 1;
        let place = (u / self.length * last as f64).clamp(0.0, last as f64);
        let span = (place as usize).min(last - 1);
        let [a, b, c, d] = spline::weights(place - span as f64);
        let (start, end) = (span == 0, span + 1 == last);
        // Beyond an end it goes on straight.
        let before = if start { [2.0 * a, -a] } else { [0.0; 2] };
        let after = if end { [-d, 2.0 * d] } else { [0.0; 2] };
        let inner = [(span, b + before[0] + after[0]), (span + 1, c + before[1] + after[1])];
        let outer = [(!start).then(|| (span - 1, a)), (!end).then(|| (span + 2, d))];
        let all = inner.into_iter().chain(outer.into_iter().flatten());
        Mean::sum(all.map(|(k, weight)| (&self.nodes[k], weight)))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    fn way(height: impl Fn(usize) -> f64) -> Vec<Mean> {
        (0..=20).map(|k| Mean::at(Vector3::new(0.006 * k as f64, 0.0, height(k)))).collect()
    }

    fn height(nodes: &[Mean], u: f64) -> f64 {
        Smooth::new(0.12, nodes).at(u).pose().expect("a pose").translation.z
    }

    #[test]
    fn a_smooth_way_begins_and_ends_in_its_nodes_and_keeps_a_line() {
        let line = way(|k| 0.001 * k as f64);
        for u in [0.0, 0.0013, 0.006, 0.0571, 0.1187, 0.12] {
            assert!((height(&line, u) - u / 6.0).abs() < 1e-15, "{u}");
        }
        let bow = way(|k| (k as f64 - 10.0).powi(2) * 1e-4);
        assert!((height(&bow, 0.0) - 0.01).abs() < 1e-15);
        assert!((height(&bow, 0.12) - 0.01).abs() < 1e-15);
    }

    #[test]
    fn what_is_uneven_from_node_to_node_is_a_third_of_it_on_the_smooth_way() {
        let uneven = way(|k| if k % 2 == 0 { 1e-4 } else { -1e-4 });
        let most = (20..=100).map(|k| height(&uneven, 0.001 * f64::from(k)).abs());
        let most = most.fold(0.0, f64::max);
        assert!((most - 1e-4 / 3.0).abs() < 1e-9, "{most}");
    }
}
