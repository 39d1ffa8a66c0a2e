//! From given poses to a verified plan.

use std::time::Instant;

use nalgebra::Isometry3;
use nullsweep_collision::{ToolContact, World};
use nullsweep_robot::{Arm, JointVector, Robot};

use super::assemble::{Way, assemble};
use super::config::TaskConfig;
use super::error::TaskError;
use super::figures::TaskFigures;
use super::route::Route;
use super::search::search;
use super::space::{Point, RESIDUAL, Space};
use crate::cost::{self, Effort};
use crate::motion::{jump, reconfigure};
use crate::plan::{Plan, Profile};
use crate::progress::{Progress, left_out};
use crate::timing::{Limits, accelerate};
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
    let arm = config.stance.bind(&robot.arm(&config.arm)?)?;
    let scene = scene.clone().in_the_way();
    let here = scene.transformed(&config.stance.pose().inverse());
    let (points, obstacles) = (here.points(), &here.obstacles);
    let world = World::new(robot, &arm, &config.tool, points, obstacles, &config.collision)?;
    if let Some(hit) = world.stance_hit() {
        return Err(TaskError::StanceHit { hit: hit.to_string() });
    }
    if let Some(q) = &config.start {
        starts(&arm, &world, q)?;
    }
    let space = Space::new(&arm, &world, &config.tool, &config.tolerance);
    let (mut route, unmet) = search(space, poses, config, progress)?;
    if !unmet.is_empty() {
        progress.note(&left_out(["pose", "poses"], &unmet, "no joint vector meets it"));
    }
    let cell = Workcell { arm: &arm, tool: &config.tool, world: &world };
    let Some(way) = connect(&space, cell, &mut route, config, progress) else {
        return Err(TaskError::NoWay { met: poses.len() - unmet.len() });
    };
    let mut plan = assemble(robot, &arm, poses, &route, &way, config);
    if config.profile == Profile::Acceleration {
        progress.stage("timing", None);
        let at_rest: Vec<usize> =
            (0..plan.knots.len()).filter(|&k| plan.knots[k].patch.is_some()).collect();
        plan = accelerate(&plan, cell, &Limits::of(&arm, config.v_max), &at_rest);
    }
    let calc_time_s = started.elapsed().as_secs_f64();

    progress.stage("verify", Some(plan.knots.len()));
    let started = Instant::now();
    let given = Given { robot, arm: &config.arm, scene: &scene, collision: &config.collision };
    let verification = verify(&plan, given, &|| progress.tick())?;
    let joints: Vec<JointVector> = plan.knots.iter().map(|k| k.q).collect();
    let straight: Vec<(&Point, &Point)> = pairs(&route)
        .zip(&way.edges)
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
        reconfigurations: way.edges.iter().flatten().count(),
        effort_rad: cost::of_path(&Effort, &joints),
        task_time_s: plan.duration(),
        excess_max: route.order.iter().map(excess).fold(0.0, f64::max),
        edge_deviation_p90_m: off.get(off.len() * 9 / 10).copied().unwrap_or(0.0),
        edge_deviation_max_m: off.last().copied().unwrap_or(0.0),
        violations: verification.violations.len(),
        against: verification.against.clone(),
        calc_time_s,
        verify_time_s: started.elapsed().as_secs_f64(),
        notes: world.notes().to_vec(),
    };
    Ok(TaskOutcome { plan, figures, verification })
}

fn pairs(route: &Route) -> impl Iterator<Item = (&Point, &Point)> {
    route.order.windows(2).map(|w| (&route.points[w[0]], &route.points[w[1]]))
}

/// Whether the arm can be at a joint vector.
fn starts(arm: &Arm, world: &World, q: &JointVector) -> Result<(), TaskError> {
    let limits = arm.margined_limits().iter().zip(q.iter()).zip(arm.joint_names());
    let outside = |((low, high), q): (&(f64, f64), &f64)| !(*low..=*high).contains(q);
    let why = limits.into_iter().find_map(|((limit, q), name)| {
        let (low, high) = limit;
        outside((limit, q))
            .then(|| format!("{name} is at {q:.4}, its range is {low:.4} to {high:.4}"))
    });
    let hit = || world.why_not(q, ToolContact::Allowed).map(|hit| hit.to_string());
    why.or_else(hit).map_or(Ok(()), |why| Err(TaskError::Start { why }))
}

/// The way from the start to the first pose, and for each edge of the route the way through free
/// space, where it is a reconfiguration or collides. A pose that none leads to is taken out of the
/// route; `None` where that is all of them.
fn connect(
    space: &Space<'_>,
    cell: Workcell<'_>,
    route: &mut Route,
    config: &TaskConfig,
    progress: &dyn Progress,
) -> Option<Way> {
    let seed = config.seed;
    let mut order: Vec<usize> = Vec::new();
    let mut way = Way { approach: None, edges: Vec::new() };
    for &pose in &route.order {
        let b = &route.points[pose];
        let Some(&last) = order.last() else {
            if let Some(start) = &config.start {
                way.approach = jump(cell, start, &b.q, seed);
                if way.approach.is_none() {
                    progress.note(&format!(
                        "pose {pose} is left out: no motion through free space was found from the start"
                    ));
                    continue;
                }
            }
            order.push(pose);
            continue;
        };
        let a = &route.points[last];
        let goes_straight = !space.is_reconfiguration(a, b)
            && space.world.motion_free(&a.q, &b.q, ToolContact::Allowed);
        if goes_straight {
            way.edges.push(None);
        } else if let Some(path) = reconfigure(cell, &a.q, &b.q, seed) {
            way.edges.push(Some(path));
        } else {
            progress.note(&format!(
                "pose {pose} is left out: no motion through free space was found from pose {last}"
            ));
            continue;
        }
        order.push(pose);
    }
    route.order = order;
    (!route.order.is_empty()).then_some(way)
}

/// Largest distance of the tool from the straight line along an edge. \[m\]
fn deviation(space: &Space<'_>, a: &Point, b: &Point) -> f64 {
    (1..16).map(|k| space.deviation_at(a, b, f64::from(k) / 16.0)).fold(0.0, f64::max)
}
