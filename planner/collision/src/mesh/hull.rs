//! Convex polyhedra: the hull of points, and one of few planes about it.

use nalgebra::{Matrix3, Point3, Vector3};
use parry3d_f64::math::Vec3;
use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::ConvexPolyhedron;
use wide::f32x8;

/// A convex polyhedron with its face planes.
#[derive(Clone, Debug)]
pub(crate) struct Hull {
    pub(crate) shape: ConvexPolyhedron,
    /// Outward unit normal and offset of each face, and of a simplified hull's planes those first
    /// that cut off most; every vertex satisfies n·v ≤ offset.
    pub(crate) planes: Vec<(Vector3<f64>, f64)>,
    /// Normal and offset of each plane in single precision, to measure eight points at a time.
    pub(crate) lanes: Vec<[f32x8; 4]>,
    pub(crate) min: Vector3<f64>,
    pub(crate) max: Vector3<f64>,
}

/// A hull of no more planes stays as it is.
const FEW: usize = 16;
/// Most planes of a simplified hull.
const MOST: usize = 64;
/// How far a simplified hull may reach beyond the true one, as long as it has less than [`MOST`]
/// planes. \[m\]
const OFF: f64 = 0.002;
/// What is added to a simplified hull's planes, more than rounding may take away. \[m\]
const ROUNDING: f64 = 1e-7;

impl Hull {
    /// The convex hull of the points; `None` if they are fewer than four, not finite, or flat.
    pub(crate) fn new(points: &[Point3<f64>]) -> Option<Self> {
        if points.len() < 4 || points.iter().any(|p| !p.coords.iter().all(|x| x.is_finite())) {
            return None;
        }
        let vertices: Vec<Vec3> = points.iter().map(|p| Vec3::new(p.x, p.y, p.z)).collect();
        let shape = ConvexPolyhedron::from_convex_hull(&vertices)?;
        // The faces come from a numeric hull that may shave off a vertex by a rounding error:
        // offsets are taken over all input points, so that no plane cuts into the solid.
        let planes = shape
            .faces()
            .iter()
            .map(|face| {
                let n = Vector3::new(face.normal.x, face.normal.y, face.normal.z);
                (n, support(points, &n))
            })
            .collect();
        let (mut min, mut max) = (points[0].coords, points[0].coords);
        for p in points {
            min = min.inf(&p.coords);
            max = max.sup(&p.coords);
        }
        Some(Self::bounded_by(planes, shape, min, max))
    }

    fn bounded_by(
        planes: Vec<(Vector3<f64>, f64)>,
        shape: ConvexPolyhedron,
        min: Vector3<f64>,
        max: Vector3<f64>,
    ) -> Self {
        let splat = |value: f64| f32x8::splat(value as f32);
        let lanes = planes.iter().map(|(n, offset)| [n.x, n.y, n.z, *offset].map(splat)).collect();
        Self { shape, planes, lanes, min, max }
    }

    /// The convex hull of the points, or, where that has many faces, a polyhedron of fewer about it.
    pub(crate) fn about(points: &[Point3<f64>]) -> Option<Self> {
        let hull = Self::new(points)?;
        let simple = (hull.planes.len() > FEW).then(|| Outer::about(&hull, points).hull());
        // The simple one is made of corners that were computed: it must be seen to hold the points.
        Some(match simple.flatten() {
            Some(simple) if simple.holds(points) && simple.planes.len() < hull.planes.len() => {
                simple
            }
            _ => hull,
        })
    }

    fn holds(&self, points: &[Point3<f64>]) -> bool {
        self.planes.iter().all(|(n, offset)| support(points, n) <= *offset)
    }

    /// Its corners. \[m\]
    pub(crate) fn corners(&self) -> impl Iterator<Item = Vector3<f64>> {
        self.shape.points().iter().map(|v| Vector3::new(v.x, v.y, v.z))
    }
}

/// How far the points reach along a unit vector.
fn support(points: &[Point3<f64>], n: &Vector3<f64>) -> f64 {
    points.iter().map(|p| n.dot(&p.coords)).fold(f64::MIN, f64::max)
}

/// A polyhedron about a hull, made by cutting a box: each plane touches the hull where the corner
/// that is farthest off it was nearest, so none cuts into it.
struct Outer<'a> {
    points: &'a [Point3<f64>],
    planes: Vec<(Vector3<f64>, f64)>,
    corners: Vec<Vector3<f64>>,
}

impl<'a> Outer<'a> {
    fn about(hull: &Hull, points: &'a [Point3<f64>]) -> Self {
        let mut outer = Self { points, planes: Vec::new(), corners: Vec::new() };
        for axis in 0..3 {
            outer.cut(Vector3::ith(axis, 1.0));
            outer.cut(-Vector3::ith(axis, 1.0));
        }
        while outer.planes.len() < MOST {
            let off = |corner: &Vector3<f64>| {
                let corner = Vec3::new(corner.x, corner.y, corner.z);
                let off = corner - hull.shape.project_local_point(corner, true).point;
                Vector3::new(off.x, off.y, off.z)
            };
            let farthest = outer.corners.iter().map(off).fold(Vector3::zeros(), |most, off| {
                if off.norm_squared() > most.norm_squared() { off } else { most }
            });
            if farthest.norm() < OFF {
                break;
            }
            outer.cut(farthest.normalize());
        }
        outer
    }

    /// Cuts off what is beyond the points along a unit vector.
    fn cut(&mut self, n: Vector3<f64>) {
        let offset = support(self.points, &n) + ROUNDING;
        self.corners.retain(|corner| n.dot(corner) <= offset);
        for (i, (first, at)) in self.planes.iter().enumerate() {
            for (second, by) in &self.planes[..i] {
                let across =
                    Matrix3::from_rows(&[first.transpose(), second.transpose(), n.transpose()]);
                let Some(back) = across.try_inverse() else { continue };
                let corner = back * Vector3::new(*at, *by, offset);
                let slack = 1e-3 * ROUNDING;
                if self.planes.iter().all(|(m, most)| m.dot(&corner) <= most + slack) {
                    self.corners.push(corner);
                }
            }
        }
        self.planes.push((n, offset));
    }

    fn hull(self) -> Option<Hull> {
        let corners: Vec<_> = self.corners.into_iter().map(Point3::from).collect();
        let hull = Hull::new(&corners)?;
        // The planes that it was cut by come in a better order than the faces.
        let own = |(n, offset): (Vector3<f64>, f64)| (n, offset.max(support(&corners, &n)));
        let is_held = hull.holds(self.points);
        is_held.then(|| {
            let planes = self.planes.into_iter().map(own).collect();
            Hull::bounded_by(planes, hull.shape, hull.min, hull.max)
        })
    }
}
