//! Which point goes to which, and the step that brings them together.

use nalgebra::{Isometry3, Matrix6, Point3, Vector3, Vector6};

use super::cloud::Cloud;
use crate::fit::weight;

/// The cosine of the greatest angle between the normals of counterparts.
const ALIKE: f64 = 0.7;

/// A point of the view where it lies, its counterpart, and the normal of both.
pub(super) struct Pair {
    point: Point3<f64>,
    to: Point3<f64>,
    normal: Vector3<f64>,
}

impl Pair {
    fn distance(&self) -> f64 {
        (self.point - self.to).dot(&self.normal)
    }
}

/// The counterparts of a view at a pose.
pub(super) struct Fit {
    pub(super) pairs: Vec<Pair>,
    /// Points of the view.
    pub(super) of: usize,
    reach: f64,
}

impl Fit {
    pub(super) fn new(target: &Cloud, moving: &Cloud, pose: &Isometry3<f64>, reach: f64) -> Self {
        let sided = target.sided && moving.sided;
        let pair = |i: usize| {
            let point = pose * moving.points[i];
            let normal = pose.rotation * moving.normals[i];
            let alike = |j: u32| {
                let dot = normal.dot(&target.normals[j as usize]);
                if sided { dot > ALIKE } else { dot.abs() > ALIKE }
            };
            let (j, _) = target.grid.nearest(&point, reach, alike)?;
            let j = j as usize;
            let other = target.normals[j];
            let other = if normal.dot(&other) < 0.0 { -other } else { other };
            let both = (normal.into_inner() + other.into_inner()).normalize();
            Some(Pair { point, to: target.points[j], normal: both })
        };
        let pairs = (0..moving.points.len()).filter_map(pair).collect();
        Self { pairs, of: moving.points.len(), reach }
    }

    /// Mean robust distance, what has no counterpart as far as the reach. \[m²\]
    pub(super) fn score(&self) -> f64 {
        let limit = self.reach * self.reach;
        let near: f64 = self.pairs.iter().map(|pair| pair.distance().powi(2).min(limit)).sum();
        (near + (self.of - self.pairs.len()) as f64 * limit) / self.of.max(1) as f64
    }

    /// Mean squared distance, what has no counterpart as far as the reach. \[m²\]
    pub(super) fn apart(&self) -> f64 {
        let limit = self.reach * self.reach;
        let near: f64 = self.pairs.iter().map(|p| (p.point - p.to).norm_squared()).sum();
        (near + (self.of - self.pairs.len()) as f64 * limit) / self.of.max(1) as f64
    }

    /// Root mean square distance across the surface. \[m\]
    pub(super) fn residual(&self) -> f64 {
        let squares: f64 = self.pairs.iter().map(|pair| pair.distance().powi(2)).sum();
        (squares / self.pairs.len().max(1) as f64).sqrt()
    }

    /// The matrix and right side of the step about a middle, turns in units of `size`, and the sum of
    /// the weights; distances along the surface count `along` times.
    pub(super) fn equations(
        &self,
        middle: &Point3<f64>,
        size: f64,
        along: f64,
    ) -> (Matrix6<f64>, Vector6<f64>, f64) {
        let counted = |pair: &Pair| {
            let (apart, across) = ((pair.point - pair.to).norm_squared(), pair.distance().powi(2));
            across + along * (apart - across).max(0.0)
        };
        let mut distances: Vec<f64> = self.pairs.iter().map(|pair| counted(pair).sqrt()).collect();
        distances.sort_unstable_by(f64::total_cmp);
        let median = distances.get(distances.len() / 2).copied().unwrap_or(0.0);
        // Tukey's biweight: across a surface with its usual tuning on the robust deviation, which
        // along it would take the ends for outliers.
        let limit = (1.4826 * median * if along > 0.0 { 20.0 } else { 4.685 }).max(1e-4);
        let (mut matrix, mut right, mut total) = (Matrix6::zeros(), Vector6::zeros(), 0.0);
        for pair in &self.pairs {
            let w = weight(counted(pair) / (limit * limit));
            let apart = pair.point - pair.to;
            let arm = pair.point - middle;
            let mut add = |axis: &Vector3<f64>, w: f64| {
                let turn = arm.cross(axis) / size;
                let row = Vector6::new(turn.x, turn.y, turn.z, axis.x, axis.y, axis.z);
                matrix += row * row.transpose() * w;
                right -= row * (w * apart.dot(axis));
            };
            add(&pair.normal, w * (1.0 - along));
            if along > 0.0 {
                (0..3).for_each(|i| add(&Vector3::ith(i, 1.0), w * along));
            }
            total += w;
        }
        (matrix, right, total)
    }
}
