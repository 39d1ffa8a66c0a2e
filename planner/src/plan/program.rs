//! The program: plans at several stops of the robot, in order, which together sweep a surface.

use std::path::Path;

use nalgebra::{Isometry3, Vector3};
use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::xxh3_64;

use super::error::{PROGRAM_FORMAT, PlanError};
use super::file::Plan;
use super::kind::is_program;
use super::seal::Seal;

/// Plans at several stops of the robot, which together sweep a surface. Every plan of it begins and ends
/// with its arm tucked, as the other arms are while it works.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Program {
    /// [`PROGRAM_FORMAT`].
    pub program: u32,
    /// The robot's name in its URDF.
    pub robot: String,
    /// How far around a stop's base its plans know what is there: more than the robot reaches. \[m\]
    pub near_m: f64,
    /// The stops, in the order of the drive.
    pub stops: Vec<ProgramStop>,
    /// What they come to together.
    pub totals: Totals,
    /// What it was like when it was put together, its plans sealed each by itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seal: Option<Seal>,
}

/// A place of the robot, and what it does there.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProgramStop {
    /// The robot's root frame in the floor frame: x, y \[m\], yaw \[rad\].
    pub base: [f64; 3],
    /// How high above the floor the root frame is. \[m\]
    #[serde(default)]
    pub base_height: f64,
    /// Held joints that are set for this stop, the lift say. \[rad\] or \[m\]
    pub held: Vec<(String, f64)>,
    /// How far it is from the stop before, around what is there, as far as a path was found. \[m\]
    pub drive_m: f64,
    /// What is done there, in this order.
    pub works: Vec<Work>,
    /// Which of them may be done at once, two and two by their places in `works`: both plans begin at the
    /// same time, and each waits where it has to for the other to be clear of it. One after the other they
    /// may be done too.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub together: Vec<[usize; 2]>,
}

/// A plan of an arm at a stop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Work {
    /// Base and tip link of the arm: BASE,TIP.
    pub arm: String,
    /// Share of all scanned points that this plan sweeps, and no plan before it.
    pub adds: f64,
    /// Share of what it is to sweep that is still in reach with the base off by [`Totals::off_m`] and
    /// [`Totals::off_rad`], the least of several directions, once it is planned anew there.
    pub kept_off_place: f64,
    /// The plan.
    pub plan: Plan,
}

/// What the stops come to together.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Totals {
    /// Scanned points.
    pub points: usize,
    /// Share of them that some plan sweeps.
    pub coverage_all: f64,
    /// Share of them in patches that some place reaches of all that were looked at: what any number of
    /// stops could do.
    pub coverage_of_any_stops: f64,
    /// Places on the floor from which the arms are long enough for something.
    pub places: usize,
    /// How many of them were looked at exactly.
    pub looked: usize,
    /// How far what the first choice of stops reaches can be from the best choice, as a share of all
    /// points: proven.
    pub choice_gap: f64,
    /// Sum of the plans' durations, of two that are done at once the longer one's. \[s\]
    pub task_time_s: f64,
    /// Sum of the drives between the stops. \[m\]
    pub drive_m: f64,
    /// How far off its place the base was taken to stand. \[m\]
    pub off_m: f64,
    /// How far it was taken to be turned. \[rad\]
    pub off_rad: f64,
    /// What no plan sweeps, by what is in the way.
    pub unswept: Vec<Unswept>,
}

/// Points that no plan sweeps, for one reason.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Unswept {
    /// The reason, in words.
    pub why: String,
    /// Patches that it concerns.
    pub patches: usize,
    /// Share of all scanned points.
    pub share: f64,
}

impl ProgramStop {
    /// The root frame's pose in the floor frame.
    #[must_use]
    pub fn pose(&self) -> Isometry3<f64> {
        let [x, y, yaw] = self.base;
        Isometry3::new(Vector3::new(x, y, self.base_height), Vector3::z() * yaw)
    }
}

impl Program {
    /// Reads a program file; `None` where it holds something else.
    ///
    /// # Errors
    /// Names the file and, for bad content, line and column.
    pub fn read(path: &Path) -> Result<Option<Self>, PlanError> {
        let text = std::fs::read_to_string(path)
            .map_err(|source| PlanError::File { path: path.into(), source })?;
        if is_program(&text) { Self::parse(&text, path).map(Some) } else { Ok(None) }
    }

