//! A depth camera that looks at distance fields.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::shape::Shape;
use crate::scan::RawScan;

/// One view of a simulated object.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulatedView {
    /// The points in the optical frame (x right, y down, z forward), without the floor.
    pub scan: RawScan,
    /// The optical frame in the floor frame: z up, the object standing at the origin, its front
    /// towards −x, where the sensor stands.
    pub sensor_pose: Isometry3<f64>,
}

/// A structured-light camera with the noise of a Kinect: σ(z) = 1.2 mm + 1.9 mm/m² (z − 0.4 m)²
/// along the optical axis (Nguyen, Izadi & Lovell 2012).
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Kinect {
    /// Pixels in a row.
    width: usize,
    /// Pixels in a column.
    height: usize,
    /// Horizontal field of view. \[rad\]
    horizontal_view: f64,
    /// Vertical field of view. \[rad\]
    vertical_view: f64,
    /// Least and greatest depth that is measured. \[m\]
    range: (f64, f64),
    /// Least cosine between surface normal and ray that still returns a depth.
    grazing_cosine: f64,
    /// Points lower than this count as floor and are removed. \[m\]
    floor_clearance: f64,
}

impl Default for Kinect {
    fn default() -> Self {
        Self {
            width: 640,
            height: 480,
            horizontal_view: 58f64.to_radians(),
            vertical_view: 45f64.to_radians(),
            range: (0.5, 4.0),
            grazing_cosine: 0.15,
            floor_clearance: 0.018,
        }
    }
}

impl Kinect {
    /// The noise of one depth. \[m\]
    fn noise(depth: f64) -> f64 {
        0.0012 + 0.0019 * (depth - 0.4).powi(2)
    }

    /// What the camera sees from `eye` (floor frame), turned towards `target`, level, of a shape
    /// that lies within 0.7 m of the target.
    pub(super) fn view(
        &self,
        shape: &Shape,
        eye: Point3<f64>,
        target: Point3<f64>,
        seed: u64,
    ) -> SimulatedView {
        let sensor_pose = optical_pose(eye, target);
        let (fx, fy) = (
            0.5 * self.width as f64 / libm::tan(0.5 * self.horizontal_view),
            0.5 * self.height as f64 / libm::tan(0.5 * self.vertical_view),
        );
        let rays: Vec<(Vector3<f64>, Option<f64>)> = (0..self.width * self.height)
            .into_par_iter()
            .map(|pixel| {
                let (column, row) = (pixel % self.width, pixel / self.width);
                let ray = Vector3::new(
                    (column as f64 + 0.5 - 0.5 * self.width as f64) / fx,
                    (row as f64 + 0.5 - 0.5 * self.height as f64) / fy,
                    1.0,
                );
                (ray, self.depth(shape, &sensor_pose, &ray, &target))
            })
            .collect();
        // One noise a hit, in the order of the pixels: the same on any number of threads.
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let points = rays
            .into_iter()
            .filter_map(|(ray, depth)| {
                depth.map(|z| Point3::from(ray * (z + Self::noise(z) * gaussian(&mut rng))))
            })
            .collect();
        let scan = RawScan { points, ..RawScan::default() };
        SimulatedView { scan, sensor_pose }
    }

    /// The depth along a ray of unit depth, by steps of the distance to the surface.
    fn depth(
        &self,
        shape: &Shape,
        pose: &Isometry3<f64>,
        ray: &Vector3<f64>,
        middle: &Point3<f64>,
    ) -> Option<f64> {
        const HIT: f64 = 5e-5;
        const BOUND: f64 = 0.7;
        let length = ray.norm();
        let direction = pose.rotation * (ray / length);
        let eye = Point3::from(pose.translation.vector);
        // Most rays miss the ball around the object, and no step is spent on them.
        let closest = (middle - eye).dot(&direction);
        let aside = (middle - eye - direction * closest).norm_squared();
        let half_chord = (BOUND * BOUND - aside).max(0.0).sqrt();
        let (nearest, farthest) = (self.range.0 * length, self.range.1 * length);
        let mut travelled = nearest.max(closest - half_chord);
        let end = farthest.min(closest + half_chord);
        for _ in 0..400 {
            if travelled >= end {
                return None;
            }
            let point = eye + direction * travelled;
            let distance = shape.distance(&point);
            if distance < HIT {
                let cosine = -shape.normal(&point).dot(&direction);
                let visible = cosine >= self.grazing_cosine && point.z >= self.floor_clearance;
                return visible.then_some(travelled / length);
            }
            // Four fifths, as blends and bends overstate the distance a little.
            travelled += 0.8 * distance;
        }
        None
    }
}

/// The pose of an optical frame at `eye` that looks at `target` with its rows level.
fn optical_pose(eye: Point3<f64>, target: Point3<f64>) -> Isometry3<f64> {
    let forward = (target - eye).normalize();
    let right = forward.cross(&Vector3::z()).normalize();
    let down = forward.cross(&right);
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[right, down, forward]));
    Isometry3::from_parts(Translation3::from(eye), UnitQuaternion::from_rotation_matrix(&rotation))
}

/// A standard normal number (Box & Muller 1958).
fn gaussian(rng: &mut ChaCha8Rng) -> f64 {
    let radius = (-2.0 * libm::log(1.0 - rng.random::<f64>())).sqrt();
    radius * libm::cos(std::f64::consts::TAU * rng.random::<f64>())
}
