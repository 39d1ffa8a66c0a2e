//! How far a plane was seen.

use nalgebra::{
    Isometry3, Matrix3, Point3, Rotation3, UnitQuaternion, UnitVector3, Vector2, Vector3,
};

/// A rectangle in space.
#[derive(Clone, Debug, PartialEq)]
pub struct Rectangle {
    /// Pose of its middle: x and y along its sides, z along the plane's normal. \[m\]
    pub pose: Isometry3<f64>,
    /// Half of its sides along x and y. \[m\]
    pub half: [f64; 2],
}

/// Two unit vectors that span a plane, right-handed with its normal.
pub(super) fn axes(normal: &UnitVector3<f64>) -> [Vector3<f64>; 2] {
    let helper = if normal.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() };
    let u = normal.cross(&helper).normalize();
    [u, normal.cross(&u)]
}

/// Twice the area of a triangle below which its corners lie on one line. \[m²\]
const STRAIGHT: f64 = 1e-12;

/// The convex hull of points seen along a normal, at the mean height of all, counter-clockwise
/// (Andrew's monotone chain, 1979).
pub(super) fn hull(points: &[Point3<f64>], normal: &UnitVector3<f64>) -> Vec<Point3<f64>> {
    let [u, v] = axes(normal);
    let height = points.iter().map(|p| p.coords.dot(normal)).sum::<f64>() / points.len() as f64;
    let mut flat: Vec<Vector2<f64>> =
        points.iter().map(|p| Vector2::new(p.coords.dot(&u), p.coords.dot(&v))).collect();
    flat.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let mut corners: Vec<Vector2<f64>> = Vec::new();
    let forth: Vec<_> = flat.iter().collect();
    let back: Vec<_> = flat.iter().rev().collect();
    for way in [forth, back] {
        let first = corners.len();
        for p in way {
            while let [.., a, b] = corners[first..]
                && (b - a).perp(&(p - b)) <= STRAIGHT
            {
                corners.pop();
            }
            corners.push(*p);
        }
        corners.pop();
    }
    corners
        .into_iter()
        .map(|c| Point3::from(u * c.x + v * c.y + normal.into_inner() * height))
        .collect()
}

/// Whether a point, seen along the normal, lies in a convex outline or at most `margin` beyond a
/// side.
pub(super) fn contains(
    outline: &[Point3<f64>],
    normal: &UnitVector3<f64>,
    point: &Point3<f64>,
    margin: f64,
) -> bool {
    let sides = outline.iter().zip(outline.iter().cycle().skip(1));
    sides.into_iter().all(|(a, b)| {
        let side = b - a;
        let length = side.norm();
        length < 1e-12 || normal.cross(&side).dot(&(point - a)) >= -margin * length
    })
}

impl Rectangle {
    /// The smallest rectangle around a convex outline: one of its sides lies on one of the outline
    /// (Freeman & Shapira 1975).
    pub(super) fn around(
        outline: &[Point3<f64>],
        point: &Point3<f64>,
        normal: &UnitVector3<f64>,
    ) -> Self {
        let mut best: Option<(f64, Self)> = None;
        let sides = outline.iter().zip(outline.iter().cycle().skip(1));
        for side in sides.map(|(a, b)| b - a).chain([axes(normal)[0]]) {
            let along = side - normal.scale(side.dot(normal));
            let Some(x) = along.try_normalize(1e-12) else { continue };
            let y = normal.cross(&x);
            let span = |axis: &Vector3<f64>| {
                let at = outline.iter().map(|p| (p - point).dot(axis));
                let grow = |(l, u): (f64, f64), x: f64| (l.min(x), u.max(x));
                at.fold((f64::INFINITY, f64::NEG_INFINITY), grow)
            };
            let ((x0, x1), (y0, y1)) = (span(&x), span(&y));
            let area = (x1 - x0) * (y1 - y0);
            if best.as_ref().is_none_or(|(least, _)| area < *least) {
                let middle = point + x * (0.5 * (x0 + x1)) + y * (0.5 * (y0 + y1));
                let turn = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[
                    x,
                    y,
                    normal.into_inner(),
                ]));
                let rotation = UnitQuaternion::from_rotation_matrix(&turn);
                let pose = Isometry3::from_parts(middle.coords.into(), rotation);
                best = Some((area, Self { pose, half: [0.5 * (x1 - x0), 0.5 * (y1 - y0)] }));
            }
        }
        best.map_or_else(
            || Self { pose: Isometry3::from(point.coords), half: [0.0; 2] },
            |(_, rectangle)| rectangle,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turned_plate_has_its_hull_and_its_rectangle() {
        let normal = UnitVector3::new_normalize(Vector3::new(0.2, -0.3, 1.0));
        let turn = UnitQuaternion::rotation_between(&Vector3::z(), &normal).unwrap()
            * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.4);
        let at = |i: usize| 0.05 * i as f64;
        let plate: Vec<Point3<f64>> = (0..21 * 11)
            .map(|i| turn * Point3::new(at(i % 21), at(i / 21), 0.0) + Vector3::new(1.0, 2.0, 3.0))
            .collect();
        let outline = hull(&plate, &normal);
        assert!((4..=8).contains(&outline.len()), "{} corners", outline.len());
        assert!(plate.iter().all(|p| contains(&outline, &normal, p, 1e-9)));
        let beside = turn * Point3::new(-0.1, 0.2, 0.0) + Vector3::new(1.0, 2.0, 3.0);
        assert!(!contains(&outline, &normal, &beside, 0.05));
        assert!(contains(&outline, &normal, &beside, 0.11));
        let rectangle = Rectangle::around(&outline, &plate[0], &normal);
        let mut half = rectangle.half;
        half.sort_by(f64::total_cmp);
        assert!((half[0] - 0.25).abs() < 1e-6 && (half[1] - 0.5).abs() < 1e-6, "{half:?}");
        let middle = turn * Point3::new(0.5, 0.25, 0.0) + Vector3::new(1.0, 2.0, 3.0);
        assert!((rectangle.pose * Point3::origin() - middle).norm() < 1e-6);
        assert!((rectangle.pose.rotation * Vector3::z() - normal.into_inner()).norm() < 1e-9);
    }
}
