//! A scan cut in two: the surface to work on, and everything around it.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};

use super::clean::{CleanConfig, CleanReport, clean};
use super::cloud::{MIN_POINTS, Scan};
use super::crop::CropBox;
use super::error::ScanError;
use super::place::PlacedScan;

/// Side of the cubes to which the surroundings are thinned. \[m\]
const SURROUNDINGS_VOXEL: f64 = 0.02;

/// Points that a cube of surroundings needs; a pixel that flies alone is no obstacle.
const SURROUNDINGS_POINTS: usize = 2;

/// A region and what lies around it.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// The surface inside the box, at full density.
    pub surface: Scan,
    /// The points outside, thinned to one in 2 cm: obstacles, no surface. \[m\]
    pub surroundings: Vec<Point3<f64>>,
    /// What cleaning the surface did.
    pub report: CleanReport,
}

/// Cleans what lies in a box of the floor frame as one scan and thins the rest. In a scene of a
/// whole room the surface so keeps the density that [`clean()`] of all points would thin away, and
/// its border is smoothed with what continues beyond it.
///
/// # Errors
/// [`ScanError::EmptyCrop`] if nothing lies in the box, or as [`clean()`].
pub fn clean_region(
    scan: &PlacedScan,
    region: &CropBox,
    config: &CleanConfig,
) -> Result<Region, ScanError> {
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
    Ok(Region { surface, surroundings: surroundings(scan, region), report })
}

/// Cleans the views of one object and thins those of all else that is in the way.
///
/// # Errors
/// As [`clean()`].
pub fn clean_apart(
    object: &PlacedScan,
    rest: &[Point3<f64>],
    config: &CleanConfig,
) -> Result<Region, ScanError> {
    let (surface, report) = clean(object, config)?;
    Ok(Region { surface, surroundings: thinned(rest.iter()), report })
}

fn surroundings(scan: &PlacedScan, region: &CropBox) -> Vec<Point3<f64>> {
    let points = scan.views.iter().flat_map(|view| &view.points);
    thinned(points.filter(|point| !region.contains(point)))
}

/// The means of the points in each cube, where there are enough.
fn thinned<'a>(points: impl Iterator<Item = &'a Point3<f64>>) -> Vec<Point3<f64>> {
    let mut cells: BTreeMap<[i64; 3], (Vector3<f64>, usize)> = BTreeMap::new();
    for point in points {
        let key = [0, 1, 2].map(|axis| (point[axis] / SURROUNDINGS_VOXEL).floor() as i64);
        let cell = cells.entry(key).or_insert((Vector3::zeros(), 0));
        cell.0 += point.coords;
        cell.1 += 1;
    }
    cells
        .into_values()
        .filter(|(_, count)| *count >= SURROUNDINGS_POINTS)
        .map(|(sum, count)| Point3::from(sum / count as f64))
        .collect()
}
