//! The local search: moves around queued clusters, then cluster optimisation around what changed.

use crate::cluster_optimisation::ClusterOptimiser;
use crate::moves::{Move, best_move};
use crate::search_tour::SearchTour;
use crate::table::Table;

/// Positions on either side of a changed cluster whose nodes are chosen anew together.
const WINDOW: usize = 4;

/// Local search with its work queue.
pub(super) struct LocalSearch {
    pub(super) optimiser: ClusterOptimiser,
    queue: Vec<u32>,
    head: usize,
    queued: Vec<bool>,
    changed: Vec<u32>,
    touched: Vec<u32>,
}

impl LocalSearch {
    pub(super) fn new(m: usize) -> Self {
        Self {
            optimiser: ClusterOptimiser::default(),
            queue: Vec::new(),
            head: 0,
            queued: vec![false; m],
            changed: Vec::new(),
            touched: Vec::new(),
        }
    }

    /// Marks a cluster whose surroundings have changed.
    pub(super) fn push(&mut self, cluster: u32) {
        if !self.queued[cluster as usize] {
            self.queued[cluster as usize] = true;
            self.queue.push(cluster);
        }
    }

    fn push_position(&mut self, tour: &SearchTour, p: usize) {
        let c = tour.at(p).0;
        self.push(c);
        self.touched.push(c);
    }

    /// Improves the tour until no queued cluster has an improving move.
    pub(super) fn run(&mut self, table: &Table, tour: &mut SearchTour) {
        self.touched.clear();
        self.touched.extend_from_slice(&self.queue[self.head..]);
        loop {
            while self.head < self.queue.len() {
                let c = self.queue[self.head];
                self.head += 1;
                self.queued[c as usize] = false;
                while self.improve(table, tour, c) {}
            }
            self.queue.clear();
            self.head = 0;
            self.choose_nodes(table, tour);
            if self.queue.is_empty() {
                return;
            }
        }
    }

    /// Windows around all that was touched, merged where they overlap.
    fn choose_nodes(&mut self, table: &Table, tour: &mut SearchTour) {
        let last = tour.order.len() - 1;
        let mut places: Vec<u32> =
            self.touched.drain(..).map(|c| tour.position[c as usize]).collect();
        places.sort_unstable();
        places.dedup();
        let mut k = 0;
        while k < places.len() {
            let from = (places[k] as usize).saturating_sub(WINDOW).max(1);
            let mut to = places[k] as usize + WINDOW;
            k += 1;
            while k < places.len() && places[k] as usize <= to + 1 + WINDOW / 2 {
                to = places[k] as usize + WINDOW;
                k += 1;
            }
            let to = to.min(last);
            if from <= to {
                self.optimiser.optimise_window(table, tour, from, to, &mut self.changed);
            }
        }
        while let Some(c) = self.changed.pop() {
            let p = tour.position[c as usize] as usize;
            for q in [p + last, p, p + 1] {
                let near = tour.order[q % (last + 1)];
                self.push(near);
            }
            self.touched.push(c);
        }
    }

    /// Makes the best move around a cluster; whether there was one.
    fn improve(&mut self, table: &Table, tour: &mut SearchTour, c: u32) -> bool {
        if table.is_small() {
            return false;
        }
        let Some((gain, found)) = best_move(table, tour, c) else { return false };
        debug_assert!(gain < 0);
        self.apply(table, tour, found);
        tour.cost += gain;
        debug_assert_eq!(tour.cost, tour.recomputed(table));
        true
    }

    fn apply(&mut self, table: &Table, tour: &mut SearchTour, found: Move) {
        let m = tour.order.len();
        match found {
            Move::Reverse { first, last, nodes } => {
                tour.reverse(first, last);
                for (p, node) in [first - 1, first, last, last + 1].into_iter().zip(nodes) {
                    let c = tour.at(p).0;
                    tour.chosen[c as usize] = node;
                    self.push_position(tour, p);
                }
                for p in [first + m - 2, first - 1, first, last - 1, last, last + 1] {
                    tour.refresh(table, p);
                }
            }
            Move::Relocate { first, last, to, turned, left, ends } => {
                let length = last - first + 1;
                let (before, after) = (tour.at(first - 1).0, tour.at(last + 1).0);
                tour.chosen[before as usize] = left[0];
                tour.chosen[after as usize] = left[1];
                if turned {
                    tour.order[first..=last].reverse();
                }
                let start = if to > last {
                    tour.exchange(first, last + 1, to);
                    to + 1 - length
                } else {
                    tour.exchange(to + 1, first, last);
                    to + 1
                };
                tour.chosen[tour.order[start] as usize] = ends[0];
                tour.chosen[tour.order[start + length - 1] as usize] = ends[1];
                for p in start - 1..=start + length {
                    self.push_position(tour, p);
                }
                for p in start - 1..start + length {
                    tour.refresh(table, p);
                }
                for c in [before, after] {
                    self.push(c);
                    self.touched.push(c);
                    let p = tour.position[c as usize] as usize;
                    tour.refresh(table, p + m - 1);
                    tour.refresh(table, p);
                }
            }
            Move::Exchange { first, middle, last } => {
                tour.exchange(first, middle, last);
                let border = first + last + 1 - middle;
                for p in [first - 1, first, border - 1, border, last, last + 1] {
                    self.push_position(tour, p);
                }
                for p in [first - 1, border - 1, last] {
                    tour.refresh(table, p);
                }
            }
        }
    }
}
