//! Other redundancy parameters within an edge, for where the even change cannot be followed.
//!
//! Each station of the tool path is a layer, each redundancy value that is tried there a node: its
//! joint vector on the one branch. The way through the layers with the least squared joint movement
//! is searched lazily: inverse kinematics and limits are asked when a node is first reached,
//! collisions only along a way that would be the result. What blocks it there is taken out, and the
//! search goes on. Every node is looked at once, so a search without result is bounded too.

use std::collections::HashSet;

use nalgebra::Isometry3;
use nullsweep_collision::ToolContact;
use nullsweep_robot::{Branch, JointVector};

use super::path::ToolPath;
use super::track::{Follower, Place, Track, arrives, is_step};
use crate::workcell::{Sample, Workcell};

/// Distance of the redundancy values that are tried. \[rad\]
const SPACING: f64 = 0.08;
/// Farthest that the redundancy parameter goes from one station to the next. \[rad\]
const SWING: f64 = 0.3;
/// Ways that may turn out to be blocked between two free nodes before the search ends.
const BLOCKED_BETWEEN: usize = 16;

impl Workcell<'_> {
    /// Follows the path on one branch from some sample at its start to some sample at its end, the
    /// redundancy parameter changing however it must; `None` where no way was found, and for arms
    /// without redundancy. What [`Self::follow`] promises of its tracks holds for this one too.
    #[must_use]
    pub fn detour(&self, path: &ToolPath, from: &[Sample], to: &[Sample]) -> Option<Track> {
        let range = self.arm.ik().redundancy_range().filter(|_| path.is_for(self.tool))?;
        let mut branches: Vec<Branch> = from.iter().map(|sample| sample.branch).collect();
        branches.sort_unstable();
        branches.dedup();
        branches.into_iter().find_map(|branch| {
            let on_branch = |samples: &[Sample]| -> Vec<Sample> {
                samples.iter().filter(|sample| sample.branch == branch).copied().collect()
            };
            Search::new(*self, path, range, on_branch(from), on_branch(to))?.run()
        })
    }
}

/// A redundancy value at a station.
#[derive(Clone, Debug)]
struct Node {
    redundancy: f64,
    state: State,
    /// Squared joint movement of the best way here. \[rad²\]
    cost: f64,
    /// The node before it on that way.
    before: usize,
}

/// What is known of a node.
#[derive(Clone, Copy, Debug)]
enum State {
    Unknown,
    /// Within the limits.
    Solved(JointVector),
    /// Free of collision too.
    Free(JointVector),
    Out,
}

impl Node {
    fn new(redundancy: f64, state: State) -> Self {
        Self { redundancy, state, cost: f64::INFINITY, before: 0 }
    }

    fn q(&self) -> Option<&JointVector> {
        match &self.state {
            State::Solved(q) | State::Free(q) => Some(q),
            State::Unknown | State::Out => None,
        }
    }
}

struct Search<'a> {
    cell: Workcell<'a>,
    path: &'a ToolPath,
    from: Vec<Sample>,
    to: Vec<Sample>,
    /// Contact pose of each station.
    poses: Vec<Isometry3<f64>>,
    /// The nodes of each station, redundancy values ascending.
    layers: Vec<Vec<Node>>,
    /// Collisions found at each station.
    hits: Vec<usize>,
    /// Station and two nodes, there and at the next one, between which the way is blocked.
    blocked: HashSet<(usize, usize, usize)>,
}

impl<'a> Search<'a> {
    /// `None` where there is nothing to search: no samples, or no station between the ends.
    fn new(
        cell: Workcell<'a>,
        path: &'a ToolPath,
        range: (f64, f64),
        mut from: Vec<Sample>,
        mut to: Vec<Sample>,
    ) -> Option<Self> {
        let last = path.stations() - 1;
        if from.is_empty() || to.is_empty() || last < 2 {
            return None;
        }
        for samples in [&mut from, &mut to] {
            samples.sort_by(|a, b| a.redundancy.total_cmp(&b.redundancy));
        }
        let mean = |samples: &[Sample]| {
            samples.iter().map(|s| s.redundancy).sum::<f64>() / samples.len() as f64
        };
        let (start, end) = (mean(&from), mean(&to));
        let layers = (0..=last)
            .map(|station| match station {
                0 => from.iter().map(|s| Node::new(s.redundancy, State::Free(s.q))).collect(),
                _ if station == last => {
                    to.iter().map(|s| Node::new(s.redundancy, State::Unknown)).collect()
                }
                _ => {
                    // Beside the even change, as far as both ends can still be reached.
                    let even = start + path.share(station) * (end - start);
                    let within = |ends: &[Sample], stations: usize| {
                        let reach = SWING * stations as f64;
                        (ends[0].redundancy - reach, ends[ends.len() - 1].redundancy + reach)
                    };
                    let (after, before) = (within(&from, station), within(&to, last - station));
                    let low = range.0.max(after.0).max(before.0);
                    let high = range.1.min(after.1).min(before.1);
                    let first = ((low - even) / SPACING).ceil() as i64;
                    let most = ((high - even) / SPACING).floor() as i64;
                    (first..=most)
                        .map(|k| Node::new(even + k as f64 * SPACING, State::Unknown))
                        .collect()
                }
            })
            .collect();
        let poses = (0..=last).map(|station| path.pose(station)).collect();
        let (hits, blocked) = (vec![0; last + 1], HashSet::new());
        Some(Self { cell, path, from, to, poses, layers, hits, blocked })
    }

