//! The order in which patches are visited, as a (generalised) travelling salesman problem
//! (paper §III.B and §IV).

use std::collections::HashMap;

use nalgebra::Isometry3;
use nullsweep_gtsp::{
    self as gtsp, Block, Budget, Costs, Ends, Instance, InstanceError, Jump, SolveError,
};
use nullsweep_robot::Tool;
use nullsweep_surface::Patch;
use serde::{Deserialize, Serialize};

use crate::roadmap::Graph;
use crate::workcell::{contact_pose, direction};

/// What the formulation needs besides the graph.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FormulationConfig {
    /// Weight of turning against distance (Eq. 4; paper §V: 0.9).
    pub beta: f64,
    /// Trials of the search for each patch.
    pub trials_per_cluster: u64,
    /// Begin at the patch nearest the tool, where the paper cuts its tour, whatever the way there
    /// costs; else that way is weighed with the rest.
    pub from_nearest: bool,
}

impl Default for FormulationConfig {
    fn default() -> Self {
        Self { beta: 0.9, trials_per_cluster: 100, from_nearest: false }
    }
}

/// One tool pose of the tour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// The patch.
    pub patch: usize,
    /// The pad's heading there. \[rad\]
    pub heading: f64,
}

/// Why there is no order.
#[derive(Debug, thiserror::Error)]
pub enum FormulationError {
    /// The instance is not one.
    #[error("the order's instance: {0}")]
    Instance(#[from] InstanceError),
    /// The solver cannot solve it.
    #[error("the order's search: {0}")]
    Solve(#[from] SolveError),
    /// A raster was asked for where the patches are given.
    #[error("a raster is no order of patches: it has places of its own")]
    NoOrder,
}

/// Price of going between patches that no edge joins (Eq. 3's h): more than any whole tour. \[m\]
/// or weighed [m and rad]
pub const JUMP: f64 = 1e4;

/// [`Method::Tsp`](crate::plan::Method::Tsp): the shortest Euclidean path, from `tool_pose` (the contact frame in the root
/// frame) on, the headings along it.
///
/// # Errors
/// A cost that is not a number; it does not occur for finite patches.
pub fn shortest(
    graph: &Graph,
    patches: &[Patch],
    tool: &Tool,
    tool_pose: &Isometry3<f64>,
    config: &FormulationConfig,
    seed: u64,
) -> Result<Vec<Stop>, FormulationError> {
    over_components(graph, patches, tool, tool_pose, |component, here| {
        Problem { graph, patches, tool, component, start: *here, config }.shortest(seed)
    })
}

/// [`Method::Curvature`](crate::plan::Method::Curvature): the path of least length and turning (Eq. 4), from `tool_pose` (the
/// contact frame in the root frame) on.
///
/// # Errors
/// A cost that is not a number; it does not occur for finite patches.
pub fn smoothest(
    graph: &Graph,
    patches: &[Patch],
    tool: &Tool,
    tool_pose: &Isometry3<f64>,
    config: &FormulationConfig,
    seed: u64,
) -> Result<Vec<Stop>, FormulationError> {
    over_components(graph, patches, tool, tool_pose, |component, here| {
        Problem { graph, patches, tool, component, start: *here, config }.smoothest(seed)
    })
}

/// The tour over all components of the graph, one after the other, always the one nearest to where
/// the last one ended, from `tool_pose` on. `visit` is told a component's patches and the contact
/// pose before it.
///
/// # Errors
/// Passes on those of `visit`.
pub fn over_components<E>(
    graph: &Graph,
    patches: &[Patch],
    tool: &Tool,
    tool_pose: &Isometry3<f64>,
    mut visit: impl FnMut(&[usize], &Isometry3<f64>) -> Result<Vec<Stop>, E>,
) -> Result<Vec<Stop>, E> {
    let mut left: Vec<&Vec<usize>> = graph.components.iter().collect();
    let mut here = *tool_pose;
    let mut tour = Vec::new();
    while !left.is_empty() {
        let distance = |component: &[usize]| {
            apart(patches, component[nearest(patches, component, &here)], &here)
        };
        let next = (0..left.len())
            .min_by(|&a, &b| distance(left[a]).total_cmp(&distance(left[b])).then(a.cmp(&b)))
            .unwrap_or(0);
        let stops = visit(left.remove(next), &here)?;
        if let Some(last) = stops.last() {
            here = pose(patches, tool, last);
        }
        tour.extend(stops);
    }
    Ok(tour)
}

/// Place in `component` of the patch nearest to a contact pose.
#[must_use]
pub fn nearest(patches: &[Patch], component: &[usize], here: &Isometry3<f64>) -> usize {
    let distance = |&i: &usize| apart(patches, component[i], here);
    (0..component.len())
        .min_by(|a, b| distance(a).total_cmp(&distance(b)).then(a.cmp(b)))
        .unwrap_or(0)
}

fn apart(patches: &[Patch], patch: usize, here: &Isometry3<f64>) -> f64 {
    (patches[patch].centre.coords - here.translation.vector).norm()
}

/// A stop for each heading in which an edge leaves the patch; one for a lone patch, and for a round
/// tool, whose heading is free.
#[must_use]
pub fn incident_stops(graph: &Graph, patch: usize, tool: &Tool) -> Vec<Stop> {
    let edges = &graph.incident[patch];
    if edges.is_empty() || tool.is_round() {
        return vec![Stop { patch, heading: 0.0 }];
    }
    edges.iter().map(|&e| Stop { patch, heading: graph.edges[e].leaving(patch) }).collect()
}

/// The contact pose of a stop, root frame.
#[must_use]
pub fn pose(patches: &[Patch], tool: &Tool, stop: &Stop) -> Isometry3<f64> {
    let patch = &patches[stop.patch];
    let travel = direction(&patch.normal, stop.heading);
    contact_pose(&patch.centre, &patch.normal, &travel, tool.stand_off)
}

/// The weighed distance of two contact frames (Eq. 4), by the smallest of the turns that are as good.
/// \[m and rad, weighed\]
#[must_use]
pub fn curvature(a: &Isometry3<f64>, b: &Isometry3<f64>, beta: f64, tool: &Tool) -> f64 {
    let between = a.inv_mul(b);
    let angle = tool.turn_between(&between.rotation);
    (1.0 - beta) * between.translation.vector.norm() + beta * angle
}

/// One component's problem.
struct Problem<'a> {
    graph: &'a Graph,
    patches: &'a [Patch],
    tool: &'a Tool,
    component: &'a [usize],
    start: Isometry3<f64>,
    config: &'a FormulationConfig,
}

impl Problem<'_> {
    /// The shortest Euclidean way.
    fn shortest(&self, seed: u64) -> Result<Vec<Stop>, FormulationError> {
        let nodes: Vec<Vec<Stop>> =
            self.component.iter().map(|&patch| vec![Stop { patch, heading: 0.0 }]).collect();
        let order =
            self.search(&nodes, seed, |a, b| (a.translation.vector - b.translation.vector).norm())?;
        let patches: Vec<usize> = order.iter().map(|s| s.patch).collect();
        Ok(self.headings_along(&patches))
    }

