//! The report of a run: one HTML page that opens without a network.
//!
//! It opens on the figures that matter and, beside them, the scene in space: the robot's shapes
//! moving along the plan's time, the tool's path, the scan by what was swept, what is in the way.
//! A list says what is left and why, and flies there; joints, velocities and other quantities run
//! under it. [`ReportData`] is plain vectors, so whoever has a plan or a recording can fill it. The
//! page's script (`assets/`) is our own: WebGL 2 and a canvas, no library.
//!
//! ```
//! use nullsweep_report::{JointAxis, Motion, ReportData, render};
//!
//! let limits = Some((-2.0, 2.0));
//! let data = ReportData {
//!     title: "One joint".into(),
//!     joints: vec![JointAxis { name: "elbow".into(), unit: "rad", limits }],
//!     plans: vec![Motion {
//!         name: "plan".into(),
//!         times: vec![0.0, 1.0],
//!         joints: vec![vec![0.0, 0.5]],
//!         ..Motion::default()
//!     }],
//!     ..ReportData::default()
//! };
//! assert!(render(&data)?.contains("One joint"));
//! # Ok::<(), nullsweep_report::ReportError>(())
//! ```

mod data;
mod left;
mod log;
mod page;
mod ros;
mod wire;

pub use data::{
    Body, Cloud, Headline, JointAxis, LineSet, Look, Motion, PadCentre, Paint, Place, PlaceGroup,
    Probe, ReportData, ReportError, Series, Shape, Table, Tone,
};
pub use left::{LeftPoint, places};
pub use log::{LogError, write_log};
pub use page::{render, write};
