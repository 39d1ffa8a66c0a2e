//! Six rotations in a row whose angles have a closed form: all solutions for a motion.
//!
//! Own derivation with the subproblems of [`super::subproblem`]; the kinds are among those of
//! Pieper (1968) and of Elias and Wen, *IK-Geo* (2022). The axes stand in one frame, where they are
//! while all angles are 0; the wanted motion is the product of the six rotations, first to last.

use nalgebra::{Isometry3, Vector3};

use super::subproblem::{Slack, Turns, turn_between, turned};
use crate::chain::{JointAxis, about};

/// Which axes meet or are parallel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// The first two meet, the last three meet: a spherical shoulder with one joint held.
    Shoulder,
    /// The second and third are parallel, the last three meet: most industrial arms.
    Industrial,
    /// The second to fourth are parallel, the last two meet: Universal Robots and their like.
    Parallel,
}

/// A kind that six axes are of.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape {
    pub(super) kind: Kind,
    /// How far they are from it: distances of axes that should meet \[m\], sines between axes that
    /// should be parallel.
    pub(super) deviation: f64,
}

/// Sines below which two axes are too near to parallel to meet in one point, and distances below
/// which an arm has no length. \[m\]
const APART: f64 = 0.1;
const LENGTH: f64 = 0.01;
/// Where axes point the same way, only the sum of two angles is determined. Sine.
const ALIGNED: f64 = 1e-9;

type Axes = [JointAxis; 6];

impl Shape {
    /// The kind that the axes are nearest to; `None` where they are of none.
    pub(super) fn of(axes: &Axes) -> Option<Self> {
        [Kind::Shoulder, Kind::Industrial, Kind::Parallel]
            .into_iter()
            .filter_map(|kind| Some(Self { kind, deviation: kind.deviation(axes)? }))
            .min_by(|a, b| a.deviation.total_cmp(&b.deviation))
    }
}

impl Kind {
    fn deviation(self, axes: &Axes) -> Option<f64> {
        let [a1, a2, a3, a4, a5, a6] = axes;
        let far = |axis: &JointAxis, point: &Vector3<f64>| {
            let off = off_axis(axis, point);
            (off > LENGTH).then_some(off)
        };
        let wrist = || {
            let centre = meeting(a4, a5)?;
            apart(a5, a6)?;
            Some((centre, gap(a4, a5).max(off_axis(a6, &centre))))
        };
        Some(match self {
            Self::Shoulder => {
                let (centre, wide) = wrist()?;
                let shoulder = meeting(a1, a2)?;
                far(a3, &centre)?;
                far(a3, &shoulder)?;
                wide.max(gap(a1, a2))
            }
            Self::Industrial => {
                let (centre, wide) = wrist()?;
                apart(a1, a2)?;
                far(a3, &centre)?;
                far(a3, &a2.point)?;
                wide.max(sine(a2, a3))
            }
            Self::Parallel => {
                meeting(a5, a6)?;
                apart(a1, a2)?;
                apart(a4, a5)?;
                far(a3, &a2.point)?;
                far(a3, &a4.point)?;
                gap(a5, a6).max(sine(a2, a3)).max(sine(a3, a4))
            }
        })
    }

    /// Calls `found` with each solution for `motion`, or that on the one branch asked for:
    /// its branch, three bits, and its angles \[rad\]. Joints that are not determined take their
    /// value of `free`.
    pub(super) fn angles(self, question: &Question<'_>, found: impl FnMut(u8, [f64; 6])) {
        match self {
            Self::Shoulder => question.shoulder(found),
            Self::Industrial => question.industrial(found),
            Self::Parallel => question.parallel(found),
        }
    }
}

/// What is asked of a kind.
pub(super) struct Question<'a> {
    pub(super) axes: &'a Axes,
    pub(super) motion: Isometry3<f64>,
    /// One branch, or all.
    pub(super) branch: Option<u8>,
    /// Angles of joints that are not determined. \[rad\]
    pub(super) free: [f64; 6],
    /// Of places, and of directions.
    pub(super) slack: Slack,
    pub(super) direction_slack: Slack,
}

