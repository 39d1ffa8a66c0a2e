//! The search through the layers.

use std::collections::{HashMap, HashSet};

use nullsweep_robot::JointVector;
use rayon::prelude::*;

use super::labels::{Cost, Ends, Givens, HERE, Labels, Link};
use super::layer::{COARSE, FINE, Layer, Node, extend};
use super::problem::Problem;
use super::station::{Station, apart};
use super::ways::Ways;
use crate::poses::Point;

/// Layers are about so many spacings of places apart.
const STRIDE: f64 = 4.0;
/// How often the layers about a place that no way leads past are made denser before the posture is
/// changed.
const DENSER: usize = 2;

/// A part of what was found.
#[derive(Clone, Debug)]
pub(super) enum Part {
    /// Along the path, from place to place.
    Run(Vec<(Station, Point)>),
    /// Through free space, both ends included; whether it is a reconfiguration within a segment.
    Way { path: Vec<JointVector>, reconfigures: bool },
}

/// The best path.
pub(super) struct Found {
    pub(super) parts: Vec<Part>,
    /// Its reconfigurations and its least movement, see [`Labels`].
    pub(super) cost: Cost,
    pub(super) layers: usize,
    pub(super) samples: usize,
}

/// A motion on the best path: by layer and node.
#[derive(Clone, Copy, Debug)]
enum Move {
    Begin(usize),
    Track(usize, usize, usize),
    Switch(usize, usize, usize),
    Way(usize, usize, usize),
}

struct Ladder<'a> {
    problem: &'a Problem<'a>,
    layers: Vec<Layer>,
    links: Vec<Link>,
    tracks: HashMap<(Node, Node), Vec<Point>>,
    ways: Ways,
    /// Places that nothing was found for.
    dead: HashSet<(usize, usize)>,
    /// How often the way into a layer was made denser.
    denser: HashMap<(usize, usize), usize>,
    switches: bool,
}

/// The path with the fewest reconfigurations and, among those, the least movement over the samples.
/// What cannot be come to is not on it.
pub(super) fn search(problem: &Problem<'_>) -> Found {
    let mut ladder = Ladder::new(problem);
    let (mut labels, mut dirty) = (Labels::default(), 0);
    loop {
        if ladder.layers.is_empty() {
            return ladder.found(&[], Cost(0, 0.0));
        }
        if let Some(p) = labels.update(&ladder.givens(), dirty) {
            dirty = ladder.cut_off(p);
            continue;
        }
        let (moves, cost) = ladder.path(&labels);
        match ladder.make(&moves) {
            Some(changed) => dirty = changed,
            None => return ladder.found(&moves, cost),
        }
    }
}

impl<'a> Ladder<'a> {
    fn new(problem: &'a Problem<'a>) -> Self {
        let mut layers: Vec<Layer> = Vec::new();
        let mut dead = HashSet::new();
        for (segment, stations) in problem.segments.iter().enumerate() {
            let first = layers.len();
            for station in spread(stations) {
                let others = layers[first..].last().map_or(&[][..], |layer| &layer.nodes);
                let mut nodes = Vec::new();
                extend(&mut nodes, &problem.space, &stations[station].pose, others, true, COARSE);
                match nodes.is_empty() {
                    true => drop(dead.insert((segment, station))),
                    false => layers.push(Layer { segment, station, nodes }),
                }
            }
            for k in (first..layers.len().saturating_sub(1)).rev() {
                let (before, after) = layers.split_at_mut(k + 1);
                let pose = &stations[before[k].station].pose;
                extend(&mut before[k].nodes, &problem.space, pose, &after[0].nodes, false, COARSE);
            }
        }
        let mut ladder = Self {
            problem,
            links: Vec::new(),
            layers,
            tracks: HashMap::new(),
            ways: Ways::new(problem),
            dead,
            denser: HashMap::new(),
            switches: false,
        };
        ladder.links = (0..ladder.layers.len()).into_par_iter().map(|p| ladder.link(p)).collect();
        ladder
    }

