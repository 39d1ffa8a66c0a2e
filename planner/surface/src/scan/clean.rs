//! From placed views to a [`Scan`]: merge, filter, estimate normals, smooth.

use std::collections::{BTreeMap, HashMap};

use nalgebra::{Point3, UnitVector3, Vector3};
use rayon::prelude::*;

use super::cloud::{MIN_POINTS, Scan};
use super::error::ScanError;
use super::loose;
use super::normals;
use super::place::PlacedScan;
use crate::fit::{HeightFit, weight};
use crate::grid::Grid;

/// How to clean.
#[derive(Clone, Debug, PartialEq)]
pub struct CleanConfig {
    /// Points of one view within one cube of this side become their mean before smoothing, and those
    /// of all views after it. \[m\]
    pub voxel: f64,
    /// The voxel grows until no more points than this are left.
    pub max_points: usize,
    /// A point is an outlier if its mean distance to this many neighbours …
    pub outlier_neighbours: usize,
    /// … exceeds the mean of all points by this many standard deviations.
    pub outlier_deviations: f64,
    /// Radius of the neighbourhood for normals and smoothing; at least three spacings are taken,
    /// about 28 points on an even surface. A Kinect's noise of 5 mm at 2 m asks for 25 mm. \[m\]
    pub radius: f64,
}

impl Default for CleanConfig {
    fn default() -> Self {
        Self {
            voxel: 0.004,
            max_points: 60_000,
            outlier_neighbours: 16,
            outlier_deviations: 3.0,
            radius: 0.025,
        }
    }
}

/// What cleaning did.
#[derive(Clone, Debug, PartialEq)]
pub struct CleanReport {
    /// Points before.
    pub points: usize,
    /// Points after.
    pub kept: usize,
    /// Points merged into others.
    pub merged: usize,
    /// Points left out of the surface as outliers or farther than 20 m from the scan's middle.
    pub outliers: usize,
    /// Points left out of it because their neighbours form no surface.
    pub loose: usize,
    /// Points kept that are among those left out of the surface: each is a thing by itself.
    pub single: usize,
    /// The voxel used. \[m\]
    pub voxel: f64,
    /// The neighbourhood used. \[m\]
    pub radius: f64,
    /// Root mean square distance by which smoothing moved the points: the sensor's noise. \[m\]
    pub noise: f64,
}

/// Farthest that a point may lie from the median of its scan. \[m\]
const MAX_DISTANCE: f64 = 20.0;

/// Neighbours whose normals differ by this angle weigh 1/e in smoothing, so that it does not round
/// edges off. \[rad\]
const EDGE_ANGLE: f64 = 0.45;

/// Cleans views into one scan: points of each view are merged by voxels, outliers dropped, normals
/// estimated within each view and oriented (to the normals of the file, else to the sensor, else
/// outwards), then all points are smoothed on all views by a moving least squares fit that weighs
/// neighbours by distance and by agreement of normals (as Öztireli, Guennebaud & Gross 2009). Of views
/// without a sensor every point is a thing: those that the surface leaves out are there again at its
/// end, as they were measured, within 20 m of the scan's middle and up to `max_points` in all. What is
/// not among them is no part of the surface, but [`measured()`](super::measured()) all the same.
///
/// # Errors
/// [`ScanError::NoSurface`] when fewer than 15 points are left.
pub fn clean(scan: &PlacedScan, config: &CleanConfig) -> Result<(Scan, CleanReport), ScanError> {
    let total = scan.len();
    let middle = middle(scan);
    let belongs = |p: &Point3<f64>| (p - middle).norm() <= MAX_DISTANCE;
    let mut samples = gather(scan, belongs);
    let near = samples.len();
    let voxel = merge(&mut samples, config.voxel, config.max_points);
    let merged = near - samples.len();
    let before = samples.len();
    drop_outliers(&mut samples, config);
    let outliers = total - near + before - samples.len();

    let spacing = median_spacing(&positions(&samples));
    let radius = config.radius.max(3.0 * spacing);
    let before = samples.len();
    let (points, normals) = with_normals(&mut samples, scan, radius);
    let loose = before - points.len();
    if points.len() < MIN_POINTS {
        return Err(ScanError::NoSurface {
            points: total,
            left: points.len(),
            needed: MIN_POINTS,
            radius,
        });
    }
    let (smooth, normals) = smooth(&points, &normals, radius);
    let squares: f64 = smooth.iter().zip(&points).map(|(a, b)| (a - b).norm_squared()).sum();
    let noise = (squares / points.len() as f64).sqrt();
    let smooth = merge_layers(&smooth, &normals, &points, voxel);
    let spacing = median_spacing(&smooth.points);
    let merged = merged + points.len() - smooth.points.len();
    let (sheet, room) =
        (smooth.points.len(), config.max_points.saturating_sub(smooth.points.len()));
    let scan = loose::join(Scan { spacing, ..smooth }, scan, voxel, room, belongs);
    let report = CleanReport {
        points: total,
        kept: scan.points.len(),
        merged,
        outliers,
        loose,
        single: scan.points.len() - sheet,
        voxel,
        radius,
        noise,
    };
    Ok((scan, report))
}

