//! The tour under search and its local search: 2-opt, relocation of short stretches and exchange
//! of neighbouring stretches, each with the nodes at the new joints chosen anew.

use super::layered::{Layers, lowest};
use super::table::Table;

/// Longest stretch that is relocated as a whole.
const LONGEST_RELOCATED: usize = 3;
/// Positions on either side of a changed joint whose nodes are chosen anew together.
const WINDOW: usize = 4;

/// Order of the clusters with the root first, chosen nodes, and the cost in the table's units.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Order {
    pub(super) order: Vec<u32>,
    pub(super) position: Vec<u32>,
    pub(super) chosen: Vec<u32>,
    pub(super) cost: i64,
}

impl Order {
    pub(super) fn new(table: &Table, order: Vec<u32>, chosen: Vec<u32>) -> Self {
        let mut position = vec![0; order.len()];
        for (p, &c) in order.iter().enumerate() {
            position[c as usize] = p as u32;
        }
        let mut tour = Self { order, position, chosen, cost: 0 };
        tour.cost = tour.recomputed(table);
        tour
    }

    pub(super) fn recomputed(&self, table: &Table) -> i64 {
        self.stretch_cost(table, 0, self.order.len())
    }

    /// Takes another tour's place without allocating.
    pub(super) fn copy_from(&mut self, other: &Self) {
        self.order.copy_from_slice(&other.order);
        self.position.copy_from_slice(&other.position);
        self.chosen.copy_from_slice(&other.chosen);
        self.cost = other.cost;
    }

    /// Cluster and node at a position; m is the root again.
    #[inline]
    pub(super) fn at(&self, p: usize) -> (u32, u32) {
        let c = self.order[if p >= self.order.len() { p - self.order.len() } else { p }];
        (c, self.chosen[c as usize])
    }

    /// Sum of the arcs from position `from` to position `to`.
    pub(super) fn stretch_cost(&self, table: &Table, from: usize, to: usize) -> i64 {
        let (mut a, mut i) = self.at(from);
        let mut sum = 0;
        for p in from + 1..=to {
            let (b, j) = self.at(p);
            sum += i64::from(table.d(a, i, b, j));
            (a, i) = (b, j);
        }
        sum
    }

    pub(super) fn reverse(&mut self, first: usize, last: usize) {
        self.order[first..=last].reverse();
        self.renumber(first, last);
    }

    /// Exchanges the stretches `first..middle` and `middle..=last`.
    pub(super) fn exchange(&mut self, first: usize, middle: usize, last: usize) {
        self.order[first..=last].rotate_left(middle - first);
        self.renumber(first, last);
    }

    fn renumber(&mut self, first: usize, last: usize) {
        for p in first..=last {
            self.position[self.order[p] as usize] = p as u32;
        }
    }
}

/// The best move found for a cluster.
#[derive(Clone, Copy)]
enum Move {
    /// Reverse `first..=last`; nodes for the clusters before, first, last, after (new order).
    Reverse { first: usize, last: usize, nodes: [u32; 4] },
    /// Move `first..=last` to between `to` and `to + 1`; nodes for the neighbours left behind and
    /// for the ends of the stretch in the new order.
    Relocate { first: usize, last: usize, to: usize, turned: bool, left: [u32; 2], ends: [u32; 2] },
    /// Exchange `first..middle` and `middle..=last`.
    Exchange { first: usize, middle: usize, last: usize },
}

/// Local search with its work queue.
pub(super) struct LocalSearch {
    pub(super) layers: Layers,
    queue: Vec<u32>,
    head: usize,
    queued: Vec<bool>,
    changed: Vec<u32>,
    touched: Vec<u32>,
}

