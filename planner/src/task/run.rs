//! From given poses to a verified plan.

use std::time::Instant;

use nalgebra::Isometry3;
use nullsweep_collision::{ToolContact, World};
use nullsweep_robot::{JointVector, Robot};

use super::assemble::assemble;
use super::config::TaskConfig;
use super::error::TaskError;
use super::figures::TaskFigures;
use super::route::Route;
use super::search::search;
use super::space::{Point, RESIDUAL, Space};
use crate::cost::{self, Effort};
use crate::motion::{RrtOptions, rrt_connect};
use crate::plan::Plan;
use crate::progress::Progress;
use crate::verify::{Given, Verification, verify};
use crate::workcell::Scene;

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

/// Plans through the poses, given in the robot's root frame.
///
/// # Errors
/// See [`TaskError`]. A plan that breaks a rule is no error: its verification says so.
pub fn run(
    robot: &Robot,
    poses: &[Isometry3<f64>],
    config: &TaskConfig,
    progress: &dyn Progress,
) -> Result<TaskOutcome, TaskError> {
    let started = Instant::now();
    let held: Vec<(&str, f64)> = config.held.iter().map(|(n, v)| (n.as_str(), *v)).collect();
    let arm = robot.arm(&config.arm)?.with_held(&held)?;
    let world = World::new(robot, &arm, &config.tool, &[], &config.obstacles, &config.collision)?;
    let space = Space::new(&arm, &world, &config.tool, &config.tolerance);
    let (route, unmet) = search(space, poses, config, progress)?;
    for pose in unmet {
        progress.note(&format!("pose {pose} is left out: no joint vector meets it"));
    }
    let edges = edges(&space, &route, config.seed)?;
    let plan = assemble(robot, &arm, poses, &route, &edges, config);
    let calc_time_s = started.elapsed().as_secs_f64();

    progress.stage("verify", Some(plan.knots.len()));
    let started = Instant::now();
    let scene = Scene::of_obstacles(config.obstacles.clone());
    let given = Given { robot, arm: &config.arm, scene: &scene, collision: &config.collision };
    let verification = verify(&plan, given, &|| progress.tick())?;
    let joints: Vec<JointVector> = plan.knots.iter().map(|k| k.q).collect();
    let straight: Vec<(&Point, &Point)> = pairs(&route)
        .zip(&edges)
        .filter(|(_, through)| through.is_none())
        .map(|(pair, _)| pair)
        .collect();
    let mut off: Vec<f64> = straight.iter().map(|(a, b)| deviation(&space, a, b)).collect();
    off.sort_by(f64::total_cmp);
    let excess = |&pose: &usize| space.excess(&poses[pose], &route.points[pose].tool).amax();
    let figures = TaskFigures {
        poses: poses.len(),
        met: route.order.iter().filter(|p| excess(p) < 10.0 * RESIDUAL).count(),
        movement_rad: straight.iter().map(|(a, b)| a.q.distance(&b.q)).sum(),
        reconfigurations: edges.iter().flatten().count(),
        effort_rad: cost::of_path(&Effort, &joints),
        task_time_s: plan.duration(),
        excess_max: route.order.iter().map(excess).fold(0.0, f64::max),
        edge_deviation_p90_m: off.get(off.len() * 9 / 10).copied().unwrap_or(0.0),
        edge_deviation_max_m: off.last().copied().unwrap_or(0.0),
        violations: verification.violations.len(),
        calc_time_s,
        verify_time_s: started.elapsed().as_secs_f64(),
        notes: world.notes().to_vec(),
    };
    Ok(TaskOutcome { plan, figures, verification })
}

fn pairs(route: &Route) -> impl Iterator<Item = (&Point, &Point)> {
    route.order.windows(2).map(|w| (&route.points[w[0]], &route.points[w[1]]))
}

/// For each edge the way through free space, where it is a reconfiguration or collides.
fn edges(
    space: &Space<'_>,
    route: &Route,
    seed: u64,
) -> Result<Vec<Option<Vec<JointVector>>>, TaskError> {
    let options = RrtOptions::default();
    pairs(route)
        .enumerate()
        .map(|(k, (a, b))| {
            if !space.is_reconfiguration(a, b)
                && space.world.motion_free(&a.q, &b.q, ToolContact::Allowed)
            {
                return Ok(None);
            }
            let path = rrt_connect(space.world, space.arm, &a.q, &b.q, &options, seed);
            let (from, to) = (route.order[k], route.order[k + 1]);
            path.map(Some).ok_or(TaskError::NoTransfer { from, to })
        })
        .collect()
}

/// Largest distance of the tool from the straight line along an edge. \[m\]
fn deviation(space: &Space<'_>, a: &Point, b: &Point) -> f64 {
    (1..16).map(|k| space.deviation_at(a, b, f64::from(k) / 16.0)).fold(0.0, f64::max)
}
