//! The tour under search: order, chosen nodes and cached arcs.

use crate::table::Table;
use crate::tour::Tour;

/// Order of the clusters with the root first, chosen nodes, and the cost in the table's units.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct SearchTour {
    pub(super) order: Vec<u32>,
    pub(super) position: Vec<u32>,
    pub(super) chosen: Vec<u32>,
    /// Cost of the arc from each position to the next.
    arcs: Vec<i32>,
    /// What of it another choice of nodes could save at most.
    slack: Vec<i32>,
    pub(super) cost: i64,
}

impl SearchTour {
    pub(super) fn new(table: &Table, order: Vec<u32>, chosen: Vec<u32>) -> Self {
        let mut position = vec![0; order.len()];
        for (p, &c) in order.iter().enumerate() {
            position[c as usize] = p as u32;
        }
        let m = order.len();
        let (arcs, slack) = (vec![0; m], vec![0; m]);
        let mut tour = Self { order, position, chosen, arcs, slack, cost: 0 };
        tour.refresh_all(table);
        tour
    }

    /// The tour under search of a public form, in a table of all nodes.
    pub(super) fn from_tour(table: &Table, tour: &Tour) -> Self {
        let root = table.outer_root.then_some(table.root as u32);
        let mut order: Vec<u32> =
            root.into_iter().chain(tour.clusters.iter().map(|&c| c as u32)).collect();
        // A closed tour from outside may begin anywhere.
        let root = order.iter().position(|&c| c as usize == table.root).unwrap_or(0);
        order.rotate_left(root);
        let mut chosen = vec![0; table.m];
        for (&c, &node) in tour.clusters.iter().zip(&tour.nodes) {
            chosen[c] = node as u32;
        }
        Self::new(table, order, chosen)
    }

    /// The public form, with the nodes that the instance has.
    pub(super) fn to_tour(&self, table: &Table) -> Tour {
        let clusters = &self.order[usize::from(table.outer_root)..];
        Tour {
            clusters: clusters.iter().map(|&c| c as usize).collect(),
            nodes: clusters
                .iter()
                .map(|&c| table.instance_node(c, self.chosen[c as usize]) as usize)
                .collect(),
        }
    }

    /// Brings the cached arcs and the cost up to date.
    pub(super) fn refresh_all(&mut self, table: &Table) {
        for p in 0..self.order.len() {
            self.refresh(table, p);
        }
        self.cost = self.arcs.iter().map(|&d| i64::from(d)).sum();
    }

    /// Copies the positions `first..=last` of another tour to those from `to` on, also turned
    /// around; the arc behind the last one is for the caller to refresh.
    pub(super) fn take_stretch(
        &mut self,
        other: &Self,
        (first, last): (usize, usize),
        forward: bool,
        to: usize,
    ) {
        if forward && first == to {
            return; // It lies there already.
        }
        let end = to + last - first;
        self.order[to..=end].copy_from_slice(&other.order[first..=last]);
        self.arcs[to..end].copy_from_slice(&other.arcs[first..last]);
        self.slack[to..end].copy_from_slice(&other.slack[first..last]);
        if forward {
            self.renumber(to, end);
        } else {
            self.reverse(to, end);
        }
    }

    /// Brings the arcs at some clusters and the cost up to date.
    pub(super) fn refresh_around<'a>(
        &mut self,
        table: &Table,
        clusters: impl Iterator<Item = &'a u32>,
    ) {
        let m = self.order.len();
        for &c in clusters {
            let p = self.position[c as usize] as usize;
            self.refresh(table, p + m - 1);
            self.refresh(table, p);
        }
        self.cost = self.arcs.iter().map(|&d| i64::from(d)).sum();
    }

    /// Brings the cached arc from position `p` on up to date; m is the root again.
    #[inline]
    pub(super) fn refresh(&mut self, table: &Table, p: usize) {
        let m = self.order.len();
        let p = if p >= m { p - m } else { p };
        let ((a, i), (b, j)) = (self.at(p), self.at(p + 1));
        let d = table.d(a, i, b, j);
        self.arcs[p] = d;
        self.slack[p] = d - table.low(a, b);
    }

    /// Cost from the arcs themselves.
    pub(super) fn recomputed(&self, table: &Table) -> i64 {
        (0..self.order.len())
            .map(|p| {
                let ((a, i), (b, j)) = (self.at(p), self.at(p + 1));
                debug_assert_eq!(self.arcs[p], table.d(a, i, b, j), "stale arc at {p}");
                i64::from(table.d(a, i, b, j))
            })
            .sum()
    }

    /// Cost of the arc from position `p`, at most 2m − 1, to the next.
    #[inline]
    pub(super) fn arc(&self, p: usize) -> i64 {
        i64::from(self.arcs[if p >= self.arcs.len() { p - self.arcs.len() } else { p }])
    }

    /// What another choice of nodes could save of that arc at most.
    #[inline]
    pub(super) fn slack(&self, p: usize) -> i64 {
        i64::from(self.slack[if p >= self.slack.len() { p - self.slack.len() } else { p }])
    }

    /// Takes another tour's place without allocating.
    pub(super) fn copy_from(&mut self, other: &Self) {
        self.order.copy_from_slice(&other.order);
        self.position.copy_from_slice(&other.position);
        self.chosen.copy_from_slice(&other.chosen);
        self.arcs.copy_from_slice(&other.arcs);
        self.slack.copy_from_slice(&other.slack);
        self.cost = other.cost;
    }

    /// Cluster and node at a position; m is the root again.
    #[inline]
    pub(super) fn at(&self, p: usize) -> (u32, u32) {
        let c = self.order[if p >= self.order.len() { p - self.order.len() } else { p }];
        (c, self.chosen[c as usize])
    }

    /// Sum of the arcs from position `from` to position `to`, at most m.
    pub(super) fn stretch_cost(&self, from: usize, to: usize) -> i64 {
        self.arcs[from..to].iter().map(|&d| i64::from(d)).sum()
    }

    /// Reverses a stretch. The arcs inside it follow where costs are symmetric; the arcs at its
    /// ends and everything else are for the caller to refresh.
    pub(super) fn reverse(&mut self, first: usize, last: usize) {
        self.order[first..=last].reverse();
        self.arcs[first..last].reverse();
        self.slack[first..last].reverse();
        self.renumber(first, last);
    }

    /// Exchanges the stretches `first..middle` and `middle..=last`; the three new arcs are for
    /// the caller to refresh.
    pub(super) fn exchange(&mut self, first: usize, middle: usize, last: usize) {
        self.order[first..=last].rotate_left(middle - first);
        self.arcs[first..=last].rotate_left(middle - first);
        self.slack[first..=last].rotate_left(middle - first);
        self.renumber(first, last);
    }

    fn renumber(&mut self, first: usize, last: usize) {
        for p in first..=last {
            self.position[self.order[p] as usize] = p as u32;
        }
    }
}
