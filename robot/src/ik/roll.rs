//! Closed form for a PR2-shaped arm with the upper-arm roll given.
//!
//! Own derivation; terms as in [`super::shape`]. With w the wrist centre from the canonical base,
//! n = |w|², X = L₁ + L₂c₄, Y = L₂s₃s₄, Z = −L₂c₃s₄ (the wrist centre in the lift frame) and
//! A = c₂X + s₂Z:
//!
//! n = a² + 2aA + L₁² + L₂² + 2L₁L₂c₄ and A² + w_z² = X² + Z² give a quadratic in c₄ with a leading
//! coefficient L₂²(L₁²/a² − s₃²) > 0. Each root gives two elbows; lift and pan follow, and the
//! wrist has two ways to the same rotation: eight solutions.

use std::f64::consts::PI;

use nalgebra::{Isometry3, Vector3};

use super::shape::{Pr2Shape, STRAIGHT, WristTarget};
use super::{Branch, InverseKinematics, Solution, Solutions};
use crate::JointVector;
use crate::limits::unwrap_near;

/// The solver. Branch bits: 0 = which root of the quadratic (set: the larger cosine of the elbow),
/// 1 = sign of the elbow (set: negative), 2 = sign of the wrist flex (set: negative), in canonical
/// angles, which for the PR2 are the joint angles themselves.
#[derive(Debug)]
pub(crate) struct UpperArmRoll {
    shape: Pr2Shape,
    range: (f64, f64),
    k1: f64,
    reach: f64,
}

const LARGER_ROOT: u8 = 1;
const ELBOW_NEGATIVE: u8 = 2;
const WRIST_NEGATIVE: u8 = 4;

/// Rounding that may put a cosine past 1 or a discriminant below 0. A clamp of this size moves
/// the tip by less than 10⁻¹¹ m.
const ROUNDING: f64 = 1e-12;

/// What does not depend on the branch.
struct Target {
    wrist: WristTarget,
    roll: (f64, f64),
    k0: f64,
    /// −b / 2a and √disc / 2a of the quadratic.
    centre: f64,
    spread: f64,
}

/// Canonical angles 1, 2 and 4 and the forearm's axes.
struct Forearm {
    pan: f64,
    lift: f64,
    elbow: f64,
    axes: [Vector3<f64>; 3],
}

impl UpperArmRoll {
    pub(crate) fn new(shape: Pr2Shape, range: (f64, f64)) -> Self {
        let Pr2Shape { a, l1, l2, .. } = shape;
        Self {
            k1: -l1 * l2 / a,
            reach: a * a + l1 * l1 + l2 * l2,
            range: if shape.continuous[2] { (-PI, PI) } else { range },
            shape,
        }
    }

    #[inline]
    fn prepare(&self, target: &Isometry3<f64>, roll: f64) -> Option<Target> {
        let Pr2Shape { a, l1, l2, .. } = self.shape;
        let wrist = self.shape.wrist_target(target);
        let (s3, c3) = self.shape.canonical(2, roll).sin_cos();
        let w = wrist.centre;
        let k0 = (w.norm_squared() - self.reach) / (2.0 * a);
        let side = (l2 * s3) * (l2 * s3);
        let qa = self.k1 * self.k1 - side;
        let half_b = k0 * self.k1 - l1 * l2;
        let qc = k0 * k0 + w.z * w.z - l1 * l1 - l2 * l2 + side;
        let disc = (half_b * half_b - qa * qc) / (qa * qa);
        if disc.is_nan() || disc < -ROUNDING {
            return None;
        }
        let spread = disc.max(0.0).sqrt();
        Some(Target { wrist, roll: (s3, c3), k0, centre: -half_b / qa, spread })
    }

    /// One of the four forearms. The pan is `free_pan` where the wrist centre is on the pan axis.
    #[inline]
    fn forearm(&self, t: &Target, branch: u8, free_pan: f64) -> Option<Forearm> {
        let Pr2Shape { a, l1, l2, .. } = self.shape;
        let c4 = if branch & LARGER_ROOT != 0 { t.centre + t.spread } else { t.centre - t.spread };
        if c4.abs() > 1.0 + ROUNDING {
            return None;
        }
        let c4 = c4.clamp(-1.0, 1.0);
        let straight = ((1.0 - c4) * (1.0 + c4)).sqrt();
        let s4 = if branch & ELBOW_NEGATIVE != 0 { -straight } else { straight };
        let (s3, c3) = t.roll;
        let w = t.wrist.centre;
        let (x, y, z) = (l1 + l2 * c4, l2 * s3 * s4, -l2 * c3 * s4);
        let ahead = t.k0 + self.k1 * c4;
        // Lift: rotates (x, z) to (ahead, w_z).
        let (s2, c2) = unit(ahead * z - w.z * x, ahead * x + w.z * z);
        // Pan: rotates (a + ahead, y) to (w_x, w_y).
        let (out_x, out_y) = (a + ahead, y);
        let (sp, cp) = (w.y * out_x - w.x * out_y, w.x * out_x + w.y * out_y);
        let (pan, (s1, c1)) = if sp.hypot(cp) < STRAIGHT * STRAIGHT {
            (free_pan, free_pan.sin_cos())
        } else {
            (sp.atan2(cp), unit(sp, cp))
        };
        let nx = Vector3::new(c1 * c2, s1 * c2, -s2);
        let ny = Vector3::new(-s1, c1, 0.0);
        let nz = Vector3::new(c1 * s2, s1 * s2, c2);
        let axis_y = ny * c3 + nz * s3;
        let up = nz * c3 - ny * s3;
        Some(Forearm {
            pan,
            lift: s2.atan2(c2),
            elbow: s4.atan2(c4),
            axes: [nx * c4 - up * s4, axis_y, nx * s4 + up * c4],
        })
    }
}

