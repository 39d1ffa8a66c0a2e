//! What no plan through given stops costs less than.
//!
//! Whatever the arm does from one joint vector to another, it costs at least the straight motion, of
//! continuous joints the shorter way round. So the cheapest order and choice of joint vectors at
//! straight costs, an open path from where the arm is, costs no more than any plan that comes through
//! one of them at each place. Joint vectors that lie close together are taken as one, and between two
//! groups the nearest two count, which only makes ways cheaper. What is left is a generalised travelling
//! salesman's instance, whose bound is that of [`nullsweep_gtsp`].

use nullsweep_gtsp::{self as gtsp, Budget, Control, Costs, Ends, Instance, Jump, Tour};
use nullsweep_robot::{Continuous, JointVector};
use serde::{Deserialize, Serialize};

use super::groups::Groups;
use super::stops::Stops;
use crate::cost::Cost;
use crate::tour::joint::{Cluster, Layers, Metric};
use crate::workcell::Sample;

/// How much is done for a bound. All limits are counts: the bound depends on nothing else.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ascent {
    /// Groups of joint vectors in all, but at least one a place.
    pub groups: usize,
    /// Steps of the bound's ascent.
    pub steps: u64,
    /// Trials of the search for the cheapest way through the groups, for each place.
    pub trials_per_place: u64,
}

impl Default for Ascent {
    fn default() -> Self {
        Self { groups: 1200, steps: 3000, trials_per_place: 20 }
    }
}

/// A bound, and how high it can be at most.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Least {
    /// No way through the stops costs less.
    pub bound: f64,
    /// What a way through all of them costs by straight motions, whatever it meets: no bound by
    /// straight motions is higher.
    pub straight: f64,
}

/// What every way from the start through one sample of each place costs at least; `None` without
/// places, where one has no samples, and for more than 698 of them.
#[must_use]
pub fn least<C: Cost>(
    cost: &C,
    continuous: Continuous,
    dof: usize,
    stops: &Stops,
    ascent: &Ascent,
) -> Option<Least> {
    let Stops { start, samples, order, .. } = stops;
    if samples.is_empty() || samples.iter().any(Vec::is_empty) {
        return None;
    }
    // Whole turns make no difference; without them single precision is enough.
    let wound = |sample: &Sample| Sample {
        q: continuous.nearest_turn(&sample.q, &JointVector::ZERO),
        ..*sample
    };
    let places: Vec<Cluster> =
        samples.iter().map(|at| Cluster::new(at.iter().map(wound).collect())).collect();
    let metric = Metric::new(cost, continuous, dof, 0.0);
    let groups = Groups::new(cost, &metric, &places, ascent.groups);
    let web = Web::new(&groups, start)?;
    let tour = web.search(&web.along(&groups, order), ascent)?;
    let effort = gtsp::Effort { steps: ascent.steps, time: None };
    let bound = gtsp::lower_bound(&web.instance, &tour, effort)? + web.held;
    let straight = straight(&metric, &places, &web.order(&tour), start);
    Some(Least { bound: bound.max(0.0), straight })
}

/// What straight motions through the places in an order cost, at the best samples.
fn straight<C: Cost>(
    metric: &Metric<'_, C>,
    places: &[Cluster],
    order: &[usize],
    start: &JointVector,
) -> f64 {
    let layers = Layers {
        metric,
        clusters: order.iter().map(|&place| &places[place]).collect(),
        extra: vec![0.0; order.len()],
        source: Some(Cluster::at(*start)),
    };
    layers.cheapest(&layers.forward()).1
}

/// The groups as an instance. An open path becomes a closed tour, costs staying symmetric: by two
/// clusters of one node more, the start and an end to which all ways are free, with a way between them
/// that pays so much that every good tour takes it.
struct Web {
    instance: Instance,
    /// What the way between end and start pays.
    held: f64,
    places: usize,
    /// The number of each node's group, node by node.
    group_of: Vec<Vec<usize>>,
}

impl Web {
    fn new<C: Cost>(groups: &Groups<'_, C>, start: &JointVector) -> Option<Self> {
        let Groups { all, apart, metric, .. } = groups;
        let places = groups.places();
        let mut group_of = vec![Vec::new(); places];
        for (number, group) in all.iter().enumerate() {
            group_of[group.place].push(number);
        }
        let flat: Vec<usize> = group_of.iter().flatten().copied().collect();
        let n = flat.len() + 2;
        let (first, last) = (n - 2, n - 1);
        let mut costs = vec![f64::INFINITY; n * n];
        let mut most = 0.0f64;
        for (u, &group) in flat.iter().enumerate() {
            let row = &apart[group];
            let mut farthest = 0.0f64;
            for (v, &other) in flat.iter().enumerate() {
                costs[u * n + v] = row[other];
                farthest = farthest.max(if row[other].is_finite() { row[other] } else { 0.0 });
            }
            let ways = groups.samples(group).map(|sample| metric.straight(start, &sample.q));
            let way = ways.fold(f64::INFINITY, f64::min);
            (costs[u * n + first], costs[first * n + u]) = (way, way);
            (costs[u * n + last], costs[last * n + u]) = (0.0, 0.0);
            most = most.max(farthest).max(way);
        }
        // More than a tour can gain by another way.
        let held = 2.0 * most * (places + 2) as f64 + 1.0;
        (costs[first * n + last], costs[last * n + first]) = (-held, -held);
        let sizes: Vec<usize> = group_of.iter().map(Vec::len).chain([1, 1]).collect();
        let instance =
            Instance::new(&sizes, Costs::Dense(costs), Jump::Forbidden, Ends::Closed).ok()?;
        Some(Self { instance, held, places, group_of })
    }

