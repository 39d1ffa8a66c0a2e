//! The robot in its place.

use nalgebra::Point3;
use nullsweep_collision::World;
use nullsweep_robot::{Arm, Robot};
use nullsweep_surface::{Patch, Scan, Surface};
use rayon::prelude::*;

use super::error::PipelineError;
use super::job::{Job, StanceChoice};
use super::start::start;
use crate::progress::Silent;
use crate::roadmap::{GraphConfig, Nodes, graph};
use crate::workcell::stance::{self, Stance, StanceSearch};
use crate::workcell::{Sample, Scene, Workcell, reach};

/// The robot in its place: everything in its root frame.
pub(super) struct Setting {
    pub(super) stance: Stance,
    pub(super) arm: Arm,
    pub(super) scan: Scan,
    pub(super) patches: Vec<Patch>,
    pub(super) world: World,
}

/// Puts the robot where it is asked to stand, or where it reaches most.
pub(super) fn settle(
    robot: &Robot,
    arm: &Arm,
    scene: &Scene,
    patches: &[Patch],
    job: &Job,
) -> Result<Setting, PipelineError> {
    match &job.stance {
        StanceChoice::Given(stance) => {
            let setting = Setting::new(robot, arm, scene, patches, job, stance.clone())?;
            match setting.world.stance_hit() {
                Some(hit) => Err(PipelineError::StanceHit { hit: hit.to_string() }),
                None => Ok(setting),
            }
        }
        StanceChoice::Auto => {
            search(robot, arm, scene, patches, job, &StanceSearch::of(robot, arm, &job.tool))
        }
        StanceChoice::Search(options) => search(robot, arm, scene, patches, job, options),
    }
}

/// The best of the stances that are searched.
fn search(
    robot: &Robot,
    arm: &Arm,
    scene: &Scene,
    patches: &[Patch],
    job: &Job,
    options: &StanceSearch,
) -> Result<Setting, PipelineError> {
    let candidates = stance::candidates(robot, arm, &job.tool, &scene.surface, patches, options)?;
    let tried = candidates.len();
    // Candidates are looked at side by side, each by itself.
    let open: Vec<Result<Option<Open>, PipelineError>> = candidates
        .into_par_iter()
        .map(|c| {
            let setting = Setting::new(robot, arm, scene, patches, job, c.stance)?;
            Ok(setting.open(job))
        })
        .collect();
    let open: Result<Vec<_>, _> = open.into_iter().filter_map(Result::transpose).collect();
    best_of(open?, job).ok_or(PipelineError::NoStance { tried, patches: patches.len() })
}

/// A stance that reaches something, not yet looked at as a whole.
struct Open {
    setting: Setting,
    reached: Vec<Option<Sample>>,
    /// What [`Setting::score`] is at most.
    most: usize,
}

/// The setting with the best score, the earlier one of two that are alike. Those that promise most
/// are scored first, some side by side, until none that is left could be better.
fn best_of(mut open: Vec<Open>, job: &Job) -> Option<Setting> {
    open.sort_by_key(|entry| std::cmp::Reverse(entry.most));
    let mut open = open.into_iter().peekable();
    let mut best: Option<(usize, Setting)> = None;
    while open.peek().is_some_and(|next| best.as_ref().is_none_or(|(s, _)| next.most > *s)) {
        let batch: Vec<Open> = open.by_ref().take(SIDE_BY_SIDE).collect();
        let scores: Vec<usize> =
            batch.par_iter().map(|entry| entry.setting.score(job, &entry.reached)).collect();
        for (score, entry) in scores.into_iter().zip(batch) {
            if best.as_ref().is_none_or(|(s, _)| score > *s) {
                best = Some((score, entry.setting));
            }
        }
    }
    best.map(|(_, setting)| setting)
}

impl Setting {
    fn new(
        robot: &Robot,
        arm: &Arm,
        scene: &Scene,
        patches: &[Patch],
        job: &Job,
        stance: Stance,
    ) -> Result<Self, PipelineError> {
        let arm = stance.bind(arm)?;
        let to_root = stance.pose().inverse();
        let patches: Vec<Patch> = patches.iter().map(|p| p.transformed(&to_root)).collect();
        let Scene { surface: scan, surroundings, obstacles } = scene.transformed(&to_root);
        let points: Vec<Point3<f64>> = scan.points.iter().copied().chain(surroundings).collect();
        let world = World::new(robot, &arm, &job.tool, &points, &obstacles, &job.collision)?;
        Ok(Self { stance, arm, scan, patches, world })
    }

    fn cell<'a>(&'a self, job: &'a Job) -> Workcell<'a> {
        Workcell { arm: &self.arm, tool: &job.tool, world: &self.world }
    }

    /// What the stance reaches; `None` where body or start posture collide, or it is nothing.
    fn open(self, job: &Job) -> Option<Open> {
        start(job, &self.arm, &self.world).ok()?;
        if self.world.stance_hit().is_some() {
            return None;
        }
        let reached = reach(self.cell(job), &self.patches, job.ik_samples, &|| ());
        let points = self.patches.iter().zip(&reached).filter(|(_, r)| r.is_some());
        let points: usize = points.map(|(patch, _)| patch.points.len()).sum();
        (points > 0).then_some(Open { setting: self, reached, most: points * (1 + WELL_JOINED) })
    }

    /// Points of reached patches, each weighed by the edges that lead on from its patch, up to
    /// `WELL_JOINED`.
    fn score(&self, job: &Job, reached: &[Option<Sample>]) -> usize {
        let surface = Surface::new(&self.scan);
        let config = GraphConfig { edge_samples: 24, ..job.graph };
        let nodes = Nodes { surface: &surface, patches: &self.patches, reached };
        let graph = graph::build(self.cell(job), nodes, &config, None, &Silent);
        (0..self.patches.len())
            .filter(|&i| reached[i].is_some())
            .map(|i| self.patches[i].points.len() * (1 + graph.incident[i].len().min(WELL_JOINED)))
            .sum()
    }
}

/// Edges from a patch from which on a stance gains nothing by more of them.
const WELL_JOINED: usize = 4;
/// Stances that are scored side by side.
const SIDE_BY_SIDE: usize = 4;
