//! The report of a run: one HTML page that opens without a network.
//!
//! It shows the scan with what was swept, the patches with their normals and the reason of those
//! that cannot be reached, the graph, the way of the tool in contact and through the air, every
//! joint over time between its limits, and tables of figures. A second plan and measured motions
//! can stand beside the first. [`ReportData`] is plain vectors, so whoever has a plan or a
//! recording can fill it.

mod data;
mod joints;
mod page;
mod scene;

pub use data::{JointAxis, Motion, PatchMark, ReportData, ReportError, Table};
pub use page::{render, write};
