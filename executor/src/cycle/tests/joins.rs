//! Where one motion goes over into another one: no step that no limit allows, no plan that is
//! accepted and then cannot be reached.

use super::*;
use crate::Guard;
use crate::admit::{Rejection, ValidPlan, admit};
use crate::testing::{held, message, rules, seal};

/// Joint 0 out and back in a sine, within 4 rad/s²: knots each 50 ms, moving at most.
fn sine(guard: &Guard, number: u64) -> std::sync::Arc<ValidPlan> {
    let turn = core::f64::consts::TAU / 2.4;
    let points: Vec<_> = (0..=48u32)
        .map(|k| {
            let t = 0.05 * f64::from(k);
            (u64::from(k) * 50 * MS, moved(HOME, 0, 0.25 * (1.0 - (turn * t).cos())))
        })
        .collect();
    plan_with(guard, number, &points, |h, knots| {
        h.interpolation = Interpolation::Cubic.wire();
        for knot in knots {
            let t = knot.time_from_start_ns as f64 * 1e-9;
            knot.velocities[0] = 0.25 * turn * (turn * t).sin();
        }
    })
}

/// A bang-bang plan from `from` with joint 0 at `speed`.
fn straight(
    guard: &Guard,
    number: u64,
    from: JointVector,
    speed: f64,
    at: usize,
) -> std::sync::Arc<ValidPlan> {
    let points = [(0, from), (200 * MS, moved(from, 0, 0.2 * speed))];
    joining(guard, number, &points, id(1), at)
}

/// A plan with limited acceleration is not left with a step that no acceleration makes, and a
/// bang-bang plan keeps its own corners.
#[test]
fn a_join_makes_no_step_that_a_curve_may_not() {
    let guard = pr2();
    let mut sim = Sim::holding(guard);
    let curve = sine(&guard, 1);
    only(&sim.offer(curve.clone()), Accepted);
    sim.run(100);
    // Knot 12 is in the middle of the way out, knot 36 of the way back, at 0.65 rad/s.
    let fast = |knot: usize| curve.knots()[knot];
    assert!(fast(12).v[0] > 0.65 && fast(36).v[0] < -0.65);
    let cases = [
        (12, -fast(12).v[0], false),
        (12, 0.0, false),
        (36, -fast(36).v[0], false),
        (12, fast(12).v[0] + 0.005, false),
        (12, fast(12).v[0] + 0.003, true),
    ];
    for (number, (at, speed, fits)) in cases.into_iter().enumerate() {
        let number = number as u64 + 2;
        let events = sim.offer(straight(&guard, number, fast(at).q, speed, at));
        if fits {
            only(&events, Accepted);
        } else {
            let why = only(&events, Rejected).why;
            assert_eq!((why.reason, why.joint), (Reason::Speed, 0), "{speed} at knot {at}");
            assert!(why.value > why.bound && why.bound <= 0.004 + 1e-12, "{why}");
        }
    }
    sim.top_acceleration = 0.0;
    sim.run_until(Mode::Hold, 2000);
    assert_eq!(sim.story(6), [Accepted, Started, Finished]);
}

/// From where the arm stands a bang-bang plan begins at speed, as it does from Hold; and a curve
/// that begins at rest may follow a bang-bang plan.
#[test]
fn bang_bang_begins_and_ends_where_the_arm_stands() {
    let guard = tireless();
    let points = line(HOME);
    for curve_first in [true, false] {
        let mut sim = Sim::holding(guard);
        let at_rest = |number, points: &[(u64, JointVector)], at: Option<usize>| {
            plan_with(&guard, number, points, |h, _| {
                h.interpolation = Interpolation::Cubic.wire();
                if let Some(knot) = at {
                    h.join_rule = JoinRule::AtKnot.wire();
                    (h.join_plan, h.join_knot) = (id(1), knot as u32);
                }
            })
        };
        let next = line(points[4].1);
        if curve_first {
            only(&sim.offer(at_rest(1, &points, None)), Accepted);
            only(&sim.offer(joining(&guard, 2, &next, id(1), 4)), Accepted);
        } else {
            only(&sim.offer(plan(&guard, 1, JoinRule::StopThenStart, &points)), Accepted);
            only(&sim.offer(at_rest(2, &next, Some(4))), Accepted);
        }
        sim.run_until(Mode::Hold, 2000);
        assert_eq!(sim.story(1), [Accepted, Started, Superseded]);
        assert_eq!(sim.story(2), [Accepted, Started, Finished]);
    }
}

