//! The way between stops: how far it is, and in which order it is least.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use nalgebra::Point3;
use nullsweep_gtsp::{Budget, Costs, Ends, Instance, Jump, solve};
use nullsweep_robot::wrap;
use nullsweep_surface::Grid;

use crate::workcell::{Scene, Stance};

/// Side of the squares of floor that a way goes over. \[m\]
const SQUARE: f64 = 0.1;
/// What the middle of a base keeps from what is there, at least. \[m\]
const CLEAR: f64 = 0.35;
/// Free floor around all stops that a way may use. \[m\]
const BESIDE: f64 = 1.2;
/// Around a stop the base is where it was found to stand, however near something is. \[m\]
const AT_STOP: f64 = 0.5;
/// What is lower is driven over, what is higher under. \[m\]
const TALL: [f64; 2] = [0.03, 1.6];
/// What a turn of 1 rad counts as. \[m/rad\]
const TURN: f64 = 0.2;
/// Trials of the order for each stop.
const TRIALS: u64 = 500;

/// The order of the stops that takes the least drive, begun and ended anywhere, and how long each way to
/// a stop is, the first 0. \[m\]
pub(super) fn order(scene: &Scene, stops: &[Stance], seed: u64) -> (Vec<usize>, Vec<f64>) {
    if stops.len() < 2 {
        return ((0..stops.len()).collect(), vec![0.0; stops.len()]);
    }
    let floor = Floor::new(scene, stops);
    let lengths: Vec<Vec<f64>> = stops.iter().map(|from| floor.lengths(from, stops)).collect();
    let n = stops.len();
    let cost = |from: usize, to: usize| {
        let turn = wrap(stops[to].base[2] - stops[from].base[2]).abs();
        0.5 * (lengths[from][to] + lengths[to][from]) + TURN * turn
    };
    let costs = (0..n * n).map(|k| cost(k / n, k % n)).collect();
    let free = Ends::OpenFromCosts(vec![0.0; n]);
    let instance = Instance::new(&vec![1; n], Costs::Dense(costs), Jump::Uniform(1e3), free);
    let tour =
        instance.ok().and_then(|all| solve(&all, &Budget::trials(TRIALS * n as u64), seed).ok());
    let order = tour.map_or_else(|| (0..n).collect(), |found| found.tour.clusters);
    let way = |k: usize| if k == 0 { 0.0 } else { lengths[order[k - 1]][order[k]] };
    let drives = (0..n).map(way).collect();
    (order, drives)
}

/// The floor in squares.
struct Floor {
    low: [f64; 2],
    size: [usize; 2],
    taken: Vec<bool>,
}

impl Floor {
    fn new(scene: &Scene, stops: &[Stance]) -> Self {
        let of = |axis: usize| stops.iter().map(move |stop| stop.base[axis]);
        let low = [0, 1].map(|axis| of(axis).fold(f64::INFINITY, f64::min) - BESIDE);
        let high = [0, 1].map(|axis| of(axis).fold(f64::NEG_INFINITY, f64::max) + BESIDE);
        let size = [0, 1].map(|axis| ((high[axis] - low[axis]) / SQUARE).ceil() as usize + 1);
        let flat: Vec<Point3<f64>> = scene
            .outline(SQUARE)
            .into_iter()
            .filter(|p| (TALL[0]..=TALL[1]).contains(&p.z))
            .map(|p| Point3::new(p.x, p.y, 0.0))
            .collect();
        let things = Grid::new(&flat, CLEAR);
        let mut floor = Self { low, size, taken: vec![false; size[0] * size[1]] };
        let at_stop = |p: &Point3<f64>| {
            stops.iter().any(|s| libm::hypot(s.base[0] - p.x, s.base[1] - p.y) <= AT_STOP)
        };
        for square in 0..floor.taken.len() {
            let middle = floor.middle(square);
            let mut is_near = false;
            things.within(&middle, CLEAR, |_, _, _| is_near = true);
            floor.taken[square] = is_near && !at_stop(&middle);
        }
        floor
    }

