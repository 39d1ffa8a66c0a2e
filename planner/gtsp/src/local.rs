//! The tour under search and its local search: 2-opt, relocation of short stretches and exchange
//! of neighbouring stretches, each with the nodes at the new joints chosen anew.

use crate::joint::{Joint, between};
use crate::layered::Layers;
use crate::order::Order;
use crate::table::Table;

/// Longest stretch that is relocated as a whole.
const LONGEST_RELOCATED: usize = 3;
/// Positions on either side of a changed joint whose nodes are chosen anew together.
const WINDOW: usize = 4;

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
        if table.is_small() {
            return false;
        }
        let mut best = (0_i64, None);
        relocations(table, tour, c, &mut best);
        if table.reversible {
            reversals(table, tour, c, &mut best);
        } else {
            // Not where reversals do as well: this move alone would undo every kick.
            exchanges(table, tour, c, &mut best);
        }
        let (gain, Some(found)) = best else { return false };
        debug_assert!(gain < 0);
        self.apply(table, tour, found);
        tour.cost += gain;
        debug_assert_eq!(tour.cost, tour.recomputed(table));
        true
    }

    fn apply(&mut self, table: &Table, tour: &mut Order, found: Move) {
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
                let joint = first + last + 1 - middle;
                for p in [first - 1, first, joint - 1, joint, last, last + 1] {
                    self.push_position(tour, p);
                }
                for p in [first - 1, joint - 1, last] {
                    tour.refresh(table, p);
                }
            }
        }
    }
}

fn reversals(table: &Table, tour: &Order, c: u32, best: &mut (i64, Option<Move>)) {
    let m = tour.order.len();
    let p = tour.position[c as usize] as usize;
    let behind = (p + m - 1) % m;
    // The removed arc, and what the cluster's other arc could gain by another node.
    let ahead_limit = tour.arc(p) + tour.loose(behind);
    let behind_limit = tour.arc(behind) + tour.loose(p);
    for (n, low) in table.near_out(c) {
        let low = i64::from(low);
        if low >= ahead_limit.max(behind_limit) {
            break;
        }
        let q = tour.position[n as usize] as usize;
        if low < ahead_limit {
            try_reversal(table, tour, p.min(q), p.max(q), best);
        }
        if low < behind_limit {
            let q = (q + m - 1) % m;
            try_reversal(table, tour, behind.min(q), behind.max(q), best);
        }
    }
}

/// Joins positions i and j, and i+1 and j+1, by reversing what lies between.
fn try_reversal(table: &Table, tour: &Order, i: usize, j: usize, best: &mut (i64, Option<Move>)) {
    let m = tour.order.len();
    if j < i + 3 || j - i + 3 > m {
        return;
    }
    let before = (i + m - 1) % m;
    let (a, b) = (tour.order[i], tour.order[i + 1]);
    let (c, d) = (tour.order[j], tour.at(j + 1).0);
    let removed = tour.arc(i) + tour.arc(j);
    let loose = tour.loose(before) + tour.loose(i + 1) + tour.loose(j - 1) + tour.loose(j + 1);
    if i64::from(table.low(a, c)) + i64::from(table.low(b, d)) - removed - loose >= best.0 {
        return;
    }
    let old = removed + tour.arc(before) + tour.arc(i + 1) + tour.arc(j - 1) + tour.arc(j + 1);
    let first = Joint::new(table, tour.at(before), tour.at(i).0, tour.at(j).0, tour.at(j - 1));
    if first.bound - old >= best.0 {
        return;
    }
    let second =
        Joint::new(table, tour.at(i + 2), tour.at(i + 1).0, tour.at(j + 1).0, tour.at(j + 2));
    let limit = best.0 + old;
    let one = first.value(limit - second.bound);
    let two = second.value(limit - one);
    if one + two < limit {
        let ([a, b], [x, y]) = (first.nodes(one), second.nodes(two));
        *best =
            (one + two - old, Some(Move::Reverse { first: i + 1, last: j, nodes: [a, b, x, y] }));
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
    let removed = tour.arc(first - 1) + tour.arc(last);
    let plain = i64::from(table.d(before.0, before.1, after.0, after.1));
    let outer = (first + m - 2) % m;
    let old_left = tour.arc(outer) + tour.arc(last + 1);
    let around = tour.loose(outer) + tour.loose(last + 1);
    let most = removed + around - i64::from(table.low(before.0, after.0));
    let nearest = table.near_in(c).chain(table.near_out(c)).map(|(_, low)| low).min();
    if nearest.is_none_or(|low| i64::from(low) >= most) {
        return;
    }
    let closing = Joint::new(table, tour.at(outer), before.0, after.0, tour.at(last + 2));
    let value = closing.value(plain + old_left);
    let chosen = value - old_left;
    let saving = removed - chosen.min(plain);
    let inner = tour.stretch_cost(first, last);
    let inner_turned = if table.reversible { inner } else { turned_cost(table, tour, first, last) };
    // Turning a stretch may cost anything where costs are not symmetric.
    let inner_loose = match last - first {
        0 => 0,
        1 if table.reversible => tour.loose(first),
        2 if table.reversible => tour.loose(first) + tour.loose(first + 1),
        _ => i64::from(i32::MAX),
    };
    let mut attempt = |to: usize, turned: bool| {
        if to + 1 >= first && to <= last {
            return;
        }
        let (x, y) = (tour.at(to), tour.at(to + 1));
        let untouched = [x.0, y.0].iter().all(|k| *k != before.0 && *k != after.0);
        let anew = untouched && chosen < plain;
        let gap = tour.arc(to);
        let rest = if anew { chosen } else { plain } - removed - gap;
        let (head, tail) = if turned { (last, first) } else { (first, last) };
        let (enter, leave) = (table.low(x.0, tour.order[head]), table.low(tour.order[tail], y.0));
        let ways = i64::from(enter) + i64::from(leave);
        if rest + ways - inner_loose >= best.0 {
            return;
        }
        let (new, ends) = match last - first {
            0 => {
                let (cost, node) = between(table, x, tour.at(first).0, y);
                (cost, [node, node])
            }
            1 => {
                let joint = Joint::new(table, x, tour.at(head).0, tour.at(tail).0, y);
                let limit = best.0 - rest + inner;
                let cost = joint.value(limit);
                if cost >= limit {
                    return;
                }
                (cost - inner, joint.nodes(cost))
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
                    tour.arc(first) + tour.arc(last_but_one)
                };
                let turning = if turned { inner_turned - inner } else { 0 };
                (cost_in + cost_out - ends + turning, [a, b])
            }
        };
        let delta = rest + new;
        if delta < best.0 {
            let left = if anew { closing.nodes(value) } else { [before.1, after.1] };
            *best = (delta, Some(Move::Relocate { first, last, to, turned, left, ends }));
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
    let ahead = tour.arc(p);
    for (n, low) in table.near_out(c) {
        if i64::from(low) >= ahead {
            break;
        }
        let q = tour.position[n as usize] as usize;
        if q == 0 {
            continue;
        }
        let first_gain = ahead - pair(table, here, tour.at(q)) + tour.arc(q - 1);
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
            let old = ahead + tour.arc(q - 1) + tour.arc(r);
            if new - old < best.0 {
                *best = (new - old, Some(Move::Exchange { first, middle, last }));
            }
        }
    }
    debug_assert!(m > 3);
}
