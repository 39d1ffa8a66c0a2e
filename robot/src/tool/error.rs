//! Why there cannot be such a tool.

/// Why there cannot be such a tool.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ToolError {
    /// A number is out of its range, or none.
    #[error("tool: {field} is {value} {unit}: {low} to {high} {unit} is wanted")]
    Range {
        /// Which field.
        field: &'static str,
        /// What it is.
        value: f64,
        /// Its unit.
        unit: &'static str,
        /// The least.
        low: f64,
        /// The greatest.
        high: f64,
    },
    /// Two bounds the wrong way round.
    #[error("tool: {field} is [{low}, {high}] {unit}: the lesser one comes first, and they differ")]
    Order {
        /// Which field.
        field: &'static str,
        /// The first.
        low: f64,
        /// The second.
        high: f64,
        /// Their unit.
        unit: &'static str,
    },
    /// An axis that points nowhere.
    #[error(
        "tool: {field} is {axis:?}: an axis is wanted, three finite numbers that are not all 0"
    )]
    Axis {
        /// Which field.
        field: &'static str,
        /// What it is.
        axis: [f64; 3],
    },
    /// The two axes are parallel.
    #[error("tool: approach {approach:?} and across {across:?} are parallel: turn one of them")]
    Parallel {
        /// The one into the surface.
        approach: [f64; 3],
        /// The one along the pad's long side.
        across: [f64; 3],
    },
    /// A key that tools of this shape need is not there.
    #[error("tool: {field} is missing: a {shape} has one")]
    Missing {
        /// Which field.
        field: &'static str,
        /// The tool's shape.
        shape: &'static str,
    },
    /// A key that tools of this shape do not have.
    #[error("tool: {field} is no key of a {shape}: leave it out, or is shape another one?")]
    Foreign {
        /// Which field.
        field: &'static str,
        /// The tool's shape.
        shape: &'static str,
    },
}
