//! The layered graph of joint vectors and its shortest path (paper §IV, Fig. 5).
//!
//! One layer for each tool pose of the tour, one node for each sample of the inverse
//! kinematics; the arm's current joint vector is the source, the sink is artificial. The cost of
//! an edge is known exactly only after its motion has been made – tracked along the surface, or a
//! jump through free space – which is dear, while a lower bound is cheap. So the shortest path
//! under the bounds is found, the motions on it are made, their true costs (or their failure) put
//! in the bounds' place, and the search goes on from there until every edge on the path is true.
//! With exact lower bounds that path is the shortest of all.

use std::collections::HashMap;

use nullsweep_robot::{JointVector, MAX_DOF};
use rayon::prelude::*;

use crate::cost::{Cost, displacement};
use crate::reach::Sample;

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

/// What the search asks of its surroundings.
pub trait Moves: Sync {
    /// What a motion is stored as.
    type Path: Send;

    /// Follows the surface from layer `layer`'s sample to the next layer's; `None` where that
    /// fails.
    fn track(&self, link: (usize, bool), from: &Sample, to: &Sample) -> Option<Motion<Self::Path>>;

    /// Jumps from a sample (`None`: from the source) to another; `None` where no motion is
    /// found.
    fn jump(&self, from: Option<&Sample>, to: &Sample) -> Option<Motion<Self::Path>>;

    /// An estimate of a jump's cost from that of its straight joint line, not below it.
    fn jump_estimate(&self, straight: f64) -> f64;
}

/// The shortest path through all layers.
#[derive(Clone, Debug)]
pub struct LayeredPath<M> {
    /// The chosen sample of each layer.
    pub choice: Vec<usize>,
    /// The motion into each layer; the first comes from the source.
    pub motions: Vec<Motion<M>>,
    /// Sum of the motions' costs.
    pub cost: f64,
    /// Searches that were needed.
    pub rounds: usize,
    /// Motions that were made.
    pub made: usize,
}

/// Why there is no path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unreachable {
    /// No motion was found into this layer.
    pub layer: usize,
}

/// Failed jumps into one layer after which it is given up.
const MAX_FAILED_JUMPS: usize = 24;

/// The cheapest path from `source` through one sample of each layer. `links[l]` joins layer
/// `l` and `l + 1`.
///
/// # Errors
/// Names the first layer into which no motion was found.
pub fn shortest<C: Cost, M: Moves>(
    cost: &C,
    continuous: &[bool; MAX_DOF],
    source: &JointVector,
    layers: &[Vec<Sample>],
    links: &[Link],
    moves: &M,
) -> Result<LayeredPath<M::Path>, Unreachable> {
    if let Some(layer) = layers.iter().position(Vec::is_empty) {
        return Err(Unreachable { layer });
    }
    let mut bounds = Bounds::new(cost, continuous, source, layers, links, moves);
    let mut made: HashMap<(usize, usize, usize), Motion<M::Path>> = HashMap::new();
    let mut failed_jumps = vec![0usize; layers.len()];
    let mut labels = Labels::new(layers);
    let mut dirty = 0;
    let mut rounds = 0;
    loop {
        rounds += 1;
        labels.update(&bounds, dirty);
        let (choice, reached) = labels.path();
        if let Some(layer) = reached {
            return Err(Unreachable { layer });
        }
        let open: Vec<(usize, usize, usize)> = (0..layers.len())
            .map(|l| (l, if l == 0 { 0 } else { choice[l - 1] }, choice[l]))
            .filter(|key| !made.contains_key(key))
            .collect();
        if open.is_empty() {
            let motions: Vec<Motion<M::Path>> = (0..layers.len())
                .filter_map(|l| {
                    made.remove(&(l, if l == 0 { 0 } else { choice[l - 1] }, choice[l]))
                })
                .collect();
            let cost = motions.iter().map(|m| m.cost).sum();
            return Ok(LayeredPath { choice, motions, cost, rounds, made: made.len() });
        }
        let attempts: Vec<Option<Motion<M::Path>>> = open
            .par_iter()
            .map(|&(l, a, b)| {
                let to = &layers[l][b];
                if l == 0 {
                    return moves.jump(None, to);
                }
                let from = &layers[l - 1][a];
                match links[l - 1] {
                    Link::Surface { edge, reversed } if bounds.tracked(l, a, b) => {
                        moves.track((edge, reversed), from, to)
                    }
                    _ => moves.jump(Some(from), to),
                }
            })
            .collect();
        dirty = layers.len();
        for (&(l, a, b), attempt) in open.iter().zip(attempts) {
            dirty = dirty.min(l);
            match attempt {
                Some(motion) => {
                    bounds.set(l, a, b, motion.cost);
                    made.insert((l, a, b), motion);
                }
                None if bounds.tracked(l, a, b) => bounds.fall_back_to_jump(l, a, b, moves),
                None => {
                    failed_jumps[l] += 1;
                    bounds.set(l, a, b, f64::INFINITY);
                    if failed_jumps[l] > MAX_FAILED_JUMPS {
                        return Err(Unreachable { layer: l });
                    }
                }
            }
        }
    }
}

