//! From a given path to a verified plan.

use std::time::Instant;

use nalgebra::Isometry3;
use nullsweep_robot::{JointVector, Robot};
use rayon::prelude::*;

use super::config::FollowConfig;
use super::error::FollowError;
use super::figures::FollowFigures;
use super::ladder::{Found, Part, search};
use super::problem::Problem;
use super::smooth::smooth;
use super::station::{Station, stations};
use crate::cost::{self, Effort};
use crate::plan::{Left, Plan};
use crate::poses::{self, Along, Piece, Point, Space, Standing, Stop, Unmet, by_reason, tell_left};
use crate::progress::Progress;
use crate::verify::{Given, Verification, verify};
use crate::workcell::{Scene, Workcell};

/// The plan and its figures.
#[derive(Clone, Debug)]
pub struct FollowOutcome {
    /// The plan; knots at poses carry the pose's index, counted over all segments, as their patch.
    pub plan: Plan,
    /// The figures.
    pub figures: FollowFigures,
    /// What verification found.
    pub verification: Verification,
}

/// Plans along the segments, given in the robot's root frame, in their order, in a scene in the floor
/// frame: all that was measured there is in the way, but for the tool's pad on the path and beside it.
/// Within a segment the tool goes straight from pose to pose; from segment to segment it is lifted off,
/// goes through free space and is set down.
///
/// # Errors
/// See [`FollowError`]. A plan that breaks a rule is no error: its verification says so; poses that are
/// not met are told to `progress`, with the reason.
pub fn run(
    robot: &Robot,
    segments: &[Vec<Isometry3<f64>>],
    scene: &Scene,
    config: &FollowConfig,
    progress: &dyn Progress,
) -> Result<FollowOutcome, FollowError> {
    let started = Instant::now();
    let setup = &config.setup;
    let Standing { arm, scene, world } = setup.stand(robot, scene)?;
    let poses = segments.concat();
    let cell = Workcell { arm: &arm, tool: &setup.tool, world: &world };
    let places = places(segments);
    let problem = Problem {
        space: Space::new(&arm, &world, &setup.tool, &setup.tolerance),
        cell,
        segments: &places,
        start: setup.start,
        step: config.step,
        seed: setup.seed,
    };
    progress.stage("ladder", None);
    let found = search(&problem);
    if found.parts.is_empty() {
        return Err(nothing(&problem.space, &poses));
    }
    progress.stage("smoothing", None);
    let pieces = smoothed(&problem, &found);
    let left = left(&problem.space, &poses, &pieces);
    tell_left(&left, progress);
    let given = poses::Given { robot, arm: &arm, setup, poses: &poses };
    progress.stage("timing", None);
    let plan = poses::assemble(given, &pieces);
    let stops = ends(&plan);
    let regions = scene.regions.marks(&[]);
    let plan = Plan { left, regions, ..setup.speed.set(plan, cell, &stops) };
    let calc_time_s = started.elapsed().as_secs_f64();

    progress.stage("verify", Some(plan.knots.len()));
    let started = Instant::now();
    let given = Given { robot, arm: &setup.arm, scene: &scene, collision: &setup.collision };
    let verification = verify(&plan, given, &|| progress.tick())?;
    let figures = FollowFigures {
        segments: segments.len(),
        calc_time_s,
        verify_time_s: started.elapsed().as_secs_f64(),
        violations: verification.violations.len(),
        against: verification.against.clone(),
        notes: world.notes().to_vec(),
        ..figures(&problem.space, &poses, &found, &pieces, &plan)
    };
    Ok(FollowOutcome { plan, figures, verification })
}

/// The knots where the tool comes onto the path or leaves it: there the arm rests, so that no blend cuts
/// their poses off.
fn ends(plan: &Plan) -> Vec<usize> {
    let on_path = |k: Option<usize>| k.and_then(|k| plan.line(k)).is_some();
    let is_end =
        |&k: &usize| on_path(Some(k)) && !(on_path(k.checked_sub(1)) && on_path(Some(k + 1)));
    (0..plan.knots.len()).filter(is_end).collect()
}

/// The places of all segments.
fn places(segments: &[Vec<Isometry3<f64>>]) -> Vec<Vec<Station>> {
    let mut first = 0;
    let of = |segment: &Vec<Isometry3<f64>>| {
        let places = stations(segment, first);
        first += segment.len();
        places
    };
    segments.iter().map(of).collect()
}

/// Why there is nothing to be followed.
fn nothing(space: &Space<'_>, poses: &[Isometry3<f64>]) -> FollowError {
    let whys: Vec<Result<Point, Unmet>> = poses.par_iter().map(|pose| space.meet(pose)).collect();
    let met = whys.iter().filter(|why| why.is_ok()).count();
    match whys.into_iter().find_map(Result::err) {
        Some(why) if met == 0 => {
            FollowError::NothingMet { poses: poses.len(), why: why.to_string() }
        }
        _ => FollowError::NoWay { met },
    }
}

/// The parts, smoothed, with what has to be put in so that the tool goes straight.
fn smoothed(problem: &Problem<'_>, found: &Found) -> Vec<Piece> {
    let is_run = |k: Option<usize>| {
        k.and_then(|k| found.parts.get(k)).is_none_or(|part| matches!(part, Part::Run(_)))
    };
    let piece = |(k, part): (usize, &Part)| match part {
        Part::Way { path, .. } => Piece::Through(path.clone()),
        Part::Run(run) => {
            let mut run = run.clone();
            smooth(problem, &mut run, [!is_run(k.checked_sub(1)), !is_run(Some(k + 1))]);
            Piece::Along(dense(problem, &run))
        }
    };
    found.parts.par_iter().enumerate().map(piece).collect()
}

