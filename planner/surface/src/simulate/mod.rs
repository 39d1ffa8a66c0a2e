//! Simulated scans: the paper's two objects (§V), and a car's door, as a Kinect would have seen them.
//!
//! The authors' recordings are not published. These stand-ins have the size, the sensor and the
//! point of view that their patch counts and tour lengths imply: a chair of about 0.5 m² and a
//! toy car of about 0.3 m², seen once from 1.35 m height.

mod camera;
mod shape;

use nalgebra::Point3;

pub use camera::SimulatedView;

use crate::scan::CropBox;
use camera::Kinect;

/// Height of the sensor above the floor. \[m\]
const SENSOR_HEIGHT: f64 = 1.35;

/// A kitchen chair, its seat 0.44 m high and its backrest away from the sensor.
#[must_use]
pub fn chair(seed: u64) -> SimulatedView {
    let eye = Point3::new(-0.72, -0.22, SENSOR_HEIGHT);
    Kinect::default().view(&shape::chair(), eye, Point3::new(0.03, 0.0, 0.45), seed)
}

/// The chair as [`chair`] sees it, and from 0.3 m beside that.
#[must_use]
pub fn chair_twice(seed: u64) -> [SimulatedView; 2] {
    let beside = Point3::new(-0.68, 0.08, SENSOR_HEIGHT);
    let at = Point3::new(0.03, 0.0, 0.45);
    [chair(seed), Kinect::default().view(&shape::chair(), beside, at, seed + 1)]
}

/// A ride-on toy car of 0.62 m length, its side towards the sensor.
#[must_use]
pub fn bobby_car(seed: u64) -> SimulatedView {
    let eye = Point3::new(-0.68, 0.18, SENSOR_HEIGHT);
    Kinect::default().view(&shape::bobby_car(), eye, Point3::new(0.0, 0.0, 0.16), seed)
}

/// A car's door that hangs upright 0.35 m above the floor, its outside towards the sensor.
#[must_use]
pub fn car_door(seed: u64) -> SimulatedView {
    let eye = Point3::new(-0.95, -0.10, SENSOR_HEIGHT);
    Kinect::default().view(&shape::car_door(), eye, Point3::new(0.0, 0.0, 0.55), seed)
}

/// The seat of [`chair`] without backrest and legs, in the floor frame.
#[must_use]
pub fn chair_seat() -> CropBox {
    CropBox { min: Point3::new(-0.30, -0.30, 0.40), max: Point3::new(0.185, 0.30, 0.50) }
}
