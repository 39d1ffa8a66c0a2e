//! Planning through given tool poses instead of a scan: in which order, and with which joint
//! vectors, the arm meets every pose within its tolerance with the least joint movement.
//!
//! The order is free and the path open, as in Wang and Gleicher's arm-coverage planner (ICRA
//! 2025), whose measures [`Figures`] holds beside ours.

mod read;
mod route;
mod search;
mod space;

pub use read::{PosesError, Tolerance, read};

use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};
use nullsweep_robot::{Arm, ArmError, ArmSpec, JointVector, Robot};
use serde::Serialize;
use std::time::Instant;

use crate::cost::{self, Effort};
use crate::motion::transfer;
use crate::plan::{CostKind, Method, Profile};
use crate::plan::{FORMAT, Held, Plan, PlanKnot, SurfaceSample};
use crate::progress::Progress;
use crate::timing;
use crate::verify::{self, Verification};
use nullsweep_collision::{self as collision, CollisionError, Obstacle, ToolContact, World};
use nullsweep_gtsp::{InstanceError, SolveError};
use nullsweep_robot::Tool;
use nullsweep_surface::scan::Scan;
use nullsweep_surface::sheet::Surface;
use route::Route;
use space::{Point, RESIDUAL, Space};

/// What is to be planned.
#[derive(Clone, Debug)]
pub struct TaskConfig {
    /// Base and tip link of the arm.
    pub arm: ArmSpec,
    /// The tool; its contact frame is what meets the poses.
    pub tool: Tool,
    /// How near is met.
    pub tolerance: Tolerance,
    /// Positions of joints outside the arm. \[rad\] or \[m\]
    pub held: Vec<(String, f64)>,
    /// Solid things, in the robot's root frame.
    pub obstacles: Vec<Obstacle>,
    /// Collision margins and meshes.
    pub collision: collision::Options,
    /// One velocity for all joints; `None`: the robot's limits. \[rad/s\]
    pub v_max: Option<f64>,
    /// Rounds of order and relaxation.
    pub rounds: usize,
    /// Trials of the order's search for each pose in each round.
    pub trials: u64,
    /// Seed of every random choice.
    pub seed: u64,
}

/// A tool for poses that speak of the tip frame itself: a cube of 1 cm behind its origin, z ahead.
#[must_use]
pub fn tip_tool() -> Tool {
    Tool {
        name: "tip".into(),
        length: 0.01,
        width: 0.01,
        thickness: 0.01,
        centre: [0.0; 3],
        approach: [0.0, 0.0, 1.0],
        across: [0.0, 1.0, 0.0],
        symmetric: false,
        ..Tool::default()
    }
}

/// Every figure of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Figures {
    /// Poses of the task.
    pub poses: usize,
    /// Poses that the plan meets.
    pub met: usize,
    /// Euclidean joint movement over all edges that are no reconfiguration: the measure of Wang
    /// and Gleicher. \[rad\]
    pub movement_rad: f64,
    /// Edges that are reconfigurations: a joint moves more than 1 rad, the tool more than 0.2 m or
    /// 0.5 rad, or the middle of the straight joint motion leaves the tool's line by more than
    /// 0.1 m; or that collide and go through free space.
    pub reconfigurations: usize,
    /// Sum of all joints' movements, transfers included. \[rad\]
    pub effort_rad: f64,
    /// Duration of the plan. \[s\]
    pub task_time_s: f64,
    /// Farthest of any pose from being met, beyond its tolerance. \[m\] or \[rad\]
    pub excess_max: f64,
    /// How far the tool leaves the straight line between its places at two poses: 90th percentile
    /// over the edges' largest. \[m\]
    pub edge_deviation_p90_m: f64,
    /// The largest. \[m\]
    pub edge_deviation_max_m: f64,
    /// Rules that the plan breaks: limits, times, collisions.
    pub violations: usize,
    /// Calculation until the route was found, verification apart. \[s\]
    pub calc_time_s: f64,
    /// Verification. \[s\]
    pub verify_time_s: f64,
    /// What was made up for the collision check.
    pub notes: Vec<String>,
}

/// The plan and its figures.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The plan; knots at poses carry the pose's index as their patch.
    pub plan: Plan,
    /// The figures.
    pub figures: Figures,
    /// What verification found.
    pub verification: Verification,
}