/// What is known of each edge's cost: the matrix into each layer, row-major from × to.
struct Bounds {
    into: Vec<Vec<f32>>,
    /// Whether the bound is of a tracked motion; else of a jump.
    tracked: Vec<Vec<bool>>,
    straight: Vec<Vec<f32>>,
    width: Vec<usize>,
}

impl Bounds {
    fn new<C: Cost, M: Moves>(
        cost: &C,
        continuous: &[bool; MAX_DOF],
        source: &JointVector,
        layers: &[Vec<Sample>],
        links: &[Link],
        moves: &M,
    ) -> Self {
        let rows: Vec<(Vec<f32>, Vec<bool>, Vec<f32>)> = (0..layers.len())
            .into_par_iter()
            .map(|l| {
                let froms: Vec<(JointVector, Option<&Sample>)> = if l == 0 {
                    vec![(*source, None)]
                } else {
                    layers[l - 1].iter().map(|s| (s.q, Some(s))).collect()
                };
                let size = froms.len() * layers[l].len();
                let (mut into, mut tracked, mut straights) =
                    (Vec::with_capacity(size), Vec::with_capacity(size), Vec::with_capacity(size));
                for (q, from) in &froms {
                    for to in &layers[l] {
                        let straight = cost.of(&displacement(continuous, q, &to.q));
                        let surface = l > 0
                            && matches!(links[l - 1], Link::Surface { .. })
                            && from.is_some_and(|f| f.branch == to.branch);
                        let bound =
                            if surface { straight } else { moves.jump_estimate(straight) };
                        into.push(bound as f32);
                        tracked.push(surface);
                        straights.push(straight as f32);
                    }
                }
                (into, tracked, straights)
            })
            .collect();
        let mut bounds = Self {
            into: Vec::new(),
            tracked: Vec::new(),
            straight: Vec::new(),
            width: layers.iter().map(Vec::len).collect(),
        };
        for (into, tracked, straight) in rows {
            bounds.into.push(into);
            bounds.tracked.push(tracked);
            bounds.straight.push(straight);
        }
        bounds
    }

    fn at(&self, l: usize, a: usize, b: usize) -> usize {
        a * self.width[l] + b
    }

    fn tracked(&self, l: usize, a: usize, b: usize) -> bool {
        self.tracked[l][self.at(l, a, b)]
    }

    fn set(&mut self, l: usize, a: usize, b: usize, cost: f64) {
        let at = self.at(l, a, b);
        self.into[l][at] = cost as f32;
    }

    fn fall_back_to_jump<M: Moves>(&mut self, l: usize, a: usize, b: usize, moves: &M) {
        let at = self.at(l, a, b);
        self.tracked[l][at] = false;
        self.into[l][at] = moves.jump_estimate(f64::from(self.straight[l][at])) as f32;
    }
}

