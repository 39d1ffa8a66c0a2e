//! Cheapest 1-trees and 1-arborescences of a complete graph; costs are row-major.

/// Cost and the pairs that are joined, in their direction.
pub(super) struct Joined {
    pub(super) cost: f64,
    pub(super) pairs: Vec<(usize, usize)>,
}

/// Cheapest spanning tree on 1.. and the two cheapest links at 0.
pub(super) fn one_tree(m: usize, costs: &[f64]) -> Joined {
    let cost = |a: usize, b: usize| costs[a * m + b];
    let mut pairs = Vec::with_capacity(m);
    let mut near = vec![(f64::INFINITY, 1); m];
    let mut inside = vec![false; m];
    let mut joined = 1;
    inside[1] = true;
    for _ in 2..m {
        let mut next = (f64::INFINITY, 0);
        for k in 2..m {
            if !inside[k] {
                let c = cost(joined, k);
                if c < near[k].0 {
                    near[k] = (c, joined);
                }
                if near[k].0 < next.0 {
                    next = (near[k].0, k);
                }
            }
        }
        pairs.push((near[next.1].1, next.1));
        inside[next.1] = true;
        joined = next.1;
    }
    let mut ends: Vec<usize> = (1..m).collect();
    ends.sort_by(|&a, &b| cost(0, a).total_cmp(&cost(0, b)));
    pairs.extend([(0, ends[0]), (0, ends[1])]);
    Joined { cost: pairs.iter().map(|&(a, b)| cost(a, b)).sum(), pairs }
}

/// Cheapest arcs by which 0 reaches every other one, and the cheapest arc back to it.
pub(super) fn one_arborescence(m: usize, costs: &[f64]) -> Joined {
    let cost = |a: usize, b: usize| costs[a * m + b];
    let parents = arborescence(m, costs);
    let mut pairs: Vec<(usize, usize)> = (1..m).map(|b| (parents[b], b)).collect();
    let back = (1..m).min_by(|&a, &b| cost(a, 0).total_cmp(&cost(b, 0))).unwrap_or(0);
    pairs.push((back, 0));
    Joined { cost: pairs.iter().map(|&(a, b)| cost(a, b)).sum(), pairs }
}

/// Where the arc into each one but 0 comes from (Chu & Liu 1965, Edmonds 1967): the cheapest arcs
/// into each; circles of them become one, which an arc enters in place of one of its own.
fn arborescence(m: usize, cost: &[f64]) -> Vec<usize> {
    let parents: Vec<usize> = (0..m)
        .map(|b| {
            let others = (0..m).filter(|&a| a != b);
            others.min_by(|&x, &y| cost[x * m + b].total_cmp(&cost[y * m + b])).unwrap_or(0)
        })
        .collect();
    let Some((group, count)) = circles(&parents) else { return parents };
    // Arcs between groups; into a circle less the arc that it replaces.
    let mut between = vec![(f64::INFINITY, (0, 0)); count * count];
    let mut sizes = vec![0; count];
    group.iter().for_each(|&g| sizes[g] += 1);
    for a in 0..m {
        for b in 1..m {
            let (g, h) = (group[a], group[b]);
            if g != h {
                let saved = if sizes[h] > 1 { cost[parents[b] * m + b] } else { 0.0 };
                let slot = &mut between[g * count + h];
                let c = cost[a * m + b] - saved;
                if c < slot.0 {
                    *slot = (c, (a, b));
                }
            }
        }
    }
    let costs: Vec<f64> = between.iter().map(|arc| arc.0).collect();
    let outer = arborescence(count, &costs);
    let mut result = parents;
    for h in 1..count {
        let (a, b) = between[outer[h] * count + h].1;
        result[b] = a;
    }
    result
}

/// The group of each one, circles being one, and how many there are; `None` without a circle. The
/// group of 0 is 0.
fn circles(parents: &[usize]) -> Option<(Vec<usize>, usize)> {
    const NONE: usize = usize::MAX;
    let m = parents.len();
    let mut group = vec![NONE; m];
    let mut seen = vec![NONE; m];
    (group[0], seen[0]) = (0, 0);
    let mut count = 1;
    let mut found = false;
    for start in 1..m {
        let mut here = start;
        while seen[here] == NONE {
            seen[here] = start;
            here = parents[here];
        }
        if here != 0 && seen[here] == start && group[here] == NONE {
            found = true;
            let first = here;
            while group[here] == NONE {
                group[here] = count;
                here = parents[here];
            }
            debug_assert_eq!(here, first);
            count += 1;
        }
    }
    for g in group.iter_mut().filter(|g| **g == NONE) {
        *g = count;
        count += 1;
    }
    found.then_some((group, count))
}
