//! Smooth runs to knots with velocities, which cubic interpolation follows within the limits.

use nullsweep_robot::{JointVector, MAX_DOF};

use super::Limits;
use super::optimal::{Interval, squared_speeds};
use super::smooth_path::{Piece, SmoothPath};
use crate::plan::Curve;

/// A moment of the motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timed {
    /// Time since the start. \[ns\]
    pub time_ns: u64,
    /// \[rad\] or \[m\]
    pub q: JointVector,
    /// \[rad/s\] or \[m/s\]
    pub v: JointVector,
    /// Where it lies on the path that the run was made from, see [`Piece`].
    pub source: f64,
}

/// Grid points are at most this far apart. \[rad\]
const STEP: f64 = 0.02;
/// Grid intervals of a piece at whose end the arm rests: there speed changes most.
const INTERVALS_AT_REST: usize = 6;
/// Rounds of giving intervals less of their limits where the cubic between two knots breaks them.
const ROUNDS: usize = 6;
/// Taken off a share of the limits in addition, so that few rounds are needed.
const SURPLUS: f64 = 5e-4;
/// Share of the limits that is planned with, so that whole nanoseconds break none.
const HEADROOM: f64 = 1.0 - 2e-5;

/// Times the runs one after another, from 0 on, each from rest to rest.
///
/// Between two knots the joints follow the cubic through their positions and velocities, with
/// every velocity and acceleration within the limits.
#[must_use]
pub fn timed(runs: &[SmoothPath], limits: &Limits) -> Vec<Timed> {
    timed_within(runs, limits, &|_, _, _| f64::INFINITY)
}

/// How fast a place of a path may be gone through besides, from its source, position and velocity: a
/// factor on that velocity.
pub(super) type SpeedCap<'a> = dyn Fn(f64, &JointVector, &JointVector) -> f64 + Sync + 'a;

/// The same, no faster than `cap` lets it.
pub(super) fn timed_within(runs: &[SmoothPath], limits: &Limits, cap: &SpeedCap<'_>) -> Vec<Timed> {
    let mut knots: Vec<Timed> = Vec::new();
    for run in runs {
        let from = knots.last().map_or(0, |k| k.time_ns);
        // Rest is where every path can be left from.
        let own = run_knots(run, limits, cap, [HEADROOM, 0.0], from).unwrap_or_default();
        let again = usize::from(!knots.is_empty());
        knots.extend(own.into_iter().skip(again));
    }
    knots
}

/// A run that is under way at its start, with ṡ = 1, braked to rest with a share of the limits.
/// `None` where that does not go.
#[must_use]
pub(super) fn braked(run: &SmoothPath, limits: &Limits, share: f64) -> Option<Vec<Timed>> {
    run_knots(run, limits, &|_, _, _| f64::INFINITY, [share, 1.0], 0)
}

/// One grid interval with the piece that it is a part of.
pub(super) struct Cell {
    pub(super) piece: Piece,
    /// Which piece of the run.
    index: usize,
}

fn run_knots(
    run: &SmoothPath,
    limits: &Limits,
    cap: &SpeedCap<'_>,
    [share, start]: [f64; 2],
    from_ns: u64,
) -> Option<Vec<Timed>> {
    let cells = cells(run);
    let mut intervals = intervals(&cells, share, cap);
    for _ in 0..ROUNDS {
        let x = squared_speeds(&intervals, limits, start * start)?;
        let (knots, ends) = place(&cells, &x, from_ns);
        let mut worst = 1.0f64;
        for (pair, end) in knots.windows(2).zip(ends.windows(2)) {
            let excess = excess(&pair[0], &pair[1], limits);
            if excess > 1.0 {
                worst = worst.max(excess);
                // A neighbour's slowing down must not be what breaks the limit.
                let wide = end[0].saturating_sub(1)..(end[1] + 1).min(intervals.len());
                for interval in &mut intervals[wide] {
                    interval.share /= excess * excess * (1.0 + SURPLUS);
                }
            }
        }
        if worst <= 1.0 {
            return Some(knots);
        }
    }
    // What starts from rest can be slowed down as a whole.
    if start != 0.0 {
        return None;
    }
    let mut x = squared_speeds(&intervals, limits, 0.0)?;
    let mut slowed = place(&cells, &x, from_ns).0;
    for _ in 0..ROUNDS {
        let worst = slowed.windows(2).map(|w| excess(&w[0], &w[1], limits)).fold(0.0, f64::max);
        if worst <= 1.0 {
            break;
        }
        // Again and again, as whole nanoseconds fall elsewhere each time, which matters where two
        // knots are but a few of them apart.
        x.iter_mut().for_each(|x| *x /= (worst * (1.0 + SURPLUS)).powi(2));
        slowed = place(&cells, &x, from_ns).0;
    }
    Some(slowed)
}

