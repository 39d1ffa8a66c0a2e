//! Numeric inverse kinematics for any serial arm: damped least squares from several starts.

use nalgebra::{Isometry3, SMatrix, Vector6};

use super::{Branch, InverseKinematics, Solution, Solutions};
use crate::chain::Chain;
use crate::limits::{JointLimits, unwrap_near, wrap};
use crate::{Jacobian, JointVector, MAX_DOF};

/// The solver.
#[derive(Debug)]
pub(crate) struct Numeric {
    chain: Chain,
    limits: Vec<JointLimits>,
    margined: Vec<(f64, f64)>,
    redundant: Option<usize>,
    starts: Vec<JointVector>,
}

/// Starts of [`InverseKinematics::solve`].
const STARTS: usize = 64;
/// Steps of one descent.
const STEPS: usize = 60;
/// Largest residual of a solution, in metres and radians alike.
const RESIDUAL: f64 = 1e-9;

impl Numeric {
    pub(crate) fn new(chain: &Chain, limits: &[JointLimits], margined: &[(f64, f64)]) -> Self {
        let n = chain.dof();
        // A chain with more joints than a pose has freedoms holds its third joint.
        let redundant = (n > 6).then_some(2);
        let ends = |i: usize| {
            let (lower, upper) = margined[i];
            if limits[i].continuous {
                (-std::f64::consts::PI, std::f64::consts::PI)
            } else {
                (lower, upper)
            }
        };
        let starts = (0..STARTS)
            .map(|k| {
                let mut q = [0.0; MAX_DOF];
                for i in 0..n {
                    let (lower, upper) = ends(i);
                    q[i] = lower + (upper - lower) * radical_inverse(k + 1, PRIMES[i]);
                }
                q
            })
            .collect();
        Self {
            chain: chain.clone(),
            limits: limits.to_vec(),
            margined: margined.to_vec(),
            redundant,
            starts,
        }
    }

    /// Descends to the target with the redundant joint held where it is.
    fn descend(&self, target: &Isometry3<f64>, q: &mut JointVector) -> bool {
        let mut damping = 1e-3;
        let (mut error, mut jacobian) = self.linearise(target, q);
        for _ in 0..STEPS {
            if error.amax() < RESIDUAL * 1e-3 {
                return true;
            }
            let step = damped_step(&jacobian, &error, damping);
            let mut trial = *q;
            for i in 0..MAX_DOF {
                trial[i] += step[i].clamp(-0.7, 0.7);
            }
            let (trial_error, trial_jacobian) = self.linearise(target, &trial);
            if trial_error.norm_squared() < error.norm_squared() {
                (*q, error, jacobian) = (trial, trial_error, trial_jacobian);
                damping = (damping * 0.2).max(1e-12);
            } else {
                damping *= 8.0;
                if damping > 1e3 {
                    break;
                }
            }
        }
        error.amax() < RESIDUAL
    }

    fn linearise(&self, target: &Isometry3<f64>, q: &JointVector) -> (Vector6<f64>, Jacobian) {
        let (tip, mut jacobian) = self.chain.jacobian(q);
        if let Some(held) = self.redundant {
            jacobian.column_mut(held).fill(0.0);
        }
        let shift = target.translation.vector - tip.translation.vector;
        let turn = (target.rotation * tip.rotation.inverse()).scaled_axis();
        let mut error = Vector6::zeros();
        error.fixed_rows_mut::<3>(0).copy_from(&shift);
        error.fixed_rows_mut::<3>(3).copy_from(&turn);
        (error, jacobian)
    }

    fn represent(&self, q: &mut JointVector) {
        for (i, limit) in self.limits.iter().enumerate() {
            if self.chain.steps[i].prismatic || self.redundant == Some(i) {
                continue;
            }
            q[i] = if limit.continuous {
                wrap(q[i])
            } else {
                unwrap_near(q[i], 0.5 * (limit.lower + limit.upper))
            };
        }
    }
}

impl InverseKinematics for Numeric {
    fn redundancy_range(&self) -> Option<(f64, f64)> {
        self.redundant.map(|i| {
            if self.limits[i].continuous {
                (-std::f64::consts::PI, std::f64::consts::PI)
            } else {
                self.margined[i]
            }
        })
    }

    fn redundant_joint(&self) -> Option<usize> {
        self.redundant
    }

    fn solve(&self, target: &Isometry3<f64>, redundancy: f64, out: &mut Solutions) {
        out.clear();
        for start in &self.starts {
            let mut q = *start;
            if let Some(held) = self.redundant {
                q[held] = redundancy;
            }
            if !self.descend(target, &mut q) {
                continue;
            }
            self.represent(&mut q);
            let known = out
                .iter()
                .any(|s| s.q.iter().zip(&q).all(|(a, b)| (unwrap_near(*a, *b) - b).abs() < 1e-5));
            if !known {
                let branch = Branch(out.len() as u8);
                let redundancy = self.redundant.map_or(0.0, |_| redundancy);
                if out.push(Solution { q, branch, redundancy }).is_err() {
                    return;
                }
            }
        }
    }

    fn solve_on(
        &self,
        branch: Branch,
        target: &Isometry3<f64>,
        redundancy: f64,
        near: &JointVector,
    ) -> Option<Solution> {
        let mut q = *near;
        if let Some(held) = self.redundant {
            q[held] = redundancy;
        }
        let redundancy = self.redundant.map_or(0.0, |_| redundancy);
        self.descend(target, &mut q).then_some(Solution { q, branch, redundancy })
    }
}

const PRIMES: [usize; MAX_DOF] = [2, 3, 5, 7, 11, 13, 17, 19];

/// The k-th number of the van der Corput sequence to a base, in (0, 1).
fn radical_inverse(mut k: usize, base: usize) -> f64 {
    let (mut value, mut weight) = (0.0, 1.0 / base as f64);
    while k > 0 {
        value += (k % base) as f64 * weight;
        k /= base;
        weight /= base as f64;
    }
    value
}

/// (JᵀJ + λI)⁻¹Jᵀe by its smaller form Jᵀ(JJᵀ + λI)⁻¹e.
fn damped_step(
    jacobian: &Jacobian,
    error: &Vector6<f64>,
    damping: f64,
) -> SMatrix<f64, MAX_DOF, 1> {
    let mut gram = jacobian * jacobian.transpose();
    for i in 0..6 {
        gram[(i, i)] += damping;
    }
    match gram.cholesky() {
        Some(factor) => jacobian.transpose() * factor.solve(error),
        None => SMatrix::zeros(),
    }
}
