//! A part of a scan as the surface to work on.

use nalgebra::Vector3;

use super::clean::{CleanConfig, CleanReport, clean};
use super::cloud::{MIN_POINTS, Scan};
use super::crop::CropBox;
use super::error::ScanError;
use super::place::PlacedScan;

/// Cleans what lies in a box of the floor frame as one scan. In a scene of a whole room the surface
/// so keeps the density that [`clean()`] of all points would thin away, and its border is smoothed
/// with what continues beyond it. What lies around it is in [`measured()`](super::measured()).
///
/// # Errors
/// [`ScanError::EmptyCrop`] if nothing lies in the box, or as [`clean()`].
pub fn clean_region(
    scan: &PlacedScan,
    region: &CropBox,
    config: &CleanConfig,
) -> Result<(Scan, CleanReport), ScanError> {
    // Refuses an empty box before its margin is taken for content.
    scan.crop(region)?;
    let margin = Vector3::repeat(2.0 * config.radius);
    let grown = CropBox { min: region.min - margin, max: region.max + margin };
    let (whole, report) = clean(&scan.crop(&grown)?, config)?;
    let surface = whole.cropped(region);
    if surface.points.len() < MIN_POINTS {
        return Err(ScanError::NoSurface {
            points: scan.len(),
            left: surface.points.len(),
            needed: MIN_POINTS,
            radius: report.radius,
        });
    }
    Ok((surface, report))
}
