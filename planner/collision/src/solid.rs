//! Convex solids in their own frame, made of the shapes that a URDF describes: signed distances for
//! the fast check, parry's shapes for both.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use nullsweep_robot::Geometry;
use parry3d_f64::math::Vec3;
use parry3d_f64::query::{DefaultQueryDispatcher, PointQuery, QueryDispatcher};
use parry3d_f64::shape::SharedShape;

use crate::frame::Frame;
use crate::mesh::{Hull, MeshError, MeshPaths};

/// A convex solid about its own origin; lengths in \[m\].
#[derive(Clone, Debug)]
pub(crate) enum Solid {
    Ball {
        radius: f64,
    },
    /// Axis z; the caps are beyond `half`.
    Capsule {
        half: f64,
        radius: f64,
    },
    /// Axis y, as parry has it: [`Solid::prepare`] turns a URDF's cylinder (axis z).
    Cylinder {
        half: f64,
        radius: f64,
    },
    Box {
        half: Vector3<f64>,
    },
    Hull(Box<Hull>),
    /// All of z ≤ 0.
    HalfSpace,
}

/// A URDF's shape as convex solids, all at one pose.
pub(crate) struct Prepared {
    pub(crate) solids: Vec<Solid>,
    pub(crate) pose: Isometry3<f64>,
    /// Where its package was found, in words, if that was looked for.
    pub(crate) told: Option<String>,
}