/// Why there is no plan.
#[derive(Debug, thiserror::Error)]
pub enum TaskError {
    /// The arm cannot be used.
    #[error(transparent)]
    Arm(#[from] ArmError),
    /// Collisions cannot be checked.
    #[error(transparent)]
    Collision(#[from] CollisionError),
    /// No joint vector was found for any pose.
    #[error(
        "none of the {poses} poses is met by the arm inside its limits and free of collision: are \
         they in the robot's root frame, and is the tip link right?"
    )]
    NothingMet {
        /// How many there are.
        poses: usize,
    },
    /// No way through free space between two poses.
    #[error(
        "no motion through free space was found from pose {from} to pose {to}: try another --seed"
    )]
    NoTransfer {
        /// The pose before.
        from: usize,
        /// The pose after.
        to: usize,
    },
    /// The order's search.
    #[error(transparent)]
    Instance(#[from] InstanceError),
    /// The order's search.
    #[error(transparent)]
    Solve(#[from] SolveError),
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
) -> Result<Outcome, TaskError> {
    let started = Instant::now();
    let held: Vec<(&str, f64)> = config.held.iter().map(|(n, v)| (n.as_str(), *v)).collect();
    let arm = robot.arm(&config.arm)?.with_held(&held)?;
    let world = World::new(robot, &arm, &config.tool, &[], &config.obstacles, &config.collision)?;
    let space = Space::new(&arm, &world, &config.tool, &config.tolerance);
    let (route, unmet) = search::search(space, poses, config, progress)?;
    for pose in unmet {
        progress.note(&format!("pose {pose} is left out: no joint vector meets it"));
    }
    let edges = edges(&space, &route, config.seed)?;
    let plan = assemble(robot, &arm, poses, &route, &edges, config);
    let calc_time_s = started.elapsed().as_secs_f64();

    progress.stage("verify", Some(plan.knots.len()));
    let started = Instant::now();
    let scan = as_scan(poses);
    let surface = Surface::new(&scan);
    let tick = || progress.tick();
    let already = vec![false; poses.len()];
    let verification = verify::verify(&plan, &arm, &world, &scan, &surface, &already, &tick);
    let joints: Vec<JointVector> = plan.knots.iter().map(|k| k.q).collect();
    let straight: Vec<(&Point, &Point)> = pairs(&route)
        .zip(&edges)
        .filter(|(_, through)| through.is_none())
        .map(|(pair, _)| pair)
        .collect();
    let mut off: Vec<f64> = straight.iter().map(|(a, b)| deviation(&space, a, b)).collect();
    off.sort_by(f64::total_cmp);
    let excess = |&pose: &usize| space.excess(&poses[pose], &route.points[pose].tool).amax();
    let figures = Figures {
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
    Ok(Outcome { plan, figures, verification })
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
    let options = transfer::Options::default();
    pairs(route)
        .enumerate()
        .map(|(k, (a, b))| {
            if !space.is_reconfiguration(a, b)
                && space.world.motion_free(&a.q, &b.q, ToolContact::Allowed)
            {
                return Ok(None);
            }
            let path = transfer::plan(space.world, space.arm, &a.q, &b.q, &options, seed);
            let (from, to) = (route.order[k], route.order[k + 1]);
            path.map(Some).ok_or(TaskError::NoTransfer { from, to })
        })
        .collect()
}

/// Largest distance of the tool from the straight line along an edge. \[m\]
fn deviation(space: &Space<'_>, a: &Point, b: &Point) -> f64 {
    (1..16).map(|k| space.deviation_at(a, b, f64::from(k) / 16.0)).fold(0.0, f64::max)
}

fn assemble(
    robot: &Robot,
    arm: &Arm,
    poses: &[Isometry3<f64>],
    route: &Route,
    edges: &[Option<Vec<JointVector>>],
    config: &TaskConfig,
) -> Plan {
    let knot = |q, line, patch| PlanKnot { time_ns: 0, q, v: JointVector::default(), line, patch };
    let mut knots: Vec<PlanKnot> = Vec::new();
    for (k, &pose) in route.order.iter().enumerate() {
        let point = &route.points[pose];
        let through = k.checked_sub(1).and_then(|e| edges[e].as_ref());
        if let Some([_, between @ .., _]) = through.map(Vec::as_slice) {
            knots.extend(between.iter().map(|q| knot(*q, None, None)));
        }
        let at = point.tool.translation.vector;
        let line = Some([at.x, at.y, at.z]);
        knots.push(knot(point.q, line, Some(pose as u32)));
    }
    let velocity = cost::velocities(arm, config.v_max);
    let joints: Vec<JointVector> = knots.iter().map(|k| k.q).collect();
    for (knot, time) in knots.iter_mut().zip(timing::bang_bang(&joints, &velocity)) {
        knot.time_ns = time;
    }
    let scan = as_scan(poses);
    Plan {
        format: FORMAT,
        robot: robot.name().into(),
        fingerprint: arm.fingerprint(),
        joints: arm.joint_names().to_vec(),
        held: Held::all_of(arm),
        tool: config.tool.clone(),
        base: [0.0; 3],
        method: Method::Tsp,
        cost: CostKind::Effort,
        profile: Profile::Velocity,
        seed: config.seed,
        knots,
        patches: poses.iter().map(|p| p.translation.vector.into()).collect(),
        surface: (0..poses.len())
            .map(|i| SurfaceSample {
                point: scan.points[i].into(),
                normal: scan.normals[i].into_inner().into(),
                reachable: true,
            })
            .collect(),
        continues: None,
        past: Vec::new(),
    }
}

/// The poses' origins, their normals against the tool's axis.
fn as_scan(poses: &[Isometry3<f64>]) -> Scan {
    let points: Vec<Point3<f64>> =
        poses.iter().map(|p| Point3::from(p.translation.vector)).collect();
    let normals =
        poses.iter().map(|p| UnitVector3::new_normalize(p.rotation * -Vector3::z())).collect();
    Scan { raw: points.clone(), points, normals, spacing: 0.01 }
}
