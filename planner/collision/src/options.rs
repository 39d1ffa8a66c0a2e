//! How a robot becomes shapes.

use std::path::PathBuf;

use nullsweep_robot::CollisionShape;

use crate::mesh::MeshPaths;
use crate::rules::Margins;

/// A held object that moves with a link.
#[derive(Clone, Debug)]
pub struct Attached {
    /// For people.
    pub name: String,
    /// The link that it is fixed to.
    pub link: String,
    /// Its shape, in the link's frame. \[m\]
    pub shape: CollisionShape,
}

/// How a check is built.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Distances to keep.
    pub margins: Margins,
    /// Where meshes of links, held objects and obstacles are found.
    pub meshes: MeshPaths,
    /// Radius \[m\] of capsules put along links whose mesh is missing, and along moving links with
    /// no collision shape at all; none: a missing mesh is an error.
    pub fit_capsules: Option<f64>,
    /// An SRDF file with the pairs of links to leave out, instead of those found by sampling.
    pub srdf: Option<PathBuf>,
    /// Held objects.
    pub attached: Vec<Attached>,
}
