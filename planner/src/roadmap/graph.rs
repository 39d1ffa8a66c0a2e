//! The Euclidean graph over the reachable patches (paper §III.A), with tracked edges.

use std::collections::HashSet;

use nalgebra::Isometry3;
use nullsweep_surface::Patch;
use rayon::prelude::*;

use super::edge::{Edge, GraphConfig};
use super::path::ToolPath;
use crate::progress::Progress;
use crate::workcell::{Bed, Sample, Workcell, contact_pose, direction, middle_out, redundancies};

/// Turns of the pad from the direction of travel that are tried, the paper's own first: the long
/// side across the travel. \[°\]
const TURNS: [f64; 6] = [0.0, 30.0, -30.0, 60.0, -60.0, 90.0];

/// The graph. Nodes are indices into the patches it was built from.
#[derive(Clone, Debug)]
pub struct Graph {
    /// The edges that exist, in a fixed order.
    pub edges: Vec<Edge>,
    /// For each patch the indices of its edges; empty for unreachable patches.
    pub incident: Vec<Vec<usize>>,
    /// The connected components with at least one patch, largest first, patches ascending.
    pub components: Vec<Vec<usize>>,
    /// Pairs of neighbours that were tried.
    pub candidates: usize,
    /// Those of them (a < b) that no edge joins.
    apart: HashSet<(usize, usize)>,
}

impl Graph {
    /// With these edges over the reached patches.
    pub(crate) fn of(
        edges: Vec<Edge>,
        reached: &[Option<Sample>],
        apart: Vec<(usize, usize)>,
    ) -> Self {
        let mut incident = vec![Vec::new(); reached.len()];
        for (i, e) in edges.iter().enumerate() {
            incident[e.a].push(i);
            incident[e.b].push(i);
        }
        let components = components(&edges, &incident, reached);
        let candidates = edges.len() + apart.len();
        Self { edges, incident, components, candidates, apart: apart.into_iter().collect() }
    }

    /// It with the edges of another graph, whose nodes stand at a `place` among its own.
    #[must_use]
    pub fn joined(mut self, other: Self, place: impl Fn(usize) -> usize) -> Self {
        for edge in other.edges {
            let edge = Edge { a: place(edge.a), b: place(edge.b), ..edge };
            let most = edge.a.max(edge.b);
            self.incident.resize(self.incident.len().max(most + 1), Vec::new());
            self.incident[edge.a].push(self.edges.len());
            self.incident[edge.b].push(self.edges.len());
            self.edges.push(edge);
        }
        let components = other.components.into_iter();
        self.components.extend(components.map(|of| of.into_iter().map(&place).collect()));
        self.components.sort_by_key(|component: &Vec<usize>| std::cmp::Reverse(component.len()));
        self.candidates += other.candidates;
        self.apart.extend(other.apart.into_iter().map(|(a, b)| (place(a), place(b))));
        self
    }

    /// The edge between two patches.
    #[must_use]
    pub fn between(&self, a: usize, b: usize) -> Option<usize> {
        self.incident.get(a)?.iter().copied().find(|&e| self.edges[e].other(a) == b)
    }

    /// What was found between two patches, a < b; `None` if they were not tried.
    fn known(&self, a: usize, b: usize) -> Option<Option<Edge>> {
        match self.between(a, b) {
            Some(edge) => Some(Some(self.edges[edge].clone())),
            None => self.apart.contains(&(a, b)).then_some(None),
        }
    }
}

/// What a graph is built over.
#[derive(Clone, Copy)]
pub struct Nodes<'a> {
    /// What the pad lies on.
    pub bed: &'a Bed,
    /// Its patches.
    pub patches: &'a [Patch],
    /// A sample of each patch that is to be a node.
    pub reached: &'a [Option<Sample>],
}

/// Builds the graph over the patches that are reached: each patch's nearest neighbours
/// within the radius, in the union of both directions, joined where a surface line exists and
/// some branch can be followed along it: at one redundancy value, or else with a detour. What
/// `before` found between the first patches, which must be the same, is taken over.
#[must_use]
pub fn build(
    cell: Workcell<'_>,
    nodes: Nodes<'_>,
    config: &GraphConfig,
    before: Option<&Graph>,
    progress: &dyn Progress,
) -> Graph {
    let Nodes { patches, reached, .. } = nodes;
    let pairs = neighbour_pairs(patches, reached, config);
    progress.stage("graph", Some(pairs.len()));
    let values = middle_out(redundancies(cell.arm.ik().redundancy_range(), config.edge_samples));
    let tried: Vec<Option<Edge>> = pairs
        .par_iter()
        .map(|&(a, b)| {
            let known = before.and_then(|graph| graph.known(a, b));
            let edge = known.unwrap_or_else(|| join(cell, nodes, config, &values, (a, b)));
            progress.tick();
            edge
        })
        .collect();
    let apart = pairs.iter().zip(&tried).filter(|(_, e)| e.is_none()).map(|(p, _)| *p).collect();
    Graph::of(tried.into_iter().flatten().collect(), reached, apart)
}

