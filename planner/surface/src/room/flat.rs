//! Flat pieces of a cloud: planes by random samples (Fischler & Bolles 1981, with normals as
//! Schnabel, Wahl & Klein 2007), each with the largest part of it that hangs together.

use std::collections::{BTreeMap, HashMap};

use nalgebra::{Point3, UnitVector3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::fit::{PlaneFit, weight};
use crate::grid::Grid;
use crate::thin::thinned;

/// How far a sensor's points stray from a plane.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Noise {
    /// Where the sensors stood; none: not known. \[m\]
    pub(super) sensors: Vec<Point3<f64>>,
}

impl Noise {
    /// Tolerance at a point: a depth camera's error grows with the square of the distance. \[m\]
    pub(super) fn at(&self, point: &Point3<f64>) -> f64 {
        let squared = self.sensors.iter().map(|s| (s - point).norm_squared());
        let nearest = squared.fold(f64::INFINITY, f64::min);
        0.012 + if nearest.is_finite() { (0.0018 * nearest).min(0.05) } else { 0.004 }
    }
}

/// A flat piece.
#[derive(Clone, Debug)]
pub(super) struct Flat {
    pub(super) centroid: Point3<f64>,
    /// To one of both sides.
    pub(super) normal: UnitVector3<f64>,
    /// Thinned points of it. \[m\]
    pub(super) points: Vec<Point3<f64>>,
    /// How much of the plane they fill. \[m²\]
    pub(super) area: f64,
}

/// Least area of a piece. \[m²\]
const AREA: f64 = 0.15;
/// Most pieces.
const PIECES: usize = 16;
/// Planes tried for each piece.
const TRIALS: usize = 300;
/// Points on which a trial is judged.
const JURY: usize = 2_000;
/// The cosine of the greatest angle between a plane and the normal of its points.
const ALIKE: f64 = 0.8;
/// Side of the cells in which area is counted. \[m\]
const CELL: f64 = 0.05;
/// Cells between two parts of a plane that still hang together, as a thin thing's shadow parts them.
const GAP: i64 = 4;
/// Points of the thinned cloud across the scan.
const ACROSS: f64 = 200.0;

/// The means of the points in each voxel, and its side, by the size of the cloud. \[m\]
pub(super) fn thin(points: &[Point3<f64>]) -> (Vec<Point3<f64>>, f64) {
    let infinite = Vector3::repeat(f64::INFINITY);
    let grow = |(l, u): (Vector3<f64>, Vector3<f64>), p: &Point3<f64>| {
        (l.inf(&p.coords), u.sup(&p.coords))
    };
    let (lower, upper) = points.iter().fold((infinite, -infinite), grow);
    let side = ((upper - lower).norm() / ACROSS).clamp(0.005, 0.03);
    (thinned(points, side), side)
}

