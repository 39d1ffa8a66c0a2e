//! A uniform grid over points: the neighbour search of all stages.
//!
//! All searches of these stages ask for everything within a radius that is known beforehand, in
//! clouds of even density. Points sorted by cell (a counting sort) answer that with a few runs of
//! contiguous memory and without allocation.

use nalgebra::{Point3, Vector3};

/// Most cells; beyond it they grow, so that a far outlier cannot take the memory.
const MAX_CELLS: f64 = 4e6;

/// Points sorted into cubic cells.
#[derive(Clone, Debug)]
pub struct Grid {
    origin: Point3<f64>,
    cell: f64,
    size: [usize; 3],
    /// Where each cell begins in `sorted`, and one end.
    starts: Vec<u32>,
    sorted: Vec<(Point3<f64>, u32)>,
}

impl Grid {
    /// A grid for searches with about `radius`.
    pub fn new(points: &[Point3<f64>], radius: f64) -> Self {
        let first = points.first().map_or(Vector3::zeros(), |p| p.coords);
        let (lower, upper) =
            points.iter().fold((first, first), |(l, u), p| (l.inf(&p.coords), u.sup(&p.coords)));
        let extent = upper - lower;
        let mut cell = radius.max(1e-6);
        let cells = |cell: f64| extent.iter().map(|e| (e / cell).floor() + 1.0).product::<f64>();
        while cells(cell) > MAX_CELLS {
            cell *= 1.26;
        }
        let size = [0, 1, 2].map(|axis| (extent[axis] / cell) as usize + 1);
        let mut grid = Self {
            origin: Point3::from(lower),
            cell,
            size,
            starts: vec![0; size.iter().product::<usize>() + 1],
            sorted: Vec::new(),
        };
        let keys: Vec<usize> = points.iter().map(|p| grid.key(p)).collect();
        for &key in &keys {
            grid.starts[key + 1] += 1;
        }
        for i in 1..grid.starts.len() {
            grid.starts[i] += grid.starts[i - 1];
        }
        let mut next = grid.starts.clone();
        grid.sorted = vec![(Point3::origin(), 0); points.len()];
        for (index, &key) in keys.iter().enumerate() {
            grid.sorted[next[key] as usize] = (points[index], index as u32);
            next[key] += 1;
        }
        grid
    }

    /// The points' indices sorted by cell: the order in which neighbours lie together.
    pub(crate) fn order(&self) -> Vec<usize> {
        self.sorted.iter().map(|(_, index)| *index as usize).collect()
    }

    /// Calls `visit(index, point, squared distance)` for every point within `radius` of `centre`,
    /// in an order that depends on the points alone.
    pub fn within(
        &self,
        centre: &Point3<f64>,
        radius: f64,
        mut visit: impl FnMut(u32, &Point3<f64>, f64),
    ) {
        let limit = radius * radius;
        let Some([x, y, z]) = self.cells_within(centre, radius) else { return };
        for iz in z.0..=z.1 {
            for iy in y.0..=y.1 {
                let row = (iz * self.size[1] + iy) * self.size[0];
                let run = self.starts[row + x.0] as usize..self.starts[row + x.1 + 1] as usize;
                for (point, index) in &self.sorted[run] {
                    let squared = (point - centre).norm_squared();
                    if squared <= limit {
                        visit(*index, point, squared);
                    }
                }
            }
        }
    }

    /// The nearest point that `accept`s, within `radius`: index and squared distance.
    pub fn nearest(
        &self,
        centre: &Point3<f64>,
        radius: f64,
        mut accept: impl FnMut(u32) -> bool,
    ) -> Option<(u32, f64)> {
        // Most searches end within the first cell; the doubling keeps the far ones right.
        let mut reach = self.cell.min(radius);
        loop {
            let mut best: Option<(u32, f64)> = None;
            self.within(centre, reach, |index, _, squared| {
                if best.is_none_or(|b| squared < b.1) && accept(index) {
                    best = Some((index, squared));
                }
            });
            if best.is_some() || reach >= radius {
                return best;
            }
            reach = (2.0 * reach).min(radius);
        }
    }

    /// First and last cell along each axis that a ball touches; `None` if it misses the grid.
    fn cells_within(&self, centre: &Point3<f64>, radius: f64) -> Option<[(usize, usize); 3]> {
        let mut ranges = [(0, 0); 3];
        for axis in 0..3 {
            let from = (centre[axis] - radius - self.origin[axis]) / self.cell;
            let to = (centre[axis] + radius - self.origin[axis]) / self.cell;
            let last = self.size[axis] - 1;
            // Written so that a NaN misses too.
            if !(to >= 0.0 && from <= last as f64 + 1.0) {
                return None;
            }
            ranges[axis] = ((from.max(0.0) as usize).min(last), (to as usize).min(last));
        }
        Some(ranges)
    }

    fn key(&self, point: &Point3<f64>) -> usize {
        let at = |axis: usize| {
            (((point[axis] - self.origin[axis]) / self.cell) as usize).min(self.size[axis] - 1)
        };
        (at(2) * self.size[1] + at(1)) * self.size[0] + at(0)
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn searches_agree_with_looking_at_every_point() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut draw =
            |scale: f64| Point3::from([0; 3].map(|_| scale * (rng.random::<f64>() - 0.5)));
        let points: Vec<_> = (0..400).map(|_| draw(1.0)).collect();
        let grid = Grid::new(&points, 0.1);
        for round in 0..200 {
            let centre = draw(1.4);
            let radius = 0.01 * f64::from(round);
            let mut found = Vec::new();
            grid.within(&centre, radius, |i, _, _| found.push(i));
            found.sort_unstable();
            let expected: Vec<u32> = (0..400u32)
                .filter(|&i| (points[i as usize] - centre).norm_squared() <= radius * radius)
                .collect();
            assert_eq!(found, expected);
            let nearest = grid.nearest(&centre, radius, |_| true).map(|n| n.0);
            let best = expected.into_iter().min_by(|&a, &b| {
                let d = |i: u32| (points[i as usize] - centre).norm_squared();
                d(a).total_cmp(&d(b))
            });
            assert_eq!(nearest, best);
        }
    }
}
