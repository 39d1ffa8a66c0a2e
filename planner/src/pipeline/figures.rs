//! The figures of a run.

use std::collections::BTreeMap;

use nullsweep_robot::{Arm, JointVector};
use serde::{Deserialize, Serialize};

use super::attempt::Sequence;
use super::left_out::LeftOut;
use super::rounds::RoundFigures;
use crate::cost::{self, Effort};
use crate::plan::Plan;
use crate::roadmap::Graph;
use crate::sweep::{DIP, Held, MissedPoints, Pace, Passes};
use crate::verify::Verification;

/// Every figure of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    /// Scanned points.
    pub points: usize,
    /// Patches.
    pub patches: usize,
    /// Patches that the arm reaches.
    pub reachable: usize,
    /// Patches put over what the others' sweep left out.
    pub fill_in_patches: usize,
    /// Places of the pad on strips, in place of the patches.
    #[serde(default)]
    pub places: usize,
    /// Short ways beside a stop between two jumps, so that it sweeps and does not only touch.
    pub strokes: usize,
    /// Pairs of neighbouring patches.
    pub edge_candidates: usize,
    /// Edges of the graph.
    pub edges: usize,
    /// Connected components of the graph.
    pub components: usize,
    /// x, y \[m\] and yaw \[rad\] of the robot's root frame in the floor frame.
    pub base: [f64; 3],
    /// How high above the floor it is. \[m\]
    pub base_height_m: f64,
    /// Held joints that the stance sets. \[rad\] or \[m\]
    pub held: BTreeMap<String, f64>,
    /// Samples of the inverse kinematics that the layered graph had.
    pub ik_samples_total: usize,
    /// Sum of all joint displacements. \[rad\]
    pub effort_rad: f64,
    /// Duration of the plan. \[s\]
    pub task_time_s: f64,
    /// Length of the pad's path on the surface. \[m\]
    pub distance_m: f64,
    /// Length of the pad's path through free space. \[m\]
    pub transfer_m: f64,
    /// Seconds that each stage took.
    pub calc_time_s: BTreeMap<String, f64>,
    /// Seconds that all took.
    pub calc_time_total_s: f64,
    /// Knots of the plan.
    pub knots: usize,
    /// Motions through free space.
    pub jumps: usize,
    /// Reachable patches that no motion was found to.
    pub dropped_patches: usize,
    /// What is not swept, by what is in the way.
    pub left_out: Vec<LeftOut>,
    /// Reachable points that are not swept, by why the pad's motion leaves them.
    #[serde(default)]
    pub missed: Vec<MissedPoints>,
    /// How fast it goes.
    pub pace: Pace,
    /// How often it passes over what it sweeps.
    #[serde(flatten)]
    pub passes: Passes,
    /// What came of each round, where there are several or the tool has a speed of its own there.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rounds: Vec<RoundFigures>,
    /// How well the tool speed that was asked for is held.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub tool_speed: Option<Held>,
    /// What the finished plan's check found.
    #[serde(flatten)]
    pub verification: Verification,
    /// Seed.
    pub seed: u64,
}

/// What plan, graph and joint path say of themselves; the rest at its default.
pub(super) fn figures(plan: &Plan, arm: &Arm, graph: &Graph, sequence: &Sequence) -> Figures {
    let joints: Vec<JointVector> = plan.knots.iter().map(|k| k.q).collect();
    Figures {
        points: plan.surface.len(),
        base: plan.base,
        base_height_m: plan.base_height,
        seed: plan.seed,
        edge_candidates: graph.candidates,
        edges: graph.edges.len(),
        components: graph.components.len(),
        ik_samples_total: sequence.samples,
        effort_rad: cost::of_path(&Effort, &joints),
        task_time_s: plan.duration(),
        distance_m: pad_path(plan, arm, true),
        transfer_m: pad_path(plan, arm, false),
        knots: plan.knots.len(),
        jumps: sequence.jumps(),
        pace: Pace::of(plan.trajectory(), plan.begins_in_motion(), arm, DIP),
        dropped_patches: sequence.dropped.len(),
        ..Figures::default()
    }
}

/// Length of the pad centre's path on the surface or off it. \[m\]
fn pad_path(plan: &Plan, arm: &Arm, on_surface: bool) -> f64 {
    let pad = plan.tool.on(arm);
    plan.knots
        .windows(2)
        .filter(|w| (w[0].line.is_some() && w[1].line.is_some()) == on_surface)
        .map(|w| (pad.centre(&w[1].q) - pad.centre(&w[0].q)).norm())
        .sum()
}