    fn middle(&self, square: usize) -> Point3<f64> {
        let [i, j] = [square % self.size[0], square / self.size[0]];
        Point3::new(self.low[0] + SQUARE * i as f64, self.low[1] + SQUARE * j as f64, 0.0)
    }

    fn square(&self, stance: &Stance) -> usize {
        let at = |axis: usize| ((stance.base[axis] - self.low[axis]) / SQUARE).round() as usize;
        at(0).min(self.size[0] - 1) + self.size[0] * at(1).min(self.size[1] - 1)
    }

    /// The shortest ways over free squares to each stop; straight where there is none. \[m\]
    fn lengths(&self, from: &Stance, to: &[Stance]) -> Vec<f64> {
        // In tenths of a millimetre: whole numbers have an order.
        const UNIT: f64 = 1e4;
        let mut best = vec![u64::MAX; self.taken.len()];
        let start = self.square(from);
        best[start] = 0;
        let mut open = BinaryHeap::from([Reverse((0u64, start))]);
        while let Some(Reverse((length, square))) = open.pop() {
            if length > best[square] {
                continue;
            }
            let (i, j) = ((square % self.size[0]) as i64, (square / self.size[0]) as i64);
            for (di, dj) in (-1..=1).flat_map(|di| (-1..=1).map(move |dj| (di, dj))) {
                let (ni, nj) = (i + di, j + dj);
                let inside = ni >= 0
                    && nj >= 0
                    && (ni as usize) < self.size[0]
                    && (nj as usize) < self.size[1];
                if !inside {
                    continue;
                }
                let next = ni as usize + self.size[0] * nj as usize;
                let step = (SQUARE * UNIT * ((di * di + dj * dj) as f64).sqrt()) as u64;
                if !self.taken[next] && length + step < best[next] {
                    best[next] = length + step;
                    open.push(Reverse((length + step, next)));
                }
            }
        }
        let straight =
            |stop: &Stance| libm::hypot(stop.base[0] - from.base[0], stop.base[1] - from.base[1]);
        let length = |stop: &Stance| match best[self.square(stop)] {
            u64::MAX => straight(stop),
            found => (found as f64 / UNIT).max(straight(stop)),
        };
        to.iter().map(length).collect()
    }
}

#[cfg(test)]
mod tests {
    use nullsweep_surface::Scan;

    use super::*;

    fn at(x: f64, y: f64) -> Stance {
        Stance { base: [x, y, 0.0], height: 0.0, held: Vec::new() }
    }

    #[test]
    fn the_way_goes_around_what_is_there_and_the_order_along_it() {
        // A wall from y = -1 to y = 1 at x = 0, half a metre high.
        let points: Vec<Point3<f64>> = (0..41)
            .flat_map(|i| (1..11).map(move |k| (i, k)))
            .map(|(i, k)| Point3::new(0.0, -1.0 + 0.05 * f64::from(i), 0.05 * f64::from(k)))
            .collect();
        let normals = vec![nalgebra::Vector3::x_axis(); points.len()];
        let surface = Scan { raw: points.clone(), points, normals, spacing: 0.05 };
        let scene = Scene::on_floor(surface);
        let stops = [at(-0.8, 0.0), at(0.8, 0.0), at(-0.8, 1.2), at(0.8, 1.2)];
        let floor = Floor::new(&scene, &stops);
        let across = floor.lengths(&stops[0], &stops)[1];
        // 1.6 m as the crow flies; around the end of the wall it is more than 2 · 1.35 m.
        assert!((2.7..4.5).contains(&across), "{across} m");
        let (order, drives) = order(&scene, &stops, 1);
        assert!(order == [0, 2, 3, 1] || order == [1, 3, 2, 0], "{order:?}");
        assert!(
            drives[0] == 0.0 && drives[1..].iter().all(|d| (1.0..2.6).contains(d)),
            "{drives:?}"
        );
    }
}
