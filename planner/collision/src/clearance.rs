//! How much more than its margin everything is apart.

use nullsweep_robot::JointVector;

use crate::ToolContact;
use crate::check::{TOLERANCE, gjk_distance};
use crate::frame::Frame;
use crate::world::{Moving, World};

/// Clearances are not looked for beyond this. \[m\]
const FAR: f64 = 0.5;
/// Beyond this the grid's bound is good enough; the points themselves are not looked at. \[m\]
const NEAR: f64 = 0.03;

impl World {
    /// A lower bound of distance − margin over all pairs that could ever be too near, at most 0.5 m; ≤ 0: not proven free. It
    /// is the true value where that is below 3 cm, and some cm below it elsewhere. In contact, for scan points that may touch, it is how far the shape may move before they break
    /// the contact rule. Slower than [`World::is_free`]. \[m\]
    #[must_use]
    pub fn clearance(&self, q: &JointVector, contact: ToolContact) -> f64 {
        if !self.is_in_range(q) {
            return f64::NEG_INFINITY;
        }
        let poses = self.bodies.poses(q);
        let mut best = FAR;
        for shape in self.moving.iter().rev() {
            let pose = &poses[shape.body];
            best = self.scan_clearance(shape, pose, contact, best);
            let root = shape.tree.root();
            let centre = pose.apply(&root.centre);
            for &index in &shape.against {
                let fixed = &self.fixed[index];
                let reach = root.radius + fixed.margin + best;
                if reach > 0.0 && fixed.box_distance_squared(&centre) < reach * reach {
                    let local = fixed.place.inverse_then(pose).then(&shape.place);
                    let distance = gjk_distance(&local, &fixed.shape, &shape.shape);
                    best = best.min(distance - fixed.margin);
                }
            }
        }
        for &(a, b) in &self.pairs {
            let (first, second) = (&self.moving[a], &self.moving[b]);
            let (ra, rb) = (first.tree.root(), second.tree.root());
            let between =
                poses[first.body].apply(&ra.centre) - poses[second.body].apply(&rb.centre);
            let margin = self.margins.self_clearance;
            if between.norm() < ra.radius + rb.radius + margin + best {
                let at = |m: &Moving| poses[m.body].then(&m.place);
                let local = at(first).inverse_then(&at(second));
                let distance = gjk_distance(&local, &first.shape, &second.shape);
                best = best.min(distance - margin);
            }
        }
        best - TOLERANCE
    }

    /// `best`, or less if the scan is nearer to the shape.
    fn scan_clearance(&self, shape: &Moving, pose: &Frame, contact: ToolContact, best: f64) -> f64 {
        let best = std::cell::Cell::new(best);
        let touch = shape.touch.as_ref().filter(|_| contact == ToolContact::Allowed);
        let (tree, margin) = match touch {
            Some(touch) if touch.depth == f64::INFINITY => (&touch.tree, 0.0),
            Some(touch) => (&shape.tree, touch.margin),
            None => (&shape.tree, self.margins.environment),
        };
        tree.all(
            |s| self.field.is_farther(&pose.apply(&s.centre), s.radius + margin + best.get()),
            |s| {
                let centre = pose.apply(&s.centre);
                let bound = self.field.bound(&centre) - s.radius - margin;
                let window = best.get().min(NEAR);
                let mut nearest = window;
                if bound < window {
                    let radius = (s.radius + margin + window).max(0.0);
                    self.field.all_within(&centre, radius, |p| {
                        nearest = nearest.min(self.point_value(shape, pose, contact, p, window));
                        true
                    });
                }
                best.set(best.get().min(nearest.max(bound)));
                true
            },
        );
        best.get()
    }
}
