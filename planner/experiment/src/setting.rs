//! The paper's setting (§V): a robot before an object, patches within its reach, and the graph.

use nalgebra::Isometry3;
use nullsweep_planner::pipeline::Job;
use nullsweep_planner::roadmap::{Graph, Nodes, graph};
use nullsweep_planner::tour::formulation::{self, Stop};
use nullsweep_planner::workcell::stance::{self, Stance, StanceSearch};
use nullsweep_planner::workcell::{
    Bed, Sample, Scene, contact_pose, direction, middle_out, redundancies,
};
use nullsweep_robot::{Arm, ArmError, JointVector, Robot, Solutions, Tool};
use nullsweep_surface::{Patch, Scan, Surface, patches};
use rayon::prelude::*;

/// Where all methods plan: everything in the robot's root frame. Joint limits hold; nothing is
/// checked for collision, and nothing at all between two poses.
pub struct Setting {
    /// The arm in its stance.
    pub arm: Arm,
    /// The tool.
    pub tool: Tool,
    /// Where the robot stands.
    pub stance: Stance,
    /// The scan.
    pub scan: Scan,
    /// Its surface, into which the pad may be pressed as deep as it likes.
    pub bed: Bed,
    /// The patches.
    pub patches: Vec<Patch>,
    /// For each patch a sample that reaches it.
    pub reached: Vec<Option<Sample>>,
    /// The graph over the reached patches.
    pub graph: Graph,
    /// Where the arm is before.
    pub start: JointVector,
}

/// Why there is no setting.
#[derive(Debug, thiserror::Error)]
pub enum SettingError {
    /// The arm cannot be made.
    #[error(transparent)]
    Arm(#[from] ArmError),
    /// Nothing to visit.
    #[error(
        "no stance of {stances} reaches any of the {patches} patches: is the scan in metres and the object within the arm's height?"
    )]
    NothingReached {
        /// Patches found.
        patches: usize,
        /// Stances tried.
        stances: usize,
    },
}

/// Stances that are looked at with all patches.
const FINALISTS: usize = 60;
/// Redundancy values by which a patch is reached or not.
const VALUES: usize = 100;

impl Setting {
    /// Patches on the cleaned scan (floor frame), the stance that reaches most of its points, and
    /// the graph, as the job's arm, tool, patches, graph and seed say.
    ///
    /// # Errors
    /// See [`SettingError`].
    pub fn new(robot: &Robot, scan: &Scan, job: &Job) -> Result<Self, SettingError> {
        let tool = &job.tool;
        let arm = robot.arm(&job.arm)?;
        let found = patches::find(scan, &job.patches, job.seed);
        let search = StanceSearch { finalists: FINALISTS, ..StanceSearch::default() };
        let candidates =
            stance::candidates(robot, &arm, tool, &Scene::on_floor(scan.clone()), &found, &search)?;
        let judged: Vec<Result<(usize, Stance, Arm), ArmError>> = candidates
            .into_par_iter()
            .map(|candidate| {
                let bound = candidate.stance.bind(&arm)?;
                let to_root = candidate.stance.pose().inverse();
                let reached = found
                    .iter()
                    .filter(|patch| reach(&bound, tool, &patch.transformed(&to_root)).is_some());
                Ok((reached.map(|p| p.points.len()).sum(), candidate.stance, bound))
            })
            .collect();
        let stances = judged.len();
        let mut best: Option<(usize, Stance, Arm)> = None;
        for entry in judged {
            let entry = entry?;
            if entry.0 > best.as_ref().map_or(0, |b| b.0) {
                best = Some(entry);
            }
        }
        let Some((_, stance, arm)) = best else {
            return Err(SettingError::NothingReached { patches: found.len(), stances });
        };
        let to_root = stance.pose().inverse();
        let patches: Vec<Patch> = found.iter().map(|p| p.transformed(&to_root)).collect();
        let scan = scan.transformed(&to_root);
        let bed = Bed::soft(Surface::new(&scan));
        let reached: Vec<Option<Sample>> =
            patches.par_iter().map(|p| reach(&arm, tool, p)).collect();
        let graph = graph::unchecked(
            Nodes { bed: &bed, patches: &patches, reached: &reached },
            &job.graph,
            tool.width,
        );
        let start = arm.home();
        let tool = tool.clone();
        Ok(Self { arm, tool, stance, scan, bed, patches, reached, graph, start })
    }

    /// The pad's contact frame before the first motion.
    #[must_use]
    pub fn tool_pose(&self) -> Isometry3<f64> {
        self.tool.on(&self.arm).pose(&self.start)
    }

    /// Appends the samples at a stop: `count` values of the redundancy as in §V, a few of them each
    /// moved to the nearest value that has a solution, so that every pose has a sample. A symmetric
    /// tool may stand the other way round.
    pub fn samples(&self, stop: &Stop, count: usize, out: &mut Vec<Sample>) {
        let range = self.arm.ik().redundancy_range();
        let at = |value: f64, out: &mut Vec<Sample>| {
            let before = out.len();
            for turn in self.tool.turns() {
                let turned = Stop { heading: stop.heading + turn, ..*stop };
                let contact = formulation::pose(&self.patches, &self.tool, &turned);
                solve(&self.arm, &self.tool, &contact, stop.heading, value, out);
            }
            out.len() > before
        };
        let values = redundancies(range, count);
        if count >= VALUES && values.iter().filter(|value| at(**value, out)).count() > 0 {
            return;
        }
        let mut taken: Vec<f64> = Vec::new();
        for wanted in values {
            let mut near = redundancies(range, VALUES);
            near.push(wanted);
            near.sort_by(|a, b| (a - wanted).abs().total_cmp(&(b - wanted).abs()));
            let mut fresh = Vec::new();
            if let Some(value) = near.into_iter().find(|value| at(*value, &mut fresh))
                && !taken.contains(&value)
            {
                taken.push(value);
                out.append(&mut fresh);
            }
        }
    }
}

/// A sample that puts the tool on the patch at some heading, the redundancy near its middle.
fn reach(arm: &Arm, tool: &Tool, patch: &Patch) -> Option<Sample> {
    let values = middle_out(redundancies(arm.ik().redundancy_range(), VALUES));
    let travel = direction(&patch.normal, 0.0);
    let contact = contact_pose(&patch.centre, &patch.normal, &travel, tool.stand_off);
    let mut found = Vec::new();
    values.into_iter().find_map(|value| {
        solve(arm, tool, &contact, 0.0, value, &mut found);
        found.first().copied()
    })
}

/// Appends the solutions inside the margined soft limits.
fn solve(
    arm: &Arm,
    tool: &Tool,
    contact: &Isometry3<f64>,
    heading: f64,
    redundancy: f64,
    out: &mut Vec<Sample>,
) {
    let mut solutions = Solutions::new();
    arm.ik().solve(&(contact * tool.contact_in_tip().inverse()), redundancy, &mut solutions);
    let inside = solutions.iter().filter(|s| arm.within_margins(&s.q));
    out.extend(inside.map(|s| Sample { q: s.q, branch: s.branch, redundancy, heading }));
}
