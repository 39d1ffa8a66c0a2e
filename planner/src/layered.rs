//! The layered graph of joint vectors and its shortest path (paper §IV, Fig. 5).
//!
//! One layer for each tool pose of the tour, one node for each sample of the inverse
//! kinematics; the arm's current joint vector is the source, the sink is artificial. The cost of
//! an edge is known exactly only after its motion has been made – tracked along the surface, or a
//! jump through free space – which is dear, while the cost of the straight joint line is cheap and
//! never above it. So the search is lazy: the path that is shortest under estimates is found, the
//! motions on it are made, their true costs (or their failure) replace the estimates, and so on.
//! An estimate is the straight cost times the mean ratio of true to straight cost seen so far
//! between the same two layers: the way round by the surface line is much the same for all samples.
//! Where a tracked motion is blocked, others of the same branch that pass there with nearly the same
//! redundancy parameter are doubted: they are taken to be longer, and once one of them is on the
//! shortest path all the same, it may go whatever way round the obstacle is found.
//! The search ends when no path's estimate is lower than the best path made by more than
//! `GAP`.

use std::collections::HashMap;

use nullsweep_robot::{JointVector, MAX_DOF};
use rayon::prelude::*;

use crate::cost::{Cost, displacement};
use crate::reach::Sample;
use crate::track::Blocked;

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

    /// An estimate of a jump's cost from that of its straight joint line, not above the truth.
    fn jump_estimate(&self, straight: f64) -> f64;
}

/// The shortest path through the layers.
#[derive(Clone, Debug)]
pub struct LayeredPath<M> {
    /// The layers that the path visits, ascending: all but those that nothing reaches.
    pub layers: Vec<usize>,
    /// The chosen sample of each visited layer.
    pub choice: Vec<usize>,
    /// The motion into each visited layer; the first comes from the source.
    pub motions: Vec<Motion<M>>,
    /// Sum of the motions' costs.
    pub cost: f64,
    /// Searches that were needed.
    pub rounds: usize,
    /// Motions that were tried.
    pub tried: usize,
}

/// The search ends when it could gain no more than this share of the cost.
const GAP: f64 = 0.005;
/// Most searches after a path was made.
const MAX_ROUNDS: usize = 100;
/// Jumps made into one layer after which no others are tried: they are dear, and their cost hardly
/// depends on the sample.
const MAX_JUMPS: usize = 3;
/// Failed jumps into one layer after which it is left out.
const MAX_FAILED_JUMPS: usize = 12;
/// A motion is doubtful where its redundancy parameter passes so near one that was blocked there.
/// \[rad\]
const NEAR: f64 = 0.02;
/// How much longer a doubtful motion is taken to be, before one was made.
const DOUBT: f32 = 1.2;
/// So many doubtful motions between two layers may fail, and as many again for each that was made,
/// until the others are given up.
const MAX_FAILED_DOUBTFUL: usize = 8;

/// The cheapest path from `source` through one sample of each layer. A layer without samples, or
/// into or out of which no motion is found, is left out; `left_out` is called with it.
pub fn shortest<C: Cost, M: Moves>(
    cost: &C,
    continuous: &[bool; MAX_DOF],
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
    let (mut rounds, mut tried, mut dirty) = (0, 0, 0);
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
            return search.finish(&keys, made, rounds, tried);
        }
        tried += open.len();
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
    continuous: &'a [bool; MAX_DOF],
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
}

