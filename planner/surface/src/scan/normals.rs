//! Normals of a cloud: estimated in a neighbourhood, then oriented.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BinaryHeap};

use nalgebra::{Point3, UnitVector3};
use rayon::prelude::*;

use crate::fit::{PlaneFit, weight};
use crate::grid::Grid;

/// Fewest neighbours of which a normal is made.
const MIN_NEIGHBOURS: usize = 6;

/// Points whose neighbours lie on a line, the shorter axis holding less than this share of the
/// longer one's variance, have no normal.
const LINE_RATIO: f64 = 0.02;

/// The normal of each point by the plane of its weighted neighbourhood, up to sign; `None` where
/// the neighbours do not span a surface. Only neighbours for which `related(point, neighbour)`
/// holds count.
pub(super) fn estimate(
    points: &[Point3<f64>],
    grid: &Grid,
    radius: f64,
    related: impl Fn(usize, usize) -> bool + Sync,
) -> Vec<Option<UnitVector3<f64>>> {
    points
        .par_iter()
        .enumerate()
        .map(|(i, point)| {
            let mut fit = PlaneFit::new(*point);
            let mut count = 0;
            grid.within(point, radius, |j, neighbour, squared| {
                if related(i, j as usize) {
                    count += 1;
                    fit.add(neighbour, weight(squared / (radius * radius)));
                }
            });
            let plane = fit.solve().filter(|_| count >= MIN_NEIGHBOURS)?;
            let [_, shorter, longer] = plane.variances;
            (shorter > LINE_RATIO * longer).then_some(plane.normal)
        })
        .collect()
}

/// Turns normals without any sensor to point outwards and agree with their neighbours': along a
/// minimum spanning tree of the neighbourhood graph, whose edges cost the change of direction, so
/// that the sign travels over smooth surface first (Hoppe et al. 1992). Each connected part then
/// takes the sign by which its outermost points look outwards.
pub(super) fn orient_outwards(
    points: &[Point3<f64>],
    normals: &mut [UnitVector3<f64>],
    grid: &Grid,
    radius: f64,
) {
    let mut done = vec![false; points.len()];
    for start in 0..points.len() {
        if done[start] {
            continue;
        }
        let mut part = Vec::new();
        let mut heap = BinaryHeap::from([Step { cost: 0.0, from: start, to: start }]);
        while let Some(Step { from, to, .. }) = heap.pop() {
            if done[to] {
                continue;
            }
            done[to] = true;
            part.push(to);
            if normals[from].dot(&normals[to]) < 0.0 {
                normals[to] = -normals[to];
            }
            grid.within(&points[to], radius, |next, _, _| {
                let next = next as usize;
                if !done[next] {
                    let cost = 1.0 - normals[to].dot(&normals[next]).abs();
                    heap.push(Step { cost, from: to, to: next });
                }
            });
        }
        if outward_vote(points, normals, &part, radius) < 0.0 {
            for &i in &part {
                normals[i] = -normals[i];
            }
        }
    }
}

/// How much the points that are seen first from above and from the four sides look towards the
/// viewer. Not from below: a sheet has both sides there, and an object stands on its own.
fn outward_vote(
    points: &[Point3<f64>],
    normals: &[UnitVector3<f64>],
    part: &[usize],
    column: f64,
) -> f64 {
    let views = [(2, 1.0), (0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)];
    let votes = views.iter().map(|&(axis, sign)| {
        let mut foremost: BTreeMap<[i64; 2], usize> = BTreeMap::new();
        for &i in part {
            let at = |other: usize| (points[i][(axis + other) % 3] / column).floor() as i64;
            let first = foremost.entry([at(1), at(2)]).or_insert(i);
            if sign * points[i][axis] > sign * points[*first][axis] {
                *first = i;
            }
        }
        foremost.values().map(|&i| sign * normals[i][axis]).sum::<f64>()
    });
    votes.sum()
}

/// One edge of the spanning tree; the greatest in the heap's order is the cheapest, ties by index.
#[derive(PartialEq)]
struct Step {
    cost: f64,
    from: usize,
    to: usize,
}

impl Eq for Step {}

impl Ord for Step {
    fn cmp(&self, other: &Self) -> Ordering {
        other
            .cost
            .total_cmp(&self.cost)
            .then_with(|| (other.to, other.from).cmp(&(self.to, self.from)))
    }
}

impl PartialOrd for Step {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_of_a_sphere_point_outwards_without_a_sensor() {
        // A Fibonacci sphere: even points without any symmetry that could hide a sign.
        let points: Vec<Point3<f64>> = (0..2000)
            .map(|i| {
                let z = 1.0 - (f64::from(i) + 0.5) / 1000.0;
                let (s, c) = libm::sincos(f64::from(i) * 2.399_963);
                let r = (1.0 - z * z).sqrt();
                Point3::new(0.2 * r * c, 0.2 * r * s, 0.2 * z)
            })
            .collect();
        let grid = Grid::new(&points, 0.05);
        let mut normals: Vec<UnitVector3<f64>> = estimate(&points, &grid, 0.05, |_, _| true)
            .into_iter()
            .map(|n| n.expect("a sphere has normals everywhere"))
            .collect();
        orient_outwards(&points, &mut normals, &grid, 0.02);
        for (point, normal) in points.iter().zip(&normals) {
            assert!(normal.dot(&point.coords.normalize()) > 0.995);
        }
    }

    #[test]
    fn points_on_a_line_have_no_normal() {
        let points: Vec<_> =
            (0..100).map(|i| Point3::new(0.001 * f64::from(i), 0.0, 0.0)).collect();
        let grid = Grid::new(&points, 0.02);
        assert!(estimate(&points, &grid, 0.02, |_, _| true).iter().all(Option::is_none));
    }
}