    /// Reads a program from the text of its file; `path` is only used to name it in errors.
    ///
    /// # Errors
    /// As [`Self::read`]; another version, or a plan that is not of its stop.
    pub fn parse(text: &str, path: &Path) -> Result<Self, PlanError> {
        let program: Self = serde_json::from_str(text)
            .map_err(|source| PlanError::Parse { path: path.into(), source })?;
        if program.program != PROGRAM_FORMAT {
            return Err(PlanError::ProgramFormat { path: path.into(), found: program.program });
        }
        for (s, stop) in program.stops.iter().enumerate() {
            if let Some(w) = stop.works.iter().position(|work| !stop.is_of(&work.plan)) {
                return Err(PlanError::OtherStop { stop: s + 1, work: w + 1 });
            }
            if !stop.are_pairs() {
                return Err(PlanError::NoPair { stop: s + 1 });
            }
        }
        Ok(program)
    }

    /// Writes a program file; the same program gives the same bytes.
    ///
    /// # Errors
    /// Names the file.
    pub fn write(&self, path: &Path) -> Result<(), PlanError> {
        let file = |source| PlanError::File { path: path.into(), source };
        let text = serde_json::to_string(self).map_err(|e| file(e.into()))?;
        std::fs::write(path, text).map_err(file)
    }

    /// The program, each plan of it said to be verified as it is.
    #[must_use]
    pub fn sealed(mut self) -> Self {
        for work in self.stops.iter_mut().flat_map(|stop| &mut stop.works) {
            work.plan = work.plan.clone().sealed();
        }
        let seal = Some(self.seal_now());
        Self { seal, ..self }
    }

    /// Whether it and its plans are as they were when they were verified.
    ///
    /// # Errors
    /// As [`Plan::check_seal`].
    pub fn check_seal(&self) -> Result<(), PlanError> {
        self.works().try_for_each(|(_, work)| work.plan.check_seal())?;
        self.seal.as_ref().ok_or(PlanError::Unverified)?.check(&self.seal_now())
    }

    /// A checksum of all of it as its file holds it.
    #[must_use]
    pub fn digest(&self) -> u64 {
        xxh3_64(&serde_json::to_vec(self).unwrap_or_default())
    }

    /// Of all but the plans' insides, which are sealed by themselves, but with their seals.
    fn seal_now(&self) -> Seal {
        let stop = |stop: &ProgramStop| {
            let works: Vec<_> = stop.works.iter().map(|w| (&w.arm, w.adds, &w.plan.seal)).collect();
            let place = (stop.base, stop.base_height, &stop.held, stop.drive_m, works);
            match stop.together.is_empty() {
                true => serde_json::to_value(place).ok(),
                false => serde_json::to_value((place, &stop.together)).ok(),
            }
        };
        let stops: Vec<_> = self.stops.iter().map(stop).collect();
        Seal::new(&[], &(self.program, &self.robot, self.near_m, stops, &self.totals))
    }

    /// Every plan with the number of its stop, from 0.
    pub fn works(&self) -> impl Iterator<Item = (usize, &Work)> {
        self.stops.iter().enumerate().flat_map(|(s, stop)| stop.works.iter().map(move |w| (s, w)))
    }
}

impl ProgramStop {
    /// How long its plans take, two that are done at once as long as the longer one. \[s\]
    #[must_use]
    pub fn seconds(&self) -> f64 {
        let of = |work: usize| self.works[work].plan.duration();
        let is_paired = |work: &usize| self.together.iter().flatten().any(|one| one == work);
        let alone = (0..self.works.len()).filter(|work| !is_paired(work)).map(of);
        let both = self.together.iter().map(|&[one, other]| of(one).max(of(other)));
        alone.chain(both).sum()
    }

    /// The work that is done at the same time as another one, by their places in `works`.
    #[must_use]
    pub fn beside(&self, work: usize) -> Option<usize> {
        let pair = self.together.iter().find(|pair| pair.contains(&work))?;
        pair.iter().copied().find(|&other| other != work)
    }

    /// Whether what is done at once is two works of two arms, and each of one pair alone.
    fn are_pairs(&self) -> bool {
        let mut paired: Vec<usize> = self.together.iter().flatten().copied().collect();
        paired.sort_unstable();
        let is_once = paired.windows(2).all(|two| two[0] != two[1]);
        let is_there = paired.last().is_none_or(|&last| last < self.works.len());
        let arm = |work: usize| &self.works[work].arm;
        is_once && is_there && self.together.iter().all(|&[one, other]| arm(one) != arm(other))
    }

    /// Whether a plan was made for this place.
    fn is_of(&self, plan: &Plan) -> bool {
        let holds = |(name, at): &(String, f64)| {
            plan.held.iter().any(|held| held.name == *name && held.position == *at)
        };
        plan.base == self.base
            && plan.base_height == self.base_height
            && self.held.iter().all(holds)
    }
}
