//! Joint vectors at a place of the path: the samples of the search.

use std::collections::HashMap;

use nalgebra::Isometry3;
use nullsweep_robot::JointVector;
use rayon::prelude::*;

use crate::poses::{Point, Space};

/// Joint vectors at a place.
#[derive(Clone, Debug)]
pub(super) struct Layer {
    pub(super) segment: usize,
    /// Index of the place in its segment.
    pub(super) station: usize,
    pub(super) nodes: Vec<Point>,
}

/// A joint vector of a layer: its segment and place, and its number there.
pub(super) type Node = (usize, usize, u32);

impl Layer {
    /// The name of one of its joint vectors.
    pub(super) fn node(&self, index: usize) -> Node {
        (self.segment, self.station, index as u32)
    }
}

/// How densely a place is sampled.
#[derive(Clone, Copy, Debug)]
pub(super) struct Density {
    /// Joint vectors nearer than this are one. \[rad\]
    pub(super) apart: f64,
    /// Starts spread over the arm's ranges.
    pub(super) spread: usize,
    /// Most joint vectors.
    pub(super) most: usize,
}

/// Of a first look, and where it found no way on.
pub(super) const COARSE: Density = Density { apart: 0.15, spread: 48, most: 240 };
pub(super) const FINE: Density = Density { apart: 0.1, spread: 240, most: 600 };

/// Adds joint vectors that meet a pose, free of collision: first those that follow from others nearby,
/// so that a posture is kept from place to place, then, where they are asked for, what the inverse
/// kinematics and starts spread over the ranges give.
pub(super) fn extend(
    nodes: &mut Vec<Point>,
    space: &Space<'_>,
    pose: &Isometry3<f64>,
    others: &[Point],
    fresh: bool,
    density: Density,
) {
    let mut starts: Vec<JointVector> = others.iter().map(|point| point.q).collect();
    if fresh {
        starts.extend(space.seeds(pose, density.spread));
    }
    let found: Vec<Option<Point>> = starts.par_iter().map(|q| space.project(pose, q)).collect();
    let mut grid = Grid::new(density.apart);
    nodes.iter().enumerate().for_each(|(k, node)| grid.put(k, node));
    for point in found.into_iter().flatten() {
        if nodes.len() >= density.most {
            break;
        }
        if grid.is_new(nodes, &point) && space.is_free(&point) {
            grid.put(nodes.len(), &point);
            nodes.push(point);
        }
    }
}

/// Which joint vectors are near which, by cubes of the first three joints.
struct Grid {
    apart: f64,
    cubes: HashMap<[i64; 3], Vec<usize>>,
}

impl Grid {
    fn new(apart: f64) -> Self {
        Self { apart, cubes: HashMap::new() }
    }

    fn cube(&self, q: &JointVector) -> [i64; 3] {
        std::array::from_fn(|j| (q[j] / self.apart).floor() as i64)
    }

    fn put(&mut self, index: usize, point: &Point) {
        let cube = self.cube(&point.q);
        self.cubes.entry(cube).or_default().push(index);
    }

    fn is_new(&self, nodes: &[Point], point: &Point) -> bool {
        let [x, y, z] = self.cube(&point.q);
        let near = |cube: [i64; 3]| {
            let known = self.cubes.get(&cube).into_iter().flatten();
            known.into_iter().any(|&k| nodes[k].q.distance(&point.q) <= self.apart)
        };
        let around = -1..=1;
        !around
            .clone()
            .any(|i| around.clone().any(|j| around.clone().any(|k| near([x + i, y + j, z + k]))))
    }
}
