//! The straight way of the tool between two places.

use nalgebra::Vector3;
use nullsweep_collision::ToolContact;

use super::space::{Point, Space};
use crate::plan::LINE_TOLERANCE;

/// Farthest that the tool may be turned from the even turn between two places. \[rad\]
const TURN: f64 = 1.7e-3;
/// Halvings of a way.
const DEPTH: usize = 6;
/// A joint vector on the way is at most this share of the way's length from the straight joint line,
/// and this far more. \[rad\]
const BOW: f64 = 0.5;
const SLACK: f64 = 1e-3;

impl Space<'_> {
    /// The joint vectors to put in between two, so that on the straight joint lines the tool goes
    /// straight too: its place leaves the line by at most [`LINE_TOLERANCE`], and it turns evenly, but
    /// for a free spin. `None` where the arm cannot follow.
    pub(crate) fn between(&self, a: &Point, b: &Point) -> Option<Vec<Point>> {
        let mut knots = Vec::new();
        self.halve(a, b, DEPTH, &mut knots)?;
        Some(knots)
    }

    fn halve(&self, a: &Point, b: &Point, depth: usize, knots: &mut Vec<Point>) -> Option<()> {
        if self.is_straight(a, b) {
            return Some(());
        }
        let place = a.tool.lerp_slerp(&b.tool, 0.5);
        let even = a.q.lerp(&b.q, 0.5);
        let middle = self.on_line(&place, &even)?;
        let bow = middle.q.distance(&even);
        if depth == 0 || bow > BOW * a.q.distance(&b.q) + SLACK {
            return None;
        }
        self.halve(a, &middle, depth - 1, knots)?;
        knots.push(middle);
        self.halve(&middle, b, depth - 1, knots)
    }

    fn is_straight(&self, a: &Point, b: &Point) -> bool {
        let spins = self.tolerance.0[5] > 0.0;
        [0.5, 0.25, 0.75].into_iter().all(|share| {
            let tool = self.point(a.q.lerp(&b.q, share)).tool;
            let even = a.tool.lerp_slerp(&b.tool, share);
            let turned = match spins {
                false => tool.rotation.angle_to(&even.rotation),
                true => {
                    let axis = Vector3::z();
                    (tool.rotation * axis).angle(&(even.rotation * axis))
                }
            };
            turned <= TURN
                && (tool.translation.vector - even.translation.vector).norm() <= LINE_TOLERANCE
        })
    }

    /// The edge from one joint vector to another: [`Self::between`], free of collision.
    pub(crate) fn edge(&self, a: &Point, b: &Point) -> Option<Vec<Point>> {
        let between = self.between(a, b)?;
        let mut from = &a.q;
        for to in between.iter().chain([b]) {
            if !self.world.motion_free(from, &to.q, ToolContact::Allowed) {
                return None;
            }
            from = &to.q;
        }
        Some(between)
    }
}
