//! The layered graph of joint vectors and its shortest path (paper §IV, Fig. 5).
//!
//! One layer for each tool pose of the tour, one node for each sample of the inverse
//! kinematics; the arm's current joint vector is the source, the sink is artificial. The cost of
//! an edge is known exactly only after its motion has been made – tracked along the surface, or a
//! jump through free space – which is expensive, while the cost of the straight joint line is cheap and
//! never above it. So the search is lazy: the path that is shortest under estimates is found, the
//! motions on it are made, their true costs (or their failure) replace the estimates, and so on.
//! An estimate is the straight cost times the mean ratio of true to straight cost seen so far
//! between the same two layers: the way round by the surface line is much the same for all samples.
//! Where a tracked motion is blocked, others of the same branch that pass there with nearly the same
//! redundancy parameter are doubted: they are taken to be longer, and once one of them is on the
//! shortest path all the same, it may go whatever way round the obstacle is found.
//! The search ends when no path's estimate is lower than the best path made by more than
//! `GAP`.

mod edges;

use std::collections::HashMap;

use edges::{Edges, Kind};
use nullsweep_robot::{Continuous, JointVector};
use rayon::prelude::*;

use crate::cost::Cost;
use crate::roadmap::Blocked;
use crate::workcell::Sample;

/// How two consecutive layers can be joined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Link {
    /// Along an edge of the graph, from its start to its end or, reversed, back.
    Surface {
        /// Index into the graph's edges.
        edge: usize,
        /// From the edge's `b` to its `a`.
        reversed: bool,
    },
    /// Only through free space.
    Jump,
}

/// A motion between two samples of consecutive layers, as its maker returns it.
#[derive(Clone, Debug)]
pub struct Motion<M> {
    /// Its true cost.
    pub cost: f64,
    /// Whatever the maker wants to keep of it.
    pub path: M,
}

/// What the search asks of its surroundings. Layers are named by their place in the tour.
pub trait Moves: Sync {
    /// What a motion is stored as.
    type Path: Send + Sync;

    /// How a layer can be joined to a later one.
    fn link(&self, from: usize, to: usize) -> Link;

    /// Follows the surface from a sample to another, the redundancy parameter changing evenly, or
    /// tells where that is blocked.
    fn track(
        &self,
        link: (usize, bool),
        from: &Sample,
        to: &Sample,
    ) -> Result<Motion<Self::Path>, Blocked>;

    /// Follows the surface from a sample to another, the redundancy parameter changing however it
    /// must; `None` where that fails.
    fn around(&self, link: (usize, bool), from: &Sample, to: &Sample)
    -> Option<Motion<Self::Path>>;

    /// Jumps from a sample (`None`: from the source) to another; `None` where no motion is
    /// found.
    fn jump(&self, from: Option<&Sample>, to: &Sample) -> Option<Motion<Self::Path>>;

    /// Whether the tool can be lifted off at a sample: without that no jump begins or ends there.
    fn lifts(&self, at: &Sample) -> bool;

    /// Whether the arm comes to a sample through free space from the source. Where it does not, jumps to
    /// it are not to be hoped for: all that is visited hangs together with the source.
    fn is_joined(&self, at: &Sample) -> bool;

    /// Whether two samples are so near each other in all but how the pad is turned that what keeps jumps
    /// from one keeps them from the other.
    fn are_alike(&self, a: &Sample, b: &Sample) -> bool;

    /// An estimate of a jump's cost from that of its straight joint line, not above the truth.
    fn jump_estimate(&self, straight: f64) -> f64;
}

/// The shortest path through the layers.
#[derive(Clone, Debug)]
pub struct LayeredPath<M> {
    /// The layers that the path visits, ascending: all but those that were left out.
    pub layers: Vec<usize>,
    /// The chosen sample of each visited layer.
    pub choice: Vec<usize>,
    /// The motion into each visited layer; the first comes from the source.
    pub motions: Vec<Motion<M>>,
    /// Sum of the motions' costs.
    pub cost: f64,
}

/// The search ends when it could gain no more than this share of the cost.
const GAP: f64 = 0.005;
/// Most searches after a path was made.
const MAX_ROUNDS: usize = 100;
/// A motion is doubtful where its redundancy parameter passes so near one that was blocked there.
/// \[rad\]
const NEAR: f64 = 0.02;