impl Solid {
    /// The solids of a shape that stands at `origin`, and where they stand in the same frame: a
    /// cylinder turns. A mesh is read from its file and becomes convex pieces.
    pub(crate) fn prepare(
        geometry: &Geometry,
        origin: Isometry3<f64>,
        meshes: &MeshPaths,
    ) -> Result<Prepared, MeshError> {
        let (mut pose, mut told) = (origin, None);
        let solids = match geometry {
            Geometry::Box { half_extents } => vec![Self::Box { half: *half_extents }],
            Geometry::Sphere { radius } => vec![Self::Ball { radius: *radius }],
            Geometry::Capsule { radius, half_length } => {
                vec![Self::Capsule { half: *half_length, radius: *radius }]
            }
            Geometry::Cylinder { radius, half_length } => {
                let quarter = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), FRAC_PI_2);
                pose = origin * quarter;
                vec![Self::Cylinder { half: *half_length, radius: *radius }]
            }
            Geometry::Mesh { uri, scale } => {
                let found = meshes.resolve(uri)?;
                let hulls = meshes.hulls(&found, scale)?;
                told = found.told;
                hulls.iter().map(|hull| Self::Hull(Box::new(hull.clone()))).collect()
            }
        };
        Ok(Prepared { solids, pose, told })
    }

    /// A lower bound of the signed distance \[m\] from `p` to the solid (negative inside). Exact for
    /// all but a hull's edges and vertices as seen from outside.
    #[inline]
    pub(crate) fn distance_bound(&self, p: &Vector3<f64>) -> f64 {
        match self {
            Self::Ball { radius } => p.norm() - radius,
            Self::Capsule { half, radius } => {
                let z = (p.z.abs() - half).max(0.0);
                (p.x * p.x + p.y * p.y + z * z).sqrt() - radius
            }
            Self::Cylinder { half, radius } => {
                let radial = (p.x * p.x + p.z * p.z).sqrt() - radius;
                let axial = p.y.abs() - half;
                let (r, a) = (radial.max(0.0), axial.max(0.0));
                (r * r + a * a).sqrt() + radial.max(axial).min(0.0)
            }
            Self::Box { half } => {
                let q = p.abs() - half;
                let outside = q.map(|x| x.max(0.0));
                outside.norm() + q.max().min(0.0)
            }
            Self::Hull(hull) => {
                hull.planes.iter().map(|(n, offset)| n.dot(p) - offset).fold(f64::MIN, f64::max)
            }
            Self::HalfSpace => p.z,
        }
    }

    /// The signed distance \[m\] from `p` to the solid.
    pub(crate) fn distance(&self, p: &Vector3<f64>) -> f64 {
        let bound = self.distance_bound(p);
        match self {
            Self::Hull(hull) if bound > 0.0 => {
                hull.shape.distance_to_local_point(Vec3::new(p.x, p.y, p.z), true).max(bound)
            }
            _ => bound,
        }
    }

    /// The axis-aligned bounds in the solid's frame \[m\]; infinite for a half-space.
    pub(crate) fn bounds(&self) -> (Vector3<f64>, Vector3<f64>) {
        let symmetric = |h: Vector3<f64>| (-h, h);
        match self {
            Self::Ball { radius } => symmetric(Vector3::repeat(*radius)),
            Self::Capsule { half, radius } => {
                symmetric(Vector3::new(*radius, *radius, half + radius))
            }
            Self::Cylinder { half, radius } => symmetric(Vector3::new(*radius, *half, *radius)),
            Self::Box { half } => symmetric(*half),
            Self::Hull(hull) => (hull.min, hull.max),
            Self::HalfSpace => (
                Vector3::repeat(f64::NEG_INFINITY),
                Vector3::new(f64::INFINITY, f64::INFINITY, 0.0),
            ),
        }
    }

    /// Centre of the bounds, which all but hulls have at the origin. \[m\]
    #[inline]
    fn centre(&self) -> Vector3<f64> {
        match self {
            Self::Hull(hull) => 0.5 * (hull.min + hull.max),
            _ => Vector3::zeros(),
        }
    }

    /// How far the solid reaches from its centre along a unit vector, at most. \[m\]
    #[inline]
    pub(crate) fn extent(&self, n: &Vector3<f64>) -> f64 {
        match self {
            Self::Ball { radius } => *radius,
            Self::Capsule { half, radius } => half * n.z.abs() + radius,
            Self::Cylinder { half, radius } => {
                half * n.y.abs() + radius * (n.x * n.x + n.z * n.z).sqrt()
            }
            Self::Box { half } => half.dot(&n.abs()),
            Self::Hull(hull) => 0.5 * (hull.max - hull.min).dot(&n.abs()),
            Self::HalfSpace => f64::INFINITY,
        }
    }

    /// Whether a plane across an axis of either solid, or across the line of their centres, proves
    /// them `need` apart; `other` stands at `pose` in this solid's frame.
    pub(crate) fn is_separated(&self, other: &Self, pose: &Frame, need: f64) -> bool {
        let between = pose.apply(&other.centre()) - self.centre();
        let gap = |n: &Vector3<f64>| {
            between.dot(n).abs() - self.extent(n) - other.extent(&pose.rotation.tr_mul(n))
        };
        (0..3).any(|i| {
            gap(&Vector3::ith(i, 1.0)) >= need || gap(&pose.rotation.column(i).into_owned()) >= need
        }) || between.try_normalize(1e-9).is_some_and(|n| gap(&n) >= need)
    }

    /// Radius \[m\] of the sphere about the centre of the bounds that holds the solid.
    pub(crate) fn bounding_radius(&self) -> f64 {
        match self {
            Self::Ball { radius } => *radius,
            Self::Capsule { half, radius } => half + radius,
            Self::Cylinder { half, radius } => libm::hypot(*half, *radius),
            Self::Box { half } => half.norm(),
            Self::Hull(hull) => {
                let centre = 0.5 * (hull.min + hull.max);
                hull.corners().fold(0.0, |r: f64, v| r.max((v - centre).norm())) + 1e-9
            }
            Self::HalfSpace => f64::INFINITY,
        }
    }

    /// The same solid as a parry shape.
    pub(crate) fn to_parry(&self) -> SharedShape {
        match self {
            Self::Ball { radius } => SharedShape::ball(*radius),
            Self::Capsule { half, radius } => SharedShape::capsule_z(*half, *radius),
            Self::Cylinder { half, radius } => SharedShape::cylinder(*half, *radius),
            Self::Box { half } => SharedShape::cuboid(half.x, half.y, half.z),
            Self::Hull(hull) => SharedShape::new(hull.shape.clone()),
            Self::HalfSpace => SharedShape::halfspace(Vec3::new(0.0, 0.0, 1.0)),
        }
    }
}

/// Distance between two shapes, the second at `pose` in the first's frame; 0 if they overlap. \[m\]
pub(crate) fn gjk_distance(pose: &Frame, first: &SharedShape, second: &SharedShape) -> f64 {
    DefaultQueryDispatcher
        .distance(&pose.to_parry(), &**first, &**second)
        .map_or(0.0, |found| found.distance)
}
