//! Locally planar patches: the surface as the set of places that the tool has to visit.
//!
//! The paper's §III.A: draw a point at random, fit a plane by RANSAC to the remaining points in
//! its ε-neighbourhood, take the inliers as a patch if their root mean square error is small
//! enough, and go on until every point was taken or drawn.
//!
//! Points that end up in no patch (slivers between patches, isolated or strongly curved spots)
//! stay in none: the coverage is measured over all points of the scan, so they count.

use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::fit::PlaneFit;
use crate::grid::Grid;
use crate::scan::Scan;

/// How patches are found.
#[derive(Clone, Debug, PartialEq)]
pub struct PatchConfig {
    /// Radius of the neighbourhood; from the size of the tool. \[m\]
    pub epsilon: f64,
    /// Farthest that an inlier lies from its plane. \[m\]
    pub inlier_distance: f64,
    /// Greatest angle between an inlier's normal and its plane's. \[rad\]
    pub inlier_angle: f64,
    /// Greatest root mean square distance of the inliers from their plane. \[m\]
    pub max_rmse: f64,
    /// Planes tried for each patch.
    pub iterations: usize,
    /// Fewest inliers of a patch, whatever the density.
    pub min_points: usize,
    /// Least area of a patch as a share of the whole neighbourhood's, by the scan's density. The
    /// paper's 15 points in a full Kinect cloud are two in a hundred.
    pub min_share: f64,
}

impl Default for PatchConfig {
    fn default() -> Self {
        Self {
            epsilon: 0.04,
            inlier_distance: 0.010,
            inlier_angle: 60f64.to_radians(),
            max_rmse: 0.006,
            iterations: 40,
            min_points: 15,
            min_share: 0.02,
        }
    }
}

/// A fill-in patch gathers points within this share of the neighbourhood's radius: about half of
/// the pad's short side, so that a pad over it sweeps them at any heading.
const FILL_IN_SHARE: f64 = 0.8;

/// A locally planar piece of the surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// The inlier in the middle of the patch. Not its foot on the plane, which on a curved body
    /// lies some millimetres inside the surface that the tool has to touch. \[m\]
    pub centre: Point3<f64>,
    /// The plane's unit normal, on the side of the scan's normals.
    pub normal: UnitVector3<f64>,
    /// The inliers, as indices into the scan, ascending.
    pub points: Vec<u32>,
    /// Root mean square distance of the inliers from the plane. \[m\]
    pub rmse: f64,
}

impl Patch {
    /// The patch seen from another frame, for a scan moved by the same pose.
    #[must_use]
    pub fn transformed(&self, pose: &Isometry3<f64>) -> Self {
        Self { centre: pose * self.centre, normal: pose.rotation * self.normal, ..self.clone() }
    }
}

/// Patches over the points that `wanted` marks and that no motion has swept: where the pad has to
/// go besides. Each stands on one point, takes its normal and the wanted points around it whose
/// normals agree within `angle` \[rad\], the place with most of them first.
#[must_use]
pub fn fill_in(scan: &Scan, wanted: &[bool], config: &PatchConfig, angle: f64) -> Vec<Patch> {
    let indices: Vec<u32> = (0..wanted.len() as u32).filter(|&i| wanted[i as usize]).collect();
    let points: Vec<Point3<f64>> = indices.iter().map(|&i| scan.points[i as usize]).collect();
    if points.is_empty() {
        return Vec::new();
    }
    let grid = Grid::new(&points, config.epsilon);
    let reach = FILL_IN_SHARE * config.epsilon;
    let mut around: Vec<Vec<u32>> = Vec::with_capacity(points.len());
    for &i in &indices {
        let (centre, normal) = (&scan.points[i as usize], &scan.normals[i as usize]);
        let mut near = Vec::new();
        grid.within(centre, reach, |local, _, _| {
            let index = indices[local as usize];
            if scan.normals[index as usize].dot(normal) >= libm::cos(angle) {
                near.push(index);
            }
        });
        near.sort_unstable();
        around.push(near);
    }
    let mut open = wanted.to_vec();
    let mut patches = Vec::new();
    loop {
        let left = |k: usize| around[k].iter().filter(|&&i| open[i as usize]).count();
        let most = (0..indices.len()).map(|k| (left(k), std::cmp::Reverse(k))).max();
        let Some((count, std::cmp::Reverse(k))) = most.filter(|m| m.0 >= config.min_points) else {
            return patches;
        };
        let taken: Vec<u32> = around[k].iter().copied().filter(|&i| open[i as usize]).collect();
        debug_assert_eq!(taken.len(), count);
        for &i in &taken {
            open[i as usize] = false;
        }
        let i = indices[k] as usize;
        let (centre, normal) = (scan.points[i], scan.normals[i]);
        let squares: f64 =
            taken.iter().map(|&i| (scan.points[i as usize] - centre).dot(&normal).powi(2)).sum();
        let rmse = (squares / taken.len() as f64).sqrt();
        patches.push(Patch { centre, normal, points: taken, rmse });
    }
}

