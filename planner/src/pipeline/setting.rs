//! The robot in its place.

use nullsweep_collision::World;
use nullsweep_robot::{Arm, Robot};
use nullsweep_surface::Patch;
use rayon::prelude::*;

use super::error::PipelineError;
use super::job::{Job, StanceChoice};
use super::left_out::{Known, in_words, left_out};
use super::other::Other;
use super::start::start;
use crate::roadmap::{GraphConfig, Nodes, graph};
use crate::workcell::stance::{self, Stance, StanceSearch};
use crate::workcell::{Bed, Sample, Scene, Workcell, reach};

/// The robot in its place: everything in its root frame.
pub(super) struct Setting {
    pub(super) stance: Stance,
    pub(super) arm: Arm,
    pub(super) scene: Scene,
    pub(super) patches: Vec<Patch>,
    pub(super) world: World,
    /// The other stances of a search that reach something, what promises most first.
    pub(super) others: Vec<Other>,
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
    // In less detail: the best is looked at again.
    let sketch = scene.sketch();
    let candidates = stance::candidates(robot, arm, &job.tool, &sketch, patches, options)?;
    let tried = candidates.len();
    let first = candidates.first().map(|candidate| candidate.stance.clone());
    // Candidates are looked at side by side, each by itself.
    let open: Vec<Result<Option<Open>, PipelineError>> = candidates
        .into_par_iter()
        .map(|c| {
            let setting = Setting::new(robot, arm, &sketch, patches, job, c.stance)?;
            Ok(setting.open(job))
        })
        .collect();
    let mut open = open.into_iter().filter_map(Result::transpose).collect::<Result<Vec<_>, _>>()?;
    // Where the arm cannot begin where it would, it may be shut in: only if it can nowhere.
    let mut makeshift: Option<Setting> = None;
    while let Some(best) = best_of(&open, job) {
        let Open { setting, stands, .. } = open.remove(best);
        if stands == Stands::Makeshift && makeshift.is_some() {
            continue;
        }
        let setting = Setting::new(robot, arm, scene, patches, job, setting.stance)?;
        match setting.stands(job) {
            Some(Stands::Ready) => return Ok(setting.beside(open)),
            Some(Stands::Makeshift) if makeshift.is_none() => makeshift = Some(setting),
            _ => {}
        }
        if makeshift.is_some() {
            open.retain(|other| other.stands == Stands::Ready);
        }
    }
    if let Some(setting) = makeshift {
        return Ok(setting.beside(open));
    }
    let why = match first {
        None => {
            "no posture within the limits reaches any, or the body has no place beside the object"
                .to_owned()
        }
        Some(stance) => Setting::new(robot, arm, scene, patches, job, stance)?.why(job),
    };
    Err(PipelineError::NoStance { tried, patches: patches.len(), why })
}

/// A stance that reaches something, not yet looked at as a whole.
struct Open {
    setting: Setting,
    reached: Vec<Option<Sample>>,
    /// What [`Setting::score`] is at most.
    most: usize,
    stands: Stands,
}

/// How the arm can begin in a stance.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Stands {
    /// In the posture that it would be in.
    Ready,
    /// Only in another one, near it.
    Makeshift,
}

/// The index of the setting with the best score, the earlier one of two that are alike. Those that
/// promise most are scored first, some side by side, until none that is left could be better.
fn best_of(open: &[Open], job: &Job) -> Option<usize> {
    let mut order: Vec<usize> = (0..open.len()).collect();
    order.sort_by_key(|&i| std::cmp::Reverse(open[i].most));
    let mut best: Option<(usize, usize)> = None;
    order.truncate(SCORED);
    for batch in order.chunks(SIDE_BY_SIDE) {
        let beat = best.map(|(score, _)| score);
        if beat.is_some_and(|score| open[batch[0]].most <= score) {
            break;
        }
        let score = |&i: &usize| open[i].setting.score(job, &open[i].reached, beat);
        let scores: Vec<Option<usize>> = batch.par_iter().map(score).collect();
        for (score, &i) in scores.into_iter().zip(batch) {
            if let Some(score) = score
                && best.is_none_or(|(s, _)| score > s)
            {
                best = Some((score, i));
            }
        }
    }
    best.map(|(_, i)| i)
}