/// A straight plan without leave for corners is as smooth as a curve, also where it begins.
#[test]
fn without_leave_for_corners_a_straight_plan_begins_only_at_its_own_speed() {
    let guard = pr2();
    let step = 0.99 * guard.velocity_tolerance(0);
    let from = moved(HOME, 0, 0.2);
    // Joint 0 at 0.4 rad/s, then slower and slower.
    let (mut q, mut points, mut speed) = (from, vec![(0, from)], 0.4f64);
    while speed > 0.0 {
        q[0] += speed * 5e-3;
        points.push((points.len() as u64 * 5 * MS, q));
        speed -= step;
    }
    let coast = |number, at: Option<usize>| {
        plan_with(&guard, number, &points, |h, _| {
            h.corners = 0;
            if let Some(knot) = at {
                h.join_rule = JoinRule::AtKnot.wire();
                (h.join_plan, h.join_knot) = (id(1), knot as u32);
            }
        })
    };
    for (running, fits) in [(0.4, true), (0.3, false)] {
        let mut sim = Sim::holding(guard);
        let there = (0.2 / running * 1e3) as u64 * MS;
        let line = [(0, HOME), (there, from), (2 * there, moved(from, 0, 0.2))];
        only(&sim.offer(plan(&guard, 1, JoinRule::StopThenStart, &line)), Accepted);
        let event = sim.offer(coast(2, Some(1)));
        if fits {
            only(&event, Accepted);
            sim.run_until(Mode::Hold, 2000);
            assert_eq!(sim.story(2), [Accepted, Started, Finished]);
        } else {
            let why = only(&event, Rejected).why;
            assert_eq!((why.reason, why.joint), (Reason::Speed, 0), "{why}");
        }
    }
    let mut sim = Sim::new(guard);
    sim.stand_at(from);
    assert_eq!(only(&sim.offer(coast(3, None)), Rejected).why.reason, Reason::Speed);
}

/// A first knot at a soft limit while the arm holds a little further inside: what the way there
/// could not keep the braking margin on is refused, everything else arrives.
#[test]
fn a_first_knot_near_a_soft_limit_is_reached_or_refused() {
    let guard = pr2();
    let mut seen = [0; 2];
    for joint in [0, 1, 2, 3, 5] {
        let (lower, upper) = guard.joints[joint].limits_at(0.0);
        for (limit, inwards) in [(upper, -1.0), (lower, 1.0)] {
            for room in [0.0, 1e-7, 1e-6, 1e-5, 1e-4, 3e-4, 1e-3, 2.4e-3, 3e-3, 0.01] {
                for apart in [0.0, 1e-13, 1e-9, 1e-6, 1e-4, 1e-3, 0.01, 0.0199] {
                    for other in [0.0, 0.015] {
                        let mut first = HOME;
                        first[joint] = limit + inwards * room;
                        let holds = moved(first, joint, inwards * apart);
                        let holds = moved(holds, 6, other);
                        let mut sim = Sim::new(guard);
                        sim.stand_at(holds);
                        // Inwards, so slowly that the plan itself needs no margin there.
                        let then = moved(first, joint, inwards * 1e-9);
                        let points = [(0, first), (100 * MS, then)];
                        let event = sim.offer(plan(&guard, 1, JoinRule::StopThenStart, &points));
                        let what = format!("joint {joint}, room {room}, {apart} apart");
                        if event[0].kind == Rejected {
                            let why = event[0].why;
                            assert_eq!(why.reason, Reason::SoftLimit, "{what}");
                            assert_eq!((why.joint, why.knot), (joint as u32, 0), "{what}");
                            assert!(room < 3e-4 && apart > 1e-11, "{what}");
                            seen[0] += 1;
                            continue;
                        }
                        seen[1] += 1;
                        for _ in 0..3000 {
                            if sim.mode() != Mode::Executing {
                                break;
                            }
                            sim.run(1);
                        }
                        let fault = sim.state.snapshot().fault;
                        assert_eq!((sim.mode(), fault), (Mode::Hold, Fault::None), "{what}");
                        assert_eq!(sim.story(1), [Accepted, Started, Finished], "{what}");
                    }
                }
            }
        }
    }
    assert!(seen[0] > 100 && seen[1] > 500, "{seen:?}");
}

