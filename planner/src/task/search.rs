//! The search for the order of the poses and the joint vector at each.
//!
//! 1. *Charts*: from a joint vector at one pose, all other poses are reached one after the other,
//!    each from its nearest neighbour's joint vector by the projection of least norm. A chart is
//!    smooth, so a way through it is short; there are as many as there are postures.
//! 2. The order and the choice among the best charts' joint vectors is a generalised travelling
//!    salesman.
//! 3. The route is relaxed over the tolerance, poses are moved to better places, and what each
//!    pose would be if it was visited from its neighbours' joint vectors enters the next round, for as
//!    long as a round gains anything.

use std::f64::consts::PI;

use nalgebra::{Isometry3, Vector3};
use nullsweep_gtsp::{self as gtsp, Block, Budget, Costs, Ends, Instance, Jump};
use nullsweep_robot::JointVector;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::config::TaskConfig;
use super::error::TaskError;
use super::route::{PENALTY, Route, Task, Unsettled};
use crate::poses::{Point, Space, Unmet};
use crate::progress::Progress;

/// Poses from which charts grow.
const ROOT_POSES: usize = 6;
/// Random joint vectors projected onto each of them.
const SEEDS: usize = 80;
/// Roots of one pose.
const ROOTS: usize = 8;
/// Neighbours from which a chart tries to reach a pose.
const REACHED_FROM: usize = 6;
/// Charts whose joint vectors enter the first round.
const CHARTS: usize = 6;
/// Another chart's joint vectors enter too where it reaches this part of the poses that no better one
/// does, one over it, or a single pose where they are few.
const COMPLEMENT: usize = 500;
/// Charts that grow from poses that no other reaches.
const GROWN: usize = 24;
/// Most joint vectors of a pose in a round.
const CHOICES: usize = 10;
/// Joint vectors nearer than this are one. \[rad\]
const SAME: f64 = 0.02;
/// Neighbouring poses that edges of the travelling salesman lead to.
const ADJACENT: usize = 14;
/// Neighbours in a pose's list.
const NEIGHBOURS: usize = 24;
/// Sweeps of a relaxation.
const SWEEPS: usize = 60;
/// An axis half a turn away is as far as a position at this distance. \[m\]
const AXIS_WEIGHT: f64 = 0.3;

/// The best route found; poses that no joint vector meets are left out and listed.
pub(super) fn search(
    space: Space<'_>,
    poses: &[Isometry3<f64>],
    config: &TaskConfig,
    progress: &dyn Progress,
) -> Result<(Route, Vec<(usize, Unmet)>), TaskError> {
    let task = Task { space, poses, near: neighbours(poses) };
    progress.stage("charts", None);
    let roots = roots(&task, config.setup.seed);
    let mut charts: Vec<(usize, f64, Chart)> = roots
        .par_iter()
        .map(|&(pose, root)| {
            let chart = chart(&task, pose, root);
            let missing = chart.iter().filter(|p| p.is_none()).count();
            (missing, spread(&task, &chart), chart)
        })
        .collect();
    charts.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut choices: Vec<Vec<Point>> = vec![Vec::new(); poses.len()];
    for chart in chosen(charts) {
        add(&mut choices, &chart);
    }
    let unmet = rescue(&task, &mut choices);
    if unmet.len() == poses.len() {
        return Err(TaskError::NothingMet { poses: poses.len() });
    }

    progress.stage("order", Some(config.rounds));
    let mut best: Option<(f64, Route)> = None;
    for round in 0..config.rounds {
        let seed = config.setup.seed.wrapping_add(round as u64);
        let mut route = order(&task, &choices, config.trials, seed)?;
        settle(&task, &mut route);
        let cost = task.cost(&route);
        progress.tick();
        if best.as_ref().is_some_and(|(least, _)| cost >= *least) {
            break;
        }
        choices = enrich(&task, &route);
        best = Some((cost, route));
    }
    let (_, route) = best.ok_or(TaskError::NothingMet { poses: poses.len() })?;
    Ok((route, unmet))
}

/// For each pose the joint vector that a chart has for it.
type Chart = Vec<Option<Point>>;

/// The best charts, in order, and of the others those that reach what no better one does.
fn chosen(charts: Vec<(usize, f64, Chart)>) -> Vec<Chart> {
    let count = charts.first().map_or(0, |(_, _, chart)| chart.len());
    let mut reached = vec![false; count];
    let mut chosen = Vec::new();
    for (rank, (_, _, chart)) in charts.into_iter().enumerate() {
        let new = chart.iter().zip(&reached).filter(|(p, reached)| p.is_some() && !**reached);
        let new = new.count();
        if rank < CHARTS || new >= (count / COMPLEMENT).max(1) {
            reached.iter_mut().zip(&chart).for_each(|(reached, p)| *reached |= p.is_some());
            chosen.push(chart);
        }
    }
    chosen
}

