//! Sampling a mesh into points.

use nalgebra::{Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::warning::ScanWarning;
use super::winding::Wound;

/// Most points sampled on one mesh; cleaning keeps a fifth of them.
pub(super) const MAX_SAMPLES: f64 = 300_000.0;

/// Points with outward normals, spread evenly at random over the faces: `1 / spacing²` for each
/// square metre. Returns also how many faces were dropped as not finite.
pub(super) fn sample(
    vertices: &[Point3<f64>],
    wound: &Wound,
    spacing: f64,
    seed: u64,
    warnings: &mut Vec<ScanWarning>,
) -> (Vec<Point3<f64>>, Vec<Vector3<f64>>, usize) {
    let mut faces = Vec::with_capacity(wound.triangles.len());
    let mut cumulative = Vec::with_capacity(wound.triangles.len());
    let mut area = 0.0;
    let mut dropped = 0;
    for (corners, turned) in wound.triangles.iter().zip(&wound.turned) {
        let [a, b, c] = corners.map(|corner| vertices[corner]);
        let twice = (b - a).cross(&(c - a));
        let norm = twice.norm();
        if !norm.is_finite() {
            dropped += 1;
        } else if norm > 0.0 {
            area += 0.5 * norm;
            let outward = if *turned { -norm } else { norm };
            faces.push((a, b - a, c - a, twice / outward));
            cumulative.push(area);
        }
    }
    if !area.is_finite() || area <= 0.0 {
        return (Vec::new(), Vec::new(), dropped);
    }
    let mut wanted = area / spacing.powi(2);
    if wanted > MAX_SAMPLES {
        wanted = MAX_SAMPLES;
        warnings.push(ScanWarning::SpacingWidened { spacing: (area / wanted).sqrt() });
    }
    let count = wanted.ceil() as usize;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
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
