//! The scan as an obstacle: a two-level grid of distances in front of the raw points.
//!
//! Both levels hold a lower bound of the distance of the grid's nodes to the nearest raw point, so
//! the bound at any place is the node's less the distance to the node: never more than the true
//! distance. What the grid cannot prove is decided on the raw points, kept in cells.

use nalgebra::{Point3, Vector3};
use nullsweep_grid::Cells;
use wide::f32x8;

use crate::frame::Frame;
use crate::sieve::Sieve;
use crate::solid::Solid;

/// The points that the moving links can reach, in the root frame.
#[derive(Debug, Default)]
pub(crate) struct Field {
    /// In the order of the cells.
    points: Vec<Vector3<f64>>,
    /// The same less `min`, eight at a time; beyond the last one far away. \[m\]
    lanes: Vec<[f32x8; 3]>,
    /// What single precision may take away from a distance. \[m\]
    rounding: f64,
    /// Bounds of the points, for what is far outside of the grids. \[m\]
    min: Vector3<f64>,
    max: Vector3<f64>,
    coarse: Grid,
    fine: Grid,
    /// Nodes of the fine grid without a point this near hold this value. \[m\]
    fine_cap: f64,
    /// Where the points are.
    cells: Cells,
}

/// Nodes of a regular grid and their distances.
#[derive(Debug, Default)]
struct Grid {
    origin: Vector3<f64>,
    spacing: f64,
    inverse: f64,
    size: [usize; 3],
    /// Lower bounds of the distance to the nearest point, x fastest. \[m\]
    distance: Vec<f32>,
}

/// Wanted spacing of the fine nodes; grows with the scan's volume. \[m\]
const FINE: f64 = 0.01;
/// The fine band reaches this many nodes from a point.
const BAND: usize = 3;
/// Most nodes of the fine grid.
const FINE_NODES: f64 = 3.0e6;
/// Coarse nodes stand this many fine spacings apart, and this far beyond the points.
const COARSE_STEP: f64 = 2.0;
/// Most nodes of the coarse grid.
const COARSE_NODES: f64 = 3.0e5;
/// How far the coarse grid reaches beyond the points. \[m\]
const COARSE_BORDER: f64 = 0.3;
/// Cells of the points are this many fine spacings wide.
const CELL: f64 = 2.5;
/// Where there is no point. \[m\]
const FAR_AWAY: f32 = 1e6;
/// Covers the rounding of stored f32 distances below 10 m. \[m\]
const ROUNDING: f64 = 2e-6;

impl Field {
    /// Keeps the finite points within `reach` of `centre` (what lies beyond can never be touched).
    pub(crate) fn new(scan: &[Point3<f64>], centre: &Vector3<f64>, reach: f64) -> Self {
        let near = |p: &&Point3<f64>| (p.coords - centre).norm() <= reach;
        let kept: Vec<Point3<f64>> = scan.iter().filter(near).copied().collect();
        let Some(first) = kept.first() else { return Self::default() };
        let (mut min, mut max) = (first.coords, first.coords);
        for p in &kept {
            min = min.inf(&p.coords);
            max = max.sup(&p.coords);
        }
        let extent = max - min;
        let spaced = |h: f64| {
            let border = 2.0 * (BAND as f64 + 1.0) * h;
            (extent.x + border) * (extent.y + border) * (extent.z + border) / (h * h * h)
        };
        let mut h = FINE;
        while spaced(h) > FINE_NODES {
            h *= 1.1;
        }
        let mut fine = Grid::new(min, max, h, (BAND + 1) as f64 * h);
        let (cells, order) = Cells::new(&kept, CELL * h);
        let points: Vec<_> = order.iter().map(|&i| kept[i as usize].coords).collect();
        let fine_cap = (BAND as f64 + 0.5) * h;
        fine.scatter(&points, fine_cap);
        let coarse = Grid::coarse(min, max, h, &points);
        let lanes = points
            .chunks(8)
            .map(|eight| {
                std::array::from_fn(|i| {
                    let lane = |k: usize| eight.get(k).map_or(FAR_AWAY, |p| (p[i] - min[i]) as f32);
                    f32x8::from(std::array::from_fn::<f32, 8, _>(lane))
                })
            })
            .collect();
        // A hundred roundings of a coordinate.
        let rounding = 1e-5 * (1.0 + extent.norm());
        Self { points, lanes, rounding, min, max, coarse, fine, fine_cap, cells }
    }

