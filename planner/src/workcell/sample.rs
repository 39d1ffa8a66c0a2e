//! The arm with its tool among what it may collide with, and the joint vectors that put the pad on
//! a contact pose: this is where the redundancy is sampled.

use std::f64::consts::TAU;

use nalgebra::Isometry3;
use nullsweep_collision::{ToolContact, World};
use nullsweep_robot::{Arm, Branch, JointVector, Solutions, Tool};

/// The arm, its tool and what is around them: what every stage from here on asks.
#[derive(Clone, Copy)]
pub struct Workcell<'a> {
    /// The arm, its held joints bound to the stance.
    pub arm: &'a Arm,
    /// The tool at the arm's tip.
    pub tool: &'a Tool,
    /// What it may collide with, in the root frame.
    pub world: &'a World,
}

/// One joint vector that puts the pad on a contact pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Joint vector. \[rad\] or \[m\]
    pub q: JointVector,
    /// Branch of the inverse kinematics.
    pub branch: Branch,
    /// Value of the redundancy parameter. \[rad\]
    pub redundancy: f64,
    /// Heading of the pad about the surface normal, from the first of the normal's [`tangents`](super::tangents). \[rad\]
    pub heading: f64,
}

/// Values of the redundancy parameter to try (paper §V): fewer than 10 around the middle of the
/// range, more uniformly over it; one value 0 for an arm without redundancy. \[rad\]
#[must_use]
pub fn redundancies(range: Option<(f64, f64)>, count: usize) -> Vec<f64> {
    let Some((low, high)) = range else { return vec![0.0] };
    let count = count.max(1);
    let share = if count < 10 { 0.5 } else { 1.0 };
    let (middle, width) = (0.5 * (low + high), share * (high - low));
    (0..count).map(|i| middle + width * ((i as f64 + 0.5) / count as f64 - 0.5)).collect()
}

impl Workcell<'_> {
    /// Appends every joint vector at `redundancies` that puts the pad on the contact pose, lies
    /// inside the margined soft limits and is free of collision, the pad on the surface.
    pub fn samples(
        &self,
        contact: &Isometry3<f64>,
        heading: f64,
        redundancies: &[f64],
        out: &mut Vec<Sample>,
    ) {
        self.visit_samples(contact, heading, redundancies, |sample| {
            out.push(sample);
            false
        });
    }

    /// The first of [`Self::samples`], the redundancies tried in the order given.
    #[must_use]
    pub fn first_sample(
        &self,
        contact: &Isometry3<f64>,
        heading: f64,
        redundancies: &[f64],
    ) -> Option<Sample> {
        let mut first = None;
        self.visit_samples(contact, heading, redundancies, |sample| {
            first = Some(sample);
            true
        });
        first
    }

    /// The joint vector with the last joint, which turns the pad, where it is and, if its limits are
    /// more than a turn apart, a turn on: an edge may lead past half a turn.
    fn turns(&self, q: &JointVector) -> impl Iterator<Item = JointVector> + use<'_> {
        let last = self.arm.dof() - 1;
        let (low, high) = self.arm.margined_limits()[last];
        let bounded = low.is_finite() && self.arm.is_revolute(last);
        let q = *q;
        [0.0, -TAU, TAU].into_iter().filter_map(move |turn| {
            let mut turned = q;
            turned[last] += turn;
            let inside = (low..=high).contains(&turned[last]);
            (turn == 0.0 || bounded && inside).then_some(turned)
        })
    }

    /// Calls `visit` on each valid sample until it returns true.
    fn visit_samples(
        &self,
        contact: &Isometry3<f64>,
        heading: f64,
        redundancies: &[f64],
        mut visit: impl FnMut(Sample) -> bool,
    ) {
        let tip = contact * self.tool.contact_in_tip().inverse();
        let mut solutions = Solutions::new();
        for &redundancy in redundancies {
            solutions.clear();
            self.arm.ik().solve(&tip, redundancy, &mut solutions);
            for s in &solutions {
                if !self.arm.within_margins(&s.q) || !self.world.is_free(&s.q, ToolContact::Allowed)
                {
                    continue;
                }
                for q in self.turns(&s.q) {
                    if visit(Sample { q, branch: s.branch, redundancy, heading }) {
                        return;
                    }
                }
            }
        }
    }
}

/// Values of the redundancy parameter, the middle one first, the ends last.
#[must_use]
pub fn middle_out(mut values: Vec<f64>) -> Vec<f64> {
    let middle = values.iter().sum::<f64>() / values.len().max(1) as f64;
    values.sort_by(|a, b| (a - middle).abs().total_cmp(&(b - middle).abs()));
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_samples_stay_around_the_middle_many_fill_the_range() {
        assert_eq!(redundancies(Some((-3.0, 1.0)), 1), vec![-1.0]);
        let few = redundancies(Some((-3.0, 1.0)), 3);
        assert!(few.iter().all(|r| (-2.0..=0.0).contains(r)), "{few:?}");
        let many = redundancies(Some((-3.0, 1.0)), 100);
        assert!((many[0] + 2.98).abs() < 1e-12 && (many[99] - 0.98).abs() < 1e-12);
        assert_eq!(redundancies(None, 7), vec![0.0]);
    }
}
