//! Exact solution of small instances: dynamic programming over subsets of clusters.

use crate::instance::{Ends, Instance};
use crate::tour::{Tour, TourCost};

/// Table entries that the exact method may use.
const ROOM: usize = 1 << 19;

/// An optimal tour and its cost where the instance is small enough, else `None`: at most 16 clusters,
/// and n · 2^m of at most 2^19 for n nodes in m clusters.
///
/// Where every tour needs a forbidden jump, one of the fewest jumps is optimal, of these the one of
/// the cheapest arcs.
pub fn solve(instance: &Instance) -> Option<(Tour, TourCost)> {
    let m = instance.clusters();
    let n = instance.nodes();
    if m > 16 || (n << m) > ROOM {
        return None;
    }
    let mut nodes = Vec::with_capacity(n);
    for (cluster, &size) in instance.sizes().iter().enumerate() {
        nodes.extend((0..size).map(|node| (cluster, node)));
    }
    match *instance.ends() {
        Ends::OpenFromCosts(_) => {
            let starts: Vec<usize> = (0..n).collect();
            Some(search(instance, &nodes, &starts))
        }
        Ends::OpenFromCluster(start) => {
            let starts: Vec<usize> = (0..n).filter(|&v| nodes[v].0 == start).collect();
            Some(search(instance, &nodes, &starts))
        }
        Ends::Closed => {
            let root = (0..m).min_by_key(|&c| instance.sizes()[c])?;
            (0..n)
                .filter(|&v| nodes[v].0 == root)
                .map(|v| search(instance, &nodes, &[v]))
                .reduce(|a, b| if b.1.better_than(&a.1) { b } else { a })
        }
    }
}

#[derive(Clone, Copy)]
struct Label {
    cost: TourCost,
    parent: u32,
}

fn step(
    instance: &Instance,
    mut cost: TourCost,
    (a, i): (usize, usize),
    (b, j): (usize, usize),
) -> TourCost {
    match instance.arc(a, i, b, j) {
        Some(arc) => cost.finite += arc,
        None => {
            cost.jumps += 1;
            cost.jump_cost += instance.jump_price(a, b);
        }
    }
    cost
}

fn search(instance: &Instance, nodes: &[(usize, usize)], starts: &[usize]) -> (Tour, TourCost) {
    let (m, n) = (instance.clusters(), nodes.len());
    let full = (1_usize << m) - 1;
    let mut labels: Vec<Option<Label>> = vec![None; n << m];
    for &v in starts {
        let mut cost = TourCost::default();
        if let Ends::OpenFromCosts(start) = instance.ends() {
            if start[v].is_finite() {
                cost.finite = start[v];
            } else {
                cost.jumps = 1;
                cost.jump_cost = instance.start_jump_price();
            }
        }
        labels[(1 << nodes[v].0) * n + v] = Some(Label { cost, parent: u32::MAX });
    }
    for set in 1..=full {
        for v in 0..n {
            let Some(label) = labels[set * n + v] else { continue };
            for w in 0..n {
                let bit = 1 << nodes[w].0;
                if set & bit != 0 {
                    continue;
                }
                let cost = step(instance, label.cost, nodes[v], nodes[w]);
                let slot = &mut labels[(set | bit) * n + w];
                if slot.as_ref().is_none_or(|old| cost.better_than(&old.cost)) {
                    *slot = Some(Label { cost, parent: v as u32 });
                }
            }
        }
    }
    let closing = |v: usize, cost: TourCost| match instance.ends() {
        Ends::Closed if m > 1 => step(instance, cost, nodes[v], nodes[starts[0]]),
        _ => cost,
    };
    let mut end = None::<(usize, TourCost)>;
    for v in 0..n {
        if let Some(label) = labels[full * n + v] {
            let cost = closing(v, label.cost);
            if end.as_ref().is_none_or(|(_, old)| cost.better_than(old)) {
                end = Some((v, cost));
            }
        }
    }
    let (mut v, _) = end.expect("every full set is reached from the start");
    let mut set = full;
    let mut path = Vec::with_capacity(m);
    loop {
        path.push(nodes[v]);
        let parent = labels[set * n + v].expect("a parent has a label").parent;
        set &= !(1 << nodes[v].0);
        if parent == u32::MAX {
            break;
        }
        v = parent as usize;
    }
    path.reverse();
    let tour = Tour {
        clusters: path.iter().map(|p| p.0).collect(),
        nodes: path.iter().map(|p| p.1).collect(),
    };
    let cost = tour.cost(instance);
    (tour, cost)
}