/// The cheapest path from `source` through one sample of each layer. A layer without samples, or
/// into or out of which no motion is found, is left out; `left_out` is called with it.
pub fn shortest<C: Cost, M: Moves>(
    cost: &C,
    continuous: Continuous,
    source: &JointVector,
    layers: &[Vec<Sample>],
    moves: &M,
    left_out: &mut dyn FnMut(usize),
) -> LayeredPath<M::Path> {
    let (visited, empty): (Vec<usize>, Vec<usize>) =
        (0..layers.len()).partition(|&l| !layers[l].is_empty());
    empty.into_iter().for_each(&mut *left_out);
    let problem = Problem { cost, continuous, source, layers, moves };
    let mut search = Search::new(problem, visited);
    let mut made: HashMap<Key, Motion<M::Path>> = HashMap::new();
    let mut best: Option<(f64, Vec<Key>)> = None;
    let (mut rounds, mut dirty) = (0, 0);
    loop {
        rounds += 1;
        search.update(dirty);
        if let Some(p) = search.cut_off() {
            dirty = match (0..=p).rev().find(|&before| search.into[before].reopen()) {
                Some(opened) => opened,
                None => {
                    left_out(search.give_up(p));
                    best = None;
                    usize::MAX
                }
            };
            continue;
        }
        let (estimate, keys) = search.cheapest();
        let open: Vec<usize> = (0..keys.len()).filter(|&p| !made.contains_key(&keys[p])).collect();
        let enough = best.as_ref().is_some_and(|(cost, _)| estimate >= cost * (1.0 - GAP));
        if open.is_empty() || enough || (best.is_some() && rounds > MAX_ROUNDS) {
            let (_, keys) = best.take().filter(|_| !open.is_empty()).unwrap_or((0.0, keys));
            return search.finish(&keys, made);
        }
        let attempts: Vec<Result<Motion<M::Path>, Option<Blocked>>> =
            open.par_iter().map(|&p| search.attempt(p, &keys[p])).collect();
        dirty = usize::MAX;
        let mut hopeless = None;
        for (&p, attempt) in open.iter().zip(attempts) {
            let (a, b) = (keys[p].from.map_or(0, |(_, a)| a), keys[p].to.1);
            let edges = &mut search.into[p];
            dirty = dirty.min(p);
            match attempt {
                Ok(motion) => {
                    edges.learn(a, b, motion.cost);
                    made.insert(keys[p], motion);
                }
                Err(Some(blocked)) => search.doubt(p, &keys[p], &blocked),
                Err(None) if edges.kind(a, b) == Kind::Doubtful => edges.fall_back_to_jump(a, b),
                Err(None) => {
                    edges.close(a, b);
                    if search.strike(p, &keys[p]) && hopeless.is_none() {
                        hopeless = Some(p);
                    }
                }
            }
        }
        let cost: Option<f64> = keys.iter().map(|key| made.get(key).map(|m| m.cost)).sum();
        if let Some(cost) = cost
            && best.as_ref().is_none_or(|(c, _)| cost < *c)
        {
            best = Some((cost, keys));
        }
        if let Some(p) = hopeless {
            left_out(search.give_up(p));
            best = None;
        }
    }
}

/// Names a motion by its two samples: (layer, sample), no `from` for the source.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Key {
    from: Option<(usize, usize)>,
    to: (usize, usize),
}

/// What is given.
struct Problem<'a, C, M> {
    cost: &'a C,
    continuous: Continuous,
    source: &'a JointVector,
    layers: &'a [Vec<Sample>],
    moves: &'a M,
}

/// The graph of estimates over the visited layers with the labels on it.
struct Search<'a, C, M> {
    problem: Problem<'a, C, M>,
    visited: Vec<usize>,
    /// The edges into each visited layer.
    into: Vec<Edges>,
    /// The least cost to each sample and where it comes from.
    labels: Vec<Vec<(f32, u32)>>,
    /// For each layer where a sample turned out not to, which samples the tool can be lifted off at.
    lifts: Vec<Option<Vec<bool>>>,
    /// Samples that are not joined to the source, no two of them alike.
    shut: Vec<Sample>,
}

impl<'a, C: Cost, M: Moves> Search<'a, C, M> {
    fn new(problem: Problem<'a, C, M>, visited: Vec<usize>) -> Self {
        let into = (0..visited.len())
            .into_par_iter()
            .map(|p| problem.edges(p.checked_sub(1).map(|b| visited[b]), visited[p]))
            .collect();
        let lifts = vec![None; problem.layers.len()];
        Self { problem, visited, into, labels: Vec::new(), lifts, shut: Vec::new() }
    }