/// A pair of patches, and the pad's heading at each of them. \[rad\]
pub type Step = [(usize, f64); 2];

/// The graph of given steps, patches joined wherever a surface line leads and some branch can be
/// followed along it at one redundancy value, the pad at these headings.
#[must_use]
pub fn of_steps(
    cell: Workcell<'_>,
    nodes: Nodes<'_>,
    config: &GraphConfig,
    steps: &[Step],
) -> Graph {
    let Nodes { bed, patches, reached } = nodes;
    let values = middle_out(redundancies(cell.arm.ik().redundancy_range(), config.edge_samples));
    let tried: Vec<Option<Edge>> = steps
        .par_iter()
        .map(|&[(a, from), (b, to)]| {
            let edge = Edge::between(bed, patches, a, b, config, cell.tool.track()[1])?;
            let mut turned = TurnedEdge::at(cell, patches, edge, [from, to]);
            turned.is_followed(cell, &values).then_some(turned.edge)
        })
        .collect();
    let pairs = steps.iter().map(|[(a, _), (b, _)]| (*a.min(b), *a.max(b)));
    let apart = pairs.zip(&tried).filter(|(_, edge)| edge.is_none()).map(|(p, _)| p).collect();
    Graph::of(tried.into_iter().flatten().collect(), reached, apart)
}

/// The edge between two patches, if some branch can be followed along it.
fn join(
    cell: Workcell<'_>,
    nodes: Nodes<'_>,
    config: &GraphConfig,
    values: &[f64],
    (a, b): (usize, usize),
) -> Option<Edge> {
    let Nodes { bed, patches, .. } = nodes;
    let edge = Edge::between(bed, patches, a, b, config, cell.tool.track()[1])?;
    let turns = TURNS.iter().filter(|turn| cell.tool.may_travel(turn.to_radians()));
    let mut turned: Vec<TurnedEdge> =
        turns.map(|turn| TurnedEdge::new(cell, patches, &edge, *turn)).collect();
    let even = turned.iter_mut().position(|edge| edge.is_followed(cell, values));
    let found = even.or_else(|| turned.iter().position(|edge| edge.has_detour(cell, values)))?;
    Some(turned.swap_remove(found).edge)
}

/// How many edges of the graph that [`build`] would give lead on from each patch, counted up to
/// `enough`: short ones are looked for first, and none where both patches have enough. `None` as soon
/// as `is_hopeless` is true of what the numbers can still become at most.
#[must_use]
pub fn joined(
    cell: Workcell<'_>,
    nodes: Nodes<'_>,
    config: &GraphConfig,
    enough: usize,
    is_hopeless: impl Fn(&[usize]) -> bool,
) -> Option<Vec<usize>> {
    let Nodes { patches, reached, .. } = nodes;
    let mut pairs = neighbour_pairs(patches, reached, config);
    let apart = |&(a, b): &(usize, usize)| (patches[a].centre - patches[b].centre).norm();
    pairs.sort_by(|x, y| apart(x).total_cmp(&apart(y)).then(x.cmp(y)));
    let values = middle_out(redundancies(cell.arm.ik().redundancy_range(), config.edge_samples));
    // Edges of each patch that were found, and that are not ruled out.
    let (mut found, mut open) = (vec![0; patches.len()], vec![0; patches.len()]);
    for i in pairs.iter().flat_map(|&(a, b)| [a, b]) {
        open[i] += 1;
    }
    let most = |open: &[usize]| -> Vec<usize> { open.iter().map(|&n| n.min(enough)).collect() };
    for (a, b) in pairs {
        if is_hopeless(&most(&open)) {
            return None;
        }
        if found[a] >= enough && found[b] >= enough {
            continue;
        }
        let is_joined = join(cell, nodes, config, &values, (a, b)).is_some();
        for i in [a, b] {
            if is_joined {
                found[i] += 1;
            } else {
                open[i] -= 1;
            }
        }
    }
    Some(most(&found))
}

