//! Cheapest nodes at the ends of a new arc, the nodes of the clusters around it being given.

use crate::cluster_optimisation::lowest;
use crate::table::{LANES, Table};

/// A new arc a → b between given nodes p and q: p → a → b → q, where the nodes of a and b are free.
#[derive(Clone, Copy)]
pub(super) struct Reconnection<'a> {
    into: &'a [i32],
    /// Cheapest entry of each of the block's rows.
    lows: &'a [i32],
    block: &'a [i32],
    out: &'a [i32],
    /// What the rows leave out.
    add: i64,
    /// Cheapest entry of `out`.
    least_out: i32,
    /// No choice of nodes costs less.
    pub(super) bound: i64,
}

impl<'a> Reconnection<'a> {
    #[inline]
    pub(super) fn new(table: &'a Table, p: (u32, u32), a: u32, b: u32, q: (u32, u32)) -> Self {
        let (add_in, into) = table.row(p.0, p.1, a);
        let (add, block, lows) = table.open_block(a, b);
        let (add_out, out) = table.column(b, q.0, q.1);
        let least_out = smallest(out);
        let add = i64::from(add_in) + i64::from(add) + i64::from(add_out);
        let paths = into.iter().zip(lows).map(|(d, low)| d + low);
        let bound = add + i64::from(paths.min().unwrap_or(0) + least_out);
        Self { into, lows, block, out, add, least_out, bound }
    }

    /// Cost of the best choice if it is below `limit`, else something that is not.
    #[inline]
    pub(super) fn value(&self, limit: i64) -> i64 {
        if self.bound >= limit {
            return limit;
        }
        let width = self.out.len();
        // Rows that cannot get below the limit are left out.
        let allowed =
            (limit - self.add - i64::from(self.least_out)).min(i64::from(i32::MAX)) as i32;
        let mut best = i32::MAX;
        let mut start = 0;
        while start < width {
            let mut paths = [i32::MAX; LANES];
            for (i, (&d, &low)) in self.into.iter().zip(self.lows).enumerate() {
                if d + low < allowed {
                    let at = i * width + start;
                    for (path, x) in paths.iter_mut().zip(&self.block[at..at + LANES]) {
                        *path = (*path).min(d + x);
                    }
                }
            }
            for (path, x) in paths.iter().zip(&self.out[start..]) {
                best = best.min(path.saturating_add(*x));
            }
            start += LANES;
        }
        i64::from(best) + self.add
    }

    /// Nodes of a and b that make the value.
    pub(super) fn nodes(&self, value: i64) -> [u32; 2] {
        let width = self.out.len();
        for (i, &d) in self.into.iter().enumerate() {
            for (j, &e) in self.out.iter().enumerate() {
                if i64::from(d + self.block[i * width + j] + e) + self.add == value {
                    return [i as u32, j as u32];
                }
            }
        }
        unreachable!("the value comes from one of these pairs")
    }
}

#[inline]
fn smallest(row: &[i32]) -> i32 {
    row.iter().copied().min().unwrap_or(0)
}

/// Cheapest p → a → q over the nodes of a.
#[inline]
pub(super) fn cheapest_between(table: &Table, p: (u32, u32), a: u32, q: (u32, u32)) -> (i64, u32) {
    let (add_in, into) = table.row(p.0, p.1, a);
    let (add_out, out) = table.column(a, q.0, q.1);
    let (value, node) = lowest(into, out);
    (i64::from(value) + i64::from(add_in) + i64::from(add_out), node)
}
