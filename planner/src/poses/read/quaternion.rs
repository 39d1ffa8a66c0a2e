//! Quaternions as other programs write them: rounded, in either order.

use std::str::FromStr;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

/// Where the scalar part of a quaternion stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QuaternionOrder {
    /// Last, as ROS writes it.
    Xyzw,
    /// First, as Eigen's constructor, MuJoCo and Drake have it.
    Wxyz,
}

impl FromStr for QuaternionOrder {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "xyzw" => Ok(Self::Xyzw),
            "wxyz" => Ok(Self::Wxyz),
            _ => Err("xyzw or wxyz is wanted".into()),
        }
    }
}

impl QuaternionOrder {
    /// Four numbers in this order as x, y, z, w.
    pub(super) fn xyzw(self, [a, b, c, d]: [f64; 4]) -> [f64; 4] {
        match self {
            Self::Xyzw => [a, b, c, d],
            Self::Wxyz => [b, c, d, a],
        }
    }
}

/// How far the length of a quaternion may be from 1: two decimals and their rounding.
const LENGTH: f64 = 0.02;

/// How far it may be without a word.
const EXACT: f64 = 1e-3;

/// A pose and the length of its quaternion as it was given: x, y, z \[m\] and x, y, z, w.
pub(super) fn isometry(
    [x, y, z]: [f64; 3],
    [qx, qy, qz, qw]: [f64; 4],
) -> Result<(Isometry3<f64>, f64), String> {
    if ![x, y, z, qx, qy, qz, qw].iter().all(|n| n.is_finite()) {
        return Err("a number is not finite".into());
    }
    let quaternion = Quaternion::new(qw, qx, qy, qz);
    let length = quaternion.norm();
    if (length - 1.0).abs() > LENGTH {
        return Err(format!("the quaternion's length is {length:.4}, not 1"));
    }
    let rotation = UnitQuaternion::new_normalize(quaternion);
    Ok((Isometry3::from_parts(Translation3::new(x, y, z), rotation), length))
}

/// How many quaternions were no unit ones, and the worst.
#[derive(Clone, Debug, Default)]
pub(super) struct Quaternions {
    rounded: usize,
    worst: Option<(String, f64)>,
}

impl Quaternions {
    /// Notes the length of one; `place` says where it is.
    pub(super) fn see(&mut self, length: f64, place: impl FnOnce() -> String) {
        let off = (length - 1.0).abs();
        if off > EXACT {
            self.rounded += 1;
            if self.worst.as_ref().is_none_or(|(_, before)| off > (before - 1.0).abs()) {
                self.worst = Some((place(), length));
            }
        }
    }

    /// What is to be told.
    pub(super) fn note(self, file: &str) -> Option<String> {
        let (place, length) = self.worst?;
        let rounded = self.rounded;
        Some(format!(
            "{file}: {rounded} quaternions normalised, whose length is not 1; it is {length:.4} in \
             {place}"
        ))
    }
}
