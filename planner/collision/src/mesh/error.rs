//! Why a mesh cannot be used.

use std::path::PathBuf;

/// Why a mesh cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum MeshError {
    /// The URI names a package that is in none of the places looked at.
    #[error("no package `{package}` with {file} in it; looked {looked}")]
    UnknownPackage {
        /// The package's name.
        package: String,
        /// The mesh's path in it.
        file: String,
        /// Where it was looked for, in words.
        looked: String,
    },
    /// Only `package://`, `file://` and plain paths are understood.
    #[error("`{uri}` is neither package://, file:// nor a path")]
    Scheme {
        /// The URI.
        uri: String,
    },
    /// The file cannot be read.
    #[error("{}: {error}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        error: std::io::Error,
    },
    /// Only STL is read.
    #[error("{}: not an STL file; convert the collision mesh to STL", path.display())]
    Format {
        /// The file.
        path: PathBuf,
    },
    /// The file is cut short or its text is no STL.
    #[error("{}: broken STL: {what}", path.display())]
    Broken {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: String,
    },
    /// The vertices span no volume.
    #[error("{}: its {vertices} vertices span no volume, so there is no convex hull", path.display())]
    Flat {
        /// The file.
        path: PathBuf,
        /// Number of vertices read.
        vertices: usize,
    },
}
