//! How much a plan's acceleration may change.

use super::*;

/// Joint 3 over `by` and at rest again in a second, by a jerk of ±32 `by` in turns, sealed.
fn s_curve(by: f64) -> (PlanHeader, Vec<Knot>) {
    let share = [(0.0, 0.0), (1.0 / 12.0, 1.0), (0.5, 2.0), (11.0 / 12.0, 1.0), (1.0, 0.0)];
    let points: Vec<_> =
        (0u64..).zip(share).map(|(k, (way, _))| (k * 250 * MS, moved(HOME, 3, by * way))).collect();
    let (mut header, mut knots) = message(1, &points);
    header.interpolation = Interpolation::Cubic.wire();
    for (knot, (_, speed)) in knots.iter_mut().zip(share) {
        knot.velocities[3] = by * speed;
    }
    seal(&mut header, &knots);
    (header, knots)
}

/// Within a curve the jerk is constant. It is bounded where the URDF has a limit of it, as the
/// acceleration is, and nowhere else.
#[test]
fn jerk_is_bounded_in_curves_where_there_is_a_limit() {
    let mut guard = pr2();
    let judge = |guard: &Guard, by: f64| {
        let (header, knots) = s_curve(by);
        admit(&header, &knots, Some(&held()), &rules(guard), NOW)
    };
    assert!(judge(&guard, 0.1).is_ok());
    for (share, fits) in [(1.0, true), (1.0 - 9e-7, true), (1.0 - 2e-6, false), (0.5, false)] {
        guard.joints[3].limits.jerk = Some(3.2 * share);
        let found = judge(&guard, 0.1);
        assert_eq!(found.is_ok(), fits, "{share}: {found:?}");
        if let Err(why) = found {
            assert_eq!((why.reason, why.joint, why.knot), (Reason::Jerk, 3, 1), "{why}");
            assert!((why.value - 3.2).abs() < 1e-9, "{why}");
        }
    }
    // Another joint's is its own.
    guard.joints[3].limits.jerk = None;
    guard.joints[2].limits.jerk = Some(1.0);
    assert!(judge(&guard, 0.1).is_ok());
}

/// A cubic from rest to rest begins and ends with an acceleration: setpoints show that step as jerk.
/// So do they where two segments meet.
#[test]
fn a_step_of_the_acceleration_is_jerk() {
    let mut guard = pr2();
    let judge = |guard: &Guard| {
        let points = [(0, HOME), (500 * MS, moved(HOME, 3, 0.1)), (1_000 * MS, HOME)];
        let (mut header, knots) = message(1, &points);
        header.interpolation = Interpolation::Cubic.wire();
        seal(&mut header, &knots);
        admit(&header, &knots, Some(&held()), &rules(guard), NOW)
    };
    // 2.4 rad/s² at once, which is 2400 rad/s³ for a cycle of 1 ms.
    for (limit, fits) in [(2401.0, true), (2399.0, false), (100.0, false)] {
        guard.joints[3].limits.jerk = Some(limit);
        let found = judge(&guard);
        assert_eq!(found.is_ok(), fits, "{limit}: {found:?}");
        if let Err(why) = found {
            assert_eq!((why.reason, why.joint, why.knot), (Reason::Jerk, 3, 0), "{why}");
            assert!((why.value - 2400.0).abs() < 1e-6 && why.bound == limit, "{why}");
        }
    }
    let (header, mut knots) = s_curve(0.1);
    guard.joints[3].limits.jerk = Some(3.3);
    assert!(admit(&header, &knots, Some(&held()), &rules(&guard), NOW).is_ok());
    // It stops in the last quarter but one instead: the acceleration steps in its last two knots.
    let mut short = header;
    knots.truncate(4);
    knots[3].velocities[3] = 0.0;
    short.knot_count = 4;
    seal(&mut short, &knots);
    let why = admit(&short, &knots, Some(&held()), &rules(&guard), NOW).unwrap_err();
    assert_eq!((why.reason, why.joint), (Reason::Jerk, 3), "{why}");
}

/// What is admitted shows no more jerk than its limit in setpoints a cycle apart, however they fall
/// between the knots, which may be closer than a cycle; what shows more is refused.
#[test]
fn setpoints_show_no_more_jerk_than_the_limit() {
    use rand::{RngExt, SeedableRng};
    let (mut admitted, mut refused) = (0, 0);
    for seed in 0..400u64 {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let mut guard = crate::testing::tireless();
        guard.period_ns = [1, 10][seed as usize % 2] * MS;
        let mut points = vec![(0, HOME)];
        for _ in 0..random.random_range(2..12) {
            let (time, q) = points[points.len() - 1];
            let by = random.random_range(-2e-3..2e-3);
            points.push((time + random.random_range(3 * MS..40 * MS), moved(q, 0, by)));
        }
        let (mut header, mut knots) = message(1, &points);
        header.interpolation = Interpolation::Cubic.wire();
        let inner = 1..knots.len() - 1;
        knots[inner].iter_mut().for_each(|k| k.velocities[0] = random.random_range(-0.1..0.1));
        seal(&mut header, &knots);
        let judge = |guard: &Guard| admit(&header, &knots, Some(&held()), &rules(guard), NOW);
        let Ok(plan) = judge(&guard) else { continue };
        let cycle = guard.period_ns as f64;
        let speed = |time: f64| match plan.knots().iter().position(|k| k.time > time) {
            Some(k) if k > 0 => {
                let (a, b) = (&plan.knots()[k - 1], &plan.knots()[k]);
                sample(a, b, Interpolation::Cubic, time).v[0]
            }
            _ => 0.0,
        };
        let mut shown = 0.0f64;
        for step in 0..(plan.duration() / cycle * 16.0) as i32 + 64 {
            let time = cycle * (f64::from(step) / 16.0 - 2.0);
            let change = speed(time) - 2.0 * speed(time + cycle) + speed(time + 2.0 * cycle);
            shown = shown.max(change.abs() / guard.period().powi(2));
        }
        for share in [0.99, 1.2, 4.0, 20.0] {
            guard.joints[0].limits.jerk = Some(share * shown);
            match judge(&guard) {
                Ok(_) if share < 1.0 => panic!("seed {seed}: {shown} is shown and admitted"),
                Ok(_) => admitted += 1,
                Err(why) => {
                    assert!(matches!(why.reason, Reason::Jerk | Reason::Velocity), "{why}");
                    refused += 1;
                }
            }
        }
    }
    println!("{admitted} admitted, {refused} refused");
    assert!(admitted > 300 && refused > 300, "{admitted} admitted, {refused} refused");
}
