//! What a mesh is beside the points that are drawn on it: its corners, its edges and all of its faces.

use nalgebra::Point3;

use super::winding::Wound;

/// Most places beside the corners, about; where there would be more they are laid wider apart, as the
/// points of such a mesh are, which is told of those.
const MOST: f64 = 1_000_000.0;

/// A face that is no wider than so many spacings is a line.
const THIN: f64 = 0.2;

/// The corners of a mesh and places on its faces, so close that no place of a face is farther than
/// 0.58 `spacing` \[m\] from one of them, in an order that depends on the mesh alone.
///
/// Faces are halved across their longest edge until no edge is longer than `spacing`, or they are but
/// lines.
pub(super) fn places(vertices: &[Point3<f64>], wound: &Wound, spacing: f64) -> Vec<Point3<f64>> {
    let faces: Vec<[Point3<f64>; 3]> = wound
        .triangles
        .iter()
        .map(|corners| corners.map(|corner| vertices[corner]))
        .filter(|face| face.iter().all(|p| p.iter().all(|x| x.is_finite())))
        .collect();
    let spacing = bearable(&faces, spacing);
    let mut places = Vec::new();
    let mut rest: Vec<[Point3<f64>; 3]> = Vec::new();
    for face in faces {
        places.extend(face);
        rest.push(face);
        while let Some([a, b, c]) = rest.pop() {
            let opposite = [(b, c, a), (c, a, b), (a, b, c)];
            let length = |(from, to, _): &(Point3<f64>, Point3<f64>, Point3<f64>)| {
                nalgebra::distance_squared(from, to)
            };
            let (from, to, tip) = opposite
                .into_iter()
                .max_by(|x, y| length(x).total_cmp(&length(y)))
                .expect("a face has three edges");
            let longest = length(&(from, to, tip)).sqrt();
            let height = (to - from).cross(&(tip - from)).norm() / longest;
            if height <= THIN * spacing {
                // A line: halved, what is left of it would stay as long.
                let parts = (longest / spacing).ceil();
                places.extend((1..parts as usize).map(|i| from.lerp(&to, i as f64 / parts)));
            } else if longest > spacing {
                // The same place from either side.
                let middle = Point3::from((from.coords + to.coords) * 0.5);
                places.push(middle);
                rest.extend([[from, middle, tip], [middle, to, tip]]);
            }
        }
    }
    let key = |p: &Point3<f64>| [p.x, p.y, p.z].map(f64::to_bits);
    places.sort_unstable_by_key(key);
    places.dedup_by_key(|p| key(p));
    places
}

/// The given spacing, or so many times twice as much that there are not too many places.
fn bearable(faces: &[[Point3<f64>; 3]], spacing: f64) -> f64 {
    let farthest = faces.iter().flatten().map(|p| p.coords.amax()).fold(0.0, f64::max);
    // Far out there are no numbers between two places that are nearer to each other.
    let mut spacing = spacing.max(1e-12 * farthest);
    let (mut area, mut length) = (0.0, 0.0);
    for [a, b, c] in faces {
        let (u, v) = (b - a, c - a);
        area += 0.5 * u.cross(&v).norm();
        length += u.norm().max(v.norm()).max((c - b).norm());
    }
    // Faces shorter than the spacing have no place but their corners.
    let places = |s: f64| 3.0 * area / (s * s) + length / s - faces.len() as f64;
    // What is no number is too much.
    let is_bearable = |s: f64| places(s) <= MOST;
    while !is_bearable(spacing) && spacing.is_finite() {
        spacing *= 2.0;
    }
    spacing
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_place_of_a_face_is_far_from_one_of_them() {
        let corners = [[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.1, 0.001, 0.0], [0.02, -0.1, 0.03]];
        let vertices: Vec<Point3<f64>> = corners.map(Point3::from).into();
        let triangles = vec![[0, 1, 2], [1, 0, 3]];
        let wound =
            Wound { turned: vec![false; 2], closed: vec![false; 2], triangles: triangles.clone() };
        let spacing = 0.005;
        let found = places(&vertices, &wound, spacing);
        assert!(vertices.iter().all(|v| found.contains(v)), "the corners are among them");
        for face in triangles {
            let [a, b, c] = face.map(|corner| vertices[corner].coords);
            for (i, j) in (0..=40).flat_map(|i| (0..=40 - i).map(move |j| (i, j))) {
                let (s, t) = (f64::from(i) / 40.0, f64::from(j) / 40.0);
                let place = Point3::from(a + (b - a) * s + (c - a) * t);
                let near = found.iter().map(|p| (p - place).norm()).fold(f64::INFINITY, f64::min);
                assert!(near <= 0.58 * spacing, "{place}: {near} m");
            }
        }
        // 10 mm² of a sliver of 0.2 m and 103 cm² beside it, no place twice.
        assert!(found.len() < 3_000, "{}", found.len());
    }
    #[test]
    fn a_face_as_large_as_a_country_gets_no_more_than_it_bears() {
        let corners = [[0.0, 0.0, 0.0], [1e6, 0.0, 0.0], [0.0, 1e6, 0.0]];
        let vertices: Vec<Point3<f64>> = corners.map(Point3::from).into();
        let triangles = vec![[0, 1, 2]];
        let wound = Wound { turned: vec![false], closed: vec![false], triangles };
        let found = places(&vertices, &wound, 0.003).len();
        assert!((1_000..=1_000_000).contains(&found), "{found}");
        // Beyond all numbers, and where neighbouring ones are farther apart than the spacing.
        for corners in [
            [[0.0, 0.0, 0.0], [1e200, 1e200, 0.0], [0.0, -1e200, 1e200]],
            [[1e20, 0.0, 0.0], [1e20 + 2e4, 0.0, 0.0], [1e20 + 4e4, 0.0, 0.0]],
            [[1e15, 0.0, 0.0], [1e15 + 1.0, 1.0, 0.0], [1e15, 2.0, 1.0]],
            [[0.0, 0.0, 0.0], [0.0, 849_152.6, 0.0], [552.7, 0.0, 1.7e25]],
        ] {
            let vertices: Vec<Point3<f64>> = corners.map(Point3::from).into();
            assert!(places(&vertices, &wound, 0.003).len() <= 2_000_000);
        }
    }
}
