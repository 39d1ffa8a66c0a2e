//! What closed meshes enclose is solid: places all through it, between which nothing of a robot fits.

use nalgebra::Point3;

use super::warning::ScanWarning;
use super::winding::Wound;

/// How far apart they are, but for solids of more than four cubic metres. \[m\]
const APART: f64 = 0.02;
/// How far its lines are off the middles of its cells along x and y, by its step.
const ASIDE: [f64; 2] = [1.7e-4, 1e-4];
/// Most places in one file.
const MOST: f64 = 500_000.0;

/// Most lines on which they are found: a large sheet encloses little.
const LINES: f64 = 4_000_000.0;

/// Places inside the closed pieces of a mesh, on a grid; none in a hollow, whose wall looks into it.
pub(super) fn fill(
    vertices: &[Point3<f64>],
    wound: &Wound,
    warnings: &mut Vec<ScanWarning>,
) -> Vec<Point3<f64>> {
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
    let [volume, shade] = volume_and_shade(&faces, first[0]);
    let apart = APART.max(libm::cbrt(volume / MOST)).max((shade / LINES).sqrt());
    // A line's number would leave its range.
    if !apart.is_finite() || size.amax() / apart > f64::from(u32::MAX) {
        return Vec::new();
    }
    if apart > APART {
        warnings.push(ScanWarning::FilledWide { apart });
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

/// What the faces enclose \[m³\], and what they cover as seen from above \[m²\].
fn volume_and_shade(faces: &[[Point3<f64>; 3]], origin: Point3<f64>) -> [f64; 2] {
    faces.iter().fold([0.0; 2], |[volume, shade], [a, b, c]| {
        let twice = (b - a).cross(&(c - a));
        [volume + (a - origin).dot(&twice) / 6.0, shade + 0.25 * twice.z.abs()]
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::{Format, RawScan, ReadOptions, ScanWarning, read_bytes};
    use super::{APART, MOST};

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

    #[test]
    fn small_things_far_apart_are_filled_as_closely_as_one_alone() {
        // Sides that are exact wherever the thing stands.
        let alone = brick(-0.0625, 0.0625, 0, false, false);
        let away: String = brick(-0.0625, 0.0625, 8, false, false)
            .lines()
            .map(|line| match line.split(' ').collect::<Vec<_>>()[..] {
                ["v", x, y, z] => {
                    let [x, y, z] = [x, y, z].map(|c| c.parse::<f64>().expect("a number"));
                    format!("v {} {} {}\n", x + 6.0, y + 5.0, z + 2.0)
                }
                _ => format!("{line}\n"),
            })
            .collect();
        let both = read(&(alone + &away));
        assert_eq!(both.inside.len(), 2 * 6 * 6 * 6);
        assert_eq!(both.warnings, []);
    }

    #[test]
    fn where_much_is_enclosed_it_is_told_how_wide_apart_the_places_lie() {
        let hall = read(&brick(-2.0, 2.0, 0, false, false));
        let apart = libm::cbrt(64.0 / MOST);
        assert!(apart > APART);
        let told: Vec<_> =
            hall.warnings.iter().filter(|w| matches!(w, ScanWarning::FilledWide { .. })).collect();
        let [ScanWarning::FilledWide { apart: found }] = told[..] else { panic!("{told:?}") };
        assert!((found - apart).abs() < 1e-9);
        let count = hall.inside.len() as f64;
        assert!((0.95 * MOST..1.05 * MOST).contains(&count), "{count}");
    }

    /// A room in which a thing stands, drawn as it is seen from within.
    #[test]
    fn what_looks_inwards_is_a_room_and_not_full() {
        let room = read(&brick(-1.0, 1.0, 0, true, false));
        assert!(room.inside.is_empty());
        let faces = 12;
        assert!(room.warnings.contains(&ScanWarning::LooksInwards { faces, of: 12 }));
        let furnished = brick(-1.0, 1.0, 0, true, false) + &brick(-0.1, 0.1, 8, false, false);
        let furnished = read(&furnished);
        assert_eq!(furnished.inside.len(), 10 * 10 * 10);
        assert!(furnished.inside.iter().all(|p| p.coords.amax() < 0.1));
        assert!(furnished.warnings.contains(&ScanWarning::LooksInwards { faces, of: 24 }));
        // Faces wound this way and that say nothing.
        let mut mixed: Vec<String> =
            brick(-0.2, 0.2, 0, false, false).lines().map(Into::into).collect();
        let inwards = brick(-0.2, 0.2, 0, true, false);
        mixed[8] = inwards.lines().nth(8).unwrap().into();
        let mixed = read(&(mixed.join("\n") + "\n"));
        assert_eq!(mixed.inside.len(), 20 * 20 * 20);
    }
}
