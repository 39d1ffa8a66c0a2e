//! Which way is up, where nobody has said it.

use nalgebra::{Point3, UnitVector3, Vector3};
use thiserror::Error;

use super::flat::{self, Flat, Noise};
use crate::scan::RawScan;

/// Gravity as a scan shows it, in the file's frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Level {
    /// Against gravity: as it is given, or else the plane's normal.
    pub up: UnitVector3<f64>,
    /// Of the file's origin above the plane by which it was found. \[m\]
    pub height: f64,
    /// How much was seen of that plane. \[m²\]
    pub area: f64,
    /// Whether the origin is a camera: it may be one, and all points lie in its field of view.
    pub camera: bool,
}

/// Why gravity cannot be told.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum LevelError {
    /// No plane is near level.
    #[error(
        "no level plane of at least {least} m² is in the scan, so which way is up cannot be told"
    )]
    NoPlane {
        /// The least area.
        least: f64,
    },
}

/// Least area of the plane that tells gravity. \[m²\]
const AREA: f64 = 0.2;

/// How far a camera may be from level, and a given direction from true. \[rad\]
const TILT: f64 = 1.0;

/// How far one who says which way is up may be wrong. \[rad\]
const GIVEN: f64 = 0.2;

/// Points on a plane's wrong side that a floor may have.
const BELOW: f64 = 0.03;

/// Finds gravity by the level plane of which most was seen and that lies below all else, or, where
/// there is none such, by the level plane of which most was seen. Level is what is at most 57°
/// from level in the frame as its sensor holds it: y down for a depth camera, y up for one that
/// looks along −z, else z up; with `up` given, at most 11° from that.
///
/// # Errors
/// [`LevelError::NoPlane`] where no such plane is there.
pub fn level(raw: &RawScan, up: Option<UnitVector3<f64>>, seed: u64) -> Result<Level, LevelError> {
    // The points of a scanner that stood elsewhere are in no camera's frame.
    let elsewhere = raw.sensor.is_some_and(|at| at != Point3::origin());
    let view = field_of_view(&raw.points).filter(|_| !elsewhere);
    let camera = held(raw).is_some();
    let noise = Noise { sensors: camera.then(Point3::origin).into_iter().collect() };
    let (thin, side) = flat::thin(&raw.points);
    let flats = flat::find(&thin, side, &noise, seed);
    let held = up.or(view).unwrap_or(Vector3::z_axis());
    let limit = libm::cos(if up.is_some() { GIVEN } else { TILT });
    let upwards = |flat: &Flat| {
        [flat.normal, -flat.normal].into_iter().find(|normal| normal.dot(&held) > limit)
    };
    let level: Vec<(UnitVector3<f64>, &Flat)> = flats
        .iter()
        .filter(|flat| flat.area >= AREA)
        .filter_map(|flat| Some((upwards(flat)?, flat)))
        .collect();
    let lowest = |(up, flat): &&(UnitVector3<f64>, &Flat)| {
        let below = |p: &&Point3<f64>| (*p - flat.centroid).dot(up) < -3.0 * noise.at(p);
        thin.iter().filter(below).count() as f64 <= BELOW * thin.len() as f64
    };
    let larger = |a: &&(UnitVector3<f64>, &Flat), b: &&(UnitVector3<f64>, &Flat)| {
        a.1.area.total_cmp(&b.1.area)
    };
    let found = level.iter().filter(lowest).max_by(larger).or(level.iter().max_by(larger));
    let Some((normal, flat)) = found else { return Err(LevelError::NoPlane { least: AREA }) };
    // Who says the direction says it exactly; the plane gives the height along it.
    let up = up.unwrap_or(*normal);
    let height = -flat.centroid.coords.dot(&up);
    Ok(Level { up, height, area: flat.area, camera })
}

/// A flat piece that is not level by a direction, and how far it is from that.
#[derive(Clone, Debug, PartialEq)]
pub struct Lean {
    /// Of the piece from level. \[rad\]
    pub angle: f64,
    /// How much was seen of it. \[m²\]
    pub area: f64,
    /// The direction by which it would be level, in the file's frame: on the sensor's side where that
    /// is known.
    pub up: UnitVector3<f64>,
}

/// Of the flat pieces of a scan that are large enough to tell, the one nearest to level by `up`, where none
/// is level to within 11°.
#[must_use]
pub fn lean(raw: &RawScan, up: &UnitVector3<f64>, seed: u64) -> Option<Lean> {
    let noise = Noise { sensors: raw.sensor.into_iter().collect() };
    let (thin, side) = flat::thin(&raw.points);
    let flats = flat::find(&thin, side, &noise, seed);
    let large = || flats.iter().filter(|flat| flat.area >= AREA);
    let level = |flat: &Flat| flat.normal.dot(up).abs();
    let flat = large().max_by(|a, b| level(a).total_cmp(&level(b)))?;
    if level(flat) > libm::cos(GIVEN) {
        return None;
    }
    let above = raw.sensor.map_or(up.into_inner(), |sensor| sensor - flat.centroid);
    let up_by_it = if flat.normal.dot(&above) < 0.0 { -flat.normal } else { flat.normal };
    Some(Lean { angle: libm::acos(level(flat).min(1.0)), area: flat.area, up: up_by_it })
}

/// The direction up of the camera at the file's origin that has seen a scan, were it held level; `None`
/// where the points stand in no camera's frame.
#[must_use]
pub fn held(raw: &RawScan) -> Option<UnitVector3<f64>> {
    field_of_view(&raw.points).filter(|_| raw.sensor == Some(Point3::origin()))
}

/// The direction up of a camera that is held level, if all points lie in the field of view of one at
/// the origin.
fn field_of_view(points: &[Point3<f64>]) -> Option<UnitVector3<f64>> {
    // Depth cameras see at most some 100° across; no point is at the lens.
    let sees = |forward: f64| {
        points.iter().all(|p| {
            let depth = forward * p.z;
            depth > 0.05 && p.x.abs() < 1.3 * depth && p.y.abs() < 1.3 * depth
        })
    };
    if sees(1.0) {
        Some(-Vector3::y_axis())
    } else if sees(-1.0) {
        Some(Vector3::y_axis())
    } else {
        None
    }
}
