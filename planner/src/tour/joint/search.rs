//! The order and the samples together.
//!
//! The few samples of each cluster that the solver of [`gtsp`](nullsweep_gtsp) works on are, at first,
//! spread over all of them. The order that it finds gets its best samples out of *all* by
//! [`Layers`]; then the samples through which a way leads that is about as cheap, some at each
//! heading, are the next few, and the solver goes on from the best tour.

use std::collections::HashMap;

use nullsweep_gtsp::{self as gtsp, Block, Budget, Control, Costs, Ends, Instance, Jump, Tour};
use nullsweep_robot::JointVector;

use super::layers::Layers;
use super::nodes::{Cluster, Metric};
use crate::cost::Cost;
use crate::roadmap::Graph;
use crate::tour::formulation::FormulationError;

/// How long is searched. All limits are counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointConfig {
    /// Samples of each cluster that the order's search sees.
    pub few: usize,
    /// Turns of order and samples at most.
    pub rounds: usize,
    /// Turns without a gain that end the search.
    pub idle: usize,
    /// Trials of the order's search for each cluster, in each turn.
    pub trials_per_cluster: u64,
}

impl Default for JointConfig {
    fn default() -> Self {
        Self { few: 36, rounds: 8, idle: 2, trials_per_cluster: 50 }
    }
}

/// What is to be visited.
pub struct Problem<'a, C> {
    /// Costs.
    pub metric: &'a Metric<'a, C>,
    /// The clusters, each with at least one sample.
    pub clusters: &'a [Cluster],
    /// For each cluster the ones that an edge joins it to.
    pub adjacent: &'a [Vec<usize>],
    /// Price in the order's search where no edge leads (Eq. 3's h).
    pub jump: f64,
    /// What a jump costs besides its straight joint motion.
    pub jump_extra: f64,
    /// Where the arm stands before; `None`: anywhere.
    pub source: Option<JointVector>,
    /// The cluster that is visited first.
    pub first: usize,
}

/// The tour found.
#[derive(Clone, Debug, PartialEq)]
pub struct JointTour {
    /// Clusters in visiting order.
    pub order: Vec<usize>,
    /// The sample chosen in each of them.
    pub choice: Vec<usize>,
    /// Cost from the source on, jumps at their straight motion and `jump_extra`.
    pub cost: f64,
    /// Samples of all clusters.
    pub samples: usize,
    /// Turns made.
    pub rounds: usize,
    /// Most bytes that samples, labels and stored costs took together.
    pub bytes: usize,
}

/// For each of `members`, patches of the graph, the places in `members` that an edge joins it to.
#[must_use]
pub fn adjacent(graph: &Graph, members: &[usize]) -> Vec<Vec<usize>> {
    let place: HashMap<usize, usize> = members.iter().enumerate().map(|(c, &p)| (p, c)).collect();
    let others = |&patch: &usize| {
        let edges = graph.incident[patch].iter();
        edges.filter_map(|&e| place.get(&graph.edges[e].other(patch)).copied()).collect()
    };
    members.iter().map(others).collect()
}

/// The cheapest tour found: the order by turns with the samples.
///
/// # Errors
/// A cost that is not a number.
pub fn solve<C: Cost>(
    problem: &Problem<'_, C>,
    config: &JointConfig,
    seed: u64,
) -> Result<JointTour, FormulationError> {
    let clusters = problem.clusters;
    let samples = clusters.iter().map(|c| c.samples().len()).sum();
    let mut few: Vec<Vec<usize>> = clusters.iter().map(|c| spread(c, config.few)).collect();
    let mut best: Option<JointTour> = None;
    let mut idle = 0;
    for round in 0..config.rounds.max(1) {
        let (order, stored) = problem.order(&few, best.as_ref(), config, seed + round as u64)?;
        let layers = problem.layers(&order);
        let forward = layers.forward();
        let (choice, cost) = layers.cheapest(&forward);
        let bytes = stored
            + clusters.iter().map(Cluster::bytes).sum::<usize>()
            + 2 * samples * size_of::<f32>();
        let bytes = best.as_ref().map_or(bytes, |b| b.bytes.max(bytes));
        if best.as_ref().is_none_or(|b| cost < b.cost * (1.0 - 1e-6)) {
            let backward = layers.backward();
            for (p, &c) in order.iter().enumerate() {
                few[c] = promising(&clusters[c], config.few, |i| forward[p][i] + backward[p][i]);
            }
            best = Some(JointTour { order, choice, cost, samples, rounds: round + 1, bytes });
            idle = 0;
        } else if let Some(best) = &mut best {
            best.rounds = round + 1;
            best.bytes = bytes;
            idle += 1;
        }
        if idle >= config.idle {
            break;
        }
    }
    Ok(best.expect("there is at least one round"))
}

