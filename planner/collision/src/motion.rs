//! How far any point of the arm can move, whatever the configuration, between joint vectors.

use std::f64::consts::FRAC_1_SQRT_2;

use nalgebra::Vector3;
use nullsweep_robot::{Arm, JointVector};

use crate::bodies::{Bodies, MAX_BODIES};
use crate::frame::Frame;
use crate::moving::Moving;

/// How much farther than its margin each body has to be. \[m\]
#[derive(Clone, Debug)]
pub(crate) struct Slack<'a> {
    /// Relative to the root frame.
    pub(crate) body: [f64; MAX_BODIES],
    /// Relative to another body: what this travel of the joints gives, if that is less.
    joints: Option<(&'a Reach, JointVector)>,
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
    /// Largest |value| of each sliding joint for which that holds \[m\]; infinite for turning ones.
    pub(crate) stroke: Vec<f64>,
}

/// What the joint of `body` does to the points of a body that hangs on it.
#[derive(Clone, Copy, Debug)]
struct Lever {
    body: usize,
    /// Index into the joint vector.
    joint: usize,
    /// Times the joint's change gives the largest displacement of a point. \[m/rad\] or \[m/m\]
    length: f64,
    /// Times the joint's change gives the body's own turn or slide.
    rate: f64,
}

impl<'a> Slack<'a> {
    pub(crate) const NONE: Self = Self { body: [0.0; MAX_BODIES], joints: None };

    /// For a motion in which each joint travels so far at most. \[rad\] or \[m\]
    pub(crate) fn new(reach: &'a Reach, travel: JointVector) -> Self {
        Self { body: [0.0; MAX_BODIES], joints: Some((reach, travel)) }
    }

    /// Bound of the motion of two bodies relative to each other. \[m\]
    #[inline]
    pub(crate) fn between(&self, a: usize, b: usize) -> f64 {
        let both = self.body[a] + self.body[b];
        self.joints.as_ref().map_or(both, |(reach, travel)| both.min(reach.between(a, b, travel)))
    }
}

impl Reach {
    pub(crate) fn new(bodies: &Bodies, arm: &Arm, moving: &[Moving]) -> Self {
        let stroke: Vec<f64> = arm
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
            if b.prismatic { b.most_slide(stroke[b.joint]) } else { 0.0 }
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
                let length = match below {
                    _ if b.prismatic => 1.0,
                    None => parts(body).map(|m| m.reach_from_axis(&b.axis)).fold(0.0, f64::max),
                    Some(child) => {
                        let to = bodies.bodies[child].rest.translation;
                        let beside = (to - b.axis * b.axis.dot(&to)).norm();
                        beside + rest - to.norm()
                    }
                };
                let rate = b.multiplier.abs();
                levers.push(Lever { body: at, joint: b.joint, length: length * rate, rate });
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
        Self { lever, ball, centre, radius, stroke }
    }

    /// How far a point of a body moves at most, in the root frame, while no joint travels farther
    /// than `travel`. \[m\]
    #[inline]
    pub(crate) fn displacement(&self, body: usize, travel: &JointVector) -> f64 {
        self.lever[body].iter().map(|l| l.length * travel[l.joint]).sum()
    }

    /// The same in the frame of another body: the joints before both do not count. Infinite if
    /// neither hangs on the other.
    fn between(&self, a: usize, b: usize, travel: &JointVector) -> f64 {
        // Parents come first.
        let (low, high) = (a.max(b), a.min(b));
        let mut sum = 0.0;
        for l in &self.lever[low] {
            if l.body == high {
                return sum;
            }
            sum += l.length * travel[l.joint];
        }
        f64::INFINITY
    }

    /// How far a point of a body can be from the straight line between its places at both ends of a
    /// straight joint line on which each joint travels `travel`. \[m\]
    pub(crate) fn bend(&self, body: usize, travel: &JointVector) -> f64 {
        // A point x moves with ẍ = Σₖⱼ q̇ₖ q̇ⱼ hₖⱼ, where |hₖⱼ| is the distance of x from the axis
        // of the later of both joints at most; in unit time that takes it an eighth of that off its chord.
        let levers = &self.lever[body];
        let pull = |k: &Lever, j: &Lever| {
            travel[k.joint] * travel[j.joint] * (k.length * j.rate).max(j.length * k.rate)
        };
        levers.iter().map(|k| levers.iter().map(|j| pull(k, j)).sum::<f64>()).sum::<f64>() / 8.0
    }

    /// How far any point of a body is at `to` from where it is at `from`, at most; the frames are
    /// the body's, the points the ball's centre in them. \[m\]
    #[inline]
    pub(crate) fn chord(
        &self,
        body: usize,
        (from, from_centre): (&Frame, &Vector3<f64>),
        (to, to_centre): (&Frame, &Vector3<f64>),
    ) -> f64 {
        // A turn by θ moves a point at distance ρ by 2 sin(θ/2) ρ, and the Frobenius norm of the
        // change of the rotation matrix is 2 √2 sin(θ/2).
        let turn = (to.rotation - from.rotation).norm() * FRAC_1_SQRT_2;
        (to_centre - from_centre).norm() + turn * self.ball[body].1
    }
}
