//! Motions through free space between nodes: those that were made, and what is known of the others.

use std::collections::{HashMap, HashSet};

use nullsweep_robot::JointVector;

use super::labels::Ends;
use super::layer::{Layer, Node};
use super::problem::Problem;
use crate::motion::{Hub, Spoke, back_away, jump, reconfigure};

/// Seeds by which a way through free space is looked for, and how many nodes of a layer are shut in before
/// no other is tried.
const SEEDS: u64 = 3;
const STRIKES: usize = 16;

pub(super) struct Ways {
    made: HashMap<Ends, Vec<JointVector>>,
    /// Motions that were not found.
    pub(super) blocked: HashSet<Ends>,
    /// Nodes where the tool does not come off, or that are shut in.
    pub(super) stuck: HashSet<Node>,
    /// By way of it nodes are joined between which no other way is found; the ways to it.
    hub: Option<Hub>,
    spokes: HashMap<Option<Node>, Spoke>,
    /// How many nodes of a layer are shut in.
    strikes: HashMap<(usize, usize), usize>,
}

impl Ways {
    pub(super) fn new(problem: &Problem<'_>) -> Self {
        Self {
            made: HashMap::new(),
            blocked: HashSet::new(),
            stuck: HashSet::new(),
            hub: Hub::of(problem.cell, problem.start.as_ref()),
            spokes: HashMap::new(),
            strikes: HashMap::new(),
        }
    }

    /// Whether a way is there; it is made where it is not.
    pub(super) fn make(
        &mut self,
        problem: &Problem<'_>,
        layers: &[Layer],
        (from, start): (Option<Node>, &JointVector),
        (to, goal): (Node, &JointVector),
    ) -> bool {
        if self.made.contains_key(&(from, to)) {
            return true;
        }
        let cell = problem.cell;
        let ends = [(from, start), (Some(to), goal)];
        for (node, q) in ends {
            if let Some(node) = node
                && back_away(cell, q).is_none()
            {
                self.stuck.insert(node);
                return false;
            }
        }
        let seed = |k: u64| problem.seed.wrapping_add(k);
        let found = (0..SEEDS).find_map(|k| match from {
            Some(_) => reconfigure(cell, start, goal, seed(k)),
            None => jump(cell, start, goal, seed(k)),
        });
        if let Some(path) = found.or_else(|| self.by_hub(problem, layers, ends)) {
            self.made.insert((from, to), path);
            return true;
        }
        self.blocked.insert((from, to));
        false
    }

    /// The way by way of the hub; where it is none, the node that is shut in is not tried again.
    fn by_hub(
        &mut self,
        problem: &Problem<'_>,
        layers: &[Layer],
        ends: [(Option<Node>, &JointVector); 2],
    ) -> Option<Vec<JointVector>> {
        let (cell, seed, hub) = (problem.cell, problem.seed, self.hub?);
        for (node, q) in ends {
            if self.spokes.contains_key(&node) {
                continue;
            }
            match (hub.spoke(cell, q, seed), node) {
                (Some(spoke), _) => drop(self.spokes.insert(node, spoke)),
                (None, Some(node)) => {
                    self.shut_in(layers, node);
                    return None;
                }
                (None, None) => return None,
            }
        }
        let [begin, end] = ends.map(|(node, _)| self.spokes.get(&node));
        Some(begin?.to(end?, cell, seed))
    }

    /// Notes a node that no way leads to or from, and where there are many, all of its layer.
    fn shut_in(&mut self, layers: &[Layer], node: Node) {
        self.stuck.insert(node);
        let strikes = self.strikes.entry((node.0, node.1)).or_default();
        *strikes += 1;
        let of = |layer: &&Layer| (layer.segment, layer.station) == (node.0, node.1);
        if *strikes >= STRIKES
            && let Some(layer) = layers.iter().find(of)
        {
            self.stuck.extend((0..layer.nodes.len()).map(|k| layer.node(k)));
        }
    }

    /// Whether some node of a layer is not known to be shut in, and whether some is.
    pub(super) fn known(&self, layer: &Layer) -> [bool; 2] {
        let stuck = |k: usize| self.stuck.contains(&layer.node(k));
        let nodes = 0..layer.nodes.len();
        [nodes.clone().any(|k| !stuck(k)), nodes.into_iter().any(stuck)]
    }

    /// A way that was made.
    pub(super) fn take(&mut self, ends: &Ends) -> Option<Vec<JointVector>> {
        self.made.remove(ends)
    }
}
