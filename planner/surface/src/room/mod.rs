//! A room as a scan shows it: which way is up, the planes that bound it, and the objects that stand
//! in it.
//!
//! [`level()`] finds gravity and the height of the sensor in a file's own frame, where nobody has
//! said them; [`Room::find`] finds floor, table tops and walls in placed views and cuts out what
//! stands on them. Every random choice has a seed: the same scan gives the same room.

mod flat;
mod level;
mod outline;
mod plane;
mod segment;

use nalgebra::{Point3, Vector3};

use crate::scan::PlacedScan;
use flat::{Flat, Noise};
pub use level::{Lean, Level, LevelError, held, lean, level};
pub use outline::Rectangle;
pub use plane::{Plane, PlaneKind};
pub use segment::Segment;

/// The planes of a room and what stands in it, in the floor frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Room {
    /// Floor, tables and walls, the largest first.
    pub planes: Vec<Plane>,
    /// Objects that stand on floor or table, that with the most points first.
    pub segments: Vec<Segment>,
    noise: Noise,
}

/// Least area of a table top; the seat of a chair is smaller. \[m²\]
const TABLE: f64 = 0.25;
/// Least area of a wall. \[m²\]
const WALL: f64 = 0.5;
/// Most of all points that may lie below a floor or behind a wall: reflections, noise.
const BEYOND: f64 = 0.03;
/// How far a point must be beyond a plane to count there. \[m\]
const FAR: f64 = 0.08;
/// The sine of the greatest lean of what counts as level or upright: 10°.
const LEAN: f64 = 0.174;

impl Room {
    /// Finds the planes and objects in views of the floor frame.
    #[must_use]
    pub fn find(scan: &PlacedScan, seed: u64) -> Self {
        let points: Vec<Point3<f64>> =
            scan.views.iter().flat_map(|view| view.points.iter().copied()).collect();
        let sensors: Vec<Point3<f64>> = scan.views.iter().filter_map(|view| view.sensor).collect();
        let noise = Noise { sensors };
        let (thin, side) = flat::thin(&points);
        let flats = flat::find(&thin, side, &noise, seed);
        let planes = kinds(&flats, &thin);
        let segments = segment::find(scan, &planes, &noise);
        Self { planes, segments, noise }
    }

    /// Whether a point is of one of the planes, as far as the sensor's noise lets it be told.
    #[must_use]
    pub fn is_on_plane(&self, point: &Point3<f64>) -> bool {
        self.planes.iter().any(|plane| plane.holds(point, self.noise.at(point)))
    }
}

/// Floor, tables and walls among flat pieces.
fn kinds(flats: &[Flat], points: &[Point3<f64>]) -> Vec<Plane> {
    let up = Vector3::z_axis();
    let beyond = |flat: &Flat, normal: &Vector3<f64>| {
        let far = points.iter().filter(|p| (*p - flat.centroid).dot(normal) < -FAR).count();
        far as f64 <= BEYOND * points.len() as f64
    };
    let lean = |flat: &Flat| flat.normal.dot(&up).abs();
    let level = |flat: &&Flat| lean(flat) > (1.0 - LEAN * LEAN).sqrt();
    let floor = flats
        .iter()
        .filter(level)
        .filter(|flat| beyond(flat, &up))
        .min_by(|a, b| a.centroid.z.total_cmp(&b.centroid.z));
    let mut planes = Vec::new();
    for flat in flats {
        let is_floor = floor.is_some_and(|floor| std::ptr::eq(floor, flat));
        // Another piece of the floor, beyond a shadow.
        let of_floor = floor.is_some_and(|f| (flat.centroid.z - f.centroid.z).abs() < FAR);
        let (kind, normal) = if level(&flat) {
            let normal = if flat.normal.z < 0.0 { -flat.normal } else { flat.normal };
            match (is_floor, of_floor) {
                (true, _) => (PlaneKind::Floor, normal),
                (false, false) if flat.area >= TABLE => (PlaneKind::Table, normal),
                _ => continue,
            }
        } else if lean(flat) < LEAN && flat.area >= WALL {
            let inwards = [flat.normal, -flat.normal].into_iter().find(|n| beyond(flat, n));
            let Some(normal) = inwards else { continue };
            (PlaneKind::Wall, normal)
        } else {
            continue;
        };
        let outline = outline::hull(&flat.points, &normal);
        planes.push(Plane { point: flat.centroid, normal, outline, area: flat.area, kind });
    }
    planes.sort_by(|a, b| b.area.total_cmp(&a.area));
    planes
}