fn add(choices: &mut [Vec<Point>], chart: &[Option<Point>]) {
    for (choices, point) in choices.iter_mut().zip(chart) {
        choices.extend(point.filter(|p| is_new(choices, p)));
    }
}

/// What no chart reaches is looked for over all postures, and charts grow from what is found; the rest
/// is not met, and why.
fn rescue(task: &Task<'_>, choices: &mut [Vec<Point>]) -> Vec<(usize, Unmet)> {
    let open: Vec<usize> = (0..choices.len()).filter(|&k| choices[k].is_empty()).collect();
    let found: Vec<(usize, Result<Point, Unmet>)> =
        open.into_par_iter().map(|pose| (pose, task.space.meet(&task.poses[pose]))).collect();
    let mut unmet = Vec::new();
    let mut grown = 0;
    for (pose, found) in found {
        match found {
            Err(why) => unmet.push((pose, why)),
            Ok(_) if !choices[pose].is_empty() => {}
            Ok(point) if grown < GROWN => {
                grown += 1;
                add(choices, &chart(task, pose, point));
            }
            Ok(point) => choices[pose].push(point),
        }
    }
    unmet
}

/// Relaxes the route and moves poses until neither gains.
fn settle(task: &Task<'_>, route: &mut Route) {
    let mut open = Unsettled::all(task.poses.len());
    for _ in 0..12 {
        task.relax(route, &mut open, SWEEPS);
        if task.reinsert(route, &mut open) < 1e-3 {
            break;
        }
    }
    task.relax(route, &mut open, 4 * SWEEPS);
}

/// For each pose the others, nearest first.
fn neighbours(poses: &[Isometry3<f64>]) -> Vec<Vec<usize>> {
    let axes: Vec<Vector3<f64>> = poses.iter().map(|p| p.rotation * Vector3::z()).collect();
    let apart = |a: usize, b: usize| {
        let shift = poses[a].translation.vector - poses[b].translation.vector;
        shift.norm() + AXIS_WEIGHT / PI * axes[a].angle(&axes[b])
    };
    (0..poses.len())
        .into_par_iter()
        .map(|a| {
            let mut others: Vec<(f64, usize)> =
                (0..poses.len()).filter(|&b| b != a).map(|b| (apart(a, b), b)).collect();
            let nearer =
                |x: &(f64, usize), y: &(f64, usize)| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1));
            if others.len() > NEIGHBOURS {
                others.select_nth_unstable_by(NEIGHBOURS, nearer);
                others.truncate(NEIGHBOURS);
            }
            others.sort_by(nearer);
            // A list of its own: `into_iter` would keep the room for all poses.
            others.iter().map(|&(_, b)| b).collect()
        })
        .collect()
}

/// Joint vectors from which charts grow: random ones projected onto poses spread over the list.
fn roots(task: &Task<'_>, seed: u64) -> Vec<(usize, Point)> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let arm = task.space.arm;
    let seeds: Vec<JointVector> = (0..SEEDS)
        .map(|_| {
            let mut q = JointVector::default();
            for (q, &(low, high)) in q.iter_mut().zip(arm.margined_limits()) {
                let bounded = low.is_finite() && high.is_finite();
                let (low, high) = if bounded { (low, high) } else { (-PI, PI) };
                // Half a turn either way from the middle holds every posture.
                let middle = 0.5 * (low + high);
                *q = rng.random_range(low.max(middle - PI)..=high.min(middle + PI));
            }
            q
        })
        .collect();
    let count = task.poses.len();
    let roots = ROOT_POSES.min(count);
    (0..roots)
        .into_par_iter()
        .flat_map_iter(|k| {
            let pose = k * count / roots;
            let mut found: Vec<Point> = Vec::new();
            for q in &seeds {
                if let Some(point) = task.space.project_free(&task.poses[pose], q)
                    && found.iter().all(|f| f.q.distance(&point.q) > 0.5)
                    && found.len() < ROOTS
                {
                    found.push(point);
                }
            }
            found.into_iter().map(move |point| (pose, point))
        })
        .collect()
}

/// The poses reached from one, each from the joint vector of a neighbour that was reached before.
fn chart(task: &Task<'_>, root: usize, point: Point) -> Chart {
    let mut chart: Chart = vec![None; task.poses.len()];
    let mut tries = vec![0; task.poses.len()];
    chart[root] = Some(point);
    let mut open = std::collections::VecDeque::from([root]);
    while let Some(from) = open.pop_front() {
        let Some(at) = chart[from] else { continue };
        for &to in &task.near[from] {
            if chart[to].is_some() || tries[to] >= REACHED_FROM {
                continue;
            }
            tries[to] += 1;
            chart[to] = task.space.project_free(&task.poses[to], &at.q);
            if chart[to].is_some() {
                open.push_back(to);
            }
        }
    }
    chart
}

