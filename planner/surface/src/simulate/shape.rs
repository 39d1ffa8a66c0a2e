//! Solids by their distance fields, which blend into rounded bodies and trace quickly (Hart, Sphere
//! tracing, 1996).

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

/// A solid in its own frame, or solids put together.
#[derive(Clone, Debug)]
pub(super) enum Shape {
    /// Half extents before rounding, rounding radius. \[m\]
    Box(Vector3<f64>, f64),
    /// Semi-axes. \[m\]
    Ellipsoid(Vector3<f64>),
    /// Along z: radius, half length, rounding of the rim. \[m\]
    Cylinder(f64, f64, f64),
    /// Around z: ring radius, tube radius. \[m\]
    Torus(f64, f64),
    /// Between two points: radius. \[m\]
    Capsule(Point3<f64>, Point3<f64>, f64),
    /// Bent about z-parallel axes: the content is displaced along x by y² / (2 radius). \[m\]
    Bent(Box<Self>, f64),
    /// Placed in the parent's frame.
    At(Isometry3<f64>, Box<Self>),
    /// Larger by a factor.
    Scaled(f64, Box<Self>),
    /// Joined with fillets of about this radius. \[m\]
    Union(Vec<Self>, f64),
}

impl Shape {
    /// Distance from a point to the surface, negative inside; a lower bound for ellipsoids, bent
    /// shapes and fillets, so that steps along a ray never pass through. \[m\]
    pub(super) fn distance(&self, p: &Point3<f64>) -> f64 {
        match self {
            Self::Box(half, rounding) => {
                let q = p.coords.abs() - half;
                q.sup(&Vector3::zeros()).norm() + q.max().min(0.0) - rounding
            }
            Self::Ellipsoid(axes) => {
                let scaled = p.coords.component_div(axes);
                let gradient = scaled.component_div(axes).norm();
                let k = scaled.norm();
                if gradient < 1e-12 { -axes.min() } else { k * (k - 1.0) / gradient }
            }
            Self::Cylinder(radius, half, rounding) => {
                let radial = libm::hypot(p.x, p.y) - (radius - rounding);
                let axial = p.z.abs() - (half - rounding);
                libm::hypot(radial.max(0.0), axial.max(0.0)) + radial.max(axial).min(0.0) - rounding
            }
            Self::Torus(ring, tube) => libm::hypot(libm::hypot(p.x, p.y) - ring, p.z) - tube,
            Self::Capsule(a, b, radius) => {
                let axis = b - a;
                let along = ((p - a).dot(&axis) / axis.norm_squared()).clamp(0.0, 1.0);
                (p - a - axis * along).norm() - radius
            }
            Self::Bent(shape, radius) => {
                let straight = Point3::new(p.x - p.y * p.y / (2.0 * radius), p.y, p.z);
                let slope = p.y / radius;
                shape.distance(&straight) / (1.0 + slope * slope).sqrt()
            }
            Self::At(pose, shape) => shape.distance(&pose.inverse_transform_point(p)),
            Self::Scaled(factor, shape) => factor * shape.distance(&(p / *factor)),
            Self::Union(shapes, fillet) => {
                shapes.iter().map(|s| s.distance(p)).fold(f64::INFINITY, |a, b| {
                    let blend = (fillet - (a - b).abs()).max(0.0);
                    a.min(b) - blend * blend / (4.0 * fillet.max(1e-9))
                })
            }
        }
    }

    /// The outward direction at a point of the surface.
    pub(super) fn normal(&self, p: &Point3<f64>) -> Vector3<f64> {
        const STEP: f64 = 1e-5;
        let along = |axis: Vector3<f64>| {
            self.distance(&(p + axis * STEP)) - self.distance(&(p - axis * STEP))
        };
        Vector3::new(along(Vector3::x()), along(Vector3::y()), along(Vector3::z())).normalize()
    }

    fn at(self, x: f64, y: f64, z: f64) -> Self {
        Self::At(Translation3::new(x, y, z).into(), Box::new(self))
    }

    fn turned(self, roll: f64, pitch: f64, yaw: f64) -> Self {
        let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        Self::At(Isometry3::from_parts(Translation3::identity(), rotation), Box::new(self))
    }
}

