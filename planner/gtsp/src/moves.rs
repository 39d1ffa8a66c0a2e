//! The moves: 2-opt, Or-opt and exchange of two neighbouring stretches. The nodes at the new arcs
//! of the first two are chosen anew.

use crate::reconnection::{Reconnection, cheapest_between};
use crate::search_tour::SearchTour;
use crate::table::Table;

/// Longest stretch that is relocated as a whole.
const LONGEST_RELOCATED: usize = 3;

/// A change of the order, with the nodes that go with it.
#[derive(Clone, Copy)]
pub(super) enum Move {
    /// Reverse `first..=last`; nodes for the clusters before, first, last, after (new order).
    Reverse { first: usize, last: usize, nodes: [u32; 4] },
    /// Move `first..=last` to between `to` and `to + 1`; nodes for the neighbours left behind and
    /// for the ends of the stretch in the new order.
    Relocate { first: usize, last: usize, to: usize, turned: bool, left: [u32; 2], ends: [u32; 2] },
    /// Exchange `first..middle` and `middle..=last`.
    Exchange { first: usize, middle: usize, last: usize },
}

/// The best move so far and the change of the cost that it makes, below 0.
type Best = (i64, Option<Move>);

/// The best improving move around a cluster, and the change of the cost, below 0.
pub(super) fn best_move(table: &Table, tour: &SearchTour, c: u32) -> Option<(i64, Move)> {
    let mut best = (0, None);
    relocations(table, tour, c, &mut best);
    if table.reversible {
        reversals(table, tour, c, &mut best);
    } else {
        // Not where reversals do as well: this move alone would undo every kick.
        exchanges(table, tour, c, &mut best);
    }
    best.1.map(|found| (best.0, found))
}

/// 2-opt around `c`, where costs are symmetric.
fn reversals(table: &Table, tour: &SearchTour, c: u32, best: &mut Best) {
    let m = tour.order.len();
    let p = tour.position[c as usize] as usize;
    let behind = (p + m - 1) % m;
    // The removed arc, and what the cluster's other arc could gain by another node.
    let ahead_limit = tour.arc(p) + tour.slack(behind);
    let behind_limit = tour.arc(behind) + tour.slack(p);
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
fn try_reversal(table: &Table, tour: &SearchTour, i: usize, j: usize, best: &mut Best) {
    let m = tour.order.len();
    if j < i + 3 || j - i + 3 > m {
        return;
    }
    let before = (i + m - 1) % m;
    let (a, b) = (tour.order[i], tour.order[i + 1]);
    let (c, d) = (tour.order[j], tour.at(j + 1).0);
    let removed = tour.arc(i) + tour.arc(j);
    let slack = tour.slack(before) + tour.slack(i + 1) + tour.slack(j - 1) + tour.slack(j + 1);
    if i64::from(table.low(a, c)) + i64::from(table.low(b, d)) - removed - slack >= best.0 {
        return;
    }
    let old = removed + tour.arc(before) + tour.arc(i + 1) + tour.arc(j - 1) + tour.arc(j + 1);
    let first =
        Reconnection::new(table, tour.at(before), tour.at(i).0, tour.at(j).0, tour.at(j - 1));
    if first.bound - old >= best.0 {
        return;
    }
    let second = Reconnection::new(
        table,
        tour.at(i + 2),
        tour.at(i + 1).0,
        tour.at(j + 1).0,
        tour.at(j + 2),
    );
    let limit = best.0 + old;
    let one = first.value(limit - second.bound);
    let two = second.value(limit - one);
    if one + two < limit {
        let ([a, b], [x, y]) = (first.nodes(one), second.nodes(two));
        *best =
            (one + two - old, Some(Move::Reverse { first: i + 1, last: j, nodes: [a, b, x, y] }));
    }
}

/// Or-opt: stretches that begin or end with `c`, also turned around.
fn relocations(table: &Table, tour: &SearchTour, c: u32, best: &mut Best) {
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
            relocate_stretch(table, tour, c, (first, last), best);
        }
    }
}

/// Tries to move the stretch `first..=last`, of which `c` is one end, to near `c`'s candidates.
fn relocate_stretch(
    table: &Table,
    tour: &SearchTour,
    c: u32,
    (first, last): (usize, usize),
    best: &mut Best,
) {
    let Some(relocation) = Relocation::new(table, tour, c, first, last) else { return };
    let m = tour.order.len();
    let leads = tour.at(first).0 == c;
    let single = first == last;
    for (n, low) in table.near_in(c) {
        if i64::from(low) >= relocation.saving {
            break;
        }
        // n stands before c.
        let q = tour.position[n as usize] as usize;
        relocation.attempt(q, !leads, best);
        if single || !table.reversible {
            continue;
        }
        relocation.attempt((q + m - 1) % m, leads, best);
    }
    if single || !table.reversible {
        for (n, low) in table.near_out(c) {
            if i64::from(low) >= relocation.saving {
                break;
            }
            // n stands after c.
            let q = tour.position[n as usize] as usize;
            relocation.attempt((q + m - 1) % m, leads && !single, best);
        }
    }
}

/// A stretch to be moved, and what closing the gap that it leaves costs.
struct Relocation<'a> {
    table: &'a Table,
    tour: &'a SearchTour,
    first: usize,
    last: usize,
    /// Cluster and node on either side of the stretch.
    before: (u32, u32),
    after: (u32, u32),
    /// Cost of the two arcs at the ends of the stretch.
    removed: i64,
    /// Cost of the arc that closes the gap, with the nodes as they are.
    plain: i64,
    /// That arc with its nodes chosen anew, its value, and the change of the cost that it makes.
    closing: Reconnection<'a>,
    value: i64,
    chosen: i64,
    /// The most that taking the stretch out saves.
    saving: i64,
    /// Cost of the arcs inside the stretch, as it is and turned around.
    inner: i64,
    inner_turned: i64,
    /// What another choice of nodes could save inside at most.
    inner_slack: i64,
}

