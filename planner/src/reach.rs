//! Which patches the arm reaches, and with which joint vectors.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, UnitQuaternion, UnitVector3, Vector3};
use nullsweep_robot::{Arm, Branch, JointVector, Solutions};
use rayon::prelude::*;

use crate::collision::{ToolContact, World};
use crate::patches::Patch;
use crate::tool::Tool;

/// The arm, its tool and what is around them: what every stage from here on asks.
#[derive(Clone, Copy)]
pub struct Workcell<'a> {
    /// The arm, its held joints bound to the stance.
    pub arm: &'a Arm,
    /// The tool at the arm's tip.
    pub tool: &'a Tool,
    /// What it may collide with, in the root frame.
    pub world: &'a World,
}

/// One joint vector that puts the pad on a contact pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Joint vector. \[rad\] or \[m\]
    pub q: JointVector,
    /// Branch of the inverse kinematics.
    pub branch: Branch,
    /// Value of the redundancy parameter. \[rad\]
    pub redundancy: f64,
    /// Heading of the pad about the surface normal, from [`tangents`]' first axis. \[rad\]
    pub heading: f64,
}

/// Two unit tangents that form a right-handed frame with the normal, a continuous function of
/// it but at one pole.
#[must_use]
pub fn tangents(normal: &UnitVector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let pole = if normal.z.abs() < 0.9 { Vector3::z() } else { Vector3::x() };
    let first = pole.cross(normal).normalize();
    (first, normal.cross(&first))
}

/// The unit tangent at a heading. \[rad\]
#[must_use]
pub fn direction(normal: &UnitVector3<f64>, heading: f64) -> Vector3<f64> {
    let (e1, e2) = tangents(normal);
    e1 * heading.cos() + e2 * heading.sin()
}

/// The heading of a direction, which is projected onto the tangent plane. \[rad\], (−π, π]
#[must_use]
pub fn heading_of(normal: &UnitVector3<f64>, direction: &Vector3<f64>) -> f64 {
    let (e1, e2) = tangents(normal);
    direction.dot(&e2).atan2(direction.dot(&e1))
}

/// The contact frame's pose: origin `stand_off` above the surface point, z against the normal,
/// x along `travel` (projected onto the tangent plane).
#[must_use]
pub fn contact_pose(
    point: &Point3<f64>,
    normal: &UnitVector3<f64>,
    travel: &Vector3<f64>,
    stand_off: f64,
) -> Isometry3<f64> {
    let z = -normal.into_inner();
    let x = (travel - z * travel.dot(&z)).normalize();
    let y = z.cross(&x);
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, z]));
    Isometry3::from_parts(
        (point + normal.into_inner() * stand_off).into(),
        UnitQuaternion::from_rotation_matrix(&rotation),
    )
}

/// Values of the redundancy parameter to try (paper §V): fewer than 10 around the middle of the
/// range, more uniformly over it; one value 0 for an arm without redundancy. \[rad\]
#[must_use]
pub fn redundancies(range: Option<(f64, f64)>, count: usize) -> Vec<f64> {
    let Some((low, high)) = range else { return vec![0.0] };
    let count = count.max(1);
    let share = if count < 10 { 0.5 } else { 1.0 };
    let (middle, width) = (0.5 * (low + high), share * (high - low));
    (0..count).map(|i| middle + width * ((i as f64 + 0.5) / count as f64 - 0.5)).collect()
}

