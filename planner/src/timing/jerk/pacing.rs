//! How fast to go through a reference.
//!
//! With b = τ̇² on an even grid, b′ and b″ by differences, each joint's
//! velocity r′√b, acceleration r″b + r′b′/2 and jerk √b (r‴b + 3r″b′/2 + r′b″/2) depend on three
//! neighbours at most. The time Σ h/√b is made least by an interior point: Newton's method on the
//! time less μ times the logarithms of all slacks, μ getting smaller, the constraints' own curvature
//! left out of the Hessian (Gauss–Newton), which so is positive definite and has two bands beside its
//! diagonal. Every iterate keeps all limits. The jerk's √b makes the problem one that is not convex:
//! what is found is a local optimum.

use nullsweep_robot::{JointVector, MAX_DOF};

use super::super::Limits;
use crate::band::Band;

/// A grid point of the reference.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    /// First, second and third derivative by τ. \[rad/sᵏ\] or \[m/sᵏ\]
    pub(super) rate: [JointVector; 3],
    /// Share of the limits that may be used, 0…1.
    pub(super) share: f64,
    /// Greatest b for another reason.
    pub(super) cap: f64,
}

impl Node {
    /// The derivatives in the middle of five places.
    pub(super) fn rates(q: [&JointVector; 5], step: f64) -> [JointVector; 3] {
        let [a, b, c, d, e] = q;
        [
            JointVector::from_fn(|j| (d[j] - b[j]) / (2.0 * step)),
            JointVector::from_fn(|j| (d[j] - 2.0 * c[j] + b[j]) / step.powi(2)),
            JointVector::from_fn(|j| {
                (e[j] - 2.0 * d[j] + 2.0 * b[j] - a[j]) / (2.0 * step.powi(3))
            }),
        ]
    }
}

/// No faster than this through the reference: nothing limits it where nothing moves.
const FASTEST: f64 = 9.0;
/// μ at first and at last, as a share of the grid's step, and what it falls by.
const FIRST: f64 = 1e-1;
const LAST: f64 = 3e-5;
const FALL: f64 = 0.2;
/// Newton's steps for each μ, and the decrease by one that is too small to go on, as a share of μ.
const STEPS: usize = 12;
const SMALL: f64 = 0.02;
/// How much of the way to a bound a step may go.
const INSIDE: f64 = 0.95;

/// b at each node of the fastest motion found.
pub(super) fn pace(nodes: &[Node], step: f64, limits: &Limits, jerk: &JointVector) -> Vec<f64> {
    let problem = Problem::new(nodes, step, limits, jerk);
    let mut b = vec![problem.slow(); nodes.len()];
    let mut mu = FIRST * step;
    while mu >= LAST * step {
        for _ in 0..STEPS {
            if !problem.improve(&mut b, mu) {
                break;
            }
        }
        mu *= FALL;
    }
    b
}

/// Scaled so that every bound is 1.
struct Row {
    first: f64,
    second: f64,
    third: f64,
}

struct Problem {
    step: f64,
    caps: Vec<f64>,
    /// For each node and joint, of accelerations and of jerks.
    accelerations: Vec<[Row; MAX_DOF]>,
    jerks: Vec<[Row; MAX_DOF]>,
    joints: usize,
}

impl Problem {
    fn new(nodes: &[Node], step: f64, limits: &Limits, jerk: &JointVector) -> Self {
        let joints = (0..MAX_DOF).rev().find(|&j| limits.velocity[j] > 0.0).map_or(0, |j| j + 1);
        let scaled = |node: &Node, j: usize, most: f64| {
            let most = if most > 0.0 { most * node.share } else { f64::INFINITY };
            let [first, second, third] = [0, 1, 2].map(|k: usize| node.rate[k][j] / most);
            Row { first, second, third }
        };
        let rows = |of: &JointVector| {
            nodes.iter().map(|n| std::array::from_fn(|j| scaled(n, j, of[j]))).collect()
        };
        let cap = |node: &Node| {
            let share = |j: usize| {
                let speed = node.rate[0][j].abs();
                if speed > 0.0 {
                    (limits.velocity[j] * node.share / speed).powi(2)
                } else {
                    f64::INFINITY
                }
            };
            (0..joints).map(share).fold(node.cap.min(FASTEST * FASTEST), f64::min)
        };
        Self {
            step,
            caps: nodes.iter().map(cap).collect(),
            accelerations: rows(&limits.acceleration),
            jerks: rows(jerk),
            joints,
        }
    }

    /// A b for all nodes that keeps every limit.
    fn slow(&self) -> f64 {
        let mut most = self.caps.iter().copied().fold(f64::INFINITY, f64::min);
        for (accelerations, jerks) in self.accelerations.iter().zip(&self.jerks) {
            for j in 0..self.joints {
                most = most.min(1.0 / accelerations[j].second.abs());
                most = most.min(libm::pow(jerks[j].third.abs(), -2.0 / 3.0));
            }
        }
        0.8 * most
    }

