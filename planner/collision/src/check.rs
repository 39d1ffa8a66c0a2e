//! The fast check: bounds first, exact distances where they do not suffice.

use nalgebra::Vector3;
use nullsweep_robot::JointVector;
use parry3d_f64::shape::SharedShape;

use crate::bodies::MAX_BODIES;
use crate::field::Field;
use crate::frame::Frame;
use crate::motion::Slack;
use crate::moving::{Moving, Pad, Touch};
use crate::rules::{Hit, TOLERANCE, ToolContact};
use crate::solid::{Solid, gjk_distance};
use crate::spheres::Sphere;
use crate::world::World;

/// Spheres looked at before a pair of shapes goes to GJK, which costs about as much.
const SPHERES: usize = 24;

/// One thing to check, by its index in the world.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Check {
    /// A moving shape against the scan.
    Scan(usize),
    /// A moving shape against the fixed shapes.
    Fixed(usize),
    /// A pair of moving shapes.
    Pair(usize),
}

impl World {
    /// Whether everything that moves with the arm keeps its margins at the joint vector `q`. \[rad\]
    /// or \[m\] NaN and ∞ are not free.
    #[must_use]
    pub fn is_free(&self, q: &JointVector, contact: ToolContact) -> bool {
        self.is_in_range(q) && self.are_clear(&self.bodies.poses(q), contact, &Slack::NONE)
    }

    /// The first pair too near at the joint vector `q` \[rad\] or \[m\], for messages; from the exact
    /// check, so it is slow.
    #[must_use]
    pub fn why_not(&self, q: &JointVector, contact: ToolContact) -> Option<Hit> {
        self.exact().first_hit(q, contact)
    }

    /// All that is too near at a joint vector; of a part and the points only the first of them. Slow.
    #[must_use]
    pub fn hits(&self, q: &JointVector, contact: ToolContact) -> Vec<Hit> {
        self.exact().hits(q, contact, usize::MAX)
    }

    /// Whether all margins hold with the slack of each body added, the bodies standing at `poses`.
    pub(crate) fn are_clear(
        &self,
        poses: &[Frame; MAX_BODIES],
        contact: ToolContact,
        slack: &Slack<'_>,
    ) -> bool {
        // The fixed shapes that the ball about each body does not prove far.
        let mut near = [0u128; MAX_BODIES];
        for (body, (centre, radius)) in self.reach.ball.iter().enumerate() {
            let centre = poses[body].apply(centre);
            for (index, fixed) in self.fixed.iter().enumerate() {
                let reach = radius + fixed.margin + slack.body[body] + TOLERANCE;
                if fixed.box_distance_squared(&centre) < reach * reach {
                    near[body] |= fixed_bit(index);
                }
            }
        }
        self.moving.iter().rev().all(|shape| {
            let (body, pose) = (shape.body, &poses[shape.body]);
            let need = slack.body[body] + TOLERANCE;
            self.is_clear_of_scan(shape, pose, contact, need)
                && (near[body] == 0 || self.is_clear_of_fixed(shape, pose, near[body], need))
        }) && self.are_pairs_clear(poses, slack)
    }

    fn is_clear_of_scan(
        &self,
        shape: &Moving,
        pose: &Frame,
        contact: ToolContact,
        slack: f64,
    ) -> bool {
        let touch = match contact {
            ToolContact::Allowed => shape.touch.as_ref(),
            ToolContact::Forbidden => None,
        };
        let margin = match touch {
            Some(Touch::Pad(pad)) => return self.is_pad_clear(shape, pad, pose, slack),
            Some(Touch::Rigid(margin)) => *margin,
            Some(Touch::Afar) if !self.is_kept_out(shape, pose, slack) => return false,
            Some(Touch::Afar) => self.margins.environment,
            None => self.margins.environment,
        };
        is_clear_of(&self.field, shape, pose, margin + slack)
    }

