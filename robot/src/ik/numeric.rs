//! Numeric inverse kinematics for any serial arm: damped least squares from several starts.
//!
//! Every descent stays inside the margined limits, so unlike the closed form this solver gives only
//! solutions inside them. An arm of six joints has no redundancy; of seven, one joint is the
//! redundancy and held; of eight, one is held and the step of least norm decides over the other
//! freedom. An arm of five joints meets the position and the direction of the tip's x axis, its
//! turn about that axis is free; an arm of fewer finds only poses that it reaches exactly.

use std::collections::VecDeque;

use nalgebra::{Isometry3, Vector3, Vector6};

use super::damped::{damped_step_over, pose_error};
use super::folds::{Folds, MOST_FOLDS, same, self_motion};
use super::redundancy::Redundancy;
use super::solution::{Branch, InverseKinematics, Solution, Solutions};
use super::spread::spread_over;
use crate::chain::{Chain, Jacobian};
use crate::joints::{unwrap_near, wrap};
use crate::limits::JointLimits;
use crate::{JointVector, MAX_DOF};

/// The solver.
///
/// Branch: bit 0 is the sign of the Jacobian's determinant and bits 1 to 4 the sides of up to four
/// fold joints (see [`super::folds`]); bits 5 to 7 count solutions that share those signs, in the
/// order of their joint values. Two targets near each other give a posture the same branch, except
/// near a singularity.
#[derive(Debug)]
pub(crate) struct Numeric {
    chain: Chain,
    limits: Vec<JointLimits>,
    margined: Vec<(f64, f64)>,
    redundancy: Redundancy,
    folds: Folds,
    seeds: Vec<JointVector>,
}

/// Configurations of which those nearest to the target are starts of a descent.
const SEEDS: usize = 512;
/// Most of them that are tried.
const STARTS: usize = 96;
/// Descents without a new solution after which the search ends.
const PATIENCE: usize = 48;
/// Largest number of steps of one descent.
const STEPS: usize = 40;
/// A descent ends when so many steps in a row each take away less than a twentieth of the error.
const STALLED: usize = 5;
/// Largest error of a solution, in metres and radians alike.
const RESIDUAL: f64 = 1e-10;
/// Largest step of a joint. \[rad or m\]
const STRIDE: f64 = 0.8;
/// Two solutions nearer than this are one. \[rad\]
const SAME: f64 = 1e-5;
/// A step that leaves less than this part of the squared error converges, and one that comes this
/// near to a known solution \[rad\] meanwhile ends there.
const CONVERGING: f64 = 0.04;
const CAUGHT: f64 = 0.03;
/// Farther from the start than this, a followed branch is reached in smaller steps. \[rad\]
const NEAR: f64 = 0.3;
/// Finest division of such a path.
const DIVISIONS: i32 = 16;
/// Share of the self-motion that makes the third joint of seven a good redundancy.
const SHARE: f64 = 0.05;

const SIGNS: u8 = 0b1_1111;

impl Numeric {
    pub(crate) fn new(chain: &Chain, limits: &[JointLimits], margined: &[(f64, f64)]) -> Self {
        let redundant = redundant_joint(chain);
        Self {
            seeds: (0..SEEDS).map(|k| spread_over(margined, k)).collect(),
            folds: Folds::of(chain, redundant),
            chain: chain.clone(),
            limits: limits.to_vec(),
            margined: margined.to_vec(),
            redundancy: Redundancy::new(redundant, margined, |joint| limits[joint].continuous),
        }
    }

    /// The seeds of each posture whose tip is nearest to the target, nearest first.
    fn starts(&self, target: &Isometry3<f64>, redundancy: f64) -> Vec<JointVector> {
        let distance = |seed: &JointVector| {
            let mut q = *seed;
            self.redundancy.hold(&mut q, redundancy);
            let tip = self.chain.tip_pose(&q);
            let shift = (tip.translation.vector - target.translation.vector).norm();
            let cosine = tip.rotation.coords.dot(&target.rotation.coords).abs();
            // A tip half a turn away costs as much as one at half a metre.
            (shift + 0.5 * (1.0 - cosine), q)
        };
        let mut starts: Vec<_> = self.seeds.iter().map(distance).collect();
        starts.sort_by(|a, b| a.0.total_cmp(&b.0));
        // In turn the nearest of each posture, then the second nearest of each, and so on.
        let mut taken = [0usize; 1 << MOST_FOLDS];
        let mut ranked: Vec<_> = starts
            .into_iter()
            .map(|(_, q)| {
                let rank = &mut taken[usize::from(self.folds.sides(&q))];
                *rank += 1;
                (*rank, q)
            })
            .collect();
        ranked.sort_by_key(|(rank, _)| *rank);
        ranked.truncate(STARTS);
        ranked.into_iter().map(|(_, q)| q).collect()
    }