/// Joint 0 by 0.1 rad in a second, by a jerk of 3.2 rad/s³ in turns.
fn gentle(guard: &Guard) -> std::sync::Arc<ValidPlan> {
    let share = [(0.0, 0.0), (1.0 / 12.0, 1.0), (0.5, 2.0), (11.0 / 12.0, 1.0), (1.0, 0.0)];
    let points: Vec<_> =
        (0..).zip(share).map(|(k, (way, _))| (k * 250 * MS, moved(HOME, 0, 0.1 * way))).collect();
    plan_with(guard, 1, &points, |h, knots| {
        h.interpolation = Interpolation::Cubic.wire();
        h.verified = 1;
        knots.iter_mut().zip(share).for_each(|(k, (_, speed))| k.velocities[0] = 0.1 * speed);
    })
}

/// Where a joint has a jerk limit, a plan takes over only with the acceleration that is there.
#[test]
fn a_join_makes_no_step_of_the_acceleration_beyond_a_jerk_limit() {
    let mut guard = pr2();
    guard.joints[0].limits.jerk = Some(5.0);
    let first = gentle(&guard);
    let at = first.knots()[1];
    let curve = |number, points: &[(u64, f64, f64)]| {
        let places: Vec<_> = points.iter().map(|(t, q, _)| (t * MS, moved(at.q, 0, *q))).collect();
        plan_with(&guard, number, &places, |h, knots| {
            h.interpolation = Interpolation::Cubic.wire();
            h.join_rule = JoinRule::AtKnot.wire();
            (h.join_plan, h.join_knot) = (id(1), 1);
            knots.iter_mut().zip(points).for_each(|(k, (_, _, v))| k.velocities[0] = *v);
        })
    };
    // There it speeds up at 0.8 rad/s², at 0.1 rad/s. One goes on so, the other at an even speed.
    let even = [(0, 0.0, 0.1), (100, 0.01, 0.1), (300, 0.08 / 3.0, 0.05), (500, 0.03, 0.0)];
    let tail =
        [(0, 0.0, 0.1), (250, 0.5 / 12.0, 0.2), (500, 1.0 / 12.0, 0.1), (750, 1.1 / 12.0, 0.0)];
    let mut sim = Sim::holding(guard);
    only(&sim.offer(first.clone()), Accepted);
    let why = only(&sim.offer(curve(2, &even)), Rejected).why;
    assert_eq!((why.reason, why.joint), (Reason::Jerk, 0), "{why}");
    assert!((why.value - 800.0).abs() < 1e-6 && (why.bound - 5.0).abs() < 1e-9, "{why}");
    only(&sim.offer(curve(3, &tail)), Accepted);
    sim.run_until(Mode::Hold, 2000);
    assert_eq!(sim.story(3), [Accepted, Started, Finished]);
    // Without a limit both may.
    let mut sim = Sim::holding(pr2());
    only(&sim.offer(gentle(&pr2())), Accepted);
    only(&sim.offer(curve(2, &even)), Accepted);
}