impl LocalSearch {
    pub(super) fn new(m: usize) -> Self {
        Self {
            layers: Layers::default(),
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

    fn push_position(&mut self, tour: &Order, p: usize) {
        let c = tour.at(p).0;
        self.push(c);
        self.touched.push(c);
    }

    /// Improves the tour until no queued cluster has an improving move.
    pub(super) fn run(&mut self, table: &Table, tour: &mut Order) {
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
    fn choose_nodes(&mut self, table: &Table, tour: &mut Order) {
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
                self.layers.window(table, tour, from, to, &mut self.changed);
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

    fn improve(&mut self, table: &Table, tour: &mut Order, c: u32) -> bool {
        let m = tour.order.len();
        if m < 8 {
            return false;
        }
        let mut best = (0_i64, None);
        if table.reversible {
            reversals(table, tour, c, &mut best);
        }
        relocations(table, tour, c, &mut best);
        exchanges(table, tour, c, &mut best);
        let (gain, Some(found)) = best else { return false };
        debug_assert!(gain < 0);
        self.apply(table, tour, found);
        tour.cost += gain;
        debug_assert_eq!(tour.cost, tour.recomputed(table));
        true
    }

    fn apply(&mut self, _table: &Table, tour: &mut Order, found: Move) {
        let m = tour.order.len();
        match found {
            Move::Reverse { first, last, nodes } => {
                tour.reverse(first, last);
                for (p, node) in [first - 1, first, last, last + 1].into_iter().zip(nodes) {
                    let c = tour.at(p).0;
                    tour.chosen[c as usize] = node;
                    self.push_position(tour, p);
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
                    self.push_position(tour, p % m);
                }
                for c in [before, after] {
                    self.push(c);
                    self.touched.push(c);
                }
            }
            Move::Exchange { first, middle, last } => {
                tour.exchange(first, middle, last);
                let joint = first + last + 1 - middle;
                for p in [first - 1, first, joint - 1, joint, last, last + 1] {
                    self.push_position(tour, p);
                }
            }
        }
    }
}

/// Cheapest p → a → b → q over the nodes of a and b, with those nodes.
#[inline]
fn joint(table: &Table, p: (u32, u32), a: u32, b: u32, q: (u32, u32)) -> (i64, u32, u32) {
    let (add_in, into) = table.row(p.0, p.1, a);
    let (add, block) = table.block(a, b);
    let (add_out, out) = table.column(b, q.0, q.1);
    let mut best = (i32::MAX, 0, 0);
    for (i, (d, row)) in into.iter().zip(block.chunks_exact(out.len())).enumerate() {
        let (value, j) = lowest(row, out);
        if d + value < best.0 {
            best = (d + value, i as u32, j);
        }
    }
    (i64::from(best.0) + i64::from(add_in) + i64::from(add) + i64::from(add_out), best.1, best.2)
}

/// Cheapest p → a → q over the nodes of a.
#[inline]
fn between(table: &Table, p: (u32, u32), a: u32, q: (u32, u32)) -> (i64, u32) {
    let (add_in, into) = table.row(p.0, p.1, a);
    let (add_out, out) = table.column(a, q.0, q.1);
    let (value, node) = lowest(into, out);
    (i64::from(value) + i64::from(add_in) + i64::from(add_out), node)
}

fn arc(table: &Table, tour: &Order, p: usize, q: usize) -> i64 {
    let ((a, i), (b, j)) = (tour.at(p), tour.at(q));
    i64::from(table.d(a, i, b, j))
}

fn reversals(table: &Table, tour: &Order, c: u32, best: &mut (i64, Option<Move>)) {
    let m = tour.order.len();
    let p = tour.position[c as usize] as usize;
    let behind = arc(table, tour, (p + m - 1) % m, p);
    let ahead = arc(table, tour, p, p + 1);
    let slack = behind.max(ahead);
    for (n, low) in table.near_out(c) {
        if i64::from(low) >= behind + ahead {
            break;
        }
        let q = tour.position[n as usize] as usize;
        if i64::from(low) < ahead + slack {
            try_reversal(table, tour, p.min(q), p.max(q), best);
        }
        // New arc between the two clusters, both entered where they were left.
        let (x, y) = ((p + m - 1) % m, (q + m - 1) % m);
        try_reversal(table, tour, x.min(y), x.max(y), best);
    }
}

/// Joins positions i and j, and i+1 and j+1, by reversing what lies between.
fn try_reversal(table: &Table, tour: &Order, i: usize, j: usize, best: &mut (i64, Option<Move>)) {
    let m = tour.order.len();
    if j < i + 3 || j - i + 3 > m {
        return;
    }
    let before = (i + m - 1) % m;
    let old = arc(table, tour, before, i)
        + arc(table, tour, i, i + 1)
        + arc(table, tour, i + 1, i + 2)
        + arc(table, tour, j - 1, j)
        + arc(table, tour, j, j + 1)
        + arc(table, tour, j + 1, j + 2);
    let (first, a, b) = joint(table, tour.at(before), tour.at(i).0, tour.at(j).0, tour.at(j - 1));
    if first - old >= best.0 {
        return;
    }
    let (second, x, y) =
        joint(table, tour.at(i + 2), tour.at(i + 1).0, tour.at(j + 1).0, tour.at(j + 2));
    let delta = first + second - old;
    if delta < best.0 {
        *best = (delta, Some(Move::Reverse { first: i + 1, last: j, nodes: [a, b, x, y] }));
    }
}

fn relocations(table: &Table, tour: &Order, c: u32, best: &mut (i64, Option<Move>)) {
    let m = tour.order.len();
    let p = tour.position[c as usize] as usize;
    for length in 1..=LONGEST_RELOCATED {
        // The cluster leads the stretch, then ends it.
        for leads in [true, false] {
            if length == 1 && !leads {
                continue;
            }
            let (first, last) =
                if leads { (p, p + length - 1) } else { ((p + 1).wrapping_sub(length), p) };
            if first == 0 || first >= m || last >= m {
                continue;
            }
            relocate_stretch(table, tour, c, first, last, best);
        }
    }
}

fn relocate_stretch(
    table: &Table,
    tour: &Order,
    c: u32,
    first: usize,
    last: usize,
    best: &mut (i64, Option<Move>),
) {
    let m = tour.order.len();
    let (before, after) = (tour.at(first - 1), tour.at(last + 1));
    let removed = arc(table, tour, first - 1, first) + arc(table, tour, last, last + 1);
    let plain = i64::from(table.d(before.0, before.1, after.0, after.1));
    let outer = (first + m - 2) % m;
    let old_left = arc(table, tour, outer, first - 1) + arc(table, tour, last + 1, last + 2);
    let (chosen, left_a, left_b) =
        joint(table, tour.at(outer), before.0, after.0, tour.at(last + 2));
    let chosen = chosen - old_left;
    let saving = removed - chosen.min(plain);
    let inner = tour.stretch_cost(table, first, last);
    let inner_turned = if table.reversible { inner } else { turned_cost(table, tour, first, last) };
    let mut attempt = |to: usize, turned: bool| {
        if to + 1 >= first && to <= last {
            return;
        }
        let (x, y) = (tour.at(to), tour.at(to + 1));
        let untouched = [x.0, y.0].iter().all(|k| *k != before.0 && *k != after.0);
        let (left, left_nodes) = if untouched && chosen < plain {
            (chosen, [left_a, left_b])
        } else {
            (plain, [before.1, after.1])
        };
        let gap = i64::from(table.d(x.0, x.1, y.0, y.1));
        let rest = left - removed - gap;
        if rest >= best.0 {
            return;
        }
        let (head, tail) = if turned { (last, first) } else { (first, last) };
        let (new, ends) = match last - first {
            0 => {
                let (cost, node) = between(table, x, tour.at(first).0, y);
                (cost, [node, node])
            }
            1 => {
                let (cost, a, b) = joint(table, x, tour.at(head).0, tour.at(tail).0, y);
                (cost - inner, [a, b])
            }
            _ => {
                let (next, last_but_one) =
                    if turned { (last - 1, first + 1) } else { (first + 1, last - 1) };
                let (cost_in, a) = between(table, x, tour.at(head).0, tour.at(next));
                let (cost_out, b) = between(table, tour.at(last_but_one), tour.at(tail).0, y);
                let ends = if turned {
                    pair(table, tour.at(head), tour.at(next))
                        + pair(table, tour.at(last_but_one), tour.at(tail))
                } else {
                    arc(table, tour, first, next) + arc(table, tour, last_but_one, last)
                };
                let turning = if turned { inner_turned - inner } else { 0 };
                (cost_in + cost_out - ends + turning, [a, b])
            }
        };
        let delta = rest + new;
        if delta < best.0 {
            *best =
                (delta, Some(Move::Relocate { first, last, to, turned, left: left_nodes, ends }));
        }
    };
    let leads = tour.at(first).0 == c;
    let single = first == last;
    for (n, low) in table.near_in(c) {
        if i64::from(low) >= saving {
            break;
        }
        // n stands before c.
        let q = tour.position[n as usize] as usize;
        attempt(q, !leads);
        if single || !table.reversible {
            continue;
        }
        attempt((q + m - 1) % m, leads);
    }
    if single || !table.reversible {
        for (n, low) in table.near_out(c) {
            if i64::from(low) >= saving {
                break;
            }
            // n stands after c.
            let q = tour.position[n as usize] as usize;
            attempt((q + m - 1) % m, leads && !single);
        }
    }
}

fn pair(table: &Table, a: (u32, u32), b: (u32, u32)) -> i64 {
    i64::from(table.d(a.0, a.1, b.0, b.1))
}

fn turned_cost(table: &Table, tour: &Order, first: usize, last: usize) -> i64 {
    (first..last).map(|p| pair(table, tour.at(p + 1), tour.at(p))).sum()
}

/// Exchange of two neighbouring stretches by three new arcs, nodes as they are.
fn exchanges(table: &Table, tour: &Order, c: u32, best: &mut (i64, Option<Move>)) {
    let m = tour.order.len();
    let p = tour.position[c as usize] as usize;
    let next = tour.at(p + 1);
    let here = tour.at(p);
    let ahead = pair(table, here, next);
    for (n, low) in table.near_out(c) {
        if i64::from(low) >= ahead {
            break;
        }
        let q = tour.position[n as usize] as usize;
        if q == 0 {
            continue;
        }
        let first_gain = ahead - pair(table, here, tour.at(q)) + arc(table, tour, q - 1, q);
        if first_gain <= 0 {
            continue;
        }
        for (r, low) in table.near_in(next.0) {
            if i64::from(low) >= first_gain {
                break;
            }
            let r = tour.position[r as usize] as usize;
            let (first, middle, last) = if q > p + 1 && r >= q {
                (p + 1, q, r)
            } else if q < p && r >= q && r < p {
                (q, r + 1, p)
            } else {
                continue;
            };
            let new = pair(table, here, tour.at(q))
                + pair(table, tour.at(r), next)
                + pair(table, tour.at(q - 1), tour.at(r + 1));
            let old = ahead + arc(table, tour, q - 1, q) + arc(table, tour, r, r + 1);
            if new - old < best.0 {
                *best = (new - old, Some(Move::Exchange { first, middle, last }));
            }
        }
    }
    debug_assert!(m > 3);
}
