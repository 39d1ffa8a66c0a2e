//! The joints along an averaged and bent piece.

use nalgebra::{Isometry3, Point3};
use nullsweep_collision::ToolContact;
use nullsweep_robot::{JointVector, MAX_DOF, damped_step, pose_error};
use rayon::prelude::*;

use super::averaged::Smooth;
use super::piece::{Mean, Piece};
use crate::plan::LINE_TOLERANCE;
use crate::sweep::distance_to_segment;
use crate::workcell::Workcell;

/// Farthest between two joint vectors along the way. \[m\]
const SPACING: f64 = 0.003;
/// Most times that this is halved to stay within [`LINE_TOLERANCE`].
const MAX_HALVINGS: u32 = 4;
/// A joint that moves farther between two of them has left its branch. \[rad\]
const MAX_STEP: f64 = 0.2;
/// Steps of the joints onto a pose, and when they are there. \[m, rad\]
const STEPS: usize = 16;
const THERE: f64 = 1e-9;
/// Damping of these steps.
const DAMPING: f64 = 1e-8;

/// A place of the way that the arm is at.
#[derive(Clone, Copy, Debug)]
pub(super) struct Station {
    pub(super) q: JointVector,
    /// Contact pose.
    pub(super) pose: Isometry3<f64>,
    /// The patch that is visited there.
    pub(super) patch: Option<u32>,
    /// How far along the piece. \[m\]
    pub(super) u: f64,
}

/// What came of following a way.
pub(super) struct Followed {
    /// Along it; none where the arm does not come everywhere.
    pub(super) stations: Vec<Station>,
    /// Where it does not go, or is not free. \[m\]
    pub(super) stuck: Vec<f64>,
}

/// Follows the smooth way by some nodes along a piece.
pub(super) fn follow(piece: &Piece, nodes: &[Mean], cell: Workcell<'_>) -> Followed {
    let way = Way { line: Smooth::new(piece.length(), nodes), cell };
    let found: Vec<Result<Station, f64>> =
        places(piece).into_par_iter().map(|(u, patch)| way.at(u, patch).ok_or(u)).collect();
    let stuck: Vec<f64> = found.iter().filter_map(|f| f.as_ref().err().copied()).collect();
    if !stuck.is_empty() {
        return Followed { stations: Vec::new(), stuck };
    }
    let coarse: Vec<Station> = found.into_iter().flatten().collect();
    let spans: Vec<Option<Vec<Station>>> =
        coarse.par_windows(2).map(|w| way.between(&w[0], &w[1], MAX_HALVINGS)).collect();
    let stuck: Vec<f64> =
        coarse.iter().zip(&spans).filter(|(_, span)| span.is_none()).map(|(s, _)| s.u).collect();
    if !stuck.is_empty() {
        return Followed { stations: Vec::new(), stuck };
    }
    let mut stations = vec![coarse[0]];
    stations.extend(spans.into_iter().flatten().flatten());
    let collides = |w: &[Station]| {
        let free = cell.world.motion_free(&w[0].q, &w[1].q, ToolContact::Allowed);
        (!free).then_some(0.5 * (w[0].u + w[1].u))
    };
    let stuck = stations.par_windows(2).filter_map(collides).collect();
    Followed { stations, stuck }
}

/// Where along a piece there is to be a joint vector, evenly, and the patches that are visited there.
fn places(piece: &Piece) -> Vec<(f64, Option<u32>)> {
    let count = (piece.length() / SPACING).ceil().max(1.0) as usize;
    let count = count.max(piece.patches.len());
    let near = |u: f64| (u / piece.length() * count as f64).round() as usize;
    let own = apart(piece.patches.iter().map(|(u, _)| near(*u)).collect(), count);
    let at = |k: usize| (piece.length() * k as f64 / count as f64, None);
    let mut places: Vec<(f64, Option<u32>)> = (0..=count).map(at).collect();
    for (k, (_, patch)) in own.into_iter().zip(&piece.patches) {
        places[k].1 = Some(*patch);
    }
    places
}

/// Places in their order moved as little aside that none is another's; up to the last one.
fn apart(mut places: Vec<usize>, last: usize) -> Vec<usize> {
    for k in 1..places.len() {
        places[k] = places[k].max(places[k - 1] + 1);
    }
    let mut most = last;
    for place in places.iter_mut().rev() {
        *place = most.min(*place);
        most = place.saturating_sub(1);
    }
    places
}

struct Way<'a> {
    line: Smooth<'a>,
    cell: Workcell<'a>,
}

impl Way<'_> {
    fn at(&self, u: f64, patch: Option<u32>) -> Option<Station> {
        let mean = self.line.at(u);
        let pose = mean.pose()?;
        let q = onto(self.cell, &pose, mean.q())?;
        self.cell.arm.within_margins(&q).then_some(Station { q, pose, patch, u })
    }

    /// The stations after `a` up to `b`, the pad within the line's tolerance between them.
    fn between(&self, a: &Station, b: &Station, halvings: u32) -> Option<Vec<Station>> {
        if (0..MAX_DOF).any(|j| (b.q[j] - a.q[j]).abs() > MAX_STEP) {
            return None;
        }
        let [from, to] = [a, b].map(|s| Point3::from(s.pose.translation.vector));
        let centre = self.cell.tool.on(self.cell.arm).centre(&a.q.lerp(&b.q, 0.5));
        if distance_to_segment(&centre, &from, &to) <= LINE_TOLERANCE {
            return Some(vec![*b]);
        }
        let halvings = halvings.checked_sub(1)?;
        let middle = self.at(0.5 * (a.u + b.u), None)?;
        let mut stations = self.between(a, &middle, halvings)?;
        stations.extend(self.between(&middle, b, halvings)?);
        Some(stations)
    }
}

/// The joint vector nearest to one near by that brings the pad onto a pose.
pub(super) fn onto(
    cell: Workcell<'_>,
    pose: &Isometry3<f64>,
    near: JointVector,
) -> Option<JointVector> {
    let tip = pose * cell.tool.contact_in_tip().inverse();
    let mut q = near;
    for _ in 0..STEPS {
        let (now, jacobian) = cell.arm.tip_pose_and_jacobian(&q);
        let error = pose_error(&now, &tip);
        if error.norm() < THERE {
            return Some(q);
        }
        q = q + damped_step(&jacobian, &error, DAMPING)?;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_that_are_visited_in_one_place_have_each_its_own() {
        assert_eq!(apart(vec![0, 0, 4, 4, 5, 9, 9, 9], 9), [0, 1, 4, 5, 6, 7, 8, 9]);
        assert_eq!(apart(vec![2, 5], 9), [2, 5]);
    }
}
