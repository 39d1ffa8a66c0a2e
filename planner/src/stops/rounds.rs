//! Round after round: stops are chosen for what is not swept yet, and what came of their plans is added.

use nullsweep_robot::Robot;
use nullsweep_surface::Patch;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::choice::{Open, Stop, choose};
use super::error::StopsError;
use super::look::Ground;
use super::setup::Setup;
use super::share::{Share, Worked, work};
use super::survey::{Site, Survey, survey};
use crate::pipeline::{is_swept, patches_of};
use crate::progress::Progress;
use crate::workcell::{Scene, Stance};

/// Times that stops are chosen: what a plan leaves out may be another one's.
const ROUNDS: usize = 3;

/// What is known and done so far.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// What is reached from where.
    pub survey: Survey,
    /// What was done, round after round.
    pub worked: Vec<Worked>,
    /// How far the first choice of stops can be from the best, as a share of all points.
    pub gap: f64,
    /// Times that stops were chosen.
    pub rounds: usize,
}

/// The way from a survey to a program; scene and patches in the floor frame.
pub struct Rounds<'a> {
    pub(super) robot: &'a Robot,
    pub(super) setup: &'a Setup,
    pub(super) scene: &'a Scene,
    pub(super) patches: Vec<Patch>,
    pub(super) state: State,
    /// Which points of the scene are swept.
    pub(super) swept: Vec<bool>,
}

impl<'a> Rounds<'a> {
    /// Surveys what is reached from where.
    ///
    /// # Errors
    /// See [`StopsError`].
    pub fn begin(
        robot: &'a Robot,
        setup: &'a Setup,
        scene: &'a Scene,
        progress: &dyn Progress,
    ) -> Result<Self, StopsError> {
        let found = setup.arms.len();
        if setup.together && found != 2 {
            return Err(StopsError::NotTwo { found });
        }
        progress.stage("patches", None);
        let patches = patches_of(scene, &setup.job)?;
        let survey = survey(robot, setup, scene, &patches, progress)?;
        let swept = vec![false; scene.surface.points.len()];
        let state = State { survey, worked: Vec::new(), gap: 0.0, rounds: 0 };
        Ok(Self { robot, setup, scene, patches, state, swept })
    }

    /// Goes on from where another process was, of the same scene.
    ///
    /// # Errors
    /// [`StopsError::OtherScene`], or no patches.
    pub fn resume(
        robot: &'a Robot,
        setup: &'a Setup,
        scene: &'a Scene,
        state: State,
    ) -> Result<Self, StopsError> {
        let patches = patches_of(scene, &setup.job)?;
        let swept = vec![false; scene.surface.points.len()];
        let reached = state.survey.sites.iter().flat_map(|site| site.reached.iter().flatten());
        let points = state.worked.iter().flat_map(|one| &one.swept);
        let is_other = reached.max().is_some_and(|&patch| patch as usize >= patches.len())
            || points.max().is_some_and(|&point| point as usize >= swept.len());
        if is_other {
            return Err(StopsError::OtherScene);
        }
        let worked = state.worked.clone();
        let state = State { worked: Vec::new(), ..state };
        let mut rounds = Self { robot, setup, scene, patches, state, swept };
        rounds.add(worked);
        Ok(rounds)
    }

    /// What is known and done so far.
    #[must_use]
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Which points of the scene are swept so far.
    #[must_use]
    pub fn swept(&self) -> &[bool] {
        &self.swept
    }

    /// Plans a share of the round.
    ///
    /// # Errors
    /// See [`work`].
    pub fn work(&self, share: &Share) -> Result<Worked, StopsError> {
        work(self.robot, self.setup, self.scene, &self.patches, share, &self.swept)
    }

    /// The next stops with their shares; `None` where none is worth it.
    ///
    /// # Errors
    /// See [`StopsError`].
    pub fn next(&mut self, progress: &dyn Progress) -> Result<Option<Vec<Stop>>, StopsError> {
        if self.state.rounds == ROUNDS {
            return Ok(None);
        }
        progress.stage("stops", None);
        let limbs = self.setup.limbs(self.robot)?;
        let ground = Ground {
            robot: self.robot,
            setup: self.setup,
            limbs: &limbs,
            scene: self.scene,
            patches: &self.patches,
            around: self.setup.around(self.robot, &limbs),
        };
        let made = self.made();
        let mut stood = made.clone();
        loop {
            let choice = choose(&Open {
                patches: &self.patches,
                sites: self.open(),
                made: made.clone(),
                most: self.setup.most,
                swept: &self.swept,
                together: self.setup.together,
            });
            let nothing = vec![Vec::new(); limbs.len()];
            let new: Vec<&Stop> =
                choice.stops.iter().filter(|stop| !stood.contains(&stop.stance)).collect();
            // The survey saw a sketch: a stop must stand among all that was measured.
            let stands: Vec<_> =
                new.par_iter().map(|stop| ground.look(&stop.stance, &nothing)).collect();
            let mut fell = Vec::new();
            for (stop, stands) in new.into_iter().zip(stands) {
                let list = if stands?.is_some() { &mut stood } else { &mut fell };
                list.push(stop.stance.clone());
            }
            if !fell.is_empty() {
                self.state.survey.sites.retain(|site| !fell.contains(&site.stance));
                continue;
            }
            if self.state.rounds == 0 {
                let points = self.swept.len().max(1) as f64;
                self.state.gap = (choice.cover.bound - choice.cover.value) / points;
            }
            self.state.rounds += 1;
            return Ok(Some(choice.stops).filter(|stops| !stops.is_empty()));
        }
    }

    /// Adds what came of a round's shares.
    pub fn add(&mut self, worked: Vec<Worked>) {
        for point in worked.iter().flat_map(|one| &one.swept) {
            self.swept[*point as usize] = true;
        }
        self.state.worked.extend(worked);
    }

    /// The stops that have a plan, in the order in which they were chosen.
    pub(super) fn made(&self) -> Vec<Stance> {
        let mut made: Vec<Stance> = Vec::new();
        for one in self.state.worked.iter().filter(|one| one.plan.is_ok()) {
            if !made.contains(&one.share.stance) {
                made.push(one.share.stance.clone());
            }
        }
        made
    }

    /// The places with what each arm could still sweep there: nothing that it was to sweep before in
    /// the same place.
    fn open(&self) -> Vec<Site> {
        let done: Vec<bool> = self.patches.iter().map(|p| is_swept(p, &self.swept)).collect();
        let tried = |site: &Site, arm: usize, patch: &u32| {
            let same = |one: &&Worked| one.share.arm == arm && one.share.stance == site.stance;
            self.state
                .worked
                .iter()
                .filter(same)
                .any(|one| one.share.patches.binary_search(patch).is_ok())
        };
        let open = |site: &Site| {
            let of = |(arm, reached): (usize, &Vec<u32>)| {
                let open = |patch: &&u32| !done[**patch as usize] && !tried(site, arm, patch);
                reached.iter().filter(open).copied().collect()
            };
            let reached = site.reached.iter().enumerate().map(of).collect();
            Site { stance: site.stance.clone(), reached }
        };
        self.state.survey.sites.iter().map(open).collect()
    }
}
