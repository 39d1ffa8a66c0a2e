//! Cluster optimisation: the cheapest nodes for a fixed order of clusters, by dynamic programming
//! (Fischetti, Salazar González & Toth, Oper. Res. 45(3), 1997).

use crate::search_tour::SearchTour;
use crate::table::Table;

/// Scratch space of the dynamic program: one stage for each position.
#[derive(Default)]
pub(super) struct ClusterOptimiser {
    /// Cheapest path to each node of each stage, stage after stage.
    labels: Vec<i32>,
    /// Where each stage begins.
    starts: Vec<usize>,
    choice: Vec<u32>,
}

/// out[j] = min over i of from[i] + block[i][j].
#[inline]
fn min_plus(from: &[i32], block: &[i32], out: &mut [i32]) {
    let width = out.len();
    if width == 1 {
        out[0] = from.iter().zip(block).map(|(f, d)| f + d).min().unwrap_or(i32::MAX);
        return;
    }
    out.fill(i32::MAX);
    for (f, row) in from.iter().zip(block.chunks_exact(width)) {
        for (o, d) in out.iter_mut().zip(row) {
            *o = (*o).min(f + d);
        }
    }
}

impl ClusterOptimiser {
    /// Re-chooses the nodes at positions `first..=last` (inside 1..m−1) for their neighbours'
    /// present nodes. Returns the change of the cost, at most 0; `changed` receives the clusters
    /// whose node is another one.
    pub(super) fn optimise_window(
        &mut self,
        table: &Table,
        tour: &mut SearchTour,
        first: usize,
        last: usize,
        changed: &mut Vec<u32>,
    ) -> i64 {
        let before = tour.stretch_cost(first - 1, last + 1);
        let (a, i) = tour.at(first - 1);
        let (z, k) = tour.at(last + 1);
        self.labels.clear();
        self.starts.clear();
        let (add, row) = table.row(a, i, tour.order[first]);
        self.starts.push(0);
        self.labels.extend(row.iter().map(|d| d + add));
        for p in first + 1..=last {
            self.push_stage(table, tour.order[p - 1], tour.order[p]);
        }
        let end = tour.order[last];
        let (add, column) = table.column(end, z, k);
        let at = self.starts[last - first];
        let (best, mut node) = lowest(&self.labels[at..], column);
        let delta = i64::from(best) + i64::from(add) - before;
        if delta >= 0 {
            return 0;
        }
        for p in (first..=last).rev() {
            let c = tour.order[p];
            if tour.chosen[c as usize] != node {
                tour.chosen[c as usize] = node;
                changed.push(c);
            }
            if p > first {
                let (_, column) = table.column(tour.order[p - 1], c, node);
                let at = self.starts[p - 1 - first];
                node = lowest(&self.labels[at..at + column.len()], column).1;
            }
        }
        for p in first - 1..=last {
            tour.refresh(table, p);
        }
        tour.cost += delta;
        delta
    }

    /// Re-chooses every node, the root's too: the best choice for this order.
    pub(super) fn optimise_all(&mut self, table: &Table, tour: &mut SearchTour) {
        let m = tour.order.len();
        let root = tour.order[0];
        if m < 2 {
            return;
        }
        let mut best = tour.cost;
        let mut improved = false;
        for node in 0..table.sizes[root as usize] {
            self.labels.clear();
            self.starts.clear();
            let (add, row) = table.row(root, node, tour.order[1]);
            self.starts.push(0);
            self.labels.extend(row.iter().map(|d| d + add));
            for p in 2..m {
                self.push_stage(table, tour.order[p - 1], tour.order[p]);
            }
            let end = tour.order[m - 1];
            let (add, column) = table.column(end, root, node);
            let (value, mut k) = lowest(&self.labels[self.starts[m - 2]..], column);
            let value = i64::from(value) + i64::from(add);
            if value >= best {
                continue;
            }
            best = value;
            improved = true;
            self.choice.clear();
            self.choice.resize(m, node);
            for p in (1..m).rev() {
                self.choice[p] = k;
                if p > 1 {
                    let (_, column) = table.column(tour.order[p - 1], tour.order[p], k);
                    let at = self.starts[p - 2];
                    k = lowest(&self.labels[at..at + column.len()], column).1;
                }
            }
        }
        if improved {
            for p in 0..m {
                tour.chosen[tour.order[p] as usize] = self.choice[p];
            }
            tour.refresh_all(table);
        }
    }

    /// Labels of the stage after the last one.
    fn push_stage(&mut self, table: &Table, from: u32, to: u32) {
        let start = self.labels.len();
        let previous = self.starts[self.starts.len() - 1];
        self.labels.resize(start + table.sizes[to as usize] as usize, 0);
        let (add, block) = table.block(from, to);
        let (done, out) = self.labels.split_at_mut(start);
        min_plus(&done[previous..], block, out);
        if add != 0 {
            for o in out {
                *o += add;
            }
        }
        self.starts.push(start);
    }
}

/// Smallest sum and the first index that has it.
#[inline]
pub(super) fn lowest(a: &[i32], b: &[i32]) -> (i32, u32) {
    let mut best = (i32::MAX, 0);
    for (k, (x, y)) in a.iter().zip(b).enumerate() {
        if x + y < best.0 {
            best = (x + y, k as u32);
        }
    }
    best
}