    /// Whether the tool can be lifted off at a sample. Where it cannot, all samples of its layer are
    /// looked at: they have much in common.
    fn lifts(&mut self, (layer, sample): (usize, usize)) -> bool {
        if let Some(known) = &self.lifts[layer] {
            return known[sample];
        }
        let Problem { layers, moves, .. } = self.problem;
        let lifts = moves.lifts(&layers[layer][sample]);
        if !lifts {
            self.lifts[layer] = Some(layers[layer].par_iter().map(|s| moves.lifts(s)).collect());
        }
        lifts
    }

    /// Whether a sample is like one that is not joined to the source.
    fn is_shut(&self, at: &Sample) -> bool {
        self.shut.iter().any(|shut| self.problem.moves.are_alike(shut, at))
    }

    /// Whether a sample, between which and another a jump failed, is not joined to the source.
    fn shuts(&mut self, (layer, sample): (usize, usize)) -> bool {
        let at = self.problem.layers[layer][sample];
        self.is_shut(&at) || {
            let is_joined = self.problem.moves.is_joined(&at);
            self.shut.extend((!is_joined).then_some(at));
            !is_joined
        }
    }

    /// After a jump into place `p` that failed: gives up those that would fail for the same reason;
    /// whether the others are given up too.
    fn strike(&mut self, p: usize, key: &Key) -> bool {
        let from = key.from.is_none_or(|from| self.lifts(from));
        let to = self.lifts(key.to);
        // What is shut in says nothing of the other end.
        let is_shut = to && self.shuts(key.to) || from && key.from.is_some_and(|k| self.shuts(k));
        let Problem { layers, moves, .. } = self.problem;
        let like = |(layer, sample): (usize, usize)| -> Vec<bool> {
            let failed = &layers[layer][sample];
            layers[layer].iter().map(|other| moves.are_alike(failed, other)).collect()
        };
        let (like_from, like_to) = (key.from.map(like), like(key.to));
        let shut = |layer: usize| layers[layer].iter().map(|at| self.is_shut(at)).collect();
        let shut_from: Option<Vec<bool>> = key.from.map(|(layer, _)| shut(layer));
        let shut_to: Vec<bool> = shut(key.to.0);
        let off = |layer: Option<usize>| layer.and_then(|layer| self.lifts[layer].as_ref());
        let (rows, columns) = (off(key.from.map(|(layer, _)| layer)), off(Some(key.to.0)));
        let edges = &mut self.into[p];
        edges.close_jumps(|row, column| {
            let is_like = like_to[column] && like_from.as_ref().is_none_or(|like| like[row]);
            is_like
                || shut_to[column]
                || shut_from.as_ref().is_some_and(|shut| shut[row])
                || rows.is_some_and(|lifts| !lifts[row])
                || columns.is_some_and(|lifts| !lifts[column])
        });
        edges.strike(from && to && !is_shut)
    }

    /// Leaves out the layer at place `p`, into which no motion leads; or the one before it, if no
    /// jump can begin there. The layer that was left out.
    fn give_up(&mut self, p: usize) -> usize {
        let is_trap = |before: usize| {
            let layer = self.visited[before];
            let lifts = self.lifts[layer].as_ref();
            let stays = |sample: usize, at: &Sample| {
                lifts.is_some_and(|lifts| !lifts[sample]) || self.is_shut(at)
            };
            let samples = self.problem.layers[layer].iter().zip(&self.labels[before]);
            let mut samples = samples.enumerate();
            samples.all(|(i, (at, (cost, _)))| cost.is_infinite() || stays(i, at))
        };
        let place = p.checked_sub(1).filter(|&before| is_trap(before)).unwrap_or(p);
        let layer = self.visited[place];
        self.leave_out(place);
        layer
    }

    /// Takes a layer out of the path.
    fn leave_out(&mut self, p: usize) {
        self.visited.remove(p);
        self.into.remove(p);
        self.labels.truncate(p);
        if p < self.visited.len() {
            let from = p.checked_sub(1).map(|b| self.visited[b]);
            self.into[p] = self.problem.edges(from, self.visited[p]);
        }
    }

    /// Recomputes the labels from place `dirty` on.
    fn update(&mut self, dirty: usize) {
        self.labels.truncate(dirty);
        for p in self.labels.len()..self.visited.len() {
            let edges = &self.into[p];
            let mut labels = vec![(f32::INFINITY, 0); edges.width];
            let source = [(0.0f32, 0u32)];
            let before = p.checked_sub(1).map_or(&source[..], |b| &self.labels[b]);
            for (a, &(label, _)) in before.iter().enumerate() {
                let row = &edges.estimate[a * edges.width..(a + 1) * edges.width];
                for (entry, &bound) in labels.iter_mut().zip(row) {
                    let candidate = label + bound;
                    if candidate < entry.0 {
                        *entry = (candidate, a as u32);
                    }
                }
            }
            self.labels.push(labels);
        }
    }

