//! Poses as they are read, or why they are not.

use std::path::PathBuf;

use nalgebra::Isometry3;

/// Poses from a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Poses {
    /// Of the tool in the robot's root frame, in pieces that are gone through without leaving off; none
    /// is empty. \[m\]
    pub segments: Vec<Vec<Isometry3<f64>>>,
    /// What had to be mended or guessed, in words.
    pub notes: Vec<String>,
}

impl Poses {
    /// All of them, one after the other.
    #[must_use]
    pub fn all(&self) -> Vec<Isometry3<f64>> {
        self.segments.concat()
    }
}

/// Why a file of poses cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum PosesError {
    /// The file cannot be read.
    #[error("{}: {source}", path.display())]
    File {
        /// Which file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A line is no pose, or no motion that can be followed.
    #[error("{}, line {line}: {what}; wanted is {wanted}", path.display())]
    Line {
        /// Which file.
        path: PathBuf,
        /// Counted from 1.
        line: usize,
        /// What is wrong.
        what: String,
        /// What is right.
        wanted: &'static str,
    },
    /// The file is no YAML or JSON.
    #[error("{}: {what}", path.display())]
    Syntax {
        /// Which file.
        path: PathBuf,
        /// What the parser says, with line and column.
        what: String,
    },
    /// Something that stands for a pose is none.
    #[error("{}, {place}: {what}", path.display())]
    Pose {
        /// Which file.
        path: PathBuf,
        /// Which pose, by the names and numbers that lead to it.
        place: String,
        /// What is wrong.
        what: String,
    },
    /// It is a plan.
    #[error(
        "{}: it is a plan, made of joint vectors, and no path of the tool: `planner publish` sends it, `planner view` shows it",
        path.display()
    )]
    Plan {
        /// Which file.
        path: PathBuf,
    },
    /// No pose at all.
    #[error("{}: no pose in it", path.display())]
    Empty {
        /// Which file.
        path: PathBuf,
    },
}
