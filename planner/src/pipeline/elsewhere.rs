//! Whether the arm would come to what a plan leaves out from another stance that was tried.

use nullsweep_robot::{Arm, Robot};
use nullsweep_surface::Patch;

use super::error::PipelineError;
use super::job::Job;
use super::left_out::LeftOut;
use super::other::{FreeFrom, Other};
use super::setting::Setting;
use crate::workcell::{Cause, Scene, reach};

/// What a stance is looked at in: scene and patches in the floor frame.
pub(super) struct Floor<'a> {
    pub(super) robot: &'a Robot,
    pub(super) arm: &'a Arm,
    pub(super) scene: &'a Scene,
    pub(super) patches: &'a [Patch],
    pub(super) job: &'a Job,
}

/// Says in the rows of what the arm meets something at how much of it is free from the one other stance
/// that promises most: what it reaches of it among all that is there.
pub(super) fn advise(
    mut rows: Vec<LeftOut>,
    others: &[Other],
    floor: &Floor<'_>,
) -> Result<Vec<LeftOut>, PipelineError> {
    let Floor { robot, arm, scene, patches, job } = *floor;
    let blocked: Vec<usize> =
        rows.iter().filter(|row| meets(&row.cause)).flat_map(|row| row.of.clone()).collect();
    let promises = |other: &Other| -> usize {
        let free = blocked.iter().filter(|&&patch| other.reached[patch]);
        free.map(|&patch| patches[patch].points.len().max(1)).sum()
    };
    // The first of those that are alike: they come best first.
    let best = others.iter().rev().max_by_key(|other| promises(other));
    let Some(best) = best.filter(|other| promises(other) > 0) else { return Ok(rows) };
    let setting = Setting::new(robot, arm, scene, patches, job, best.stance.clone())?;
    if !setting.can_stand(job) {
        return Ok(rows);
    }
    let promised: Vec<usize> = blocked.into_iter().filter(|&patch| best.reached[patch]).collect();
    let looked: Vec<Patch> = promised.iter().map(|&patch| setting.patches[patch].clone()).collect();
    let reached = reach(setting.cell(job), &looked, job.ik_samples, &|| ());
    let is_free = |patch: &usize| {
        let place = promised.iter().position(|other| other == patch);
        place.is_some_and(|place| reached[place].is_some())
    };
    for row in rows.iter_mut().filter(|row| meets(&row.cause)) {
        let patches = row.of.iter().filter(|patch| is_free(patch)).count();
        let stance = best.stance.clone();
        row.free_from = (patches > 0).then_some(FreeFrom { stance, patches });
    }
    Ok(rows)
}

/// Whether something is in the arm's way.
pub(super) fn meets(cause: &Cause) -> bool {
    matches!(
        cause,
        Cause::Itself { .. } | Cause::Solid { .. } | Cause::Object { .. } | Cause::Unseen { .. }
    )
}
