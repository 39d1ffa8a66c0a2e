//! What can be wrong with a file or a tour of it.

use std::path::PathBuf;

use crate::instance::InstanceError;
use crate::tour::TourError;

/// What is wrong with a file, and on which line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TsplibError {
    /// The file cannot be read.
    #[error("cannot read {path}: {reason}")]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's words.
        reason: String,
    },
    /// A header key or section that no TSPLIB file has.
    #[error("line {line}: unknown keyword {key:?}")]
    UnknownKey {
        /// Line, from 1.
        line: usize,
        /// The word.
        key: String,
    },
    /// A known key with a value that cannot be handled.
    #[error("line {line}: {key} {value:?} is not supported")]
    UnknownValue {
        /// Line, from 1.
        line: usize,
        /// The key.
        key: String,
        /// Its value.
        value: String,
    },
    /// Something needed is not there.
    #[error("line {line}: missing {what}")]
    Missing {
        /// Line reached.
        line: usize,
        /// What is missing.
        what: &'static str,
    },
    /// A section ends early.
    #[error("line {line}: the file ends inside {what}")]
    Short {
        /// Line reached.
        line: usize,
        /// The section.
        what: &'static str,
    },
    /// Not a number.
    #[error("line {line}: {found:?} is not a usable number")]
    Number {
        /// Line, from 1.
        line: usize,
        /// The word.
        found: String,
    },
    /// Not a count.
    #[error("line {line}: {what} is {found:?}, expected a whole number of at least 0")]
    Count {
        /// Line, from 1.
        line: usize,
        /// What should be counted.
        what: &'static str,
        /// The word.
        found: String,
    },
    /// A node that does not exist.
    #[error("line {line}: node {number} is not between 1 and {nodes}")]
    NodeNumber {
        /// Line, from 1.
        line: usize,
        /// The number.
        number: usize,
        /// `DIMENSION`.
        nodes: usize,
    },
    /// A node given twice, or in two sets: sets must be disjoint.
    #[error("line {line}: node {node} is given twice; every node belongs to one set")]
    Twice {
        /// Line, from 1.
        line: usize,
        /// The node.
        node: usize,
    },
    /// A node without a set.
    #[error("line {line}: the sets end and node {node} is in none of them")]
    NoSet {
        /// Line reached.
        line: usize,
        /// The node.
        node: usize,
    },
    /// A set that does not exist.
    #[error("line {line}: set {set} is not between 1 and {sets}")]
    SetNumber {
        /// Line, from 1.
        line: usize,
        /// The number.
        set: usize,
        /// `GTSP_SETS`.
        sets: usize,
    },
    /// A set given twice.
    #[error("line {line}: set {set} is given twice")]
    SetTwice {
        /// Line, from 1.
        line: usize,
        /// The set.
        set: usize,
    },
    /// A set without nodes.
    #[error("line {line}: set {set} is empty")]
    EmptySet {
        /// Line, from 1.
        line: usize,
        /// The set.
        set: usize,
    },
    /// An explicit matrix of more nodes than are read.
    #[error("line {line}: an explicit matrix of {nodes} nodes is too large, at most {most}")]
    TooLarge {
        /// Line, from 1.
        line: usize,
        /// `DIMENSION`.
        nodes: usize,
        /// The limit.
        most: usize,
    },
    /// A tour names a node that the instance lacks.
    #[error("the tour visits node {number}, which the instance does not have")]
    TourNode {
        /// The number.
        number: usize,
    },
    /// The tour does not fit the instance.
    #[error("the tour does not fit the instance: {0}")]
    Tour(TourError),
    /// The parts do not make an instance.
    #[error("the file makes no instance: {0}")]
    Instance(InstanceError),
}
