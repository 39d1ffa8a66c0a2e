//! Which clusters have arcs to which, as sorted lists: room in proportion to the pairs that are joined.

use std::sync::Arc;

/// The ordered pairs of clusters that arcs join, numbered row by row.
#[derive(Clone)]
pub(super) struct Adjacency {
    /// Where each cluster's list begins, and the end of the last one.
    starts: Arc<[usize]>,
    /// Clusters entered, ascending within a list.
    to: Arc<[u32]>,
}

/// A pair, left and entered, that cannot be among them.
pub(super) enum Misfit {
    /// Of clusters that do not exist or are the same.
    Clusters(usize, usize),
    /// Given before.
    Twice(usize, usize),
}

impl Adjacency {
    /// Of `m` clusters by (left, entered), in any order.
    ///
    /// # Errors
    /// Where a cluster does not exist, is joined with itself, or a pair is given twice.
    pub(super) fn new(m: usize, mut pairs: Vec<(usize, usize)>) -> Result<Self, Misfit> {
        let wrong = pairs.iter().find(|&&(from, to)| from >= m || to >= m || from == to);
        if let Some(&(from, to)) = wrong {
            return Err(Misfit::Clusters(from, to));
        }
        pairs.sort_unstable();
        if let Some(twice) = pairs.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(Misfit::Twice(twice[0].0, twice[0].1));
        }
        let starts = (0..=m).map(|a| pairs.partition_point(|&(from, _)| from < a)).collect();
        let to = pairs.iter().map(|&(_, to)| to as u32).collect();
        Ok(Self { starts, to })
    }

    /// Number of pairs.
    pub(super) fn len(&self) -> usize {
        self.to.len()
    }

    /// The number of a pair; `None` where no arc joins it.
    #[inline]
    pub(super) fn number(&self, from: usize, to: usize) -> Option<usize> {
        let start = self.starts[from];
        let list = &self.to[start..self.starts[from + 1]];
        list.binary_search(&(to as u32)).ok().map(|k| start + k)
    }
}
