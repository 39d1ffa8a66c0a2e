//! The whole object on one page: what is reached is surveyed, stops are chosen, their plans made, and
//! what those have not swept is chosen for again.

use nullsweep_robot::Robot;
use rayon::prelude::*;

use super::error::StopsError;
use super::pair::work_together;
use super::program::program;
use super::rounds::Rounds;
use super::setup::Setup;
use super::share::{Share, Worked};
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
        let worked = if setup.together {
            progress.stage("plans of the stops", Some(stops.len()));
            all(&stops, progress, |stop| work_together(&rounds, stop))?
        } else {
            let shares: Vec<Share> = stops.into_iter().flat_map(|stop| stop.shares).collect();
            progress.stage("plans of the stops", Some(shares.len()));
            all(&shares, progress, |share| Ok(vec![rounds.work(share)?]))?
        };
        rounds.add(worked);
    }
    program(&rounds, progress)
}

/// What comes of each, in order.
fn all<T: Sync>(
    of: &[T],
    progress: &dyn Progress,
    work: impl Fn(&T) -> Result<Vec<Worked>, StopsError> + Sync,
) -> Result<Vec<Worked>, StopsError> {
    let done: Vec<Result<Vec<Worked>, StopsError>> = of
        .par_iter()
        .map(|one| {
            let worked = work(one);
            progress.tick();
            worked
        })
        .collect();
    Ok(done.into_iter().collect::<Result<Vec<_>, _>>()?.concat())
}
