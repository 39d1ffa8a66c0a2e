//! Which side of a mesh is its outside. Files hold faces wound inwards, wound as it came, and
//! twice, once for each side.

use std::collections::{HashMap, HashSet};

use nalgebra::{Point3, Vector3};

use super::pieces::{Piece, pieces};
use super::warning::ScanWarning;

/// The faces of a mesh, and which of them are to be turned round.
pub(super) struct Wound {
    pub(super) triangles: Vec<[usize; 3]>,
    pub(super) turned: Vec<bool>,
    /// Which faces are of pieces that enclose something solid and know their outside.
    pub(super) closed: Vec<bool>,
}

/// Leaves out faces that cover others, and finds the outside of each connected piece: a closed one
/// encloses a volume; of an open one, that side which is seen from around and above, if it is seen
/// by far most. Else, and inside other pieces, faces stay as most of the piece is wound; that is
/// told where the shape does not bear it out. A closed piece all of which looks inwards, in no
/// other, is a room's wall as well as a thing inside out: it encloses nothing solid.
pub(super) fn outward(
    vertices: &[Point3<f64>],
    triangles: Vec<[usize; 3]>,
    warnings: &mut Vec<ScanWarning>,
) -> Wound {
    let of = triangles.len();
    let triangles = once(vertices, triangles);
    let is_twofold = triangles.len() < of;
    if is_twofold {
        warnings.push(ScanWarning::TwiceCovered { faces: of - triangles.len(), of });
    }
    let of = triangles.len();
    let welded = weld(vertices, &triangles);
    let pieces = pieces(&welded);
    let faces = |piece: &Piece, turn: bool| -> Vec<[Point3<f64>; 3]> {
        let corner = |f: usize| triangles[f].map(|v| vertices[v]);
        let mut faces: Vec<_> = piece.faces.iter().map(|&(f, _)| corner(f)).collect();
        for (face, &(_, turned)) in faces.iter_mut().zip(&piece.faces) {
            if turned != turn {
                face.swap(1, 2);
            }
        }
        faces
    };
    let solids: Vec<Solid> =
        pieces.iter().filter(|p| p.closed).map(|p| Solid::new(faces(p, false))).collect();
    let (mut turned, mut closed) = (vec![false; of], vec![false; of]);
    let (mut unknown, mut inwards) = (0, 0);
    for piece in &pieces {
        // Most of the piece's area as the file has it.
        let as_given: f64 = piece
            .faces
            .iter()
            .zip(faces(piece, false))
            .map(|(&(_, turned), face)| if turned { -area(&face) } else { area(&face) })
            .sum();
        let given = as_given < 0.0;
        let shape = faces(piece, given);
        let verdict = if !piece.oriented {
            None
        } else if piece.closed {
            let inside = solids.iter().filter(|solid| solid.holds(&shape[0][0])).count();
            match (inside % 2 == 1, piece.mixed()) {
                (false, _) => encloses(&shape),
                // A piece in another may be the wall of a hollow or a thing in it.
                (true, mixed) => (!mixed).then_some(true),
            }
        } else {
            seen_outside(&shape)
        };
        if verdict.is_none() {
            unknown += piece.faces.len();
        }
        let turn = if verdict == Some(false) { !given } else { given };
        // Of faces that are there both ways, the first one says nothing.
        let is_room = piece.closed && verdict == Some(false) && !piece.mixed() && !is_twofold;
        if is_room {
            inwards += piece.faces.len();
        }
        for &(face, against) in &piece.faces {
            turned[face] = piece.oriented && (against != turn);
            closed[face] = piece.closed && verdict.is_some() && !is_room;
        }
    }
    let faces = turned.iter().filter(|&&t| t).count();
    if faces > 0 {
        warnings.push(ScanWarning::FacesTurned { faces, of });
    }
    if inwards > 0 {
        warnings.push(ScanWarning::LooksInwards { faces: inwards, of });
    }
    if unknown > 0 {
        warnings.push(ScanWarning::SideUnknown { faces: unknown, of });
    }
    Wound { triangles, turned, closed }
}

/// Each face once, whichever way round it is there again.
fn once(vertices: &[Point3<f64>], triangles: Vec<[usize; 3]>) -> Vec<[usize; 3]> {
    let welded = weld(vertices, &triangles);
    let mut seen = HashSet::with_capacity(triangles.len());
    let mut first = welded.iter().map(|corners| {
        let mut corners = *corners;
        corners.sort_unstable();
        seen.insert(corners)
    });
    triangles.into_iter().filter(|_| first.next().unwrap_or(true)).collect()
}

