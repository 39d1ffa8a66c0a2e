//! Joint vectors and their geometry.

use std::f64::consts::{PI, TAU};
use std::ops::{Add, Deref, DerefMut, Sub};

use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

use crate::limits::JointLimits;

/// The largest number of active joints in an arm.
pub const MAX_DOF: usize = 8;

/// One value per active joint in chain order \[rad\] or \[m\]; unused tail entries are exactly 0, so
/// that norms and costs may run over all lanes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Pod, Zeroable)]
#[repr(transparent)]
#[serde(transparent)]
pub struct JointVector([f64; MAX_DOF]);

impl JointVector {
    /// All joints at 0.
    pub const ZERO: Self = Self([0.0; MAX_DOF]);

    /// With these values.
    #[must_use]
    #[inline]
    pub const fn new(values: [f64; MAX_DOF]) -> Self {
        Self(values)
    }

    /// With the value that each joint's index gives.
    #[must_use]
    #[inline]
    pub fn from_fn(value: impl FnMut(usize) -> f64) -> Self {
        Self(std::array::from_fn(value))
    }

    /// The vector at `share` 0…1 of the straight line to another one.
    #[must_use]
    #[inline]
    pub fn lerp(&self, to: &Self, share: f64) -> Self {
        Self::from_fn(|j| self[j] + share * (to[j] - self[j]))
    }

    /// Euclidean distance. \[rad\] or \[m\]
    #[must_use]
    #[inline]
    pub fn distance(&self, other: &Self) -> f64 {
        (0..MAX_DOF).map(|j| (other[j] - self[j]).powi(2)).sum::<f64>().sqrt()
    }

    /// How far each joint moves on the straight line to another vector, without a sign.
    #[must_use]
    #[inline]
    pub fn displacement(&self, to: &Self) -> Self {
        Self::from_fn(|j| (to[j] - self[j]).abs())
    }

    /// Whole turns, for each joint those that bring this vector nearest to another one.
    #[must_use]
    pub fn turns_to(&self, near: &Self) -> Self {
        Self::from_fn(|j| ((near[j] - self[j]) / TAU).round() * TAU)
    }
}

impl Deref for JointVector {
    type Target = [f64; MAX_DOF];

    #[inline]
    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

impl DerefMut for JointVector {
    #[inline]
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.0
    }
}

impl From<[f64; MAX_DOF]> for JointVector {
    #[inline]
    fn from(values: [f64; MAX_DOF]) -> Self {
        Self(values)
    }
}

impl From<JointVector> for [f64; MAX_DOF] {
    #[inline]
    fn from(q: JointVector) -> Self {
        q.0
    }
}

impl<'a> IntoIterator for &'a JointVector {
    type Item = &'a f64;
    type IntoIter = std::slice::Iter<'a, f64>;

    #[inline]
    fn into_iter(self) -> Self::IntoIter {
        self.0.iter()
    }
}

impl Add for JointVector {
    type Output = Self;

    #[inline]
    fn add(self, other: Self) -> Self {
        Self::from_fn(|j| self[j] + other[j])
    }
}

impl Sub for JointVector {
    type Output = Self;

    #[inline]
    fn sub(self, other: Self) -> Self {
        Self::from_fn(|j| self[j] - other[j])
    }
}

/// Which joints turn without end, so that whole turns of them make no difference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Continuous([bool; MAX_DOF]);

impl Continuous {
    /// Of the joints with these limits.
    #[must_use]
    pub fn of(limits: &[JointLimits]) -> Self {
        let mut continuous = [false; MAX_DOF];
        for (c, limits) in continuous.iter_mut().zip(limits) {
            *c = limits.continuous;
        }
        Self(continuous)
    }

    /// Of the joints so marked.
    #[must_use]
    pub const fn new(continuous: [bool; MAX_DOF]) -> Self {
        Self(continuous)
    }

    /// Whether a joint turns without end.
    #[must_use]
    #[inline]
    pub fn is(&self, joint: usize) -> bool {
        self.0[joint]
    }

