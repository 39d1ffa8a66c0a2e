use std::sync::atomic::{AtomicUsize, Ordering};

use nullsweep_robot::Branch;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::cost::Effort;
use crate::roadmap::TrackFailure;

/// Motions whose true cost is the straight one plus a hidden surcharge; some fail.
struct Hidden {
    straight_tracks: bool,
    links: Vec<Link>,
}

fn surcharge(from: &Sample, to: &Sample) -> f64 {
    let mix = libm::sin(from.q[0] * 7919.0 + to.q[0] * 104_729.0).abs();
    if mix > 0.9 { f64::INFINITY } else { mix * 3.0 }
}

fn straight(a: &JointVector, b: &JointVector) -> f64 {
    Effort.of(&a.displacement(b))
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
        let start = from.map_or(JointVector::ZERO, |s| s.q);
        Some(Motion { cost: self.jump_estimate(straight(&start, &to.q)), path: () })
    }
    fn lifts(&self, _: &Sample) -> bool {
        true
    }
    fn is_joined(&self, _: &Sample) -> bool {
        true
    }
    fn are_alike(&self, a: &Sample, b: &Sample) -> bool {
        a == b
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
                    let mut q = JointVector::ZERO;
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
    let mut best: Vec<f64> =
        layers[0].iter().map(|s| moves.jump(None, s).map_or(f64::INFINITY, |m| m.cost)).collect();
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
    let source = JointVector::ZERO;
    let path = shortest(&Effort, Continuous::default(), &source, layers, moves, &mut |l| {
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
    libm::sin(from[0] * 7919.0 + to[0] * 104_729.0) > 0.3
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
        let start = from.map_or(JointVector::ZERO, |s| s.q);
        let is_open = from.is_none() || opens(&start, &to.q);
        is_open.then(|| Motion { cost: 1.0 + straight(&start, &to.q), path: () })
    }
    fn lifts(&self, _: &Sample) -> bool {
        true
    }
    fn is_joined(&self, _: &Sample) -> bool {
        true
    }
    fn are_alike(&self, a: &Sample, b: &Sample) -> bool {
        a == b
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
        let source = JointVector::ZERO;
        let path = shortest(&Effort, Continuous::default(), &source, &layers, &Gates, &mut |_| {
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
    fn track(&self, _: (usize, bool), from: &Sample, to: &Sample) -> Result<Motion<()>, Blocked> {
        Ok(Motion { cost: straight(&from.q, &to.q), path: () })
    }
    fn around(&self, _: (usize, bool), _: &Sample, _: &Sample) -> Option<Motion<()>> {
        unreachable!("no track is blocked")
    }
    fn jump(&self, from: Option<&Sample>, to: &Sample) -> Option<Motion<()>> {
        let start = from.map_or(JointVector::ZERO, |s| s.q);
        let goes = self.lifts(to) && from.is_none_or(|from| self.lifts(from));
        goes.then(|| Motion { cost: 1.0 + straight(&start, &to.q), path: () })
    }
    fn lifts(&self, at: &Sample) -> bool {
        at.heading != 1.0
    }
    fn is_joined(&self, _: &Sample) -> bool {
        true
    }
    fn are_alike(&self, a: &Sample, b: &Sample) -> bool {
        a == b
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
        let source = JointVector::ZERO;
        let path = shortest(&Effort, Continuous::default(), &source, &layers, &Trap, &mut |l| {
            left_out.push(l)
        });
        assert_eq!((path.layers, left_out), (vec![0, 2, 3, 4], vec![1]));
    }
}

/// No jump leads into the second layer; counts those that are asked for.
struct Wall(AtomicUsize);

impl Moves for Wall {
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
        let Some(from) = from else {
            return Some(Motion { cost: straight(&JointVector::ZERO, &to.q), path: () });
        };
        if to.heading == 1.0 {
            self.0.fetch_add(1, Ordering::Relaxed);
            return None;
        }
        Some(Motion { cost: straight(&from.q, &to.q), path: () })
    }
    fn lifts(&self, _: &Sample) -> bool {
        true
    }
    fn is_joined(&self, _: &Sample) -> bool {
        true
    }
    fn are_alike(&self, a: &Sample, b: &Sample) -> bool {
        a.branch == b.branch
    }
    fn jump_estimate(&self, straight: f64) -> f64 {
        straight
    }
}

#[test]
fn a_jump_that_fails_is_not_tried_again_between_samples_that_are_alike() {
    let mut rng = ChaCha8Rng::seed_from_u64(13);
    for _ in 0..50 {
        // Six samples a layer, of two kinds: thirty-six jumps, of four kinds.
        let layers: Vec<Vec<Sample>> = (0..3)
            .map(|layer| {
                let sample = |k: u8| {
                    let mut q = JointVector::ZERO;
                    q[..3].fill_with(|| rng.random_range(-2.0..2.0));
                    let (branch, heading) = (Branch(k % 2), f64::from(layer));
                    Sample { q, branch, redundancy: 0.0, heading }
                };
                (0..6).map(sample).collect()
            })
            .collect();
        let wall = Wall(AtomicUsize::new(0));
        let mut left_out = Vec::new();
        let source = JointVector::ZERO;
        let path = shortest(&Effort, Continuous::default(), &source, &layers, &wall, &mut |l| {
            left_out.push(l)
        });
        assert_eq!((path.layers, left_out), (vec![0, 2], vec![1]));
        let tried = wall.0.into_inner();
        assert!((1..=4).contains(&tried), "{tried} jumps tried");
    }
}