/// The patches of a scan. A seed gives the same patches on every machine.
#[must_use]
pub fn find(scan: &Scan, config: &PatchConfig, seed: u64) -> Vec<Patch> {
    let grid = Grid::new(&scan.points, config.epsilon);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut order: Vec<u32> = (0..scan.points.len() as u32).collect();
    order.shuffle(&mut rng);
    let full = median_neighbourhood(&grid, scan, config.epsilon);
    let least = config.min_points.max((config.min_share * full as f64) as usize);
    let mut taken = vec![false; scan.points.len()];
    let mut patches = Vec::new();
    let mut near = Vec::new();
    for drawn in order {
        if taken[drawn as usize] {
            continue;
        }
        near.clear();
        grid.within(&scan.points[drawn as usize], config.epsilon, |index, _, _| {
            if !taken[index as usize] {
                near.push(index);
            }
        });
        near.sort_unstable();
        if near.len() < least {
            continue;
        }
        if let Some(patch) = fit(scan, &near, least, config, &mut rng) {
            for &index in &patch.points {
                taken[index as usize] = true;
            }
            patches.push(patch);
        }
    }
    patches
}

/// The patches of the points that `wanted` marks, as if there were no others.
#[must_use]
pub fn find_among(scan: &Scan, wanted: &[bool], config: &PatchConfig, seed: u64) -> Vec<Patch> {
    let kept: Vec<u32> = (0..wanted.len() as u32).filter(|&i| wanted[i as usize]).collect();
    let mut found = find(&scan.of(&kept), config, seed);
    for point in found.iter_mut().flat_map(|patch| &mut patch.points) {
        *point = kept[*point as usize];
    }
    found
}

/// The points that a full neighbourhood of the radius holds: the median over the scan, as borders
/// hold fewer.
#[must_use]
pub fn full_neighbourhood(scan: &Scan, radius: f64) -> usize {
    median_neighbourhood(&Grid::new(&scan.points, radius), scan, radius)
}

fn median_neighbourhood(grid: &Grid, scan: &Scan, radius: f64) -> usize {
    let stride = scan.points.len().div_ceil(500).max(1);
    let mut counts: Vec<usize> = scan
        .points
        .iter()
        .step_by(stride)
        .map(|point| {
            let mut count = 0;
            grid.within(point, radius, |_, _, _| count += 1);
            count
        })
        .collect();
    counts.sort_unstable();
    counts.get(counts.len() / 2).copied().unwrap_or(0)
}

/// The plane with the most inliers, refitted to them, as a patch if it is good enough.
fn fit(
    scan: &Scan,
    near: &[u32],
    least: usize,
    config: &PatchConfig,
    rng: &mut ChaCha8Rng,
) -> Option<Patch> {
    let point = |index: u32| scan.points[index as usize];
    let aligned = libm::cos(config.inlier_angle);
    let inliers = |through: Point3<f64>, normal: &Vector3<f64>| -> Vec<u32> {
        let belongs = |&index: &u32| {
            (point(index) - through).dot(normal).abs() <= config.inlier_distance
                && scan.normals[index as usize].dot(normal) >= aligned
        };
        near.iter().copied().filter(belongs).collect()
    };
    let mut best: Vec<u32> = Vec::new();
    for _ in 0..config.iterations {
        let [a, b, c] = [0; 3].map(|_| near[rng.random_range(0..near.len())]);
        let cross = (point(b) - point(a)).cross(&(point(c) - point(a)));
        let Some(normal) = UnitVector3::try_new(cross, 1e-9) else { continue };
        let normal = facing(normal, &scan.normals[a as usize]);
        let found = inliers(point(a), &normal);
        if found.len() > best.len() {
            best = found;
        }
    }
    if best.len() < least {
        return None;
    }
    let mut plane = PlaneFit::new(point(best[0]));
    for &index in &best {
        plane.add(&point(index), 1.0);
    }
    let plane = plane.solve()?;
    let rmse = plane.variances[0].sqrt();
    if rmse > config.max_rmse {
        return None;
    }
    let mean: Vector3<f64> = best.iter().map(|&i| scan.normals[i as usize].into_inner()).sum();
    let normal = facing(plane.normal, &UnitVector3::try_new(mean, 1e-9)?);
    // The inliers may surround a patch found before: their mean could lie on it or over a hole, so
    // the inlier nearest to the mean is the middle.
    let middle = best.iter().copied().min_by(|&a, &b| {
        let apart = |index: u32| (point(index) - plane.centroid).norm_squared();
        apart(a).total_cmp(&apart(b))
    })?;
    let centre = point(middle);
    Some(Patch { centre, normal, points: best, rmse })
}

fn facing(normal: UnitVector3<f64>, towards: &UnitVector3<f64>) -> UnitVector3<f64> {
    if normal.dot(towards) < 0.0 { -normal } else { normal }
}
