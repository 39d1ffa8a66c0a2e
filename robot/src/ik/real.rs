//! One number, or four at once: the closed forms are written once for both.

use std::ops::{Add, Mul, Neg, Sub};

use wide::f64x4;

use crate::lanes;

/// What the closed forms need of a number.
pub(crate) trait Real:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self>
{
    fn splat(value: f64) -> Self;
    fn sqrt(self) -> Self;
    fn recip(self) -> Self;
    /// Angle of the point (x, self), in [−π, π]; 0 for the origin.
    fn angle_over(self, x: Self) -> Self;
}

impl Real for f64 {
    #[inline]
    fn splat(value: f64) -> Self {
        value
    }
    #[inline]
    fn sqrt(self) -> Self {
        self.sqrt()
    }
    #[inline]
    fn recip(self) -> Self {
        self.recip()
    }
    #[inline]
    fn angle_over(self, x: Self) -> Self {
        libm::atan2(self, x)
    }
}

impl Real for f64x4 {
    #[inline]
    fn splat(value: f64) -> Self {
        Self::splat(value)
    }
    #[inline]
    fn sqrt(self) -> Self {
        self.sqrt()
    }
    #[inline]
    fn recip(self) -> Self {
        Self::ONE / self
    }
    #[inline]
    fn angle_over(self, x: Self) -> Self {
        lanes::atan2(self, x)
    }
}

/// (sine, cosine) of the direction (x, y).
#[inline]
pub(super) fn unit<T: Real>(y: T, x: T) -> (T, T) {
    let inverse = (x * x + y * y).sqrt().recip();
    (y * inverse, x * inverse)
}
