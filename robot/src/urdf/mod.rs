//! URDF text to a checked kinematic tree.

mod error;
mod model;
mod read;
mod xml;

use std::path::Path;
use std::sync::Arc;

pub use error::UrdfError;
pub(crate) use model::Model;
pub use model::{
    CollisionShape, Geometry, HardLimits, Joint, JointKind, Link, Mimic, SafetyController,
};
use read::build;
use xml::{is_xacro, joint_facts};

/// A whole robot: one tree of links joined by joints, from a URDF.
///
/// Cheap to clone (the tree is shared).
#[derive(Clone, Debug)]
pub struct Robot {
    pub(crate) model: Arc<Model>,
}

impl Robot {
    /// Reads a URDF file.
    ///
    /// # Errors
    /// When the file cannot be read or is not one proper kinematic tree; see [`UrdfError`].
    pub fn from_urdf_file(path: &Path) -> Result<Self, UrdfError> {
        let text = std::fs::read_to_string(path)
            .map_err(|source| UrdfError::Read { path: path.to_owned(), source })?;
        Self::from_urdf_str(&text)
    }

    /// Reads a URDF from text.
    ///
    /// # Errors
    /// When the text is not one proper kinematic tree; see [`UrdfError`].
    pub fn from_urdf_str(xml: &str) -> Result<Self, UrdfError> {
        if is_xacro(xml) {
            return Err(UrdfError::Xacro);
        }
        let facts = joint_facts(xml).map_err(|reason| UrdfError::Parse { reason })?;
        let parsed = urdf_rs::read_from_string(xml)
            .map_err(|e| UrdfError::Parse { reason: e.to_string() })?;
        Ok(Self { model: Arc::new(build(&parsed, &facts)?) })
    }

    /// Name of the robot; may be empty.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.model.name
    }

    /// All links, in the order of the URDF.
    #[must_use]
    pub fn links(&self) -> &[Link] {
        &self.model.links
    }

    /// All joints, in the order of the URDF.
    #[must_use]
    pub fn joints(&self) -> &[Joint] {
        &self.model.joints
    }

    /// Index of the root link, whose frame is the root frame.
    #[must_use]
    pub fn root(&self) -> usize {
        self.model.root
    }

    /// Index of a link by name.
    #[must_use]
    pub fn link_index(&self, name: &str) -> Option<usize> {
        self.model.links.iter().position(|l| l.name == name)
    }
}