/// The flat pieces of a thinned cloud with its side, see [`thin`], in the order in which they were
/// found.
pub(super) fn find(points: &[Point3<f64>], side: f64, noise: &Noise, seed: u64) -> Vec<Flat> {
    let radius = 3.5 * side;
    let grid = Grid::new(points, radius);
    let normals: Vec<Option<UnitVector3<f64>>> =
        points.par_iter().map(|p| normal(p, &grid, radius)).collect();
    let mut free: Vec<usize> = (0..points.len()).filter(|&i| normals[i].is_some()).collect();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut flats = Vec::new();
    let mut failed = 0;
    while flats.len() < PIECES && failed < 4 && free.len() >= 50 {
        let on = |i: usize, point: &Point3<f64>, normal: &UnitVector3<f64>| {
            let p = &points[i];
            (p - point).dot(normal).abs() <= noise.at(p)
                && normals[i].is_some_and(|n| n.dot(normal).abs() > ALIKE)
        };
        let jury: Vec<usize> =
            (0..JURY.min(free.len())).map(|_| free[rng.random_range(0..free.len())]).collect();
        let trials: Vec<usize> =
            (0..TRIALS).map(|_| free[rng.random_range(0..free.len())]).collect();
        let votes: Vec<usize> = trials
            .par_iter()
            .map(|&i| {
                normals[i].map_or(0, |n| jury.iter().filter(|&&j| on(j, &points[i], &n)).count())
            })
            .collect();
        let Some(best) = (0..TRIALS).max_by_key(|&t| (votes[t], TRIALS - t)) else { break };
        let (mut point, mut turn) = (points[trials[best]], normals[trials[best]]);
        let mut inliers = Vec::new();
        for _ in 0..6 {
            let Some(normal) = turn else { break };
            inliers = free.iter().copied().filter(|&i| on(i, &point, &normal)).collect();
            let mut fit = PlaneFit::new(point);
            for &i in &inliers {
                fit.add(&points[i], 1.0);
            }
            let Some(plane) = fit.solve() else { break };
            (point, turn) = (plane.centroid, Some(plane.normal));
        }
        let Some(normal) = turn else { break };
        let (part, area) = largest_part(points, &inliers, &normal);
        if area < AREA {
            failed += 1;
            // What makes no piece this time is not tried again.
            free.retain(|i| *i != trials[best] && !part.contains(i));
            continue;
        }
        failed = 0;
        let of: Vec<Point3<f64>> = part.iter().map(|&i| points[i]).collect();
        let mut fit = PlaneFit::new(point);
        of.iter().for_each(|p| fit.add(p, 1.0));
        let taken: std::collections::HashSet<usize> = part.into_iter().collect();
        free.retain(|i| !taken.contains(i));
        if let Some(plane) = fit.solve() {
            let (centroid, normal) = (plane.centroid, plane.normal);
            flats.push(Flat { centroid, normal, points: of, area });
        }
    }
    flats
}

fn normal(point: &Point3<f64>, grid: &Grid, radius: f64) -> Option<UnitVector3<f64>> {
    let mut fit = PlaneFit::new(*point);
    let mut count = 0;
    grid.within(point, radius, |_, neighbour, squared| {
        count += 1;
        fit.add(neighbour, weight(squared / (radius * radius)));
    });
    let plane = fit.solve().filter(|_| count >= 6)?;
    (plane.variances[0] < 0.25 * plane.variances[1]).then_some(plane.normal)
}

/// The largest part that hangs together of points in a plane, and its area. \[m²\]
fn largest_part(
    points: &[Point3<f64>],
    members: &[usize],
    normal: &UnitVector3<f64>,
) -> (Vec<usize>, f64) {
    let [u, v] = super::outline::axes(normal);
    let mut cells: BTreeMap<[i64; 2], Vec<usize>> = BTreeMap::new();
    for &i in members {
        let key = [u, v].map(|axis| (points[i].coords.dot(&axis) / CELL).floor() as i64);
        cells.entry(key).or_default().push(i);
    }
    let mut part: HashMap<[i64; 2], usize> = HashMap::new();
    let mut parts: Vec<Vec<[i64; 2]>> = Vec::new();
    for &start in cells.keys() {
        if part.contains_key(&start) {
            continue;
        }
        part.insert(start, parts.len());
        let mut cluster = vec![start];
        let mut next = 0;
        while let Some(&[x, y]) = cluster.get(next) {
            next += 1;
            for near in (-GAP..=GAP).flat_map(|i| (-GAP..=GAP).map(move |j| [x + i, y + j])) {
                if cells.contains_key(&near) && !part.contains_key(&near) {
                    part.insert(near, parts.len());
                    cluster.push(near);
                }
            }
        }
        parts.push(cluster);
    }
    let Some(largest) = parts.iter().rev().max_by_key(|cluster| cluster.len()) else {
        return (Vec::new(), 0.0);
    };
    let of = largest.iter().flat_map(|key| cells[key].iter().copied()).collect();
    (of, largest.len() as f64 * CELL * CELL)
}
