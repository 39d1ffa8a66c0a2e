//! A rigid transform as a matrix: what the inner loops of the collision check multiply with.

use nalgebra::{Isometry3, Matrix3, Vector3};

/// Rotation matrix and translation \[m\]: `p ↦ rotation · p + translation`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    pub(crate) rotation: Matrix3<f64>,
    pub(crate) translation: Vector3<f64>,
}

impl Frame {
    pub(crate) const IDENTITY: Self = Self {
        rotation: Matrix3::new(1., 0., 0., 0., 1., 0., 0., 0., 1.),
        translation: Vector3::new(0., 0., 0.),
    };

    /// The point of this frame in the parent's coordinates.
    #[inline]
    pub(crate) fn apply(&self, p: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * p + self.translation
    }

    /// The parent's point in this frame's coordinates.
    #[inline]
    pub(crate) fn apply_inverse(&self, p: &Vector3<f64>) -> Vector3<f64> {
        self.rotation.tr_mul(&(p - self.translation))
    }

    /// `self · inner`.
    #[inline]
    pub(crate) fn then(&self, inner: &Self) -> Self {
        Self {
            rotation: self.rotation * inner.rotation,
            translation: self.rotation * inner.translation + self.translation,
        }
    }

    /// `self⁻¹ · other`: the other frame in this frame's coordinates.
    #[inline]
    pub(crate) fn inverse_then(&self, other: &Self) -> Self {
        Self {
            rotation: self.rotation.tr_mul(&other.rotation),
            translation: self.apply_inverse(&other.translation),
        }
    }

    /// The pose in parry's own mathematics (glam).
    #[inline]
    pub(crate) fn to_parry(self) -> parry3d_f64::math::Pose {
        use parry3d_f64::math::{Mat3, Pose, Rot3, Vec3};
        let r = &self.rotation;
        let t = &self.translation;
        let columns = Mat3::from_cols_array(&[
            r[(0, 0)],
            r[(1, 0)],
            r[(2, 0)],
            r[(0, 1)],
            r[(1, 1)],
            r[(2, 1)],
            r[(0, 2)],
            r[(1, 2)],
            r[(2, 2)],
        ]);
        Pose::from_parts(Vec3::new(t.x, t.y, t.z), Rot3::from_mat3(&columns))
    }
}

impl From<&Isometry3<f64>> for Frame {
    fn from(pose: &Isometry3<f64>) -> Self {
        Self {
            rotation: *pose.rotation.to_rotation_matrix().matrix(),
            translation: pose.translation.vector,
        }
    }
}
