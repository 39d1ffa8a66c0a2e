//! The forearms of a PR2-shaped arm with the upper-arm roll given.
//!
//! Own derivation; terms as in [`super::shape`]. With w the wrist centre from the canonical base,
//! n = |w|², X = L₁ + L₂c₄, Y = L₂s₃s₄, Z = −L₂c₃s₄ (the wrist centre in the lift frame) and
//! A = c₂X + s₂Z:
//!
//! n = a² + 2aA + L₁² + L₂² + 2L₁L₂c₄ and A² + w_z² = X² + Z² give a quadratic in c₄ with a leading
//! coefficient L₂²(L₁²/a² − s₃²) > 0. Each root gives two elbows; lift and pan follow.
//!
//! Singular: where both roots meet (a fold: the branches end there), where the elbow is straight
//! (both elbows are one), and where the wrist centre is on the pan axis (the pan is free).

use nalgebra::Vector3;

use super::closed::{Family, Forearm};
use super::real::{Real, unit};
use super::shape::Pr2Shape;

/// Branch bits: 0 = root of the quadratic (set: the larger cosine of the elbow), 1 = sign of the
/// elbow (set: negative). In canonical angles, which for the PR2 are the joint angles.
#[derive(Debug)]
pub(crate) struct UpperArmRoll {
    a: f64,
    l1: f64,
    l2: f64,
    k1: f64,
    reach: f64,
}

const LARGER_ROOT: u8 = 1;
const ELBOW_NEGATIVE: u8 = 2;

/// Rounding that may put a cosine past 1 or a discriminant below 0. A clamp of this size moves
/// the tip by less than 10⁻¹¹ m.
const ROUNDING: f64 = 1e-12;

/// Nearer than this to the pan axis, the wrist centre is on it. \[m\]
const ON_AXIS: f64 = 1e-9;

pub(crate) struct Prepared {
    centre: Vector3<f64>,
    roll: f64,
    /// Sine and cosine of the roll.
    sines: (f64, f64),
    k0: f64,
    /// −b / 2a and √disc / 2a of the quadratic.
    middle: f64,
    spread: f64,
    on_axis: bool,
}

impl UpperArmRoll {
    pub(super) fn new(shape: &Pr2Shape) -> Self {
        let Pr2Shape { a, l1, l2, .. } = *shape;
        Self { a, l1, l2, k1: -l1 * l2 / a, reach: a * a + l1 * l1 + l2 * l2 }
    }
}

impl Family for UpperArmRoll {
    type Prepared = Prepared;
    const GIVEN: usize = 2;
    const FREE: usize = 0;
    const MARK: u8 = 0;

    #[inline]
    fn prepare(&self, w: &Vector3<f64>, roll: f64) -> Option<Prepared> {
        let Self { a, l1, l2, k1, reach } = *self;
        let (s3, c3) = libm::sincos(roll);
        let k0 = (w.norm_squared() - reach) / (2.0 * a);
        let side = (l2 * s3) * (l2 * s3);
        let inverse = (k1 * k1 - side).recip();
        let middle = (l1 * l2 - k0 * k1) * inverse;
        let rest = (k0 * k0 + w.z * w.z - l1 * l1 - l2 * l2 + side) * inverse;
        let disc = middle * middle - rest;
        if disc.is_nan() || disc < -ROUNDING {
            return None;
        }
        let on_axis = w.x * w.x + w.y * w.y < ON_AXIS * ON_AXIS;
        let spread = disc.max(0.0).sqrt();
        Some(Prepared { centre: *w, roll, sines: (s3, c3), k0, middle, spread, on_axis })
    }

    #[inline]
    fn choose(&self, t: &Prepared, bits: u8, _: f64) -> Option<[f64; 3]> {
        let c4 = if bits & LARGER_ROOT != 0 { t.middle + t.spread } else { t.middle - t.spread };
        if c4.abs() > 1.0 + ROUNDING {
            return None;
        }
        let c4 = c4.clamp(-1.0, 1.0);
        let s4 = ((1.0 - c4) * (1.0 + c4)).sqrt();
        Some([c4, if bits & ELBOW_NEGATIVE != 0 { -s4 } else { s4 }, 0.0])
    }

    #[inline]
    fn is_distinct(&self, t: &Prepared, bits: u8) -> bool {
        let one_root = t.spread == 0.0 && bits & LARGER_ROOT != 0;
        let straight = bits & ELBOW_NEGATIVE != 0
            && self.choose(t, bits, 0.0).is_some_and(|[_, s4, _]| s4 == 0.0);
        !(one_root || straight)
    }

    #[inline]
    fn forearm<T: Real>(&self, t: &Prepared, [c4, s4, _]: [T; 3], free: f64) -> Forearm<T> {
        let [a, l1, l2, k0, k1] = [self.a, self.l1, self.l2, t.k0, self.k1].map(T::splat);
        let [wx, wy, wz] = [t.centre.x, t.centre.y, t.centre.z].map(T::splat);
        let roll = (T::splat(t.sines.0), T::splat(t.sines.1));
        let (x, y, z) = (l1 + l2 * c4, l2 * roll.0 * s4, -(l2 * roll.1 * s4));
        let ahead = k0 + k1 * c4;
        // The lift turns (X, Z) to (A, w_z), the pan (a + A, Y) to (w_x, w_y).
        let lift = unit(ahead * z - wz * x, ahead * x + wz * z);
        let out = a + ahead;
        let (pan, pan_angle) = if t.on_axis {
            let (sin, cos) = libm::sincos(free);
            ((T::splat(sin), T::splat(cos)), T::splat(free))
        } else {
            let pan = unit(wy * out - wx * y, wx * out + wy * y);
            (pan, pan.0.angle_over(pan.1))
        };
        Forearm {
            angles: [pan_angle, lift.0.angle_over(lift.1), T::splat(t.roll), s4.angle_over(c4)],
            sines: [pan, lift, roll, (s4, c4)],
        }
    }
}
