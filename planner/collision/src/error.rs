//! Why a check could not be built.

use nullsweep_robot::ToolError;

use crate::mesh::MeshError;
use crate::srdf::SrdfError;

/// Why a check could not be built.
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
    /// A hull of an obstacle holds no volume.
    #[error("obstacle {obstacle} is flat, or a corner of it is not finite")]
    FlatObstacle {
        /// The obstacle.
        obstacle: String,
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
    /// There cannot be such a tool.
    #[error(transparent)]
    Tool(#[from] ToolError),
    /// More driven joints than the check can hold.
    #[error("{count} joints are driven by the arm (with mimics), at most {most} are supported")]
    TooManyBodies {
        /// Joints driven.
        count: usize,
        /// The most.
        most: usize,
    },
}
