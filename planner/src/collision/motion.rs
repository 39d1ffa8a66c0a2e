//! Motions along straight joint lines: how far any point can move, and proofs that none collides.

use super::ToolContact;
use super::bodies::{Bodies, MAX_BODIES};
use super::world::{Moving, World};
use nalgebra::Vector3;
use nullsweep_robot::{Arm, JointVector, MAX_DOF};
use std::collections::VecDeque;

/// How much farther than its margin each body has to be. \[m\]
#[derive(Clone, Debug)]
pub(crate) struct Slack {
    /// Relative to the root frame.
    pub(crate) body: [f64; MAX_BODIES],
    /// Relative to another body, in which the joints before both do not count.
    between: [[f64; MAX_BODIES]; MAX_BODIES],
}

/// How far the parts of each body can be from each joint's axis, whatever the configuration.
#[derive(Clone, Debug, Default)]
pub(crate) struct Reach {
    /// For each body: itself and the bodies that it hangs on, up the chain.
    lever: Vec<Vec<Lever>>,
    /// A ball in the root frame that no moving part ever leaves. \[m\]
    pub(crate) centre: Vector3<f64>,
    pub(crate) radius: f64,
    /// Largest |value| of each joint for which that holds.
    pub(crate) travel: Vec<f64>,
}

/// What the joint of `body` does to the points of a body that hangs on it.
#[derive(Clone, Copy, Debug)]
struct Lever {
    body: usize,
    /// Index into the joint vector.
    joint: usize,
    /// Times the joint's change gives the largest way of a point. \[m/rad\] or \[m/m\]
    way: f64,
}

/// A motion is halved at most this often before it counts as not proven.
const HALVINGS: u32 = 7;

impl Slack {
    pub(crate) const NONE: Self =
        Self { body: [0.0; MAX_BODIES], between: [[0.0; MAX_BODIES]; MAX_BODIES] };

    /// Bound of the motion of two bodies relative to each other. \[m\]
    #[inline]
    pub(crate) fn between(&self, a: usize, b: usize) -> f64 {
        self.between[a][b]
    }

    fn scaled(&self, factor: f64) -> Self {
        Self {
            body: self.body.map(|x| x * factor),
            between: self.between.map(|row| row.map(|x| x * factor)),
        }
    }
}

impl Reach {
    pub(crate) fn new(bodies: &Bodies, arm: &Arm, moving: &[Moving]) -> Self {
        let travel: Vec<f64> = arm
            .limits()
            .iter()
            .enumerate()
            .map(|(joint, limits)| {
                // Turning never takes a part out of the ball; sliding does.
                let slides = bodies.bodies.iter().any(|b| b.joint == joint && b.prismatic);
                let most = limits.lower.abs().max(limits.upper.abs());
                if slides { most } else { f64::INFINITY }
            })
            .collect();
        // How far a prismatic body slides from its rest place at most.
        let slide = |body: usize| {
            let b = &bodies.bodies[body];
            if b.prismatic { b.most_slide(travel[b.joint]) } else { 0.0 }
        };
        let count = bodies.bodies.len();
        let parts = |body: usize| moving.iter().filter(move |m| m.body == body);
        let own_reach: Vec<f64> = (0..count)
            .map(|b| parts(b).map(|m| m.reach_from_origin()).fold(0.0, f64::max))
            .collect();

        let mut lever = vec![Vec::new(); count];
        for (body, levers) in lever.iter_mut().enumerate() {
            // Up the chain: `rest` bounds the distance of the body's points from the origin of the
            // body `at`; `below` is the child of `at` that the chain came through.
            let (mut at, mut below, mut rest) = (body, None::<usize>, own_reach[body]);
            loop {
                let b = &bodies.bodies[at];
                let way = match below {
                    _ if b.prismatic => 1.0,
                    None => parts(body).map(|m| m.reach_from_axis(&b.axis)).fold(0.0, f64::max),
                    Some(child) => {
                        let to = bodies.bodies[child].rest.translation;
                        let beside = (to - b.axis * b.axis.dot(&to)).norm();
                        beside + rest - to.norm()
                    }
                };
                levers.push(Lever { body: at, joint: b.joint, way: way * b.multiplier.abs() });
                let Some(parent) = b.parent else { break };
                rest += b.rest.translation.norm() + slide(at);
                below = Some(at);
                at = parent;
            }
        }
        let (mut centre, mut radius) = (Vector3::zeros(), 0.0f64);
        if let Some(first) = bodies.bodies.first() {
            centre = first.rest.translation;
        }
        for body in 0..count {
            let (mut at, mut reach) = (body, own_reach[body] + slide(body));
            while let Some(parent) = bodies.bodies[at].parent {
                reach += bodies.bodies[at].rest.translation.norm() + slide(parent);
                at = parent;
            }
            radius = radius.max(reach + (bodies.bodies[at].rest.translation - centre).norm());
        }
        Self { lever, centre, radius, travel }
    }

    /// The largest ways between `a` and `b`.
    fn slack(&self, bodies: &Bodies, a: &JointVector, b: &JointVector) -> Slack {
        let change: [f64; MAX_DOF] = std::array::from_fn(|j| (b[j] - a[j]).abs());
        let mut slack = Slack::NONE;
        let count = self.lever.len();
        for body in 0..count {
            let way = |until: Option<usize>| -> f64 {
                self.lever[body]
                    .iter()
                    .take_while(|l| Some(l.body) != until)
                    .filter(|l| change[l.joint] > 0.0)
                    .map(|l| l.way * change[l.joint])
                    .sum()
            };
            slack.body[body] = way(None);
            for other in 0..body {
                if bodies.is_ancestor(other, body) {
                    slack.between[body][other] = way(Some(other));
                } else {
                    slack.between[body][other] = slack.body[body] + slack.body[other];
                }
                slack.between[other][body] = slack.between[body][other];
            }
        }
        slack
    }
}

impl World {
    /// An upper bound of the path length of the fastest point of arm and tool along the straight
    /// joint line from `a` to `b`. \[m\]
    #[must_use]
    pub fn motion_bound(&self, a: &JointVector, b: &JointVector) -> f64 {
        self.reach.slack(&self.bodies, a, b).body.iter().copied().fold(0.0, f64::max)
    }

    /// Whether the whole straight joint line from `a` to `b` is proven free: by bisection until, at
    /// each piece's middle, every distance exceeds its margin by what the bodies can move from
    /// there to the piece's ends. False if a collision is found, or if no proof is found within
    /// 7 halvings (a motion that grazes a margin).
    #[must_use]
    pub fn motion_free(&self, a: &JointVector, b: &JointVector, contact: ToolContact) -> bool {
        let ways = self.reach.slack(&self.bodies, a, b);
        // The ends first: they are where a useless motion is most often seen to be one.
        if !self.is_free(b, contact) || !self.is_free(a, contact) {
            return false;
        }
        // Coarse pieces first: they find a collision soonest.
        let mut open = VecDeque::from([(0.0, 1.0, 0)]);
        while let Some((from, to, depth)) = open.pop_front() {
            let middle = 0.5 * (from + to);
            let q: JointVector = std::array::from_fn(|j| a[j] + middle * (b[j] - a[j]));
            let slack = ways.scaled(0.5 * (to - from));
            if self.is_clear(&q, contact, &slack) {
                continue;
            }
            if depth == HALVINGS || !self.is_free(&q, contact) {
                return false;
            }
            open.push_back((from, middle, depth + 1));
            open.push_back((middle, to, depth + 1));
        }
        true
    }
}