/// What the cells ask of the speed along them, of which `share` of the limits may be used.
pub(super) fn intervals(cells: &[Cell], share: f64, cap: &SpeedCap<'_>) -> Vec<Interval> {
    let of = |Cell { piece, .. }: &Cell| Interval {
        length: piece.length,
        slope: piece.slope,
        bend: piece.bend,
        share,
        caps: [0.0, piece.length].map(|s| {
            let source = piece.source[usize::from(s > 0.0)];
            cap(source, &piece.at(s), &piece.slope_at(s)).powi(2)
        }),
    };
    cells.iter().map(of).collect()
}

/// The grid: every piece in equal parts.
pub(super) fn cells(run: &SmoothPath) -> Vec<Cell> {
    let mut cells = Vec::new();
    let last = run.pieces.len().saturating_sub(1);
    for (index, piece) in run.pieces.iter().enumerate() {
        let end = piece.slope_at(piece.length);
        let length = (0..MAX_DOF)
            .map(|j| piece.slope[j].abs().max(end[j].abs()) * piece.length)
            .fold(0.0, f64::max);
        let mut count = (length / STEP).ceil().max(1.0) as usize;
        if index == 0 || index == last {
            count = count.max(INTERVALS_AT_REST);
        }
        for k in 0..count {
            let share = |k: usize| k as f64 / count as f64;
            cells.push(Cell { piece: piece.part(share(k), share(k + 1)), index });
        }
    }
    cells
}

/// Knots at the grid points, and at which grid point each one is. Left out are grid points
/// through which one quadratic in time goes on.
fn place(cells: &[Cell], x: &[f64], from_ns: u64) -> (Vec<Timed>, Vec<usize>) {
    let count = cells.len();
    let mut knots: Vec<Timed> = Vec::with_capacity(count + 1);
    let mut ends = Vec::with_capacity(count + 1);
    let mut push = |knot: Timed, end: usize| {
        knots.push(knot);
        ends.push(end);
    };
    let along = |i: usize| (x[i + 1] - x[i]) / (2.0 * cells[i].piece.length);
    let mut time = 0.0f64;
    for i in 0..count {
        let piece = &cells[i].piece;
        if i == 0 || !goes_on(&cells[i - 1], &cells[i], along(i - 1), along(i), x[i]) {
            let time_ns = (time * 1e9).round();
            // Where the arm is at the whole nanosecond.
            let late = time_ns * 1e-9 - time;
            let (speed, u) = (x[i].sqrt(), along(i));
            let s = speed * late + 0.5 * u * late * late;
            let rate = speed + u * late;
            let knot = Timed {
                time_ns: from_ns.saturating_add(time_ns as u64),
                q: if i == 0 { piece.start } else { piece.at(s) },
                v: JointVector::new(piece.slope_at(s).map(|slope| slope * rate)),
                source: piece.source[0],
            };
            push(knot, i);
        }
        time += 2.0 * piece.length / (x[i].sqrt() + x[i + 1].sqrt());
    }
    if let Some(Cell { piece, .. }) = cells.last() {
        let end = Timed {
            time_ns: from_ns.saturating_add((time * 1e9).ceil() as u64),
            q: piece.at(piece.length),
            v: JointVector::ZERO,
            source: piece.source[1],
        };
        push(end, count);
    }
    (knots, ends)
}

/// Whether a grid point within a piece has the same quadratic in time on both sides.
fn goes_on(a: &Cell, b: &Cell, before: f64, after: f64, x: f64) -> bool {
    if a.index != b.index {
        return false;
    }
    let straight = a.piece.bend == JointVector::ZERO;
    // An s̈ this small changes ṡ by nothing within a step.
    let still = |u: f64| u.abs() * a.piece.length < 1e-12 * x;
    let same = (before - after).abs() <= 1e-9 * before.abs().max(after.abs());
    (straight && same) || (still(before) && still(after))
}

/// By how much the cubic between two knots exceeds the limits: a factor on speed.
fn excess(a: &Timed, b: &Timed, limits: &Limits) -> f64 {
    let curve =
        Curve::cubic((&a.q, &a.v), (&b.q, &b.v), b.time_ns.saturating_sub(a.time_ns) as f64 * 1e-9);
    let mut most = 0.0f64;
    for j in 0..MAX_DOF {
        if limits.velocity[j] > 0.0 {
            most = most.max(curve.top_speed(j) / limits.velocity[j]);
            most = most.max((curve.top_acceleration(j) / limits.acceleration[j]).sqrt());
        }
    }
    most
}