    /// How far each joint moves from `a` to `b`, continuous ones the shorter way round, without a
    /// sign. \[rad\] or \[m\]
    #[must_use]
    #[inline]
    pub fn displacement(&self, a: &JointVector, b: &JointVector) -> JointVector {
        JointVector::from_fn(|j| {
            let raw = b[j] - a[j];
            let turns = if self.0[j] { (raw / TAU).round() } else { 0.0 };
            (raw - turns * TAU).abs()
        })
    }

    /// Whole turns of the continuous joints, those that bring `q` nearest to `near`. \[rad\]
    #[must_use]
    pub fn turns_to(&self, q: &JointVector, near: &JointVector) -> JointVector {
        let turns = q.turns_to(near);
        JointVector::from_fn(|j| if self.0[j] { turns[j] } else { 0.0 })
    }

    /// `q` with whole turns of its continuous joints taken away so that it is nearest to `near`.
    #[must_use]
    pub fn nearest_turn(&self, q: &JointVector, near: &JointVector) -> JointVector {
        JointVector::from_fn(|j| match self.0[j] {
            true => q[j] - ((q[j] - near[j]) / TAU).round() * TAU,
            false => q[j],
        })
    }
}

/// The same angle in (−π, π]. \[rad\]
#[must_use]
#[inline]
pub fn wrap(angle: f64) -> f64 {
    // Nearly always true, and rounding is a call where the processor has no instruction for it.
    if angle > -PI && angle <= PI {
        return angle;
    }
    // Half a turn rounds either way.
    match unwrap_near(angle, 0.0) {
        wrapped if wrapped <= -PI => wrapped + TAU,
        wrapped if wrapped > PI => wrapped - TAU,
        wrapped => wrapped,
    }
}

/// The same angle, by whole turns nearest to `near`. \[rad\]
#[inline]
pub(crate) fn unwrap_near(angle: f64, near: f64) -> f64 {
    let ahead = near - angle;
    if ahead.abs() <= PI {
        return angle;
    }
    angle + (ahead / TAU).round_ties_even() * TAU
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_a_turn_is_pi_from_either_side() {
        for (angle, wanted) in [(PI, PI), (-PI, PI), (3.0 * PI, PI), (0.1 + TAU, 0.1), (-3.0, -3.0)]
        {
            assert!((wrap(angle) - wanted).abs() < 1e-12, "{angle}: {}", wrap(angle));
        }
        assert_eq!((wrap(PI), wrap(-PI)), (PI, PI));
        assert!((wrap(-100.0) + 100.0 - 16.0 * TAU).abs() < 1e-12);
        // Next to half a turn the quotient rounds, and the angle is inside all the same.
        for turns in -20..=20 {
            let half = (f64::from(turns) + 0.5) * TAU;
            for angle in [half.next_down(), half, half.next_up()] {
                let wrapped = wrap(angle);
                assert!(wrapped > -PI && wrapped <= PI, "{angle}: {wrapped}");
            }
        }
    }

    #[test]
    fn whole_turns_bring_an_angle_near_another_one() {
        assert!((unwrap_near(0.1, 13.0) - (0.1 + 2.0 * TAU)).abs() < 1e-12);
        assert_eq!(unwrap_near(3.0, 0.0), 3.0);
    }

    #[test]
    fn continuous_joints_go_the_short_way_round() {
        let mut marked = [false; MAX_DOF];
        marked[1] = true;
        let continuous = Continuous::new(marked);
        let a = JointVector::new([3.0; MAX_DOF]);
        let b = JointVector::new([-3.0; MAX_DOF]);
        let d = continuous.displacement(&a, &b);
        assert_eq!((d[0], d[1]), (6.0, TAU - 6.0));
        let near = continuous.nearest_turn(&b, &a);
        assert_eq!((near[0], near[1]), (-3.0, -3.0 + TAU));
        assert_eq!(b + continuous.turns_to(&b, &a), near);
        assert_eq!(a.lerp(&b, 0.5), JointVector::ZERO);
        assert!((a.distance(&b) - 6.0 * (MAX_DOF as f64).sqrt()).abs() < 1e-12);
    }
}
