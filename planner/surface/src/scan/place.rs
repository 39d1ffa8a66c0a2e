//! Moving scans from a sensor's frame into the floor frame.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, UnitVector3, Vector3};

use super::crop::CropBox;
use super::error::ScanError;
use super::raw::RawScan;
use super::stray;

/// What is known about where a scan was taken.
#[derive(Clone, Debug, PartialEq)]
pub enum Placement {
    /// The pose that takes the file's coordinates to the floor frame: the sensor's own, where that
    /// is the origin of the file's frame ([`RawScan::sensor`]).
    SensorPose(Isometry3<f64>),
    /// The direction against gravity in the file's frame, the sensor's height above the plane
    /// that the object stands on, and that plane's height above the floor (a table). Where
    /// the sensor is not known ([`RawScan::sensor`]), the height is that of the origin of the file's
    /// frame. The points' mean comes to stand over the origin.
    UpAndHeight {
        /// Against gravity, in the file's frame.
        up: UnitVector3<f64>,
        /// Of the sensor above the support. \[m\]
        sensor_height: f64,
        /// Of the support above the floor. \[m\]
        support_height: f64,
    },
    /// Only the direction against gravity is known: the lowest point that has others around it rests
    /// on the support, the points' mean comes to stand over the origin, and no sensor orients the
    /// normals.
    Up {
        /// Against gravity, in the file's frame.
        up: UnitVector3<f64>,
        /// Of the support above the floor. \[m\]
        support_height: f64,
    },
    /// The pose that takes the file's coordinates to the floor frame, and the sensor's position
    /// there if it is known: for a further file in the frame of one that was placed before.
    Frame {
        /// File to floor frame.
        pose: Isometry3<f64>,
        /// In the floor frame. \[m\]
        sensor: Option<Point3<f64>>,
    },
    /// The file's own VIEWPOINT is the sensor's pose in the floor frame and the points are in the
    /// sensor's frame. Without one in the file, the identity.
    Viewpoint,
}

/// One view in the floor frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct View {
    /// Points in the floor frame. \[m\]
    pub points: Vec<Point3<f64>>,
    /// Normals that the file gave, parallel to `points`.
    pub normals: Option<Vec<UnitVector3<f64>>>,
    /// The corners of its meshes and places all over their faces: what is in the way where `points`
    /// are but drawn at random. Empty for points. \[m\]
    pub faces: Vec<Point3<f64>>,
    /// Red, green and blue that the file gave, parallel to `points`.
    pub colours: Option<Vec<[u8; 3]>>,
    /// Places inside what its closed meshes enclose. \[m\]
    pub inside: Vec<Point3<f64>>,
    /// Where the sensor stood; `None`: unknown. \[m\]
    pub sensor: Option<Point3<f64>>,
}

/// Views in the floor frame: z up, the floor at z = 0.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlacedScan {
    /// The views, in the order of the files.
    pub views: Vec<View>,
}

/// How much lower than its points a corner of a mesh may lie and still belong to them. \[m\]
const FOOT: f64 = 0.01;

/// Moves a scan into the floor frame. Returns it with the pose that takes the file's coordinates
/// there, so that a second file in the same frame can be placed with [`Placement::Frame`].
#[must_use]
pub fn place(raw: &RawScan, placement: &Placement) -> (PlacedScan, Isometry3<f64>) {
    let pose = match placement {
        Placement::SensorPose(pose) | Placement::Frame { pose, .. } => *pose,
        Placement::Viewpoint => raw.viewpoint.unwrap_or_default(),
        Placement::UpAndHeight { up, sensor_height, support_height } => {
            let upright = upright(up);
            let mean = mean(raw.anchors(), &upright);
            let sensor = upright * raw.sensor.unwrap_or_default();
            let height = sensor_height + support_height - sensor.z;
            Isometry3::from_parts(Translation3::new(-mean.x, -mean.y, height), upright)
        }
        Placement::Up { up, support_height } => {
            let upright = upright(up);
            let mean = mean(raw.anchors(), &upright);
            let lowest = lowest(raw, &upright);
            let shift = Translation3::new(-mean.x, -mean.y, support_height - lowest);
            Isometry3::from_parts(shift, upright)
        }
    };
    let sensor = match placement {
        Placement::Up { .. } => None,
        Placement::Frame { sensor, .. } => *sensor,
        _ => raw.sensor.map(|at| pose * at),
    };
    let view = View {
        points: raw.points.iter().map(|p| pose * p).collect(),
        normals: raw
            .normals
            .as_ref()
            .map(|normals| normals.iter().map(|n| pose.rotation * n).collect()),
        faces: raw.faces.iter().map(|p| pose * p).collect(),
        colours: raw.colours.clone(),
        inside: raw.inside.iter().map(|p| pose * p).collect(),
        sensor,
    };
    (PlacedScan { views: vec![view] }, pose)
}

/// How many points lie below the one that [`place`] lays onto the support: alone, so that they
/// carry nothing. Only a placement by [`Placement::Up`] looks for it.
#[must_use]
pub fn below_support(raw: &RawScan, placement: &Placement) -> usize {
    match placement {
        Placement::Up { up, .. } => stray::support(&raw.points, &upright(up)).1,
        _ => 0,
    }
}

impl PlacedScan {
    /// Adds the views of another scan in the same frame.
    pub fn join(&mut self, other: Self) {
        self.views.extend(other.views);
    }

