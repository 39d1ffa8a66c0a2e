//! The joints along an averaged and bent piece.

use nalgebra::Isometry3;
use nullsweep_collision::ToolContact;
use nullsweep_robot::{JointVector, MAX_DOF, damped_step, pose_error};
use rayon::prelude::*;

use super::bend::Bend;
use super::piece::{Laid, Piece};
use super::window::Windows;
use crate::plan::LINE_TOLERANCE;
use crate::workcell::{Bed, Workcell};

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

/// Follows the averaged and bent piece, or says where it cannot be.
pub(super) fn follow(
    piece: &Piece,
    windows: &Windows,
    bend: &Bend,
    cell: Workcell<'_>,
    bed: &Bed,
) -> Result<Vec<Station>, Vec<f64>> {
    let way = Way { piece, windows, bend, cell, laid: piece.laid(bed, windows, bend) };
    let found: Vec<Result<Station, f64>> =
        places(piece).into_par_iter().map(|(u, patch)| way.at(u, patch).ok_or(u)).collect();
    let failed: Vec<f64> = found.iter().filter_map(|f| f.as_ref().err().copied()).collect();
    if !failed.is_empty() {
        return Err(failed);
    }
    let coarse: Vec<Station> = found.into_iter().flatten().collect();
    let spans: Vec<Option<Vec<Station>>> =
        coarse.par_windows(2).map(|w| way.between(&w[0], &w[1], MAX_HALVINGS)).collect();
    let failed: Vec<f64> =
        coarse.iter().zip(&spans).filter(|(_, span)| span.is_none()).map(|(s, _)| s.u).collect();
    if !failed.is_empty() {
        return Err(failed);
    }
    let mut stations = vec![coarse[0]];
    stations.extend(spans.into_iter().flatten().flatten());
    let collides = |w: &[Station]| {
        let free = cell.world.motion_free(&w[0].q, &w[1].q, ToolContact::Allowed);
        (!free).then_some(0.5 * (w[0].u + w[1].u))
    };
    let failed: Vec<f64> = stations.par_windows(2).filter_map(collides).collect();
    if failed.is_empty() { Ok(stations) } else { Err(failed) }
}

/// Where along a piece there is to be a joint vector: its ends, its patches, and evenly between.
fn places(piece: &Piece) -> Vec<(f64, Option<u32>)> {
    let mut marks: Vec<(f64, Option<u32>)> = vec![(0.0, None)];
    for &(u, patch) in &piece.patches {
        match marks.last_mut() {
            Some(last) if u - last.0 < 1e-6 => last.1 = Some(patch),
            _ => marks.push((u, Some(patch))),
        }
    }
    if piece.length() - marks[marks.len() - 1].0 > 1e-6 {
        marks.push((piece.length(), None));
    }
    let mut places = vec![marks[0]];
    for pair in marks.windows(2) {
        let (a, b) = (pair[0].0, pair[1].0);
        let count = ((b - a) / SPACING).ceil().max(1.0) as usize;
        places.extend((1..count).map(|k| (a + (b - a) * k as f64 / count as f64, None)));
        places.push(pair[1]);
    }
    places
}

struct Way<'a> {
    piece: &'a Piece,
    windows: &'a Windows,
    bend: &'a Bend,
    cell: Workcell<'a>,
    laid: Laid,
}

impl Way<'_> {
    fn at(&self, u: f64, patch: Option<u32>) -> Option<Station> {
        let window = self.windows.at(u);
        let mean = self.piece.mean(u, window).moved(&self.bend.at(u));
        let pose = mean.pose(self.laid.at(u, window))?;
        let q = onto(self.cell, &pose, mean.q)?;
        self.cell.arm.within_margins(&q).then_some(Station { q, pose, patch, u })
    }

    /// The stations after `a` up to `b`, the pad within the line's tolerance between them.
    fn between(&self, a: &Station, b: &Station, halvings: u32) -> Option<Vec<Station>> {
        if (0..MAX_DOF).any(|j| (b.q[j] - a.q[j]).abs() > MAX_STEP) {
            return None;
        }
        let middle = self.at(0.5 * (a.u + b.u), None)?;
        let centre = self.cell.tool.on(self.cell.arm).centre(&a.q.lerp(&b.q, 0.5));
        if (centre.coords - middle.pose.translation.vector).norm() <= LINE_TOLERANCE {
            return Some(vec![*b]);
        }
        let halvings = halvings.checked_sub(1)?;
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