impl Workcell<'_> {
    /// Appends every joint vector at `redundancies` that puts the pad on the contact pose, lies
    /// inside the margined soft limits and is free of collision, the pad on the surface.
    pub fn samples(
        &self,
        contact: &Isometry3<f64>,
        heading: f64,
        redundancies: &[f64],
        out: &mut Vec<Sample>,
    ) {
        self.visit_samples(contact, heading, redundancies, |sample| {
            out.push(sample);
            false
        });
    }

    /// The first of [`Self::samples`], the redundancies tried in the order given.
    #[must_use]
    pub fn first_sample(
        &self,
        contact: &Isometry3<f64>,
        heading: f64,
        redundancies: &[f64],
    ) -> Option<Sample> {
        let mut first = None;
        self.visit_samples(contact, heading, redundancies, |sample| {
            first = Some(sample);
            true
        });
        first
    }

    /// The joint vector with the last joint, which turns the pad, where it is and, if its limits are
    /// more than a turn apart, a turn on: an edge may lead past half a turn.
    fn turns(&self, q: &JointVector) -> impl Iterator<Item = JointVector> + use<'_> {
        let last = self.arm.dof() - 1;
        let (low, high) = self.arm.margined_limits()[last];
        let bounded = low.is_finite() && self.arm.is_revolute(last);
        let q = *q;
        [0.0, -TAU, TAU].into_iter().filter_map(move |turn| {
            let mut turned = q;
            turned[last] += turn;
            let inside = (low..=high).contains(&turned[last]);
            (turn == 0.0 || bounded && inside).then_some(turned)
        })
    }

    /// Calls `visit` on each valid sample until it returns true.
    fn visit_samples(
        &self,
        contact: &Isometry3<f64>,
        heading: f64,
        redundancies: &[f64],
        mut visit: impl FnMut(Sample) -> bool,
    ) {
        let tip = contact * self.tool.contact_in_tip().inverse();
        let mut solutions = Solutions::new();
        for &redundancy in redundancies {
            solutions.clear();
            self.arm.ik().solve(&tip, redundancy, &mut solutions);
            for s in &solutions {
                if !self.arm.within_margins(&s.q) || !self.world.is_free(&s.q, ToolContact::Allowed)
                {
                    continue;
                }
                for q in self.turns(&s.q) {
                    if visit(Sample { q, branch: s.branch, redundancy, heading }) {
                        return;
                    }
                }
            }
        }
    }
}

/// Headings at which a patch is tried, evenly over half a turn: with a pad that turns about the
/// arm's last axis one would do, other arms and the gripper's shape want several.
const HEADINGS: usize = 8;

/// For each patch, one sample that reaches it, at the first heading that has one; `None` for an
/// unreachable patch. `tick` is called once a patch.
#[must_use]
pub fn reach(
    cell: Workcell<'_>,
    patches: &[Patch],
    ik_samples: usize,
    tick: &(dyn Fn() + Sync),
) -> Vec<Option<Sample>> {
    let values = middle_out(redundancies(cell.arm.ik().redundancy_range(), ik_samples.max(24)));
    patches
        .par_iter()
        .map(|patch| {
            let turn = if cell.tool.symmetric { 0.5 } else { 1.0 } * TAU;
            let found = (0..HEADINGS).find_map(|h| {
                let heading = turn * h as f64 / HEADINGS as f64;
                let travel = direction(&patch.normal, heading);
                let pose = contact_pose(&patch.centre, &patch.normal, &travel, cell.tool.stand_off);
                cell.first_sample(&pose, heading, &values)
            });
            tick();
            found
        })
        .collect()
}

/// The same values, the middle one first, the ends last.
#[must_use]
pub fn middle_out(mut values: Vec<f64>) -> Vec<f64> {
    let middle = values.iter().sum::<f64>() / values.len().max(1) as f64;
    values.sort_by(|a, b| (a - middle).abs().total_cmp(&(b - middle).abs()));
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_samples_stay_around_the_middle_many_fill_the_range() {
        assert_eq!(redundancies(Some((-3.0, 1.0)), 1), vec![-1.0]);
        let few = redundancies(Some((-3.0, 1.0)), 3);
        assert!(few.iter().all(|r| (-2.0..=0.0).contains(r)), "{few:?}");
        let many = redundancies(Some((-3.0, 1.0)), 100);
        assert!((many[0] + 2.98).abs() < 1e-12 && (many[99] - 0.98).abs() < 1e-12);
        assert_eq!(redundancies(None, 7), vec![0.0]);
    }

    #[test]
    fn heading_and_direction_are_inverse() {
        for k in 0..40 {
            let a = f64::from(k);
            let normal =
                UnitVector3::new_normalize(Vector3::new(a.sin(), (a * 1.7).cos(), 0.9 - 0.05 * a));
            let heading = (a * 0.37).rem_euclid(6.0) - 3.0;
            let d = direction(&normal, heading);
            assert!((heading_of(&normal, &d) - heading).abs() < 1e-12);
            let pose = contact_pose(&Point3::origin(), &normal, &d, 0.01);
            assert!((pose * Vector3::x() - d).norm() < 1e-12);
            assert!((pose * Vector3::z() + normal.into_inner()).norm() < 1e-12);
            assert!((pose.translation.vector - normal.into_inner() * 0.01).norm() < 1e-12);
        }
    }
}
