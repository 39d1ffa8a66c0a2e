//! Pairs of shapes that no configuration brings together, proven once, so that no check looks at
//! them again.
//!
//! Between neighbouring links only one or two joints turn. A shape that its joint carries round is
//! held by the cylinder that it sweeps about the joint's axis, and inside that cylinder the joint
//! no longer matters; what is left of the joints is cut into intervals until the distance at each
//! one's middle exceeds what the interval can take away.

use std::f64::consts::PI;

use nalgebra::{UnitQuaternion, Vector3};
use nullsweep_robot::{Arm, MAX_DOF};
use parry3d_f64::shape::SharedShape;

use crate::bodies::Bodies;
use crate::frame::Frame;
use crate::rules::TOLERANCE;
use crate::solid::{Solid, gjk_distance};

/// Range of each joint within which the proofs hold. \[rad\] or \[m\]
pub(crate) type Ranges = [(f64, f64); MAX_DOF];

/// How far beyond its limits a revolute joint may be asked about. \[rad\]
const BEYOND: f64 = 0.35;
/// Distances computed before a pair counts as not proven.
const BUDGET: usize = 96;

/// A shape that stands in a body, or in the root frame.
#[derive(Clone, Copy)]
pub(crate) struct Placed<'a> {
    pub(crate) body: Option<usize>,
    pub(crate) place: &'a Frame,
    pub(crate) solid: &'a Solid,
}

/// Where joints may be: all turns for continuous ones, a little beyond the limits for others;
/// sliding ones keep their `stroke`.
pub(crate) fn ranges(arm: &Arm, stroke: &[f64]) -> Ranges {
    std::array::from_fn(|j| match arm.limits().get(j) {
        Some(limits) if stroke[j].is_infinite() && !limits.continuous => {
            (limits.lower - BEYOND, limits.upper + BEYOND)
        }
        Some(_) => (-stroke[j], stroke[j]),
        None => (f64::NEG_INFINITY, f64::INFINITY),
    })
}

/// Whether the two shapes are proven to be `need` apart wherever the joints are in their ranges.
pub(crate) fn never_near(
    bodies: &Bodies,
    ranges: &Ranges,
    a: Placed<'_>,
    b: Placed<'_>,
    need: f64,
) -> bool {
    if matches!(a.solid, Solid::HalfSpace) || matches!(b.solid, Solid::HalfSpace) {
        return false;
    }
    // Parents come first, so the one further on is the one that may hang on the other.
    let (near, far) = if a.body <= b.body { (a, b) } else { (b, a) };
    let Some(chain) = chain(bodies, near.body, far.body) else { return false };
    let turns = |body: usize| !bodies.bodies[body].prismatic;
    let (Some(&first), Some(&last)) = (chain.first(), chain.last()) else { return false };

    let far_swept = turns(last).then(|| sweep(far, &Vector3::zeros(), &bodies.bodies[last].axis));
    let near_swept = turns(first).then(|| {
        let rest = &bodies.bodies[first].rest;
        sweep(near, &rest.translation, &(rest.rotation * bodies.bodies[first].axis))
    });
    let own = |shape: Placed<'_>| (shape.solid.clone(), *shape.place);
    let (near_own, far_own) = (own(near), own(far));
    // Which joints are left: both ends swept leaves the fewest, none the truest shapes.
    let mut tries = Vec::new();
    if let (Some(n), Some(f)) = (&near_swept, &far_swept)
        && chain.len() > 1
    {
        tries.push((n, f, 1..chain.len() - 1));
    }
    if let Some(f) = &far_swept {
        tries.push((&near_own, f, 0..chain.len() - 1));
    }
    if let Some(n) = &near_swept {
        tries.push((n, &far_own, 1..chain.len()));
    }
    tries.push((&near_own, &far_own, 0..chain.len()));
    tries.into_iter().any(|(near, far, left)| {
        let shapes = [near.0.to_parry(), far.0.to_parry()];
        let need = need + TOLERANCE;
        let search = Search { bodies, ranges, chain: &chain, near, far, shapes, need };
        left.len() <= 1 && search.holds(left.start, left.len())
    })
}

/// The bodies from `near` (exclusive) to `far`; none if `far` does not hang on `near`.
fn chain(bodies: &Bodies, near: Option<usize>, far: Option<usize>) -> Option<Vec<usize>> {
    let mut chain = Vec::new();
    let mut at = far;
    while at != near {
        let body = at?;
        chain.push(body);
        at = bodies.bodies[body].parent;
    }
    chain.reverse();
    Some(chain)
}

