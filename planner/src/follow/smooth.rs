//! A path made shorter in the null space.

use nalgebra::{Cholesky, SMatrix, SVector};
use nullsweep_robot::{JointVector, MAX_DOF};
use rayon::prelude::*;

use super::problem::Problem;
use super::station::Station;
use crate::poses::Point;

type Square = SMatrix<f64, MAX_DOF, MAX_DOF>;
type Lanes = SVector<f64, MAX_DOF>;

/// Most rounds.
const ROUNDS: usize = 24;
/// A round that gains a smaller share than this ends them.
const GAIN: f64 = 1e-4;
/// Most that a joint moves in a round. \[rad\] or \[m\]
const STRIDE: f64 = 0.25;
/// Keeps the pull of a short edge, and a step along what nothing pulls, bounded.
const SHORTEST: f64 = 1e-3;
const STIFFNESS: f64 = 1e-3;
/// Shares of a step that are tried.
const SHARES: [f64; 3] = [1.0, 0.4, 0.1];

/// Moves the joint vectors of a run where that makes it shorter (reweighted Gauss–Newton steps on the
/// sum of its edges' lengths, in the null space of each pose), as far as they stay free of collision
/// and no joint jumps; ends that are `fixed` stay.
pub(super) fn smooth(problem: &Problem<'_>, run: &mut [(Station, Point)], fixed: [bool; 2]) {
    if run.len() < 2 {
        return;
    }
    let mut pinned = vec![false; run.len()];
    let ends = [0, run.len() - 1];
    let pin = |pinned: &mut Vec<bool>| {
        pinned.fill(false);
        ends.iter().zip(fixed).for_each(|(&end, fixed)| pinned[end] = fixed);
    };
    pin(&mut pinned);
    let mut fresh = true;
    for _ in 0..ROUNDS {
        let before = length(run);
        let step = descent(problem, run, &pinned);
        let better = SHARES.iter().find_map(|&share| {
            let (points, held) = moved(problem, run, &step, share)?;
            (chain_length(&points) < before * (1.0 - GAIN)).then_some((points, held))
        });
        match better {
            Some((points, held)) => {
                run.iter_mut().zip(points).for_each(|(at, point)| at.1 = point);
                pinned.iter_mut().zip(held).for_each(|(pinned, held)| *pinned |= held);
                fresh = false;
            }
            // What was held may go another way now.
            None if !fresh => {
                pin(&mut pinned);
                fresh = true;
            }
            None => return,
        }
    }
}

fn length(run: &[(Station, Point)]) -> f64 {
    run.windows(2).map(|w| w[0].1.q.distance(&w[1].1.q)).sum()
}

fn chain_length(points: &[Point]) -> f64 {
    points.windows(2).map(|w| w[0].q.distance(&w[1].q)).sum()
}

/// The step for each joint vector: a block tridiagonal system.
fn descent(problem: &Problem<'_>, run: &[(Station, Point)], pinned: &[bool]) -> Vec<JointVector> {
    let count = run.len();
    let projectors: Vec<Square> = run
        .par_iter()
        .zip(pinned)
        .map(|((station, point), pinned)| match pinned {
            true => Square::zeros(),
            false => problem.space.null_space(&station.pose, point),
        })
        .collect();
    let q: Vec<Lanes> = run.iter().map(|(_, point)| Lanes::from(*point.q)).collect();
    let pull: Vec<f64> = q.windows(2).map(|w| 1.0 / ((w[1] - w[0]).norm() + SHORTEST)).collect();
    // Forward: the blocks eliminated one after the other.
    let mut factors: Vec<(Cholesky<f64, nalgebra::Const<MAX_DOF>>, Lanes)> =
        Vec::with_capacity(count);
    for k in 0..count {
        let p = &projectors[k];
        let (mut weight, mut force) = (STIFFNESS, Lanes::zeros());
        if let Some(b) = k.checked_sub(1) {
            weight += pull[b];
            force += pull[b] * (q[b] - q[k]);
        }
        if k + 1 < count {
            weight += pull[k];
            force += pull[k] * (q[k + 1] - q[k]);
        }
        let mut block = p * weight + (Square::identity() - p);
        let mut right = p * force;
        if let Some(b) = k.checked_sub(1) {
            let (factor, known) = &factors[b];
            let coupling = p * projectors[b] * pull[b];
            block -= coupling * factor.solve(&coupling.transpose());
            right += coupling * factor.solve(known);
        }
        let symmetric = (block + block.transpose()) * 0.5;
        let Some(factor) = symmetric.cholesky() else {
            return vec![JointVector::ZERO; count];
        };
        factors.push((factor, right));
    }
    let mut steps = vec![Lanes::zeros(); count];
    for k in (0..count).rev() {
        let (factor, right) = &factors[k];
        let mut right = *right;
        if k + 1 < count {
            right += projectors[k] * projectors[k + 1] * steps[k + 1] * pull[k];
        }
        steps[k] = factor.solve(&right);
    }
    let largest = steps.iter().map(|step| step.amax()).fold(0.0, f64::max);
    let scale = (STRIDE / largest).min(1.0);
    let lanes = |(p, step): (&Square, Lanes)| JointVector::new((p * step * scale).into());
    projectors.iter().zip(steps).map(lanes).collect()
}

/// The joint vectors a share of the step further, those where they were that would collide or jump;
/// and which those are. `None` where all are.
fn moved(
    problem: &Problem<'_>,
    run: &[(Station, Point)],
    step: &[JointVector],
    share: f64,
) -> Option<(Vec<Point>, Vec<bool>)> {
    let moves = |q: &JointVector| *q != JointVector::ZERO;
    let mut held: Vec<bool> = step.iter().map(|step| !moves(step)).collect();
    let new: Vec<Option<Point>> = run
        .par_iter()
        .zip(step)
        .map(|((station, point), step)| {
            let q = JointVector::from_fn(|j| point.q[j] + share * step[j]);
            problem.space.project(&station.pose, &q)
        })
        .collect();
    let mut points: Vec<Point> = run.iter().map(|(_, point)| *point).collect();
    for (k, new) in new.into_iter().enumerate() {
        match new {
            Some(new) if !held[k] => points[k] = new,
            _ => held[k] = true,
        }
    }
    if chain_length(&points) >= length(run) {
        return None;
    }
    let mut open: Vec<usize> = (0..points.len() - 1).collect();
    loop {
        let bad: Vec<usize> = open
            .par_iter()
            .copied()
            .filter(|&k| {
                !(held[k] && held[k + 1]) && problem.step(&points[k], &points[k + 1]).is_none()
            })
            .collect();
        if bad.is_empty() {
            break;
        }
        let mut again = Vec::new();
        for k in bad.into_iter().flat_map(|k| [k, k + 1]) {
            if !held[k] {
                held[k] = true;
                points[k] = run[k].1;
                again.extend([k.checked_sub(1), Some(k)].into_iter().flatten());
            }
        }
        again.retain(|&k| k + 1 < points.len());
        again.sort_unstable();
        again.dedup();
        open = again;
    }
    (!held.iter().all(|held| *held)).then_some((points, held))
}