impl Question<'_> {
    /// The angles of one rotation by the sides that are asked for.
    fn sides(&self, bit: u8, turns: Turns, free: f64) -> impl Iterator<Item = (u8, f64)> {
        let asked = self.branch;
        [false, true].into_iter().filter_map(move |second| {
            let side = u8::from(second) << bit;
            if asked.is_some_and(|branch| branch & 1 << bit != side) {
                return None;
            }
            Some((side, turns.on(second, free, asked.is_some())?))
        })
    }

    /// The elbow by the distance from shoulder to wrist centre, the shoulder by where the wrist
    /// centre is.
    fn shoulder(&self, mut found: impl FnMut(u8, [f64; 6])) {
        let [a1, a2, a3, a4, a5, _] = self.axes;
        let (Some(shoulder), Some(centre)) = (meeting(a1, a2), meeting(a4, a5)) else { return };
        let wanted = (self.motion * nalgebra::Point3::from(centre)).coords - shoulder;
        let (arm, pivot) = (centre - a3.point, shoulder - a3.point);
        let elbow = Turns::to_distance(&a3.direction, &arm, &pivot, wanted.norm(), self.slack);
        for (first, q3) in self.sides(0, elbow, self.free[2]) {
            let reached = turned(&a3.direction, q3, &arm) - pivot;
            // R₂ · reached = R₁ᵀ · wanted: the same component along the second axis.
            let component = a2.direction.dot(&reached);
            let back = -a1.direction;
            let pan = Turns::to_component(&back, &wanted, &a2.direction, component, self.slack);
            for (second, q1) in self.sides(1, pan, self.free[0]) {
                let ahead = turned(&back, q1, &wanted);
                let q2 = turn_between(&a2.direction, &reached, &ahead);
                self.wrist(first | second, [q1, q2, q3], &mut found);
            }
        }
    }

    /// The first joint by the wrist centre's place along the parallel axes, then two links in the
    /// plane across them.
    fn industrial(&self, mut found: impl FnMut(u8, [f64; 6])) {
        let [_, a2, a3, a4, a5, _] = self.axes;
        let Some(centre) = meeting(a4, a5) else { return };
        for (first, q1, wanted) in self.lift(&centre) {
            let (arm, pivot) = (centre - a3.point, a2.point - a3.point);
            let elbow = planar(a3, &arm, &pivot, &(wanted - a2.point), self.slack);
            for (second, q3) in self.sides(1, elbow, self.free[2]) {
                let reached = turned(&a3.direction, q3, &arm) - pivot;
                let q2 = turn_between(&a2.direction, &reached, &(wanted - a2.point));
                self.wrist(first | second, [q1, q2, q3], &mut found);
            }
        }
    }

    /// The first joint as there, the fifth and sixth by the direction of the parallel axes seen
    /// from the last link, and two links in the plane.
    fn parallel(&self, mut found: impl FnMut(u8, [f64; 6])) {
        let [a1, a2, a3, a4, a5, a6] = self.axes;
        let Some(centre) = meeting(a5, a6) else { return };
        let across = a2.direction;
        for (first, q1, _) in self.lift(&centre) {
            let from_lift = rotation_about(a1, -q1) * self.motion;
            let last = from_lift.rotation * a6.direction;
            let bend = Turns::to_component(
                &a5.direction,
                &a6.direction,
                &across,
                across.dot(&last),
                self.direction_slack,
            );
            for (second, q5) in self.sides(1, bend, self.free[4]) {
                let seen = turned(&a5.direction, -q5, &across);
                let q6 = if a6.direction.cross(&seen).norm() < ALIGNED {
                    self.free[5]
                } else {
                    let from = from_lift.rotation.inverse_transform_vector(&across);
                    turn_between(&a6.direction, &from, &seen)
                };
                let hand = rotation_about(a5, q5) * rotation_about(a6, q6);
                let plane = from_lift * hand.inverse();
                let turn = angle_of(a2, &plane);
                let wanted = (plane * nalgebra::Point3::from(a4.point)).coords - a2.point;
                let (arm, pivot) = (a4.point - a3.point, a2.point - a3.point);
                let elbow = planar(a3, &arm, &pivot, &wanted, self.slack);
                for (third, q3) in self.sides(2, elbow, self.free[2]) {
                    let reached = turned(&a3.direction, q3, &arm) - pivot;
                    let q2 = turn_between(&across, &reached, &wanted);
                    let sign = |axis: &JointAxis| across.dot(&axis.direction).signum();
                    let q4 = sign(a4) * (turn - q2 - sign(a3) * q3);
                    found(first | second | third, [q1, q2, q3, q4, q5, q6]);
                }
            }
        }
    }

    /// The first joint's angles that bring a point to its place along the second axis, and the
    /// point's goal as that joint's link sees it.
    fn lift<'a>(
        &'a self,
        point: &Vector3<f64>,
    ) -> impl Iterator<Item = (u8, f64, Vector3<f64>)> + use<'a> {
        let [a1, a2, ..] = self.axes;
        let goal = (self.motion * nalgebra::Point3::from(*point)).coords - a1.point;
        let back = -a1.direction;
        let component = a2.direction.dot(&(point - a1.point));
        let turns = Turns::to_component(&back, &goal, &a2.direction, component, self.slack);
        self.sides(0, turns, self.free[0])
            .map(move |(side, q1)| (side, q1, turned(&back, q1, &goal) + a1.point))
    }

    /// The last three angles, whose axes meet, for the first three.
    fn wrist(&self, arm_bits: u8, [q1, q2, q3]: [f64; 3], found: &mut impl FnMut(u8, [f64; 6])) {
        let [a1, a2, a3, a4, a5, a6] = self.axes.map(|a| a.direction);
        let arm = about(&a1, q1) * about(&a2, q2) * about(&a3, q3);
        let rest = arm.inverse() * self.motion.rotation;
        let last = rest * a6;
        let bend = Turns::to_component(&a5, &a6, &a4, a4.dot(&last), self.direction_slack);
        for (side, q5) in self.sides(2, bend, self.free[4]) {
            let bent = turned(&a5, q5, &a6);
            let aligned = a4.cross(&bent).norm() < ALIGNED;
            let q4 = if aligned { self.free[3] } else { turn_between(&a4, &bent, &last) };
            let roll = (about(&a4, q4) * about(&a5, q5)).inverse() * rest;
            let q6 = 2.0 * libm::atan2(roll.coords.xyz().dot(&a6), roll.w);
            found(arm_bits | side, [q1, q2, q3, q4, q5, q6]);
        }
    }
}