/// The faces' corners with vertices at one place taken for one.
fn weld(vertices: &[Point3<f64>], triangles: &[[usize; 3]]) -> Vec<[usize; 3]> {
    let mut first: HashMap<[u64; 3], usize> = HashMap::with_capacity(vertices.len());
    let same: Vec<usize> = vertices
        .iter()
        .enumerate()
        // A sum with 0 makes 0 of −0.
        .map(|(i, p)| *first.entry([p.x, p.y, p.z].map(|c| (c + 0.0).to_bits())).or_insert(i))
        .collect();
    triangles.iter().map(|corners| corners.map(|v| same[v])).collect()
}

fn doubled(&[a, b, c]: &[Point3<f64>; 3]) -> Vector3<f64> {
    (b - a).cross(&(c - a))
}

fn area(face: &[Point3<f64>; 3]) -> f64 {
    0.5 * doubled(face).norm()
}

/// Whether the volume that faces enclose is positive: they look outwards. `None` where they enclose
/// none.
fn encloses(faces: &[[Point3<f64>; 3]]) -> Option<bool> {
    let origin = faces[0][0];
    let volume: f64 =
        faces.iter().map(|f| (f[0] - origin).dot(&(f[1] - origin).cross(&(f[2] - origin)))).sum();
    let area: f64 = faces.iter().map(area).sum();
    (volume.abs() > 1e-6 * libm::pow(area, 1.5)).then_some(volume > 0.0)
}

fn bounds(faces: &[[Point3<f64>; 3]]) -> (Vector3<f64>, Vector3<f64>) {
    let infinite = Vector3::repeat(f64::INFINITY);
    let grow = |(l, u): (Vector3<f64>, Vector3<f64>), p: &Point3<f64>| {
        (l.inf(&p.coords), u.sup(&p.coords))
    };
    faces.iter().flatten().fold((infinite, -infinite), grow)
}

/// A closed piece.
struct Solid {
    faces: Vec<[Point3<f64>; 3]>,
    min: Vector3<f64>,
    max: Vector3<f64>,
}

impl Solid {
    fn new(faces: Vec<[Point3<f64>; 3]>) -> Self {
        let (min, max) = bounds(&faces);
        Self { faces, min, max }
    }

    /// Whether a point is in it, and not on it: a ray crosses it an odd number of times.
    fn holds(&self, point: &Point3<f64>) -> bool {
        if (0..3).any(|axis| !(self.min[axis] < point[axis] && point[axis] < self.max[axis])) {
            return false;
        }
        // Along no axis and no diagonal, so that it meets no edge of what people draw.
        let ray = Vector3::new(0.312_7, 0.548_3, 0.775_6);
        let crossed = |&&[a, b, c]: &&[Point3<f64>; 3]| {
            let (u, v, from) = (b - a, c - a, point - a);
            let across = ray.cross(&v);
            let scale = u.dot(&across);
            let other = from.cross(&u);
            let (s, t) = (from.dot(&across) / scale, ray.dot(&other) / scale);
            s >= 0.0 && t >= 0.0 && s + t <= 1.0 && v.dot(&other) / scale > 0.0
        };
        let own = self.faces.iter().flatten().any(|corner| corner == point);
        !own && self.faces.iter().filter(crossed).count() % 2 == 1
    }
}

/// Cells across an open piece in the pictures that are taken of it.
const PICTURE: f64 = 48.0;

/// Whether an open piece shows its front to who looks from around and above (true) or its back
/// (false); `None` where it shows some of both, as a sheet or a bowl does.
fn seen_outside(faces: &[[Point3<f64>; 3]]) -> Option<bool> {
    if faces.len() < 4 {
        return None;
    }
    let (min, max) = bounds(faces);
    let cell = (max - min).norm() / PICTURE;
    if !(cell > 0.0 && cell.is_finite()) {
        return None;
    }
    let mut seen = [0.0; 2];
    let mut below = [0.0; 2];
    for axis in 0..3 {
        for sign in [1.0, -1.0] {
            let into = if axis == 2 && sign < 0.0 { &mut below } else { &mut seen };
            let mut foremost: HashMap<[i64; 2], (f64, f64)> = HashMap::new();
            for face in faces {
                let normal = sign * doubled(face)[axis];
                over(face, cell, |point| {
                    let at = |other: usize| (point[(axis + other) % 3] / cell).floor() as i64;
                    let depth = sign * point[axis];
                    let first = foremost.entry([at(1), at(2)]).or_insert((depth, normal));
                    if depth > first.0 {
                        *first = (depth, normal);
                    }
                });
            }
            for (_, normal) in foremost.into_values() {
                into[usize::from(normal < 0.0)] += 1.0;
            }
        }
    }
    let lean = |[front, back]: [f64; 2]| (front - back) / f64::max(front + back, 1.0);
    let all = lean([seen[0] + below[0], seen[1] + below[1]]);
    let around = lean(seen);
    if around >= 0.5 && all >= 0.2 {
        Some(true)
    } else if around <= -0.5 && all <= -0.4 {
        Some(false)
    } else {
        None
    }
}