    /// Descends to the target inside the limits; the redundant joint does not move. `None` also as
    /// soon as the descent is about to end in one of the solutions `known`.
    fn descend(
        &self,
        target: &Isometry3<f64>,
        known: &[Solution],
        q: &mut JointVector,
    ) -> Option<Jacobian> {
        let mut damping = 1e-3;
        self.clamp(q);
        let (mut error, mut jacobian) = self.linearise(target, q);
        let mut stalled = 0;
        for _ in 0..STEPS {
            if error.amax() < RESIDUAL * 1e-2 || stalled >= STALLED {
                break;
            }
            let mut trial = *q;
            self.step(&jacobian, &error, damping, &mut trial);
            let (trial_error, trial_jacobian) = self.linearise(target, &trial);
            let ratio = trial_error.norm_squared() / error.norm_squared();
            stalled = if ratio > 0.9 { stalled + 1 } else { 0 };
            if ratio < 1.0 {
                (*q, error, jacobian) = (trial, trial_error, trial_jacobian);
                if ratio < CONVERGING && known.iter().any(|s| same(&s.q, q, CAUGHT)) {
                    return None;
                }
                damping = (damping * 0.1).max(1e-14);
            } else if damping > 1e2 || error.amax() < RESIDUAL {
                break;
            } else {
                damping *= 10.0;
            }
        }
        (error.amax() < RESIDUAL).then_some(jacobian)
    }

    /// A damped step; joints that it would push past a limit stay there, and the others step again
    /// without them.
    fn step(&self, jacobian: &Jacobian, error: &Vector6<f64>, damping: f64, q: &mut JointVector) {
        let start = *q;
        let mut free = [false; MAX_DOF];
        free[..self.chain.dof()].fill(true);
        if let Some(held) = self.redundancy.joint {
            free[held] = false;
        }
        for _ in 0..2 {
            let step = damped_step_over(jacobian, &free, error, damping);
            let most = step.iter().fold(0.0f64, |most, s| most.max(s.abs()));
            let scale = if most > STRIDE { STRIDE / most } else { 1.0 };
            let mut stopped = false;
            for (i, &(lower, upper)) in self.margined.iter().enumerate().filter(|(i, _)| free[*i]) {
                q[i] = start[i] + scale * step[i];
                if q[i] < lower || q[i] > upper {
                    stopped = true;
                    q[i] = q[i].clamp(lower, upper);
                }
            }
            if !stopped {
                return;
            }
            for (i, &(lower, upper)) in self.margined.iter().enumerate() {
                free[i] &= q[i] > lower && q[i] < upper;
            }
        }
    }

    fn clamp(&self, q: &mut JointVector) {
        for (i, &(lower, upper)) in self.margined.iter().enumerate() {
            if self.redundancy.joint == Some(i) || self.limits[i].continuous {
                continue;
            }
            if !self.chain.steps[i].prismatic {
                q[i] = unwrap_near(q[i], 0.5 * (lower + upper));
            }
            q[i] = q[i].clamp(lower, upper);
        }
    }

    /// Error from tip to target, linear then angular, and the Jacobian without the held column.
    fn linearise(&self, target: &Isometry3<f64>, q: &JointVector) -> (Vector6<f64>, Jacobian) {
        let (tip, mut jacobian) = self.chain.jacobian(q);
        if let Some(held) = self.redundancy.joint {
            jacobian.column_mut(held).fill(0.0);
        }
        let shift = target.translation.vector - tip.translation.vector;
        let turn = if self.chain.dof() == 5 {
            let axis = tip.rotation * Vector3::x();
            let wanted = target.rotation * Vector3::x();
            for mut column in jacobian.column_iter_mut() {
                let about = axis.dot(&column.fixed_rows::<3>(3));
                let mut angular = column.fixed_rows_mut::<3>(3);
                angular -= axis * about;
            }
            let normal = axis.cross(&wanted);
            let sine = normal.norm();
            normal * (libm::atan2(sine, axis.dot(&wanted)) / sine.max(f64::MIN_POSITIVE))
        } else {
            return (pose_error(&tip, target), jacobian);
        };
        (Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z), jacobian)
    }

    /// Jacobian signs of a configuration, with the held column out.
    fn signs(&self, q: &JointVector, jacobian: &Jacobian) -> u8 {
        self.folds.signs(q, jacobian) & SIGNS
    }

    fn represent(&self, q: &mut JointVector) {
        for (i, limit) in self.limits.iter().enumerate() {
            if limit.continuous && self.redundancy.joint != Some(i) {
                q[i] = wrap(q[i]);
            }
        }
    }

    /// Follows the straight path from the pose and redundancy of `near`, in `parts` steps.
    fn follow(
        &self,
        target: &Isometry3<f64>,
        redundancy: f64,
        near: &JointVector,
        parts: i32,
    ) -> Option<(JointVector, Jacobian)> {
        let from = self.chain.tip_pose(near);
        let mut q = *near;
        let mut last = None;
        for k in 1..=parts {
            let t = f64::from(k) / f64::from(parts);
            let pose = if k == parts { *target } else { from.try_lerp_slerp(target, t, 1e-9)? };
            if let Some(held) = self.redundancy.joint {
                q[held] = near[held] + (redundancy - near[held]) * t;
            }
            let before = q;
            last = Some(self.descend(&pose, &[], &mut q)?);
            if q.iter().zip(&before).any(|(a, b)| (a - b).abs() > NEAR) {
                return None;
            }
        }
        last.map(|jacobian| (q, jacobian))
    }
}

