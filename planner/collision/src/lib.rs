//! Collision: whether a configuration, or a motion, keeps its distance from robot and environment.
//!
//! Everything is in the robot's root frame. A [`World`] is built once per stance and then asked
//! from any number of threads. Its fast check proves freedom by bounds (spheres over each shape, a
//! distance grid over the scan) and falls back to exact distances where bounds do not suffice;
//! [`World::exact`] is the slow check by parry's shapes and every raw point, for verification.
//!
//! # What is checked
//! - Each shape that moves with the arm (the links' own shapes, attached objects, the tool's pad)
//!   against the robot's other shapes, with [`Margins::self_clearance`]. Left out are links that
//!   are rigid to each other, links joined by a joint, and shapes that always touch, or that an
//!   SRDF disables: [`World::excluded`] lists them with the [`Reason`]. The fast check also leaves
//!   out pairs that are proven never to come near each other; a joint more than 0.35 rad beyond its
//!   limits, where no proof was made, counts as a collision there.
//! - Each of them against the scan's points and the obstacles, with [`Margins::environment`].
//! - What does not move with the arm against the environment, once: [`World::stance_hit`].
//!
//! # The contact rule
//! With [`ToolContact::Allowed`] the pad may touch the scan. Its *prism* is the pad's rectangle
//! grown by [`Margins::contact_growth`] on all four sides, from [`Margins::contact_front`] before
//! the pad's plane back to the pad's back (its thickness). Scan points in the prism are contact:
//! the sponge is compressed there. So, for a scan point in the prism,
//! - the pad is never in collision with it;
//! - a shape that is rigid to the tip (palm, fingers, fingertips: they hold the sponge and end only
//!   11 mm behind its plane on the PR2, while a depth camera's noise is ±5 mm) is in collision only
//!   if the point lies deeper than [`Margins::contact_depth`] inside of it;
//! - every other shape keeps its full margin.
//!
//! Scan points outside the prism keep the full margin from every shape that is not rigid to the
//! tip. The pad keeps the smaller of it and `contact_growth`, the other shapes that are rigid to
//! the tip the smaller of it and [`Margins::contact_clearance`]: a flat surface beside the pad,
//! 11 mm before the fingertips, is then no collision, while anything behind the pad's back still
//! is. Obstacles are never contact.

mod bodies;
mod check;
mod clearance;
mod exact;
mod field;
mod frame;
mod mesh;
mod motion;
mod never;
mod pairs;
mod parts;
mod proof;
mod sieve;
mod solid;
mod spheres;
mod srdf;
#[cfg(test)]
mod tests;
mod world;

pub use exact::Exact;
pub use mesh::{MeshError, MeshPaths};
pub use pairs::{Excluded, Reason};
pub use srdf::{GroupState, SrdfError, group_states};
pub use world::World;

use nalgebra::{Isometry3, Point3, Vector3};
use nullsweep_robot::CollisionShape;
use std::path::PathBuf;

/// Distances to keep. \[m\]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margins {
    /// Between shapes of the robot.
    pub self_clearance: f64,
    /// Between the robot and the environment (scan points and obstacles).
    pub environment: f64,
    /// How far the contact prism reaches beyond the pad's sides; also the pad's own margin to
    /// scan points outside the prism while contact is allowed.
    pub contact_growth: f64,
    /// How far the contact prism reaches before the pad's plane.
    pub contact_front: f64,
    /// What shapes that are rigid to the tip keep from scan points outside the prism while contact
    /// is allowed.
    pub contact_clearance: f64,
    /// How deep a point of the contact prism may lie inside a shape that is rigid to the tip.
    pub contact_depth: f64,
}

impl Default for Margins {
    fn default() -> Self {
        Self {
            self_clearance: 0.005,
            environment: 0.005,
            contact_growth: 0.005,
            contact_front: 0.015,
            contact_clearance: 0.001,
            contact_depth: 0.005,
        }
    }
}

/// Whether the tool's pad may touch the scan: see the contact rule of this module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ToolContact {
    /// The pad works on the surface.
    Allowed,
    /// The tool too keeps its margin: transfers.
    Forbidden,
}

/// Something to keep away from besides the scan, in the root frame.
#[derive(Clone, Debug)]
pub struct Obstacle {
    /// For people.
    pub name: String,
    /// Its shape about its own origin.
    pub shape: ObstacleShape,
    /// Where it is.
    pub pose: Isometry3<f64>,
    /// The robot stands on it: only what moves with the arm is checked against it.
    pub carries_robot: bool,
}

