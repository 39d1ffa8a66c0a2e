//! Recognises an arm of the PR2's shape and measures it; the wrist that both solvers share.
//!
//! The shape, in the terms of a canonical frame with z along the pan axis and x from the pan axis
//! to the shoulder: Rz(q₁) · Tx(a) · Ry(q₂) · Rx(q₃) · Tx(L₁) · Ry(q₄) · Rx(q₅) · Tx(L₂) · Ry(q₆) ·
//! Rx(q₇). Consecutive axes are perpendicular; lift and upper-arm roll meet in the shoulder,
//! upper-arm roll, elbow and forearm roll in the elbow, forearm roll and both wrist axes in the
//! wrist centre. Any URDF with these axes is recognised, whatever its zero positions, signs and
//! frames and whatever is mounted on the last joint.

use nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, Vector3};

use crate::chain::{Chain, JointAxis};
use crate::joints::{unwrap_near, wrap};
use crate::limits::JointLimits;
use crate::{JointVector, MAX_DOF};

/// An arm's measures and how its joints map to the canonical ones.
#[derive(Clone, Debug)]
pub(crate) struct Pr2Shape {
    /// Pan axis to shoulder. \[m\]
    pub(crate) a: f64,
    /// Shoulder to elbow. \[m\]
    pub(crate) l1: f64,
    /// Elbow to wrist centre. \[m\]
    pub(crate) l2: f64,
    /// Root frame in the canonical base frame (on the pan axis at the shoulder's height).
    from_root: Isometry3<f64>,
    /// Canonical wrist frame in the tip frame.
    wrist_in_tip: Isometry3<f64>,
    /// canonical = sign · joint + offset
    sign: [f64; 7],
    offset: [f64; 7],
    /// Middle of each joint's range; 0 for continuous joints. \[rad\]
    middle: [f64; 7],
    pub(crate) continuous: [bool; 7],
}

/// A target in canonical terms.
pub(crate) struct WristTarget {
    /// Wrist centre in the canonical base frame. \[m\]
    pub(crate) centre: Vector3<f64>,
    /// Columns of the wrist's rotation in the canonical base frame.
    pub(crate) axes: [Vector3<f64>; 3],
}

impl Pr2Shape {
    /// The measures of a chain of this shape, or `None` for any other.
    pub(crate) fn recognise(chain: &Chain, limits: &[JointLimits]) -> Option<Self> {
        if chain.dof() != 7 || chain.steps.iter().any(|s| s.prismatic) {
            return None;
        }
        let (tip, axes) = chain.axes(&JointVector::new([0.0; MAX_DOF]));
        let u: Vec<Vector3<f64>> = axes.iter().map(|a| a.direction).collect();
        if (0..6).any(|i| u[i].dot(&u[i + 1]).abs() > TOLERANCE) {
            return None;
        }
        let shoulder = meeting(&axes[1], &axes[2])?;
        let elbow = meeting(&axes[2], &axes[3])?;
        let wrist = meeting(&axes[4], &axes[5])?;
        if distance(&axes[4], &elbow) > TOLERANCE || distance(&axes[6], &wrist) > TOLERANCE {
            return None;
        }
        let foot = axes[0].point + u[0] * u[0].dot(&(shoulder - axes[0].point));
        let (a, l1, l2) =
            ((shoulder - foot).norm(), (elbow - shoulder).norm(), (wrist - elbow).norm());
        // The closed form needs its quadratic's leading coefficient, L₂²(L₁²/a² − sin²q₃), and
        // L₁ + L₂ cos q₄ to stay positive.
        if a < 0.02 * l1 || a > 0.95 * l1 || l2 > 0.98 * l1 || l2 < 0.02 * l1 {
            return None;
        }
        let (x, upper, fore) =
            ((shoulder - foot) / a, (elbow - shoulder) / l1, (wrist - elbow) / l2);
        // The shoulder's offset must be the common normal of pan and lift.
        if x.dot(&u[1]).abs() > TOLERANCE {
            return None;
        }
        let y = u[1];
        let z = x.cross(&y);
        let offset = [
            0.0,
            angle(&x, &upper, &y),
            angle(&y, &u[3], &upper),
            angle(&upper, &fore, &u[3]),
            angle(&u[3], &u[5], &fore),
            angle(&fore, &u[6], &u[5]),
            0.0,
        ];
        let sign = [z.dot(&u[0]), 1.0, upper.dot(&u[2]), 1.0, fore.dot(&u[4]), 1.0, 1.0];
        let frame = |x: Vector3<f64>, y: Vector3<f64>, origin: Vector3<f64>| {
            let rotation =
                Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, x.cross(&y)]));
            Isometry3::from_parts(origin.into(), UnitQuaternion::from_rotation_matrix(&rotation))
        };
        let middle = |i: usize| {
            let JointLimits { lower, upper, continuous, .. } = limits[i];
            if continuous { 0.0 } else { 0.5 * (lower + upper) }
        };
        Some(Self {
            a,
            l1,
            l2,
            from_root: frame(x, y, foot).inverse(),
            wrist_in_tip: tip.inverse() * frame(u[6], u[5], wrist),
            sign: sign.map(f64::signum),
            offset,
            middle: std::array::from_fn(middle),
            continuous: std::array::from_fn(|i| limits[i].continuous),
        })
    }

    /// The wrist that puts the tip at a target.
    #[inline]
    pub(crate) fn wrist_target(&self, target: &Isometry3<f64>) -> WristTarget {
        let wrist = self.from_root * (target * self.wrist_in_tip);
        let rotation = wrist.rotation.to_rotation_matrix();
        let m = rotation.matrix();
        WristTarget {
            centre: wrist.translation.vector,
            axes: [m.column(0).into(), m.column(1).into(), m.column(2).into()],
        }
    }

    /// The canonical angle of a joint.
    #[inline]
    pub(crate) fn canonical(&self, joint: usize, q: f64) -> f64 {
        self.sign[joint] * q + self.offset[joint]
    }

    /// Joint positions for canonical angles, in the representation that the trait promises;
    /// `given` keeps its value.
    #[inline]
    pub(crate) fn joints(&self, canonical: &[f64; 7], given: (usize, f64)) -> JointVector {
        let mut q = [0.0; MAX_DOF];
        for i in 0..7 {
            let angle = self.sign[i] * (canonical[i] - self.offset[i]);
            q[i] =
                if self.continuous[i] { wrap(angle) } else { unwrap_near(angle, self.middle[i]) };
        }
        q[given.0] = given.1;
        JointVector::new(q)
    }
}

/// Relative to lengths of about a metre and to unit vectors.
const TOLERANCE: f64 = 1e-9;

/// Where two perpendicular axes meet.
fn meeting(one: &JointAxis, two: &JointAxis) -> Option<Vector3<f64>> {
    let point = one.point + one.direction * one.direction.dot(&(two.point - one.point));
    (distance(two, &point) < TOLERANCE).then_some(point)
}

fn distance(axis: &JointAxis, point: &Vector3<f64>) -> f64 {
    (point - axis.point).cross(&axis.direction).norm()
}

/// Angle from one vector to another about an axis perpendicular to both.
fn angle(from: &Vector3<f64>, to: &Vector3<f64>, axis: &Vector3<f64>) -> f64 {
    libm::atan2(axis.dot(&from.cross(to)), from.dot(to))
}
