//! Generalised travelling-salesman tours.

use std::path::PathBuf;
use std::time::Duration;

use nullsweep_gtsp::tsplib::read_gtsp;
use nullsweep_gtsp::{self as gtsp, Budget, Costs, Effort, Ends, Instance, Jump, lower_bound};
use numpy::PyUntypedArrayMethods;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{numbers, shaped};
use crate::errors::{UsageError, raise, shape};
use crate::keywords::Keywords;

/// A tour.
#[pyclass(frozen, get_all, module = "nullsweep.gtsp")]
pub(crate) struct Solution {
    /// The clusters in their order.
    clusters: Vec<usize>,
    /// The node in each, by its number in the costs.
    nodes: Vec<usize>,
    /// What the tour costs.
    cost: f64,
    /// Arcs that there are none for.
    jumps: usize,
    /// What no tour costs less than, if that was asked for and found.
    bound: Option<f64>,
    /// Whether no tour costs less.
    proven: bool,
    trials: u64,
    seconds: f64,
}

#[pymethods]
impl Solution {
    fn __repr__(&self) -> String {
        let bound = self.bound.map_or(String::new(), |bound| format!(", no tour below {bound}"));
        format!("Solution(cost {}, {} clusters{bound})", self.cost, self.clusters.len())
    }
}

/// Visits each cluster once, at one node of it, for the least cost.
#[pyfunction]
#[pyo3(signature = (costs, clusters, **how))]
pub(crate) fn solve(
    py: Python<'_>,
    costs: &Bound<'_, PyAny>,
    clusters: Vec<Vec<usize>>,
    how: Option<&Bound<'_, PyDict>>,
) -> PyResult<Solution> {
    let how = Keywords::of(py, how)?;
    let (seconds, trials) = (how.take("seconds", None)?, how.take("trials", None)?);
    let (seed, threads) = (how.take("seed", 1)?, how.take("threads", 0)?);
    let jump = how.take("jump", None)?.map_or(Jump::Forbidden, Jump::Uniform);
    let ends = how.take("start", None)?.map_or(Ends::Closed, Ends::OpenFromCluster);
    let bound: f64 = how.take("bound", 0.0)?;
    how.end()?;
    let array = numbers(costs)?;
    let found = array.shape();
    let &[n, columns] = found else { return Err(shape("costs", "(n, n)", found)) };
    if n != columns {
        return Err(shape("costs", "(n, n)", found));
    }
    let order = order(&clusters, n)?;
    let given = array.as_slice()?;
    let dense = order.iter().flat_map(|&a| order.iter().map(move |&b| given[a * n + b])).collect();
    let sizes: Vec<usize> = clusters.iter().map(Vec::len).collect();
    let instance = Instance::new(&sizes, Costs::Dense(dense), jump, ends).map_err(raise)?;
    let seconds = seconds.or_else(|| trials.is_none().then_some(10.0));
    let time = seconds.map(|s| span("seconds", s)).transpose()?;
    let budget = Budget { trials, time, threads, target: None };
    let effort = Effort { steps: u64::MAX, time: Some(span("bound", bound)?) };
    let (solved, bound) = py
        .detach(|| {
            let solved = gtsp::solve(&instance, &budget, seed)?;
            let wanted = (bound > 0.0).then_some(effort);
            let bound = wanted.and_then(|effort| lower_bound(&instance, &solved.tour, effort));
            Ok::<_, gtsp::SolveError>((solved, bound))
        })
        .map_err(raise)?;
    let tour = &solved.tour;
    let nodes = tour.clusters.iter().zip(&tour.nodes).map(|(c, k)| clusters[*c][*k]).collect();
    Ok(Solution {
        nodes,
        clusters: tour.clusters.clone(),
        cost: solved.cost.total(),
        jumps: solved.cost.jumps,
        bound: bound.or_else(|| solved.proven.then(|| solved.cost.total())),
        proven: solved.proven,
        trials: solved.trials,
        seconds: solved.elapsed.as_secs_f64(),
    })
}

/// Costs and clusters of a GTSPLIB file, as [`solve`] takes them; nodes count from 0.
#[pyfunction]
pub(crate) fn read(py: Python<'_>, path: PathBuf) -> PyResult<(Bound<'_, PyAny>, Vec<Vec<usize>>)> {
    let file = read_gtsp(&path).map_err(raise)?;
    let instance = &file.instance;
    let places: Vec<(usize, usize)> = (0..instance.clusters())
        .flat_map(|c| (0..instance.sizes()[c]).map(move |k| (c, k)))
        .collect();
    let cost = |&(a, i): &(usize, usize), &(b, j): &(usize, usize)| {
        if a == b { 0.0 } else { instance.arc(a, i, b, j).unwrap_or(f64::INFINITY) }
    };
    let costs: Vec<f64> =
        places.iter().flat_map(|from| places.iter().map(move |to| cost(from, to))).collect();
    let mut next = 0;
    let clusters = instance.sizes().iter().map(|size| {
        let from = next;
        next += size;
        (from..next).collect()
    });
    let clusters = clusters.collect();
    let costs = if places.is_empty() { Vec::new() } else { costs };
    Ok((shaped(py, costs, &[places.len()], false)?, clusters))
}

/// The nodes by clusters, each once.
fn order(clusters: &[Vec<usize>], n: usize) -> PyResult<Vec<usize>> {
    let mut seen = vec![false; n];
    for (c, nodes) in clusters.iter().enumerate() {
        for &node in nodes {
            let slot = seen.get_mut(node).ok_or_else(|| {
                UsageError::new_err(format!("cluster {c}: there is no node {node} among {n}"))
            })?;
            if std::mem::replace(slot, true) {
                return Err(UsageError::new_err(format!(
                    "cluster {c}: node {node} is there twice"
                )));
            }
        }
    }
    match seen.iter().position(|seen| !seen) {
        None => Ok(clusters.concat()),
        Some(node) => Err(UsageError::new_err(format!("node {node} is in no cluster"))),
    }
}

fn span(what: &str, seconds: f64) -> PyResult<Duration> {
    Duration::try_from_secs_f64(seconds)
        .map_err(|why| UsageError::new_err(format!("{what}: {why}")))
}
