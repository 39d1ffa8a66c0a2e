//! Some of a scan's measured points as a volume: what is nearest to one of them.

use nalgebra::Point3;
use nullsweep_surface::Grid;

/// Farthest that a point may be from what was measured to be of it: what a cleaned surface stands for
/// is as near. \[m\]
const BESIDE: f64 = 0.015;

/// Measured points, some of them marked. A place belongs to the mark if the measured point that is
/// nearest to it, and within 15 mm, is marked.
#[derive(Clone, Debug)]
pub struct Marked {
    points: Vec<Point3<f64>>,
    marked: Vec<bool>,
    grid: Grid,
}

impl Marked {
    /// Of points in some frame \[m\] and whether each is marked.
    #[must_use]
    pub fn new(points: Vec<Point3<f64>>, marked: Vec<bool>) -> Self {
        let grid = Grid::new(&points, BESIDE);
        Self { points, marked, grid }
    }

    pub(super) fn contains(&self, p: &Point3<f64>) -> bool {
        self.grid.nearest(p, BESIDE, |_| true).is_some_and(|(i, _)| self.marked[i as usize])
    }

    /// Distance to the nearest marked point; ∞ where there is none. \[m\]
    pub(super) fn distance(&self, p: &Point3<f64>) -> f64 {
        let marked = self.points.iter().zip(&self.marked).filter(|(_, marked)| **marked);
        marked.map(|(q, _)| (q - p).norm()).fold(f64::INFINITY, f64::min)
    }
}
