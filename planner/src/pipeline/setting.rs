//! The robot in its place.

use nalgebra::Point3;
use nullsweep_robot::{Arm, JointVector, Robot};
use rayon::prelude::*;

use super::{Job, PipelineError, StanceChoice};
use crate::collision::{Obstacle, ToolContact, World};
use crate::graph::{self, GraphConfig};
use crate::patches::Patch;
use crate::progress::Silent;
use crate::reach::{Workcell, reach};
use crate::scan::Scan;
use crate::stance::{self, Stance};
use crate::surface::Surface;

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
    scan: &Scan,
    patches: &[Patch],
    job: &Job,
) -> Result<Setting, PipelineError> {
    match &job.stance {
        StanceChoice::Given(stance) => {
            let setting = Setting::new(robot, arm, scan, patches, job, stance.clone())?;
            match setting.world.stance_hit() {
                Some(hit) => Err(PipelineError::StanceHit { hit: hit.to_string() }),
                None => Ok(setting),
            }
        }
        StanceChoice::Search(search) => {
            let candidates = stance::candidates(robot, arm, &job.tool, scan, patches, search)?;
            let tried = candidates.len();
            // Candidates are looked at side by side, each by itself; the best share of points
            // whose patch is reached without a collision wins, ties go to the earlier one.
            let judged: Vec<Result<Option<(usize, Setting)>, PipelineError>> = candidates
                .into_par_iter()
                .map(|c| {
                    let setting = Setting::new(robot, arm, scan, patches, job, c.stance)?;
                    Ok(setting.score(job).map(|score| (score, setting)))
                })
                .collect();
            let mut best: Option<(usize, Setting)> = None;
            for entry in judged {
                if let Some((score, setting)) = entry?
                    && best.as_ref().is_none_or(|(s, _)| score > *s)
                {
                    best = Some((score, setting));
                }
            }
            best.map(|(_, setting)| setting)
                .ok_or(PipelineError::NoStance { tried, patches: patches.len() })
        }
    }
}

impl Setting {
    fn new(
        robot: &Robot,
        arm: &Arm,
        scan: &Scan,
        patches: &[Patch],
        job: &Job,
        stance: Stance,
    ) -> Result<Self, PipelineError> {
        let arm = stance.bind(arm)?;
        let to_root = stance.pose().inverse();
        let scan = scan.transformed(&to_root);
        let patches: Vec<Patch> = patches.iter().map(|p| p.transformed(&to_root)).collect();
        let obstacles: Vec<Obstacle> = job
            .obstacles
            .iter()
            .map(|o| Obstacle { pose: to_root * o.pose, ..o.clone() })
            .collect();
        let surroundings = job.surroundings.iter().map(|p| to_root * p);
        let points: Vec<Point3<f64>> = scan.points.iter().copied().chain(surroundings).collect();
        let world = World::new(robot, &arm, &job.tool, &points, &obstacles, &job.collision)?;
        Ok(Self { stance, arm, scan, patches, world })
    }

    /// Points of reached patches, each weighed by the edges that lead on from its patch, up to
    /// `WELL_JOINED`; `None` where body or start posture collide, or nothing is reached.
    fn score(&self, job: &Job) -> Option<usize> {
        start(job, &self.arm, &self.world).ok()?;
        if self.world.stance_hit().is_some() {
            return None;
        }
        let cell = Workcell { arm: &self.arm, tool: &job.tool, world: &self.world };
        let reached = reach(cell, &self.patches, job.ik_samples, &|| ());
        let surface = Surface::new(&self.scan);
        let config = GraphConfig { edge_samples: 24, ..job.graph };
        let graph = graph::build(cell, &surface, &self.patches, &reached, &config, None, &Silent);
        let score = (0..self.patches.len())
            .filter(|&i| reached[i].is_some())
            .map(|i| self.patches[i].points.len() * (1 + graph.incident[i].len().min(WELL_JOINED)))
            .sum();
        (score > 0).then_some(score)
    }
}

/// Edges from a patch from which on a stance gains nothing by more of them.
const WELL_JOINED: usize = 4;

/// The joint vector that the plan starts from.
pub(super) fn start(job: &Job, arm: &Arm, world: &World) -> Result<JointVector, PipelineError> {
    if let Some(after) = &job.after
        && after.held.is_none()
    {
        let knots = after.plan.knots.len();
        return after
            .plan
            .knots
            .get(after.knot)
            .map(|k| k.q)
            .ok_or(PipelineError::NoSuchKnot { knots, knot: after.knot });
    }
    let held = job.after.as_ref().and_then(|after| after.held);
    let start = held.or(job.start).unwrap_or_else(|| arm.home());
    for (j, &(low, high)) in arm.margined_limits().iter().enumerate() {
        if !(low..=high).contains(&start[j]) {
            let joint = arm.joint_names()[j].clone();
            return Err(PipelineError::StartLimit { joint, value: start[j], low, high });
        }
    }
    match world.why_not(&start, ToolContact::Allowed) {
        Some(hit) => Err(PipelineError::StartHit { hit: hit.to_string() }),
        None => Ok(start),
    }
}
