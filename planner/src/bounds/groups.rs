//! Joint vectors that lie close together taken as one, and what it costs at least to go from some to
//! others.

use nullsweep_robot::{JointVector, MAX_DOF};
use rayon::prelude::*;

use crate::cost::Cost;
use crate::tour::joint::{Cluster, Metric};
use crate::workcell::Sample;

/// By how much single precision may make a cost too high: so far off may each joint be, \[rad\] or
/// \[m\], and this share of the whole.
const ROUNDING: (f64, f64) = (1e-5, 2e-6);

/// Groups of the samples at each place.
pub(super) struct Groups<'a, C> {
    cost: &'a C,
    pub(super) metric: &'a Metric<'a, C>,
    /// The samples of each place, continuous joints within half a turn.
    places: &'a [Cluster],
    pub(super) all: Vec<Group>,
    /// What a motion from a group to another of another place costs at least.
    pub(super) apart: Vec<Vec<f64>>,
}

/// Samples of one place.
pub(super) struct Group {
    pub(super) place: usize,
    /// Their numbers, ascending.
    pub(super) members: Vec<usize>,
    /// What it costs to go from one corner of the box around them to the opposite one.
    spread: f64,
    /// The joint in which that costs most, and the middle there; none where all are one.
    cut: Option<(usize, f64)>,
}

impl Group {
    fn new<C: Cost>(cost: &C, place: usize, samples: &[Sample], members: Vec<usize>) -> Self {
        let ends = |j: usize| {
            let values = members.iter().map(|&i| samples[i].q[j]);
            let none = (f64::INFINITY, f64::NEG_INFINITY);
            values.fold(none, |(low, high), q| (low.min(q), high.max(q)))
        };
        let around: [(f64, f64); MAX_DOF] = std::array::from_fn(ends);
        let across = JointVector::from_fn(|j| (around[j].1 - around[j].0).max(0.0));
        let alone =
            |j: usize| cost.of(&JointVector::from_fn(|k| if k == j { across[j] } else { 0.0 }));
        let widest = (0..MAX_DOF).max_by(|&a, &b| alone(a).total_cmp(&alone(b)).then(b.cmp(&a)));
        let cut = widest.map(|j| (j, 0.5 * (around[j].0 + around[j].1)));
        // Rounding may put the middle of two neighbours on the upper one.
        let cut = cut.filter(|&(j, middle)| middle < around[j].1);
        Self { place, members, spread: if cut.is_some() { cost.of(&across) } else { 0.0 }, cut }
    }
}

impl<'a, C: Cost> Groups<'a, C> {
    /// One group for each place, then the one that spreads farthest cut in halves until there are about
    /// `count`.
    pub(super) fn new(
        cost: &'a C,
        metric: &'a Metric<'a, C>,
        places: &'a [Cluster],
        count: usize,
    ) -> Self {
        let whole = |(place, cluster): (usize, &Cluster)| {
            let samples = cluster.samples();
            Group::new(cost, place, samples, (0..samples.len()).collect())
        };
        let all: Vec<Group> = places.iter().enumerate().map(whole).collect();
        let mut groups = Self { cost, metric, places, all, apart: Vec::new() };
        while groups.all.len() < count {
            let widest = |&a: &usize, &b: &usize| {
                groups.all[a].spread.total_cmp(&groups.all[b].spread).then(b.cmp(&a))
            };
            let Some(widest) = (0..groups.all.len()).max_by(widest) else { break };
            if !groups.halve(widest) {
                break;
            }
        }
        groups.apart = (0..groups.all.len()).into_par_iter().map(|g| groups.row(g)).collect();
        groups
    }

    /// How many places there are.
    pub(super) fn places(&self) -> usize {
        self.places.len()
    }

    /// The samples of a group.
    pub(super) fn samples(&self, group: usize) -> impl Iterator<Item = &Sample> {
        let Group { place, members, .. } = &self.all[group];
        let samples = self.places[*place].samples();
        members.iter().map(move |&i| &samples[i])
    }

    /// Cuts a group in halves; whether it could be: not where all its samples are one.
    fn halve(&mut self, group: usize) -> bool {
        let Group { place, members, cut, .. } = &self.all[group];
        let Some((joint, middle)) = *cut else { return false };
        let (place, samples) = (*place, self.places[*place].samples());
        let (low, high) = members.iter().partition(|&&i| samples[i].q[joint] <= middle);
        self.all[group] = Group::new(self.cost, place, samples, low);
        self.all.push(Group::new(self.cost, place, samples, high));
        true
    }

    /// What motions from a group to each other one cost at least; none lead within its place.
    fn row(&self, group: usize) -> Vec<f64> {
        let Group { place, members, .. } = &self.all[group];
        let samples = self.places[*place].samples();
        let from = Cluster::new(members.iter().map(|&i| samples[i]).collect());
        let to = |(other, cluster): (usize, &Cluster)| {
            if other == *place { Vec::new() } else { self.metric.nearest(&from, cluster) }
        };
        let nearest: Vec<Vec<f32>> = self.places.iter().enumerate().map(to).collect();
        let (joint, share) = ROUNDING;
        let slack = self.cost.of(&JointVector::from_fn(|_| joint));
        let least = |other: &Group| {
            let costs = other.members.iter().filter_map(|&i| nearest[other.place].get(i));
            let least = f64::from(costs.copied().fold(f32::INFINITY, f32::min));
            (least * (1.0 - share) - slack).max(0.0)
        };
        self.all.iter().map(least).collect()
    }
}
