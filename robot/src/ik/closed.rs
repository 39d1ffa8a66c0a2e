//! The closed-form solver of a PR2-shaped arm: a family gives up to four forearms, the wrist gives
//! two solutions for each.

use std::f64::consts::PI;

use nalgebra::{Isometry3, Vector3};
use wide::f64x4;

use super::real::{Real, unit};
use super::redundancy::Redundancy;
use super::shape::Pr2Shape;
use super::solution::{Branch, InverseKinematics, Solution, Solutions};
use crate::JointVector;
use crate::joints::unwrap_near;

/// Bit 2 of a branch: sign of the wrist flex (set: negative).
pub(super) const WRIST_NEGATIVE: u8 = 4;

/// Below this sine of the wrist flex both rolls turn about one line, and only their sum (or, for
/// the wrist folded back, their difference) is determined.
const STRAIGHT: f64 = 1e-9;

/// The first four joints with one of them given. All angles are canonical, see [`super::shape`].
pub(crate) trait Family: Send + Sync {
    /// What does not depend on the branch.
    type Prepared;
    /// Index of the given joint.
    const GIVEN: usize;
    /// Index of the joint that is free where the arm is singular.
    const FREE: usize;
    /// Marks the branches of this family, so that no other takes them for its own.
    const MARK: u8;

    /// `None` where no forearm reaches the wrist centre.
    fn prepare(&self, centre: &Vector3<f64>, given: f64) -> Option<Self::Prepared>;

    /// Numbers that pick one of the four forearms by the two low bits of a branch; `free` is the
    /// angle of the free joint where it is not determined. `None` where the branch does not reach.
    fn choose(&self, prepared: &Self::Prepared, bits: u8, free: f64) -> Option<[f64; 3]>;

    /// Whether `bits` stands for itself, or is one with a lower branch because both meet here.
    fn is_distinct(&self, prepared: &Self::Prepared, bits: u8) -> bool;

    /// The joints of a forearm.
    fn forearm<T: Real>(&self, prepared: &Self::Prepared, choice: [T; 3], free: f64) -> Forearm<T>;
}

/// Pan, lift, upper-arm roll and elbow.
pub(crate) struct Forearm<T> {
    pub(super) angles: [T; 4],
    /// (sine, cosine) of each.
    pub(super) sines: [(T, T); 4],
}

/// A family of the first four joints and the wrist that they share.
#[derive(Debug)]
pub(crate) struct ClosedForm<F> {
    shape: Pr2Shape,
    redundancy: Redundancy,
    family: F,
}

impl<F: Family> ClosedForm<F> {
    pub(super) fn new(shape: Pr2Shape, margined: &[(f64, f64)], family: F) -> Self {
        let redundancy = Redundancy::new(Some(F::GIVEN), margined, |j| shape.continuous[j]);
        Self { shape, redundancy, family }
    }

    fn assemble(&self, arm: [f64; 4], wrist: [f64; 3], given: f64) -> JointVector {
        let [pan, lift, roll, elbow] = arm;
        self.shape
            .joints(&[pan, lift, roll, elbow, wrist[0], wrist[1], wrist[2]], (F::GIVEN, given))
    }
}

impl<F: Family> InverseKinematics for ClosedForm<F> {
    fn redundancy_range(&self) -> Option<(f64, f64)> {
        self.redundancy.range
    }

    fn redundant_joint(&self) -> Option<usize> {
        self.redundancy.joint
    }

