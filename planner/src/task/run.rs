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
use crate::motion::reconfigure;
use crate::plan::Plan;
use crate::progress::{Progress, left_out};
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
    let (mut route, unmet) = search(space, poses, config, progress)?;
    if !unmet.is_empty() {
        progress.note(&left_out(["pose", "poses"], &unmet, "no joint vector meets it"));
    }
    let cell = Workcell { arm: &arm, tool: &config.tool, world: &world };
    let edges = connect(&space, cell, &mut route, config.seed, progress);
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
        guessed_links: verification.against.guessed_links.clone(),
        calc_time_s,
        verify_time_s: started.elapsed().as_secs_f64(),
        notes: world.notes().to_vec(),
    };
    Ok(TaskOutcome { plan, figures, verification })
}

fn pairs(route: &Route) -> impl Iterator<Item = (&Point, &Point)> {
    route.order.windows(2).map(|w| (&route.points[w[0]], &route.points[w[1]]))
}

/// For each edge of the route the way through free space, where it is a reconfiguration or collides.
/// A pose that none leads to is taken out of the route.
fn connect(
    space: &Space<'_>,
    cell: Workcell<'_>,
    route: &mut Route,
    seed: u64,
    progress: &dyn Progress,
) -> Vec<Option<Vec<JointVector>>> {
    let mut order: Vec<usize> = Vec::new();
    let mut edges = Vec::new();
    for &pose in &route.order {
        let Some(&last) = order.last() else {
            order.push(pose);
            continue;
        };
        let (a, b) = (&route.points[last], &route.points[pose]);
        let goes_straight = !space.is_reconfiguration(a, b)
            && space.world.motion_free(&a.q, &b.q, ToolContact::Allowed);
        if goes_straight {
            edges.push(None);
        } else if let Some(path) = reconfigure(cell, &a.q, &b.q, seed) {
            edges.push(Some(path));
        } else {
            progress.note(&format!(
                "pose {pose} is left out: no motion through free space was found from pose {last}"
            ));
            continue;
        }
        order.push(pose);
    }
    route.order = order;
    edges
}

/// Largest distance of the tool from the straight line along an edge. \[m\]
fn deviation(space: &Space<'_>, a: &Point, b: &Point) -> f64 {
    (1..16).map(|k| space.deviation_at(a, b, f64::from(k) / 16.0)).fold(0.0, f64::max)
}
