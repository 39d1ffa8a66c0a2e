//! The report of a run: one HTML page that opens without a network.
//!
//! It shows the scan with what was swept, the patches with their normals and the reason of those
//! that cannot be reached, the graph, the path of the tool in contact and through the air, every
//! joint over time between its limits, and tables of figures. A second plan and measured motions
//! can stand beside the first. [`ReportData`] is plain vectors, so whoever has a plan or a
//! recording can fill it.
//!
//! ```
//! use nullsweep_report::{JointAxis, Motion, ReportData, render};
//!
//! let data = ReportData {
//!     title: "One joint".into(),
//!     joints: vec![JointAxis { name: "elbow".into(), limits: Some((-2.0, 2.0)) }],
//!     plans: vec![Motion {
//!         name: "plan".into(),
//!         times: vec![0.0, 1.0],
//!         joints: vec![vec![0.0, 0.5]],
//!         ..Motion::default()
//!     }],
//!     ..ReportData::default()
//! };
//! assert!(render(&data)?.contains("Joints over time"));
//! # Ok::<(), nullsweep_report::ReportError>(())
//! ```

mod data;
mod joints;
mod page;
mod room;
mod scene;
mod style;

pub use data::{JointAxis, Motion, PatchMark, ReportData, ReportError, Table};
pub use page::{render, write};
pub use room::{RoomData, write_room};
