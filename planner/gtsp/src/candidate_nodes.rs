//! Candidate nodes of wide clusters.
//!
//! Of a hundred nodes of a cluster a good tour can use few: those at the ends of cheap arcs to the
//! clusters nearby, and those on cheap paths through the cluster. Every other epoch searches these
//! alone. The tour that it ends with is polished with all nodes, and the nodes that this brings in
//! become candidates, so that no node is excluded for good.

use crate::ils::descend;
use crate::local::LocalSearch;
use crate::search_tour::SearchTour;
use crate::table::Table;
use crate::tour::Tour;

/// All nodes of clusters up to this size are candidates.
const WIDE: u32 = 24;
/// Cheapest arcs between two near clusters whose ends are kept.
const ARCS: usize = 3;
/// Neighbours of a cluster between which the cheapest path through it is kept.
const PATHS: usize = 10;

/// The candidates of each cluster, ascending.
pub(super) struct CandidateNodes {
    nodes: Vec<Vec<u32>>,
}

impl CandidateNodes {
    /// The candidates by the costs; `None` where no cluster is wide, or all tours are enumerated.
    pub(super) fn select(full: &Table) -> Option<Self> {
        if full.is_small() || full.sizes.iter().all(|&size| size <= WIDE) {
            return None;
        }
        let mut kept: Vec<Vec<bool>> =
            full.sizes.iter().map(|&size| vec![size <= WIDE; size as usize]).collect();
        for a in 0..full.m as u32 {
            let near: Vec<u32> = full.near_out(a).map(|(b, _)| b).collect();
            for &b in &near {
                keep_cheap_arcs(full, a, b, &mut kept);
                keep_cheap_arcs(full, b, a, &mut kept);
            }
            for &b in near.iter().take(PATHS) {
                for &c in near.iter().take(PATHS).filter(|&&c| c != b) {
                    keep_path_through(full, b, a, c, &mut kept);
                }
            }
        }
        // A cluster without any neighbour keeps one node.
        for kept in kept.iter_mut().filter(|kept| !kept.contains(&true)) {
            kept[0] = true;
        }
        let nodes = kept
            .iter()
            .map(|kept| (0..kept.len() as u32).filter(|&i| kept[i as usize]).collect())
            .collect();
        Some(Self { nodes })
    }

    /// The costs between the candidates.
    pub(super) fn table(&self, full: &Table) -> Table {
        full.restricted(&self.nodes)
    }

    /// Makes the nodes of a polished tour candidates.
    pub(super) fn add_chosen(&mut self, polished: &SearchTour) {
        for (nodes, &chosen) in self.nodes.iter_mut().zip(&polished.chosen) {
            if let Err(at) = nodes.binary_search(&chosen) {
                nodes.insert(at, chosen);
            }
        }
    }

    /// The polished tour in the terms of the candidates' table; its nodes are among them.
    pub(super) fn reduce(&self, table: &Table, polished: &SearchTour) -> SearchTour {
        let place =
            |(c, node): (usize, &u32)| self.nodes[c].binary_search(node).unwrap_or(0) as u32;
        let chosen = polished.chosen.iter().enumerate().map(place).collect();
        SearchTour::new(table, polished.order.clone(), chosen)
    }
}

/// The tour with all nodes to choose from, brought to a local optimum.
pub(super) fn polish(full: &Table, tour: &Tour) -> SearchTour {
    let mut polished = SearchTour::from_tour(full, tour);
    descend(full, &mut LocalSearch::new(full.m), &mut polished);
    polished
}

/// Keeps the ends of the cheapest arcs from `a` to `b`, of different nodes of `a` and of `b`.
fn keep_cheap_arcs(full: &Table, a: u32, b: u32, kept: &mut [Vec<bool>]) {
    if !full.is_stored(a, b) {
        return;
    }
    for &i in by_cost(full.row_lowest(a, b)).iter().take(ARCS) {
        kept[a as usize][i] = true;
        kept[b as usize][cheapest(full.row(a, i as u32, b).1)] = true;
    }
    for &j in by_cost(&full.column_lowest(a, b)).iter().take(ARCS) {
        kept[b as usize][j] = true;
        kept[a as usize][cheapest(full.column(a, b, j as u32).1)] = true;
    }
}

/// Keeps the nodes of the cheapest path from `b` through `a` to `c`.
fn keep_path_through(full: &Table, b: u32, a: u32, c: u32, kept: &mut [Vec<bool>]) {
    if !full.is_stored(b, a) || !full.is_stored(a, c) {
        return;
    }
    let out = full.row_lowest(a, c);
    let paths: Vec<i32> = full.column_lowest(b, a).iter().zip(out).map(|(x, y)| x + y).collect();
    let i = cheapest(&paths);
    kept[a as usize][i] = true;
    kept[b as usize][cheapest(full.column(b, a, i as u32).1)] = true;
    kept[c as usize][cheapest(full.row(a, i as u32, c).1)] = true;
}

/// Indices by rising cost.
fn by_cost(costs: &[i32]) -> Vec<usize> {
    let mut indices: Vec<usize> = (0..costs.len()).collect();
    indices.sort_by_key(|&i| costs[i]);
    indices
}

fn cheapest(costs: &[i32]) -> usize {
    (0..costs.len()).min_by_key(|&i| costs[i]).unwrap_or(0)
}
