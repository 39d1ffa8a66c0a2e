//! STL and OBJ meshes.

use std::collections::HashMap;

use nalgebra::Point3;

use super::decode::{decode, number, without_bom};
use super::error::{Malformed, Place, malformed};
use super::parsed::Parsed;
use super::warning::ScanWarning;

/// Reads an STL mesh, ascii or binary.
pub(super) fn parse_stl(bytes: &[u8]) -> Result<Parsed, Malformed> {
    const HEADER: usize = 84;
    const FACET: usize = 50;
    let announced = bytes.get(80..HEADER).map(|n| u32::from_le_bytes([n[0], n[1], n[2], n[3]]));
    // Some binary files begin with "solid" too, so the length decides.
    let needed = announced.and_then(|n| (n as usize).checked_mul(FACET)?.checked_add(HEADER));
    let whole = needed == Some(bytes.len());
    let text = without_bom(bytes).trim_ascii_start();
    let ascii = text.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"))
        && !bytes.contains(&0);
    if !whole && ascii {
        return parse_ascii_stl(bytes);
    }
    let Some(needed) = needed.filter(|&n| n > HEADER && n <= bytes.len()) else {
        let cause = match announced {
            Some(count) => format!(
                "{count} facets of {FACET} bytes after the header do not make a file of {} bytes",
                bytes.len()
            ),
            None => "too short for a binary STL, and an ascii one begins with \"solid\"".into(),
        };
        return malformed(Place::Byte(bytes.len().min(80)), cause);
    };
    let mut mesh = Soup::default();
    for facet in bytes[HEADER..needed].chunks_exact(FACET) {
        let number = |i: usize| {
            let at = 12 + 4 * i;
            f32::from_le_bytes([facet[at], facet[at + 1], facet[at + 2], facet[at + 3]])
        };
        mesh.triangle([0, 3, 6].map(|i| [number(i), number(i + 1), number(i + 2)]));
    }
    if !whole {
        let place = Place::Byte(needed);
        mesh.parsed.warnings.push(ScanWarning::TrailingData { place });
    }
    Ok(mesh.parsed)
}

fn parse_ascii_stl(bytes: &[u8]) -> Result<Parsed, Malformed> {
    let mut mesh = Soup::default();
    let mut corners = Vec::with_capacity(3);
    let mut in_facet = false;
    let mut closed = false;
    let mut line = 0;
    let content = decode(bytes, &mut mesh.parsed.warnings)?;
    for text in content.lines() {
        line += 1;
        let mut tokens = text.split_ascii_whitespace();
        let word = tokens.next().map(str::to_ascii_lowercase);
        match word.as_deref() {
            Some("solid") => closed = false,
            Some("facet") => in_facet = true,
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
            Some("endfacet") => in_facet = false,
            Some("endsolid") => closed = true,
            _ => {}
        }
    }
    if in_facet || !corners.is_empty() {
        return malformed(Place::Line(line), "the file ends within a facet, before endsolid");
    }
    if !closed {
        mesh.parsed.warnings.push(ScanWarning::NoEnd);
    }
    Ok(mesh.parsed)
}

