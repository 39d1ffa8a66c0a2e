//! How far a piece is bent aside.

use nalgebra::Vector6;
use nullsweep_robot::JointVector;

/// Farthest between two controls. \[m\]
const SPACING: f64 = 0.012;

/// How far aside a place of a piece is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Offset {
    /// What the joints are away from their average, so that the arm is near the pose. \[rad\] or \[m\]
    pub(super) q: JointVector,
    /// Twist of the pad about its centre, in the root frame. \[m, rad\]
    pub(super) twist: Vector6<f64>,
}

impl Offset {
    const NONE: Self =
        Self { q: JointVector::ZERO, twist: Vector6::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0) };

    /// With a multiple of another one.
    pub(super) fn plus(&self, other: &Self, times: f64) -> Self {
        Self {
            q: JointVector::from_fn(|j| self.q[j] + times * other.q[j]),
            twist: self.twist + other.twist * times,
        }
    }
}

/// A uniform cubic B-spline of offsets along a piece, which vanishes at both ends with its slope and
/// curvature.
#[derive(Clone, Debug)]
pub(super) struct Bend {
    /// Of the controls. \[m\]
    spacing: f64,
    pub(super) controls: Vec<Offset>,
}

impl Bend {
    /// No bend, of a piece of some length. \[m\]
    pub(super) fn none(length: f64) -> Self {
        let spans = (length / SPACING).ceil().max(1.0);
        let controls = vec![Offset::NONE; (spans as usize).saturating_sub(3)];
        Self { spacing: length / spans, controls }
    }

    /// Length of way for each control. \[m\]
    pub(super) fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Where on the piece a control weighs most. \[m\]
    pub(super) fn middle(&self, control: usize) -> f64 {
        (control + 2) as f64 * self.spacing
    }

    /// The controls that bend a place, with their weights.
    pub(super) fn weights(&self, u: f64) -> impl Iterator<Item = (usize, f64)> + use<> {
        let count = self.controls.len();
        let place = (u / self.spacing).max(0.0);
        let span = (place as usize).min(count + 2);
        let t = place - span as f64;
        let (s, t2, t3) = (1.0 - t, t * t, t * t * t);
        let weights = [
            s * s * s / 6.0,
            (3.0 * t3 - 6.0 * t2 + 4.0) / 6.0,
            (-3.0 * t3 + 3.0 * t2 + 3.0 * t + 1.0) / 6.0,
            t3 / 6.0,
        ];
        (0..4).filter_map(move |k| {
            let control = (span + k).checked_sub(3)?;
            (control < count).then_some((control, weights[k]))
        })
    }

    /// At a place of the piece.
    pub(super) fn at(&self, u: f64) -> Offset {
        let add = |sum: Offset, (k, weight): (usize, f64)| sum.plus(&self.controls[k], weight);
        self.weights(u).fold(Offset::NONE, add)
    }

    /// Takes a control's bend out.
    pub(super) fn straighten(&mut self, control: usize) {
        self.controls[control] = Offset::NONE;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bend_vanishes_at_the_ends_and_is_what_its_controls_say_between() {
        let mut bend = Bend::none(0.3);
        let one = Offset { q: JointVector::from_fn(|_| 1.0), twist: Vector6::repeat(2.0) };
        bend.controls.iter_mut().for_each(|control| *control = one);
        for u in [0.0, 0.3] {
            assert!(bend.at(u).twist.norm() < 1e-12);
        }
        for u in [0.05, 0.1501, 0.25] {
            assert!(
                (bend.at(u).twist.x - 2.0).abs() < 1e-12 && (bend.at(u).q[0] - 1.0).abs() < 1e-12
            );
        }
        // Smooth: second differences are as small as a cubic's.
        let q = |u: f64| bend.at(u).q[0];
        for k in 1..300 {
            let u = 0.001 * f64::from(k);
            let second = (q(u + 1e-4) - 2.0 * q(u) + q((u - 1e-4).max(0.0))) / 1e-8;
            assert!(second.abs() < 1.1 / (0.012 * 0.012), "{second} at {u}");
        }
        assert!(Bend::none(0.02).controls.is_empty());
    }
}
