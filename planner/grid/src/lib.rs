//! Points sorted into cubic cells (a counting sort): all that lie in a box or a ball come as a few
//! runs of contiguous memory, without allocation.
//!
//! [`Cells`] holds no points, only where each cell's begin. Who builds it gets the order and keeps
//! in it whatever a search has to read.
//!
//! ```
//! use nalgebra::Point3;
//! use nullsweep_grid::Cells;
//!
//! let points = [[0.9, 0.0, 0.0], [0.1, 0.0, 0.0], [0.2, 0.0, 0.0]].map(Point3::from);
//! let (cells, order) = Cells::new(&points, 0.5);
//! assert_eq!(order, [1, 2, 0]);
//!
//! let near = cells.around(&Point3::origin(), 0.3).flat_map(|run| &order[run]);
//! assert!(near.eq(&[1, 2]));
//! ```

use std::ops::Range;

use nalgebra::{Point3, Vector3};

/// Most cells; beyond it they grow, so that a far outlier cannot take the memory.
const MAX_CELLS: f64 = 4e6;

/// Where the points of each cubic cell are.
///
/// Sums over what a search visits depend on the order: other arithmetic here gives other plans.
#[derive(Clone, Debug)]
pub struct Cells {
    origin: Point3<f64>,
    side: f64,
    size: [usize; 3],
    /// Where each cell begins in the order, and one end; x fastest.
    starts: Vec<u32>,
}

impl Cells {
    /// Sorts finite points into cells with sides of about `side`, which serve searches of about
    /// that radius best; also their indices in the cells' order, ascending in each cell.
    #[must_use]
    pub fn new(points: &[Point3<f64>], side: f64) -> (Self, Vec<u32>) {
        let first = points.first().map_or(Vector3::zeros(), |p| p.coords);
        let (lower, upper) =
            points.iter().fold((first, first), |(l, u), p| (l.inf(&p.coords), u.sup(&p.coords)));
        let extent = upper - lower;
        let mut side = side.max(1e-6);
        let count = |side: f64| extent.iter().map(|e| (e / side).floor() + 1.0).product::<f64>();
        while count(side) > MAX_CELLS {
            side *= 1.26;
        }
        let size = [0, 1, 2].map(|axis| (extent[axis] / side) as usize + 1);
        let starts = vec![0; size.iter().product::<usize>() + 1];
        let mut cells = Self { origin: Point3::from(lower), side, size, starts };
        let keys: Vec<usize> = points.iter().map(|p| cells.key(p)).collect();
        for &key in &keys {
            cells.starts[key + 1] += 1;
        }
        for i in 1..cells.starts.len() {
            cells.starts[i] += cells.starts[i - 1];
        }
        let mut next = cells.starts.clone();
        let mut order = vec![0; points.len()];
        for (index, &key) in keys.iter().enumerate() {
            order[next[key] as usize] = index as u32;
            next[key] += 1;
        }
        (cells, order)
    }

    /// The side of a cell.
    #[must_use]
    #[inline]
    pub fn side(&self) -> f64 {
        self.side
    }

    /// Runs of the order with all points of the box between two corners, and with others of the
    /// cells that it touches. They ascend; none if the box misses the grid, has a NaN
    /// or a corner on the wrong side.
    #[inline]
    pub fn between(&self, low: &Point3<f64>, high: &Point3<f64>) -> Runs<'_> {
        let mut ranges = [(0, 0); 3];
        for axis in 0..3 {
            let from = (low[axis] - self.origin[axis]) / self.side;
            let to = (high[axis] - self.origin[axis]) / self.side;
            let last = self.size[axis] - 1;
            // Written so that a NaN misses too.
            if !(to >= 0.0 && from <= last as f64 + 1.0 && from <= to) {
                return Runs { cells: self, x: (0, 0), y: (0, 0), at: (0, 1), last: 0 };
            }
            ranges[axis] = ((from.max(0.0) as usize).min(last), (to as usize).min(last));
        }
        let [x, y, z] = ranges;
        Runs { cells: self, x, y, at: (y.0, z.0), last: z.1 }
    }

    /// As [`Self::between`], with all points within `radius` of `centre`, but for rounding.
    #[inline]
    pub fn around(&self, centre: &Point3<f64>, radius: f64) -> Runs<'_> {
        self.between(&centre.map(|c| c - radius), &centre.map(|c| c + radius))
    }

    fn key(&self, point: &Point3<f64>) -> usize {
        let at = |axis: usize| {
            (((point[axis] - self.origin[axis]) / self.side) as usize).min(self.size[axis] - 1)
        };
        (at(2) * self.size[1] + at(1)) * self.size[0] + at(0)
    }
}

/// Of no points.
impl Default for Cells {
    fn default() -> Self {
        Self::new(&[], 1.0).0
    }
}

/// Ranges of the order, a row of cells each; see [`Cells::between`].
#[derive(Clone, Debug)]
pub struct Runs<'a> {
    cells: &'a Cells,
    /// First and last cell.
    x: (usize, usize),
    y: (usize, usize),
    /// The next row's y and z.
    at: (usize, usize),
    /// The last z.
    last: usize,
}

impl Iterator for Runs<'_> {
    type Item = Range<usize>;

    #[inline]
    fn next(&mut self) -> Option<Range<usize>> {
        let (y, z) = self.at;
        if z > self.last {
            return None;
        }
        self.at = if y < self.y.1 { (y + 1, z) } else { (self.y.0, z + 1) };
        let Cells { size, starts, .. } = self.cells;
        let row = (z * size[1] + y) * size[0];
        Some(starts[row + self.x.0] as usize..starts[row + self.x.1 + 1] as usize)
    }
}