/// Joint 0 from `from` at a speed and an acceleration, by jerks of so many seconds each.
fn jerks(
    guard: &Guard,
    number: u64,
    from: JointVector,
    (mut speed, mut acceleration): (f64, f64),
    parts: &[(f64, f64)],
    edit: impl FnOnce(&mut nullsweep_ipc_types::PlanHeader),
) -> Result<std::sync::Arc<ValidPlan>, Rejection> {
    let (mut time, mut way) = (0, 0.0);
    let (mut points, mut speeds) = (vec![(0, from)], vec![speed]);
    for &(seconds, jerk) in parts {
        let ns = (seconds * 1e9).round();
        let t = ns * 1e-9;
        way += speed * t + acceleration * t * t / 2.0 + jerk * t * t * t / 6.0;
        speed += acceleration * t + jerk * t * t / 2.0;
        acceleration += jerk * t;
        time += ns as u64;
        points.push((time, moved(from, 0, way)));
        speeds.push(speed);
    }
    let (mut header, mut knots) = message(number, &points);
    header.interpolation = Interpolation::Cubic.wire();
    edit(&mut header);
    knots.iter_mut().zip(speeds).for_each(|(k, v)| k.velocities[0] = v);
    seal(&mut header, &knots);
    admit(&header, &knots, Some(&held()), &rules(guard), u64::MAX).map(std::sync::Arc::new)
}

/// A step of the acceleration within the limit and a jerk on both sides of it add up in the cycle
/// across the seam.
#[test]
fn jerk_is_summed_over_the_cycle_across_a_join() {
    let mut guard = pr2();
    guard.joints[0].limits.jerk = Some(3.3);
    let first = gentle(&guard);
    let at = first.knots()[1];
    // There it speeds up at 0.8 rad/s², at 0.1 rad/s, with 3.2 rad/s³.
    let join = |number, acceleration: f64, jerk: f64| {
        let (rise, t) = (0.05, 0.8 / 3.2);
        let top = acceleration + jerk * rise;
        let speed = 0.1 + (acceleration + top) / 2.0 * rise + top * top / 6.4;
        let half = (speed / 3.2).sqrt();
        assert!(half > t);
        let parts = [(rise, jerk), (top / 3.2, -3.2), (half, -3.2), (half, 3.2)];
        jerks(&guard, number, at.q, (0.1, acceleration), &parts, |h| {
            h.join_rule = JoinRule::AtKnot.wire();
            (h.join_plan, h.join_knot) = (id(1), 1);
        })
        .expect("sound by itself")
    };
    let mut sim = Sim::holding(guard);
    only(&sim.offer(first.clone()), Accepted);
    let step = 0.99 * guard.sudden(0);
    for (number, acceleration, jerk) in [(2, 0.8 + step, 3.2), (3, 0.8 + step, -3.2)] {
        let why = only(&sim.offer(join(number, acceleration, jerk)), Rejected).why;
        assert_eq!((why.reason, why.joint), (Reason::Jerk, 0), "{why}");
        assert!((why.value - 3.2 - 0.99 * 3.3).abs() < 0.01 && why.bound > 3.29, "{why}");
    }
    only(&sim.offer(join(4, 0.8, 3.2)), Accepted);
    sim.run_until(Mode::Hold, 3000);
    assert_eq!(sim.story(4), [Accepted, Started, Finished]);
}