    /// b′/2 and b″/2 at a node; the ends go on evenly.
    fn bends(&self, b: &[f64], k: usize) -> [f64; 2] {
        let (before, after) = (b[k.saturating_sub(1)], b[(k + 1).min(b.len() - 1)]);
        let h = self.step;
        [(after - before) / (4.0 * h), (after - 2.0 * b[k] + before) / (2.0 * h * h)]
    }

    /// The time less μ times the logarithms; infinite where a limit is broken.
    fn value(&self, b: &[f64], mu: f64) -> f64 {
        let mut sum = 0.0;
        for k in 0..b.len() {
            let (own, cap) = (b[k], self.caps[k]);
            if !(own > 0.0 && own < cap) {
                return f64::INFINITY;
            }
            let root = own.sqrt();
            let [half, bend] = self.bends(b, k);
            let mut product = 1.0 - own / cap;
            for j in 0..self.joints {
                let row = &self.accelerations[k][j];
                let a = row.second * own + row.first * half;
                let row = &self.jerks[k][j];
                let s = root * (row.third * own + 3.0 * row.second * half + row.first * bend);
                if !(a.abs() < 1.0 && s.abs() < 1.0) {
                    return f64::INFINITY;
                }
                product *= (1.0 - a * a) * (1.0 - s * s);
            }
            sum += self.step / root - mu * libm::log(product);
        }
        sum
    }

    /// One step of Newton's method; whether another may help.
    fn improve(&self, b: &mut [f64], mu: f64) -> bool {
        let n = b.len();
        let mut hessian = Band::zero(n, 3);
        let mut fall = vec![0.0; n];
        let h = self.step;
        for k in 0..n {
            let (own, root) = (b[k], b[k].sqrt());
            let mut slope = [0.0; 3];
            let mut bend = [[0.0; 3]; 3];
            slope[1] += -0.5 * h / (own * root);
            bend[1][1] += 0.75 * h / (own * own * root);
            // A bound |y| < 1 whose y has these derivatives by b before, at and after the node.
            let mut bound = |y: f64, dy: [f64; 3]| {
                let (above, below) = (1.0 / (1.0 - y), 1.0 / (1.0 + y));
                let (first, second) = (mu * (above - below), mu * (above * above + below * below));
                for i in 0..3 {
                    slope[i] += first * dy[i];
                    for l in i..3 {
                        bend[i][l] += second * dy[i] * dy[l];
                    }
                }
            };
            let [half, curve] = self.bends(b, k);
            let (first, second) = (0.25 / h, 0.5 / (h * h));
            for j in 0..self.joints {
                let row = &self.accelerations[k][j];
                let y = row.second * own + row.first * half;
                bound(y, [-row.first * first, row.second, row.first * first]);
                let row = &self.jerks[k][j];
                let inner = row.third * own + 3.0 * row.second * half + row.first * curve;
                let (beside, bent) = (3.0 * row.second * first, row.first * second);
                let dy = [
                    root * (bent - beside),
                    root * (row.third - 2.0 * bent) + 0.5 * inner / root,
                    root * (bent + beside),
                ];
                bound(root * inner, dy);
            }
            let room = 1.0 / (self.caps[k] - own);
            slope[1] += mu * room;
            bend[1][1] += mu * room * room;
            // At the ends the neighbour that is not there is the end itself.
            let index = |i: usize| (k + i).saturating_sub(1).min(n - 1);
            for i in 0..3 {
                fall[index(i)] -= slope[i];
                for l in i..3 {
                    let (row, column) = (index(i), index(l));
                    let twice = if i != l && row == column { 2.0 } else { 1.0 };
                    hessian.add(row, column, twice * bend[i][l]);
                }
            }
        }
        let slope = fall.clone();
        hessian.solve(&mut fall);
        let decrease: f64 = fall.iter().zip(&slope).map(|(a, b)| a * b).sum();
        if decrease.is_nan() || decrease <= SMALL * mu {
            return false;
        }
        let now = self.value(b, mu);
        // Not through a bound of b itself.
        let mut length = 1.0f64;
        for k in 0..n {
            if fall[k] < 0.0 {
                length = length.min(-INSIDE * b[k] / fall[k]);
            } else if fall[k] > 0.0 {
                length = length.min(INSIDE * (self.caps[k] - b[k]) / fall[k]);
            }
        }
        while length > 1e-8 {
            let next: Vec<f64> = b.iter().zip(&fall).map(|(b, f)| b + length * f).collect();
            let value = self.value(&next, mu);
            if value <= now - 0.1 * length * decrease {
                b.copy_from_slice(&next);
                return now - value > SMALL * mu;
            }
            length *= 0.6;
        }
        false
    }
}