impl InverseKinematics for Numeric {
    fn redundancy_range(&self) -> Option<(f64, f64)> {
        self.redundancy.range
    }

    fn redundant_joint(&self) -> Option<usize> {
        self.redundancy.joint
    }

    fn solve(&self, target: &Isometry3<f64>, redundancy: f64, out: &mut Solutions) {
        out.clear();
        let dof = self.chain.dof();
        let mut mirrored = VecDeque::new();
        let mut fresh = self.starts(target, redundancy).into_iter();
        let mut in_vain = 0;
        while in_vain < PATIENCE {
            let Some(mut q) = mirrored.pop_front().or_else(|| fresh.next()) else { break };
            let redundancy = self.redundancy.hold(&mut q, redundancy);
            in_vain += 1;
            let Some(jacobian) = self.descend(target, out, &mut q) else { continue };
            self.represent(&mut q);
            let signs = self.signs(&q, &jacobian);
            // With two spare joints solutions are not isolated: one for each posture will do.
            let known = out
                .iter()
                .any(|s| same(&s.q, &q, SAME) || (dof == MAX_DOF && s.branch.0 & SIGNS == signs));
            if known {
                continue;
            }
            in_vain = 0;
            mirrored.extend(self.folds.mirrored(&q, &jacobian, dof));
            if out.push(Solution { q, branch: Branch(signs), redundancy }).is_err() {
                break;
            }
        }
        number(out);
    }

    fn solve_on(
        &self,
        branch: Branch,
        target: &Isometry3<f64>,
        redundancy: f64,
        near: &JointVector,
    ) -> Option<Solution> {
        let mut parts = 1;
        let (mut q, jacobian) = loop {
            if let Some(found) = self.follow(target, redundancy, near, parts) {
                break found;
            }
            parts *= 4;
            if parts > DIVISIONS {
                return None;
            }
        };
        if self.signs(&q, &jacobian) != branch.0 & SIGNS {
            return None;
        }
        for i in (0..self.chain.dof()).filter(|&i| self.limits[i].continuous) {
            if self.redundancy.joint != Some(i) {
                q[i] = unwrap_near(q[i], near[i]);
            }
        }
        let redundancy = self.redundancy.hold(&mut q, redundancy);
        Some(Solution { q, branch, redundancy })
    }
}

/// Orders solutions by branch signs and joint values, and counts those with the same signs.
fn number(out: &mut Solutions) {
    out.sort_unstable_by(|a, b| {
        let values = || a.q.iter().zip(&b.q).map(|(a, b)| a.total_cmp(b)).find(|o| o.is_ne());
        a.branch.cmp(&b.branch).then_with(|| values().unwrap_or(std::cmp::Ordering::Equal))
    });
    let (mut last, mut count) = (None, 0u8);
    for solution in out.iter_mut() {
        let signs = solution.branch.0;
        count = if last == Some(signs) { (count + 1).min(7) } else { 0 };
        last = Some(signs);
        solution.branch = Branch(signs | count << 5);
    }
}

/// The joint that is held: none of six or fewer; of more the third, which is the upper-arm roll of
/// most arms, or the joint that moves most in the arm's self-motion where the third does not.
fn redundant_joint(chain: &Chain) -> Option<usize> {
    match chain.dof() {
        0..=6 => None,
        7 => {
            let shares = self_motion(chain);
            if shares[2] >= SHARE {
                return Some(2);
            }
            (0..7).max_by(|&a, &b| shares[a].total_cmp(&shares[b]))
        }
        _ => Some(2),
    }
}
