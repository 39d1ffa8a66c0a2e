//! What a depth camera has seen: files of points become a cleaned [`scan::Scan`], a continuous
//! [`sheet::Surface`] over it, and the planar [`patches`] that a tool has to visit. Knows no robot.

pub mod grid;
pub mod patches;
pub mod scan;
pub mod sheet;
pub mod simulate;

mod fit;
