//! What one arm does at one stop, and the plan of it.

use std::sync::Mutex;

use nullsweep_robot::Robot;
use nullsweep_surface::Patch;
use serde::{Deserialize, Serialize};

use super::error::StopsError;
use super::setup::Setup;
use crate::pipeline::{self, End, Figures, Job, Outcome, PipelineError, StanceChoice};
use crate::plan::Plan;
use crate::progress::Progress;
use crate::workcell::{Scene, Stance};

/// What one arm is to sweep at one stop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Share {
    /// Where the robot stands.
    pub stance: Stance,
    /// Which of the arms.
    pub arm: usize,
    /// The patches, ascending.
    pub patches: Vec<u32>,
}

/// What came of a share.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Worked {
    /// What was to be swept.
    pub share: Share,
    /// The verified plan, or why there is none.
    pub plan: Result<Plan, String>,
    /// Which points of the scene it sweeps, as indices, ascending.
    pub swept: Vec<u32>,
    /// What it is like; nothing where there is none.
    pub figures: Option<Figures>,
    /// What its making had to tell.
    pub notes: Vec<String>,
    /// Whether it may be done at once with the work before it in the list.
    #[serde(default)]
    pub at_once: bool,
}

/// What counts as the same place. \[rad\] or \[m\]
const SAME: f64 = 1e-6;

/// Plans a share. `swept` says of each point of the scene whether it was swept before; scene and patches
/// are in the floor frame.
///
/// # Errors
/// See [`StopsError`]. A share that no plan is found for is none: its `plan` says why.
pub fn work(
    robot: &Robot,
    setup: &Setup,
    scene: &Scene,
    patches: &[Patch],
    share: &Share,
    swept: &[bool],
) -> Result<Worked, StopsError> {
    let limbs = setup.limbs(robot)?;
    let limb = &limbs[share.arm];
    let [x, y, _] = share.stance.base;
    let (here, kept) = scene.near([x, y], setup.around(robot, &limbs));
    let mut own = vec![false; scene.surface.points.len()];
    for &patch in &share.patches {
        patches[patch as usize].points.iter().for_each(|&point| own[point as usize] = true);
    }
    let is_spared = |point: &u32| !own[*point as usize] || swept[*point as usize];
    let job = Job {
        arm: limb.spec.clone(),
        stance: StanceChoice::Given(share.stance.clone()),
        start: Some(limb.tucked),
        end: End::Start,
        spared: kept.iter().map(is_spared).collect(),
        ..setup.job.clone()
    };
    let notes = Notes::default();
    let made = pipeline::run(robot, &here, &job, &notes);
    let none = |why: String, notes| Worked {
        share: share.clone(),
        plan: Err(why),
        swept: Vec::new(),
        figures: None,
        notes,
        at_once: false,
    };
    let notes = notes.told();
    let Outcome { plan, figures, arm, .. } = match made {
        Ok(outcome) => outcome,
        Err(error) if is_of_the_place(&error) => return Ok(none(error.to_string(), notes)),
        Err(error) => return Err(error.into()),
    };
    let found = &figures.verification;
    if let Some(first) = found.violations.first() {
        let (count, what) = (found.violations.len(), &first.detail);
        return Ok(none(format!("the plan breaks {count} rules: {what}"), notes));
    }
    let last = plan.knots.last().map_or(limb.tucked, |knot| knot.q);
    let apart = arm.continuous().displacement(&last, &limb.tucked);
    if apart.iter().any(|apart| apart.abs() > SAME) {
        return Ok(none("no way back to the tucked posture was found".into(), notes));
    }
    let swept = kept.iter().zip(&found.swept).filter(|(_, s)| **s).map(|(point, _)| *point);
    Ok(Worked {
        share: share.clone(),
        swept: swept.collect(),
        plan: Ok(plan),
        figures: Some(figures),
        notes,
        at_once: false,
    })
}

/// Whether another stop, or another share, may do better.
fn is_of_the_place(error: &PipelineError) -> bool {
    matches!(
        error,
        PipelineError::NoPatches { .. }
            | PipelineError::AllSpared
            | PipelineError::StanceHit { .. }
            | PipelineError::StartHit { .. }
            | PipelineError::StartLimit { .. }
            | PipelineError::NothingReached { .. }
            | PipelineError::NoMotion { .. }
    )
}

/// Keeps what is told.
#[derive(Default)]
pub(super) struct Notes(Mutex<Vec<String>>);

impl Notes {
    pub(super) fn told(self) -> Vec<String> {
        self.0.into_inner().unwrap_or_default()
    }
}

impl Progress for Notes {
    fn stage(&self, _: &'static str, _: Option<usize>) {}
    fn tick(&self) {}
    fn note(&self, text: &str) {
        if let Ok(mut notes) = self.0.lock() {
            notes.push(text.to_owned());
        }
    }
}
