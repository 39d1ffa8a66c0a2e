//! Wide clusters thinned to the nodes that matter.
//!
//! Of a hundred nodes of a cluster a good tour can use few: those at the ends of cheap arcs to the
//! clusters nearby, and those on cheap ways through the cluster. The search runs on these; each
//! tour that it ends with is polished with all nodes, and the nodes that this brings in are taken
//! up, so that nothing is lost for good.

use crate::local::LocalSearch;
use crate::order::Order;
use crate::search::settle;
use crate::table::Table;
use crate::tour::Tour;

/// Clusters of more nodes are thinned.
const WIDE: u32 = 24;
/// Cheapest arcs between two near clusters whose ends are kept.
const ARCS: usize = 3;
/// Neighbours of a cluster between which the cheapest way through it is kept.
const WAYS: usize = 10;

/// The nodes in use of each cluster, ascending.
#[derive(Clone)]
pub(super) struct Thinned {
    nodes: Vec<Vec<u32>>,
}

impl Thinned {
    /// The nodes that matter; `None` where no cluster is wide, or all tours are enumerated.
    pub(super) fn new(full: &Table) -> Option<Self> {
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
            for &b in near.iter().take(WAYS) {
                for &c in near.iter().take(WAYS).filter(|&&c| c != b) {
                    keep_way_through(full, b, a, c, &mut kept);
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

    /// The costs between the nodes in use.
    pub(super) fn table(&self, full: &Table) -> Table {
        full.restricted(&self.nodes)
    }

    /// Takes up the nodes of a polished tour.
    pub(super) fn take_up(&mut self, polished: &Order) {
        for (nodes, &chosen) in self.nodes.iter_mut().zip(&polished.chosen) {
            if let Err(at) = nodes.binary_search(&chosen) {
                nodes.insert(at, chosen);
            }
        }
    }

    /// The polished tour in the thinned table's terms; its nodes were taken up.
    pub(super) fn inside(&self, table: &Table, polished: &Order) -> Order {
        let place =
            |(c, node): (usize, &u32)| self.nodes[c].binary_search(node).unwrap_or(0) as u32;
        let chosen = polished.chosen.iter().enumerate().map(place).collect();
        Order::new(table, polished.order.clone(), chosen)
    }
}

/// The tour with all nodes to choose from, brought to a local optimum.
pub(super) fn polish(full: &Table, tour: &Tour) -> Order {
    let mut polished = Order::from_tour(full, tour);
    settle(full, &mut LocalSearch::new(full.m), &mut polished);
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

/// Keeps the nodes of the cheapest way from `b` through `a` to `c`.
fn keep_way_through(full: &Table, b: u32, a: u32, c: u32, kept: &mut [Vec<bool>]) {
    if !full.is_stored(b, a) || !full.is_stored(a, c) {
        return;
    }
    let out = full.row_lowest(a, c);
    let ways: Vec<i32> = full.column_lowest(b, a).iter().zip(out).map(|(x, y)| x + y).collect();
    let i = cheapest(&ways);
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
