//! The forearms of a PR2-shaped arm with the shoulder pan given.
//!
//! Own derivation; terms as in [`super::shape`] and [`super::roll`]. With r the wrist centre from
//! the shoulder, turned back by the pan: |r|² = L₁² + L₂² + 2L₁L₂c₄ gives one cosine of the elbow,
//! r_y = Y = L₂s₃s₄ two rolls for each sign of it, and the lift turns (X, Z) to (r_x, r_z).
//!
//! Singular: where |r_y| = L₂|s₄| (both rolls meet, the branches end there), and where the elbow is
//! straight (the roll is free, and a wrist centre with r_y ≠ 0 is out of reach).

use nalgebra::Vector3;

use super::closed::{Family, Forearm};
use super::real::{Real, unit};
use super::shape::Pr2Shape;

/// Branch bits: 0 = sign of the cosine of the upper-arm roll (set: negative), 1 = sign of the elbow
/// (set: negative). In canonical angles, which for the PR2 are the joint angles.
#[derive(Debug)]
pub(crate) struct ShoulderPan {
    a: f64,
    l1: f64,
    l2: f64,
}

const ROLL_BACK: u8 = 1;
const ELBOW_NEGATIVE: u8 = 2;

/// Rounding that may put the cosine of the elbow past 1.
const ROUNDING: f64 = 1e-12;

/// Rounding of Z², in m²: at worst the tip is off by its root, 2·10⁻⁸ m, with the elbow straight.
const ROUNDING_SQUARE: f64 = 4e-16;

/// Below this sine the elbow is straight and the roll free.
const STRAIGHT: f64 = 1e-8;

pub(crate) struct Prepared {
    /// Wrist centre from the shoulder, turned back by the pan. \[m\]
    r: Vector3<f64>,
    pan: f64,
    sines: (f64, f64),
    /// Sine (not negative) and cosine of the elbow.
    elbow: (f64, f64),
    /// |Z|. \[m\]
    height: f64,
}

impl ShoulderPan {
    pub(super) fn new(shape: &Pr2Shape) -> Self {
        Self { a: shape.a, l1: shape.l1, l2: shape.l2 }
    }
}

impl Family for ShoulderPan {
    type Prepared = Prepared;
    const GIVEN: usize = 0;
    const FREE: usize = 2;
    const MARK: u8 = 8;

    #[inline]
    fn prepare(&self, w: &Vector3<f64>, pan: f64) -> Option<Prepared> {
        let Self { a, l1, l2 } = *self;
        let (s1, c1) = libm::sincos(pan);
        let r = Vector3::new(c1 * w.x + s1 * w.y - a, c1 * w.y - s1 * w.x, w.z);
        let c4 = (r.norm_squared() - l1 * l1 - l2 * l2) / (2.0 * l1 * l2);
        if c4.is_nan() || c4.abs() > 1.0 + ROUNDING {
            return None;
        }
        let c4 = c4.clamp(-1.0, 1.0);
        let s4 = ((1.0 - c4) * (1.0 + c4)).sqrt();
        let square = (l2 * s4) * (l2 * s4) - r.y * r.y;
        if square < -ROUNDING_SQUARE {
            return None;
        }
        let height = square.max(0.0).sqrt();
        Some(Prepared { r, pan, sines: (s1, c1), elbow: (s4, c4), height })
    }

    #[inline]
    fn choose(&self, t: &Prepared, bits: u8, free: f64) -> Option<[f64; 3]> {
        let s4 = if bits & ELBOW_NEGATIVE != 0 { -t.elbow.0 } else { t.elbow.0 };
        if t.elbow.0 < STRAIGHT {
            let (s3, c3) = libm::sincos(free);
            return Some([s4, s3, c3]);
        }
        let toward = if bits & ROLL_BACK != 0 { -t.height } else { t.height };
        let (s3, c3) = unit(t.r.y * s4.signum(), toward);
        Some([s4, s3, c3])
    }

    #[inline]
    fn is_distinct(&self, t: &Prepared, bits: u8) -> bool {
        let straight = t.elbow.0 < STRAIGHT;
        !(bits != 0 && straight || bits & ROLL_BACK != 0 && t.height == 0.0)
    }

    #[inline]
    fn forearm<T: Real>(&self, t: &Prepared, [s4, s3, c3]: [T; 3], _: f64) -> Forearm<T> {
        let [l1, l2, rx, rz, c4] = [self.l1, self.l2, t.r.x, t.r.z, t.elbow.1].map(T::splat);
        let (x, z) = (l1 + l2 * c4, -(l2 * c3 * s4));
        let lift = unit(rx * z - rz * x, rx * x + rz * z);
        Forearm {
            angles: [
                T::splat(t.pan),
                lift.0.angle_over(lift.1),
                s3.angle_over(c3),
                s4.angle_over(c4),
            ],
            sines: [(T::splat(t.sines.0), T::splat(t.sines.1)), lift, (s3, c3), (s4, c4)],
        }
    }
}
