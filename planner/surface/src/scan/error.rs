//! What can be wrong with a scan.

use std::fmt;
use std::path::PathBuf;

use thiserror::Error;

use super::crop::CropBox;

/// Why a scan was refused.
#[derive(Debug, Error)]
pub enum ScanError {
    /// The file could not be opened or read.
    #[error("{}: cannot be read", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// The file's name and its first bytes match no supported format.
    #[error("{}: neither PCD, PLY, STL, OBJ, glTF, LAS, E57, PTX, NPY, XYZ nor CSV by its extension or first bytes", path.display())]
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// The file is of a format that is known but not read.
    #[error("{}: {format} files are not read; convert it: `{convert}`", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// Its format.
        format: &'static str,
        /// A command that makes a file of it that is read.
        convert: String,
    },
    /// The file breaks its own format.
    #[error("{}: {place}: {cause}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Where in the file.
        place: Place,
        /// What is wrong there.
        cause: String,
    },
    /// The file is sound but holds fewer finite points than a surface needs.
    #[error(
        "{}: {found} usable points (and {dropped} not finite); a surface needs at least {needed}",
        path.display()
    )]
    TooFew {
        /// The file.
        path: PathBuf,
        /// Finite points found.
        found: usize,
        /// Points dropped as not finite.
        dropped: usize,
        /// Least number accepted.
        needed: usize,
    },
    /// All points of the file are one and the same.
    #[error("{}: all {count} points lie at one place; is the sensor's lens covered?", path.display())]
    OnePlace {
        /// The file.
        path: PathBuf,
        /// How many points.
        count: usize,
    },
    /// Nothing is left after the crop.
    #[error(
        "the box from {:.3?} to {:.3?} m holds none of {points} points, which span {min:.3?} to \
         {max:.3?} m in the floor frame",
        <[f64; 3]>::from(region.min),
        <[f64; 3]>::from(region.max)
    )]
    EmptyCrop {
        /// The box.
        region: CropBox,
        /// Points before the crop.
        points: usize,
        /// Least corner of the placed scan. \[m\]
        min: [f64; 3],
        /// Greatest corner of the placed scan. \[m\]
        max: [f64; 3],
    },
    /// Cleaning left too little to plan on.
    #[error(
        "{left} of {points} points are left after cleaning, {needed} are needed: the points form \
         no surface at the scale of {radius:.3} m (too sparse, one line, or not in metres)"
    )]
    NoSurface {
        /// Points before cleaning.
        points: usize,
        /// Points after cleaning.
        left: usize,
        /// Least number accepted.
        needed: usize,
        /// The neighbourhood in which a surface was sought. \[m\]
        radius: f64,
    },
}

/// Where in a file something is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// A line, counted from 1.
    Line(usize),
    /// A byte, counted from 0.
    Byte(usize),
    /// Somewhere: the library that reads the format does not say where.
    File,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "line {line}"),
            Self::Byte(byte) => write!(f, "byte {byte}"),
            Self::File => write!(f, "the file"),
        }
    }
}

/// A format error before it is tied to a file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Malformed {
    pub(super) place: Place,
    pub(super) cause: String,
}

/// Shorthand for the parsers.
pub(super) fn malformed<T>(place: Place, cause: impl Into<String>) -> Result<T, Malformed> {
    Err(Malformed { place, cause: cause.into() })
}