/// A cylinder about the line through `origin` along the unit vector `axis` that holds the shape
/// however it turns about that line.
fn sweep(shape: Placed<'_>, origin: &Vector3<f64>, axis: &Vector3<f64>) -> (Solid, Frame) {
    let radius = reach(shape.solid, shape.place, origin, axis) + 1e-9;
    let (low, high) = shape.solid.bounds();
    let middle = shape.place.apply(&(0.5 * (low + high))) - origin;
    let half = shape.solid.extent(&shape.place.rotation.tr_mul(axis)) + 1e-9;
    // A cylinder's axis is y.
    let turn = UnitQuaternion::rotation_between(&Vector3::y(), axis)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), PI));
    let place = Frame {
        rotation: *turn.to_rotation_matrix().matrix(),
        translation: origin + axis * axis.dot(&middle),
    };
    (Solid::Cylinder { half, radius }, place)
}

/// Upper bound of the distance of the solid's points from a line. \[m\]
fn reach(solid: &Solid, place: &Frame, origin: &Vector3<f64>, axis: &Vector3<f64>) -> f64 {
    let beside = |p: Vector3<f64>| {
        let d = place.apply(&p) - origin;
        (d - axis * axis.dot(&d)).norm()
    };
    match solid {
        Solid::Ball { radius } => beside(Vector3::zeros()) + radius,
        Solid::Capsule { half, radius } => {
            let end = |z: f64| beside(Vector3::new(0.0, 0.0, z));
            end(*half).max(end(-half)) + radius
        }
        Solid::Cylinder { half, radius } => {
            let end = |y: f64| beside(Vector3::new(0.0, y, 0.0));
            end(*half).max(end(-half)) + radius
        }
        _ => {
            let (low, high) = solid.bounds();
            let corner =
                |n: usize| Vector3::from_fn(|i, _| if n >> i & 1 == 0 { low[i] } else { high[i] });
            (0..8).map(|n| beside(corner(n))).fold(0.0, f64::max)
        }
    }
}

/// The proof over the joints that are left, all others at rest.
struct Search<'a> {
    bodies: &'a Bodies,
    ranges: &'a Ranges,
    chain: &'a [usize],
    near: &'a (Solid, Frame),
    far: &'a (Solid, Frame),
    shapes: [SharedShape; 2],
    need: f64,
}

impl Search<'_> {
    /// Over `count` joints (none or one) of the chain, from the `first` on.
    fn holds(&self, first: usize, count: usize) -> bool {
        if count == 0 {
            return self.distance(0, 0.0) >= self.need;
        }
        let body = &self.bodies.bodies[self.chain[first]];
        let (low, high) = self.ranges[body.joint];
        let (low, high) = (body.value(low), body.value(high));
        let (mut low, mut high) = (low.min(high), low.max(high));
        if !body.prismatic && high - low > 2.0 * PI {
            (low, high) = (-PI, PI);
        }
        if !(low.is_finite() && high.is_finite()) {
            return false;
        }
        let lever = self.lever(first);
        let mut open = vec![(low, high)];
        for _ in 0..BUDGET {
            let Some((from, to)) = open.pop() else { return true };
            let middle = 0.5 * (from + to);
            let spare = self.distance(first, middle) - self.need;
            if spare < 1e-6 {
                return false;
            }
            if spare < 0.5 * (to - from) * lever {
                open.extend([(from, middle), (middle, to)]);
            }
        }
        open.is_empty()
    }

    /// Distance of the shapes with one joint of the chain at a value of its own. \[m\]
    fn distance(&self, joint: usize, value: f64) -> f64 {
        let pose = self.pose(0..self.chain.len(), joint, value).then(&self.far.1);
        let local = self.near.1.inverse_then(&pose);
        gjk_distance(&local, &self.shapes[0], &self.shapes[1])
    }

    /// The frame of the last of these bodies of the chain, in that of the first one's parent.
    fn pose(&self, bodies: std::ops::Range<usize>, joint: usize, value: f64) -> Frame {
        bodies.fold(Frame::IDENTITY, |pose, k| {
            let at = if k == joint { value } else { 0.0 };
            pose.then(&self.bodies.bodies[self.chain[k]].local(at))
        })
    }

    /// How far the far shape moves for each unit of a joint, at most. \[m/rad\] or \[m/m\]
    fn lever(&self, joint: usize) -> f64 {
        let body = &self.bodies.bodies[self.chain[joint]];
        if body.prismatic {
            return 1.0;
        }
        let place = self.pose(joint + 1..self.chain.len(), usize::MAX, 0.0).then(&self.far.1);
        reach(&self.far.0, &place, &Vector3::zeros(), &body.axis)
    }
}