    /// Number of points in all views.
    #[must_use]
    pub fn len(&self) -> usize {
        self.views.iter().map(|view| view.points.len()).sum()
    }

    /// Whether no view has a point.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The points inside a box of the floor frame.
    ///
    /// # Errors
    /// [`ScanError::EmptyCrop`] if there is none, with the extent of what was there.
    pub fn crop(&self, region: &CropBox) -> Result<Self, ScanError> {
        let views: Vec<View> = self.views.iter().map(|view| crop(view, region)).collect();
        let cropped = Self { views };
        if !cropped.is_empty() {
            return Ok(cropped);
        }
        let mut min = Vector3::repeat(f64::INFINITY);
        let mut max = -min;
        for point in self.views.iter().flat_map(|view| &view.points) {
            (min, max) = (min.inf(&point.coords), max.sup(&point.coords));
        }
        Err(ScanError::EmptyCrop {
            region: *region,
            points: self.len(),
            min: min.into(),
            max: max.into(),
        })
    }
}

fn crop(view: &View, region: &CropBox) -> View {
    let kept: Vec<usize> =
        (0..view.points.len()).filter(|&i| region.contains(&view.points[i])).collect();
    let within = |all: &[Point3<f64>]| all.iter().copied().filter(|p| region.contains(p)).collect();
    View {
        points: kept.iter().map(|&i| view.points[i]).collect(),
        normals: view.normals.as_ref().map(|n| kept.iter().map(|&i| n[i]).collect()),
        colours: view.colours.as_ref().map(|c| kept.iter().map(|&i| c[i]).collect()),
        faces: within(&view.faces),
        inside: within(&view.inside),
        sensor: view.sensor,
    }
}

/// The rotation that takes `up` to z and, so that what the camera looks at lies ahead, its
/// forward axis (z of an optical frame) to x as far as it is level. A frame that already stands
/// upright is left as it is.
fn upright(up: &UnitVector3<f64>) -> UnitQuaternion<f64> {
    if up.z > 0.999_9 {
        return UnitQuaternion::rotation_between(up, &Vector3::z()).unwrap_or_default();
    }
    let forward = Vector3::z();
    let mut x = forward - up.scale(forward.dot(up));
    if x.norm() < 0.1 {
        x = Vector3::x() - up.scale(up.x);
    }
    let x = x.normalize();
    let y = up.cross(&x);
    let rows = nalgebra::Matrix3::from_rows(&[x.transpose(), y.transpose(), up.transpose()]);
    UnitQuaternion::from_rotation_matrix(&nalgebra::Rotation3::from_matrix_unchecked(rows))
}

/// The lowest that a scan rests on, over the rotated frame's origin: the lowest point that has others
/// around it; of a mesh, whose points leave out the corners, the lowest corner about there. \[m\]
fn lowest(raw: &RawScan, upright: &UnitQuaternion<f64>) -> f64 {
    let (carried, _) = stray::support(&raw.points, upright);
    let corners = raw.vertices.iter().map(|p| (upright * p).z);
    corners.filter(|z| *z >= carried - FOOT).fold(carried, f64::min)
}

/// The mean of the rotated points.
fn mean(points: &[Point3<f64>], rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
    let sum: Vector3<f64> = points.iter().map(|p| p.coords).sum();
    rotation * (sum / points.len().max(1) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn raw(points: Vec<Point3<f64>>) -> RawScan {
        RawScan { points, ..RawScan::default() }
    }

    #[test]
    fn an_optical_frame_is_set_upright_with_its_floor_at_zero() {
        // A level camera 1.2 m up: y points down, so the floor lies at y = 1.2.
        let scan = raw(vec![Point3::new(0.1, 1.2, 2.0), Point3::new(-0.1, 0.2, 2.0)]);
        let placement = Placement::UpAndHeight {
            up: UnitVector3::new_normalize(Vector3::new(0.0, -1.0, 0.0)),
            sensor_height: 1.2,
            support_height: 0.0,
        };
        let (placed, pose) = place(&scan, &placement);
        let view = &placed.views[0];
        assert!((view.points[0] - Point3::new(0.0, -0.1, 0.0)).norm() < 1e-12);
        assert!((view.points[1] - Point3::new(0.0, 0.1, 1.0)).norm() < 1e-12);
        assert!((view.sensor.unwrap() - Point3::new(-2.0, 0.0, 1.2)).norm() < 1e-12);
        assert!((pose * Point3::new(0.1, 1.2, 2.0) - view.points[0]).norm() < 1e-12);
    }

    #[test]
    fn a_mesh_rests_on_its_table() {
        let scan = raw(vec![Point3::new(1.0, 2.0, -0.3), Point3::new(3.0, 4.0, 0.2)]);
        let placement = Placement::Up { up: Vector3::z_axis(), support_height: 0.72 };
        let (placed, _) = place(&scan, &placement);
        assert!((placed.views[0].points[0] - Point3::new(-1.0, -1.0, 0.72)).norm() < 1e-12);
        assert_eq!(placed.views[0].sensor, None);
        assert_eq!(below_support(&scan, &placement), 0);
        let (_, pose) = place(&scan, &placement);
        let again = place(&scan, &Placement::Frame { pose, sensor: None }).0;
        assert_eq!(again, placed);
    }
}
