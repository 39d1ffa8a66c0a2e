//! Reading a scan file of any supported format.

use std::path::Path;

use nalgebra::{Point3, UnitVector3};

use super::cloud::MIN_POINTS;
use super::error::{Malformed, ScanError, ScanWarning};
use super::parsed::Parsed;
use super::raw::RawScan;
use super::{mesh, pcd, ply, sample, text};

/// How to read a scan.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadOptions {
    /// Factor from the file's unit to metres: 0.001 for a file in millimetres.
    pub scale: f64,
    /// Mean distance between the points sampled on a mesh. \[m\]
    pub mesh_spacing: f64,
    /// Seed of the sampling of meshes.
    pub seed: u64,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self { scale: 1.0, mesh_spacing: 0.003, seed: 1 }
    }
}

/// File formats, told apart by extension, then by the first bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Point Cloud Library: ascii, binary, binary_compressed.
    Pcd,
    /// Stanford polygon file: ascii, little and big endian; points or a mesh.
    Ply,
    /// Stereolithography mesh, ascii or binary.
    Stl,
    /// Wavefront mesh or points.
    Obj,
    /// Three or six numbers a line, separated by blanks, commas or semicolons.
    Text,
}

impl Format {
    /// The format of a file by its name, or by how its content starts.
    #[must_use]
    pub fn detect(path: &Path, bytes: &[u8]) -> Option<Self> {
        let extension = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
        match extension.as_deref() {
            Some("pcd") => Some(Self::Pcd),
            Some("ply") => Some(Self::Ply),
            Some("stl") => Some(Self::Stl),
            Some("obj") => Some(Self::Obj),
            Some("xyz" | "csv" | "txt" | "asc" | "pts") => Some(Self::Text),
            _ => {
                let head = text::without_bom(bytes);
                if head.starts_with(b"ply") {
                    Some(Self::Ply)
                } else if head.starts_with(b"# .PCD") || head.starts_with(b"VERSION") {
                    Some(Self::Pcd)
                } else {
                    None
                }
            }
        }
    }
}

/// Longest plausible side of a scan in metres; beyond it the unit is taken for millimetres.
const METRE_EXTENT: f64 = 30.0;

/// Reads the scan in a file.
///
/// # Errors
/// [`ScanError`] names the file, the place in it and the cause.
pub fn read(path: &Path, options: &ReadOptions) -> Result<RawScan, ScanError> {
    let bytes =
        std::fs::read(path).map_err(|source| ScanError::Io { path: path.into(), source })?;
    let format = Format::detect(path, &bytes)
        .ok_or_else(|| ScanError::UnknownFormat { path: path.into() })?;
    read_bytes(&bytes, format, path, options)
}

/// Reads a scan from bytes in memory; `path` is only used to name the scan in errors.
///
/// # Errors
/// As [`read`].
pub fn read_bytes(
    bytes: &[u8],
    format: Format,
    path: &Path,
    options: &ReadOptions,
) -> Result<RawScan, ScanError> {
    let parsed = match format {
        Format::Pcd => pcd::parse(bytes),
        Format::Ply => ply::parse(bytes),
        Format::Stl => mesh::parse_stl(bytes),
        Format::Obj => mesh::parse_obj(bytes),
        Format::Text => text::parse(bytes),
    };
    let parsed = parsed.map_err(|Malformed { place, cause }| ScanError::Malformed {
        path: path.into(),
        place,
        cause,
    })?;
    finish(parsed, path, options)
}

fn finish(parsed: Parsed, path: &Path, options: &ReadOptions) -> Result<RawScan, ScanError> {
    let Parsed { mut points, mut normals, triangles, mut viewpoint, mut warnings } = parsed;
    for p in &mut points {
        p.coords *= options.scale;
    }
    if let Some(pose) = &mut viewpoint {
        pose.translation.vector *= options.scale;
    }
    let mut dropped = 0;
    if !triangles.is_empty() {
        (points, normals, dropped) =
            sample::sample(&points, &triangles, options.mesh_spacing, options.seed, &mut warnings);
    }
    let finite: Vec<bool> = points.iter().map(|p| p.coords.iter().all(|c| c.is_finite())).collect();
    let kept_normals: Vec<Option<UnitVector3<f64>>> = normals
        .iter()
        .zip(&finite)
        .filter(|(_, keep)| **keep)
        .map(|(n, _)| UnitVector3::try_new(*n, 1e-6).filter(|n| n.iter().all(|c| c.is_finite())))
        .collect();
    let total = points.len();
    let mut keep = finite.iter();
    points.retain(|_| *keep.next().unwrap_or(&false));
    dropped += total - points.len();

    if points.len() < MIN_POINTS {
        let path = path.into();
        return Err(ScanError::TooFew { path, found: points.len(), dropped, needed: MIN_POINTS });
    }
    let extent = extent(&points);
    if extent <= 0.0 {
        return Err(ScanError::OnePlace { path: path.into(), count: points.len() });
    }
    if extent > METRE_EXTENT {
        warnings.push(ScanWarning::LooksLikeMillimetres { extent });
    }
    if dropped > 0 {
        warnings.push(ScanWarning::NonFinite { dropped });
    }
    // A single missing normal makes the file's normals unusable as a whole: a mixture of given
    // and estimated ones would not be oriented alike.
    let normals = (kept_normals.len() == points.len())
        .then(|| kept_normals.into_iter().collect::<Option<Vec<_>>>())
        .flatten();
    Ok(RawScan { points, normals, viewpoint, dropped, warnings })
}

/// The longest side of the bounding box.
fn extent(points: &[Point3<f64>]) -> f64 {
    let first = points[0].coords;
    let (lower, upper) =
        points.iter().fold((first, first), |(l, u), p| (l.inf(&p.coords), u.sup(&p.coords)));
    (upper - lower).max()
}
