//! The slow check of two arms of one robot against each other.

use nullsweep_robot::JointVector;

use crate::across::across;
use crate::exact::{Exact, are_apart, breaks};
use crate::rules::{Hit, With};
use crate::shapes::{distance, poses};

/// Two arms that move at the same time, each as its own exact check has it: every pair of what moves
/// with the one and what moves with the other, their tools included, by parry's queries.
#[derive(Debug)]
pub struct ExactArms<'a> {
    arms: [&'a Exact; 2],
    pairs: Vec<(usize, usize)>,
}

impl<'a> ExactArms<'a> {
    /// Of two arms of one robot in one stance that share no joint.
    #[must_use]
    pub fn new(first: &'a Exact, second: &'a Exact) -> Self {
        Self { arms: [first, second], pairs: across(first.scene(), second.scene()) }
    }

    /// The first pair found nearer than [`Margins::self_clearance`](crate::Margins::self_clearance), each
    /// arm at its joint vector \[rad\] or \[m\].
    #[must_use]
    pub fn first_hit(&self, q: [&JointVector; 2]) -> Option<Hit> {
        let placed = |arm: usize| {
            let (exact, scene) = (self.arms[arm], self.arms[arm].scene());
            let poses = poses(&scene.parts, scene.links, exact.arm(), q[arm]);
            let bounds = exact.bounds(&poses);
            (&scene.parts, poses, bounds)
        };
        let [one, other] = [placed(0), placed(1)];
        let margin = self.arms[0].scene().margins.self_clearance;
        self.pairs.iter().find_map(|&(a, b)| {
            if are_apart(&one.2[a], &other.2[b], margin) {
                return None;
            }
            let (first, second) = (&one.0[a], &other.0[b]);
            let distance = distance(&one.1[a], &*first.shape, &other.1[b], &*second.shape);
            breaks(distance, margin).then(|| Hit {
                link: first.name.clone(),
                with: With::Link(second.name.clone()),
                distance,
                margin,
            })
        })
    }
}