/// The connector slows down to the first knot, where a plan may begin with all the jerk that there
/// may be: the setpoints show no more of it.
#[test]
fn jerk_is_within_its_limit_from_the_connector_into_the_plan() {
    let mut guard = tireless();
    guard.joints[0].limits.jerk = Some(50.0);
    let quarter = 0.15;
    let parts = [(quarter, 49.0), (quarter, -49.0), (quarter, -49.0), (quarter, 49.0)];
    let from = moved(HOME, 0, 0.0012);
    let plan = jerks(&guard, 1, from, (0.0, 0.0), &parts, |_| {}).expect("sound by itself");
    let mut sim = Sim::holding(guard);
    only(&sim.offer(plan), Accepted);
    let (mut speeds, mut shown) = (vec![0.0; 3], 0.0f64);
    while sim.mode() != Mode::Hold {
        sim.run(1);
        speeds.push(sim.last_v[0]);
        let [.., a, b, c] = speeds[..] else { panic!("three") };
        shown = shown.max((a - 2.0 * b + c).abs() / guard.period().powi(2));
    }
    assert!(sim.story(1).contains(&Finished) && speeds.len() > 400, "{}", speeds.len());
    assert!(shown <= 50.0 * (1.0 + 1e-6), "{shown} rad/s³");
}

/// Straight plans too: a corner on both sides of the seam, each as large as it may be.
#[test]
fn corners_are_summed_over_the_cycle_across_a_join() {
    let guard = pr2();
    let step = 0.9 * guard.velocity_tolerance(0);
    // Speeds up by a step each `apart_ns` up to knot 20, and down again.
    let stairs = |number, from: JointVector, first: u64, last_ns: u64, join: bool| {
        let (mut q, mut points, mut time) = (from, vec![(0, from)], 0);
        for k in first..60 {
            let apart_ns = if k == first { last_ns } else { MS };
            q[0] += step * k.min(59 - k) as f64 * apart_ns as f64 * 1e-9;
            time += apart_ns;
            points.push((time, q));
        }
        plan_with(&guard, number, &points, |h, _| {
            h.corners = 0;
            if join {
                h.join_rule = JoinRule::AtKnot.wire();
                (h.join_plan, h.join_knot) = (id(1), 20);
            }
        })
    };
    let first = stairs(1, HOME, 0, MS, false);
    let at = first.knots()[20].q;
    let mut sim = Sim::holding(guard);
    only(&sim.offer(first), Accepted);
    // In the seam, and half a cycle after it.
    let why = only(&sim.offer(stairs(2, at, 20, MS / 2, true)), Rejected).why;
    assert_eq!((why.reason, why.joint), (Reason::Speed, 0), "{why}");
    // So many knots there that the loop would be long in summing them.
    let mut crowd = vec![(0, at)];
    crowd.extend((1..=12).map(|k| (k * MS / 20, moved(at, 0, 20.0 * step * 5e-5 * k as f64))));
    let mut q = crowd[12].1;
    for k in (0..20).rev() {
        q[0] += step * f64::from(k) * 1e-3;
        crowd.push((crowd[crowd.len() - 1].0 + MS, q));
    }
    let crowd = plan_with(&guard, 4, &crowd, |h, _| {
        (h.corners, h.join_rule) = (0, JoinRule::AtKnot.wire());
        (h.join_plan, h.join_knot) = (id(1), 20);
    });
    let why = only(&sim.offer(crowd), Rejected).why;
    assert_eq!((why.reason, why.bound), (Reason::Malformed, 8.0), "{why}");
    only(&sim.offer(stairs(3, at, 20, MS, true)), Accepted);
}

/// While a plan is executed that its sender does not call verified, everybody is told.
#[test]
fn a_plan_that_is_not_verified_is_told_while_it_runs() {
    let mut sim = Sim::holding(pr2());
    assert!(!sim.state.snapshot().unverified);
    only(&sim.offer(gentle(&pr2())), Accepted);
    sim.run(10);
    assert!(sim.state.snapshot().plan == id(1) && !sim.state.snapshot().unverified);
    let mut sim = Sim::holding(pr2());
    only(&sim.offer(plan(&pr2(), 2, JoinRule::StopThenStart, &line(HOME))), Accepted);
    sim.run(10);
    assert!(sim.state.snapshot().plan == id(2) && sim.state.snapshot().unverified);
    sim.run_until(Mode::Hold, 2000);
    assert!(!sim.state.snapshot().unverified);
}
