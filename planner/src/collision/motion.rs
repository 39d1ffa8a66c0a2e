//! Motions along straight joint lines: how far any point can move, and proofs that none collides.

use super::ToolContact;
use super::bodies::{Bodies, MAX_BODIES};
use super::frame::Frame;
use super::world::{Moving, World};
use nalgebra::Vector3;
use nullsweep_robot::{Arm, JointVector, MAX_DOF};
use std::collections::VecDeque;
use std::f64::consts::FRAC_1_SQRT_2;

/// How much farther than its margin each body has to be. \[m\]
#[derive(Clone, Debug)]
pub(crate) struct Slack<'a> {
    /// Relative to the root frame.
    pub(crate) body: [f64; MAX_BODIES],
    /// Relative to another body: this fraction of the motion's ways, if that is less.
    ways: Option<(&'a Ways, f64)>,
}

/// What a straight joint line does to each body at most.
#[derive(Clone, Debug)]
struct Ways {
    /// The longest way of a point in the root frame. \[m\]
    body: [f64; MAX_BODIES],
    /// In the frame of another body: the joints before both do not count. \[m\]
    between: [[f64; MAX_BODIES]; MAX_BODIES],
    /// The acceleration of a point if the motion takes one unit of time. \[m\]
    bend: [f64; MAX_BODIES],
}

/// How far the parts of each body can be from each joint's axis, whatever the configuration.
#[derive(Clone, Debug, Default)]
pub(crate) struct Reach {
    /// For each body: itself and the bodies that it hangs on, up the chain.
    lever: Vec<Vec<Lever>>,
    /// For each body, in its frame: a ball about all its parts and the places they guard. \[m\]
    pub(crate) ball: Vec<(Vector3<f64>, f64)>,
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
    /// Times the joint's change gives the body's own turn or slide.
    rate: f64,
}

/// A motion is halved at most this often before it counts as not proven.
const HALVINGS: u32 = 7;

impl Slack<'_> {
    pub(crate) const NONE: Self = Self { body: [0.0; MAX_BODIES], ways: None };

    /// Bound of the motion of two bodies relative to each other. \[m\]
    #[inline]
    pub(crate) fn between(&self, a: usize, b: usize) -> f64 {
        let both = self.body[a] + self.body[b];
        self.ways.map_or(both, |(ways, fraction)| both.min(fraction * ways.between[a][b]))
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
            .map(|b| parts(b).map(|m| m.reach_from(&Vector3::zeros())).fold(0.0, f64::max))
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
                let rate = b.multiplier.abs();
                levers.push(Lever { body: at, joint: b.joint, way: way * rate, rate });
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
        let ball = (0..count)
            .map(|b| {
                let centre = parts(b).map(|m| m.tree.root().centre).sum::<Vector3<f64>>()
                    / parts(b).count().max(1) as f64;
                (centre, parts(b).map(|m| m.reach_from(&centre)).fold(0.0, f64::max))
            })
            .collect();
        Self { lever, ball, centre, radius, travel }
    }

    /// The largest ways between `a` and `b`.
    fn ways(&self, bodies: &Bodies, a: &JointVector, b: &JointVector) -> Ways {
        let change: [f64; MAX_DOF] = std::array::from_fn(|j| (b[j] - a[j]).abs());
        let mut slack = Ways {
            body: [0.0; MAX_BODIES],
            between: [[0.0; MAX_BODIES]; MAX_BODIES],
            bend: [0.0; MAX_BODIES],
        };
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
            // A point x moves with ẍ = Σₖⱼ q̇ₖ q̇ⱼ hₖⱼ, where |hₖⱼ| is the distance of x from the
            // axis of the later of both joints at most.
            for k in &self.lever[body] {
                for j in &self.lever[body] {
                    let changes = change[k.joint] * change[j.joint];
                    if changes > 0.0 {
                        slack.bend[body] += changes * (k.way * j.rate).max(j.way * k.rate);
                    }
                }
            }
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

    /// How far any point of each body is at most from where it is at `middle`, while the joints go
    /// from there to both ends, which are half of `fraction` of the motion away: by the chord to
    /// either end and how far the way can bend away from it, or by the ways along it.
    fn slack<'a>(
        &self,
        ways: &'a Ways,
        fraction: f64,
        middle: &[Frame; MAX_BODIES],
        ends: [&[Frame; MAX_BODIES]; 2],
    ) -> Slack<'a> {
        let half = 0.5 * fraction;
        let mut body = [0.0; MAX_BODIES];
        for (i, (centre, radius)) in self.ball.iter().enumerate() {
            let from = middle[i].apply(centre);
            let chord = ends
                .iter()
                .map(|end| {
                    // A turn by θ moves a point at distance ρ by 2 sin(θ/2) ρ, and the Frobenius
                    // norm of the change of the rotation matrix is 2 √2 sin(θ/2).
                    let turn = (end[i].rotation - middle[i].rotation).norm() * FRAC_1_SQRT_2;
                    (end[i].apply(centre) - from).norm() + turn * radius
                })
                .fold(0.0, f64::max);
            let bend = ways.bend[i] * half * half / 8.0;
            body[i] = (chord + bend).min(half * ways.body[i]);
        }
        Slack { body, ways: Some((ways, half)) }
    }
}

impl World {
    /// An upper bound of the path length of the fastest point of arm and tool along the straight
    /// joint line from `a` to `b`. \[m\]
    #[must_use]
    pub fn motion_bound(&self, a: &JointVector, b: &JointVector) -> f64 {
        self.reach.ways(&self.bodies, a, b).body.iter().copied().fold(0.0, f64::max)
    }

    /// Whether the whole straight joint line from `a` to `b` is proven free: by bisection until, at
    /// each piece's middle, every distance exceeds its margin by what the bodies can move from
    /// there to the piece's ends. False if a collision is found, or if no proof is found within
    /// 7 halvings (a motion that grazes a margin).
    #[must_use]
    pub fn motion_free(&self, a: &JointVector, b: &JointVector, contact: ToolContact) -> bool {
        let ways = self.reach.ways(&self.bodies, a, b);
        // The ends first: they are where a useless motion is most often seen to be one.
        if !self.is_free(b, contact) || !self.is_free(a, contact) {
            return false;
        }
        // Coarse pieces first: they find a collision soonest.
        let mut open = VecDeque::from([(0.0, 1.0, 0)]);
        while let Some((from, to, depth)) = open.pop_front() {
            let middle = 0.5 * (from + to);
            let at = |t: f64| -> JointVector { std::array::from_fn(|j| a[j] + t * (b[j] - a[j])) };
            let [first, poses, last] = [from, middle, to].map(|t| self.bodies.poses(&at(t)));
            let slack = self.reach.slack(&ways, to - from, &poses, [&first, &last]);
            if self.are_clear(&poses, contact, &slack) {
                continue;
            }
            if depth == HALVINGS || !self.are_clear(&poses, contact, &Slack::NONE) {
                return false;
            }
            open.push_back((from, middle, depth + 1));
            open.push_back((middle, to, depth + 1));
        }
        true
    }
}