    /// Whether the pad in contact is clear of the points that press on it: none is where its
    /// keep-out boxes are; and of those that it may not touch.
    fn is_pad_clear(&self, shape: &Moving, pad: &Pad, pose: &Frame, slack: f64) -> bool {
        if !self.is_kept_out(shape, pose, slack) {
            return false;
        }
        let far = |s: &Sphere| self.firm.is_farther(&pose.apply(&s.centre), s.radius + slack);
        let holds = |p: &Vector3<f64>| self.pad_value(shape, pad, pose, p, slack) >= slack;
        pad.tree.all(far, |_| false)
            || pad
                .guards
                .iter()
                .all(|(place, solid)| self.firm.all_near(solid, &pose.then(place), slack, holds))
    }

    /// Whether the tool in use keeps away from the points that it is to keep out of.
    fn is_kept_out(&self, shape: &Moving, pose: &Frame, slack: f64) -> bool {
        let (keep_out, margin) = &self.keep_out;
        is_clear_of(keep_out, shape, pose, margin + slack)
    }

    /// Whether one check holds with the slack added, the bodies standing at `poses`.
    pub(crate) fn holds(
        &self,
        check: Check,
        poses: &[Frame; MAX_BODIES],
        contact: ToolContact,
        slack: &Slack<'_>,
    ) -> bool {
        match check {
            Check::Scan(shape) => {
                let shape = &self.moving[shape];
                let need = slack.body[shape.body] + TOLERANCE;
                self.is_clear_of_scan(shape, &poses[shape.body], contact, need)
            }
            Check::Fixed(shape) => {
                let shape = &self.moving[shape];
                let need = slack.body[shape.body] + TOLERANCE;
                self.is_clear_of_fixed(shape, &poses[shape.body], u128::MAX, need)
            }
            Check::Pair(pair) => {
                let (a, b) = self.pairs[pair];
                let between = slack.between(self.moving[a].body, self.moving[b].body);
                let need = self.margins.self_clearance + between + TOLERANCE;
                self.is_moving_pair_clear(a, b, poses, need)
            }
        }
    }

    /// The bodies that the checks are about, one bit each.
    pub(crate) fn bodies_of(&self, checks: &[Check]) -> u32 {
        let bit = |shape: usize| 1u32 << self.moving[shape].body;
        checks.iter().fold(0, |bits, check| match *check {
            Check::Scan(shape) | Check::Fixed(shape) => bits | bit(shape),
            Check::Pair(pair) => bits | bit(self.pairs[pair].0) | bit(self.pairs[pair].1),
        })
    }

    /// A lower bound of how far the pad in contact can move, relative to the point `p` (root frame),
    /// before the point breaks the rules; negative if it does now. Not looked at more closely than
    /// to tell whether it is at least `enough`. \[m\]
    fn pad_value(
        &self,
        shape: &Moving,
        pad: &Pad,
        pose: &Frame,
        p: &Vector3<f64>,
        enough: f64,
    ) -> f64 {
        let in_body = pose.apply_inverse(p);
        let local = shape.place.apply_inverse(&in_body);
        let free = distance_for(&shape.solid, &local, pad.margin + enough) - pad.margin;
        if free >= enough {
            return free;
        }
        let at = self.contact.frame.apply_inverse(&in_body);
        let in_prism = (0..3).all(|i| at[i] >= self.contact.min[i] && at[i] <= self.contact.max[i]);
        if !in_prism && free < 0.0 {
            return free;
        }
        // What is left is to stay out of the keep-out boxes.
        pad.keep_out
            .iter()
            .map(|(min, max)| box_distance(min, max, &at))
            .fold(f64::INFINITY, f64::min)
            .max(free)
    }

    fn is_clear_of_fixed(&self, shape: &Moving, pose: &Frame, near: u128, slack: f64) -> bool {
        let root = shape.tree.root();
        let centre = pose.apply(&root.centre);
        shape.against.iter().filter(|&&index| near & fixed_bit(index) != 0).all(|&index| {
            let fixed = &self.fixed[index];
            let need = fixed.margin + slack;
            let reach = root.radius + need;
            fixed.box_distance_squared(&centre) >= reach * reach
                || is_pair_clear(
                    shape,
                    &fixed.place.inverse_then(pose),
                    &fixed.solid,
                    &Frame::IDENTITY,
                    &fixed.shape,
                    need,
                )
        })
    }