/// A point with what its view says of it.
#[derive(Clone)]
struct Sample {
    point: Point3<f64>,
    /// The file's normal, zero if it has none.
    hint: Vector3<f64>,
    view: usize,
}

fn positions(samples: &[Sample]) -> Vec<Point3<f64>> {
    samples.iter().map(|s| s.point).collect()
}

/// The median of all points, axis by axis.
fn middle(scan: &PlacedScan) -> Point3<f64> {
    let points = || scan.views.iter().flat_map(|view| &view.points);
    let median = [0, 1, 2].map(|axis| {
        let mut values: Vec<f64> = points().map(|p| p[axis]).collect();
        median(&mut values).unwrap_or(0.0)
    });
    Point3::from(median)
}

/// All points that belong to the surface.
fn gather(scan: &PlacedScan, belongs: impl Fn(&Point3<f64>) -> bool) -> Vec<Sample> {
    let mut samples = Vec::with_capacity(scan.len());
    for (view, content) in scan.views.iter().enumerate() {
        for (i, &point) in content.points.iter().enumerate() {
            let hint = content.normals.as_ref().map_or(Vector3::zeros(), |n| n[i].into_inner());
            samples.push(Sample { point, hint, view });
        }
    }
    samples.retain(|s| belongs(&s.point));
    samples
}

/// Merges the samples of each view by voxel, widening it until at most `max_points` are left.
/// Returns the voxel used.
fn merge(samples: &mut Vec<Sample>, voxel: f64, max_points: usize) -> f64 {
    // Below a tenth of a millimetre the keys would leave their range; no depth sensor sees that.
    let mut voxel = voxel.max(1e-4);
    let key = |sample: &Sample, voxel: f64| {
        (sample.view, [0, 1, 2].map(|axis| (sample.point[axis] / voxel).floor() as i64))
    };
    loop {
        // Counted before they are made: of millions of points, nearly as many cells would be there.
        let mut keys: Vec<(usize, [i64; 3])> = samples.iter().map(|s| key(s, voxel)).collect();
        keys.par_sort_unstable();
        keys.dedup();
        let count = keys.len();
        drop(keys);
        if count <= max_points {
            // A tree map, as the order of a hash map is not that of the last run.
            let mut cells: BTreeMap<(usize, [i64; 3]), (Sample, f64)> = BTreeMap::new();
            for sample in samples.iter() {
                cells
                    .entry(key(sample, voxel))
                    .and_modify(|(sum, count)| {
                        sum.point += sample.point.coords;
                        sum.hint += sample.hint;
                        *count += 1.0;
                    })
                    .or_insert_with(|| (sample.clone(), 1.0));
            }
            let mean = |(mut sum, count): (Sample, f64)| {
                sum.point /= count;
                sum
            };
            *samples = cells.into_values().map(mean).collect();
            return voxel;
        }
        // Points on a surface thin out with the square of the voxel.
        let ratio = (count as f64 / max_points.max(1) as f64).sqrt();
        voxel *= ratio.clamp(1.05, 4.0);
    }
}