/// Reads the vertices and faces of an OBJ file; without faces it is a point cloud.
pub(super) fn parse_obj(bytes: &[u8]) -> Result<Parsed, Malformed> {
    let mut parsed = Parsed::default();
    let mut corners = Vec::new();
    let content = decode(bytes, &mut parsed.warnings)?;
    // A statement that goes on in the next line ends with a backslash.
    let mut begun = String::new();
    for (index, text) in content.lines().enumerate() {
        let place = Place::Line(index + 1);
        let whole;
        let text = match text.trim_end().strip_suffix('\\') {
            Some(part) => {
                begun += part;
                begun.push(' ');
                continue;
            }
            None if begun.is_empty() => text,
            None => {
                whole = std::mem::take(&mut begun) + text;
                &whole
            }
        };
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
    if !begun.is_empty() {
        let last = Place::Line(content.lines().count());
        return malformed(last, "the file ends within a statement: its last line has a backslash");
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
    for (i, value) in values.iter_mut().enumerate() {
        let Some(token) = tokens.next() else {
            return malformed(place, format!("a vertex of {i} numbers where three are needed"));
        };
        *value = number(token)
            .ok_or_else(|| Malformed { place, cause: format!("{token:?} is not a number") })?;
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

#[cfg(test)]
mod tests {
    use std::path::Path;

    use nalgebra::Vector3;

    use super::super::sample::MAX_SAMPLES;
    use super::super::{Format, RawScan, ReadOptions, ScanError, ScanWarning, read_bytes};

    /// The corners and outward triangles of a box of 0.3 × 0.2 × 0.1 m.
    fn brick() -> (Vec<[f32; 3]>, Vec<[usize; 3]>) {
        let corner =
            |i: usize| [0.3 * (i & 1) as f32, 0.2 * (i >> 1 & 1) as f32, 0.1 * (i >> 2) as f32];
        let quads =
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        ((0..8).map(corner).collect(), triangles)
    }

    fn read(bytes: &[u8], format: Format) -> Result<RawScan, ScanError> {
        read_bytes(bytes, format, Path::new("brick"), &ReadOptions::default())
    }

    fn check(raw: &RawScan) {
        let area = 2.0 * (0.3 * 0.2 + 0.3 * 0.1 + 0.2 * 0.1);
        let expected = area / 0.003f64.powi(2);
        let count = raw.points.len() as f64;
        assert!((count - expected).abs() <= 2.0, "{count} points, {expected} expected");
        let normals = raw.normals.as_ref().expect("faces have normals");
        let mut top = 0;
        for (p, n) in raw.points.iter().zip(normals) {
            let size = Vector3::new(0.3, 0.2, 0.1);
            let outermost = (0..3).any(|axis| {
                let outside = if n[axis] > 0.5 { size[axis] } else { 0.0 };
                n[axis].abs() > 0.999 && (p[axis] - outside).abs() < 1e-6
            });
            assert!(outermost, "{p} with normal {n:?}");
            top += usize::from(n.z > 0.5);
        }
        let share = top as f64 / count;
        assert!((share - 0.06 / area).abs() < 0.005, "{share} of the points are on top");
    }

    #[test]
    fn one_brick_comes_out_of_every_mesh_format() {
        let (corners, triangles) = brick();
        let mut ascii = String::from("solid brick\n");
        let mut binary = vec![b' '; 80];
        binary.extend((triangles.len() as u32).to_le_bytes());
        let mut obj = String::from("# brick\n");
        let mut ply = format!(
            "ply\nformat ascii 1.0\nelement face {}\nproperty list uchar int vertex_indices\n\
             element vertex 8\nproperty float x\nproperty float y\nproperty float z\nend_header\n",
            triangles.len()
        );
        for [a, b, c] in &triangles {
            ascii += "facet normal 0 0 0\nouter loop\n";
            binary.extend([0; 12]);
            for corner in [a, b, c] {
                let [x, y, z] = corners[*corner];
                ascii += &format!("vertex {x} {y} {z}\n");
                binary.extend([x, y, z].iter().flat_map(|v| v.to_le_bytes()));
            }
            ascii += "endloop\nendfacet\n";
            binary.extend([0; 2]);
            ply += &format!("3 {a} {b} {c}\n");
        }
        ascii += "endsolid brick\n";
        for [x, y, z] in &corners {
            obj += &format!("v {x} {y} {z}\n");
            ply += &format!("{x} {y} {z}\n");
        }
        for [a, b, c] in &triangles {
            obj += &format!("f {}/1 {}//2 -{}\n", a + 1, b + 1, corners.len() - c);
        }
        check(&read(ascii.as_bytes(), Format::Stl).unwrap());
        check(&read(&binary, Format::Stl).unwrap());
        check(&read(obj.as_bytes(), Format::Obj).unwrap());
        check(&read(ply.as_bytes(), Format::Ply).unwrap());

        let cut = read(&binary[..binary.len() - 1], Format::Stl).unwrap_err().to_string();
        assert!(cut.starts_with("brick: byte 80: 12 facets of 50 bytes"), "{cut}");
        let cut = read(&ascii.as_bytes()[..ascii.len() - 20], Format::Stl).unwrap_err();
        assert!(cut.to_string().contains("endsolid"), "{cut}");
        let wild = obj.replace("f 1/1", "f 9/1");
        let error = read(wild.as_bytes(), Format::Obj).unwrap_err().to_string();
        assert!(error.starts_with("brick: line 10: \"9/1\" names none of 8"), "{error}");
    }

    #[test]
    fn a_seed_gives_the_same_samples_and_a_large_mesh_is_thinned() {
        let obj = b"v 0 0 0\nv 20 0 0\nv 20 20 0\nf 1 2 3\n";
        let first = read(obj, Format::Obj).unwrap();
        assert_eq!(first, read(obj, Format::Obj).unwrap());
        assert_eq!(first.points.len(), MAX_SAMPLES as usize);
        let widened = |w: &ScanWarning| matches!(w, ScanWarning::SpacingWidened { .. });
        assert!(first.warnings.iter().any(widened));
    }
}
