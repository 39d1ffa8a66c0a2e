//! A smooth joint path: quadratic pieces that meet in position and direction.

use nullsweep_robot::JointVector;

/// q(s) = start + slope·s + bend·s²/2 for s from 0 to `length`. The path parameter s is any
/// parameter; the joint's unit is \[rad\] or \[m\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// Range of s.
    pub length: f64,
    /// Position at s = 0.
    pub start: JointVector,
    /// dq/ds at s = 0.
    pub slope: JointVector,
    /// d²q/ds².
    pub bend: JointVector,
    /// Where its ends lie on the path that it was made from: index of a point, and share of the
    /// way to the next one. A whole number is that point.
    pub source: [f64; 2],
}

/// Pieces that meet in position and slope. The arm is at rest at its end, and at its start unless
/// it is told otherwise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SmoothPath {
    /// In their order.
    pub pieces: Vec<Piece>,
}

impl Piece {
    /// A straight line.
    #[must_use]
    pub fn line(a: &JointVector, b: &JointVector, source: [f64; 2]) -> Self {
        let length = a.distance(b);
        let slope = JointVector::from_fn(|j| (b[j] - a[j]) / length);
        Self { length, start: *a, slope, bend: JointVector::ZERO, source }
    }

    /// The position at s.
    #[must_use]
    pub fn at(&self, s: f64) -> JointVector {
        JointVector::from_fn(|j| self.start[j] + s * (self.slope[j] + 0.5 * s * self.bend[j]))
    }

    /// dq/ds at s.
    #[must_use]
    pub fn slope_at(&self, s: f64) -> JointVector {
        JointVector::from_fn(|j| self.slope[j] + s * self.bend[j])
    }

    /// The first or the second part of it, cut at a share of its length.
    #[must_use]
    pub fn part(&self, from: f64, to: f64) -> Self {
        let (a, b) = (from * self.length, to * self.length);
        let mix = |share: f64| self.source[0] + share * (self.source[1] - self.source[0]);
        // The ends of a piece keep their source exactly.
        let source = [
            if from == 0.0 { self.source[0] } else { mix(from) },
            if to == 1.0 { self.source[1] } else { mix(to) },
        ];
        Self { length: b - a, start: self.at(a), slope: self.slope_at(a), bend: self.bend, source }
    }
}
