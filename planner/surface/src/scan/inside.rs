//! What closed meshes enclose is solid: places all through it, between which nothing of a robot fits.

use nalgebra::Point3;

use super::winding::Wound;

/// How far apart they are, but for solids of more than some cubic metres. \[m\]
const APART: f64 = 0.02;
/// How far its lines are off the middles of its cells along x and y, by its step.
const ASIDE: [f64; 2] = [1.7e-4, 1e-4];
/// Most places in one file.
const MOST: f64 = 500_000.0;

/// Places inside the closed pieces of a mesh, on a grid; none in a hollow, whose wall looks into it.
pub(super) fn fill(vertices: &[Point3<f64>], wound: &Wound) -> Vec<Point3<f64>> {
    let faces: Vec<[Point3<f64>; 3]> = wound
        .triangles
        .iter()
        .zip(wound.turned.iter().zip(&wound.closed))
        .filter(|(_, (_, closed))| **closed)
        .map(|(corners, (turned, _))| {
            let [a, b, c] = corners.map(|i| vertices[i]);
            if *turned { [a, c, b] } else { [a, b, c] }
        })
        .filter(|corners| corners.iter().all(|p| p.iter().all(|x| x.is_finite())))
        .collect();
    let Some(first) = faces.first() else { return Vec::new() };
    let (mut low, mut high) = (first[0], first[0]);
    for p in faces.iter().flatten() {
        (low, high) = (low.inf(p), high.sup(p));
    }
    let size = high - low;
    let apart = APART.max((size.x * size.y * size.z / MOST).cbrt());
    if !apart.is_finite() {
        return Vec::new();
    }
    // Upright lines through the middles of a grid's cells, a little aside, along x more than along y:
    // no mesh that people draw has its edges or its diagonals there.
    let line = |axis: usize, k: usize| low[axis] + (k as f64 + 0.5 + ASIDE[axis]) * apart;
    let [columns, rows] = [0, 1].map(|axis| (size[axis] / apart).ceil() as usize);
    let range = |least: f64, most: f64, axis: usize, count: usize| {
        let first = ((least - low[axis]) / apart - 0.6).max(0.0) as usize;
        let end = ((most - low[axis]) / apart + 0.6).max(0.0) as usize;
        first..end.min(count)
    };
    // Where a line meets a face: the column, the height, and whether it goes in there.
    let mut met: Vec<(usize, f64, bool)> = Vec::new();
    for [a, b, c] in &faces {
        let (min, max) = (a.inf(b).inf(c), a.sup(b).sup(c));
        let (u, v) = (b - a, c - a);
        let area = u.x * v.y - u.y * v.x;
        if area == 0.0 {
            continue;
        }
        for column in range(min.x, max.x, 0, columns) {
            for row in range(min.y, max.y, 1, rows) {
                let (x, y) = (line(0, column) - a.x, line(1, row) - a.y);
                let s = (x * v.y - y * v.x) / area;
                let t = (u.x * y - u.y * x) / area;
                if s >= 0.0 && t >= 0.0 && s + t < 1.0 {
                    met.push((row * columns + column, a.z + s * u.z + t * v.z, area < 0.0));
                }
            }
        }
    }
    met.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut places = Vec::new();
    for column in met.chunk_by(|a, b| a.0 == b.0) {
        let (x, y) = (line(0, column[0].0 % columns), line(1, column[0].0 / columns));
        let mut depth = 0;
        for pair in column.windows(2) {
            depth += if pair[0].2 { 1 } else { -1 };
            let (from, to) = (pair[0].1, pair[1].1);
            let count = if depth > 0 { ((to - from) / apart) as usize } else { 0 };
            let first = 0.5 * (from + to - count.saturating_sub(1) as f64 * apart);
            places.extend((0..count).map(|k| Point3::new(x, y, first + k as f64 * apart)));
        }
    }
    places
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::{Format, RawScan, ReadOptions, read_bytes};

    /// A box in the words of an OBJ file, its faces looking inwards if `hollow`; without its lid if
    /// `open`.
    fn brick(low: f64, high: f64, before: usize, hollow: bool, open: bool) -> String {
        let at = |bit: usize| if bit == 1 { high } else { low };
        let corner = |i: usize| format!("v {} {} {}\n", at(i & 1), at(i >> 1 & 1), at(i >> 2));
        let quads =
            [[4, 5, 7, 6], [0, 2, 3, 1], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let face = |quad: &[usize; 4]| {
            let mut quad = quad.map(|i| (i + 1 + before).to_string());
            if hollow {
                quad.reverse();
            }
            format!("f {}\n", quad.join(" "))
        };
        (0..8).map(corner).chain(quads[usize::from(open)..].iter().map(face)).collect()
    }

    fn read(text: &str) -> RawScan {
        read_bytes(text.as_bytes(), Format::Obj, Path::new("brick"), &ReadOptions::default())
            .expect("a mesh")
    }

    #[test]
    fn a_closed_mesh_is_full_and_a_hollow_or_open_one_is_not() {
        let full = read(&brick(-0.2, 0.2, 0, false, false)).inside;
        assert_eq!(full.len(), 20 * 20 * 20);
        assert!(full.iter().all(|p| p.iter().all(|x| x.abs() < 0.195)));
        let near = |x: f64| full.iter().any(|p| (p.coords.add_scalar(-x)).amax() < 0.011);
        assert!((-18..=18).all(|k| near(0.01 * f64::from(k))));

        let walls = brick(-0.2, 0.2, 0, false, false) + &brick(-0.1, 0.1, 8, true, false);
        let walls = read(&walls).inside;
        assert_eq!(walls.len(), 20 * 20 * 20 - 10 * 10 * 10);
        assert!(walls.iter().all(|p| p.coords.amax() > 0.1));

        assert!(read(&brick(-0.2, 0.2, 0, false, true)).inside.is_empty());
    }
}
