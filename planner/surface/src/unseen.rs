//! What no view has seen: the space behind what was measured.
//!
//! Each sensor's measurements are sorted by direction, into windows that overlap by half. A place is
//! *unseen* if in one of the windows around its direction it lies behind all that was measured
//! there, as some sensor sees it, and no sensor has looked through it. So the edge of what was seen
//! is taken to be uncertain by a window, wherever their borders fall. Windows without a measurement
//! say nothing: a scan that was cropped would else be walled in.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{Point3, UnitQuaternion, Vector3};
use rayon::prelude::*;

use crate::scan::{PlacedScan, Scan, View};

/// Side of the cells of space. \[m\]
const CELL: f64 = 0.01;
/// How deep something may come into what no view has seen, if nothing else is asked for: so deep may
/// the sensor be wrong, and so thin may a thing be. \[m\]
pub const DEEPEST: f64 = 0.02;
/// How far the unseen is looked at around the surface. \[m\]
const AROUND: f64 = 0.6;
/// Width of a window: directions are told apart by this angle, and by no less than a few
/// measurements. \[rad\]
const WINDOW: f64 = 0.5 * PI / 180.0;
/// Measurements that a window should have, across.
const ACROSS: f64 = 2.5;

/// The border of the unseen space around a surface, as centres of cells 1 cm apart; nothing where
/// no view has a known sensor. Below the floor (z = 0) is no space. \[m\]
///
/// What keeps half a cell from these places comes no deeper than `deepest` \[m\] into the unseen; with
/// 0 not at all, as exactly as cells tell.
#[must_use]
pub fn border(scan: &PlacedScan, surface: &Scan, deepest: f64) -> Vec<Point3<f64>> {
    // Of what begins so deep the first centre of a cell may lie a whole cell deeper.
    let depth = (deepest - 0.5 * CELL).max(0.0);
    let eye = |view| Eye::of(view, surface, depth);
    let eyes: Vec<Eye> = scan.views.iter().filter_map(eye).collect();
    if eyes.is_empty() {
        return Vec::new();
    }
    let space = Space::around(surface);
    let unseen: Vec<bool> =
        (0..space.len()).into_par_iter().map(|i| is_unseen(&eyes, &space.centre(i))).collect();
    (0..space.len())
        .filter(|&i| unseen[i] && space.neighbours(i).any(|n| n.is_none_or(|n| !unseen[n])))
        .map(|i| space.centre(i))
        .collect()
}

fn is_unseen(eyes: &[Eye], place: &Point3<f64>) -> bool {
    let mut hidden = false;
    for eye in eyes {
        match eye.sees(place) {
            Sight::Through => return false,
            Sight::Behind => hidden = true,
            Sight::Nothing => {}
        }
    }
    hidden
}

/// What a sensor says of a place.
enum Sight {
    /// It has measured something behind it.
    Through,
    /// It has measured only what is well in front of it.
    Behind,
    /// It has measured nothing there, or just there.
    Nothing,
}

/// A sensor and how far it saw, by direction.
struct Eye {
    at: Point3<f64>,
    /// Turns z into the middle of what it saw.
    turn: UnitQuaternion<f64>,
    /// Side of the cells of directions: half a window. \[rad\]
    angle: f64,
    columns: usize,
    sight: Vec<Range>,
}

/// How far a sensor saw in a cell of directions. \[m\]
#[derive(Clone, Copy)]
struct Range {
    /// The least distance measured in any window around it: what is nearer was looked through.
    /// Infinite where nothing was measured.
    nearest: f32,
    /// Behind this some window around it saw nothing. Infinite where nothing was measured.
    hidden: f32,
}

