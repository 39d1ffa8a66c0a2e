//! Which pairs of shapes are checked against each other, and which are left out and why.

use std::collections::BTreeSet;

use nullsweep_robot::{Arm, JointKind, JointVector, Robot};
use parry3d_f64::math::Pose;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::bodies::Bodies;
use crate::error::CollisionError;
use crate::options::Options;
use crate::parts::Part;
use crate::shapes::{distance, poses};
use crate::srdf;

/// Two links (or tool, or attached object) that are not checked against each other.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Excluded {
    /// One.
    pub first: String,
    /// The other.
    pub second: String,
    /// Which of the collision shapes of each, in URDF order and with the convex pieces of a mesh as
    /// shapes of their own; none: all of them.
    pub shapes: Option<(usize, usize)>,
    /// Why not.
    pub reason: Reason,
}

/// Why a pair is not checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// A joint joins them.
    Adjacent,
    /// A joint joins them if fixed joints count as welds, and they touch at home: the shapes of
    /// neighbours are often drawn larger than the parts.
    Welded,
    /// At most 1 mm farther apart than the self clearance, at home and in at least 99 % of the
    /// sampled configurations: neighbours by construction.
    AlwaysTouching,
    /// The SRDF disables them.
    Srdf,
}

/// The pairs of parts to check, and those left out (rigid ones are not listed).
#[derive(Clone, Debug, Default)]
pub(crate) struct Pairs {
    /// Indices into the parts, the first below the second; at least one of them moves.
    pub(crate) checked: Vec<(usize, usize)>,
    pub(crate) excluded: Vec<Excluded>,
}

/// Configurations sampled to find the pairs that always touch.
const SAMPLES: usize = 500;
/// A pair that is apart in more of them does not always touch (1 %).
const MISSES: usize = SAMPLES / 100;
/// Added to the self clearance, so that a constant gap of just that size does not flicker. \[m\]
const NEIGHBOURS: f64 = 0.001;
/// Seed of the samples: they belong to the robot, not to a plan.
const SEED: u64 = 0x5e1f;

/// Sorts all pairs of parts into checked and excluded.
pub(crate) fn find(
    robot: &Robot,
    arm: &Arm,
    bodies: &Bodies,
    parts: &[Part],
    options: &Options,
) -> Result<Pairs, CollisionError> {
    let disabled: Option<BTreeSet<(String, String)>> = match &options.srdf {
        Some(path) => Some(srdf::disabled_pairs(path)?.into_iter().map(ordered).collect()),
        None => None,
    };
    let body_of = |part: &Part| bodies.carrier(part.link).0;

    let mut pairs = Pairs::default();
    let near = options.margins.self_clearance + NEIGHBOURS;
    let (samples, links) = (sample(arm), robot.links().len());
    let mut placed: Vec<Option<Vec<Pose>>> = vec![None; samples.len()];
    for (j, second) in parts.iter().enumerate() {
        for (i, first) in parts.iter().enumerate().take(j) {
            if body_of(first) == body_of(second) {
                continue;
            }
            let names = || ordered((first.name.clone(), second.name.clone()));
            // An SRDF speaks for the robot's links, but knows no tool or held object.
            let own = |p: &Part| p.link.is_some_and(|l| robot.links()[l].name == p.name);
            let of = |part: &Part| {
                let name = part.name.clone();
                (0..parts.len()).filter(move |&k| parts[k].name == name)
            };
            let mut touch = |s: usize, a: usize, b: usize| {
                let at = placed[s].get_or_insert_with(|| poses(parts, links, arm, &samples[s]));
                distance(&at[a], &*parts[a].shape, &at[b], &*parts[b].shape) < near
            };
            let reason = if adjacent(robot, first, second) {
                Some(Reason::Adjacent)
            } else if disabled.as_ref().is_some_and(|d| d.contains(&names())) {
                Some(Reason::Srdf)
            } else if disabled.is_some() && own(first) && own(second) {
                None
            } else if own(first)
                && own(second)
                && are_welded_neighbours(robot, first, second)
                && of(second).any(|b| of(first).any(|a| touch(0, a, b)))
            {
                Some(Reason::Welded)
            } else {
                // The first sample is home, where a pair that always touches must touch.
                let mut misses = 0;
                let always = (0..samples.len()).all(|s| {
                    let touching = touch(s, i, j);
                    misses += usize::from(!touching);
                    (touching || s > 0) && misses <= MISSES
                });
                always.then_some(Reason::AlwaysTouching)
            };
            let Some(reason) = reason else {
                pairs.checked.push((i, j));
                continue;
            };
            let shape = |k: usize| parts[..k].iter().filter(|p| p.name == parts[k].name).count();
            let excluded = Excluded {
                first: first.name.clone(),
                second: second.name.clone(),
                shapes: (reason == Reason::AlwaysTouching).then(|| (shape(i), shape(j))),
                reason,
            };
            if !pairs.excluded.contains(&excluded) {
                pairs.excluded.push(excluded);
            }
        }
    }
    Ok(pairs)
}

fn ordered((a, b): (String, String)) -> (String, String) {
    if a <= b { (a, b) } else { (b, a) }
}

/// Whether a joint joins the links that carry the two parts.
fn adjacent(robot: &Robot, first: &Part, second: &Part) -> bool {
    let (Some(a), Some(b)) = (first.link, second.link) else {
        return false;
    };
    robot.joints().iter().any(|j| (j.parent, j.child) == (a, b) || (j.parent, j.child) == (b, a))
}

/// Whether a joint joins what the two links are welded to by fixed joints.
fn are_welded_neighbours(robot: &Robot, first: &Part, second: &Part) -> bool {
    let (Some(a), Some(b)) = (first.link, second.link) else {
        return false;
    };
    // The link at the top of a link's weld.
    let top = |mut link: usize| {
        while let Some(joint) = robot.links()[link].parent_joint.map(|j| &robot.joints()[j]) {
            if joint.kind != JointKind::Fixed {
                break;
            }
            link = joint.parent;
        }
        link
    };
    let (a, b) = (top(a), top(b));
    let hangs_on = |link: usize, other: usize| {
        robot.links()[link].parent_joint.is_some_and(|j| top(robot.joints()[j].parent) == other)
    };
    hangs_on(a, b) || hangs_on(b, a)
}

/// Home, then seeded random configurations within the limits.
pub(crate) fn sample(arm: &Arm) -> Vec<JointVector> {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let mut samples = vec![arm.home()];
    samples.resize_with(SAMPLES + 1, || {
        let mut q = JointVector::default();
        for (value, limits) in q.iter_mut().zip(arm.limits()) {
            let (lower, upper) = if limits.continuous {
                (-std::f64::consts::PI, std::f64::consts::PI)
            } else {
                (limits.lower, limits.upper)
            };
            *value = rng.random_range(lower..=upper);
        }
        q
    });
    samples
}
