//! Reading a scan file of any supported format.

use std::path::Path;

use nalgebra::{Point3, UnitVector3, Vector3};

use super::cloud::MIN_POINTS;
use super::error::{Malformed, ScanError};
use super::parsed::Parsed;
use super::raw::RawScan;
use super::warning::ScanWarning;
use super::{
    decode, e57, faces, foreign, gltf, inside, las, mesh, npy, pcd, ply, ptx, sample, stray, text,
    winding,
};

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
    /// Meshes in a tree of nodes: text with buffers, or binary.
    Gltf,
    /// A lidar's points, plain or compressed.
    Las,
    /// A terrestrial scanner's scans with their poses, binary.
    E57,
    /// The same as text.
    Ptx,
    /// A NumPy array.
    Npy,
    /// A point a line: numbers apart by blanks, tabs, commas or semicolons, columns named or not.
    Text,
}

/// How binary files begin.
const MAGIC: [(&[u8], Format); 4] = [
    (b"glTF", Format::Gltf),
    (b"LASF", Format::Las),
    (b"ASTM-E57", Format::E57),
    (b"\x93NUMPY", Format::Npy),
];

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
            Some("gltf" | "glb") => Some(Self::Gltf),
            Some("las" | "laz") => Some(Self::Las),
            Some("e57") => Some(Self::E57),
            Some("ptx") => Some(Self::Ptx),
            Some("npy") => Some(Self::Npy),
            Some("xyz" | "csv" | "txt" | "asc" | "pts") => Some(Self::Text),
            _ => {
                let head = decode::without_bom(bytes);
                if head.starts_with(b"ply") {
                    Some(Self::Ply)
                } else if head.starts_with(b"# .PCD") || head.starts_with(b"VERSION") {
                    Some(Self::Pcd)
                } else {
                    let begins = |(magic, format): &(&[u8], Self)| {
                        bytes.starts_with(magic).then_some(*format)
                    };
                    MAGIC.iter().find_map(begins)
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
    let Some(format) = Format::detect(path, &bytes) else {
        return Err(match foreign::detect(path, &bytes) {
            Some((format, convert)) => ScanError::Foreign { path: path.into(), format, convert },
            None => ScanError::UnknownFormat { path: path.into() },
        });
    };
    read_bytes(&bytes, format, path, options)
}

/// Reads a scan from bytes in memory; `path` names the scan in errors, and what a glTF file keeps in
/// other files lies beside it.
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
        Format::Gltf => gltf::parse(bytes, path),
        Format::Las => las::parse(bytes),
        Format::E57 => e57::parse(bytes),
        Format::Ptx => ptx::parse(bytes),
        Format::Npy => npy::parse(bytes),
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
    let Parsed { mut points, mut normals, mut colours, triangles, .. } = parsed;
    let Parsed { mut viewpoint, mut sensor, mut warnings, .. } = parsed;
    let scale = scale(options.scale, &mut warnings);
    for p in &mut points {
        p.coords *= scale;
    }
    if let Some(pose) = &mut viewpoint {
        pose.translation.vector *= scale;
    }
    if let Some(at) = &mut sensor {
        at.coords *= scale;
    }
    let (mut dropped, mut inside) = (0, Vec::new());
    let (mut vertices, mut on_faces) = (Vec::new(), Vec::new());
    if !triangles.is_empty() {
        sensor = None;
        unused(points.len(), &triangles, &mut warnings);
        let wound = winding::outward(&points, triangles, &mut warnings);
        inside = inside::fill(&points, &wound, &mut warnings);
        let corners = wound.triangles.iter().flatten();
        let mut used = vec![false; points.len()];
        corners.for_each(|&corner| used[corner] = true);
        vertices = points;
        on_faces = faces::places(&vertices, &wound, options.mesh_spacing);
        colours.clear();
        (points, normals, dropped) =
            sample::sample(&vertices, &wound, options.mesh_spacing, options.seed, &mut warnings);
        let mut used = used.into_iter();
        vertices.retain(|p| used.next() == Some(true) && p.iter().all(|c| c.is_finite()));
    }
    let finite: Vec<bool> = points.iter().map(|p| p.coords.iter().all(|c| c.is_finite())).collect();
    let mut keep =
        |points: &mut Vec<Point3<f64>>, normals: &mut Vec<Vector3<f64>>, flags: &[bool]| {
            retain(&mut colours, flags);
            retain(normals, flags);
            let before = points.len();
            retain(points, flags);
            before - points.len()
        };
    dropped += keep(&mut points, &mut normals, &finite);

    let zero = |p: &Point3<f64>| p.coords.iter().all(|c| *c == 0.0);
    let zeros = points.iter().filter(|p| zero(p)).count();
    if zeros >= MIN_POINTS && zeros < points.len() {
        let seen: Vec<bool> = points.iter().map(|p| !zero(p)).collect();
        keep(&mut points, &mut normals, &seen);
        warnings.push(ScanWarning::AtOrigin { dropped: zeros });
    }
    if let Some(strays) = stray::find(&points) {
        let near: Vec<bool> = strays.flags.iter().map(|stray| !stray).collect();
        keep(&mut points, &mut normals, &near);
        warnings.push(ScanWarning::Stray {
            dropped: strays.count,
            farthest: strays.farthest.into(),
            distance: strays.distance,
        });
    }

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
    let unit =
        |n: Vector3<f64>| UnitVector3::try_new(n, 1e-6).filter(|n| n.iter().all(|c| c.is_finite()));
    let normals = (normals.len() == points.len())
        .then(|| normals.into_iter().map(unit).collect::<Option<Vec<_>>>())
        .flatten();
    let colours = Some(colours).filter(|colours| colours.len() == points.len());
    let faces = on_faces;
    Ok(RawScan {
        points,
        vertices,
        normals,
        colours,
        faces,
        inside,
        viewpoint,
        sensor,
        dropped,
        warnings,
    })
}

/// Tells of a mesh's vertices that are in none of its faces, as points and lines beside them are.
fn unused(vertices: usize, triangles: &[[usize; 3]], warnings: &mut Vec<ScanWarning>) {
    let mut used = vec![false; vertices];
    triangles.iter().flatten().for_each(|&corner| used[corner] = true);
    let points = used.iter().filter(|used| !**used).count();
    if points > 0 {
        warnings.push(ScanWarning::NoFace { points });
    }
}

/// The factor to metres: the user's, else 1, as what the columns say is in the points by now.
fn scale(asked: f64, warnings: &mut Vec<ScanWarning>) -> f64 {
    let stated = warnings.iter().position(|w| matches!(w, ScanWarning::Unit { .. }));
    let Some(at) = stated.filter(|_| asked != 1.0) else { return asked };
    let ScanWarning::Unit { unit, factor } = warnings.remove(at) else { return asked };
    warnings.push(ScanWarning::UnitOverruled { unit, scale: asked });
    asked / factor
}

/// Keeps what is flagged of a list that runs parallel to the flags; any other stays as it is.
fn retain<T>(list: &mut Vec<T>, flags: &[bool]) {
    if list.len() == flags.len() {
        let mut flag = flags.iter();
        list.retain(|_| *flag.next().unwrap_or(&false));
    }
}

/// The longest side of the bounding box.
fn extent(points: &[Point3<f64>]) -> f64 {
    let first = points[0].coords;
    let (lower, upper) =
        points.iter().fold((first, first), |(l, u), p| (l.inf(&p.coords), u.sup(&p.coords)));
    (upper - lower).max()
}