/// A box of the given outer size with rounded edges.
fn block(x: f64, y: f64, z: f64, rounding: f64) -> Shape {
    Shape::Box(Vector3::new(x, y, z) * 0.5 - Vector3::repeat(rounding), rounding)
}

/// A chair of 0.48 m width and 0.90 m height that faces −x.
pub(super) fn chair() -> Shape {
    let mut parts = vec![
        block(0.47, 0.48, 0.035, 0.015).at(0.0, 0.0, 0.4225),
        // The frame under the seat.
        block(0.42, 0.42, 0.06, 0.005).at(0.0, 0.0, 0.38),
        // The backrest, hollow towards the sitter and leaning back.
        Shape::Bent(Box::new(block(0.025, 0.45, 0.44, 0.010)), -0.75)
            .turned(0.0, 0.16, 0.0)
            .at(0.272, 0.0, 0.685),
    ];
    for y in [-0.16, 0.16] {
        // The posts that carry the backrest, and the legs.
        let foot = Point3::new(0.20, y, 0.38);
        parts.push(Shape::Capsule(foot, Point3::new(0.270, y, 0.75), 0.016));
        for x in [-0.19, 0.19] {
            parts.push(block(0.04, 0.04, 0.40, 0.008).at(x, 1.2 * y, 0.20));
        }
    }
    // To the visible area of the paper's chair.
    Shape::Scaled(1.015, Box::new(Shape::Union(parts, 0.008)))
}

/// A toy car along y, 0.63 m long, its bonnet towards +y.
pub(super) fn bobby_car() -> Shape {
    let ellipsoid = |x, y, z| Shape::Ellipsoid(Vector3::new(x, y, z));
    let body = Shape::Union(
        vec![
            block(0.24, 0.53, 0.13, 0.05).at(0.0, 0.0, 0.155),
            // Bonnet, seat and tail.
            ellipsoid(0.14, 0.17, 0.115).at(0.0, 0.145, 0.205),
            ellipsoid(0.125, 0.135, 0.105).at(0.0, -0.17, 0.20),
            block(0.16, 0.22, 0.11, 0.045).at(0.0, -0.05, 0.18),
        ],
        0.06,
    );
    let mut parts = vec![body];
    for x in [-0.145, 0.145] {
        for y in [-0.175, 0.185] {
            let wheel = Shape::Union(
                vec![Shape::Cylinder(0.09, 0.03, 0.012), Shape::Cylinder(0.04, 0.038, 0.008)],
                0.004,
            );
            parts.push(wheel.turned(0.0, std::f64::consts::FRAC_PI_2, 0.0).at(x, y, 0.09));
        }
    }
    let wheel_centre = Point3::new(0.0, 0.045, 0.385);
    parts.push(Shape::Capsule(Point3::new(0.0, 0.10, 0.27), wheel_centre, 0.02));
    parts.push(
        Shape::Union(
            vec![
                Shape::Torus(0.09, 0.015),
                Shape::Cylinder(0.03, 0.012, 0.006),
                Shape::Capsule(Point3::new(-0.085, 0.0, 0.0), Point3::new(0.085, 0.0, 0.0), 0.010),
            ],
            0.01,
        )
        .turned(0.45, 0.0, 0.0)
        .at(wheel_centre.x, wheel_centre.y, wheel_centre.z),
    );
    // To the visible area of the paper's car.
    Shape::Scaled(1.045, Box::new(Shape::Union(parts, 0.015)))
}

/// A car's door without its window, 0.62 m along y and 0.42 m high, its outside towards −x: a panel that
/// bulges, with the window's edge along its top and a flat handle.
pub(super) fn car_door() -> Shape {
    Shape::Union(
        vec![
            Shape::Bent(Box::new(block(0.04, 0.62, 0.40, 0.012)), 1.5).at(0.0, 0.0, 0.55),
            Shape::Bent(Box::new(block(0.05, 0.60, 0.03, 0.012)), 1.5).at(0.0, 0.0, 0.745),
            Shape::Ellipsoid(Vector3::new(0.012, 0.07, 0.022)).at(-0.012, 0.17, 0.66),
        ],
        0.02,
    )
}
