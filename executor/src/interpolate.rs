//! Between two knots: straight joint lines (bang-bang velocity) or cubic Hermite curves.
//!
//! Everything is evaluated in closed form from absolute plan time, so nothing drifts, and both
//! ends of a segment are hit bit for bit.

use nullsweep_ipc_types::Interpolation;
pub use nullsweep_recording::PlanKnot;

use crate::total::greater;
use crate::{JointVector, MAX_DOF};

/// Positions and velocities at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// \[rad\] or \[m\]
    pub q: JointVector,
    /// \[rad/s\] or \[m/s\]
    pub v: JointVector,
}

/// The sample of the segment `a`…`b` at plan time `time`, clamped to the segment. \[ns\]
#[must_use]
pub fn sample(a: &PlanKnot, b: &PlanKnot, kind: Interpolation, time: f64) -> Sample {
    let length = b.time - a.time;
    let u = (time - a.time) / length;
    if !(u > 0.0) {
        return Sample { q: a.q, v: velocity_at(a, b, kind, 0.0) };
    }
    if u >= 1.0 {
        return Sample { q: b.q, v: velocity_at(a, b, kind, 1.0) };
    }
    let mut q = [0.0; MAX_DOF];
    match kind {
        Interpolation::Linear => {
            for j in 0..MAX_DOF {
                q[j] = a.q[j] + (b.q[j] - a.q[j]) * u;
            }
        }
        Interpolation::Cubic => {
            for j in 0..MAX_DOF {
                let c = Cubic::new(a, b, j);
                q[j] = c.position(u);
            }
        }
    }
    Sample { q: JointVector::new(q), v: velocity_at(a, b, kind, u) }
}

/// The greatest speed of joint `j` within the segment, NaN where that is no number. \[rad/s\]
#[must_use]
pub fn top_speed(a: &PlanKnot, b: &PlanKnot, kind: Interpolation, j: usize) -> f64 {
    match kind {
        Interpolation::Linear => (b.q[j] - a.q[j]).abs() / seconds(a, b),
        Interpolation::Cubic => {
            let c = Cubic::new(a, b, j);
            // The velocity is a parabola: its ends and its vertex bound it.
            if !c.is_finite() {
                return f64::NAN;
            }
            // No vertex where it is a straight line.
            let vertex = -c.c2 / (3.0 * c.c3);
            let inside = vertex > 0.0 && vertex < 1.0;
            let inner = if inside { c.slope(vertex).abs() } else { 0.0 };
            greater(greater(c.slope(0.0).abs(), c.slope(1.0).abs()), inner) / seconds(a, b)
        }
    }
}

/// The accelerations of joint `j` at both ends of a curve, between which it is linear in time. A
/// straight segment has none but in its corners. \[rad/s²\]
#[must_use]
pub fn ends(a: &PlanKnot, b: &PlanKnot, kind: Interpolation, j: usize) -> [f64; 2] {
    match kind {
        Interpolation::Linear => [0.0; 2],
        Interpolation::Cubic => {
            let c = Cubic::new(a, b, j);
            [2.0 * c.c2, 2.0 * c.c2 + 6.0 * c.c3].map(|end| end / seconds(a, b).powi(2))
        }
    }
}

/// The acceleration of joint `j` in the segment `a`…`b` at plan time `time`. \[rad/s²\]
#[must_use]
pub(crate) fn acceleration(
    a: &PlanKnot,
    b: &PlanKnot,
    kind: Interpolation,
    j: usize,
    time: f64,
) -> f64 {
    let [from, to] = ends(a, b, kind, j);
    from + (to - from) * ((time - a.time) / (b.time - a.time))
}

/// The greatest acceleration of joint `j` within a curve, NaN where that is no number; it is linear
/// in time. A straight segment has none but in its corners. \[rad/s²\]
#[must_use]
pub fn top_acceleration(a: &PlanKnot, b: &PlanKnot, kind: Interpolation, j: usize) -> f64 {
    let [from, to] = ends(a, b, kind, j);
    greater(from.abs(), to.abs())
}

/// The jerk of joint `j` within a curve, NaN where that is no number; it is constant there, and the
/// acceleration steps between two curves. A straight segment has none. \[rad/s³\]
#[must_use]
pub fn top_jerk(a: &PlanKnot, b: &PlanKnot, kind: Interpolation, j: usize) -> f64 {
    match kind {
        Interpolation::Linear => 0.0,
        Interpolation::Cubic => (6.0 * Cubic::new(a, b, j).c3).abs() / seconds(a, b).powi(3),
    }
}

/// The lowest and highest position of joint `j` within the segment, NaN where one of them is no
/// number. \[rad\]
#[must_use]
pub fn reach(a: &PlanKnot, b: &PlanKnot, kind: Interpolation, j: usize) -> (f64, f64) {
    let (mut low, mut high) = (-greater(-a.q[j], -b.q[j]), greater(a.q[j], b.q[j]));
    if kind == Interpolation::Cubic {
        let c = Cubic::new(a, b, j);
        if !c.is_finite() {
            return (f64::NAN, f64::NAN);
        }
        // Where 3 c3 u² + 2 c2 u + c1 = 0, in the form that does not cancel.
        let root = (c.c2 * c.c2 - 3.0 * c.c3 * c.c1).max(0.0).sqrt();
        let k = -(c.c2 + root.copysign(c.c2));
        for u in [k / (3.0 * c.c3), c.c1 / k] {
            if u > 0.0 && u < 1.0 {
                low = low.min(c.position(u));
                high = high.max(c.position(u));
            }
        }
    }
    (low, high)
}

