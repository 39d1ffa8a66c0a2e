//! Edge assembly crossover on the orders of clusters (after Nagata & Kobayashi, INFORMS J. Comput.
//! 25(2), 2013), with nodes chosen anew wherever the order has changed.
//!
//! Arcs that only one parent has form cycles which alternate between the parents. Applying one of
//! them to the first parent exchanges some of its arcs for the second one's; subtours that arise
//! are patched together at least cost.

use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;

use crate::local::LocalSearch;
use crate::pieces::{Links, Pieces};
use crate::search_tour::SearchTour;
use crate::table::Table;

const NONE: u32 = u32::MAX;

/// Scratch space of the crossover.
#[derive(Default)]
pub(super) struct Crossover {
    a: Links,
    b: Links,
    rest_a: Links,
    rest_b: Links,
    /// Clusters along all cycles, one after the other; the first is not repeated at the end.
    cycle: Vec<u32>,
    ends: Vec<usize>,
    path: Vec<u32>,
    seen: Vec<[u32; 2]>,
    /// The first parent's links but for those of `touched`, while a child is made.
    child: Links,
    touched: Vec<u32>,
    pieces: Pieces,
}

fn links(tour: &SearchTour, into: &mut Links) {
    let m = tour.order.len();
    into.clear();
    into.resize(m, [NONE; 2]);
    for p in 0..m {
        let next = tour.order[if p + 1 == m { 0 } else { p + 1 }];
        into[tour.order[p] as usize][1] = next;
        into[next as usize][0] = tour.order[p];
    }
}

fn replace(links: &mut Links, at: u32, old: u32, new: u32) {
    let slots = &mut links[at as usize];
    let k = usize::from(slots[0] != old);
    debug_assert_eq!(slots[k], old);
    slots[k] = new;
}

impl Crossover {
    /// Splits the difference of two tours into alternating cycles; returns how many there are.
    pub(super) fn prepare(
        &mut self,
        table: &Table,
        a: &SearchTour,
        b: &SearchTour,
        rng: &mut ChaCha8Rng,
    ) -> usize {
        links(a, &mut self.a);
        links(b, &mut self.b);
        self.child.clone_from(&self.a);
        self.cycle.clear();
        self.ends.clear();
        if table.reversible {
            self.undirected_cycles(rng);
        } else {
            self.directed_cycles();
        }
        self.ends.len()
    }

    fn directed_cycles(&mut self) {
        let m = self.a.len();
        let mut done = vec![false; m];
        for start in 0..m as u32 {
            if done[start as usize] || self.a[start as usize][1] == self.b[start as usize][1] {
                continue;
            }
            let mut here = start;
            loop {
                done[here as usize] = true;
                let head = self.a[here as usize][1];
                self.cycle.push(here);
                self.cycle.push(head);
                here = self.b[head as usize][0];
                if here == start {
                    break;
                }
            }
            self.ends.push(self.cycle.len());
        }
    }

    fn undirected_cycles(&mut self, rng: &mut ChaCha8Rng) {
        let m = self.a.len();
        self.rest_a.clear();
        self.rest_b.clear();
        for c in 0..m {
            let only = |mine: [u32; 2], other: [u32; 2]| {
                let keep = |x: u32| if other.contains(&x) { NONE } else { x };
                let (x, y) = (keep(mine[0]), keep(mine[1]));
                if x == NONE { [y, NONE] } else { [x, y] }
            };
            self.rest_a.push(only(self.a[c], self.b[c]));
            self.rest_b.push(only(self.b[c], self.a[c]));
        }
        self.seen.clear();
        self.seen.resize(m, [NONE; 2]);
        let offset = rng.random_range(0..m);
        for k in 0..m {
            let start = ((k + offset) % m) as u32;
            while self.rest_a[start as usize][0] != NONE {
                self.path.clear();
                self.path.push(start);
                self.seen[start as usize][0] = 0;
                self.walk(rng);
                self.seen[start as usize][0] = NONE;
            }
        }
    }

    /// Walks at random along remaining arcs, cutting cycles off the path until nothing is left.
    fn walk(&mut self, rng: &mut ChaCha8Rng) {
        loop {
            let steps = self.path.len() - 1;
            let here = self.path[steps];
            let rest = if steps.is_multiple_of(2) { &mut self.rest_a } else { &mut self.rest_b };
            let slots = rest[here as usize];
            if slots[0] == NONE {
                debug_assert_eq!(steps, 0);
                return;
            }
            let next = if slots[1] != NONE && rng.random::<bool>() { slots[1] } else { slots[0] };
            remove(rest, here, next);
            remove(rest, next, here);
            let parity = (steps + 1) % 2;
            let earlier = self.seen[next as usize][parity];
            if earlier == NONE {
                self.seen[next as usize][parity] = self.path.len() as u32;
                self.path.push(next);
                continue;
            }
            // Stored so that the first arc of a cycle belongs to the first parent.
            let from = earlier as usize;
            let length = self.path.len() - from;
            for k in 0..length {
                self.cycle.push(self.path[from + (k + parity) % length]);
            }
            self.ends.push(self.cycle.len());
            while self.path.len() > from + 1 {
                let c = self.path.pop().unwrap_or(next);
                self.seen[c as usize][self.path.len() % 2] = NONE;
            }
        }
    }