/// How far neighbours in a chart are from each other: half of the sum of each pose's two nearest,
/// which is about the length of the way through it. \[rad\]
fn spread(task: &Task<'_>, chart: &[Option<Point>]) -> f64 {
    let mut sum = 0.0;
    for (pose, point) in chart.iter().enumerate() {
        let Some(point) = point else { continue };
        let mut nearest = [PENALTY; 2];
        for other in task.near[pose].iter().filter_map(|&k| chart[k]) {
            let d = task.edge(point, &other);
            if d < nearest[1] {
                nearest = if d < nearest[0] { [d, nearest[0]] } else { [nearest[0], d] };
            }
        }
        sum += 0.5 * (nearest[0] + nearest[1]);
    }
    sum
}

fn is_new(known: &[Point], point: &Point) -> bool {
    known.len() < CHOICES && known.iter().all(|k| k.q.distance(&point.q) > SAME)
}

/// The order of the poses and the choice at each, by the travelling salesman.
fn order(
    task: &Task<'_>,
    choices: &[Vec<Point>],
    trials_per_pose: u64,
    seed: u64,
) -> Result<Route, TaskError> {
    let visited: Vec<usize> = (0..choices.len()).filter(|&k| !choices[k].is_empty()).collect();
    let mut cluster = vec![usize::MAX; choices.len()];
    for (k, &pose) in visited.iter().enumerate() {
        cluster[pose] = k;
    }
    let mut pairs: Vec<(usize, usize)> = visited
        .iter()
        .flat_map(|&a| task.near[a].iter().take(ADJACENT).map(move |&b| (a.min(b), a.max(b))))
        .filter(|&(a, b)| cluster[a] != usize::MAX && cluster[b] != usize::MAX)
        .collect();
    pairs.sort_unstable();
    pairs.dedup();
    let blocks: Vec<Block> = pairs
        .into_par_iter()
        .flat_map_iter(|(a, b)| {
            let costs: Vec<f64> = choices[a]
                .iter()
                .flat_map(|p| choices[b].iter().map(move |q| (p, q)))
                .map(|(p, q)| match task.space.is_reconfiguration(p, q) {
                    true => f64::INFINITY,
                    false => p.q.distance(&q.q),
                })
                .collect();
            Block::both_ways(cluster[a], cluster[b], choices[a].len(), costs)
        })
        .collect();
    let sizes: Vec<usize> = visited.iter().map(|&k| choices[k].len()).collect();
    let free_start = Ends::OpenFromCosts(vec![0.0; sizes.iter().sum()]);
    let instance =
        Instance::new(&sizes, Costs::Blocks(blocks), Jump::Uniform(PENALTY), free_start)?;
    let budget = Budget::trials(trials_per_pose * visited.len() as u64);
    let tour = gtsp::solve(&instance, &budget, seed)?.tour;
    let mut points: Vec<Point> = choices
        .iter()
        .map(|c| c.first().copied().unwrap_or(task.space.point(JointVector::new([0.0; 8]))))
        .collect();
    let order: Vec<usize> = tour.clusters.iter().map(|&k| visited[k]).collect();
    for (&pose, &node) in order.iter().zip(&tour.nodes) {
        points[pose] = choices[pose][node];
    }
    Ok(Route { order, points })
}

/// For each pose its joint vector on the route, and those by which it would be met from the joint
/// vectors of its neighbours.
fn enrich(task: &Task<'_>, route: &Route) -> Vec<Vec<Point>> {
    let mut visited = vec![false; task.poses.len()];
    for &pose in &route.order {
        visited[pose] = true;
    }
    (0..task.poses.len())
        .into_par_iter()
        .map(|pose| {
            if !visited[pose] {
                return Vec::new();
            }
            let mut choices = vec![route.points[pose]];
            for &other in task.near[pose].iter().filter(|&&k| visited[k]) {
                if choices.len() >= CHOICES {
                    break;
                }
                let from = &route.points[other].q;
                if let Some(point) = task.space.project_free(&task.poses[pose], from)
                    && is_new(&choices, &point)
                {
                    choices.push(point);
                }
            }
            choices
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_of_neighbours_keeps_no_room_for_all_poses() {
        let poses: Vec<Isometry3<f64>> =
            (0..500).map(|k| Isometry3::translation(1.01f64.powi(k), 0.0, 0.0)).collect();
        let lists = neighbours(&poses);
        assert_eq!(lists[7][..4], [6, 8, 5, 9]);
        assert!(lists.iter().all(|list| list.capacity() < 2 * NEIGHBOURS));
    }
}
