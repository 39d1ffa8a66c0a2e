//! Scans: files of points or meshes become cleaned points with normals in the floor frame.
//!
//! The stages, in order: [`read()`] parses a file into a [`RawScan`] in the file's own frame
//! (a depth camera's optical frame: x right, y down, z forward, sensor at the origin), [`place()`]
//! moves it into the floor frame (z up, floor at z = 0), and [`clean()`] merges, filters and
//! smooths it into a [`Scan`], the only form in which the later stages see a surface. Several
//! views are placed apart and joined with [`PlacedScan::join`] before cleaning.
//!
//! A file is untrusted. Whatever its bytes, `read` returns points or a [`ScanError`] that names
//! the file, the line or byte and the cause; it never allocates from a count in a header.

mod clean;
mod cloud;
mod colour;
mod columns;
mod crop;
mod decode;
mod e57;
mod error;
mod faces;
mod foreign;
mod gltf;
mod guarded;
mod inside;
mod las;
mod loose;
mod measured;
mod mesh;
mod normals;
mod npy;
mod parsed;
mod pcd;
mod pieces;
mod place;
mod ply;
mod ply_text;
mod ptx;
mod raw;
mod read;
mod region;
mod rows;
mod sample;
mod stray;
mod text;
mod warning;
mod winding;

pub use clean::{CleanConfig, CleanReport, clean};
pub use cloud::Scan;
pub use crop::CropBox;
pub use error::{Place, ScanError};
pub use measured::{Measured, measured};
pub use place::{PlacedScan, Placement, View, below_support, place};
pub use raw::RawScan;
pub use read::{Format, ReadOptions, read, read_bytes};
pub use region::clean_region;
pub use warning::{Rest, ScanWarning};