    fn run(mut self) -> Option<Track> {
        let mut dirty = 1;
        loop {
            self.label(dirty);
            let route = self.cheapest()?;
            if let Some(station) = self.collision(&route) {
                dirty = station;
                continue;
            }
            match self.track(&route) {
                Ok(track) => return Some(track),
                Err(station) => {
                    self.blocked.insert((station, route[station], route[station + 1]));
                    if self.blocked.len() > BLOCKED_BETWEEN {
                        return None;
                    }
                    dirty = station + 1;
                }
            }
        }
    }

    /// Finds the best way to each node, from station `dirty` on.
    fn label(&mut self, dirty: usize) {
        let run = Follower::new(self.cell, self.path, &self.from[0]);
        for node in &mut self.layers[0] {
            node.cost = 0.0;
        }
        for station in dirty..self.layers.len() {
            let is_last = station + 1 == self.layers.len();
            let (before, here) = self.layers.split_at_mut(station);
            let (before, here) = (&before[station - 1], &mut here[0]);
            let mut first = 0;
            for (index, node) in here.iter_mut().enumerate() {
                node.cost = f64::INFINITY;
                if matches!(node.state, State::Out) {
                    continue;
                }
                while before.get(first).is_some_and(|n| n.redundancy < node.redundancy - SWING) {
                    first += 1;
                }
                let near = before
                    .iter()
                    .enumerate()
                    .skip(first)
                    .take_while(|(_, n)| n.redundancy <= node.redundancy + SWING)
                    .filter(|(_, n)| n.cost.is_finite())
                    .filter_map(|(at, n)| Some((at, n.cost, n.redundancy, n.q()?)));
                if matches!(node.state, State::Unknown) {
                    let away = |redundancy: f64| (redundancy - node.redundancy).abs();
                    let nearest =
                        near.clone().min_by(|(.., a, _), (.., b, _)| away(*a).total_cmp(&away(*b)));
                    let Some((.., near)) = nearest else { continue };
                    let found = run.solve(&self.poses[station], node.redundancy, near).ok();
                    node.state = match found {
                        Some(q) if !is_last => State::Solved(q),
                        // The ends are samples, which are free.
                        Some(q) if arrives(self.cell.arm.limits(), &q, &self.to[index].q) => {
                            State::Free(q)
                        }
                        _ => State::Out,
                    };
                }
                let Some(&q) = node.q() else { continue };
                for (at, cost, _, from) in near {
                    let length: f64 = q.iter().zip(from).map(|(a, b)| (a - b) * (a - b)).sum();
                    let is_open =
                        || is_step(from, &q) && !self.blocked.contains(&(station - 1, at, index));
                    if cost + length < node.cost && is_open() {
                        (node.cost, node.before) = (cost + length, at);
                    }
                }
            }
        }
    }

    /// The nodes of the best way, one for each station.
    fn cheapest(&self) -> Option<Vec<usize>> {
        let last = self.layers.len() - 1;
        let ends = self.layers[last].iter().enumerate().filter(|(_, node)| node.cost.is_finite());
        let (mut at, _) = ends.min_by(|(_, a), (_, b)| a.cost.total_cmp(&b.cost))?;
        let mut route = vec![0; last + 1];
        for station in (0..=last).rev() {
            route[station] = at;
            at = self.layers[station][at].before;
        }
        Some(route)
    }

    /// Looks at the nodes of a way that were not looked at yet, first where most collisions were
    /// found; the station of one that collides.
    fn collision(&mut self, route: &[usize]) -> Option<usize> {
        let mut stations: Vec<usize> = (0..route.len()).collect();
        stations.sort_by_key(|&station| std::cmp::Reverse(self.hits[station]));
        stations.into_iter().find(|&station| {
            let node = &mut self.layers[station][route[station]];
            let State::Solved(q) = node.state else { return false };
            let is_free = self.cell.world.is_free(&q, ToolContact::Allowed);
            node.state = if is_free { State::Free(q) } else { State::Out };
            self.hits[station] += usize::from(!is_free);
            !is_free
        })
    }

    /// The track through the nodes, or the station after which it is blocked.
    fn track(&self, route: &[usize]) -> Result<Track, usize> {
        let node = |station: usize| &self.layers[station][route[station]];
        let mut run = Follower::new(self.cell, self.path, &self.from[route[0]]);
        for station in 1..route.len() {
            let redundancy = node(station).redundancy;
            let q = *node(station).q().ok_or(station - 1)?;
            let place = Place { share: 1.0, q, redundancy, pose: self.poses[station] };
            run.step(place).map_err(|_| station - 1)?;
        }
        match self.cell.world.unproven(&run.track.joints, ToolContact::Allowed) {
            None => Ok(run.track),
            Some(knot) => Err(run.station_at(knot).min(route.len() - 2)),
        }
    }
}
