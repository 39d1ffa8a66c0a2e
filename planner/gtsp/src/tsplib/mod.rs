//! TSPLIB and GTSPLIB files: instances read and written, tours read and written.

mod error;
mod read;
#[cfg(test)]
mod tests;
mod weights;
mod write;

pub use error::TsplibError;
pub use read::{GtspFile, parse_gtsp, parse_tour_numbers, read_gtsp};
pub use write::{Exported, export, write_tour};
