use super::*;
use crate::plan::Curve;
use crate::timing::{Piece, SmoothPath, timed};

fn lane(values: &[f64]) -> JointVector {
    let mut all = JointVector::ZERO;
    all[..values.len()].copy_from_slice(values);
    all
}

fn free(_: f64, _: &JointVector, _: &JointVector) -> f64 {
    f64::INFINITY
}

/// The least time from rest to rest over a distance: constant jerk in seven parts.
fn least(distance: f64, velocity: f64, acceleration: f64, jerk: f64) -> f64 {
    // With and without a constant acceleration, with and without a cruise.
    let ramp = |v: f64| {
        if v * jerk >= acceleration * acceleration {
            v / acceleration + acceleration / jerk
        } else {
            2.0 * (v / jerk).sqrt()
        }
    };
    let reached = |v: f64| v * ramp(v);
    if reached(velocity) <= distance {
        return 2.0 * ramp(velocity) + (distance - reached(velocity)) / velocity;
    }
    let (mut low, mut high) = (0.0, velocity);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if reached(middle) <= distance { low = middle } else { high = middle }
    }
    2.0 * ramp(low)
}

#[test]
fn from_rest_to_rest_is_within_three_percent_of_the_least_time() {
    for (distance, velocity, acceleration, jerk) in [
        (1.0, 2.0, 4.0, 40.0),
        (3.0, 2.0, 4.0, 40.0),
        (0.2, 2.0, 4.0, 40.0),
        (0.05, 2.0, 4.0, 40.0),
        (2.0, 1.0, 8.0, 400.0),
        (1.0, 2.0, 15.0, 7500.0),
    ] {
        let limits =
            Limits { velocity: lane(&[velocity, 3.0]), acceleration: lane(&[acceleration, 8.0]) };
        let (start, end) = (lane(&[0.3, 1.0]), lane(&[0.3 + distance, 1.0]));
        let run = SmoothPath { pieces: vec![Piece::line(&start, &end, [0.0, 1.0])] };
        let run = timed(&[run], &limits);
        let jerks = lane(&[jerk, jerk]);
        let knots = limited(&run, &limits, &jerks, &free);
        let (first, last) = (knots[0], knots[knots.len() - 1]);
        assert_eq!((first.q, first.v), (start, JointVector::ZERO));
        assert_eq!((last.q, last.v), (end, JointVector::ZERO));
        let took = last.time_ns as f64 * 1e-9;
        let least = least(distance, velocity, acceleration, jerk);
        println!("{distance} {velocity} {acceleration} {jerk}: {took:.4} of {least:.4} s");
        assert!(took >= least * 0.999 && took <= least * 1.03, "{took} of {least}");
        kept(&knots, &limits, &jerks);
    }
}

/// Velocity, acceleration and jerk within each segment, and no step of the acceleration.
fn kept(knots: &[Timed], limits: &Limits, jerk: &JointVector) {
    let mut before = JointVector::ZERO;
    for w in knots.windows(2) {
        let seconds = (w[1].time_ns - w[0].time_ns) as f64 * 1e-9;
        assert!(seconds >= 1e-3);
        let curve = Curve::cubic((&w[0].q, &w[0].v), (&w[1].q, &w[1].v), seconds);
        let (a, b) = (curve.acceleration(0.0), curve.acceleration(1.0));
        for j in 0..2 {
            assert!(curve.top_speed(j) <= limits.velocity[j] * (1.0 + 1e-9));
            assert!(curve.top_acceleration(j) <= limits.acceleration[j] * (1.0 + 1e-6));
            assert!((b[j] - a[j]).abs() / seconds <= jerk[j] * (1.0 + 1e-6));
            assert!((a[j] - before[j]).abs() < 1e-6 * jerk[j] * seconds + 1e-8);
        }
        before = b;
    }
    assert!((0..2).all(|j| before[j].abs() < 1e-8));
}

/// An arc of two joints, gone along at limits that only its bend uses.
#[test]
fn a_bend_keeps_all_limits_and_its_path() {
    let points: Vec<JointVector> = (0..=400)
        .map(|k| {
            let angle = 0.01 * f64::from(k);
            lane(&[libm::cos(angle), libm::sin(angle)])
        })
        .collect();
    let limits = Limits { velocity: lane(&[2.0, 2.0]), acceleration: lane(&[4.0, 4.0]) };
    let jerk = lane(&[40.0, 40.0]);
    let run = timed(&crate::timing::smooth(&points, &|_, _| true), &limits);
    let free_s = run[run.len() - 1].time_ns as f64 * 1e-9;
    let knots = limited(&run, &limits, &jerk, &free);
    kept(&knots, &limits, &jerk);
    let took = knots[knots.len() - 1].time_ns as f64 * 1e-9;
    assert!(took > free_s && took < 1.2 * free_s, "{took} s, without a limit of jerk {free_s} s");
    for knot in &knots {
        let radius = libm::hypot(knot.q[0], knot.q[1]);
        assert!((radius - 1.0).abs() < 4e-4, "{radius}");
    }
    // Slower where the tool is to be slower, here everywhere.
    let slow = |_: f64, _: &JointVector, v: &JointVector| 0.3 / libm::hypot(v[0], v[1]);
    let knots = limited(&run, &limits, &jerk, &slow);
    let speeds: Vec<f64> = knots.iter().map(|k| libm::hypot(k.v[0], k.v[1])).collect();
    assert!(speeds.iter().all(|v| *v < 0.3 * 1.01));
    let held = speeds.iter().filter(|v| **v > 0.294).count();
    assert!(held as f64 > 0.9 * speeds.len() as f64, "{held} of {}", speeds.len());
}