    /// The way of least length and turning.
    fn smoothest(&self, seed: u64) -> Result<Vec<Stop>, FormulationError> {
        let nodes: Vec<Vec<Stop>> = self
            .component
            .iter()
            .map(|&patch| incident_stops(self.graph, patch, self.tool))
            .collect();
        self.search(&nodes, seed, |a, b| curvature(a, b, self.config.beta, self.tool))
    }

    /// The pad heads where it goes next (but for the edge's turn); at the end, and before a jump,
    /// where it came from.
    fn headings_along(&self, order: &[usize]) -> Vec<Stop> {
        let edge = |a: usize, b: usize| self.graph.between(a, b).map(|e| &self.graph.edges[e]);
        (0..order.len())
            .map(|i| {
                let patch = order[i];
                let next = order.get(i + 1).and_then(|&n| edge(patch, n)).map(|e| e.leaving(patch));
                let before = || {
                    let previous = *order.get(i.checked_sub(1)?)?;
                    edge(previous, patch).map(|e| e.leaving(patch) + std::f64::consts::PI)
                };
                let any = || incident_stops(self.graph, patch, self.tool)[0].heading;
                Stop { patch, heading: next.or_else(before).unwrap_or_else(any) }
            })
            .collect()
    }

    /// Solves the instance whose clusters are `nodes`, with `cost` between contact poses of
    /// adjacent patches: a path from the start pose on.
    fn search(
        &self,
        nodes: &[Vec<Stop>],
        seed: u64,
        cost: impl Fn(&Isometry3<f64>, &Isometry3<f64>) -> f64,
    ) -> Result<Vec<Stop>, FormulationError> {
        let poses: Vec<Vec<Isometry3<f64>>> = nodes
            .iter()
            .map(|stops| stops.iter().map(|s| pose(self.patches, self.tool, s)).collect())
            .collect();
        let cluster: HashMap<usize, usize> =
            self.component.iter().enumerate().map(|(c, &patch)| (patch, c)).collect();
        let mut blocks = Vec::new();
        for (a, &patch) in self.component.iter().enumerate() {
            for &edge in &self.graph.incident[patch] {
                let b = cluster[&self.graph.edges[edge].other(patch)];
                if a < b {
                    let costs = poses[a]
                        .iter()
                        .flat_map(|from| poses[b].iter().map(|to| cost(from, to)))
                        .collect();
                    blocks.extend(Block::both_ways(a, b, poses[a].len(), costs));
                }
            }
        }
        let sizes: Vec<usize> = nodes.iter().map(Vec::len).collect();
        let ends = if self.config.from_nearest {
            Ends::OpenFromCluster(nearest(self.patches, self.component, &self.start))
        } else {
            Ends::OpenFromCosts(poses.iter().flatten().map(|p| cost(&self.start, p)).collect())
        };
        let instance = Instance::new(&sizes, Costs::Blocks(blocks), Jump::Uniform(JUMP), ends)?;
        let trials = self.config.trials_per_cluster * nodes.len() as u64;
        let tour = gtsp::solve(&instance, &Budget::trials(trials), seed)?.tour;
        Ok(tour.clusters.iter().zip(&tour.nodes).map(|(&c, &n)| nodes[c][n]).collect())
    }
}