    /// The tour through places in an order, each at the group of one of its samples.
    fn along<C: Cost>(&self, groups: &Groups<'_, C>, order: &[(usize, usize)]) -> Tour {
        let node = |&(place, sample): &(usize, usize)| {
            let has = |&group: &usize| groups.all[group].members.binary_search(&sample).is_ok();
            (place, self.group_of[place].iter().position(has).unwrap_or(0))
        };
        let ends = [(self.places + 1, 0), (self.places, 0)];
        let (clusters, nodes) = ends.into_iter().chain(order.iter().map(node)).unzip();
        Tour { clusters, nodes }
    }

    fn search(&self, from: &Tour, ascent: &Ascent) -> Option<Tour> {
        let trials = ascent.trials_per_place * self.instance.clusters() as u64;
        let control = Control { start: Some(from), ..Control::default() };
        Some(gtsp::solve_with(&self.instance, &Budget::trials(trials), 1, control).ok()?.tour)
    }

    /// The places in a tour's order from the start on.
    fn order(&self, tour: &Tour) -> Vec<usize> {
        let mut order = tour.clusters.clone();
        let start = order.iter().position(|&c| c == self.places).unwrap_or(0);
        order.rotate_left(start);
        if order.get(1) == Some(&(self.places + 1)) {
            order[1..].reverse();
        }
        order.retain(|&place| place < self.places);
        order
    }
}

#[cfg(test)]
mod tests {
    use nullsweep_robot::{Branch, MAX_DOF};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::cost::{Effort, TaskTime};

    const DOF: usize = 5;

    fn drawn(places: usize, most: usize, rng: &mut ChaCha8Rng) -> Stops {
        let samples: Vec<Vec<Sample>> = (0..places)
            .map(|_| {
                let middle: [f64; DOF] = std::array::from_fn(|_| rng.random_range(-2.0..2.0));
                let sample = |rng: &mut ChaCha8Rng| {
                    let mut q = [0.0; MAX_DOF];
                    q[..DOF].fill_with(|| rng.random_range(-1.0..1.0));
                    (0..DOF).for_each(|j| q[j] += middle[j]);
                    // The last joint goes round and round.
                    q[DOF - 1] *= 2.0;
                    let (q, branch) = (JointVector::new(q), Branch(0));
                    Sample { q, branch, redundancy: 0.0, heading: 0.0 }
                };
                (0..rng.random_range(1..=most)).map(|_| sample(rng)).collect()
            })
            .collect();
        let mut start = [0.0; MAX_DOF];
        start[..DOF].fill_with(|| rng.random_range(-2.0..2.0));
        let order = (0..places).map(|place| (place, 0)).collect();
        Stops { start: JointVector::new(start), patches: (0..places).collect(), samples, order }
    }

    /// The least that any order and any choice costs, by trying them all.
    fn by_trial<C: Cost>(cost: &C, continuous: Continuous, stops: &Stops) -> f64 {
        fn on<C: Cost>(
            (cost, continuous, stops): (&C, Continuous, &Stops),
            at: &JointVector,
            left: &mut Vec<usize>,
            so_far: f64,
            best: &mut f64,
        ) {
            if left.is_empty() {
                *best = best.min(so_far);
            }
            for k in 0..left.len() {
                let place = left.swap_remove(k);
                for sample in &stops.samples[place] {
                    let next = so_far + cost.of(&continuous.displacement(at, &sample.q));
                    if next < *best {
                        on((cost, continuous, stops), &sample.q, left, next, best);
                    }
                }
                left.push(place);
                let last = left.len() - 1;
                left.swap(k, last);
            }
        }
        let mut best = f64::INFINITY;
        let mut left = (0..stops.samples.len()).collect();
        on((cost, continuous, stops), &stops.start, &mut left, 0.0, &mut best);
        best
    }

    fn check<C: Cost>(cost: &C, ascent: &Ascent, worst: f64) {
        let mut round = [false; MAX_DOF];
        round[DOF - 1] = true;
        let continuous = Continuous::new(round);
        let (mut share, mut count) = (0.0, 0);
        for seed in 0..30 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let places = 1 + seed as usize % 7;
            let stops = drawn(places, 6, &mut rng);
            let least = least(cost, continuous, DOF, &stops, ascent).expect("there are samples");
            let best = by_trial(cost, continuous, &stops);
            assert!(least.bound <= best + 1e-9, "seed {seed}: {least:?}, but {best} is possible");
            assert!(least.straight >= best - 1e-4, "seed {seed}: {least:?}, the best is {best}");
            share += least.bound / best;
            count += 1;
        }
        assert!(share / f64::from(count) > worst, "in the mean {}", share / f64::from(count));
    }

    #[test]
    fn no_order_and_no_choice_of_samples_costs_less_than_the_bound() {
        let velocity = JointVector::new([2.0, 1.0, 0.5, 3.0, 2.0, 0.0, 0.0, 0.0]);
        let fine = Ascent { steps: 1000, ..Ascent::default() };
        check(&Effort, &fine, 0.97);
        check(&TaskTime::new(&velocity), &fine, 0.97);
        // A few groups of many samples each: lower, but a bound all the same.
        let coarse = Ascent { groups: 12, ..fine };
        check(&Effort, &coarse, 0.4);
        check(&TaskTime::new(&velocity), &coarse, 0.3);
    }

    #[test]
    fn what_has_no_way_has_no_bound() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let none = drawn(0, 1, &mut rng);
        let mut shut = drawn(3, 2, &mut rng);
        shut.samples[1].clear();
        for stops in [none, shut] {
            let least = least(&Effort, Continuous::default(), DOF, &stops, &Ascent::default());
            assert_eq!(least, None);
        }
    }
}