    fn are_pairs_clear(&self, poses: &[Frame; MAX_BODIES], slack: &Slack<'_>) -> bool {
        let mut balls = [Vector3::zeros(); MAX_BODIES];
        for (body, (centre, _)) in self.reach.ball.iter().enumerate() {
            balls[body] = poses[body].apply(centre);
        }
        let mut bodies = (usize::MAX, usize::MAX);
        let (mut need, mut far) = (0.0, false);
        self.pairs.iter().all(|&(a, b)| {
            let (i, j) = (self.moving[a].body, self.moving[b].body);
            if bodies != (i, j) {
                // The pairs of two bodies follow each other.
                bodies = (i, j);
                need = self.margins.self_clearance + slack.between(i, j) + TOLERANCE;
                let reach = self.reach.ball[i].1 + self.reach.ball[j].1 + need;
                far = (balls[i] - balls[j]).norm_squared() >= reach * reach;
            }
            if far {
                return true;
            }
            self.is_moving_pair_clear(a, b, poses, need)
        })
    }

    fn is_moving_pair_clear(
        &self,
        a: usize,
        b: usize,
        poses: &[Frame; MAX_BODIES],
        need: f64,
    ) -> bool {
        let (first, second) = (&self.moving[a], &self.moving[b]);
        let (at, other) = (&poses[first.body], &poses[second.body]);
        are_moving_clear((first, at), (second, other), need)
    }
}

/// Whether two shapes, each with its body's frame, are at least `need` from each other.
pub(crate) fn are_moving_clear(
    (first, at): (&Moving, &Frame),
    (second, other): (&Moving, &Frame),
    need: f64,
) -> bool {
    let (ra, rb) = (first.tree.root().radius, second.tree.root().radius);
    let reach = ra + rb + need;
    let between = at.apply(&first.tree.root().centre) - other.apply(&second.tree.root().centre);
    if between.norm_squared() >= reach * reach {
        return true;
    }
    // The spheres of the smaller shape against the solid of the larger.
    let ((small, at), (large, other)) =
        if ra <= rb { ((first, at), (second, other)) } else { ((second, other), (first, at)) };
    let relative = other.inverse_then(at);
    is_pair_clear(small, &relative, &large.solid, &large.place, &large.shape, need)
}

/// Whether a shape is at least `need` from all points of a field.
fn is_clear_of(field: &Field, shape: &Moving, pose: &Frame, need: f64) -> bool {
    let is_far = |s: &Sphere| field.is_farther(&pose.apply(&s.centre), s.radius + need);
    shape.tree.all(is_far, |_| false)
        || field.all_near(&shape.solid, &pose.then(&shape.place), need, |p| {
            let local = shape.place.apply_inverse(&pose.apply_inverse(p));
            distance_for(&shape.solid, &local, need) >= need
        })
}

/// The bit of a fixed shape; beyond 127 they share the last one.
#[inline]
fn fixed_bit(index: usize) -> u128 {
    1 << index.min(127)
}

/// Whether `shape`, its body at `relative` in some frame, is at least `need` from the solid that
/// stands at `place` in that frame.
fn is_pair_clear(
    shape: &Moving,
    relative: &Frame,
    solid: &Solid,
    place: &Frame,
    other: &SharedShape,
    need: f64,
) -> bool {
    let local = place.inverse_then(relative);
    let pose = local.then(&shape.place);
    if solid.is_separated(&shape.solid, &pose, need) {
        return true;
    }
    let mut seen = 0;
    shape.tree.all(
        |s| {
            seen += 1;
            seen <= SPHERES && solid.distance_bound(&local.apply(&s.centre)) >= s.radius + need
        },
        |_| false,
    ) || gjk_distance(&pose, other, &shape.shape) >= need
}

/// The signed distance, but only a lower bound of it where that already is `enough`. \[m\]
fn distance_for(solid: &Solid, p: &Vector3<f64>, enough: f64) -> f64 {
    let bound = solid.distance_bound(p);
    if bound >= enough { bound } else { solid.distance(p) }
}

/// Distance from `p` to a box, 0 inside. \[m\]
fn box_distance(min: &Vector3<f64>, max: &Vector3<f64>, p: &Vector3<f64>) -> f64 {
    (min - p).sup(&(p - max)).map(|x| x.max(0.0)).norm()
}
