//! What the arm does between two knots: a straight joint line at constant velocity, or a cubic.

use nullsweep_robot::{JointVector, MAX_DOF};

/// A joint motion of some seconds: for each joint a cubic of u = 0…1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Curve {
    seconds: f64,
    /// Coefficients of 1, u, u² and u³.
    terms: [JointVector; 4],
    end: JointVector,
}

impl Curve {
    /// The straight line between two positions.
    #[must_use]
    pub fn line(a: &JointVector, b: &JointVector, seconds: f64) -> Self {
        let difference = *b - *a;
        Self { seconds, terms: [*a, difference, JointVector::ZERO, JointVector::ZERO], end: *b }
    }

    /// The cubic through two positions with given velocities (Hermite).
    #[must_use]
    pub fn cubic(
        (a, va): (&JointVector, &JointVector),
        (b, vb): (&JointVector, &JointVector),
        seconds: f64,
    ) -> Self {
        let first = JointVector::from_fn(|j| va[j] * seconds);
        let last = JointVector::from_fn(|j| vb[j] * seconds);
        let difference = *b - *a;
        let second = JointVector::from_fn(|j| 3.0 * difference[j] - 2.0 * first[j] - last[j]);
        let third = JointVector::from_fn(|j| first[j] + last[j] - 2.0 * difference[j]);
        Self { seconds, terms: [*a, first, second, third], end: *b }
    }

    /// How long it takes. \[s\]
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// The position at a share 0…1 of the time; the ends exactly. \[rad\] or \[m\]
    #[must_use]
    pub fn at(&self, share: f64) -> JointVector {
        if share >= 1.0 {
            return self.end;
        }
        let [a, b, c, d] = &self.terms;
        JointVector::from_fn(|j| a[j] + share * (b[j] + share * (c[j] + share * d[j])))
    }

    /// The velocity at a share of the time. \[rad/s\] or \[m/s\]
    #[must_use]
    pub fn velocity(&self, share: f64) -> JointVector {
        JointVector::from_fn(|j| self.slope(j, share) / self.seconds)
    }

    /// The acceleration at a share of the time. \[rad/s²\] or \[m/s²\]
    #[must_use]
    pub fn acceleration(&self, share: f64) -> JointVector {
        let [_, _, c, d] = &self.terms;
        JointVector::from_fn(|j| (2.0 * c[j] + 6.0 * share * d[j]) / self.seconds.powi(2))
    }

    /// The greatest speed of a joint. \[rad/s\] or \[m/s\]
    #[must_use]
    pub fn top_speed(&self, joint: usize) -> f64 {
        // A parabola: its ends and, if it lies between them, its vertex.
        let [_, _, c, d] = self.terms.map(|term| term[joint]);
        let vertex = -c / (3.0 * d);
        let inner =
            if vertex > 0.0 && vertex < 1.0 { self.slope(joint, vertex).abs() } else { 0.0 };
        self.slope(joint, 0.0).abs().max(self.slope(joint, 1.0).abs()).max(inner) / self.seconds
    }

    /// The greatest acceleration of a joint: it is linear in time. \[rad/s²\] or \[m/s²\]
    #[must_use]
    pub fn top_acceleration(&self, joint: usize) -> f64 {
        self.acceleration(0.0)[joint].abs().max(self.acceleration(1.0)[joint].abs())
    }

    /// The jerk of a joint, which is constant. \[rad/s³\] or \[m/s³\]
    #[must_use]
    pub fn jerk(&self, joint: usize) -> f64 {
        6.0 * self.terms[3][joint] / self.seconds.powi(3)
    }

    /// The lowest and the highest position of a joint. \[rad\] or \[m\]
    #[must_use]
    pub fn range(&self, joint: usize) -> (f64, f64) {
        let [a, b, c, d] = self.terms.map(|term| term[joint]);
        let end = self.end[joint];
        let (mut low, mut high) = (a.min(end), a.max(end));
        // Where b + 2c u + 3d u² = 0, in the form that does not cancel.
        let root = (c * c - 3.0 * d * b).max(0.0).sqrt();
        let k = -(c + root.copysign(c));
        for u in [k / (3.0 * d), b / k] {
            if u > 0.0 && u < 1.0 {
                let q = self.at(u)[joint];
                (low, high) = (low.min(q), high.max(q));
            }
        }
        (low, high)
    }

    /// The farthest that a joint can move within it. \[rad\] or \[m\]
    #[must_use]
    pub fn reach(&self) -> f64 {
        (0..MAX_DOF).map(|j| self.top_speed(j) * self.seconds).fold(0.0, f64::max)
    }

    /// Into how many equal parts it is cut so that no joint moves farther than `step` in one.
    #[must_use]
    pub fn steps(&self, step: f64) -> usize {
        ((self.reach() / step).ceil() as usize).max(1)
    }

    fn slope(&self, joint: usize, share: f64) -> f64 {
        let [_, b, c, d] = self.terms.map(|term| term[joint]);
        b + share * (2.0 * c + share * 3.0 * d)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn bounds_hold_and_derivatives_agree(
            ends in prop::array::uniform2(-3.0..3.0f64),
            speeds in prop::array::uniform2(-3.0..3.0f64),
            seconds in 0.001..2.0f64,
            straight in any::<bool>(),
        ) {
            let [a, b] = ends.map(|q| JointVector::new([q; MAX_DOF]));
            let [va, vb] = speeds.map(|v| JointVector::new([v; MAX_DOF]));
            let curve = if straight {
                Curve::line(&a, &b, seconds)
            } else {
                Curve::cubic((&a, &va), (&b, &vb), seconds)
            };
            prop_assert_eq!((curve.at(0.0), curve.at(1.0)), (a, b));
            let (low, high) = curve.range(0);
            let step = 1e-6;
            for k in 1..50 {
                let u = f64::from(k) / 50.0;
                let [q0, q, q1] = [u - step, u, u + step].map(|u| curve.at(u)[0]);
                prop_assert!(q >= low - 1e-9 && q <= high + 1e-9);
                let v = (q1 - q0) / (2.0 * step * seconds);
                prop_assert!((v - curve.velocity(u)[0]).abs() < 1e-5 * (1.0 + v.abs()));
                let [v0, v1] = [u - step, u + step].map(|u| curve.velocity(u)[0]);
                let acceleration = (v1 - v0) / (2.0 * step * seconds);
                let stated = curve.acceleration(u)[0];
                prop_assert!((acceleration - stated).abs() < 1e-4 * (1.0 + stated.abs()));
                prop_assert!(curve.velocity(u)[0].abs() <= curve.top_speed(0) * (1.0 + 1e-9));
                prop_assert!(stated.abs() <= curve.top_acceleration(0) * (1.0 + 1e-9));
            }
        }
    }
}
