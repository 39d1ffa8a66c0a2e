//! Why a URDF was refused.

use std::path::PathBuf;

/// Why a URDF was refused.
#[derive(Debug, thiserror::Error)]
pub enum UrdfError {
    /// The file could not be read.
    #[error("cannot read URDF {path}: {source}; check the path")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The text is not a URDF.
    #[error("not a valid URDF: {reason}")]
    Parse {
        /// What the parser said.
        reason: String,
    },
    /// The text is a xacro file.
    #[error("this is a xacro file, not a URDF: expand it with `xacro FILE > out.urdf`")]
    Xacro,
    /// There is no link.
    #[error("the URDF has no link")]
    Empty,
    /// A joint type without a single axis.
    #[error(
        "joint {joint} is {kind}: only fixed, revolute, continuous and prismatic are supported"
    )]
    UnsupportedJoint {
        /// The joint.
        joint: String,
        /// Its type.
        kind: String,
    },
    /// A name is used twice.
    #[error("{what} name {name} is used twice: names must be unique")]
    DuplicateName {
        /// `link` or `joint`.
        what: &'static str,
        /// The name.
        name: String,
    },
    /// A joint names a link that is not there.
    #[error("joint {joint} names link {link}, which the URDF does not have")]
    UnknownLink {
        /// The joint.
        joint: String,
        /// The missing link.
        link: String,
    },
    /// A link has two parent joints.
    #[error("link {link} is the child of both {first} and {second}: a robot must be a tree")]
    TwoParents {
        /// The link.
        link: String,
        /// A joint.
        first: String,
        /// Another joint.
        second: String,
    },
    /// More than one link has no parent.
    #[error("{} links have no parent joint ({}): a robot must have one root", roots.len(), roots.join(", "))]
    ManyRoots {
        /// The links.
        roots: Vec<String>,
    },
    /// Links that hang on each other in a circle.
    #[error("links {} form a cycle that is not connected to a root", links.join(", "))]
    Cycle {
        /// The links.
        links: Vec<String>,
    },
    /// NaN or infinity where a number must be.
    #[error("{what} of {name} is not a finite number")]
    NotFinite {
        /// Which value.
        what: &'static str,
        /// Joint or link.
        name: String,
    },
    /// The axis has no direction.
    #[error("the axis of joint {joint} is zero")]
    ZeroAxis {
        /// The joint.
        joint: String,
    },
    /// Lower above upper, or a negative limit.
    #[error("the {what} limits of joint {joint} are not in order: {lower} … {upper}")]
    BadLimits {
        /// The joint.
        joint: String,
        /// `hard`, `soft`, `velocity`, `acceleration` or `jerk`.
        what: &'static str,
        /// Lower end.
        lower: f64,
        /// Upper end.
        upper: f64,
    },
    /// A mimic joint that follows nothing, itself or a circle.
    #[error("joint {joint} mimics {other}, {reason}")]
    BadMimic {
        /// The joint.
        joint: String,
        /// The joint that it names.
        other: String,
        /// What is wrong.
        reason: &'static str,
    },
    /// A collision shape without size.
    #[error("a collision shape of link {link} has a size that is not positive")]
    BadGeometry {
        /// The link.
        link: String,
    },
}