/// Drops points that lie apart from the others: whose mean distance to their neighbours stands out
/// (Rusu, Marton, Blodow, Dolha & Beetz 2008).
fn drop_outliers(samples: &mut Vec<Sample>, config: &CleanConfig) {
    let points = positions(samples);
    if points.len() <= config.outlier_neighbours {
        return;
    }
    let spacing = median_spacing(&points);
    let reach = spacing * (config.outlier_neighbours as f64).sqrt() * 1.5;
    let grid = Grid::new(&points, reach);
    let distances: Vec<f64> = points
        .par_iter()
        .map(|point| mean_distance(point, &grid, reach, config.outlier_neighbours))
        .collect();
    let count = distances.len() as f64;
    let mean = distances.iter().sum::<f64>() / count;
    let variance = distances.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / count;
    let limit = mean + config.outlier_deviations * variance.sqrt();
    let mut distance = distances.iter();
    samples.retain(|_| distance.next().is_some_and(|&d| d <= limit));
}

/// Mean distance to the `wanted` nearest neighbours. Those beyond twice `reach` count as that far:
/// it decides that the point is an outlier and bounds the search.
fn mean_distance(point: &Point3<f64>, grid: &Grid, reach: f64, wanted: usize) -> f64 {
    let mut squared = Vec::with_capacity(4 * wanted);
    for radius in [reach, 2.0 * reach] {
        squared.clear();
        grid.within(point, radius, |_, _, d| squared.push(d));
        if squared.len() > wanted {
            break;
        }
    }
    // The point itself is its own nearest.
    let nearest = squared.len().min(wanted + 1);
    if nearest < squared.len() {
        squared.select_nth_unstable_by(nearest - 1, f64::total_cmp);
    }
    let missing = wanted + 1 - nearest;
    let sum: f64 = squared[..nearest].iter().map(|d| d.sqrt()).sum();
    (sum + missing as f64 * 2.0 * reach) / wanted as f64
}

/// The samples that have a normal, with the normal oriented; the others are dropped.
fn with_normals(
    samples: &mut Vec<Sample>,
    scan: &PlacedScan,
    radius: f64,
) -> (Vec<Point3<f64>>, Vec<UnitVector3<f64>>) {
    let points = positions(samples);
    let grid = Grid::new(&points, radius);
    // Within one view, and on one side of a thin wall where the file knows its sides: two views of
    // a plate from both sides would give the plane in its middle.
    let estimated = normals::estimate(&points, &grid, radius, |i, j| {
        samples[i].view == samples[j].view && samples[i].hint.dot(&samples[j].hint) >= 0.0
    });
    let mut normal = estimated.iter();
    samples.retain(|_| normal.next().is_some_and(Option::is_some));
    let mut normals: Vec<UnitVector3<f64>> = estimated.into_iter().flatten().collect();
    let points = positions(samples);

    let mut unknown = Vec::new();
    for (i, sample) in samples.iter().enumerate() {
        let towards = match scan.views[sample.view].sensor {
            _ if sample.hint.norm() > 1e-6 => sample.hint,
            Some(sensor) => sensor - sample.point,
            None => {
                unknown.push(i);
                continue;
            }
        };
        if normals[i].dot(&towards) < 0.0 {
            normals[i] = -normals[i];
        }
    }
    if !unknown.is_empty() {
        let loose: Vec<Point3<f64>> = unknown.iter().map(|&i| points[i]).collect();
        let mut turned: Vec<_> = unknown.iter().map(|&i| normals[i]).collect();
        let reach = 0.6 * radius;
        normals::orient_outwards(&loose, &mut turned, &Grid::new(&loose, reach), reach);
        for (&i, n) in unknown.iter().zip(turned) {
            normals[i] = n;
        }
    }
    (points, normals)
}

