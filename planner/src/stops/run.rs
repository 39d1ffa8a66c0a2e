//! The whole object on one page: what is reached is surveyed, stops are chosen, their plans made, and
//! what those have not swept is chosen for again.

use nullsweep_robot::Robot;
use rayon::prelude::*;

use super::error::StopsError;
use super::program::program;
use super::rounds::Rounds;
use super::setup::Setup;
use super::share::Share;
use crate::plan::Program;
use crate::progress::Progress;
use crate::workcell::Scene;

/// Chooses stops and makes their plans, round after round, and puts the program together.
///
/// # Errors
/// See [`StopsError`].
pub fn run(
    robot: &Robot,
    setup: &Setup,
    scene: &Scene,
    progress: &dyn Progress,
) -> Result<Program, StopsError> {
    let mut rounds = Rounds::begin(robot, setup, scene, progress)?;
    while let Some(stops) = rounds.next(progress)? {
        let shares: Vec<Share> = stops.into_iter().flat_map(|stop| stop.shares).collect();
        progress.stage("plans of the stops", Some(shares.len()));
        let worked: Vec<_> = shares
            .par_iter()
            .map(|share| {
                let worked = rounds.work(share);
                progress.tick();
                worked
            })
            .collect();
        rounds.add(worked.into_iter().collect::<Result<_, _>>()?);
    }
    program(&rounds, progress)
}