    fn givens(&self) -> Givens<'_> {
        Givens {
            layers: &self.layers,
            links: &self.links,
            start: self.problem.start.as_ref(),
            continuous: self.problem.cell.arm.continuous(),
            blocked: &self.ways.blocked,
            stuck: &self.ways.stuck,
            switches: self.switches,
        }
    }

    /// How a layer is come to from the one before it, as far as is known beforehand.
    fn link(&self, p: usize) -> Link {
        let Some(before) = p.checked_sub(1).map(|b| &self.layers[b]) else {
            return Link::Way { gap: false };
        };
        let layer = &self.layers[p];
        if before.segment != layer.segment {
            return Link::Way { gap: false };
        }
        let places = (layer.station - before.station) as f64;
        let most = self.steps(places);
        let rungs = layer.nodes.iter().map(|to| {
            let near = |(k, from): (usize, &Point)| {
                let within = (0..most.len()).all(|j| (to.q[j] - from.q[j]).abs() <= most[j]);
                within.then(|| (k as u32, from.q.distance(&to.q) as f32))
            };
            before.nodes.iter().enumerate().filter_map(near).collect()
        });
        Link::Track(rungs.collect())
    }

    /// What each joint may move over so many places.
    fn steps(&self, places: f64) -> Vec<f64> {
        let arm = self.problem.cell.arm;
        let kind = |j: usize| self.problem.step[usize::from(!arm.is_revolute(j))];
        (0..arm.dof()).map(|j| places * kind(j)).collect()
    }

    /// The best path under what is known.
    fn path(&self, labels: &Labels) -> (Vec<Move>, Cost) {
        let Some((mut here, cost)) = labels.last() else { return (Vec::new(), Cost::NONE) };
        let mut moves = Vec::new();
        for p in (0..self.layers.len()).rev() {
            let from = labels.come[p][here].from;
            let Some(before) = p.checked_sub(1) else {
                moves.push(Move::Begin(here));
                break;
            };
            let a = from as usize;
            moves.push(match &self.links[p] {
                Link::Track(_) => Move::Track(p, a, here),
                Link::Way { .. } => Move::Way(p, a, here),
            });
            here = a;
            let switched = labels.leave[before][a].from;
            if switched != HERE {
                moves.push(Move::Switch(before, switched as usize, a));
                here = switched as usize;
            }
        }
        moves.reverse();
        (moves, cost)
    }

    /// Makes the motions of the path that are not made yet, those along the path first; the first layer
    /// whose labels changed by one that failed, `None` where all are made.
    fn make(&mut self, moves: &[Move]) -> Option<usize> {
        let open: Vec<(usize, usize, usize)> = moves
            .iter()
            .filter_map(|step| match *step {
                Move::Track(p, a, b) if !self.tracks.contains_key(&self.rung(p, a, b)) => {
                    Some((p, a, b))
                }
                _ => None,
            })
            .collect();
        let made: Vec<Option<Vec<Point>>> =
            open.par_iter().map(|&(p, a, b)| self.track(p, a, b)).collect();
        let mut dirty = None;
        for (&(p, a, b), made) in open.iter().zip(made) {
            if let Some(points) = made {
                self.tracks.insert(self.rung(p, a, b), points);
                continue;
            }
            if let Link::Track(rungs) = &mut self.links[p] {
                rungs[b].retain(|(from, _)| *from as usize != a);
            }
            dirty = dirty.or(Some(p));
        }
        dirty.or_else(|| moves.iter().find_map(|step| self.make_way(*step)))
    }

    /// The two ends of a motion along the path.
    fn rung(&self, p: usize, a: usize, b: usize) -> (Node, Node) {
        (self.layers[p - 1].node(a), self.layers[p].node(b))
    }

    /// Follows the path from a joint vector to one of the next layer: what is between.
    fn track(&self, p: usize, a: usize, b: usize) -> Option<Vec<Point>> {
        let (before, layer) = (&self.layers[p - 1], &self.layers[p]);
        let (from, to) = (before.nodes[a], layer.nodes[b]);
        let places = layer.station - before.station;
        let stations = &self.problem.segments[layer.segment][before.station + 1..layer.station];
        let mut points = Vec::with_capacity(places);
        let mut last = from;
        for (k, station) in stations.iter().enumerate() {
            let even = from.q.lerp(&to.q, (k + 1) as f64 / places as f64);
            let point = self.problem.space.project(&station.pose, &even)?;
            self.problem.step(&last, &point)?;
            points.push(point);
            last = point;
        }
        self.problem.step(&last, &to)?;
        Some(points)
    }

    /// Makes a way through free space, if it is one and is not made yet; the layer that changes where
    /// it fails.
    fn make_way(&mut self, step: Move) -> Option<usize> {
        let (p, (from, to)) = self.ends(step)?;
        let goal = self.point(to).q;
        let start = match from {
            Some(from) => self.point(from).q,
            None => self.problem.start?,
        };
        let is_made = self.ways.make(self.problem, &self.layers, (from, &start), (to, &goal));
        (!is_made).then_some(p)
    }

    /// The layer and the ends of a way through free space.
    fn ends(&self, step: Move) -> Option<(usize, Ends)> {
        match step {
            Move::Begin(b) => {
                self.problem.start?;
                Some((0, (None, self.layers[0].node(b))))
            }
            Move::Track(..) => None,
            Move::Switch(p, a, b) => {
                Some((p, (Some(self.layers[p].node(a)), self.layers[p].node(b))))
            }
            Move::Way(p, a, b) => {
                Some((p, (Some(self.layers[p - 1].node(a)), self.layers[p].node(b))))
            }
        }
    }

    fn point(&self, (segment, station, index): Node) -> Point {
        let at = |layer: &&Layer| (layer.segment, layer.station) == (segment, station);
        let layer = self.layers.iter().find(at).unwrap_or(&self.layers[0]);
        layer.nodes[index as usize]
    }

    /// No way leads into a layer: the samples become denser there, then the posture may change, then
    /// what cannot be followed is passed over, or what is behind it left out. The first layer that
    /// changed.
    fn cut_off(&mut self, p: usize) -> usize {
        if !matches!(self.links[p], Link::Track(_)) {
            return self.leave_out(p);
        }
        let key = (self.layers[p].segment, self.layers[p].station);
        let denser = self.denser.entry(key).or_default();
        *denser += 1;
        if !self.switches && *denser > DENSER {
            self.switches = true;
            return 0;
        }
        match self.between(p) {
            Some(station) => self.insert(p, station, *self.denser.get(&key).unwrap_or(&0)),
            None if !self.switches => self.switches = true,
            None => self.links[p] = Link::Way { gap: true },
        }
        if self.switches { 0 } else { p.saturating_sub(1) }
    }

    /// Through free space nothing comes to a layer. It is left out where it is shut in itself; where only
    /// the one before it is, from which nothing leads away, that one is. The first layer that changed.
    fn leave_out(&mut self, p: usize) -> usize {
        let [open, _] = self.ways.known(&self.layers[p]);
        let shut = |before: &usize| self.ways.known(&self.layers[*before])[1];
        let out = p.checked_sub(1).filter(|before| open && shut(before)).unwrap_or(p);
        self.layers.remove(out);
        self.links.remove(out);
        let before = out.checked_sub(1).map(|before| self.layers[before].segment);
        if let (Some(link), Some(layer)) = (self.links.get_mut(out), self.layers.get(out)) {
            *link = Link::Way { gap: before == Some(layer.segment) };
        }
        out.saturating_sub(1)
    }

    /// A place in the middle between a layer and the one before it that may have joint vectors.
    fn between(&self, p: usize) -> Option<usize> {
        let (from, to) = (self.layers[p - 1].station, self.layers[p].station);
        let middle = usize::midpoint(from, to);
        let segment = self.layers[p].segment;
        let open = (from + 1..to).filter(|s| !self.dead.contains(&(segment, *s)));
        open.min_by_key(|s| s.abs_diff(middle))
    }

    /// Puts a layer before layer `p`, sampled densely, and the two beside it too.
    fn insert(&mut self, p: usize, station: usize, denser: usize) {
        let segment = self.layers[p].segment;
        let stations = &self.problem.segments[segment];
        let space = &self.problem.space;
        let mut nodes = Vec::new();
        let others = [self.layers[p - 1].nodes.as_slice(), &self.layers[p].nodes].concat();
        extend(&mut nodes, space, &stations[station].pose, &others, true, FINE);
        if nodes.is_empty() {
            self.dead.insert((segment, station));
            return;
        }
        if denser <= DENSER {
            for beside in [p - 1, p] {
                let layer = &mut self.layers[beside];
                let pose = &stations[layer.station].pose;
                extend(&mut layer.nodes, space, pose, &nodes, true, FINE);
            }
        }
        self.layers.insert(p, Layer { segment, station, nodes });
        self.links.insert(p, Link::Way { gap: false });
        for changed in p.saturating_sub(1)..(p + 3).min(self.layers.len()) {
            if !matches!(self.links[changed], Link::Way { gap: true }) {
                self.links[changed] = self.link(changed);
            }
        }
    }

    /// The parts of the path, its motions all made.
    fn found(mut self, moves: &[Move], cost: Cost) -> Found {
        let mut parts: Vec<Part> = Vec::new();
        let place = |layers: &[Layer], problem: &Problem<'_>, p: usize, k: usize| {
            let layer = &layers[p];
            (problem.segments[layer.segment][layer.station], layer.nodes[k])
        };
        for &step in moves {
            let reconfigures = match step {
                Move::Track(p, a, b) => {
                    let (before, layer) = (&self.layers[p - 1], &self.layers[p]);
                    let stations = &self.problem.segments[layer.segment];
                    let between = &stations[before.station + 1..layer.station];
                    let points = self.tracks.remove(&self.rung(p, a, b)).unwrap_or_default();
                    if let Some(Part::Run(run)) = parts.last_mut() {
                        run.extend(between.iter().copied().zip(points));
                        run.push(place(&self.layers, self.problem, p, b));
                    }
                    continue;
                }
                Move::Begin(_) => false,
                Move::Switch(..) => true,
                Move::Way(p, ..) => matches!(self.links[p], Link::Way { gap: true }),
            };
            if let Some(path) = self.ends(step).and_then(|(_, ends)| self.ways.take(&ends)) {
                parts.push(Part::Way { path, reconfigures });
            }
            let (p, k) = match step {
                Move::Begin(b) => (0, b),
                Move::Switch(p, _, b) | Move::Way(p, _, b) | Move::Track(p, _, b) => (p, b),
            };
            parts.push(Part::Run(vec![place(&self.layers, self.problem, p, k)]));
        }
        let samples = self.layers.iter().map(|layer| layer.nodes.len()).sum();
        Found { parts, cost, layers: self.layers.len(), samples }
    }
}

/// The places of a segment that become layers: its ends, and about each [`STRIDE`]th.
fn spread(stations: &[Station]) -> Vec<usize> {
    let mut chosen = vec![0];
    let mut gone = 0.0;
    for k in 1..stations.len() {
        gone += apart(&stations[k - 1].pose, &stations[k].pose);
        if gone >= STRIDE || k + 1 == stations.len() {
            chosen.push(k);
            gone = 0.0;
        }
    }
    chosen
}