/// The shape of an obstacle. \[m\]
#[derive(Clone, Debug)]
pub enum ObstacleShape {
    /// A cuboid about the origin.
    Box {
        /// Half of its size along x, y, z.
        half_extents: Vector3<f64>,
    },
    /// The convex hull of an STL file; a concave thing takes one file for each convex piece.
    Mesh {
        /// The file, in metres.
        path: PathBuf,
    },
    /// All that is below the plane z = 0: a floor.
    Floor,
}

impl Obstacle {
    /// The floor z = 0 of a floor frame that stands at `pose` in the root frame.
    #[must_use]
    pub fn floor(pose: Isometry3<f64>) -> Self {
        Self { name: "floor".into(), shape: ObstacleShape::Floor, pose, carries_robot: true }
    }
}

/// A held object that moves with a link.
#[derive(Clone, Debug)]
pub struct Attached {
    /// For people.
    pub name: String,
    /// The link that it is fixed to.
    pub link: String,
    /// Its shape, in the link's frame.
    pub shape: CollisionShape,
}

/// How a [`World`] is built.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Distances to keep.
    pub margins: Margins,
    /// Where collision meshes are found.
    pub meshes: MeshPaths,
    /// Radius \[m\] of capsules put along links whose mesh is missing, and along moving links with
    /// no collision shape at all; none: a missing mesh is an error.
    pub fit_capsules: Option<f64>,
    /// Pairs to leave out, instead of those found by sampling.
    pub srdf: Option<PathBuf>,
    /// Held objects.
    pub attached: Vec<Attached>,
}

/// Why a [`World`] could not be built.
#[derive(Debug, thiserror::Error)]
pub enum CollisionError {
    /// A link's (or attached object's) mesh cannot be used.
    #[error("collision mesh of {link}: {error}")]
    Mesh {
        /// The link or object.
        link: String,
        /// What is wrong with its mesh.
        error: MeshError,
    },
    /// An obstacle's mesh cannot be used.
    #[error("mesh of obstacle {obstacle}: {error}")]
    ObstacleMesh {
        /// The obstacle.
        obstacle: String,
        /// What is wrong with its mesh.
        error: MeshError,
    },
    /// A link that the robot does not have.
    #[error("{named_by} names link {link}, which the robot does not have")]
    UnknownLink {
        /// The link.
        link: String,
        /// Who names it.
        named_by: String,
    },
    /// The SRDF cannot be used.
    #[error(transparent)]
    Srdf(#[from] SrdfError),
    /// A scan point is NaN or infinite.
    #[error("scan point {index} is not finite: clean the scan first")]
    NotFinite {
        /// Index into the scan.
        index: usize,
    },
    /// A margin is negative or not a number.
    #[error("margin {name} is {value} m: it must be a number of at least 0")]
    Margin {
        /// Which one.
        name: &'static str,
        /// Its value. \[m\]
        value: f64,
    },
    /// More driven joints than the check can hold.
    #[error("{count} joints are driven by the arm (with mimics), at most {most} are supported")]
    TooManyBodies {
        /// Joints driven.
        count: usize,
        /// The most.
        most: usize,
    },
}

/// Two things closer than their margin.
#[derive(Clone, Debug, PartialEq)]
pub struct Hit {
    /// The link (or tool, or attached object).
    pub link: String,
    /// What it is too near to.
    pub with: With,
    /// Their distance, negative for a point inside a shape. \[m\]
    pub distance: f64,
    /// The distance they should keep. \[m\]
    pub margin: f64,
}

/// The other side of a [`Hit`].
#[derive(Clone, Debug, PartialEq)]
pub enum With {
    /// Another link (or the tool, or an attached object).
    Link(String),
    /// A scan point, in the root frame.
    ScanPoint(Point3<f64>),
    /// An obstacle.
    Obstacle(String),
}

impl std::fmt::Display for Hit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (distance, margin) = (1e3 * self.distance, 1e3 * self.margin);
        write!(f, "{} is {distance:.1} mm from ", self.link)?;
        match &self.with {
            With::Link(name) => write!(f, "{name}")?,
            With::Obstacle(name) => write!(f, "obstacle {name}")?,
            With::ScanPoint(p) => write!(f, "scan point ({:.3}, {:.3}, {:.3})", p.x, p.y, p.z)?,
        }
        write!(f, ", must keep {margin:.1} mm")
    }
}
