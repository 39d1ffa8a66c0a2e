//! Least labels over the layers: first reconfigurations, then movement.

use std::collections::HashSet;

use nullsweep_robot::{Continuous, JointVector};

use super::layer::{Layer, Node};

/// Reconfigurations, then movement.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub(super) struct Cost(pub(super) u32, pub(super) f64);

impl Cost {
    pub(super) const NONE: Self = Self(u32::MAX, f64::INFINITY);

    pub(super) fn is_some(self) -> bool {
        self.0 < u32::MAX
    }

    fn plus(self, reconfigurations: u32, movement: f64) -> Self {
        match self.is_some() {
            true => Self(self.0 + reconfigurations, self.1 + movement),
            false => Self::NONE,
        }
    }
}

/// How a layer is come to from the one before it.
#[derive(Clone, Debug)]
pub(super) enum Link {
    /// Along the path: for each node the nodes before it from which it may be come to, and at least how
    /// much movement that takes.
    Track(Vec<Vec<(u32, f32)>>),
    /// Through free space, from segment to segment, or over what cannot be followed, which counts as a
    /// reconfiguration.
    Way { gap: bool },
}

/// The best known way to a node.
#[derive(Clone, Copy, Debug)]
pub(super) struct Label {
    pub(super) cost: Cost,
    /// The node before it.
    pub(super) from: u32,
}

/// A motion through free space between two nodes: from the start where there is no first.
pub(super) type Ends = (Option<Node>, Node);

/// What a motion through free space costs besides its straight line: lift and return. \[rad\]
pub(super) const LIFT: f64 = 1.0;

/// What is given to the labels.
pub(super) struct Givens<'a> {
    pub(super) layers: &'a [Layer],
    /// Into each layer; the first one's is from the start.
    pub(super) links: &'a [Link],
    pub(super) start: Option<&'a JointVector>,
    pub(super) continuous: Continuous,
    /// Motions that were not found.
    pub(super) blocked: &'a HashSet<Ends>,
    /// Nodes where the tool does not come off.
    pub(super) stuck: &'a HashSet<Node>,
    /// Layers where the posture may be changed.
    pub(super) switches: bool,
}

impl Givens<'_> {
    /// Whether a motion through free space may be tried.
    fn open(&self, from: Option<Node>, to: Node) -> bool {
        !from.is_some_and(|from| self.stuck.contains(&from))
            && !self.stuck.contains(&to)
            && !self.blocked.contains(&(from, to))
    }
}

/// For each layer the labels of coming to its nodes, and of leaving from them.
#[derive(Default)]
pub(super) struct Labels {
    pub(super) come: Vec<Vec<Label>>,
    pub(super) leave: Vec<Vec<Label>>,
}

/// A label's node before it where there is none: it is left as it was come to, or begun with.
pub(super) const HERE: u32 = u32::MAX;

impl Labels {
    /// Makes the labels anew from a layer on. The first layer that no way leads to.
    pub(super) fn update(&mut self, of: &Givens<'_>, dirty: usize) -> Option<usize> {
        self.come.truncate(dirty);
        self.leave.truncate(dirty);
        for p in self.come.len()..of.layers.len() {
            let come = match (&of.links[p], p.checked_sub(1)) {
                (Link::Track(rungs), Some(before)) => self.tracked(rungs, before),
                (Link::Way { gap }, Some(before)) => self.over(of, before, p, u32::from(*gap)),
                (_, None) => begun(of),
            };
            let cut = !come.iter().any(|label| label.cost.is_some());
            let leave = switched(of, p, &come);
            self.come.push(come);
            self.leave.push(leave);
            if cut {
                return Some(p);
            }
        }
        None
    }

    fn tracked(&self, rungs: &[Vec<(u32, f32)>], before: usize) -> Vec<Label> {
        let leave = &self.leave[before];
        let best = |rungs: &Vec<(u32, f32)>| {
            let of = |&(from, least): &(u32, f32)| Label {
                cost: leave[from as usize].cost.plus(0, f64::from(least)),
                from,
            };
            least(rungs.iter().map(of))
        };
        rungs.iter().map(best).collect()
    }

    fn over(&self, of: &Givens<'_>, before: usize, p: usize, gap: u32) -> Vec<Label> {
        let (a, b) = (&of.layers[before].nodes, &of.layers[p].nodes);
        let best = |k: usize| {
            let reach = |(i, label): (usize, &Label)| {
                let ends = (of.layers[before].node(i), of.layers[p].node(k));
                let open = label.cost.is_some() && of.open(Some(ends.0), ends.1);
                let cost = match open {
                    true => label.cost.plus(gap, LIFT + apart(of, &a[i].q, &b[k].q)),
                    false => Cost::NONE,
                };
                Label { cost, from: i as u32 }
            };
            least(self.leave[before].iter().enumerate().map(reach))
        };
        (0..b.len()).map(best).collect()
    }

    /// The best node to end with.
    pub(super) fn last(&self) -> Option<(usize, Cost)> {
        let last = self.come.last()?;
        let costs = last.iter().map(|label| label.cost).enumerate();
        costs.reduce(|best, other| if other.1 < best.1 { other } else { best })
    }
}

/// From the start, or where the first layer is begun with.
fn begun(of: &Givens<'_>) -> Vec<Label> {
    let cost = |(k, q): (usize, &JointVector)| match of.start {
        None => Cost(0, 0.0),
        Some(_) if !of.open(None, of.layers[0].node(k)) => Cost::NONE,
        Some(start) => Cost(0, LIFT + apart(of, start, q)),
    };
    let nodes = of.layers[0].nodes.iter().map(|node| &node.q).enumerate();
    nodes.map(|node| Label { cost: cost(node), from: HERE }).collect()
}

/// The labels of leaving: as a node was come to, or after a change of posture where that is better.
fn switched(of: &Givens<'_>, p: usize, come: &[Label]) -> Vec<Label> {
    let stay = |label: &Label| Label { from: HERE, ..*label };
    let mut leave: Vec<Label> = come.iter().map(stay).collect();
    if !of.switches {
        return leave;
    }
    let nodes = &of.layers[p].nodes;
    let Some(fewest) = come.iter().map(|l| l.cost).filter(|c| c.is_some()).map(|c| c.0).min()
    else {
        return leave;
    };
    for (k, label) in leave.iter_mut().enumerate() {
        if label.cost.0 <= fewest {
            continue;
        }
        for (i, from) in come.iter().enumerate().filter(|(_, l)| l.cost.0 == fewest) {
            if i == k || !of.open(Some(of.layers[p].node(i)), of.layers[p].node(k)) {
                continue;
            }
            let cost = from.cost.plus(1, LIFT + apart(of, &nodes[i].q, &nodes[k].q));
            if cost < label.cost {
                *label = Label { cost, from: i as u32 };
            }
        }
    }
    leave
}

fn apart(of: &Givens<'_>, a: &JointVector, b: &JointVector) -> f64 {
    of.continuous.displacement(a, b).iter().map(|d| d * d).sum::<f64>().sqrt()
}

fn least(labels: impl Iterator<Item = Label>) -> Label {
    let none = Label { cost: Cost::NONE, from: HERE };
    labels.fold(none, |best, label| if label.cost < best.cost { label } else { best })
}
