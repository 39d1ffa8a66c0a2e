//! How often the tool has to be lifted off at least.
//!
//! On the surface the arm stays on one branch of its inverse kinematics, and goes from patch to patch
//! along the graph's edges. So a piece of a plan between two motions through free space lies within one
//! component of the graph over patches and branches, in which an edge joins two patches on every branch
//! that has a posture at both of them. Whether the arm can be followed there on that branch is not asked, which
//! only makes components larger: as many pieces are needed as components that cover all patches.

use serde::{Deserialize, Serialize};

use super::stops::Stops;
use crate::cover::{Problem, cover};
use crate::roadmap::Graph;

/// Pieces on the surface, each of which the arm comes to through free space.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pieces {
    /// Of the plan.
    pub made: usize,
    /// No plan that stops at the same patches has fewer, whatever the arm can be followed along.
    pub least: usize,
    /// So many components cover all patches: the bound is at most that.
    pub cover: usize,
}

/// How many pieces visit the stops that the graph knows, `made` being those of the plan.
#[must_use]
pub fn pieces(stops: &Stops, graph: &Graph, made: usize) -> Pieces {
    let known: Vec<usize> =
        (0..stops.patches.len()).filter(|&at| stops.patches[at] < graph.incident.len()).collect();
    let sets = components(stops, graph, &known);
    let weights = vec![2.0; known.len()];
    // Covering one patch more is worth more than a set costs: the best choice covers all.
    let problem = Problem { costs: vec![1.0; sets.len()], most: sets.len(), weights, sets };
    let found = cover(&problem);
    let all = 2.0 * known.len() as f64;
    let least = (all - found.bound - 1e-6).ceil().max(0.0) as usize;
    Pieces { made, least, cover: (all - found.value).round() as usize }
}

/// For each component the patches in it, as numbers in `known`, ascending.
fn components(stops: &Stops, graph: &Graph, known: &[usize]) -> Vec<Vec<u32>> {
    let mut nodes: Vec<(usize, u8)> = known
        .iter()
        .enumerate()
        .flat_map(|(k, &at)| stops.samples[at].iter().map(move |sample| (k, sample.branch.0)))
        .collect();
    nodes.sort_unstable();
    nodes.dedup();
    let number = |node: (usize, u8)| nodes.binary_search(&node).ok();
    let mut seen = vec![false; nodes.len()];
    let mut sets = Vec::new();
    for first in 0..nodes.len() {
        if seen[first] {
            continue;
        }
        seen[first] = true;
        let mut component = vec![first];
        let mut next = 0;
        while let Some(&(k, branch)) = component.get(next).map(|&node| &nodes[node]) {
            next += 1;
            let patch = stops.patches[known[k]];
            for &edge in &graph.incident[patch] {
                let other = graph.edges[edge].other(patch);
                let there = known.iter().position(|&at| stops.patches[at] == other);
                if let Some(node) = there.and_then(|there| number((there, branch)))
                    && !seen[node]
                {
                    seen[node] = true;
                    component.push(node);
                }
            }
        }
        // On one branch: each patch once.
        let mut set: Vec<u32> = component.into_iter().map(|node| nodes[node].0 as u32).collect();
        set.sort_unstable();
        sets.push(set);
    }
    sets
}

#[cfg(test)]
mod tests {
    use std::collections::{HashSet, VecDeque};

    use nullsweep_robot::{Branch, JointVector};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::roadmap::Edge;
    use crate::workcell::Sample;

    fn drawn(patches: usize, rng: &mut ChaCha8Rng) -> (Stops, Graph) {
        let sample = |branch: u8| Sample {
            q: JointVector::ZERO,
            branch: Branch(branch),
            redundancy: 0.0,
            heading: 0.0,
        };
        let samples: Vec<Vec<Sample>> = (0..patches)
            .map(|_| {
                let mut branches: Vec<u8> = (0..3).filter(|_| rng.random_bool(0.5)).collect();
                branches.push(rng.random_range(0..3));
                branches.into_iter().map(sample).collect()
            })
            .collect();
        let pairs = (0..patches).flat_map(|a| (0..a).map(move |b| (a, b)));
        let edge =
            |(a, b)| Edge { a, b, line: Vec::new(), heading_a: 0.0, heading_b: 0.0, turn: 0.0 };
        let edges = pairs.filter(|_| rng.random_bool(0.35)).map(edge).collect();
        let graph = Graph::of(edges, &vec![Some(sample(0)); patches], Vec::new());
        let order = (0..patches).map(|patch| (patch, 0)).collect();
        let patches = (0..patches).collect();
        (Stops { start: JointVector::ZERO, patches, samples, order }, graph)
    }

    /// The fewest pieces, by going through all that can be visited with none, one, two … of them.
    fn by_trial(stops: &Stops, graph: &Graph) -> usize {
        let patches = stops.patches.len();
        let nodes: Vec<(usize, u8)> = (0..patches)
            .flat_map(|p| stops.samples[p].iter().map(move |s| (p, s.branch.0)))
            .collect();
        // Pieces so far, the patch and the branch where the arm is, and what is visited.
        type State = (usize, Option<(usize, u8)>, usize);
        let mut open: VecDeque<State> = VecDeque::from([(0, None, 0)]);
        let mut seen = HashSet::new();
        while let Some((pieces, at, visited)) = open.pop_front() {
            if visited + 1 == 1 << patches {
                return pieces;
            }
            if !seen.insert((at, visited)) {
                continue;
            }
            for &(patch, branch) in &nodes {
                let is_way = |(p, b)| b == branch && graph.between(p, patch).is_some();
                let next = (Some((patch, branch)), visited | 1 << patch);
                if at.is_some_and(is_way) {
                    open.push_front((pieces, next.0, next.1));
                }
                open.push_back((pieces + 1, next.0, next.1));
            }
        }
        usize::MAX
    }

    #[test]
    fn no_plan_has_fewer_pieces_than_are_said_to_be_needed() {
        let (mut exact, mut several) = (0, 0);
        for seed in 0..60 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let (stops, graph) = drawn(2 + seed as usize % 6, &mut rng);
            let best = by_trial(&stops, &graph);
            let found = pieces(&stops, &graph, best);
            assert!(found.least <= best, "seed {seed}: {found:?}");
            assert!(found.cover >= best, "seed {seed}: {found:?}");
            exact += usize::from(found.least == best);
            several += usize::from(best > 1);
        }
        assert!(exact >= 55 && several >= 30, "{exact} exact, {several} of several pieces");
    }

    #[test]
    fn what_was_added_to_the_graph_later_asks_for_no_piece_of_its_own() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let (mut stops, graph) = drawn(4, &mut rng);
        let before = pieces(&stops, &graph, 9);
        stops.patches.push(4);
        stops.samples.push(stops.samples[0].clone());
        assert_eq!(pieces(&stops, &graph, 9), before);
    }
}
