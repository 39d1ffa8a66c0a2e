//! The damped least-squares step towards a pose, and the error that it takes away.

use nalgebra::{Isometry3, Matrix6, Vector6};

use crate::chain::Jacobian;
use crate::{JointVector, MAX_DOF};

/// The twist that takes one pose to another: its translation \[m\], then its rotation as a vector
/// along the axis \[rad\], both in the root frame.
#[must_use]
#[inline]
pub fn pose_error(from: &Isometry3<f64>, to: &Isometry3<f64>) -> Vector6<f64> {
    let shift = to.translation.vector - from.translation.vector;
    let turn = (to.rotation * from.rotation.inverse()).scaled_axis();
    Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
}

/// The damped least-squares step: Δq = Jᵀ (J Jᵀ + λ I)⁻¹ e, which minimises |J Δq − e|² + λ |Δq|².
///
/// `error` is the twist that is wanted of the tip, see [`pose_error`]. `damping` is λ, the square of
/// the damping factor: near a singularity it bounds the step by |e| / (2 √λ). Rows and columns of
/// zeros are left out: a freedom of the pose that does not matter, a joint that does not move.
/// `None` where the matrix is not positive definite, for example without damping at a singularity.
///
/// Nakamura and Hanafusa, *Inverse Kinematic Solutions With Singularity Robustness for Robot
/// Manipulator Control* (1986); Wampler, *Manipulator Inverse Kinematic Solutions Based on Vector
/// Formulations and Damped Least-Squares Methods* (1986).
#[must_use]
pub fn damped_step(jacobian: &Jacobian, error: &Vector6<f64>, damping: f64) -> Option<JointVector> {
    let damped = jacobian * jacobian.transpose() + Matrix6::identity() * damping;
    let step = jacobian.transpose() * damped.cholesky()?.solve(error);
    Some(JointVector::new(step.into()))
}

/// [`damped_step`] over the free columns, 0 in the others, and never without an answer: the inner
/// loop of this crate's solvers, by hand since general matrices took most of its time. The two
/// differ by rounding, so neither stands in for the other where results must be bit-identical.
#[inline]
pub(super) fn damped_step_over(
    jacobian: &Jacobian,
    free: &[bool; MAX_DOF],
    error: &Vector6<f64>,
    damping: f64,
) -> JointVector {
    let columns: &[[f64; 6]; MAX_DOF] = &jacobian.data.0;
    // The lower triangle of J Jᵀ + λ I, then of its Cholesky factor.
    let mut l = [[0.0; 6]; 6];
    for (column, _) in columns.iter().zip(free).filter(|(_, free)| **free) {
        for i in 0..6 {
            for j in 0..6 {
                l[i][j] += column[i] * column[j];
            }
        }
    }
    let mut inverse = [0.0; 6];
    let mut x = [0.0; 6];
    for i in 0..6 {
        for j in 0..i {
            let known: f64 = (0..j).map(|k| l[i][k] * l[j][k]).sum();
            l[i][j] = (l[i][j] - known) * inverse[j];
        }
        let known: f64 = (0..i).map(|k| l[i][k] * l[i][k]).sum();
        // Rounding may take away all of a singular direction but the damping.
        inverse[i] = (l[i][i] + damping - known).max(1e-2 * damping).sqrt().recip();
        let known: f64 = (0..i).map(|k| l[i][k] * x[k]).sum();
        x[i] = (error[i] - known) * inverse[i];
    }
    for i in (0..6).rev() {
        let known: f64 = (i + 1..6).map(|k| l[k][i] * x[k]).sum();
        x[i] = (x[i] - known) * inverse[i];
    }
    JointVector::from_fn(|c| match free[c] {
        true => (0..6).map(|i| columns[c][i] * x[i]).sum(),
        false => 0.0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ArmSpec, Robot, Side};

    #[test]
    fn steps_reach_a_pose_nearby() {
        let arm = Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).unwrap();
        let mut q = arm.home();
        let target = arm.tip_pose(&(q + JointVector::from_fn(|j| if j < 7 { 0.1 } else { 0.0 })));
        for _ in 0..8 {
            let (tip, jacobian) = arm.tip_pose_and_jacobian(&q);
            q = q + damped_step(&jacobian, &pose_error(&tip, &target), 1e-6).unwrap();
        }
        let rest = pose_error(&arm.tip_pose(&q), &target).amax();
        assert!(rest < 1e-9, "{rest}");
        assert_eq!(q[7], 0.0);
    }

    #[test]
    fn both_steps_agree_but_for_rounding() {
        let arm = Robot::pr2().arm(&ArmSpec::pr2(Side::Left)).unwrap();
        for k in 0..200 {
            let mut jacobian = arm.jacobian(&arm.spread(k));
            let mut free = [true; MAX_DOF];
            free[k % 7] = false;
            jacobian.column_mut(k % 7).fill(0.0);
            let error = Vector6::from_fn(|i, _| 0.1 * libm::sin(k as f64 + i as f64));
            let step = damped_step(&jacobian, &error, 1e-3).unwrap();
            let other = damped_step_over(&jacobian, &free, &error, 1e-3);
            assert!(step.distance(&other) < 1e-12, "{step:?} {other:?}");
            assert_eq!(step[k % 7], 0.0);
        }
    }

    #[test]
    fn nothing_moves_what_has_no_jacobian() {
        assert_eq!(damped_step(&Jacobian::zeros(), &Vector6::repeat(1.0), 0.0), None);
        let step = damped_step(&Jacobian::zeros(), &Vector6::repeat(1.0), 1e-4);
        assert_eq!(step, Some(JointVector::ZERO));
    }
}