    /// The first place into whose layer no motion leads any more.
    fn cut_off(&self) -> Option<usize> {
        self.labels.iter().position(|labels| labels.iter().all(|(cost, _)| cost.is_infinite()))
    }

    /// The path that is cheapest under the estimates, as its motions, and its estimated cost.
    fn cheapest(&self) -> (f64, Vec<Key>) {
        let Some(last) = self.labels.last() else { return (0.0, Vec::new()) };
        let mut here = (0..last.len()).fold(0, |m, b| if last[b].0 < last[m].0 { b } else { m });
        let estimate = f64::from(last[here].0);
        let mut keys = Vec::with_capacity(self.visited.len());
        for p in (0..self.visited.len()).rev() {
            let before = self.labels[p][here].1 as usize;
            let from = p.checked_sub(1).map(|b| (self.visited[b], before));
            keys.push(Key { from, to: (self.visited[p], here) });
            here = before;
        }
        keys.reverse();
        (estimate, keys)
    }

    /// The path of motions that were all made.
    fn finish(self, keys: &[Key], mut made: HashMap<Key, Motion<M::Path>>) -> LayeredPath<M::Path> {
        let motions: Vec<Motion<M::Path>> =
            keys.iter().filter_map(|key| made.remove(key)).collect();
        LayeredPath {
            layers: self.visited,
            choice: keys.iter().map(|key| key.to.1).collect(),
            cost: motions.iter().map(|m| m.cost).sum(),
            motions,
        }
    }

    /// Makes the motion into place `p`, or says where a track is blocked.
    fn attempt(&self, p: usize, key: &Key) -> Result<Motion<M::Path>, Option<Blocked>> {
        let Problem { layers, moves, .. } = &self.problem;
        let to = &layers[key.to.0][key.to.1];
        let Some((layer, a)) = key.from else { return moves.jump(None, to).ok_or(None) };
        let from = &layers[layer][a];
        match (moves.link(layer, key.to.0), self.into[p].kind(a, key.to.1)) {
            (Link::Surface { edge, reversed }, Kind::Track) => {
                moves.track((edge, reversed), from, to).map_err(Some)
            }
            (Link::Surface { edge, reversed }, Kind::Doubtful) => {
                moves.around((edge, reversed), from, to).ok_or(None)
            }
            _ if self.is_shut(from) || self.is_shut(to) => Err(None),
            _ => moves.jump(Some(from), to).ok_or(None),
        }
    }

    /// Whatever passes near where a track into place `p` was blocked will hardly do better: the
    /// pose there, the branch and the redundancy parameter are all that a posture depends on.
    fn doubt(&mut self, p: usize, key: &Key, blocked: &Blocked) {
        let Some((layer, a)) = key.from else { return };
        let (from, to) = (&self.problem.layers[layer], &self.problem.layers[key.to.0]);
        let (first, last) = (&from[a], &to[key.to.1]);
        let alike = |x: &Sample, y: &Sample| x.branch == y.branch && x.heading == y.heading;
        for (row, x) in from.iter().enumerate().filter(|(_, x)| alike(x, first)) {
            for (column, y) in to.iter().enumerate().filter(|(_, y)| alike(y, last)) {
                let passes = x.redundancy + blocked.share * (y.redundancy - x.redundancy);
                if (passes - blocked.redundancy).abs() <= NEAR {
                    self.into[p].doubt(row, column);
                }
            }
        }
    }
}

impl<C: Cost, M: Moves> Problem<'_, C, M> {
    /// The estimates of all edges from a layer (`None`: the source) into another.
    fn edges(&self, from: Option<usize>, to: usize) -> Edges {
        let width = self.layers[to].len();
        let surface = from.is_some_and(|f| matches!(self.moves.link(f, to), Link::Surface { .. }));
        let rows: Vec<(&JointVector, Option<&Sample>)> = match from {
            None => vec![(self.source, None)],
            Some(layer) => self.layers[layer].iter().map(|s| (&s.q, Some(s))).collect(),
        };
        let lift = self.moves.jump_estimate(0.0) as f32;
        let mut edges = Edges::new(width, rows.len() * width, lift);
        for (q, from) in rows {
            for to in &self.layers[to] {
                let straight = self.cost.of(&self.continuous.displacement(q, &to.q)) as f32;
                let tracked = surface && from.is_some_and(|f| f.branch == to.branch);
                let kind = if tracked { Kind::Track } else { Kind::Jump };
                edges.push(kind, straight);
            }
        }
        edges
    }
}

#[cfg(test)]
mod tests;