impl<'a, C: Cost, M: Moves> Search<'a, C, M> {
    fn new(problem: Problem<'a, C, M>, visited: Vec<usize>) -> Self {
        let into = (0..visited.len())
            .into_par_iter()
            .map(|p| problem.edges(p.checked_sub(1).map(|b| visited[b]), visited[p]))
            .collect();
        let lifts = vec![None; problem.layers.len()];
        Self { problem, visited, into, labels: Vec::new(), lifts }
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

    /// After a jump into place `p` that failed: gives up those that would fail for the same reason;
    /// whether the others are given up too.
    fn strike(&mut self, p: usize, key: &Key) -> bool {
        let from = key.from.is_none_or(|from| self.lifts(from));
        let to = self.lifts(key.to);
        let off = |layer: Option<usize>| layer.and_then(|layer| self.lifts[layer].as_ref());
        let (rows, columns) = (off(key.from.map(|(layer, _)| layer)), off(Some(key.to.0)));
        let edges = &mut self.into[p];
        edges.close_jumps(|row, column| {
            rows.is_some_and(|lifts| !lifts[row]) || columns.is_some_and(|lifts| !lifts[column])
        });
        edges.failed_jumps += usize::from(from && to);
        edges.failed_jumps > MAX_FAILED_JUMPS || edges.is_closed()
    }

    /// Leaves out the layer at place `p`, into which no motion leads; or the one before it, if no
    /// jump can begin there. The layer that was left out.
    fn give_up(&mut self, p: usize) -> usize {
        let is_trap = |before: usize| {
            let lifts = self.lifts[self.visited[before]].as_ref();
            lifts.is_some_and(|lifts| {
                lifts
                    .iter()
                    .zip(&self.labels[before])
                    .all(|(lifts, (cost, _))| !lifts || cost.is_infinite())
            })
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
    fn finish(
        self,
        keys: &[Key],
        mut made: HashMap<Key, Motion<M::Path>>,
        rounds: usize,
        tried: usize,
    ) -> LayeredPath<M::Path> {
        let motions: Vec<Motion<M::Path>> =
            keys.iter().filter_map(|key| made.remove(key)).collect();
        LayeredPath {
            layers: self.visited,
            choice: keys.iter().map(|key| key.to.1).collect(),
            cost: motions.iter().map(|m| m.cost).sum(),
            motions,
            rounds,
            tried,
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
        let size = rows.len() * width;
        let mut edges = Edges {
            width,
            estimate: Vec::with_capacity(size),
            straight: Vec::with_capacity(size),
            kind: Vec::with_capacity(size),
            lift: self.moves.jump_estimate(0.0) as f32,
            ratios: [(0.0, 0.0); 3],
            doubtful: [0; 2],
            jumps: 0,
            failed_jumps: 0,
        };
        for (q, from) in rows {
            for to in &self.layers[to] {
                let straight = self.cost.of(&displacement(self.continuous, q, &to.q)) as f32;
                let tracked = surface && from.is_some_and(|f| f.branch == to.branch);
                let kind = if tracked { Kind::Track } else { Kind::Jump };
                edges.straight.push(straight);
                edges.kind.push(kind);
                edges.estimate.push(edges.guess(kind, straight));
            }
        }
        edges
    }
}

/// How two samples are joined, and what is known of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// To be tracked along the surface; an estimate.
    Track,
    /// To be tracked in whatever way goes, as the even change is likely to be blocked; an estimate.
    Doubtful,
    /// To be jumped; an estimate.
    Jump,
    /// A jump that is not tried, as enough others were made.
    Spare,
    /// The motion was made, or cannot be made: the cost is true.
    Known,
}

/// What is known of the edges between two layers' samples: matrices, row-major from × to.
struct Edges {
    width: usize,
    /// The true cost where it is known, else the estimate.
    estimate: Vec<f32>,
    /// The cost of the straight joint line.
    straight: Vec<f32>,
    kind: Vec<Kind>,
    /// What a jump costs besides its way.
    lift: f32,
    /// Ratios of true to straight cost seen here, of tracks, of doubtful ones and of jumps: their
    /// sum and number.
    ratios: [(f32, f32); 3],
    /// Doubtful motions that were made, and that failed.
    doubtful: [usize; 2],
    /// Jumps that were made, and that failed though the tool can be lifted off at both ends.
    jumps: usize,
    failed_jumps: usize,
}

impl Edges {
    fn kind(&self, a: usize, b: usize) -> Kind {
        self.kind[a * self.width + b]
    }

    fn guess(&self, kind: Kind, straight: f32) -> f32 {
        let ratio = |kind: Kind, unseen: f32| match self.ratios[kind as usize] {
            (_, 0.0) => unseen,
            (sum, seen) => sum / seen,
        };
        match kind {
            Kind::Track => straight * ratio(kind, 1.0),
            Kind::Doubtful => straight * ratio(kind, DOUBT * ratio(Kind::Track, 1.0)),
            Kind::Jump => self.lift + straight * ratio(kind, 1.0),
            Kind::Spare | Kind::Known => f32::INFINITY,
        }
    }

    /// Puts a true cost in place and re-estimates the others of its kind.
    fn learn(&mut self, a: usize, b: usize, cost: f64) {
        let at = a * self.width + b;
        let kind = self.kind[at];
        let way = cost as f32 - if kind == Kind::Jump { self.lift } else { 0.0 };
        let (sum, seen) = &mut self.ratios[kind as usize];
        *sum += way / self.straight[at].max(1e-6);
        *seen += 1.0;
        self.doubtful[0] += usize::from(kind == Kind::Doubtful);
        self.jumps += usize::from(kind == Kind::Jump);
        self.kind[at] = Kind::Known;
        self.estimate[at] = cost as f32;
        if self.jumps >= MAX_JUMPS {
            self.turn(Kind::Jump, Kind::Spare);
        }
        for i in 0..self.kind.len() {
            if self.kind[i] != Kind::Known {
                self.estimate[i] = self.guess(self.kind[i], self.straight[i]);
            }
        }
    }

    fn set(&mut self, at: usize, kind: Kind) {
        self.kind[at] = kind;
        self.estimate[at] = self.guess(kind, self.straight[at]);
    }

    fn doubt(&mut self, a: usize, b: usize) {
        let at = a * self.width + b;
        if self.kind[at] == Kind::Track {
            self.set(at, Kind::Doubtful);
        }
    }

    /// After a doubtful motion that failed; after too many, all of them.
    fn fall_back_to_jump(&mut self, a: usize, b: usize) {
        self.set(a * self.width + b, Kind::Jump);
        let [made, failed] = &mut self.doubtful;
        *failed += 1;
        if *failed >= MAX_FAILED_DOUBTFUL * (*made + 1) {
            self.turn(Kind::Doubtful, Kind::Jump);
        }
    }

    fn close(&mut self, a: usize, b: usize) {
        self.set(a * self.width + b, Kind::Known);
    }

    /// Gives up the jumps between the samples (row, column) that `which` picks, but those made.
    fn close_jumps(&mut self, which: impl Fn(usize, usize) -> bool) {
        for at in 0..self.kind.len() {
            let is_jump = matches!(self.kind[at], Kind::Jump | Kind::Spare);
            if is_jump && which(at / self.width, at % self.width) {
                self.set(at, Kind::Known);
            }
        }
    }

    /// Offers the jumps again that were put off; whether there were any.
    fn reopen(&mut self) -> bool {
        self.jumps = 0;
        self.turn(Kind::Spare, Kind::Jump)
    }

    fn turn(&mut self, from: Kind, to: Kind) -> bool {
        let mut any = false;
        for at in 0..self.kind.len() {
            if self.kind[at] == from {
                self.set(at, to);
                any = true;
            }
        }
        any
    }

    /// Whether no edge is left.
    fn is_closed(&self) -> bool {
        self.estimate.iter().all(|e| e.is_infinite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cost::Effort;
    use crate::track::TrackFailure;
    use nullsweep_robot::Branch;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Motions whose true cost is the straight one plus a hidden surcharge; some fail.
    struct Hidden {
        straight_tracks: bool,
        links: Vec<Link>,
    }

    fn surcharge(from: &Sample, to: &Sample) -> f64 {
        let mix = (from.q[0] * 7919.0 + to.q[0] * 104_729.0).sin().abs();
        if mix > 0.9 { f64::INFINITY } else { mix * 3.0 }
    }

    fn straight(a: &JointVector, b: &JointVector) -> f64 {
        Effort.of(&displacement(&[false; MAX_DOF], a, b))
    }

    impl Moves for Hidden {
        type Path = ();
        fn link(&self, from: usize, to: usize) -> Link {
            if to == from + 1 { self.links[from] } else { Link::Jump }
        }
        fn track(
            &self,
            link: (usize, bool),
            from: &Sample,
            to: &Sample,
        ) -> Result<Motion<()>, Blocked> {
            let redundancy = 0.5 * (from.redundancy + to.redundancy);
            let blocked = Blocked { why: TrackFailure::Collision, share: 0.5, redundancy };
            self.around(link, from, to).ok_or(blocked)
        }
        fn around(&self, _: (usize, bool), from: &Sample, to: &Sample) -> Option<Motion<()>> {
            let extra = if self.straight_tracks { 0.0 } else { surcharge(from, to) };
            extra.is_finite().then(|| Motion { cost: straight(&from.q, &to.q) + extra, path: () })
        }
        fn jump(&self, from: Option<&Sample>, to: &Sample) -> Option<Motion<()>> {
            let start = from.map_or([0.0; MAX_DOF], |s| s.q);
            Some(Motion { cost: self.jump_estimate(straight(&start, &to.q)), path: () })
        }
        fn lifts(&self, _: &Sample) -> bool {
            true
        }
        fn jump_estimate(&self, straight: f64) -> f64 {
            2.0 + 1.5 * straight
        }
    }

    fn layers(rng: &mut ChaCha8Rng, count: usize) -> (Vec<Vec<Sample>>, Vec<Link>) {
        let layers: Vec<Vec<Sample>> = (0..count)
            .map(|_| {
                (0..rng.random_range(1..6))
                    .map(|_| {
                        let mut q = [0.0; MAX_DOF];
                        q[..3].fill_with(|| rng.random_range(-2.0..2.0));
                        let branch = Branch(rng.random_range(0..2));
                        Sample { q, branch, redundancy: q[0], heading: 0.0 }
                    })
                    .collect()
            })
            .collect();
        let links = (1..count)
            .map(|_| {
                if rng.random_range(0..5) == 0 {
                    Link::Jump
                } else {
                    Link::Surface { edge: 0, reversed: false }
                }
            })
            .collect();
        (layers, links)
    }

    /// The same problem by enumeration of every choice with true costs.
    fn brute_force(layers: &[Vec<Sample>], moves: &Hidden) -> f64 {
        let mut best: Vec<f64> = layers[0]
            .iter()
            .map(|s| moves.jump(None, s).map_or(f64::INFINITY, |m| m.cost))
            .collect();
        for l in 1..layers.len() {
            best = layers[l]
                .iter()
                .map(|to| {
                    layers[l - 1]
                        .iter()
                        .zip(&best)
                        .map(|(from, label)| {
                            let tracked = (matches!(moves.links[l - 1], Link::Surface { .. })
                                && from.branch == to.branch)
                                .then(|| moves.around((0, false), from, to))
                                .flatten();
                            let motion = tracked.or_else(|| moves.jump(Some(from), to));
                            label + motion.map_or(f64::INFINITY, |m| m.cost)
                        })
                        .fold(f64::INFINITY, f64::min)
                })
                .collect();
        }
        best.into_iter().fold(f64::INFINITY, f64::min)
    }

    fn search(layers: &[Vec<Sample>], moves: &Hidden) -> (LayeredPath<()>, Vec<usize>) {
        let mut left_out = Vec::new();
        let source = [0.0; MAX_DOF];
        let path = shortest(&Effort, &[false; MAX_DOF], &source, layers, moves, &mut |l| {
            left_out.push(l);
        });
        (path, left_out)
    }

    #[test]
    fn lazy_search_comes_near_the_shortest_true_path() {
        let mut excess = 0.0;
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        for trial in 0..200 {
            let (layers, links) = layers(&mut rng, 1 + trial % 9);
            let moves = Hidden { straight_tracks: trial % 3 == 0, links };
            let (found, left_out) = search(&layers, &moves);
            let expected = brute_force(&layers, &moves);
            let gap = found.cost / expected - 1.0;
            assert!(gap > -1e-6, "cheaper than possible: {} {expected}", found.cost);
            if trial % 3 == 0 {
                assert!(gap < GAP + 1e-5, "exact estimates: {} {expected}", found.cost);
            }
            excess += gap / 200.0;
            assert!(left_out.is_empty());
        }
        assert!(excess < 0.05, "random surcharges cost {excess} on average");
    }

    #[test]
    fn an_empty_layer_is_left_out() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let (mut layers, links) = layers(&mut rng, 4);
        layers[2].clear();
        let (path, left_out) = search(&layers, &Hidden { straight_tracks: true, links });
        assert_eq!(left_out, [2]);
        assert_eq!(path.layers, [0, 1, 3]);
        assert_eq!(path.motions.len(), 3);
    }

    /// Jumps alone, many of which fail.
    struct Gates;

    fn opens(from: &JointVector, to: &JointVector) -> bool {
        (from[0] * 7919.0 + to[0] * 104_729.0).sin() > 0.3
    }

    impl Moves for Gates {
        type Path = ();
        fn link(&self, _: usize, _: usize) -> Link {
            Link::Jump
        }
        fn track(&self, _: (usize, bool), _: &Sample, _: &Sample) -> Result<Motion<()>, Blocked> {
            unreachable!("no layers are linked along the surface")
        }
        fn around(&self, _: (usize, bool), _: &Sample, _: &Sample) -> Option<Motion<()>> {
            unreachable!("no layers are linked along the surface")
        }
        fn jump(&self, from: Option<&Sample>, to: &Sample) -> Option<Motion<()>> {
            let start = from.map_or([0.0; MAX_DOF], |s| s.q);
            let is_open = from.is_none() || opens(&start, &to.q);
            is_open.then(|| Motion { cost: 1.0 + straight(&start, &to.q), path: () })
        }
        fn lifts(&self, _: &Sample) -> bool {
            true
        }
        fn jump_estimate(&self, straight: f64) -> f64 {
            1.0 + straight
        }
    }

    #[test]
    fn no_layer_is_left_out_that_some_path_visits() {
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let (mut whole, mut cut) = (0, 0);
        for trial in 0..2000 {
            let (mut layers, _) = layers(&mut rng, 2 + trial % 5);
            // With more than twelve jumps into it, a layer may be given up before all have failed.
            for (l, layer) in layers.iter_mut().enumerate() {
                layer.truncate(3 + l % 2);
            }
            let mut reached = vec![true; layers[0].len()];
            for pair in layers.windows(2) {
                let comes = |to: &Sample| {
                    pair[0].iter().zip(&reached).any(|(from, r)| *r && opens(&from.q, &to.q))
                };
                reached = pair[1].iter().map(comes).collect();
            }
            let mut left_out = 0;
            let source = [0.0; MAX_DOF];
            let path = shortest(&Effort, &[false; MAX_DOF], &source, &layers, &Gates, &mut |_| {
                left_out += 1
            });
            assert_eq!(path.layers.len() + left_out, layers.len());
            assert!(path.cost.is_finite());
            if reached.contains(&true) {
                assert_eq!(left_out, 0, "trial {trial}");
                whole += 1;
            } else {
                assert!(left_out > 0);
                cut += 1;
            }
        }
        assert!(whole > 500 && cut > 200, "{whole} whole, {cut} cut");
    }

    /// Tracks everywhere to the second layer, where the tool cannot be lifted off again.
    struct Trap;

    impl Moves for Trap {
        type Path = ();
        fn link(&self, from: usize, to: usize) -> Link {
            match (from, to) {
                (0, 1) => Link::Surface { edge: 0, reversed: false },
                _ => Link::Jump,
            }
        }
        fn track(
            &self,
            link: (usize, bool),
            from: &Sample,
            to: &Sample,
        ) -> Result<Motion<()>, Blocked> {
            let blocked = Blocked { why: TrackFailure::Collision, share: 0.5, redundancy: 0.0 };
            self.around(link, from, to).ok_or(blocked)
        }
        fn around(&self, _: (usize, bool), from: &Sample, to: &Sample) -> Option<Motion<()>> {
            Some(Motion { cost: straight(&from.q, &to.q), path: () })
        }
        fn jump(&self, from: Option<&Sample>, to: &Sample) -> Option<Motion<()>> {
            let start = from.map_or([0.0; MAX_DOF], |s| s.q);
            let goes = self.lifts(to) && from.is_none_or(|from| self.lifts(from));
            goes.then(|| Motion { cost: 1.0 + straight(&start, &to.q), path: () })
        }
        fn lifts(&self, at: &Sample) -> bool {
            at.heading != 1.0
        }
        fn jump_estimate(&self, straight: f64) -> f64 {
            1.0 + straight
        }
    }

    #[test]
    fn the_layer_that_no_jump_leaves_is_left_out_not_those_behind_it() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        for _ in 0..50 {
            let (mut layers, _) = layers(&mut rng, 5);
            for (l, layer) in layers.iter_mut().enumerate() {
                layer.iter_mut().for_each(|s| (s.heading, s.branch) = (l as f64, Branch(0)));
            }
            let mut left_out = Vec::new();
            let source = [0.0; MAX_DOF];
            let path = shortest(&Effort, &[false; MAX_DOF], &source, &layers, &Trap, &mut |l| {
                left_out.push(l)
            });
            assert_eq!((path.layers, left_out), (vec![0, 2, 3, 4], vec![1]));
        }
    }
}
