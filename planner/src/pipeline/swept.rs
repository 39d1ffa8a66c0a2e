//! What was swept before a plan begins.

use nullsweep_robot::Arm;
use nullsweep_surface::{Patch, Scan};

use super::error::PipelineError;
use super::job::{After, Job};
use crate::plan::Stretch;
use crate::sweep::coverage;
use crate::timing::Rest;
use crate::workcell::Sample;

/// Which points belong to one of the marked patches.
pub(super) fn points_of(scan: &Scan, patches: &[Patch], marked: &[bool]) -> Vec<bool> {
    let mut points = vec![false; scan.points.len()];
    for (patch, _) in patches.iter().zip(marked).filter(|(_, m)| **m) {
        for &i in &patch.points {
            points[i as usize] = true;
        }
    }
    points
}

/// Which points the plan that a job goes on from, and those that led to it, have swept by where the
/// arm comes to `rest` on it, or else by its knot; nothing where it is to be swept again.
pub(super) fn swept_before(
    job: &Job,
    rest: Option<&Rest>,
    arm: &Arm,
    scan: &Scan,
) -> Result<Vec<bool>, PipelineError> {
    let Some(After { plan, knot, again: false, .. }) = &job.after else {
        return Ok(vec![false; scan.points.len()]);
    };
    let (knots, knot) = (plan.knots.len(), rest.map_or(*knot, |rest| rest.at));
    if knot >= knots {
        return Err(PipelineError::NoSuchKnot { knots, knot });
    }
    let followed = plan.followed(knot);
    Ok(coverage::swept_by(scan, followed.iter().map(Stretch::trajectory), arm))
}

/// What is swept with what need not be.
pub(super) fn with_spared(mut swept: Vec<bool>, job: &Job) -> Vec<bool> {
    swept.iter_mut().zip(&job.spared).for_each(|(swept, spared)| *swept |= spared);
    swept
}

/// Share of a patch's points from which on it counts as swept.
pub(super) const SWEPT_SHARE: f64 = 0.9;

/// Whether a patch counts as swept where these points are.
#[must_use]
pub fn is_swept(patch: &Patch, already: &[bool]) -> bool {
    let swept = patch.points.iter().filter(|&&i| already[i as usize]).count();
    swept as f64 >= SWEPT_SHARE * patch.points.len() as f64
}

/// Takes patches that are swept already out of what is to be visited.
pub(super) fn leave_out_swept(reached: &mut [Option<Sample>], patches: &[Patch], already: &[bool]) {
    for (entry, patch) in reached.iter_mut().zip(patches) {
        if is_swept(patch, already) {
            *entry = None;
        }
    }
}

/// The patches that are not swept already; all where nothing is said of any point.
pub(super) fn without_swept(mut patches: Vec<Patch>, already: &[bool]) -> Vec<Patch> {
    if !already.is_empty() {
        patches.retain(|patch| !is_swept(patch, already));
    }
    patches
}