impl Eye {
    /// The sensor of a view, if it is known; a place counts as unseen from so far behind what was
    /// measured. \[m\]
    fn of(view: &View, surface: &Scan, depth: f64) -> Option<Self> {
        let at = view.sensor?;
        let mean: Vector3<f64> = view.points.iter().map(|p| (p - at).normalize()).sum();
        let turn = UnitQuaternion::rotation_between(&Vector3::z(), &mean)?;
        let distances: f64 = view.points.iter().map(|p| (p - at).norm()).sum();
        let distance = distances / view.points.len().max(1) as f64;
        let angle = 0.5 * WINDOW.max(ACROSS * surface.spacing / distance.max(1e-3));
        let (columns, rows) = ((2.0 * PI / angle) as usize + 1, (PI / angle) as usize + 1);
        let mut eye = Self { at, turn, angle, columns, sight: Vec::new() };
        // Least and largest distance in each cell, the largest 0 where there is none.
        let mut seen = vec![(f32::INFINITY, 0.0_f32); columns * rows];
        for p in &view.points {
            let (direction, distance) = eye.look(p);
            if let Some((least, most)) = seen.get_mut(direction) {
                *least = least.min(distance);
                *most = most.max(distance);
            }
        }
        // A window is a cell, the next one, and the two below these.
        let joined = |a: (f32, f32), b: (f32, f32)| (a.0.min(b.0), a.1.max(b.1));
        let window = |first: usize| {
            [1, columns, columns + 1]
                .iter()
                .filter_map(|offset| seen.get(first + offset))
                .fold(seen[first], |window, cell| joined(window, *cell))
        };
        let windows: Vec<(f32, f32)> = (0..seen.len()).map(window).collect();
        let range = |cell: usize| {
            let around = [0, 1, columns, columns + 1]
                .into_iter()
                .filter_map(|offset| Some(windows[cell.checked_sub(offset)?]))
                .filter(|(_, most)| *most > 0.0);
            let nothing = Range { nearest: f32::INFINITY, hidden: f32::INFINITY };
            around.fold(nothing, |range, (least, most)| Range {
                nearest: range.nearest.min(least),
                hidden: range.hidden.min(most + depth as f32),
            })
        };
        eye.sight = (0..seen.len()).map(range).collect();
        Some(eye)
    }

    /// The cell of a place's direction, and its distance. \[m\]
    fn look(&self, place: &Point3<f64>) -> (usize, f32) {
        let v = self.turn.inverse_transform_vector(&(place - self.at));
        let column = (libm::atan2(v.x, v.z) + PI) / self.angle;
        let row = (libm::atan2(v.y, libm::hypot(v.x, v.z)) + FRAC_PI_2) / self.angle;
        (row as usize * self.columns + column as usize, v.norm() as f32)
    }

    fn sees(&self, place: &Point3<f64>) -> Sight {
        let (direction, distance) = self.look(place);
        match self.sight.get(direction) {
            Some(range) if distance > range.hidden => Sight::Behind,
            Some(range) if range.nearest.is_finite() && distance < range.nearest => Sight::Through,
            _ => Sight::Nothing,
        }
    }
}

/// Cells of the space around a surface, x fastest.
struct Space {
    low: Point3<f64>,
    size: [usize; 3],
}

impl Space {
    fn around(surface: &Scan) -> Self {
        let first = surface.points.first().copied().unwrap_or_default();
        let (mut low, mut high) = (first, first);
        for p in &surface.points {
            (low, high) = (low.inf(p), high.sup(p));
        }
        let grow = Vector3::repeat(AROUND);
        (low, high) = (low - grow, high + grow);
        low.z = low.z.max(0.0);
        let size = [0, 1, 2].map(|i| ((high[i] - low[i]).max(0.0) / CELL).ceil() as usize);
        Self { low, size }
    }

    fn len(&self) -> usize {
        self.size.iter().product()
    }

    fn place(&self, i: usize) -> [usize; 3] {
        let [x, y, _] = self.size;
        [i % x, i / x % y, i / (x * y)]
    }

    fn centre(&self, i: usize) -> Point3<f64> {
        self.low + Vector3::from(self.place(i).map(|n| (n as f64 + 0.5) * CELL))
    }

