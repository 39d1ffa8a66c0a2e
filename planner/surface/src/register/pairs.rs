//! Which point goes to which, and the step that brings them together.

use nalgebra::{Isometry3, Matrix3, Matrix6, Matrix6x3, Point3, Vector3, Vector6};

use super::cloud::Cloud;
use crate::fit::weight;

/// The cosine of the greatest angle between the normals of counterparts.
const ALIKE: f64 = 0.7;

/// How far a point is from its counterpart.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Metric {
    /// Across the surface, in metres.
    Across,
    /// In standard deviations of what the sensors measure.
    Noise,
}

/// A point of the view where it lies, its counterpart, and the normal and the noise of both.
pub(super) struct Pair {
    point: Point3<f64>,
    to: Point3<f64>,
    normal: Vector3<f64>,
    noise: Matrix3<f64>,
}

impl Pair {
    fn distance(&self) -> f64 {
        (self.point - self.to).dot(&self.normal)
    }

    /// The matrix by which the way between the two counts, from both sides.
    fn weights(&self, metric: Metric) -> Matrix3<f64> {
        let across = self.normal * self.normal.transpose();
        match metric {
            Metric::Across => across,
            Metric::Noise => self.noise.try_inverse().unwrap_or(across),
        }
    }
}

/// The counterparts of a view at a pose.
pub(super) struct Fit {
    pub(super) pairs: Vec<Pair>,
    /// Points that were to have one.
    pub(super) of: usize,
    reach: f64,
}

impl Fit {
    /// Those of at most so many of the view's points among the target's.
    pub(super) fn new(
        target: &Cloud,
        moving: &Cloud,
        pose: &Isometry3<f64>,
        reach: f64,
        most: usize,
    ) -> Self {
        let asking = asking(moving, most);
        let of = asking.len();
        let pairs = asking.filter_map(|i| pair(target, moving, pose, reach, i)).collect();
        Self { pairs, of, reach }
    }

    /// The same, and those of as many of the target's points among the view's: neither's edges draw the
    /// other's to one side.
    pub(super) fn both(
        target: &Cloud,
        moving: &Cloud,
        pose: &Isometry3<f64>,
        reach: f64,
        most: usize,
    ) -> Self {
        let mut fit = Self::new(target, moving, pose, reach, most);
        let back = Self::new(moving, target, &pose.inverse(), reach, most);
        let turn = pose.rotation.to_rotation_matrix();
        let turned = |m: Matrix3<f64>| turn.matrix() * m * turn.matrix().transpose();
        fit.pairs.extend(back.pairs.into_iter().map(|p| Pair {
            point: pose * p.to,
            to: pose * p.point,
            normal: pose.rotation * p.normal,
            noise: turned(p.noise),
        }));
        fit.of += back.of;
        fit
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
    /// the weights.
    pub(super) fn equations(
        &self,
        middle: &Point3<f64>,
        size: f64,
        metric: Metric,
    ) -> (Matrix6<f64>, Vector6<f64>, f64) {
        let ways: Vec<(Vector3<f64>, Matrix3<f64>, f64)> = self
            .pairs
            .iter()
            .map(|pair| {
                let (way, weights) = (pair.point - pair.to, pair.weights(metric));
                (way, weights, way.dot(&(weights * way)).max(0.0))
            })
            .collect();
        let mut squares: Vec<f64> = ways.iter().map(|(_, _, squared)| *squared).collect();
        squares.sort_unstable_by(f64::total_cmp);
        let median = squares.get(squares.len() / 2).copied().unwrap_or(0.0).sqrt();
        // Tukey's biweight: across a surface with its usual tuning on the robust deviation, which
        // along it would take the ends for outliers.
        let limit = 1.4826 * median;
        let limit = match metric {
            Metric::Across => (4.685 * limit).max(1e-4),
            Metric::Noise => (12.0 * limit).max(0.1),
        };
        let (mut matrix, mut right, mut total) = (Matrix6::zeros(), Vector6::zeros(), 0.0);
        for (pair, (way, weights, squared)) in self.pairs.iter().zip(&ways) {
            let w = weight(squared / (limit * limit));
            let turn = (pair.point - middle).cross_matrix() / size;
            let mut rows = Matrix6x3::zeros();
            rows.fixed_rows_mut::<3>(0).copy_from(&turn);
            rows.fixed_rows_mut::<3>(3).fill_with_identity();
            let weighted = rows * weights * w;
            matrix += weighted * rows.transpose();
            right -= weighted * way;
            total += w;
        }
        (matrix, right, total)
    }
}

/// At most so many of a cloud's points, evenly.
fn asking(cloud: &Cloud, most: usize) -> impl ExactSizeIterator<Item = usize> {
    let all = cloud.points.len();
    (0..all).step_by(all.div_ceil(most.max(1)).max(1))
}

/// A point of the view with the target's nearest point that looks the same way.
fn pair(
    target: &Cloud,
    moving: &Cloud,
    pose: &Isometry3<f64>,
    reach: f64,
    i: usize,
) -> Option<Pair> {
    let sided = target.sided && moving.sided;
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
    let turn = pose.rotation.to_rotation_matrix();
    let turned = turn.matrix() * moving.noise[i] * turn.matrix().transpose();
    let noise = target.noise[j] + turned;
    Some(Pair { point, to: target.points[j], normal: both, noise })
}