impl<C: Cost> Problem<'_, C> {
    /// The order over the few samples and the bytes that its costs take.
    fn order(
        &self,
        few: &[Vec<usize>],
        from: Option<&JointTour>,
        config: &JointConfig,
        seed: u64,
    ) -> Result<(Vec<usize>, usize), FormulationError> {
        let at = |c: usize, k: usize| &self.clusters[c].samples()[few[c][k]];
        let mut blocks = Vec::new();
        for (a, near) in self.adjacent.iter().enumerate() {
            for &b in near.iter().filter(|b| **b > a) {
                let costs = (0..few[a].len())
                    .flat_map(|i| (0..few[b].len()).map(move |j| (i, j)))
                    .map(|(i, j)| self.metric.between(at(a, i), at(b, j)))
                    .collect();
                blocks.extend(Block::both_ways(a, b, few[a].len(), costs));
            }
        }
        let entries: usize = blocks.iter().map(|b| b.costs.len()).sum();
        // The instance's own, 8 bytes, and the search's, 4.
        let stored = entries * (size_of::<f64>() + size_of::<i32>());
        let sizes: Vec<usize> = few.iter().map(Vec::len).collect();
        let ends = Ends::OpenFromCluster(self.first);
        let jump = Jump::Uniform(self.jump);
        let instance = Instance::new(&sizes, Costs::Blocks(blocks), jump, ends)?;
        let start = from.map(|tour| Tour {
            clusters: tour.order.clone(),
            nodes: tour
                .order
                .iter()
                .zip(&tour.choice)
                .map(|(&c, i)| few[c].iter().position(|k| k == i).unwrap_or(0))
                .collect(),
        });
        let budget = Budget::trials(config.trials_per_cluster * sizes.len() as u64);
        let control = Control { start: start.as_ref(), ..Control::default() };
        let tour = gtsp::solve_with(&instance, &budget, seed, control)?.tour;
        Ok((tour.clusters, stored))
    }

    fn layers(&self, order: &[usize]) -> Layers<'_, C> {
        let jumps = |p: usize| p > 0 && !self.adjacent[order[p - 1]].contains(&order[p]);
        Layers {
            metric: self.metric,
            clusters: order.iter().map(|&c| &self.clusters[c]).collect(),
            extra: (0..order.len())
                .map(|p| if jumps(p) { self.jump_extra as f32 } else { 0.0 })
                .collect(),
            source: self.source.map(Cluster::at),
        }
    }
}

/// At most about `most` samples, spread over each heading's; at least one of each heading.
fn spread(cluster: &Cluster, most: usize) -> Vec<usize> {
    if cluster.samples().len() <= most {
        return (0..cluster.samples().len()).collect();
    }
    let each = (most / cluster.headings().count().max(1)).max(1);
    cluster
        .headings()
        .flat_map(|range| {
            let (start, count) = (range.start, range.len());
            let taken = each.min(count);
            (0..taken).map(move |k| start + (2 * k + 1) * count / (2 * taken))
        })
        .collect()
}

/// The samples of least value, about `most`, as many of each heading.
fn promising(cluster: &Cluster, most: usize, value: impl Fn(usize) -> f32) -> Vec<usize> {
    if cluster.samples().len() <= most {
        return (0..cluster.samples().len()).collect();
    }
    let each = (most / cluster.headings().count().max(1)).max(1);
    cluster
        .headings()
        .flat_map(|range| {
            let mut all: Vec<usize> = range.collect();
            all.sort_by(|&i, &j| value(i).total_cmp(&value(j)).then(i.cmp(&j)));
            all.truncate(each);
            all
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use nullsweep_robot::{Branch, Continuous, JointVector, MAX_DOF};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::cost::Effort;
    use crate::workcell::Sample;

    /// Clusters in rows of `width`, each joined to those around it. Their samples change evenly with
    /// the redundancy, as those of an arm do, and a little at random.
    fn grid(count: usize, width: usize, rng: &mut ChaCha8Rng) -> (Vec<Cluster>, Vec<Vec<usize>>) {
        let place = |c: usize| ((c % width) as f64, (c / width) as f64);
        let cluster = |c: usize, rng: &mut ChaCha8Rng| {
            let ((x, y), first) = (place(c), rng.random_range(-3.0..3.0));
            let sample = |i: usize, rng: &mut ChaCha8Rng| {
                let (heading, r) = ((i / 10) as f64, (i % 10) as f64 / 10.0);
                let mut q = [0.0; MAX_DOF];
                q[0] = 0.2 * x + 0.5 * r;
                q[1] = 0.3 * y - (0.4 + 0.1 * x) * r * r;
                q[2] = 0.1 * x * y + r;
                q[3] = first + heading * 0.8 + (1.0 - 0.2 * y) * r;
                q[..4].iter_mut().for_each(|q| *q += rng.random_range(-0.02..0.02));
                Sample { q: JointVector::new(q), branch: Branch(0), redundancy: r, heading }
            };
            Cluster::new((0..40).map(|i| sample(i, rng)).collect())
        };
        let near = |a: usize| {
            let close = |b: &usize| {
                let (p, q) = (place(a), place(*b));
                *b != a && (p.0 - q.0).abs() <= 1.0 && (p.1 - q.1).abs() <= 1.0
            };
            (0..count).filter(close).collect()
        };
        ((0..count).map(|c| cluster(c, rng)).collect(), (0..count).map(near).collect())
    }

    #[test]
    fn few_samples_in_turns_do_as_well_as_all_at_once() {
        let metric = &Metric::new(&Effort, Continuous::default(), 4, 0.0);
        for seed in 0..2 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let (clusters, adjacent) = grid(20, 5, &mut rng);
            let problem = Problem {
                metric,
                clusters: &clusters,
                adjacent: &adjacent,
                jump: 1e3,
                jump_extra: 0.0,
                source: None,
                first: 7,
            };
            let solve = |few: usize| {
                let config = JointConfig { few, ..JointConfig::default() };
                let tour = solve(&problem, &config, seed).expect("costs are numbers");
                let mut seen = tour.order.clone();
                seen.sort_unstable();
                assert_eq!(seen, (0..20).collect::<Vec<_>>());
                assert_eq!(tour.order[0], 7);
                assert!(tour.order.windows(2).all(|w| adjacent[w[0]].contains(&w[1])));
                assert!(
                    (problem.layers(&tour.order).cost_of(&tour.choice) - tour.cost).abs() < 1e-9
                );
                tour.cost
            };
            let (turns, whole) = (solve(8), solve(40));
            let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
            assert_eq!(alone.install(|| solve(8)), turns);
            assert!(turns < 1.05 * whole, "{turns} {whole}");
        }
    }
}