/// The angle of the second of two parallel axes by the distance, across them, of what it carries
/// from the first one. `arm` and `pivot` from the second axis, `wanted` from the first.
fn planar(
    axis: &JointAxis,
    arm: &Vector3<f64>,
    pivot: &Vector3<f64>,
    wanted: &Vector3<f64>,
    slack: Slack,
) -> Turns {
    let flat = |v: &Vector3<f64>| v - axis.direction * axis.direction.dot(v);
    let distance = flat(wanted).norm();
    Turns::to_distance(&axis.direction, &flat(arm), &flat(pivot), distance, slack)
}

fn rotation_about(axis: &JointAxis, angle: f64) -> Isometry3<f64> {
    let rotation = about(&axis.direction, angle);
    Isometry3::from_parts((axis.point - rotation * axis.point).into(), rotation)
}

/// The angle of a rotation about an axis. \[rad\]
fn angle_of(axis: &JointAxis, motion: &Isometry3<f64>) -> f64 {
    2.0 * libm::atan2(motion.rotation.coords.xyz().dot(&axis.direction), motion.rotation.w)
}

fn sine(one: &JointAxis, two: &JointAxis) -> f64 {
    one.direction.cross(&two.direction).norm()
}

fn apart(one: &JointAxis, two: &JointAxis) -> Option<()> {
    (sine(one, two) > APART).then_some(())
}

/// Distance between two axes that are not parallel. \[m\]
fn gap(one: &JointAxis, two: &JointAxis) -> f64 {
    let normal = one.direction.cross(&two.direction);
    (two.point - one.point).dot(&normal).abs() / normal.norm()
}

fn off_axis(axis: &JointAxis, point: &Vector3<f64>) -> f64 {
    (point - axis.point).cross(&axis.direction).norm()
}

/// Where two axes meet, or the middle between them where they are nearest; `None` where they are
/// parallel.
fn meeting(one: &JointAxis, two: &JointAxis) -> Option<Vector3<f64>> {
    let normal = one.direction.cross(&two.direction);
    let square = normal.norm_squared();
    if square < APART * APART {
        return None;
    }
    let between = two.point - one.point;
    let along_one = between.cross(&two.direction).dot(&normal) / square;
    let along_two = between.cross(&one.direction).dot(&normal) / square;
    let (a, b) = (one.point + one.direction * along_one, two.point + two.direction * along_two);
    Some(0.5 * (a + b))
}