    /// Applies cycle `k` to the first of the two parents that were prepared, patches, chooses nodes
    /// and improves locally.
    pub(super) fn child(
        &mut self,
        table: &Table,
        [a, b]: [&SearchTour; 2],
        k: usize,
        local: &mut LocalSearch,
        out: &mut SearchTour,
    ) {
        let from = if k == 0 { 0 } else { self.ends[k - 1] };
        let cycle = &self.cycle[from..self.ends[k]];
        self.touched.clear();
        self.touched.extend_from_slice(cycle);
        if table.reversible {
            for pair in cycle.chunks_exact(2) {
                replace(&mut self.child, pair[0], pair[1], NONE);
                replace(&mut self.child, pair[1], pair[0], NONE);
            }
            for i in (1..cycle.len()).step_by(2) {
                let (x, y) = (cycle[i], cycle[(i + 1) % cycle.len()]);
                replace(&mut self.child, x, NONE, y);
                replace(&mut self.child, y, NONE, x);
            }
        } else {
            for i in (0..cycle.len()).step_by(2) {
                let head = cycle[i + 1];
                let tail = cycle[(i + 2) % cycle.len()];
                self.child[head as usize][0] = tail;
                self.child[tail as usize][1] = head;
            }
        }
        out.copy_from(a);
        for c in &self.touched {
            let c = *c as usize;
            let (mine, other) = (self.child[c], self.b[c]);
            if mine == other || (table.reversible && mine[0] == other[1] && mine[1] == other[0]) {
                out.chosen[c] = b.chosen[c];
            }
        }
        self.patch(table, a, &out.chosen);
        self.unroll(table, a, out);
        for c in &self.touched {
            self.child[*c as usize] = self.a[*c as usize];
        }
        for c in &self.touched {
            local.push(*c);
        }
        local.run(table, out);
    }

    /// Joins all subtours, smallest first, by the cheapest exchange of two arcs.
    fn patch(&mut self, table: &Table, a: &SearchTour, chosen: &[u32]) {
        self.pieces.cut(a, &self.child, &self.touched);
        self.pieces.number_parts(a, &self.child, table.reversible);
        let d = |x: u32, y: u32| i64::from(table.d(x, chosen[x as usize], y, chosen[y as usize]));
        let mut clusters = Vec::new();
        while let Some(id) = self.pieces.smallest_part() {
            clusters.clear();
            self.pieces.clusters_of(id, a, &mut clusters);
            clusters.sort_unstable();
            let mut best = (i64::MAX, [NONE; 4]);
            for &x in &clusters {
                for (n, _) in table.near_out(x) {
                    self.try_patch(table, &d, (id, x, n), &mut best);
                }
            }
            if best.0 == i64::MAX {
                // Nothing near is outside: where arcs were exchanged, of which each subtour has some.
                for &x in self.touched.iter().filter(|&&x| self.pieces.part_of(x) == id) {
                    for &u in &self.touched {
                        self.try_patch(table, &d, (id, x, u), &mut best);
                    }
                }
            }
            // x–y and u–v become x–u and y–v; directed: x→y, v→u become x→u, v→y.
            let [x, y, u, v] = best.1;
            replace_arc(&mut self.child, table.reversible, x, y, u, v);
            self.touched.extend_from_slice(&best.1);
            self.pieces.join(id, &clusters, self.pieces.part_of(u));
            self.pieces.cut(a, &self.child, &best.1);
        }
    }

    /// Cheapest exchange of an arc at `x` and one at `u`, where they belong to different subtours.
    fn try_patch(
        &self,
        table: &Table,
        d: &impl Fn(u32, u32) -> i64,
        (id, x, u): (u32, u32, u32),
        best: &mut (i64, [u32; 4]),
    ) {
        if self.pieces.part_of(u) == id {
            return;
        }
        let joined = d(x, u);
        // The other new arc is the dear one to look up: it costs `least` at least.
        let least = i64::from(table.least);
        let mut attempt = |y: u32, v: u32, removed: i64, other: (u32, u32)| {
            let rest = joined - removed;
            if rest.saturating_add(least) < best.0 {
                let delta = rest + d(other.0, other.1);
                if delta < best.0 {
                    *best = (delta, [x, y, u, v]);
                }
            }
        };
        if table.reversible {
            for y in self.child[x as usize] {
                let before = d(x, y);
                for v in self.child[u as usize] {
                    attempt(y, v, before + d(u, v), (y, v));
                }
            }
        } else {
            let (y, v) = (self.child[x as usize][1], self.child[u as usize][0]);
            attempt(y, v, d(x, y) + d(v, u), (v, y));
        }
    }

    /// The order from the root on, in the cheaper direction; what is as in the first parent, of
    /// which `out` is a copy, is taken over.
    fn unroll(&self, table: &Table, a: &SearchTour, out: &mut SearchTour) {
        let mut to = 0;
        self.pieces.walk(a, &self.child, table.reversible, 0, |from, last, forward| {
            out.take_stretch(a, (from, last), forward, to);
            to += last + 1 - from;
        });
        debug_assert_eq!(to, a.order.len());
        let root = table.root as u32;
        let [x, y] = self.child[root as usize];
        let d = |x: u32, y: u32| table.d(x, out.chosen[x as usize], y, out.chosen[y as usize]);
        if table.reversible && d(root, x) + d(y, root) < d(root, y) + d(x, root) {
            out.reverse(1, to - 1);
        }
        out.refresh_around(table, self.touched.iter().chain([&root]));
    }
}

fn remove(rest: &mut Links, at: u32, other: u32) {
    let slots = &mut rest[at as usize];
    if slots[0] == other {
        slots[0] = slots[1];
    }
    slots[1] = NONE;
}

fn replace_arc(links: &mut Links, reversible: bool, x: u32, y: u32, u: u32, v: u32) {
    if reversible {
        replace(links, x, y, u);
        replace(links, y, x, v);
        replace(links, u, v, x);
        replace(links, v, u, y);
    } else {
        links[x as usize][1] = u;
        links[u as usize][0] = x;
        links[v as usize][1] = y;
        links[y as usize][0] = v;
    }
}
