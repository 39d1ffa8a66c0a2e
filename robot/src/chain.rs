//! The serial chain of an arm, folded for speed: one fixed transform and one axis a joint.

use nalgebra::{Isometry3, Quaternion, SMatrix, UnitQuaternion, Vector3};
use wide::f64x4;

use crate::{JointVector, MAX_DOF, lanes};

/// Geometric Jacobian: rows linear x, y, z [m/s], angular x, y, z [rad/s] of the tip in the root
/// frame; one column a joint, unused columns zero.
pub type Jacobian = SMatrix<f64, 6, MAX_DOF>;

/// Root frame → joint 1 → … → joint n → tip. Everything that does not move with the arm's own
/// joints is folded into the fixed transform before the next joint.
#[derive(Clone, Debug)]
pub(crate) struct Chain {
    pub(crate) steps: Vec<Step>,
    /// Tip in the frame of the last joint.
    pub(crate) tip: Isometry3<f64>,
}

/// A fixed transform, then a joint.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    /// Joint frame in the frame after the joint before.
    pub(crate) offset: Isometry3<f64>,
    pub(crate) turns: bool,
    pub(crate) shifts: bool,
    /// Axis in the joint frame, a unit vector.
    pub(crate) axis: Vector3<f64>,
    pub(crate) prismatic: bool,
}

impl Step {
    pub(crate) fn new(offset: Isometry3<f64>, axis: Vector3<f64>, prismatic: bool) -> Self {
        Self {
            turns: offset.rotation != UnitQuaternion::identity(),
            shifts: offset.translation.vector != Vector3::zeros(),
            offset,
            axis,
            prismatic,
        }
    }
}

impl Chain {
    pub(crate) fn dof(&self) -> usize {
        self.steps.len()
    }

    /// Pose of the tip in the root frame.
    #[inline]
    pub(crate) fn tip_pose(&self, q: &JointVector) -> Isometry3<f64> {
        let mut rotation = UnitQuaternion::identity();
        let mut position = Vector3::zeros();
        let halves = half_sines(q);
        for (i, step) in self.steps.iter().enumerate() {
            enter(step, &mut rotation, &mut position);
            move_along(step, q[i], halves.of(i), &mut rotation, &mut position);
        }
        position += rotation * self.tip.translation.vector;
        Isometry3::from_parts(position.into(), rotation * self.tip.rotation)
    }

    /// Tip pose and, for each joint, its axis and a point on it, in the root frame.
    #[inline]
    pub(crate) fn axes(&self, q: &JointVector) -> (Isometry3<f64>, [JointAxis; MAX_DOF]) {
        let mut axes = [JointAxis::default(); MAX_DOF];
        let mut rotation = UnitQuaternion::identity();
        let mut position = Vector3::zeros();
        let halves = half_sines(q);
        for (i, step) in self.steps.iter().enumerate() {
            enter(step, &mut rotation, &mut position);
            axes[i] = JointAxis { direction: rotation * step.axis, point: position };
            move_along(step, q[i], halves.of(i), &mut rotation, &mut position);
        }
        position += rotation * self.tip.translation.vector;
        (Isometry3::from_parts(position.into(), rotation * self.tip.rotation), axes)
    }

    /// Tip pose and geometric Jacobian in the root frame.
    #[inline]
    pub(crate) fn jacobian(&self, q: &JointVector) -> (Isometry3<f64>, Jacobian) {
        let (tip, axes) = self.axes(q);
        let mut jacobian = Jacobian::zeros();
        for (i, step) in self.steps.iter().enumerate() {
            let JointAxis { direction, point } = axes[i];
            let mut column = jacobian.column_mut(i);
            if step.prismatic {
                column.fixed_rows_mut::<3>(0).copy_from(&direction);
            } else {
                let arm = tip.translation.vector - point;
                column.fixed_rows_mut::<3>(0).copy_from(&direction.cross(&arm));
                column.fixed_rows_mut::<3>(3).copy_from(&direction);
            }
        }
        (tip, jacobian)
    }
}

/// A joint's axis in the root frame.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct JointAxis {
    pub(crate) direction: Vector3<f64>,
    pub(crate) point: Vector3<f64>,
}

#[inline]
fn enter(step: &Step, rotation: &mut UnitQuaternion<f64>, position: &mut Vector3<f64>) {
    if step.shifts {
        *position += *rotation * step.offset.translation.vector;
    }
    if step.turns {
        *rotation *= step.offset.rotation;
    }
}

#[inline]
fn move_along(
    step: &Step,
    value: f64,
    (sin, cos): (f64, f64),
    rotation: &mut UnitQuaternion<f64>,
    position: &mut Vector3<f64>,
) {
    if step.prismatic {
        *position += *rotation * (step.axis * value);
    } else {
        let turn = Quaternion::from_parts(cos, step.axis * sin);
        *rotation *= UnitQuaternion::new_unchecked(turn);
    }
}

/// Sines and cosines of half of each joint value.
struct HalfSines {
    sin: [f64; MAX_DOF],
    cos: [f64; MAX_DOF],
}

impl HalfSines {
    #[inline]
    fn of(&self, joint: usize) -> (f64, f64) {
        (self.sin[joint], self.cos[joint])
    }
}

#[inline]
fn half_sines(q: &JointVector) -> HalfSines {
    let [a, b, c, d, e, f, g, h] = **q;
    let (s0, c0) = lanes::sin_cos(f64x4::new([a, b, c, d]) * 0.5);
    let (s1, c1) = lanes::sin_cos(f64x4::new([e, f, g, h]) * 0.5);
    let join = |one: f64x4, two: f64x4| {
        let ([a, b, c, d], [e, f, g, h]) = (one.to_array(), two.to_array());
        [a, b, c, d, e, f, g, h]
    };
    HalfSines { sin: join(s0, s1), cos: join(c0, c1) }
}

/// Rotation about a unit axis. \[rad\]
#[inline]
pub(crate) fn about(axis: &Vector3<f64>, angle: f64) -> UnitQuaternion<f64> {
    let (sin, cos) = libm::sincos(0.5 * angle);
    UnitQuaternion::new_unchecked(Quaternion::from_parts(cos, axis * sin))
}
