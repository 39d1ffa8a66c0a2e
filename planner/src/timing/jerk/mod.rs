//! The fastest way along a path under limits of velocity, acceleration and jerk.
//!
//! Without a limit of jerk the fastest way is known ([`super::sampled`]). Averaged over a few
//! hundredths of a second it becomes a reference r(τ) whose third derivative is bounded, and what is
//! looked for is how fast to go through it: τ̇ = ω, b = ω² on an even grid of τ ([`pacing`]). The
//! pace found is gone along in even steps of time; the places there are the control points of a
//! cubic B-spline, which meets in position, velocity and acceleration, begins and ends at rest
//! without acceleration, and whose jerk between two knots is the control points' third difference
//! ([`spline`]): what the executor follows, exactly, from positions and velocities.

mod pacing;
mod reference;
mod spline;

use nullsweep_robot::JointVector;

use self::pacing::{Node, pace};
use self::reference::reference;
use self::spline::{Excess, Spline};
use super::Limits;
use super::sampled::{SpeedCap, Timed};

/// Time between two nodes of the reference, and at first between two knots; less where the run is
/// so short that there would be fewer than [`FINE`], but no less than the least. \[ns\]
const STEP_NS: u64 = 4_000_000;
const LEAST_NS: u64 = 1_000_000;
const FINE: u64 = 400;
/// Most knots that a run is given.
const MOST_KNOTS: u64 = 8000;
/// Rounds of giving less of the limits where the spline breaks them.
const ROUNDS: usize = 6;
/// By how much it may break them until it is slowed down as a whole instead.
const SLACK: f64 = 0.004;
/// Share of the limits that is planned with, so that whole nanoseconds break none.
const HEADROOM: f64 = 1.0 - 1e-5;

/// A run from rest to rest under limited acceleration becomes one under limited jerk too, from rest
/// to rest without acceleration at both ends. `jerk` holds each joint's. \[rad/s³\] or \[m/s³\]
/// `tool` gives how fast a place of the path may be gone through, from its source, position and
/// velocity: a factor on that velocity.
#[must_use]
pub(super) fn limited(
    run: &[Timed],
    limits: &Limits,
    jerk: &JointVector,
    tool: &SpeedCap<'_>,
) -> Vec<Timed> {
    let (Some(first), Some(last)) = (run.first(), run.last()) else { return Vec::new() };
    let span_ns = last.time_ns.saturating_sub(first.time_ns);
    if span_ns == 0 {
        return run.to_vec();
    }
    let step_ns = (span_ns / FINE).clamp(LEAST_NS, STEP_NS).max(span_ns / MOST_KNOTS);
    let step = step_ns as f64 * 1e-9;
    let reference = reference(run, step_ns);
    let mut nodes: Vec<Node> = reference
        .windows(5)
        .map(|w| {
            let q: [&JointVector; 5] = std::array::from_fn(|k| &w[k].q);
            let rate = Node::rates(q, step);
            let cap = tool(w[2].source, &w[2].q, &rate[0]);
            Node { rate, share: HEADROOM, cap: cap * cap }
        })
        .collect();
    let inner = &reference[2..reference.len() - 2];
    let mut best: Option<Spline> = None;
    for _ in 0..ROUNDS {
        let squared = pace(&nodes, step, limits, jerk);
        let made = Spline::along(inner, &squared, step, step_ns);
        let excess = made.excess(limits, jerk);
        let worst = excess.iter().map(|e| e.factor).fold(1.0, f64::max);
        let mut asked = vec![1.0f64; nodes.len()];
        let slowed = made.slowed(worst);
        if best.as_ref().is_none_or(|best| slowed.seconds() < best.seconds()) {
            best = Some(slowed);
        }
        if worst <= 1.0 + SLACK {
            break;
        }
        for Excess { from, to, factor } in excess {
            let around = (from as usize).saturating_sub(1)..(to as usize + 3).min(nodes.len());
            // Of the limits a jerk asks for the third power of what speed is given; a place is
            // given less once a round, by the most that any stretch around it asks for.
            for less in &mut asked[around] {
                *less = less.max(factor.powi(3));
            }
        }
        nodes.iter_mut().zip(&asked).for_each(|(node, less)| node.share /= less);
    }
    best.map_or_else(|| run.to_vec(), |spline| spline.knots(first.time_ns, inner))
}

#[cfg(test)]
mod tests;