/// One joint's cubic over u = 0…1: a + c1 u + c2 u² + c3 u³.
struct Cubic {
    a: f64,
    c1: f64,
    c2: f64,
    c3: f64,
}

impl Cubic {
    fn new(a: &PlanKnot, b: &PlanKnot, j: usize) -> Self {
        let h = seconds(a, b);
        let d = b.q[j] - a.q[j];
        let (v0, v1) = (a.v[j] * h, b.v[j] * h);
        Self { a: a.q[j], c1: v0, c2: 3.0 * d - 2.0 * v0 - v1, c3: v0 + v1 - 2.0 * d }
    }

    fn is_finite(&self) -> bool {
        [self.a, self.c1, self.c2, self.c3].iter().all(|c| c.is_finite())
    }

    fn position(&self, u: f64) -> f64 {
        self.a + u * (self.c1 + u * (self.c2 + u * self.c3))
    }

    fn slope(&self, u: f64) -> f64 {
        self.c1 + u * (2.0 * self.c2 + u * 3.0 * self.c3)
    }
}

fn seconds(a: &PlanKnot, b: &PlanKnot) -> f64 {
    (b.time - a.time) * 1e-9
}

fn velocity_at(a: &PlanKnot, b: &PlanKnot, kind: Interpolation, u: f64) -> JointVector {
    let mut v = [0.0; MAX_DOF];
    for j in 0..MAX_DOF {
        v[j] = match kind {
            Interpolation::Linear => (b.q[j] - a.q[j]) / seconds(a, b),
            Interpolation::Cubic if u <= 0.0 => a.v[j],
            Interpolation::Cubic if u >= 1.0 => b.v[j],
            Interpolation::Cubic => Cubic::new(a, b, j).slope(u) / seconds(a, b),
        };
    }
    JointVector::new(v)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn knot(time: f64, q: f64, v: f64) -> PlanKnot {
        PlanKnot {
            time,
            q: JointVector::new([q; MAX_DOF]),
            v: JointVector::new([v; MAX_DOF]),
            ramp: 1.0,
        }
    }

    proptest! {
        #[test]
        fn ends_are_exact_and_bounds_hold(
            start in 0u64..1 << 50,
            length in 1u64..2_000_000_000,
            ends in prop::array::uniform2(-3.0..3.0f64),
            speeds in prop::array::uniform2(-3.0..3.0f64),
            cubic in any::<bool>(),
            at in prop::collection::vec(0.0..1.0f64, 32),
        ) {
            let kind = if cubic { Interpolation::Cubic } else { Interpolation::Linear };
            let a = knot(start as f64, ends[0], speeds[0]);
            let b = knot((start + length) as f64, ends[1], speeds[1]);
            prop_assert_eq!(sample(&a, &b, kind, a.time).q, a.q);
            prop_assert_eq!(sample(&a, &b, kind, b.time).q, b.q);
            prop_assert_eq!(sample(&a, &b, kind, b.time + 5.0).q, b.q);
            prop_assert_eq!(sample(&a, &b, kind, a.time - 5.0).q, a.q);
            let (low, high) = reach(&a, &b, kind, 0);
            let top = top_speed(&a, &b, kind, 0);
            for u in at {
                let s = sample(&a, &b, kind, a.time + u * length as f64);
                prop_assert!(s.q[0] >= low - 1e-9 && s.q[0] <= high + 1e-9);
                prop_assert!(s.v[0].abs() <= top * (1.0 + 1e-9) + 1e-9);
            }
        }

        #[test]
        fn velocity_is_the_derivative(
            ends in prop::array::uniform2(-3.0..3.0f64),
            speeds in prop::array::uniform2(-3.0..3.0f64),
            u in 0.01..0.99f64,
        ) {
            let (a, b) = (knot(0.0, ends[0], speeds[0]), knot(1e9, ends[1], speeds[1]));
            for kind in [Interpolation::Linear, Interpolation::Cubic] {
                let (t, h) = (u * 1e9, 1e4);
                let at = |t| sample(&a, &b, kind, t);
                let slope = (at(t + h).q[0] - at(t - h).q[0]) / (2.0 * h * 1e-9);
                prop_assert!((slope - at(t).v[0]).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn degenerate_cubics_have_bounds() {
        // A straight line and a stand-still: the leading coefficients vanish.
        let line = (knot(0.0, 1.0, 1.0), knot(1e9, 2.0, 1.0));
        assert_eq!(top_speed(&line.0, &line.1, Interpolation::Cubic, 0), 1.0);
        assert_eq!(reach(&line.0, &line.1, Interpolation::Cubic, 0), (1.0, 2.0));
        let still = (knot(0.0, 1.0, 0.0), knot(1e9, 1.0, 0.0));
        assert_eq!(top_speed(&still.0, &still.1, Interpolation::Cubic, 0), 0.0);
        assert_eq!(reach(&still.0, &still.1, Interpolation::Cubic, 0), (1.0, 1.0));
        // There and back within one segment: the reach exceeds both ends.
        let bow = (knot(0.0, 0.0, 1.0), knot(1e9, 0.0, -1.0));
        let (low, high) = reach(&bow.0, &bow.1, Interpolation::Cubic, 0);
        assert!(low == 0.0 && (high - 0.25).abs() < 1e-12, "{low} {high}");
    }
}
