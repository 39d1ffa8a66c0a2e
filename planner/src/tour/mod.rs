//! In which order the patches are visited.

pub mod formulation;
pub mod joint;
pub mod raster;