/// The least cost to each sample and where it comes from.
struct Labels {
    cost: Vec<Vec<f32>>,
    from: Vec<Vec<u32>>,
}

impl Labels {
    fn new(layers: &[Vec<Sample>]) -> Self {
        Self {
            cost: layers.iter().map(|l| vec![f32::INFINITY; l.len()]).collect(),
            from: layers.iter().map(|l| vec![0; l.len()]).collect(),
        }
    }

    /// Recomputes the labels from layer `dirty` on.
    fn update(&mut self, bounds: &Bounds, dirty: usize) {
        for l in dirty..self.cost.len() {
            let (before, rest) = self.cost.split_at_mut(l);
            let (cost, from) = (&mut rest[0], &mut self.from[l]);
            cost.fill(f32::INFINITY);
            let width = cost.len();
            let source = [0.0f32];
            let previous = before.last().map_or(&source[..], |labels| &labels[..]);
            for (a, &label) in previous.iter().enumerate() {
                let row = &bounds.into[l][a * width..(a + 1) * width];
                for b in 0..width {
                    let candidate = label + row[b];
                    let better = candidate < cost[b];
                    cost[b] = if better { candidate } else { cost[b] };
                    from[b] = if better { a as u32 } else { from[b] };
                }
            }
        }
    }

    /// The cheapest path, or the first layer that nothing reaches.
    fn path(&self) -> (Vec<usize>, Option<usize>) {
        let unreached = self.cost.iter().position(|l| l.iter().all(|c| c.is_infinite()));
        let mut choice = vec![0; self.cost.len()];
        if unreached.is_none()
            && let Some(last) = self.cost.last()
        {
            let mut here = (0..last.len()).fold(0, |m, b| if last[b] < last[m] { b } else { m });
            for l in (0..self.cost.len()).rev() {
                choice[l] = here;
                here = self.from[l][here] as usize;
            }
        }
        (choice, unreached)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cost::Effort;
    use nullsweep_robot::Branch;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Motions whose true cost is the straight one plus a hidden surcharge; some fail.
    struct Hidden {
        straight_tracks: bool,
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
        fn track(&self, _: (usize, bool), from: &Sample, to: &Sample) -> Option<Motion<()>> {
            let extra = if self.straight_tracks { 0.0 } else { surcharge(from, to) };
            extra.is_finite().then(|| Motion { cost: straight(&from.q, &to.q) + extra, path: () })
        }
        fn jump(&self, from: Option<&Sample>, to: &Sample) -> Option<Motion<()>> {
            let start = from.map_or([0.0; MAX_DOF], |s| s.q);
            Some(Motion { cost: self.jump_estimate(straight(&start, &to.q)), path: () })
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
                        Sample { q, branch, redundancy: 0.0, heading: 0.0 }
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
    fn brute_force(layers: &[Vec<Sample>], links: &[Link], moves: &Hidden) -> f64 {
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
                            let tracked = (matches!(links[l - 1], Link::Surface { .. })
                                && from.branch == to.branch)
                                .then(|| moves.track((0, false), from, to))
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

    #[test]
    fn lazy_search_finds_the_shortest_true_path() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        for trial in 0..200 {
            let (layers, links) = layers(&mut rng, 1 + trial % 9);
            let moves = Hidden { straight_tracks: trial % 3 == 0 };
            let found =
                shortest(&Effort, &[false; MAX_DOF], &[0.0; MAX_DOF], &layers, &links, &moves)
                    .expect("jumps reach every layer");
            let expected = brute_force(&layers, &links, &moves);
            assert!((found.cost - expected).abs() < 1e-4, "{} {expected}", found.cost);
        }
    }

    #[test]
    fn an_empty_layer_is_named() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let (mut layers, links) = layers(&mut rng, 4);
        layers[2].clear();
        let moves = Hidden { straight_tracks: true };
        let result =
            shortest(&Effort, &[false; MAX_DOF], &[0.0; MAX_DOF], &layers, &links, &moves);
        assert_eq!(result.err(), Some(Unreachable { layer: 2 }));
    }
}
