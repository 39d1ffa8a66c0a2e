//! Puts the program together.

use super::drive;
use super::error::StopsError;
use super::look::Ground;
use super::rounds::Rounds;
use super::share::Worked;
use super::tolerance::{Offset, tolerance};
use super::unswept::unswept;
use crate::plan::{PROGRAM_FORMAT, Plan, Program, ProgramStop, Totals, Work};
use crate::progress::Progress;
use crate::workcell::Stance;

/// The program of all that was done, sealed.
///
/// # Errors
/// See [`StopsError`].
pub fn program(of: &Rounds<'_>, progress: &dyn Progress) -> Result<Program, StopsError> {
    progress.stage("program", None);
    let limbs = of.setup.limbs(of.robot)?;
    let sketch = of.scene.sketch();
    let ground = Ground {
        robot: of.robot,
        setup: of.setup,
        limbs: &limbs,
        scene: &sketch,
        patches: &of.patches,
        around: of.setup.around(of.robot, &limbs),
    };
    let made = of.made();
    let (order, drives) = drive::order(of.scene, &made, of.setup.job.seed);
    let points = of.swept.len();
    let mut swept = vec![false; points];
    let off = Offset::default();
    let mut stops = Vec::new();
    for (&stop, drive_m) in order.iter().zip(&drives) {
        let stance = &made[stop];
        let (mut works, mut together) = (Vec::new(), Vec::new());
        for (one, plan) in plans(&of.state.worked, stance) {
            let new = one.swept.iter().filter(|&&point| !swept[point as usize]).count();
            one.swept.iter().for_each(|&point| swept[point as usize] = true);
            if one.at_once {
                together.push([works.len() - 1, works.len()]);
            }
            works.push(Work {
                arm: limbs[one.share.arm].spec.to_string(),
                adds: new as f64 / points.max(1) as f64,
                kept_off_place: tolerance(&ground, &one.share, off)?,
                plan: plan.clone(),
            });
        }
        let Stance { base, height, held } = stance.clone();
        let drive_m = *drive_m;
        stops.push(ProgramStop { base, base_height: height, held, drive_m, works, together });
    }
    let union = of.state.survey.union(of.patches.len());
    let mut any = vec![false; points];
    for (patch, _) in of.patches.iter().zip(union).filter(|(_, reached)| *reached) {
        patch.points.iter().for_each(|&point| any[point as usize] = true);
    }
    let share = |of: &[bool]| of.iter().filter(|o| **o).count() as f64 / points.max(1) as f64;
    let totals = Totals {
        points,
        coverage_all: share(&swept),
        coverage_of_any_stops: share(&any),
        places: of.state.survey.places,
        looked: of.state.survey.looked,
        choice_gap: of.state.gap,
        task_time_s: stops.iter().map(ProgramStop::seconds).sum(),
        drive_m: drives.iter().sum(),
        off_m: off.along,
        off_rad: off.turned,
        unswept: unswept(of)?,
    };
    let robot = of.robot.name().into();
    let near_m = ground.around;
    Ok(Program { program: PROGRAM_FORMAT, robot, near_m, stops, totals, seal: None }.sealed())
}

/// What was done at a stop.
fn plans<'a>(
    worked: &'a [Worked],
    stance: &'a Stance,
) -> impl Iterator<Item = (&'a Worked, &'a Plan)> {
    let here = worked.iter().filter(move |one| one.share.stance == *stance);
    here.filter_map(|one| one.plan.as_ref().ok().map(|plan| (one, plan)))
}
