//! From given poses to a verified plan.

use std::time::Instant;

use nalgebra::Isometry3;
use nullsweep_robot::{JointVector, Robot};
use rayon::prelude::*;

use super::config::TaskConfig;
use super::error::TaskError;
use super::figures::TaskFigures;
use super::route::Route;
use super::search::search;
use crate::cost::{self, Effort};
use crate::plan::{Left, Plan};
use crate::poses::{
    self, Along, Chain, Order, Piece, Point, Space, Standing, Stop, by_reason, chain, tell_left,
};
use crate::progress::Progress;
use crate::verify::{Given, Verification, verify};
use crate::workcell::{Scene, Workcell};

/// The plan and its figures.
#[derive(Clone, Debug)]
pub struct TaskOutcome {
    /// The plan; knots at poses carry the pose's index as their patch.
    pub plan: Plan,
    /// The figures.
    pub figures: TaskFigures,
    /// What verification found.
    pub verification: Verification,
}

/// Plans through the poses, given in the robot's root frame, in a scene in the floor frame: all that
/// was measured there is in the way, but for the tool's pad at a pose and beside it.
///
/// # Errors
/// See [`TaskError`]. A plan that breaks a rule is no error: its verification says so.
pub fn run(
    robot: &Robot,
    poses: &[Isometry3<f64>],
    scene: &Scene,
    config: &TaskConfig,
    progress: &dyn Progress,
) -> Result<TaskOutcome, TaskError> {
    let started = Instant::now();
    let setup = &config.setup;
    let Standing { arm, scene, world } = setup.stand(robot, scene)?;
    let space = Space::new(&arm, &world, &setup.tool, &setup.tolerance);
    let (route, unmet) = search(space, poses, config, progress)?;
    let mut left = by_reason(&unmet);
    tell_left(&left, progress);
    let cell = Workcell { arm: &arm, tool: &setup.tool, world: &world };
    let (pieces, apart) = connect(&space, cell, &route, config, progress)
        .ok_or(TaskError::NoWay { met: poses.len() - unmet.len() })?;
    tell_left(&apart, progress);
    left.extend(apart);
    let given = poses::Given { robot, arm: &arm, setup, poses };
    let plan = poses::assemble(given, &pieces);
    progress.stage("timing", None);
    let at_rest: Vec<usize> =
        (0..plan.knots.len()).filter(|&k| plan.knots[k].patch.is_some()).collect();
    let regions = scene.regions.marks(&[]);
    let plan = Plan { left, regions, ..setup.speed.set(plan, cell, &at_rest) };
    let calc_time_s = started.elapsed().as_secs_f64();

    progress.stage("verify", Some(plan.knots.len()));
    let started = Instant::now();
    let given = Given { robot, arm: &setup.arm, scene: &scene, collision: &setup.collision };
    let verification = verify(&plan, given, &|| progress.tick())?;
    let joints: Vec<JointVector> = plan.knots.iter().map(|k| k.q).collect();
    let along = Along::of(&space, poses, &pieces);
    let figures = TaskFigures {
        poses: poses.len(),
        met: along.met,
        movement_rad: along.movement,
        reconfigurations: along.ways.saturating_sub(usize::from(setup.start.is_some())),
        effort_rad: cost::of_path(&Effort, &joints),
        task_time_s: plan.duration(),
        excess_max: along.excess,
        edge_deviation_p90_m: along.deviation_p90,
        edge_deviation_max_m: along.deviation_max,
        violations: verification.violations.len(),
        against: verification.against.clone(),
        calc_time_s,
        verify_time_s: started.elapsed().as_secs_f64(),
        notes: world.notes().to_vec(),
    };
    Ok(TaskOutcome { plan, figures, verification })
}

/// The way through the route, from the start on where there is one, and what no way leads to; `None`
/// where that is all.
fn connect(
    space: &Space<'_>,
    cell: Workcell<'_>,
    route: &Route,
    config: &TaskConfig,
    progress: &dyn Progress,
) -> Option<(Vec<Piece>, Vec<Left>)> {
    progress.stage("ways", None);
    let runs = runs(space, route);
    let (start, seed) = (config.setup.start.as_ref(), config.setup.seed);
    let mut order: Vec<usize> = (0..runs.len()).collect();
    let mut best = chain(cell, &runs, start, Order::Free, seed);
    let count = |runs: &[usize], of: &[Vec<Stop>]| -> usize {
        runs.iter().map(|&run| of[run].iter().filter(|s| s.pose.is_some()).count()).sum()
    };
    // From a small run that leads nowhere the largest one is not come to: it is begun with.
    let largest = (0..runs.len()).rev().max_by_key(|&run| count(&[run], &runs))?;
    if start.is_none() && best.left_out.contains(&largest) {
        order.remove(largest);
        order.insert(0, largest);
        let other: Vec<Vec<Stop>> = order.iter().map(|&run| runs[run].clone()).collect();
        let again = chain(cell, &other, start, Order::Free, seed);
        let left: Vec<usize> = again.left_out.iter().map(|&run| order[run]).collect();
        if count(&left, &runs) < count(&best.left_out, &runs) {
            best = Chain { left_out: left, ..again };
        }
    }
    let poses = best.left_out.iter().flat_map(|&run| &runs[run]).filter_map(|stop| stop.pose);
    let mut points: Vec<u32> = poses.map(|pose| pose as u32).collect();
    points.sort_unstable();
    if best.pieces.is_empty() {
        return None;
    }
    let apart = (!points.is_empty()).then(|| Left { cause: APART.into(), points });
    Some((best.pieces, apart.into_iter().collect()))
}

const APART: &str = "no motion through free space was found to there from the other poses, or the tool does \
                     not come off there";

/// The route in runs within which the arm goes from pose to pose without leaving its posture: free of
/// collision, with what has to be put in so that the tool goes straight.
fn runs(space: &Space<'_>, route: &Route) -> Vec<Vec<Stop>> {
    let edges: Vec<Option<Vec<Stop>>> = route
        .order
        .par_windows(2)
        .map(|pair| edge(space, &route.points[pair[0]], &route.points[pair[1]]))
        .collect();
    let mut runs: Vec<Vec<Stop>> = Vec::new();
    for (k, &pose) in route.order.iter().enumerate() {
        let stop = Stop { point: route.points[pose], pose: Some(pose) };
        match (k.checked_sub(1).and_then(|e| edges[e].as_ref()), runs.last_mut()) {
            (Some(between), Some(run)) => run.extend(between.iter().copied().chain([stop])),
            _ => runs.push(vec![stop]),
        }
    }
    runs
}

/// What is put in between two poses; `None` where the arm has to leave off.
fn edge(space: &Space<'_>, a: &Point, b: &Point) -> Option<Vec<Stop>> {
    if space.is_reconfiguration(a, b) {
        return None;
    }
    let stops = space.edge(a, b)?.into_iter().map(|point| Stop { point, pose: None });
    Some(stops.collect())
}
