//! What else was measured: every point that a cleaned surface does not stand for is in the way.

use nalgebra::Point3;
use rayon::prelude::*;

use super::cloud::Scan;
use super::place::{PlacedScan, View};
use crate::grid::Grid;

/// A point this near to a point of the surface is the surface, seen with the sensor's noise. \[m\]
pub(super) const STANDS_FOR: f64 = 0.015;
/// A thing has at least this many points more …
const COMPANY: usize = 3;
/// … this near to each of its points, or four spacings of the surface; a pixel that flies alone
/// between fore- and background has fewer. \[m\]
const NEAR: f64 = 0.02;

/// All points of a scan beside its cleaned surface, in the surface's frame. \[m\]
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measured {
    /// Those for which the surface stands, as they were measured.
    pub raw: Vec<Point3<f64>>,
    /// Those that it leaves out: what lies beside the region, what cleaning has dropped, and, measured
    /// too, places inside of closed meshes.
    pub rest: Vec<Point3<f64>>,
    /// Flying pixels: left out by the surface, and alone. Only a depth camera has them: where no
    /// sensor is known, every point is a thing.
    pub flying: Vec<Point3<f64>>,
}

/// Sorts every point of the views by whether the surface made of them stands for it.
#[must_use]
pub fn measured(scan: &PlacedScan, surface: &Scan) -> Measured {
    let all: Vec<Point3<f64>> = scan.views.iter().flat_map(found).copied().collect();
    let of_camera: Vec<bool> = scan
        .views
        .iter()
        .flat_map(|view| std::iter::repeat_n(view.sensor.is_some(), found(view).len()))
        .collect();
    let near = NEAR.max(4.0 * surface.spacing);
    let known = Grid::new(&surface.points, STANDS_FOR);
    let company = Grid::new(&all, near);
    let is_known = |p: &Point3<f64>| known.nearest(p, STANDS_FOR, |_| true).is_some();
    let is_alone = |p: &Point3<f64>| {
        let mut others = 0;
        company.within(p, near, |_, _, _| others += 1);
        // The point itself is among them.
        others <= COMPANY
    };
    let kinds: Vec<(bool, bool)> = all
        .par_iter()
        .zip(&of_camera)
        .map(|(p, of_camera)| {
            let known = is_known(p);
            (known, *of_camera && !known && is_alone(p))
        })
        .collect();
    let mut measured = Measured::default();
    measured.rest.extend(scan.views.iter().flat_map(|view| &view.inside));
    for (point, (is_known, is_alone)) in all.into_iter().zip(kinds) {
        let kind = match (is_known, is_alone) {
            (true, _) => &mut measured.raw,
            (false, false) => &mut measured.rest,
            (false, true) => &mut measured.flying,
        };
        kind.push(point);
    }
    measured
}

/// What a view knows of things: its points, or its meshes' faces.
fn found(view: &View) -> &[Point3<f64>] {
    if view.faces.is_empty() { &view.points } else { &view.faces }
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitVector3, Vector3};

    use super::*;
    use crate::scan::View;

    #[test]
    fn a_post_beside_the_surface_stays_and_a_lone_pixel_flies() {
        let plate: Vec<Point3<f64>> = (0..900)
            .map(|i| Point3::new(f64::from(i % 30) * 0.005, f64::from(i / 30) * 0.005, 0.0))
            .collect();
        let up = UnitVector3::new_normalize(Vector3::z());
        let surface = Scan {
            normals: vec![up; plate.len()],
            raw: plate.clone(),
            points: plate.clone(),
            spacing: 0.005,
        };
        let noisy: Vec<Point3<f64>> = plate.iter().map(|p| p + Vector3::z() * 0.004).collect();
        let post: Vec<Point3<f64>> =
            (1..20).map(|i| Point3::new(0.07, 0.07, 0.02 + 0.005 * f64::from(i))).collect();
        let pixel = Point3::new(0.0, 0.0, 0.1);
        let points = noisy.iter().chain(&post).copied().chain([pixel]).collect();
        let sensor = Some(Point3::new(0.0, 0.0, 2.0));
        let mut placed = PlacedScan { views: vec![View { points, sensor, ..View::default() }] };
        let found = measured(&placed, &surface);
        assert_eq!(found.raw, noisy);
        assert_eq!(found.rest, post);
        assert_eq!(found.flying, [pixel]);
        placed.views[0].sensor = None;
        let found = measured(&placed, &surface);
        assert_eq!(found.rest.len(), post.len() + 1);
        assert_eq!(found.flying, []);
    }
}