impl InverseKinematics for UpperArmRoll {
    fn redundancy_range(&self) -> Option<(f64, f64)> {
        Some(self.range)
    }

    fn redundant_joint(&self) -> Option<usize> {
        Some(2)
    }

    fn solve(&self, target: &Isometry3<f64>, redundancy: f64, out: &mut Solutions) {
        out.clear();
        let Some(t) = self.prepare(target, redundancy) else { return };
        let roll = self.shape.canonical(2, redundancy);
        for branch in 0..4u8 {
            // Where two branches meet, one of them stands for both.
            if t.spread == 0.0 && branch & LARGER_ROOT != 0 {
                continue;
            }
            let Some(forearm) = self.forearm(&t, branch, 0.0) else { continue };
            if branch & ELBOW_NEGATIVE != 0 && forearm.elbow == 0.0 {
                continue;
            }
            let wrist = Wrist::new(&forearm.axes, &t.wrist.axes);
            for flip in [0, WRIST_NEGATIVE] {
                if wrist.is_straight() && flip != 0 {
                    continue;
                }
                let [q5, q6, q7] = wrist.angles(flip != 0, 0.0);
                let canonical = [forearm.pan, forearm.lift, roll, forearm.elbow, q5, q6, q7];
                let q = self.shape.joints(&canonical, (2, redundancy));
                // Eight at most, and the capacity is larger.
                let _ = out.push(Solution { q, branch: Branch(branch | flip), redundancy });
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
        let t = self.prepare(target, redundancy)?;
        let forearm = self.forearm(&t, branch.0, self.shape.canonical(0, near[0]))?;
        let wrist = Wrist::new(&forearm.axes, &t.wrist.axes);
        let roll = self.shape.canonical(2, redundancy);
        let near_roll = self.shape.canonical(6, near[6]);
        let [q5, q6, q7] = wrist.angles(branch.0 & WRIST_NEGATIVE != 0, near_roll);
        let canonical = [forearm.pan, forearm.lift, roll, forearm.elbow, q5, q6, q7];
        let mut q = self.shape.joints(&canonical, (2, redundancy));
        for i in 0..7 {
            if self.shape.continuous[i] && i != 2 {
                q[i] = unwrap_near(q[i], near[i]);
            }
        }
        Some(Solution { q, branch, redundancy })
    }
}

/// The last three joints: W = Rx(q₅)·Ry(q₆)·Rx(q₇).
struct Wrist {
    /// Cosine and (positive) sine of the flex.
    flex: (f64, f64),
    /// W₁₀, −W₂₀: sine and cosine of the forearm roll, times the sine of the flex.
    first: (f64, f64),
    /// W₀₁, W₀₂, likewise of the wrist roll.
    last: (f64, f64),
    /// W₂₁, W₁₁: sine and cosine of the sum of both rolls where the wrist is straight.
    sum: (f64, f64),
}

impl Wrist {
    #[inline]
    fn new(forearm: &[Vector3<f64>; 3], wrist: &[Vector3<f64>; 3]) -> Self {
        let last = (forearm[0].dot(&wrist[1]), forearm[0].dot(&wrist[2]));
        Self {
            flex: (forearm[0].dot(&wrist[0]), (last.0 * last.0 + last.1 * last.1).sqrt()),
            first: (forearm[1].dot(&wrist[0]), -forearm[2].dot(&wrist[0])),
            last,
            sum: (forearm[2].dot(&wrist[1]), forearm[1].dot(&wrist[1])),
        }
    }

    fn is_straight(&self) -> bool {
        self.flex.1 < STRAIGHT
    }

    /// Canonical forearm roll, wrist flex and wrist roll; `near_roll` is the wrist roll where it is
    /// free.
    #[inline]
    fn angles(&self, negative: bool, near_roll: f64) -> [f64; 3] {
        let flex = self.flex.1.atan2(self.flex.0);
        if self.is_straight() {
            let sum = self.sum.0.atan2(self.sum.1);
            let roll = if self.flex.0 > 0.0 { sum - near_roll } else { sum + near_roll };
            return [roll, if negative { -flex } else { flex }, near_roll];
        }
        if negative {
            [(-self.first.0).atan2(-self.first.1), -flex, (-self.last.0).atan2(-self.last.1)]
        } else {
            [self.first.0.atan2(self.first.1), flex, self.last.0.atan2(self.last.1)]
        }
    }
}

/// (sine, cosine) along (y, x).
#[inline]
fn unit(y: f64, x: f64) -> (f64, f64) {
    let inverse = (x * x + y * y).sqrt().recip();
    (y * inverse, x * inverse)
}