    /// The points kept.
    pub(crate) fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether every point is proven to be at least `need` away from `p` \[m\].
    #[inline]
    pub(crate) fn is_farther(&self, p: &Vector3<f64>, need: f64) -> bool {
        self.points.is_empty()
            || (need >= 0.0 && self.box_distance_squared(p) >= need * need)
            || self.coarse.bound(p) >= need
            || (need < self.fine_cap && self.fine.bound(p) >= need)
    }

    /// Squared distance to the bounds of the points. \[m²\]
    #[inline]
    fn box_distance_squared(&self, p: &Vector3<f64>) -> f64 {
        (self.min - p).sup(&(p - self.max)).map(|x| x.max(0.0)).norm_squared()
    }

    /// Calls `test` on every point that may be nearer than `need` to the solid standing at `at`, and
    /// on some that are not, until it is false; whether it never was.
    #[inline]
    pub(crate) fn all_near(
        &self,
        solid: &Solid,
        at: &Frame,
        need: f64,
        mut test: impl FnMut(&Vector3<f64>) -> bool,
    ) -> bool {
        let need = need + self.rounding;
        let (low, high) = solid.bounds();
        let centre = at.apply(&(0.5 * (low + high)));
        let half = at.rotation.abs() * (0.5 * (high - low)) + Vector3::repeat(need);
        let sieve = Sieve::new(solid, at, &self.min, need);
        // Runs ascend, and the end of one may share its eight with the start of the next.
        let mut done = 0;
        for run in self.cells.between(&(centre - half).into(), &(centre + half).into()) {
            let eights = done.max(run.start / 8)..run.end.div_ceil(8);
            done = done.max(eights.end);
            for eight in eights {
                let mut near = sieve.near(&self.lanes[eight]);
                while near != 0 {
                    let point = self.points.get(8 * eight + near.trailing_zeros() as usize);
                    if point.is_some_and(|p| !test(p)) {
                        return false;
                    }
                    near &= near - 1;
                }
            }
        }
        true
    }
}

impl Grid {
    /// A grid over the box grown by `border`, distances still infinite.
    fn new(min: Vector3<f64>, max: Vector3<f64>, spacing: f64, border: f64) -> Self {
        let origin = min - Vector3::repeat(border);
        let count = |i: usize| ((max[i] - min[i] + 2.0 * border) / spacing).ceil() as usize + 1;
        let size = [count(0), count(1), count(2)];
        Self {
            origin,
            spacing,
            inverse: 1.0 / spacing,
            size,
            distance: vec![f32::INFINITY; size[0] * size[1] * size[2]],
        }
    }

    /// The grid for the far field: exact distances between nodes, less the distance from a point
    /// to its node.
    fn coarse(min: Vector3<f64>, max: Vector3<f64>, fine: f64, points: &[Vector3<f64>]) -> Self {
        let extent = (max - min).map(|x| x + 2.0 * COARSE_BORDER);
        let mut spacing = COARSE_STEP * fine;
        while extent.product() > COARSE_NODES * spacing.powi(3) {
            spacing *= 1.1;
        }
        let mut grid = Self::new(min, max, spacing, COARSE_BORDER);
        for p in points {
            let [x, y, z] = grid.clamped_cell(p);
            grid.distance[(z * grid.size[1] + y) * grid.size[0] + x] = 0.0;
        }
        // Squared distances in spacings, one axis after the other: small whole numbers, so exact.
        let [nx, ny, nz] = grid.size;
        for (count, stride) in [(nx, 1), (ny, nx), (nz, nx * ny)] {
            let mut line = vec![0.0f32; count];
            for start in (0..grid.distance.len()).filter(|i| i / stride % count == 0) {
                for (k, value) in line.iter_mut().enumerate() {
                    *value = grid.distance[start + k * stride];
                }
                if line.iter().all(|v| v.is_infinite()) {
                    continue;
                }
                for k in 0..count {
                    let mut least = f32::INFINITY;
                    for (m, value) in line.iter().enumerate() {
                        let apart = k as f32 - m as f32;
                        let squared = value + apart * apart;
                        least = if squared < least { squared } else { least };
                    }
                    grid.distance[start + k * stride] = least;
                }
            }
        }
        let off_node = 0.5 * 3f64.sqrt() * spacing + ROUNDING;
        for d in &mut grid.distance {
            *d = (f64::from(*d).sqrt() * spacing - off_node) as f32;
        }
        grid
    }

