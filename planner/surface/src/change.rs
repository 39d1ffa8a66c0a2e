//! What is another way in a second scan of the same surface: its colour, or how high it lies.

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use crate::grid::Grid;
use crate::scan::{PlacedScan, Scan};

/// Radius of the disc about a point of which both scans are compared; at least three spacings of the
/// surface are taken. \[m\]
const DISC: f64 = 0.008;
/// What is farther from the surface is another thing. \[m\]
const NEAR: f64 = 0.03;
/// Fewest points of a scan in a disc that tell something.
const FEW: usize = 3;

/// How a point of the surface is another way.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Change {
    /// Distance of the mean colours, by red, green and blue of 0 to 255 each; `None`: one of the scans
    /// has no colour there.
    pub colour: Option<f64>,
    /// How much higher the second scan lies, along the surface's normal; `None`: it shows nothing there.
    /// \[m\]
    pub height: Option<f64>,
}

/// Compares two scans over each point of the surface that was made of the first; all in one frame.
#[must_use]
pub fn changes(surface: &Scan, before: &PlacedScan, after: &PlacedScan) -> Vec<Change> {
    let radius = DISC.max(3.0 * surface.spacing);
    let [before, after] = [before, after].map(|scan| Seen::new(scan, radius));
    (0..surface.points.len())
        .into_par_iter()
        .map(|i| {
            let (point, normal) = (&surface.points[i], &surface.normals[i]);
            let [first, second] = [&before, &after].map(|seen| seen.about(point, normal, radius));
            let colours = first.colour.zip(second.colour);
            Change {
                colour: colours.map(|(a, b)| (a - b).norm()),
                height: first.height.zip(second.height).map(|(a, b)| b - a),
            }
        })
        .collect()
}

/// The points of a scan, with their colours where it has them.
struct Seen {
    points: Vec<Point3<f64>>,
    colours: Vec<Option<Vector3<f64>>>,
    grid: Grid,
}

/// What a scan shows about a place.
struct Look {
    colour: Option<Vector3<f64>>,
    height: Option<f64>,
}

impl Seen {
    fn new(scan: &PlacedScan, radius: f64) -> Self {
        let (mut points, mut colours) = (Vec::new(), Vec::new());
        for view in &scan.views {
            points.extend(view.points.iter().copied());
            let vector = |rgb: &[u8; 3]| Vector3::from(rgb.map(f64::from));
            colours.extend(
                (0..view.points.len()).map(|i| view.colours.as_ref().map(|c| vector(&c[i]))),
            );
        }
        let grid = Grid::new(&points, radius);
        Self { points, colours, grid }
    }

    fn about(&self, centre: &Point3<f64>, normal: &Vector3<f64>, radius: f64) -> Look {
        let (mut heights, mut colour, mut coloured) = (Vec::new(), Vector3::zeros(), 0usize);
        // In the order of the file, so that sums do not depend on the grid.
        let mut near = Vec::new();
        self.grid
            .within(centre, libm::hypot(radius, NEAR), |index, _, _| near.push(index as usize));
        near.sort_unstable();
        for index in near {
            let offset = self.points[index] - centre;
            let height = offset.dot(normal);
            let beside = (offset - normal * height).norm();
            if height.abs() > NEAR || beside > radius {
                continue;
            }
            heights.push(height);
            if let Some(rgb) = self.colours[index] {
                colour += rgb;
                coloured += 1;
            }
        }
        heights.sort_by(f64::total_cmp);
        let height = (heights.len() >= FEW).then(|| heights[heights.len() / 2]);
        Look { colour: (coloured >= FEW).then(|| colour / coloured as f64), height }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scan::View;

    /// A plate of 20 × 20 cm, a point every 4 mm, its right half as said.
    fn plate(colour: Option<[u8; 3]>, height: f64, hole: bool) -> PlacedScan {
        let at = |i: u32| 0.004 * f64::from(i) - 0.1;
        let all = (0..2500).map(|i| Point3::new(at(i % 50), at(i / 50), 0.0));
        let is_right = |p: &Point3<f64>| p.x > 0.0;
        let points: Vec<Point3<f64>> = all
            .filter(|p| !(hole && is_right(p)))
            .map(|p| if is_right(&p) { p + Vector3::z() * height } else { p })
            .collect();
        let paint = |p: &Point3<f64>| match colour {
            Some(rgb) if is_right(p) => rgb,
            _ => [180, 180, 180],
        };
        let colours = colour.map(|_| points.iter().map(paint).collect());
        PlacedScan { views: vec![View { points, colours, ..View::default() }] }
    }

    fn surface(scan: &PlacedScan) -> Scan {
        let points = scan.views[0].points.clone();
        let normals = vec![Vector3::z_axis(); points.len()];
        Scan { raw: points.clone(), points, normals, spacing: 0.004 }
    }

    #[test]
    fn colour_and_height_are_told_apart_and_what_is_not_seen_is_not_known() {
        let before = plate(Some([180, 180, 180]), 0.0, false);
        let surface = surface(&before);
        let of = |after: &PlacedScan| changes(&surface, &before, after);
        // Away from the border, left and right of it.
        let sides = |changes: &[Change]| {
            let mut sides = [Vec::new(), Vec::new()];
            for (point, change) in surface.points.iter().zip(changes) {
                if point.x.abs() > 0.02 {
                    sides[usize::from(point.x > 0.0)].push(*change);
                }
            }
            sides
        };
        let [left, right] = sides(&of(&plate(Some([100, 180, 240]), 0.0, false)));
        assert!(left.iter().all(|c| c.colour == Some(0.0) && c.height == Some(0.0)));
        assert!(right.iter().all(|c| (c.colour.expect("seen") - 100.0).abs() < 1e-9));
        let [left, right] = sides(&of(&plate(None, -0.002, false)));
        assert!(left.iter().all(|c| c.colour.is_none() && c.height == Some(0.0)));
        assert!(right.iter().all(|c| (c.height.expect("seen") + 0.002).abs() < 1e-12));
        let [left, right] = sides(&of(&plate(Some([180, 180, 180]), 0.0, true)));
        assert!(left.iter().all(|c| c.height == Some(0.0)));
        assert!(right.iter().all(|c| *c == Change::default()));
    }
}