    fn solve(&self, target: &Isometry3<f64>, redundancy: f64, out: &mut Solutions) {
        out.clear();
        let target = self.shape.wrist_target(target);
        let given = self.shape.canonical(F::GIVEN, redundancy);
        let Some(prepared) = self.family.prepare(&target.centre, given) else { return };
        let choices: [_; 4] =
            std::array::from_fn(|bits| self.family.choose(&prepared, bits as u8, 0.0));
        let Some(any) = choices.iter().flatten().next() else { return };
        // A lane without a forearm computes one that exists, and is not read.
        let lane = |k: usize| f64x4::new(choices.map(|c| c.as_ref().unwrap_or(any)[k]));
        let forearm = self.family.forearm(&prepared, [lane(0), lane(1), lane(2)], 0.0);
        let wrist = Wrist::new(&axes(&forearm.sines), &target.axes);
        let angles = wrist.angles();
        let arm = forearm.angles.map(f64x4::to_array);
        let [first, flex, last] = angles.map(f64x4::to_array);
        let bend = wrist.bend().to_array();
        for bits in 0..4 {
            if choices[bits].is_none() || !self.family.is_distinct(&prepared, bits as u8) {
                continue;
            }
            let arm = arm.map(|lanes| lanes[bits]);
            let mut push = |wrist: [f64; 3], wrist_bit: u8| {
                let q = self.assemble(arm, wrist, redundancy);
                let branch = Branch(F::MARK | wrist_bit | bits as u8);
                // Eight at most, which is less than the capacity.
                let _ = out.push(Solution { q, branch, redundancy });
            };
            if bend[bits] < STRAIGHT {
                push(wrist.lane(bits).straight(0.0), 0);
            } else {
                push([first[bits], flex[bits], last[bits]], 0);
                push([first[bits] + PI, -flex[bits], last[bits] + PI], WRIST_NEGATIVE);
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
        if branch.0 & !(WRIST_NEGATIVE | 3) != F::MARK {
            return None;
        }
        let target = self.shape.wrist_target(target);
        let given = self.shape.canonical(F::GIVEN, redundancy);
        let prepared = self.family.prepare(&target.centre, given)?;
        let free = self.shape.canonical(F::FREE, near[F::FREE]);
        let choice = self.family.choose(&prepared, branch.0 & 3, free)?;
        let forearm = self.family.forearm(&prepared, choice, free);
        let wrist = Wrist::new(&axes(&forearm.sines), &target.axes);
        let turned = if wrist.bend() < STRAIGHT {
            wrist.straight(self.shape.canonical(6, near[6]))
        } else {
            let [first, flex, last] = wrist.angles();
            if branch.0 & WRIST_NEGATIVE == 0 {
                [first, flex, last]
            } else {
                [first + PI, -flex, last + PI]
            }
        };
        let mut q = self.assemble(forearm.angles, turned, redundancy);
        for i in (0..7).filter(|&i| i != F::GIVEN && self.shape.continuous[i]) {
            q[i] = unwrap_near(q[i], near[i]);
        }
        Some(Solution { q, branch, redundancy })
    }
}

/// Columns of Rz(q₁)·Ry(q₂)·Rx(q₃)·Ry(q₄): the forearm's axes in the canonical base frame.
#[inline]
fn axes<T: Real>(sines: &[(T, T); 4]) -> [[T; 3]; 3] {
    let [(s1, c1), (s2, c2), (s3, c3), (s4, c4)] = *sines;
    // Columns after pan and lift: x, y = (−s₁, c₁, 0) and z.
    let x = [c1 * c2, s1 * c2, -s2];
    let z = [c1 * s2, s1 * s2, c2];
    let side = [s3 * z[0] - c3 * s1, s3 * z[1] + c3 * c1, s3 * z[2]];
    let up = [c3 * z[0] + s3 * s1, c3 * z[1] - s3 * c1, c3 * z[2]];
    let mix = |a: T, b: T| std::array::from_fn(|i| a * x[i] + b * up[i]);
    [mix(c4, -s4), side, mix(s4, c4)]
}

/// The last three joints, W = Rx(q₅)·Ry(q₆)·Rx(q₇), by the columns of W.
struct Wrist<T> {
    columns: [[T; 3]; 3],
}

impl<T: Real> Wrist<T> {
    #[inline]
    fn new(forearm: &[[T; 3]; 3], wrist: &[Vector3<f64>; 3]) -> Self {
        let entry = |f: &[T; 3], w: &Vector3<f64>| {
            f[0] * T::splat(w.x) + f[1] * T::splat(w.y) + f[2] * T::splat(w.z)
        };
        Self {
            columns: std::array::from_fn(|c| {
                std::array::from_fn(|r| entry(&forearm[r], &wrist[c]))
            }),
        }
    }

    /// |sin q₆|, from W₁₀ = sin q₅ sin q₆ and W₂₀ = −cos q₅ sin q₆.
    #[inline]
    fn bend(&self) -> T {
        let [_, y, z] = self.columns[0];
        (y * y + z * z).sqrt()
    }

    /// Forearm roll, wrist flex (not negative) and wrist roll. The other solution for the same rotation
    /// is half a turn of both rolls and the negative flex.
    #[inline]
    fn angles(&self) -> [T; 3] {
        let [x, y, z] = self.columns[0];
        let first = unit(y, -z);
        [first.0.angle_over(first.1), self.bend().angle_over(x), self.last(first)]
    }

    /// The wrist roll that goes with a forearm roll (sine, cosine), from Rx(−q₅)·W. However loose
    /// the forearm roll is near a straight wrist, the two together give W.
    #[inline]
    fn last(&self, (sin, cos): (T, T)) -> T {
        let [_, y, z] = [0, 1, 2].map(|i| self.columns[i]);
        (-(cos * z[1] + sin * z[2])).angle_over(cos * y[1] + sin * y[2])
    }
}

impl Wrist<f64x4> {
    fn lane(&self, i: usize) -> Wrist<f64> {
        Wrist { columns: self.columns.map(|column| column.map(|entry| entry.to_array()[i])) }
    }
}

impl Wrist<f64> {
    /// The angles of a straight (or folded) wrist whose own roll is kept.
    fn straight(&self, last: f64) -> [f64; 3] {
        let [x, y, _] = [0, 1, 2].map(|i| self.columns[i]);
        // W₂₁ and W₁₁: sine and cosine of the sum of both rolls, or, folded, of their difference.
        let sum = libm::atan2(y[2], y[1]);
        let first = if x[0] > 0.0 { sum - last } else { sum + last };
        [first, libm::atan2(self.bend(), x[0]), self.last(libm::sincos(first))]
    }
}
