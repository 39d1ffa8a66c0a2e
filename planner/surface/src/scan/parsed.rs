//! What the parsers of all formats have in common: the form of their result.

use nalgebra::{Isometry3, Point3, Vector3};

use super::warning::ScanWarning;

/// What a parser hands over: everything in the file's unit, nothing filtered.
#[derive(Debug)]
pub(super) struct Parsed {
    /// Points, or the vertices of a mesh.
    pub(super) points: Vec<Point3<f64>>,
    /// Parallel to `points`, or empty.
    pub(super) normals: Vec<Vector3<f64>>,
    /// Red, green and blue, parallel to `points`, or empty.
    pub(super) colours: Vec<[u8; 3]>,
    /// Corners as indices into `points`; not empty: a mesh.
    pub(super) triangles: Vec<[usize; 3]>,
    /// The sensor's pose by a PCD header, which is not applied.
    pub(super) viewpoint: Option<Isometry3<f64>>,
    /// Where the sensor stood among the points; by default their origin.
    pub(super) sensor: Option<Point3<f64>>,
    pub(super) warnings: Vec<ScanWarning>,
}

impl Default for Parsed {
    fn default() -> Self {
        Self {
            points: Vec::new(),
            normals: Vec::new(),
            colours: Vec::new(),
            triangles: Vec::new(),
            viewpoint: None,
            sensor: Some(Point3::origin()),
            warnings: Vec::new(),
        }
    }
}
