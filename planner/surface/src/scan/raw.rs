//! A scan as its file holds it.

use nalgebra::{Isometry3, Point3, UnitVector3};

use super::warning::ScanWarning;

/// Points as the file holds them: finite, scaled to metres, in the file's own frame.
#[derive(Clone, Debug, PartialEq)]
pub struct RawScan {
    /// The finite points. \[m\]
    pub points: Vec<Point3<f64>>,
    /// The finite corners of a mesh, on which `points` were laid; empty for points. \[m\]
    pub vertices: Vec<Point3<f64>>,
    /// Unit normals parallel to `points`, where the file has a usable one for every point.
    pub normals: Option<Vec<UnitVector3<f64>>>,
    /// A mesh's corners and places all over its faces; empty for points. \[m\]
    pub faces: Vec<Point3<f64>>,
    /// Red, green and blue parallel to `points`, where the file has them.
    pub colours: Option<Vec<[u8; 3]>>,
    /// Places inside what closed meshes enclose, on a grid. \[m\]
    pub inside: Vec<Point3<f64>>,
    /// Pose of the sensor in the frame of the points, where a PCD header states other than the
    /// identity that every writer fills in. Advisory: files exist whose header turns points that
    /// are already in the optical frame, so it is applied only on request
    /// (`Placement::Viewpoint`).
    pub viewpoint: Option<Isometry3<f64>>,
    /// Where the sensor stood, in the frame of the points: for a depth camera the origin; for a
    /// scanner whose file moves its points to their place, where that file says; `None` for what no
    /// single place has seen or nobody says from where: several scans in one file, a flown lidar's
    /// points, a mesh. \[m\]
    pub sensor: Option<Point3<f64>>,
    /// Points dropped as NaN or infinite.
    pub dropped: usize,
    /// What the user should know.
    pub warnings: Vec<ScanWarning>,
}

impl Default for RawScan {
    /// No points, of a depth camera.
    fn default() -> Self {
        Self {
            points: Vec::new(),
            vertices: Vec::new(),
            normals: None,
            faces: Vec::new(),
            colours: None,
            inside: Vec::new(),
            viewpoint: None,
            sensor: Some(Point3::origin()),
            dropped: 0,
            warnings: Vec::new(),
        }
    }
}

impl RawScan {
    /// What it is placed by: a mesh by its corners, so that it stands where it stands whatever points
    /// a seed lays on it.
    #[must_use]
    pub fn anchors(&self) -> &[Point3<f64>] {
        if self.vertices.is_empty() { &self.points } else { &self.vertices }
    }
}
