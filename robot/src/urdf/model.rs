//! The kinematic tree: links, the joints between them, and their shapes.

use nalgebra::{Isometry3, UnitVector3, Vector3};

/// The tree itself.
#[derive(Debug)]
pub(crate) struct Model {
    pub(crate) name: String,
    pub(crate) links: Vec<Link>,
    pub(crate) joints: Vec<Joint>,
    /// The one link without a parent joint.
    pub(crate) root: usize,
    /// All joints, parents before children.
    pub(crate) order: Vec<usize>,
}

/// A rigid body.
#[derive(Clone, Debug)]
pub struct Link {
    /// Unique in the robot.
    pub name: String,
    /// Collision shapes; may be none.
    pub collisions: Vec<CollisionShape>,
    /// Collision shapes of size 0 in the URDF: points, which are no shapes and are not in
    /// `collisions`.
    pub empty_shapes: usize,
    /// Index of the joint that moves this link; none for the root.
    pub parent_joint: Option<usize>,
}

/// A shape that stands for a link, or a part of it, in collision checks.
#[derive(Clone, Debug, PartialEq)]
pub struct CollisionShape {
    /// Pose of the shape in the link frame.
    pub origin: Isometry3<f64>,
    /// The shape around its own origin.
    pub geometry: Geometry,
}

/// Geometry of a collision shape, centred on its origin. \[m\]
#[derive(Clone, Debug, PartialEq)]
pub enum Geometry {
    /// A cuboid.
    Box {
        /// Half of the size along x, y, z.
        half_extents: Vector3<f64>,
    },
    /// A cylinder along z.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Half of the length.
        half_length: f64,
    },
    /// A ball.
    Sphere {
        /// Radius.
        radius: f64,
    },
    /// A cylinder along z with half balls at its ends.
    Capsule {
        /// Radius of cylinder and balls.
        radius: f64,
        /// Half of the length of the cylinder without the balls.
        half_length: f64,
    },
    /// A mesh file, which this crate does not open.
    Mesh {
        /// As written in the URDF, for example `package://…`.
        uri: String,
        /// Scale along x, y, z.
        scale: Vector3<f64>,
    },
}

/// A joint between two links.
#[derive(Clone, Debug)]
pub struct Joint {
    /// Unique in the robot.
    pub name: String,
    /// How it moves.
    pub kind: JointKind,
    /// Index of the parent link.
    pub parent: usize,
    /// Index of the child link.
    pub child: usize,
    /// Pose of the joint frame in the parent link's frame.
    pub origin: Isometry3<f64>,
    /// Axis in the joint frame.
    pub axis: UnitVector3<f64>,
    /// `<limit>`; none where the URDF has none.
    pub limits: Option<HardLimits>,
    /// `<safety_controller>`; none where the URDF has none.
    pub safety: Option<SafetyController>,
    /// Follows another joint.
    pub mimic: Option<Mimic>,
    /// xyz and rpy as written: bits that do not depend on any sine.
    pub(crate) origin_text: [f64; 6],
}

/// How a joint moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// Not at all.
    Fixed,
    /// About its axis between limits. \[rad\]
    Revolute,
    /// About its axis without limits. \[rad\]
    Continuous,
    /// Along its axis between limits. \[m\]
    Prismatic,
}

/// `<limit>` of a joint. [rad, rad/s, rad/s², rad/s³; m for prismatic joints]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HardLimits {
    /// Lower end; −∞ for continuous joints.
    pub lower: f64,
    /// Upper end; +∞ for continuous joints.
    pub upper: f64,
    /// Largest speed.
    pub velocity: f64,
    /// Largest acceleration, where the URDF has one.
    pub acceleration: Option<f64>,
    /// Largest jerk, where the URDF has one.
    pub jerk: Option<f64>,
}

/// `<safety_controller>` of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SafetyController {
    /// Soft limits [rad or m]; none for continuous joints and where the URDF has none.
    pub soft: Option<(f64, f64)>,
    /// How the allowed speed grows with the distance to a soft limit. [1/s]
    pub k_position: Option<f64>,
}

/// A joint that follows another: position = multiplier · other + offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mimic {
    /// Index of the joint that is followed.
    pub joint: usize,
    /// Factor.
    pub multiplier: f64,
    /// Offset. [rad or m]
    pub offset: f64,
}

impl Joint {
    /// Whether the joint moves by itself: neither fixed nor following another.
    #[must_use]
    pub fn is_independent(&self) -> bool {
        self.kind != JointKind::Fixed && self.mimic.is_none()
    }
}
