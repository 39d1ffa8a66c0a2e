//! What is wrong with regions.

use std::path::PathBuf;

/// Why regions cannot be taken.
#[derive(Debug, thiserror::Error)]
pub enum RegionError {
    /// The file cannot be read.
    #[error("cannot read {path}: {source}")]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It is no file of regions.
    #[error("{path}: not a file of regions: {cause}")]
    Parse {
        /// The file.
        path: PathBuf,
        /// Why not.
        cause: String,
    },
    /// A region is not as it may be.
    #[error("region {region}: {what}")]
    Region {
        /// Its name.
        region: String,
        /// What is wrong, and what is wanted.
        what: String,
    },
    /// A region holds no measured point.
    #[error(
        "region {region} holds no point of {of}: the nearest, at ({:.3}, {:.3}, {:.3}) of the floor \
         frame, is {distance_m:.3} m outside of it",
        nearest[0], nearest[1], nearest[2]
    )]
    Nothing {
        /// Its name.
        region: String,
        /// Of what.
        of: &'static str,
        /// The point that is nearest to it. \[m\]
        nearest: [f64; 3],
        /// How far it is away. \[m\]
        distance_m: f64,
    },
    /// All that a region holds belongs to others.
    #[error("all points of region {region} belong to region {other}, which comes before it")]
    Covered {
        /// Its name.
        region: String,
        /// The other one's.
        other: String,
    },
}