impl Setting {
    pub(super) fn new(
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
        let scene = scene.transformed(&to_root);
        let (points, obstacles) = (scene.points(), &scene.obstacles);
        let world = World::new(robot, &arm, &job.tool, points, obstacles, &job.collision)?;
        Ok(Self { stance, arm, scene, patches, world, others: Vec::new() })
    }

    /// It beside the others that were open to choice.
    fn beside(self, mut open: Vec<Open>) -> Self {
        open.sort_by_key(|other| std::cmp::Reverse(other.most));
        let other = |open: Open| {
            let reached = open.reached.iter().map(Option::is_some).collect();
            Other { stance: open.setting.stance, reached }
        };
        Self { others: open.into_iter().map(other).collect(), ..self }
    }

    pub(super) fn cell<'a>(&'a self, job: &'a Job) -> Workcell<'a> {
        Workcell { arm: &self.arm, tool: &job.tool, world: &self.world }
    }

    /// How the arm can begin; `None` where the body collides, or the arm in every start posture.
    fn stands(&self, job: &Job) -> Option<Stands> {
        if self.world.stance_hit().is_some() {
            return None;
        }
        let start = start(job, &self.arm, &self.world).ok()?;
        Some(if start.is_makeshift { Stands::Makeshift } else { Stands::Ready })
    }

    /// Whether body and arm have a place here.
    pub(super) fn can_stand(&self, job: &Job) -> bool {
        self.stands(job).is_some()
    }

    /// What keeps the arm from everything.
    fn why(&self, job: &Job) -> String {
        if let Some(hit) = self.world.stance_hit() {
            return hit.to_string();
        }
        if let Err(error) = start(job, &self.arm, &self.world) {
            return error.to_string();
        }
        let scan = &self.scene.surface;
        let none = vec![false; scan.points.len().max(self.patches.len())];
        let known = Known::unreached(scan, &self.patches, &none);
        in_words(&left_out(self.cell(job), &known))
    }

    /// What the stance reaches; `None` where body or start posture collide, or it is nothing.
    fn open(self, job: &Job) -> Option<Open> {
        let stands = self.stands(job)?;
        let reached = reach(self.cell(job), &self.patches, job.ik_samples, &|| ());
        let points = self.patches.iter().zip(&reached).filter(|(_, r)| r.is_some());
        let points: usize = points.map(|(patch, _)| patch.points.len()).sum();
        (points > 0).then_some(Open {
            setting: self,
            reached,
            most: points * (1 + WELL_JOINED),
            stands,
        })
    }

    /// Points of reached patches, each weighed by the edges that lead on from its patch, up to
    /// `WELL_JOINED`; `None` if that is no more than what is to be beaten.
    fn score(&self, job: &Job, reached: &[Option<Sample>], beat: Option<usize>) -> Option<usize> {
        let bed = Bed::new(&self.scene, &job.tool);
        let config = GraphConfig { edge_samples: EDGE_SAMPLES, ..job.graph };
        let nodes = Nodes { bed: &bed, patches: &self.patches, reached };
        let weighed = |edges: &[usize]| -> usize {
            let patches = self.patches.iter().zip(reached).zip(edges);
            let reached = patches.filter(|((_, reached), _)| reached.is_some());
            reached.map(|((patch, _), edges)| patch.points.len() * (1 + edges)).sum()
        };
        let is_hopeless = |most: &[usize]| beat.is_some_and(|beat| weighed(most) <= beat);
        let edges = graph::joined(self.cell(job), nodes, &config, WELL_JOINED, is_hopeless)?;
        Some(weighed(&edges))
    }
}

/// Edges from a patch from which on a stance gains nothing by more of them.
const WELL_JOINED: usize = 4;
/// Redundancy values by which an edge is looked for where stances are compared.
const EDGE_SAMPLES: usize = 12;
/// Stances that are scored at most, those that promise most.
const SCORED: usize = 12;
/// Stances that are scored side by side.
const SIDE_BY_SIDE: usize = 4;