/// A run with what is put in between its places.
fn dense(problem: &Problem<'_>, run: &[(Station, Point)]) -> Vec<Stop> {
    let mut stops: Vec<Stop> = Vec::with_capacity(run.len());
    for (k, (station, point)) in run.iter().enumerate() {
        if let Some((_, before)) = k.checked_sub(1).map(|b| &run[b]) {
            let between = problem.space.between(before, point).unwrap_or_default();
            stops.extend(between.into_iter().map(|point| Stop { point, pose: None }));
        }
        stops.push(Stop { point: *point, pose: station.given });
    }
    stops
}

/// The poses that are left out, by cause.
fn left(space: &Space<'_>, poses: &[Isometry3<f64>], pieces: &[Piece]) -> Vec<Left> {
    let mut met = vec![false; poses.len()];
    for piece in pieces {
        let Piece::Along(stops) = piece else { continue };
        stops.iter().filter_map(|stop| stop.pose).for_each(|pose| met[pose] = true);
    }
    let open: Vec<usize> = (0..poses.len()).filter(|&k| !met[k]).collect();
    let whys: Vec<(usize, Result<Point, Unmet>)> =
        open.par_iter().map(|&pose| (pose, space.meet(&poses[pose]))).collect();
    let (mut unmet, mut apart) = (Vec::new(), Vec::new());
    for (pose, why) in whys {
        match why {
            Err(why) => unmet.push((pose, why)),
            Ok(_) => apart.push(pose as u32),
        }
    }
    let mut left = by_reason(&unmet);
    if !apart.is_empty() {
        left.push(Left { cause: NO_WAY.into(), points: apart });
    }
    left
}

const NO_WAY: &str = "the arm meets it, but no way was found to follow the path there, nor a motion through \
                      free space to there";

fn figures(
    space: &Space<'_>,
    poses: &[Isometry3<f64>],
    found: &Found,
    pieces: &[Piece],
    plan: &Plan,
) -> FollowFigures {
    let along = Along::of(space, poses, pieces);
    let joints: Vec<JointVector> = plan.knots.iter().map(|k| k.q).collect();
    let reconfigures = |part: &&Part| matches!(part, Part::Way { reconfigures: true, .. });
    let mut figures = FollowFigures {
        poses: poses.len(),
        met: along.met,
        reconfigurations: found.parts.iter().filter(reconfigures).count(),
        transfers: along.ways,
        movement_rad: along.movement,
        sampled_rad: found.cost.1,
        layers: found.layers,
        samples: found.samples,
        effort_rad: cost::of_path(&Effort, &joints),
        task_time_s: plan.duration(),
        edge_deviation_p90_m: along.deviation_p90,
        edge_deviation_max_m: along.deviation_max,
        step_max_rad: along.step[0],
        step_max_m: along.step[1],
        ..FollowFigures::default()
    };
    let errors: Vec<(f64, f64)> = (0..plan.knots.len())
        .into_par_iter()
        .filter_map(|k| {
            let pose = plan.knots[k].patch.and_then(|pose| poses.get(pose as usize))?;
            Some(passed(space, pose, plan, k))
        })
        .collect();
    figures.position_error_max_m = errors.iter().map(|e| e.0).fold(0.0, f64::max);
    figures.angle_error_max_rad = errors.iter().map(|e| e.1).fold(0.0, f64::max);
    figures
}

/// Curves about a knot on which the tool may pass the knot's pose.
const ABOUT: usize = 3;
/// Looks on a curve, and how often about the best one again.
const LOOKS: i32 = 8;
const AGAIN: i32 = 4;

/// How near the motion passes a pose about a knot: place \[m\] and axes \[rad\], beyond the tolerance.
fn passed(space: &Space<'_>, pose: &Isometry3<f64>, plan: &Plan, knot: usize) -> (f64, f64) {
    let off = |q: JointVector| {
        let excess = space.excess(pose, &space.point(q).tool);
        (excess.fixed_rows::<3>(0).norm(), excess.fixed_rows::<3>(3).norm())
    };
    let nearer = |a: (f64, f64), b: (f64, f64)| if b.0 < a.0 { b } else { a };
    let curves = knot.saturating_sub(ABOUT).max(1)..(knot + ABOUT + 1).min(plan.knots.len());
    curves.fold(off(plan.knots[knot].q), |best, k| {
        let curve = plan.curve(k);
        let (mut middle, mut width, mut here) = (0.5, 0.5, (f64::INFINITY, f64::INFINITY));
        for _ in 0..AGAIN {
            let share = |i: i32| (middle + width * f64::from(i) / f64::from(LOOKS)).clamp(0.0, 1.0);
            let looks = (-LOOKS..=LOOKS).map(|i| (share(i), off(curve.at(share(i)))));
            let found = looks.reduce(|a, b| if b.1.0 < a.1.0 { b } else { a });
            let Some((at, error)) = found else { break };
            (middle, here) = (at, nearer(here, error));
            width /= f64::from(LOOKS);
        }
        nearer(best, here)
    })
}
