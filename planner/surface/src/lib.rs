//! What a depth camera has seen, as a surface that a tool can follow.
//!
//! Files of points or meshes become a [`RawScan`], placed in the floor frame and cleaned to a
//! [`Scan`]: points with normals. [`patches`] cuts it into the planar pieces that a tool has to
//! visit; a [`Surface`] lies between its points and gives the line from one piece to the next.
//! [`mod@room`] finds the planes and objects of a whole scene, [`mod@register`] lays one view onto
//! others, [`mod@change`] says what is another way in a later scan. [`simulate`] makes scans where no camera is at hand. Nothing here knows a robot.
//!
//! All lengths are metres, all angles radians. The same input and seed give bit-identical results,
//! whatever the number of threads.
//!
//! ```
//! use nullsweep_surface::{
//!     CleanConfig, PatchConfig, Placement, Surface, SurfacePoint, clean, patches, place, simulate,
//! };
//!
//! // A file would be read with `nullsweep_surface::read`.
//! let view = simulate::bobby_car(1);
//! let (placed, _) = place(&view.scan, &Placement::SensorPose(view.sensor_pose));
//! let (scan, report) = clean(&placed, &CleanConfig::default())?;
//! println!("{} of {} points are kept", report.kept, report.points);
//!
//! let patches = patches::find(&scan, &PatchConfig::default(), 1);
//! assert!(patches.len() > 100);
//!
//! // From each patch to its neighbour on the surface, a point every centimetre.
//! let surface = Surface::new(&scan);
//! let end = |i: usize| SurfacePoint { point: patches[i].centre, normal: patches[i].normal };
//! let near = |i: &usize| (patches[*i].centre - patches[0].centre).norm() < 0.07;
//! for i in (1..patches.len()).filter(near) {
//!     if let Some(line) = surface.line(&end(0), &end(i), 0.01, 0.07) {
//!         assert_eq!(line.last(), Some(&end(i)));
//!     }
//! }
//! # Ok::<(), nullsweep_surface::ScanError>(())
//! ```

mod fit;
mod grid;
mod thin;

pub mod scan;

pub mod change;
pub mod register;
pub mod room;

pub mod patches;
mod sheet;
pub mod simulate;
pub mod unseen;

pub use grid::Grid;
pub use patches::{Patch, PatchConfig};
pub use scan::{
    CleanConfig, CropBox, Measured, PlacedScan, Placement, RawScan, ReadOptions, Scan, ScanError,
    clean, clean_region, measured, place, read,
};
pub use sheet::{Surface, SurfacePoint};