/// Moves each point along its normal onto the local surface of its neighbours.
fn smooth(
    points: &[Point3<f64>],
    normals: &[UnitVector3<f64>],
    radius: f64,
) -> (Vec<Point3<f64>>, Vec<UnitVector3<f64>>) {
    let grid = Grid::new(points, radius);
    let sharpness = 1.0 / (2.0 * (1.0 - libm::cos(EDGE_ANGLE)));
    (0..points.len())
        .into_par_iter()
        .map(|i| {
            // The normal first, from neighbours that agree, then the height along it.
            let mut mean = Vector3::zeros();
            let alike = |j: u32, squared: f64| {
                let differs = 1.0 - normals[i].dot(&normals[j as usize]);
                weight(squared / (radius * radius)) * libm::exp(-2.0 * sharpness * differs)
            };
            grid.within(&points[i], radius, |j, _, squared| {
                mean += normals[j as usize].scale(alike(j, squared));
            });
            let normal = UnitVector3::try_new(mean, 1e-9).unwrap_or(normals[i]);
            let mut fit = HeightFit::new(points[i], &normal, radius);
            grid.within(&points[i], radius, |j, neighbour, squared| {
                fit.add(neighbour, alike(j, squared));
            });
            fit.solve().unwrap_or((points[i], normal))
        })
        .unzip()
}

/// The means of what lies in each voxel on one side of a sheet; the spacing is left at zero. The
/// sensor's noise spreads a surface over several layers of voxels, which smoothing lays onto each
/// other. A mean, as any choice by order would prefer one layer and shift the raw points.
fn merge_layers(
    points: &[Point3<f64>],
    normals: &[UnitVector3<f64>],
    raw: &[Point3<f64>],
    voxel: f64,
) -> Scan {
    let mut groups: Vec<(Vec<usize>, UnitVector3<f64>)> = Vec::new();
    let mut cells: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
    for (i, normal) in normals.iter().enumerate() {
        let key = [0, 1, 2].map(|axis| (points[i][axis] / voxel).floor() as i64);
        let sides = cells.entry(key).or_default();
        match sides.iter().find(|&&group| groups[group].1.dot(normal) > 0.0) {
            Some(&group) => groups[group].0.push(i),
            None => {
                sides.push(groups.len());
                groups.push((vec![i], *normal));
            }
        }
    }
    let mean = |members: &[usize], of: &[Point3<f64>]| {
        let sum: Vector3<f64> = members.iter().map(|&i| of[i].coords).sum();
        Point3::from(sum / members.len() as f64)
    };
    let normal = |members: &[usize], first: UnitVector3<f64>| {
        let sum: Vector3<f64> = members.iter().map(|&i| normals[i].into_inner()).sum();
        UnitVector3::try_new(sum, 1e-9).unwrap_or(first)
    };
    Scan {
        points: groups.iter().map(|(members, _)| mean(members, points)).collect(),
        normals: groups.iter().map(|(members, first)| normal(members, *first)).collect(),
        raw: groups.iter().map(|(members, _)| mean(members, raw)).collect(),
        spacing: 0.0,
    }
}

/// Median distance from a point to its nearest neighbour, over at most 2,000 of them.
fn median_spacing(points: &[Point3<f64>]) -> f64 {
    let first = points.first().map_or(Vector3::zeros(), |p| p.coords);
    let (lower, upper) =
        points.iter().fold((first, first), |(l, u), p| (l.inf(&p.coords), u.sup(&p.coords)));
    let extent = (upper - lower).norm().max(1e-6);
    // The spacing that an even surface as large as the bounding box would have.
    let guess = extent / (points.len().max(1) as f64).sqrt();
    let grid = Grid::new(points, guess);
    let stride = points.len().div_ceil(2000).max(1);
    let mut distances: Vec<f64> = (0..points.len())
        .step_by(stride)
        .filter_map(|i| grid.nearest(&points[i], extent, |j| j as usize != i))
        .map(|(_, squared)| squared.sqrt())
        .collect();
    median(&mut distances).unwrap_or(0.0)
}

fn median(values: &mut [f64]) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let middle = values.len() / 2;
    Some(*values.select_nth_unstable_by(middle, f64::total_cmp).1)
}
