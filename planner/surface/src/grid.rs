//! A uniform grid over points: the neighbour search of all stages.
//!
//! All searches of these stages ask for everything within a radius that is known beforehand, in
//! clouds of even density.

use nalgebra::Point3;
use nullsweep_grid::Cells;

/// Points sorted into cubic cells.
#[derive(Clone, Debug)]
pub struct Grid {
    cells: Cells,
    sorted: Vec<(Point3<f64>, u32)>,
}

impl Grid {
    /// A grid for searches with about `radius`.
    pub fn new(points: &[Point3<f64>], radius: f64) -> Self {
        let (cells, order) = Cells::new(points, radius);
        Self { cells, sorted: order.into_iter().map(|i| (points[i as usize], i)).collect() }
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
        for run in self.cells.around(centre, radius) {
            for (point, index) in &self.sorted[run] {
                let squared = (point - centre).norm_squared();
                if squared <= limit {
                    visit(*index, point, squared);
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
        let mut reach = self.cells.side().min(radius);
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