/// The graph of the paper's model, between whose nodes no arm is followed: each patch's nearest
/// neighbours joined wherever a surface line leads.
#[must_use]
pub fn unchecked(nodes: Nodes<'_>, config: &GraphConfig, wave: f64) -> Graph {
    let Nodes { bed, patches, reached } = nodes;
    let (mut edges, mut apart) = (Vec::new(), Vec::new());
    for (a, b) in neighbour_pairs(patches, reached, config) {
        match Edge::between(bed, patches, a, b, config, wave) {
            Some(edge) => edges.push(edge),
            None => apart.push((a, b)),
        }
    }
    Graph::of(edges, reached, apart)
}

/// Pairs (a < b) of reachable patches of which one is among the other's nearest.
fn neighbour_pairs(
    patches: &[Patch],
    reached: &[Option<Sample>],
    config: &GraphConfig,
) -> Vec<(usize, usize)> {
    let nodes: Vec<usize> = (0..patches.len()).filter(|&i| reached[i].is_some()).collect();
    let mut pairs = Vec::new();
    for &i in &nodes {
        let mut near: Vec<(f64, usize)> = nodes
            .iter()
            .filter(|&&j| j != i)
            .map(|&j| ((patches[j].centre - patches[i].centre).norm(), j))
            .filter(|&(d, _)| d <= config.radius && d > 1e-6)
            .collect();
        near.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        pairs.extend(near.iter().take(config.neighbours).map(|&(_, j)| (i.min(j), i.max(j))));
    }
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}

/// An edge with the pad turned from it.
struct TurnedEdge {
    edge: Edge,
    path: ToolPath,
    /// Contact pose and heading at both ends.
    ends: [(Isometry3<f64>, f64); 2],
    /// The samples at its start, as far as they were asked for.
    from: Vec<Sample>,
}

impl TurnedEdge {
    /// `turn` in \[°\].
    fn new(cell: Workcell<'_>, patches: &[Patch], edge: &Edge, turn: f64) -> Self {
        let edge = Edge { turn: turn.to_radians(), ..edge.clone() };
        let headings = [edge.heading_a + edge.turn, edge.heading_b + edge.turn];
        Self::at(cell, patches, edge, headings)
    }

    /// With the pad's heading at both ends. \[rad\]
    fn at(cell: Workcell<'_>, patches: &[Patch], edge: Edge, headings: [f64; 2]) -> Self {
        let stand_off = cell.tool.stand_off;
        let path = ToolPath::along(&edge, false, headings[0], headings[1], stand_off);
        let end = |patch: usize, heading: f64| {
            let patch = &patches[patch];
            let travel = direction(&patch.normal, heading);
            (contact_pose(&patch.centre, &patch.normal, &travel, stand_off), heading)
        };
        let ends = [end(edge.a, headings[0]), end(edge.b, headings[1])];
        Self { edge, path, ends, from: Vec::new() }
    }

    /// Whether one branch can be followed at one of the redundancy values.
    fn is_followed(&mut self, cell: Workcell<'_>, values: &[f64]) -> bool {
        let [(start, first), (end, last)] = &self.ends;
        let mut to = Vec::new();
        values.iter().any(|value| {
            let value = std::slice::from_ref(value);
            let before = self.from.len();
            cell.samples(start, *first, value, &mut self.from);
            let from = &self.from[before..];
            if from.is_empty() {
                return false;
            }
            to.clear();
            cell.samples(end, *last, value, &mut to);
            from.iter().any(|f| {
                let mut same = to.iter().filter(|t| t.branch == f.branch);
                same.any(|t| cell.follow(&self.path, f, t).is_ok())
            })
        })
    }

    /// Whether one branch can be followed where none of the values by itself can, going from one
    /// to another.
    fn has_detour(&self, cell: Workcell<'_>, values: &[f64]) -> bool {
        if self.from.is_empty() || values.len() < 2 {
            return false;
        }
        let (end, last) = &self.ends[1];
        let mut to = Vec::new();
        cell.samples(end, *last, values, &mut to);
        cell.detour(&self.path, &self.from, &to).is_some()
    }
}

/// Connected components of the reachable patches.
fn components(
    edges: &[Edge],
    incident: &[Vec<usize>],
    reached: &[Option<Sample>],
) -> Vec<Vec<usize>> {
    let mut seen: Vec<bool> = reached.iter().map(Option::is_none).collect();
    let mut components = Vec::new();
    for start in 0..reached.len() {
        if seen[start] {
            continue;
        }
        seen[start] = true;
        let mut component = vec![start];
        let mut next = 0;
        while next < component.len() {
            let here = component[next];
            next += 1;
            for &e in &incident[here] {
                let other = edges[e].other(here);
                if !seen[other] {
                    seen[other] = true;
                    component.push(other);
                }
            }
        }
        component.sort_unstable();
        components.push(component);
    }
    components.sort_by_key(|c| (std::cmp::Reverse(c.len()), c[0]));
    components
}