    /// Distances to the nearest point, as far as `cap`.
    fn scatter(&mut self, points: &[Vector3<f64>], cap: f64) {
        let (h, band) = (self.spacing as f32, BAND as isize);
        for p in points {
            let cell = self.clamped_cell(p);
            let offset = (p - self.node(cell[0], cell[1], cell[2])).map(|x| x as f32);
            for dz in -band..=band {
                let z = (cell[2] as isize + dz) as usize;
                let from_z = dz as f32 * h - offset.z;
                for dy in -band..=band {
                    let y = (cell[1] as isize + dy) as usize;
                    let from_y = dy as f32 * h - offset.y;
                    let flat = from_z * from_z + from_y * from_y;
                    let first = (z * self.size[1] + y) * self.size[0] + cell[0] - BAND;
                    let row = &mut self.distance[first..=first + 2 * BAND];
                    for (dx, squared) in row.iter_mut().enumerate() {
                        let from_x = (dx as isize - band) as f32 * h - offset.x;
                        *squared = squared.min(flat + from_x * from_x);
                    }
                }
            }
        }
        // A point reaches all nodes within BAND of its own, from which it is half a spacing off at
        // most; what none has reached is farther than the cap.
        let cap = cap as f32;
        for d in &mut self.distance {
            *d = d.sqrt().min(cap) - ROUNDING as f32;
        }
    }

    fn node(&self, x: usize, y: usize, z: usize) -> Vector3<f64> {
        self.origin + self.spacing * Vector3::new(x as f64, y as f64, z as f64)
    }

    /// The nearest node's indices, clamped to the grid.
    #[inline]
    fn clamped_cell(&self, p: &Vector3<f64>) -> [usize; 3] {
        let at = (p - self.origin) * self.inverse;
        // The cast saturates: below 0 (and NaN) becomes 0.
        let index = |i: usize| ((at[i] + 0.5) as usize).min(self.size[i] - 1);
        [index(0), index(1), index(2)]
    }

    /// A lower bound of the distance from `p` to any point: may be negative. \[m\]
    #[inline]
    fn bound(&self, p: &Vector3<f64>) -> f64 {
        let [x, y, z] = self.clamped_cell(p);
        let distance = self.distance[(z * self.size[1] + y) * self.size[0] + x];
        f64::from(distance) - (p - self.node(x, y, z)).norm()
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn bounds_never_exceed_the_true_distance_and_are_near_it() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let scan: Vec<Point3<f64>> = (0..3000)
            .map(|_| {
                let (u, v): (f64, f64) = (rng.random_range(-0.4..0.4), rng.random_range(-0.3..0.3));
                Point3::new(0.8 + 0.2 * u * u, u, 0.9 + v)
            })
            .collect();
        let field = Field::new(&scan, &Vector3::zeros(), 10.0);
        assert_eq!(field.len(), scan.len());
        let mut near = 0;
        for n in 0..20_000 {
            let mut p = Vector3::new(
                rng.random_range(-0.5..2.0),
                rng.random_range(-1.2..1.2),
                rng.random_range(-0.2..2.0),
            );
            if n % 4 == 0 {
                let on = scan[rng.random_range(0..scan.len())].coords;
                p = on + 0.015 * (p - Vector3::new(0.75, 0.0, 0.9));
            }
            let truth = scan.iter().map(|q| (q.coords - p).norm()).fold(f64::MAX, f64::min);
            assert!(!field.is_farther(&p, truth + 1e-9), "more than the true {truth} m at {p}");
            // Near the surface what is proven is two fine spacings short of the truth at most.
            if truth < 0.02 {
                near += 1;
                assert!(field.is_farther(&p, truth - 2.0 * 0.01), "{truth} m at {p}");
            }
        }
        assert!(near > 1000, "{near} places near the surface");
    }

    #[test]
    fn points_out_of_reach_are_dropped() {
        let scan = [Point3::new(1.0, 0.0, 0.0), Point3::new(5.0, 0.0, 0.0)];
        assert_eq!(Field::new(&scan, &Vector3::zeros(), 2.0).len(), 1);
        assert!(Field::new(&scan[1..], &Vector3::zeros(), 2.0).is_farther(&Vector3::zeros(), 9.0));
    }
}
