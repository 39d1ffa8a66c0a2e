//! The cheapest samples for a given order (paper §IV, Fig. 5), nothing checked between them.

use rayon::prelude::*;
use wide::f32x8;

use super::nodes::{Cluster, Metric};
use crate::cost::Cost;
use crate::workcell::Sample;

/// Costs for one layer to the next from which on threads share the work.
const WORTH_SHARING: usize = 100_000;

/// Clusters in the order in which they are visited.
pub struct Layers<'a, C> {
    /// Costs.
    pub metric: &'a Metric<'a, C>,
    /// The layers.
    pub clusters: Vec<&'a Cluster>,
    /// Added to the way into each layer: what a jump costs besides its motion. The first is the
    /// way from the source.
    pub extra: Vec<f32>,
    /// Where the arm stands before; `None`: the start is free.
    pub source: Option<Cluster>,
}

/// For each layer and sample the cost of the cheapest way to it, or from it to the end.
pub type Labels = Vec<Vec<f32>>;

impl<'a, C: Cost> Layers<'a, C> {
    /// The cheapest way from the source to each sample.
    #[must_use]
    pub fn forward(&self) -> Labels {
        let mut labels: Labels = Vec::with_capacity(self.clusters.len());
        for p in 0..self.clusters.len() {
            let here = self.clusters[p];
            let next = match (p.checked_sub(1), &self.source) {
                (Some(b), _) => self.step(self.clusters[b], &labels[b], self.extra[p], here),
                (None, Some(source)) => self.step(source, &[0.0], self.extra[p], here),
                (None, None) => vec![0.0; here.samples().len()],
            };
            labels.push(next);
        }
        labels
    }

    /// The cheapest way from each sample to the end of the last layer.
    #[must_use]
    pub fn backward(&self) -> Labels {
        let mut labels: Labels = Vec::with_capacity(self.clusters.len());
        for p in (0..self.clusters.len()).rev() {
            let here = self.clusters[p];
            let next = match labels.last() {
                Some(after) => self.step(self.clusters[p + 1], after, self.extra[p + 1], here),
                None => vec![0.0; here.samples().len()],
            };
            labels.push(next);
        }
        labels.reverse();
        labels
    }

    /// The samples of the cheapest way, one a layer, and its cost.
    #[must_use]
    pub fn cheapest(&self, forward: &Labels) -> (Vec<usize>, f64) {
        let mut choice = Vec::with_capacity(forward.len());
        let mut after: Option<&Sample> = None;
        for p in (0..forward.len()).rev() {
            let samples = self.clusters[p].samples();
            let value = |i: usize| {
                let step = after.map_or(0.0, |next| self.metric.between(&samples[i], next));
                f64::from(forward[p][i]) + step
            };
            let values = (0..samples.len()).map(|i| (value(i), i));
            let (_, best) = values.fold((f64::INFINITY, 0), |m, v| if v.0 < m.0 { v } else { m });
            choice.push(best);
            after = Some(&samples[best]);
        }
        choice.reverse();
        let cost = self.cost_of(&choice);
        (choice, cost)
    }

    /// The cost of a choice of samples, in double precision.
    #[must_use]
    pub fn cost_of(&self, choice: &[usize]) -> f64 {
        let at = |p: usize| &self.clusters[p].samples()[choice[p]];
        (0..choice.len())
            .map(|p| {
                let step = match (p.checked_sub(1), &self.source) {
                    (Some(b), _) => self.metric.between(at(b), at(p)),
                    (None, Some(source)) => self.metric.between(&source.samples()[0], at(p)),
                    (None, None) => 0.0,
                };
                step + f64::from(self.extra[p])
            })
            .sum()
    }

    /// Labels of `to` by way of `from`.
    fn step(&self, from: &Cluster, labels: &[f32], extra: f32, to: &Cluster) -> Vec<f32> {
        let count = to.samples().len();
        let mut out = vec![f32x8::splat(f32::INFINITY); to.eights()];
        if from.samples().len() * count < WORTH_SHARING {
            self.metric.relax(from, labels, extra, to, 0, &mut out);
        } else {
            let share = to.eights().div_ceil(2 * rayon::current_num_threads());
            out.par_chunks_mut(share).enumerate().for_each(|(k, out)| {
                self.metric.relax(from, labels, extra, to, k * share, out);
            });
        }
        out.into_iter().flat_map(f32x8::to_array).take(count).collect()
    }
}

#[cfg(test)]
mod tests {
    use nullsweep_robot::{Branch, Continuous, JointVector, MAX_DOF};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::cost::Effort;

    fn cluster(rng: &mut ChaCha8Rng) -> Cluster {
        let count = rng.random_range(1..30);
        let sample = |i: usize, rng: &mut ChaCha8Rng| {
            let mut q = [0.0; MAX_DOF];
            q[..7].fill_with(|| rng.random_range(-3.0..3.0));
            let branch = Branch(rng.random_range(0..2));
            Sample { q: JointVector::new(q), branch, redundancy: 0.0, heading: (i / 5) as f64 }
        };
        Cluster::new((0..count).map(|i| sample(i, rng)).collect())
    }

    #[test]
    fn labels_of_both_ways_agree_with_plain_relaxation() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut continuous = [false; MAX_DOF];
        continuous[4] = true;
        for _ in 0..20 {
            let clusters: Vec<Cluster> = (0..6).map(|_| cluster(&mut rng)).collect();
            let metric = &Metric::new(&Effort, Continuous::new(continuous), 7, 2.5);
            let layers = Layers {
                metric,
                clusters: clusters.iter().collect(),
                extra: (0..6).map(|p| if p == 3 { 4.0 } else { 0.0 }).collect(),
                source: Some(Cluster::new(clusters[0].samples()[..1].to_vec())),
            };
            let mut plain: Vec<f64> = clusters[0]
                .samples()
                .iter()
                .map(|s| metric.between(&clusters[0].samples()[0], s))
                .collect();
            for p in 1..6 {
                plain = clusters[p]
                    .samples()
                    .iter()
                    .map(|to| {
                        let steps = clusters[p - 1].samples().iter().zip(&plain);
                        steps
                            .map(|(from, label)| {
                                label + metric.between(from, to) + f64::from(layers.extra[p])
                            })
                            .fold(f64::INFINITY, f64::min)
                    })
                    .collect();
            }
            let expected = plain.iter().copied().fold(f64::INFINITY, f64::min);
            let (forward, backward) = (layers.forward(), layers.backward());
            let (choice, cost) = layers.cheapest(&forward);
            assert!((cost - expected).abs() < 1e-4, "{cost} {expected}");
            assert!((layers.cost_of(&choice) - cost).abs() < 1e-12);
            for p in 0..6 {
                let through = forward[p][choice[p]] + backward[p][choice[p]];
                assert!((f64::from(through) - expected).abs() < 1e-4, "{p}: {through}");
            }
        }
    }
}
