//! STL and OBJ meshes, and sampling any mesh into points.

use std::collections::HashMap;

use nalgebra::{Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::error::{Malformed, Place, ScanWarning, malformed};
use super::read::{Parsed, ReadOptions};
use super::text::{as_text, without_bom};

/// Most points sampled on one mesh; cleaning keeps a fifth of them.
const MAX_SAMPLES: f64 = 300_000.0;

/// Points with normals, spread evenly at random over the faces: `1 / spacing²` for each square
/// metre. Returns also how many faces were dropped as not finite.
pub(super) fn sample(
    vertices: &[Point3<f64>],
    triangles: &[[usize; 3]],
    options: &ReadOptions,
    warnings: &mut Vec<ScanWarning>,
) -> (Vec<Point3<f64>>, Vec<Vector3<f64>>, usize) {
    let mut faces = Vec::with_capacity(triangles.len());
    let mut cumulative = Vec::with_capacity(triangles.len());
    let mut area = 0.0;
    let mut dropped = 0;
    for corners in triangles {
        let [a, b, c] = corners.map(|corner| vertices[corner]);
        let twice = (b - a).cross(&(c - a));
        let norm = twice.norm();
        if !norm.is_finite() {
            dropped += 1;
        } else if norm > 0.0 {
            area += 0.5 * norm;
            faces.push((a, b - a, c - a, twice / norm));
            cumulative.push(area);
        }
    }
    if !area.is_finite() || area <= 0.0 {
        return (Vec::new(), Vec::new(), dropped);
    }
    let mut wanted = area / options.mesh_spacing.powi(2);
    if wanted > MAX_SAMPLES {
        wanted = MAX_SAMPLES;
        warnings.push(ScanWarning::SpacingWidened { spacing: (area / wanted).sqrt() });
    }
    let count = wanted.ceil() as usize;
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
    let mut points = Vec::with_capacity(count);
    let mut normals = Vec::with_capacity(count);
    let mut face = 0;
    for i in 0..count {
        // One sample in each of `count` equal strata of the area: more even than drawing faces.
        let at = (i as f64 + rng.random::<f64>()) / count as f64 * area;
        while face + 1 < faces.len() && cumulative[face] < at {
            face += 1;
        }
        let (origin, u, v, normal) = faces[face];
        let (mut s, mut t) = (rng.random::<f64>(), rng.random::<f64>());
        if s + t > 1.0 {
            (s, t) = (1.0 - s, 1.0 - t);
        }
        points.push(origin + u * s + v * t);
        normals.push(normal);
    }
    (points, normals, dropped)
}

/// Reads an STL mesh, ascii or binary.
pub(super) fn parse_stl(bytes: &[u8]) -> Result<Parsed, Malformed> {
    const HEADER: usize = 84;
    const FACET: usize = 50;
    let announced = bytes.get(80..HEADER).map(|n| u32::from_le_bytes([n[0], n[1], n[2], n[3]]));
    // Some binary files begin with "solid" too, so the length decides.
    if let Some(count) = announced
        && (count as usize).checked_mul(FACET).and_then(|n| n.checked_add(HEADER))
            == Some(bytes.len())
    {
        let mut mesh = Soup::default();
        for facet in bytes[HEADER..].chunks_exact(FACET) {
            let number = |i: usize| {
                let at = 12 + 4 * i;
                f32::from_le_bytes([facet[at], facet[at + 1], facet[at + 2], facet[at + 3]])
            };
            mesh.triangle([0, 3, 6].map(|i| [number(i), number(i + 1), number(i + 2)]));
        }
        return Ok(mesh.parsed);
    }
    if !without_bom(bytes).trim_ascii_start().starts_with(b"solid") {
        let cause = match announced {
            Some(count) => format!(
                "{count} facets of {FACET} bytes after the header do not make a file of {} bytes",
                bytes.len()
            ),
            None => "too short for a binary STL, and an ascii one begins with \"solid\"".into(),
        };
        return malformed(Place::Byte(bytes.len().min(80)), cause);
    }
    parse_ascii_stl(bytes)
}

fn parse_ascii_stl(bytes: &[u8]) -> Result<Parsed, Malformed> {
    let mut mesh = Soup::default();
    let mut corners = Vec::with_capacity(3);
    let mut closed = false;
    let mut line = 0;
    for text in as_text(without_bom(bytes))?.lines() {
        line += 1;
        let mut tokens = text.split_ascii_whitespace();
        match tokens.next() {
            Some("vertex") => {
                corners.push(numbers(&mut tokens, Place::Line(line))?.map(|v| v as f32))
            }
            Some("endloop") => {
                let Ok(triangle) = <[[f32; 3]; 3]>::try_from(corners.as_slice()) else {
                    let cause = format!("a facet of {} corners", corners.len());
                    return malformed(Place::Line(line), cause);
                };
                mesh.triangle(triangle);
                corners.clear();
            }
            Some("endsolid") => closed = true,
            _ => {}
        }
    }
    if !closed {
        return malformed(Place::Line(line), "the file ends before endsolid");
    }
    Ok(mesh.parsed)
}

/// Reads the vertices and faces of an OBJ file; without faces it is a point cloud.
pub(super) fn parse_obj(bytes: &[u8]) -> Result<Parsed, Malformed> {
    let mut parsed = Parsed::default();
    let mut corners = Vec::new();
    for (index, text) in as_text(without_bom(bytes))?.lines().enumerate() {
        let place = Place::Line(index + 1);
        let mut tokens = text.split_ascii_whitespace();
        match tokens.next() {
            Some("v") => parsed.points.push(Point3::from(numbers(&mut tokens, place)?)),
            Some("f") => {
                corners.clear();
                for token in tokens {
                    corners.push(corner(token, parsed.points.len(), place)?);
                }
                if corners.len() < 3 {
                    return malformed(place, format!("a face of {} corners", corners.len()));
                }
                for pair in corners.windows(2).skip(1) {
                    parsed.triangles.push([corners[0], pair[0], pair[1]]);
                }
            }
            _ => {}
        }
    }
    Ok(parsed)
}

/// A face's corner `v`, `v/vt` or `v/vt/vn`: counted from 1, or from the end if negative.
fn corner(token: &str, vertices: usize, place: Place) -> Result<usize, Malformed> {
    let number: Option<i64> = token.split('/').next().and_then(|v| v.parse().ok());
    let index = match number {
        Some(n) if n > 0 => usize::try_from(n - 1).ok(),
        Some(n) if n < 0 => {
            usize::try_from(n.unsigned_abs()).ok().and_then(|back| vertices.checked_sub(back))
        }
        _ => None,
    };
    match index.filter(|&i| i < vertices) {
        Some(index) => Ok(index),
        None => malformed(place, format!("{token:?} names none of {vertices} vertices")),
    }
}

fn numbers<'a>(
    tokens: &mut impl Iterator<Item = &'a str>,
    place: Place,
) -> Result<[f64; 3], Malformed> {
    let mut values = [0.0; 3];
    for value in &mut values {
        let Some(token) = tokens.next() else {
            return malformed(place, "a vertex needs three numbers");
        };
        *value =
            token.parse().or_else(|_| malformed(place, format!("{token:?} is not a number")))?;
    }
    Ok(values)
}

/// Triangles without shared corners, as STL holds them; equal corners are merged.
#[derive(Default)]
struct Soup {
    parsed: Parsed,
    index: HashMap<[u32; 3], usize>,
}

impl Soup {
    fn triangle(&mut self, corners: [[f32; 3]; 3]) {
        let triangle = corners.map(|corner| {
            *self.index.entry(corner.map(f32::to_bits)).or_insert_with(|| {
                self.parsed.points.push(Point3::from(corner.map(f64::from)));
                self.parsed.points.len() - 1
            })
        });
        self.parsed.triangles.push(triangle);
    }
}