    /// The six cells beside one; `None` for one beyond the space, none below it: there is the floor.
    fn neighbours(&self, i: usize) -> impl Iterator<Item = Option<usize>> {
        let [x, y, z] = self.place(i);
        let [nx, ny, nz] = self.size;
        [
            Some((x > 0).then(|| i - 1)),
            Some((x + 1 < nx).then_some(i + 1)),
            Some((y > 0).then(|| i - nx)),
            Some((y + 1 < ny).then_some(i + nx)),
            (z > 0 || self.low.z > 0.0).then(|| (z > 0).then(|| i - nx * ny)),
            Some((z + 1 < nz).then_some(i + nx * ny)),
        ]
        .into_iter()
        .flatten()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitVector3;

    use super::*;

    const DEPTH: f64 = DEEPEST - 0.5 * CELL;

    /// A plate of 40 × 40 cm at height 1 m over the origin, seen from a place.
    fn plate(sensor: Option<Point3<f64>>) -> (View, Scan) {
        let points: Vec<Point3<f64>> = (0..10_000)
            .map(|i| {
                let at = |n: i32| 0.004 * f64::from(n) - 0.2;
                Point3::new(at(i % 100), at(i / 100), 1.0)
            })
            .collect();
        let up = UnitVector3::new_normalize(Vector3::z());
        let surface = Scan {
            normals: vec![up; points.len()],
            raw: points.clone(),
            points: points.clone(),
            spacing: 0.004,
        };
        (View { points, sensor, ..View::default() }, surface)
    }

    #[test]
    fn behind_a_plate_is_unseen_and_beside_it_is_not() {
        let (view, surface) = plate(Some(Point3::new(0.0, 0.0, 2.0)));
        let eye = [Eye::of(&view, &surface, DEPTH).unwrap()];
        assert!(is_unseen(&eye, &Point3::new(0.05, 0.05, 0.9)));
        assert!(is_unseen(&eye, &Point3::new(0.25, 0.0, 0.7)), "the shadow widens");
        assert!(!is_unseen(&eye, &Point3::new(0.05, 0.05, 0.99)), "as thin as that may be seen");
        assert!(!is_unseen(&eye, &Point3::new(0.05, 0.05, 1.1)));
        assert!(!is_unseen(&eye, &Point3::new(0.3, 0.0, 0.9)));
        // A second sensor below looks through it.
        let (below, _) = plate(Some(Point3::new(0.0, 0.0, 0.2)));
        let both = [&view, &below].map(|view| Eye::of(view, &surface, DEPTH).unwrap());
        assert!(!is_unseen(&both, &Point3::new(0.05, 0.05, 0.9)));
        assert!(!is_unseen(&both, &Point3::new(0.05, 0.05, 1.1)));
    }

    #[test]
    fn the_edge_of_what_was_seen_does_not_depend_on_where_windows_begin() {
        // Seen from two metres above, 4 mm are 0.11°; places a third of a window beside the edge.
        for step in 0..40 {
            let (mut view, surface) = plate(Some(Point3::new(0.0, 0.0, 3.0)));
            let cut = -0.1 + 0.001 * f64::from(step);
            view.points.retain(|p| p.x <= cut);
            let eye = [Eye::of(&view, &surface, DEPTH).unwrap()];
            let edge = view.points.iter().map(|p| p.x).fold(f64::MIN, f64::max);
            let beside = |share: f64| {
                let tangent = libm::tan(libm::atan(edge / 2.0) + share * WINDOW);
                Point3::new(2.2 * tangent, 0.01, 0.8)
            };
            assert!(is_unseen(&eye, &beside(0.33)), "edge at {edge}");
            assert!(!is_unseen(&eye, &beside(1.5)), "edge at {edge}");
        }
    }

    #[test]
    fn the_border_encloses_the_shadow() {
        let (view, surface) = plate(Some(Point3::new(0.0, 0.0, 2.0)));
        let border = border(&PlacedScan { views: vec![view] }, &surface, DEEPEST);
        let near = |p: Point3<f64>| border.iter().any(|b| (b - p).norm() < 0.02);
        assert!(near(Point3::new(0.0, 0.0, 0.97)), "right behind the plate");
        assert!(near(Point3::new(0.3, 0.0, 0.5)), "the side of the shadow");
        assert!(!near(Point3::new(0.0, 0.0, 0.7)), "deep inside");
        assert!(border.iter().all(|p| p.z < 0.99 && p.z > 0.0));
    }

    #[test]
    fn what_may_not_come_into_the_shadow_at_all_is_kept_right_behind_what_was_measured() {
        let (view, surface) = plate(Some(Point3::new(0.0, 0.0, 2.0)));
        let scan = PlacedScan { views: vec![view] };
        // What keeps half a cell from the border comes so deep under the plate's middle.
        let deepest = |may: f64| {
            let border = border(&scan, &surface, may);
            let under = border.iter().filter(|p| libm::hypot(p.x, p.y) < 0.1);
            1.0 - under.map(|p| p.z).fold(0.0, f64::max) - 0.5 * CELL
        };
        let (forbidden, avoided) = (deepest(0.0), deepest(DEEPEST));
        assert!((-0.5 * CELL..=0.5 * CELL).contains(&forbidden), "{forbidden} m");
        assert!((DEEPEST - 1.5 * CELL..=DEEPEST).contains(&avoided), "{avoided} m");
    }

    #[test]
    fn a_scan_without_a_sensor_hides_nothing() {
        let (view, surface) = plate(None);
        assert!(border(&PlacedScan { views: vec![view] }, &surface, DEEPEST).is_empty());
    }
}