/// Visits points of a face, at most a cell apart.
fn over(&[a, b, c]: &[Point3<f64>; 3], cell: f64, mut visit: impl FnMut(&Point3<f64>)) {
    let (u, v) = (b - a, c - a);
    let longest = u.norm().max(v.norm()).max((c - b).norm());
    let steps = (longest / (0.7 * cell)).ceil().clamp(1.0, 4.0 * PICTURE) as u32;
    for i in 0..steps {
        for j in 0..steps - i {
            let at = |k: u32| (f64::from(k) + 1.0 / 3.0) / f64::from(steps);
            visit(&(a + u * at(i) + v * at(j)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box of faces wound outwards, from a corner on.
    fn brick(from: [f64; 3], size: [f64; 3]) -> (Vec<Point3<f64>>, Vec<[usize; 3]>) {
        let at = |i: usize, axis: usize| from[axis] + size[axis] * (i >> axis & 1) as f64;
        let corners = (0..8).map(|i| Point3::new(at(i, 0), at(i, 1), at(i, 2))).collect();
        let quads =
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        (corners, quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect())
    }

    fn turn([a, b, c]: [usize; 3]) -> [usize; 3] {
        [a, c, b]
    }

    fn told(vertices: &[Point3<f64>], triangles: &[[usize; 3]]) -> (Wound, Vec<ScanWarning>) {
        let mut warnings = Vec::new();
        let wound = outward(vertices, triangles.to_vec(), &mut warnings);
        (wound, warnings)
    }

    #[test]
    fn a_closed_box_looks_outwards_however_it_is_wound() {
        let (corners, faces) = brick([0.0; 3], [0.3, 0.2, 0.1]);
        let (wound, warnings) = told(&corners, &faces);
        assert!(wound.turned.iter().all(|t| !t) && warnings.is_empty());

        let inward: Vec<_> = faces.iter().map(|&f| turn(f)).collect();
        let (wound, warnings) = told(&corners, &inward);
        assert!(wound.turned.iter().all(|t| *t) && !wound.closed.contains(&true));
        let room = ScanWarning::LooksInwards { faces: 12, of: 12 };
        assert_eq!(warnings, [ScanWarning::FacesTurned { faces: 12, of: 12 }, room]);

        let mixed: Vec<_> =
            faces.iter().enumerate().map(|(i, &f)| if i % 3 == 0 { turn(f) } else { f }).collect();
        let (wound, warnings) = told(&corners, &mixed);
        assert!(wound.turned.iter().enumerate().all(|(i, t)| *t == (i % 3 == 0)));
        assert_eq!(warnings, [ScanWarning::FacesTurned { faces: 4, of: 12 }]);

        let both: Vec<_> = faces.iter().flat_map(|&f| [turn(f), f]).collect();
        let (wound, warnings) = told(&corners, &both);
        assert_eq!(wound.triangles.len(), 12);
        assert!(wound.turned.iter().all(|t| *t) && !wound.closed.contains(&false));
        assert_eq!(warnings[0], ScanWarning::TwiceCovered { faces: 12, of: 24 });
    }

    #[test]
    fn pieces_are_judged_one_by_one_and_a_hollow_keeps_its_wall() {
        let (mut corners, mut faces) = brick([0.0; 3], [1.0; 3]);
        let (other, inner) = brick([2.0, 0.0, 0.0], [0.5; 3]);
        faces.extend(inner.iter().map(|f| turn(f.map(|v| v + 8))));
        corners.extend(other);
        let (hollow, wall) = brick([0.3; 3], [0.4; 3]);
        faces.extend(wall.iter().map(|f| turn(f.map(|v| v + 16))));
        corners.extend(hollow);
        let (wound, warnings) = told(&corners, &faces);
        assert!((0..36).all(|i| wound.turned[i] == (12..24).contains(&i)));
        let room = ScanWarning::LooksInwards { faces: 12, of: 36 };
        assert_eq!(warnings, [ScanWarning::FacesTurned { faces: 12, of: 36 }, room]);
    }

    #[test]
    fn an_open_box_is_turned_and_of_a_sheet_it_is_said_that_nobody_knows() {
        let (corners, faces) = brick([0.0; 3], [0.3, 0.2, 0.1]);
        let open: Vec<_> = faces[2..].iter().map(|&f| turn(f)).collect();
        let (wound, warnings) = told(&corners, &open);
        assert!(wound.turned.iter().all(|t| *t));
        assert_eq!(warnings, [ScanWarning::FacesTurned { faces: 10, of: 10 }]);

        let (wound, warnings) = told(&corners, &faces[..2]);
        assert!(wound.turned.iter().all(|t| !t));
        assert_eq!(warnings, [ScanWarning::SideUnknown { faces: 2, of: 2 }]);
    }
}
