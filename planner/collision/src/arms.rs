//! Proofs that two arms of one robot keep clear of each other, whatever each does within a box of joint
//! vectors.

use nalgebra::Vector3;
use nullsweep_robot::JointVector;

use crate::across::across;
use crate::bodies::MAX_BODIES;
use crate::check::are_moving_clear;
use crate::frame::Frame;
use crate::rules::TOLERANCE;
use crate::world::World;

/// Two arms that move at the same time, by the bounds of the fast check.
#[derive(Debug)]
pub struct Arms<'a> {
    worlds: [&'a World; 2],
    /// Indices into the moving shapes of each; those of the same two bodies follow each other.
    pairs: Vec<(usize, usize)>,
}

/// What a box of joint vectors of one arm comes to.
#[derive(Clone, Debug)]
pub struct Span {
    /// The bodies in the box's middle, and the balls about them.
    poses: [Frame; MAX_BODIES],
    centres: [Vector3<f64>; MAX_BODIES],
    /// How far from there any joint vector of the box takes a point of each. \[m\]
    slack: [f64; MAX_BODIES],
}

impl<'a> Arms<'a> {
    /// Of two arms of one robot in one stance that share no joint.
    #[must_use]
    pub fn new(first: &'a World, second: &'a World) -> Self {
        let worlds = [first, second];
        let scenes = worlds.map(|world| world.exact().scene());
        // The moving shapes are the moving parts, in their order.
        let shape = |arm: usize, part: usize| {
            scenes[arm].moves[..part].iter().filter(|moves| **moves).count()
        };
        let mut pairs: Vec<(usize, usize)> = across(scenes[0], scenes[1])
            .into_iter()
            .map(|(a, b)| (shape(0, a), shape(1, b)))
            .collect();
        pairs.sort_by_key(|&(a, b)| (first.moving[a].body, second.moving[b].body));
        Self { worlds, pairs }
    }

    /// All joint vectors of an arm, the first (0) or the second (1), that are no farther from `middle` in
    /// any joint than `travel`. \[rad\] or \[m\]
    ///
    /// # Panics
    /// There is no third arm.
    #[must_use]
    pub fn span(&self, arm: usize, middle: &JointVector, travel: &JointVector) -> Span {
        let world = self.worlds[arm];
        let poses = world.bodies.poses(middle);
        let mut span =
            Span { poses, centres: [Vector3::zeros(); MAX_BODIES], slack: [0.0; MAX_BODIES] };
        for (body, (centre, _)) in world.reach.ball.iter().enumerate() {
            span.centres[body] = poses[body].apply(centre);
            span.slack[body] = world.reach.displacement(body, travel);
        }
        span
    }

    /// Whether it is proven that the arms keep
    /// [`Margins::self_clearance`](crate::Margins::self_clearance), the first anywhere in its span and the
    /// second anywhere in its.
    #[must_use]
    pub fn are_apart(&self, first: &Span, second: &Span) -> bool {
        self.hold(first, second, 1.0)
    }

    /// The same in the middle of both spans alone.
    #[must_use]
    pub fn are_apart_in_the_middle(&self, first: &Span, second: &Span) -> bool {
        self.hold(first, second, 0.0)
    }

    fn hold(&self, first: &Span, second: &Span, share: f64) -> bool {
        let [one, other] = self.worlds;
        let margin = one.margins.self_clearance + TOLERANCE;
        let mut bodies = (usize::MAX, usize::MAX);
        let (mut need, mut far) = (0.0, false);
        self.pairs.iter().all(|&(a, b)| {
            let (a, b) = (&one.moving[a], &other.moving[b]);
            let (i, j) = (a.body, b.body);
            if bodies != (i, j) {
                bodies = (i, j);
                need = margin + share * (first.slack[i] + second.slack[j]);
                let reach = one.reach.ball[i].1 + other.reach.ball[j].1 + need;
                far = (first.centres[i] - second.centres[j]).norm_squared() >= reach * reach;
            }
            far || are_moving_clear((a, &first.poses[i]), (b, &second.poses[j]), need)
        })
    }
}