impl<'a> Relocation<'a> {
    /// `None` where `c` has no candidate near enough to gain anything.
    fn new(
        table: &'a Table,
        tour: &'a SearchTour,
        c: u32,
        first: usize,
        last: usize,
    ) -> Option<Self> {
        let m = tour.order.len();
        let (before, after) = (tour.at(first - 1), tour.at(last + 1));
        let removed = tour.arc(first - 1) + tour.arc(last);
        let plain = arc(table, before, after);
        let outer = (first + m - 2) % m;
        let old_left = tour.arc(outer) + tour.arc(last + 1);
        let around = tour.slack(outer) + tour.slack(last + 1);
        let most = removed + around - i64::from(table.low(before.0, after.0));
        let nearest = table.near_in(c).chain(table.near_out(c)).map(|(_, low)| low).min();
        if nearest.is_none_or(|low| i64::from(low) >= most) {
            return None;
        }
        let closing =
            Reconnection::new(table, tour.at(outer), before.0, after.0, tour.at(last + 2));
        let value = closing.value(plain + old_left);
        let chosen = value - old_left;
        let saving = removed - chosen.min(plain);
        let inner = tour.stretch_cost(first, last);
        let inner_turned =
            if table.reversible { inner } else { turned_cost(table, tour, first, last) };
        // Turning a stretch may cost anything where costs are not symmetric.
        let inner_slack = match last - first {
            0 => 0,
            1 if table.reversible => tour.slack(first),
            2 if table.reversible => tour.slack(first) + tour.slack(first + 1),
            _ => i64::from(i32::MAX),
        };
        Some(Self {
            table,
            tour,
            first,
            last,
            before,
            after,
            removed,
            plain,
            closing,
            value,
            chosen,
            saving,
            inner,
            inner_turned,
            inner_slack,
        })
    }

    /// Considers the place between the positions `to` and `to + 1`.
    fn attempt(&self, to: usize, turned: bool, best: &mut Best) {
        let Self { table, tour, first, last, before, after, plain, chosen, inner, .. } = *self;
        if to + 1 >= first && to <= last {
            return;
        }
        let (x, y) = (tour.at(to), tour.at(to + 1));
        let untouched = [x.0, y.0].iter().all(|k| *k != before.0 && *k != after.0);
        let anew = untouched && chosen < plain;
        let gap = tour.arc(to);
        let rest = if anew { chosen } else { plain } - self.removed - gap;
        let (head, tail) = if turned { (last, first) } else { (first, last) };
        let (enter, leave) = (table.low(x.0, tour.order[head]), table.low(tour.order[tail], y.0));
        let least = i64::from(enter) + i64::from(leave);
        if rest + least - self.inner_slack >= best.0 {
            return;
        }
        let (new, ends) = match last - first {
            0 => {
                let (cost, node) = cheapest_between(table, x, tour.at(first).0, y);
                (cost, [node, node])
            }
            1 => {
                let moved = Reconnection::new(table, x, tour.at(head).0, tour.at(tail).0, y);
                let limit = best.0 - rest + inner;
                let cost = moved.value(limit);
                if cost >= limit {
                    return;
                }
                (cost - inner, moved.nodes(cost))
            }
            _ => {
                let (next, last_but_one) =
                    if turned { (last - 1, first + 1) } else { (first + 1, last - 1) };
                let (cost_in, a) = cheapest_between(table, x, tour.at(head).0, tour.at(next));
                let (cost_out, b) =
                    cheapest_between(table, tour.at(last_but_one), tour.at(tail).0, y);
                let ends = if turned {
                    arc(table, tour.at(head), tour.at(next))
                        + arc(table, tour.at(last_but_one), tour.at(tail))
                } else {
                    tour.arc(first) + tour.arc(last_but_one)
                };
                let turning = if turned { self.inner_turned - inner } else { 0 };
                (cost_in + cost_out - ends + turning, [a, b])
            }
        };
        let delta = rest + new;
        if delta < best.0 {
            let left = if anew { self.closing.nodes(self.value) } else { [before.1, after.1] };
            *best = (delta, Some(Move::Relocate { first, last, to, turned, left, ends }));
        }
    }
}

/// Cost of the arc from one cluster's node to another's.
fn arc(table: &Table, a: (u32, u32), b: (u32, u32)) -> i64 {
    i64::from(table.d(a.0, a.1, b.0, b.1))
}

/// Cost of the arcs inside a stretch that is turned around.
fn turned_cost(table: &Table, tour: &SearchTour, first: usize, last: usize) -> i64 {
    (first..last).map(|p| arc(table, tour.at(p + 1), tour.at(p))).sum()
}

/// Exchange of two neighbouring stretches by three new arcs, nodes as they are.
fn exchanges(table: &Table, tour: &SearchTour, c: u32, best: &mut Best) {
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
        let first_gain = ahead - arc(table, here, tour.at(q)) + tour.arc(q - 1);
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
            let new = arc(table, here, tour.at(q))
                + arc(table, tour.at(r), next)
                + arc(table, tour.at(q - 1), tour.at(r + 1));
            let old = ahead + tour.arc(q - 1) + tour.arc(r);
            if new - old < best.0 {
                *best = (new - old, Some(Move::Exchange { first, middle, last }));
            }
        }
    }
    debug_assert!(m > 3);
}
