//! A mesh as convex pieces: cut by planes until no hull is much fatter than what it holds.
//!
//! A cut goes through the triangles of a closed mesh and closes both halves again, so that the hull of
//! each holds its part of the inside: between them the pieces hold all of the mesh and of what it
//! encloses. An open mesh is closed first, as if a lid were on each of its openings.

use nalgebra::{Point3, Vector3};
use parry3d_f64::math::Vec3;
use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::TriMesh;
use parry3d_f64::transformation::try_convex_hull;

use super::soup::Soup;

/// A hull whose surface is farther off the mesh's is cut. \[m\]
const FAT: f64 = 0.01;
/// Most pieces of a mesh.
const MOST: usize = 8;
/// Planes that are tried across each axis.
const CUTS: usize = 9;
/// A cut is worth it that frees at least this share of the whole hull's volume.
const WORTH: f64 = 0.02;
/// Distance of the places of a hull's surface that are looked at. \[m\]
const STEP: f64 = 0.012;
/// Directions whose farthest points stand for all of a half where cuts are compared.
const DIRECTIONS: usize = 48;

/// Part of a mesh.
struct Piece {
    soup: Soup,
    /// Axis and place of the planes that it was cut out by.
    cuts: Vec<(usize, f64)>,
    /// How far its hull's surface is off the mesh's at most; 0 if no cut is worth it. \[m\]
    fat: f64,
}

/// Sets of points whose convex hulls together hold the mesh and its inside; none is empty.
pub(crate) fn pieces(mesh: Soup) -> Vec<Vec<Point3<f64>>> {
    let mesh = mesh.closed();
    let (Some(skin), Some(whole)) = (skin(&mesh), volume(&extremes(&mesh.vertices))) else {
        return vec![mesh.vertices];
    };
    let mut pieces = vec![Piece::new(mesh, Vec::new(), &skin)];
    while pieces.len() < MOST {
        let fattest = (0..pieces.len()).max_by(|&a, &b| pieces[a].fat.total_cmp(&pieces[b].fat));
        let Some(piece) = fattest.map(|i| &mut pieces[i]).filter(|piece| piece.fat > FAT) else {
            break;
        };
        let Some((axis, at)) = piece.best_cut(WORTH * whole) else {
            piece.fat = 0.0;
            continue;
        };
        let [low, high] = piece.soup.cut(axis, at);
        let mut cuts = std::mem::take(&mut piece.cuts);
        cuts.push((axis, at));
        *piece = Piece::new(low, cuts.clone(), &skin);
        pieces.push(Piece::new(high, cuts, &skin));
    }
    pieces.into_iter().map(|piece| piece.soup.vertices).collect()
}

impl Piece {
    fn new(soup: Soup, cuts: Vec<(usize, f64)>, skin: &TriMesh) -> Self {
        let fat = fatness(&soup.vertices, &cuts, skin);
        Self { soup, cuts, fat }
    }

    /// The plane that leaves the least volume in the hulls of both halves; none frees as much as is
    /// wanted. \[m³\]
    fn best_cut(&self, wanted: f64) -> Option<(usize, f64)> {
        let mut least = volume(&extremes(&self.soup.vertices))? - wanted;
        let mut best = None;
        for axis in 0..3 {
            let along = self.soup.vertices.iter().map(|p| p[axis]);
            let (low, high) =
                along.fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(x), high.max(x)));
            for k in 1..=CUTS {
                let at = low + (high - low) * k as f64 / (CUTS + 1) as f64;
                let sides = self.soup.cut_corners(axis, at);
                let volumes = sides.map(|side| volume(&extremes(&side)));
                if let [Some(a), Some(b)] = volumes
                    && a + b < least
                {
                    least = a + b;
                    best = Some((axis, at));
                }
            }
        }
        best
    }
}

/// The mesh's surface, to measure distances to.
fn skin(mesh: &Soup) -> Option<TriMesh> {
    let vertices = mesh.vertices.iter().map(vec3).collect();
    let triangles = mesh.triangles.iter().map(|t| t.map(|i| i as u32)).collect();
    TriMesh::new(vertices, triangles).ok()
}

fn vec3(p: &Point3<f64>) -> Vec3 {
    Vec3::new(p.x, p.y, p.z)
}

/// How far the surface of the points' hull is off the skin, where no plane cut them off. \[m\]
fn fatness(points: &[Point3<f64>], cuts: &[(usize, f64)], skin: &TriMesh) -> f64 {
    let points: Vec<Vec3> = points.iter().map(vec3).collect();
    let Ok((corners, faces)) = try_convex_hull(&points) else { return 0.0 };
    let mut most = 0.0f64;
    for face in faces {
        let [a, b, c] = face.map(|i| corners[i as usize]);
        let is_cut =
            |&(axis, at): &(usize, f64)| [a, b, c].iter().all(|p| (p[axis] - at).abs() < 1e-6);
        if cuts.iter().any(is_cut) {
            continue;
        }
        let longest = (b - a).length().max((c - b).length()).max((a - c).length());
        let steps = (longest / STEP).ceil().clamp(2.0, 64.0) as usize;
        for i in 0..=steps {
            for j in 0..=steps - i {
                let (u, v) = (i as f64 / steps as f64, j as f64 / steps as f64);
                let p = a + (b - a) * u + (c - a) * v;
                most = most.max(skin.distance_to_local_point(p, false));
            }
        }
    }
    most
}

/// The farthest points along directions evenly all round.
fn extremes(points: &[Point3<f64>]) -> Vec<Vec3> {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let mut found: Vec<usize> = (0..DIRECTIONS)
        .filter_map(|k| {
            let z = 1.0 - (2 * k + 1) as f64 / DIRECTIONS as f64;
            let (sine, cosine) = libm::sincos(golden * k as f64);
            let flat = (1.0 - z * z).sqrt();
            let n = Vector3::new(flat * cosine, flat * sine, z);
            let along = |i: &usize| n.dot(&points[*i].coords);
            (0..points.len()).max_by(|a, b| along(a).total_cmp(&along(b)))
        })
        .collect();
    found.sort_unstable();
    found.dedup();
    found.into_iter().map(|i| vec3(&points[i])).collect()
}

/// The volume of the points' hull; none if they are flat. \[m³\]
fn volume(points: &[Vec3]) -> Option<f64> {
    if points.len() < 4 {
        return None;
    }
    let (corners, faces) = try_convex_hull(points).ok()?;
    let cone = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|i| corners[i as usize] - points[0]);
        a.dot(b.cross(c)) / 6.0
    };
    Some(faces.iter().map(cone).sum::<f64>()).filter(|volume| *volume > 1e-9)
}
