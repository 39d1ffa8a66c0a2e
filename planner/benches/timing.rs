//! What timing a path of 10,000 knots takes, beside bang-bang velocity on the same path.

use std::hint::black_box;

use nullsweep_planner::timing::{Limits, bang_bang, smooth, timed};
use nullsweep_robot::{ArmSpec, JointVector, Robot, Side};

fn main() {
    divan::main();
}

const KNOTS: usize = 10_000;

/// Seven joints on waves of their own about the home posture, a step of 0.03 rad a knot, and a
/// corner every hundred knots.
fn path() -> (Vec<JointVector>, Limits) {
    let arm = Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).expect("the PR2 has a right arm");
    let home = arm.home();
    let points = (0..KNOTS)
        .map(|k| {
            let mut q = home;
            for (j, value) in q.iter_mut().take(arm.dof()).enumerate() {
                let phase = 0.05 * k as f64 / (1.0 + 0.3 * j as f64);
                let corner = (k as f64 / 100.0).fract() - 0.5;
                *value += 0.3 * phase.sin() + 0.2 * corner.abs();
            }
            q
        })
        .collect();
    (points, Limits::of(&arm, None))
}

#[divan::bench(sample_count = 10)]
fn acceleration(bencher: divan::Bencher<'_, '_>) {
    let (points, limits) = path();
    bencher.bench_local(|| timed(&smooth(black_box(&points), &|_, _| true), &limits));
}

#[divan::bench(sample_count = 10)]
fn velocity(bencher: divan::Bencher<'_, '_>) {
    let (points, limits) = path();
    bencher.bench_local(|| bang_bang(black_box(&points), &limits.velocity));
}
