//! The stretches into which a tour falls when a few of its arcs are exchanged, and the subtours that
//! they then form: work in proportion to the exchange, not to the tour.

use crate::search_tour::SearchTour;

/// Neighbours of every cluster: predecessor and successor; without directions where reversible.
pub(super) type Links = Vec<[u32; 2]>;

/// Stretches of a tour, cut wherever the links of some child differ from it, and before the root.
#[derive(Default)]
pub(super) struct Pieces {
    /// First position of each, ascending, and then the length of the tour.
    starts: Vec<u32>,
    /// Subtour of each.
    parts: Vec<u32>,
    /// Clusters of each subtour; 0 once it was joined with another.
    sizes: Vec<u32>,
    /// Subtour of each cluster.
    labels: Vec<u32>,
}

const NONE: u32 = u32::MAX;

impl Pieces {
    /// Cuts `tour` at those of the `touched` clusters where the links differ from it. Where subtours
    /// are numbered already, further cuts keep the numbers.
    pub(super) fn cut(&mut self, tour: &SearchTour, links: &Links, touched: &[u32]) {
        let m = tour.order.len() as u32;
        let numbered = !self.sizes.is_empty();
        if !numbered {
            self.starts.clear();
            self.starts.extend([0, m]);
        }
        for &c in touched {
            let p = tour.position[c as usize];
            let next = if p + 1 == m { 0 } else { p + 1 };
            let before = tour.order[if p == 0 { m - 1 } else { p - 1 } as usize];
            for (cut, at) in [
                (links[c as usize][0] != before, p),
                (links[c as usize][1] != tour.order[next as usize], next),
            ] {
                if !cut || at == 0 {
                    continue;
                }
                if !numbered {
                    self.starts.push(at);
                } else if let Err(k) = self.starts.binary_search(&at) {
                    self.starts.insert(k, at);
                    self.parts.insert(k, self.parts[k - 1]);
                }
            }
        }
        if !numbered {
            self.starts.sort_unstable();
            self.starts.dedup();
        }
    }

    /// The piece of a position.
    fn piece(&self, position: u32) -> usize {
        self.starts.partition_point(|&start| start <= position) - 1
    }

    /// Walks the subtour of piece `from`, entered at its first cluster, and tells the positions of
    /// each piece and whether they are passed forwards.
    pub(super) fn walk(
        &self,
        tour: &SearchTour,
        links: &Links,
        reversible: bool,
        from: usize,
        mut tell: impl FnMut(usize, usize, bool),
    ) {
        let (mut piece, mut forward) = (from, true);
        loop {
            let (first, last) = (self.starts[piece], self.starts[piece + 1] - 1);
            tell(first as usize, last as usize, forward);
            let end = tour.order[if forward { last } else { first } as usize];
            let next = links[end as usize][usize::from(forward)];
            piece = self.piece(tour.position[next as usize]);
            forward = !reversible || links[next as usize][0] == end;
            if piece == from {
                return;
            }
        }
    }

    /// Finds the subtours and numbers them by their lowest cluster.
    pub(super) fn number_parts(&mut self, tour: &SearchTour, links: &Links, reversible: bool) {
        let count = self.starts.len() - 1;
        self.parts.clear();
        self.parts.resize(count, NONE);
        // Lowest cluster and size of each subtour, and a piece of it.
        let mut found: Vec<(u32, u32, usize)> = Vec::new();
        let mut of_piece = std::mem::take(&mut self.parts);
        for from in 0..count {
            if of_piece[from] != NONE {
                continue;
            }
            let (mut lowest, mut size) = (NONE, 0);
            self.walk(tour, links, reversible, from, |first, last, _| {
                of_piece[self.piece(first as u32)] = found.len() as u32;
                size += (last + 1 - first) as u32;
                let clusters = tour.order[first..=last].iter().copied();
                lowest = clusters.min().unwrap_or(NONE).min(lowest);
            });
            found.push((lowest, size, found.len()));
        }
        found.sort_unstable();
        let mut number = vec![0; found.len()];
        for (k, &(_, _, old)) in found.iter().enumerate() {
            number[old] = k as u32;
        }
        for part in &mut of_piece {
            *part = number[*part as usize];
        }
        self.parts = of_piece;
        self.labels.resize(tour.order.len(), NONE);
        for (k, &part) in self.parts.iter().enumerate() {
            let clusters = &tour.order[self.starts[k] as usize..self.starts[k + 1] as usize];
            clusters.iter().for_each(|&c| self.labels[c as usize] = part);
        }
        self.sizes.clear();
        self.sizes.extend(found.iter().map(|&(_, size, _)| size));
    }

    /// The subtour of a cluster.
    #[inline]
    pub(super) fn part_of(&self, cluster: u32) -> u32 {
        self.labels[cluster as usize]
    }

    /// The subtour of the fewest clusters; `None`, and all is forgotten, once there is but one.
    pub(super) fn smallest_part(&mut self) -> Option<u32> {
        let left = (0..self.sizes.len()).filter(|&k| self.sizes[k] > 0);
        if left.clone().count() > 1 {
            return left.min_by_key(|&k| self.sizes[k]).map(|k| k as u32);
        }
        self.sizes.clear();
        None
    }

    /// Appends the clusters of a subtour.
    pub(super) fn clusters_of(&self, part: u32, tour: &SearchTour, clusters: &mut Vec<u32>) {
        for (k, _) in self.parts.iter().enumerate().filter(|&(_, p)| *p == part) {
            let range = self.starts[k] as usize..self.starts[k + 1] as usize;
            clusters.extend_from_slice(&tour.order[range]);
        }
    }

    /// Makes the clusters of one subtour, which are given, those of another.
    pub(super) fn join(&mut self, part: u32, clusters: &[u32], into: u32) {
        clusters.iter().for_each(|&c| self.labels[c as usize] = into);
        for p in self.parts.iter_mut().filter(|p| **p == part) {
            *p = into;
        }
        self.sizes[into as usize] += self.sizes[part as usize];
        self.sizes[part as usize] = 0;
    }
}
