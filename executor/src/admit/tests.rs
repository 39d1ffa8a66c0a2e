//! Everything that can be wrong with a plan, and the reason that it is rejected with.

use nullsweep_ipc_types::{Interpolation, JoinRule, Knot, MAX_KNOTS, PlanHeader, PlanId, Reason};
use proptest::prelude::*;

use super::{Held, Join, Rejection, ValidPlan, admit};
use crate::guard::Guard;
use crate::guard::tests::pr2;
use crate::interpolate::{reach, sample, top_speed};
use crate::testing::{HOME, MS, held, message, moved, rules, seal};

mod jerk;

const NOW: u64 = 5000;

type Edit = fn(&mut PlanHeader, &mut Vec<Knot>);

fn good() -> (PlanHeader, Vec<Knot>) {
    let points: Vec<_> =
        (0..=4u32).map(|i| (u64::from(i) * 50 * MS, moved(HOME, 0, 0.05 * f64::from(i)))).collect();
    message(1, &points)
}

fn judge(header: &PlanHeader, knots: &[Knot], held: Option<&Held>) -> Result<ValidPlan, Rejection> {
    admit(header, knots, held, &rules(&pr2()), NOW)
}

/// Rest to rest from knot to knot, a second each.
fn gentle_curve(header: &mut PlanHeader, knots: &mut [Knot]) {
    header.interpolation = Interpolation::Cubic.wire();
    for knot in knots {
        knot.time_from_start_ns *= 20;
    }
}

/// What is changed, the reason, the joint, the knot.
type Case = (&'static str, Edit, Reason, Option<u32>, Option<u32>);

/// Sealed again after the change.
const SEALED: &[Case] = &[
    (
        "one knot",
        |h, k| {
            k.truncate(1);
            h.knot_count = 1;
        },
        Reason::Malformed,
        None,
        None,
    ),
    ("count too high", |h, _| h.knot_count += 1, Reason::Malformed, None, None),
    ("count too low", |h, _| h.knot_count -= 1, Reason::Malformed, None, None),
    ("count huge", |h, _| h.knot_count = u32::MAX, Reason::Malformed, None, None),
    ("no joints", |h, _| h.joint_count = 0, Reason::Malformed, None, None),
    ("too many joints", |h, _| h.joint_count = 17, Reason::Malformed, None, None),
    ("too many held", |h, _| h.held_count = 33, Reason::Malformed, None, None),
    ("no id", |h, _| h.id = PlanId::NONE, Reason::Malformed, None, None),
    ("interpolation", |h, _| h.interpolation = 7, Reason::Malformed, None, None),
    ("join rule", |h, _| h.join_rule = 3, Reason::Malformed, None, None),
    ("before the start", |h, _| h.id.epoch = 99, Reason::Epoch, None, None),
    ("from the future", |h, _| h.id.epoch = NOW + 1, Reason::Epoch, None, None),
    ("another robot", |h, _| h.fingerprint ^= 1, Reason::Robot, None, None),
    ("another arm", |h, _| h.joint_count = 6, Reason::Robot, None, None),
    ("held count", |h, _| h.held_count = 1, Reason::HeldJoint, Some(1), None),
    ("torso", |h, _| h.held_positions[0] += 0.003, Reason::HeldJoint, Some(0), None),
    ("held NaN", |h, _| h.held_positions[1] = f64::NAN, Reason::HeldJoint, Some(1), None),
    ("NaN", |_, k| k[2].positions[3] = f64::NAN, Reason::NotFinite, Some(3), Some(2)),
    ("infinite", |_, k| k[4].velocities[6] = f64::INFINITY, Reason::NotFinite, Some(6), Some(4)),
    ("late start", |_, k| k[0].time_from_start_ns = 1, Reason::TimeOrder, None, Some(0)),
    ("equal times", |_, k| k[3].time_from_start_ns = 100 * MS, Reason::TimeOrder, None, Some(3)),
    ("falling times", |_, k| k[3].time_from_start_ns = 50 * MS, Reason::TimeOrder, None, Some(3)),
    ("endless", |_, k| k[4].time_from_start_ns = u64::MAX, Reason::TimeOrder, None, Some(4)),
    ("soft limit", |_, k| k[4].positions[5] = 0.5, Reason::SoftLimit, Some(5), Some(4)),
    ("velocity", |_, k| k[2].positions[0] += 0.1, Reason::Velocity, Some(0), Some(2)),
    (
        "whole turn",
        |_, k| k[3].positions[6] += core::f64::consts::TAU,
        Reason::Velocity,
        Some(6),
        Some(3),
    ),
    (
        "cubic that does not come to rest",
        |h, k| {
            gentle_curve(h, k);
            k[4].velocities[2] = 0.02;
        },
        Reason::Velocity,
        Some(2),
        Some(4),
    ),
    // Every sum in such a curve is infinite or no number.
    (
        "a speed beyond all numbers",
        |h, k| {
            gentle_curve(h, k);
            k[2].velocities[4] = 1.79e308;
        },
        Reason::Velocity,
        Some(4),
        Some(2),
    ),
    (
        "a speed whose square is beyond all numbers",
        |h, k| {
            gentle_curve(h, k);
            k[2].velocities[4] = -1e200;
        },
        Reason::Velocity,
        Some(4),
        Some(2),
    ),
    (
        "far",
        |_, k| k.iter_mut().for_each(|k| k.positions[6] = 1e15),
        Reason::SoftLimit,
        Some(6),
        Some(0),
    ),
    (
        "too many turns",
        |_, k| k.iter_mut().for_each(|k| k.positions[4] = -1001.0),
        Reason::SoftLimit,
        Some(4),
        Some(0),
    ),
    // 6 d / t² = 4.2 rad/s² of 4.
    (
        "acceleration",
        |h, k| {
            gentle_curve(h, k);
            k[3].positions[0] = k[2].positions[0] + 0.7;
        },
        Reason::Acceleration,
        Some(0),
        Some(3),
    ),
    ("bang-bang that does not say so", |h, _| h.corners = 0, Reason::Corner, Some(0), Some(4)),
    (
        "a corner on the way",
        |h, k| {
            h.corners = 0;
            k[2].positions[0] -= 0.03;
        },
        Reason::Corner,
        Some(0),
        Some(1),
    ),
    // Both knots are inside, but the curve swings out between them.
    (
        "cubic swing",
        |h, k| {
            h.interpolation = Interpolation::Cubic.wire();
            for knot in k.iter_mut() {
                knot.time_from_start_ns *= 20;
                knot.positions[5] = -0.25;
                knot.velocities[5] = 2.0;
            }
        },
        Reason::SoftLimit,
        Some(5),
        Some(1),
    ),
];

#[test]
fn each_wrong_plan_is_rejected_with_its_reason() {
    let (header, knots) = good();
    assert_eq!(judge(&header, &knots, Some(&held())).map(|p| p.id()), Ok(header.id));
    for (name, edit, reason, joint, knot) in SEALED {
        let (mut header, mut knots) = good();
        edit(&mut header, &mut knots);
        seal(&mut header, &knots);
        let why = judge(&header, &knots, Some(&held())).expect_err(name);
        assert_eq!(why.reason, *reason, "{name}: {why}");
        assert_eq!(why.joint, joint.unwrap_or(u32::MAX), "{name}: {why}");
        assert_eq!(why.knot, knot.unwrap_or(u32::MAX), "{name}: {why}");
    }
}

#[test]
fn what_was_changed_after_sealing_is_seen() {
    let changes: [Edit; 3] =
        [|h, _| h.join_knot ^= 1, |_, k| k[1].positions[0] += 1e-12, |h, _| h.checksum ^= 1 << 40];
    for change in changes {
        let (mut header, mut knots) = good();
        change(&mut header, &mut knots);
        let why = judge(&header, &knots, Some(&held())).unwrap_err();
        assert_eq!(why.reason, Reason::Checksum);
    }
}

#[test]
fn without_a_joint_state_nothing_is_admitted() {
    let (header, knots) = good();
    assert_eq!(judge(&header, &knots, None).unwrap_err().reason, Reason::NotReady);
    let other = Held { count: 1, ..held() };
    assert_eq!(judge(&header, &knots, Some(&other)).unwrap_err().reason, Reason::HeldJoint);
    let mut sunk = held();
    sunk.positions[0] -= 1.1 * Guard::HELD_TOLERANCE;
    assert_eq!(judge(&header, &knots, Some(&sunk)).unwrap_err().reason, Reason::HeldJoint);
}

#[test]
fn the_braking_margin_grows_with_speed() {
    // The wrist flex has k_position 20: at 1 rad/s it must keep 0.05 rad from its soft limit.
    let guard = pr2();
    let (_, upper) = guard.joints[5].limits_at(0.0);
    for (speed, distance, fits) in [(1.0, 0.051, true), (1.0, 0.049, false), (0.1, 0.049, true)] {
        let end = upper - distance;
        let mut from = HOME;
        from[5] = end - 0.1;
        let mut to = HOME;
        to[5] = end;
        let (header, knots) = message(1, &[(0, from), ((0.1 / speed * 1e9) as u64, to)]);
        let result = judge(&header, &knots, Some(&held()));
        assert_eq!(result.is_ok(), fits, "{speed} rad/s, {distance} rad: {result:?}");
    }
}

/// What keeps every limit to within rounding is admitted: rest to rest with the joint's own
/// acceleration, and a share of 10⁻⁶ more. A straight line has no such bound.
#[test]
fn acceleration_is_bounded_in_curves_to_within_rounding() {
    let guard = pr2();
    for j in 0..7 {
        let most = guard.joints[j].limits.acceleration;
        for (share, fits) in [(0.5, true), (1.0, true), (1.0 + 9e-7, true), (1.0 + 2e-6, false)] {
            let by = most * share * 0.25 / 6.0;
            let points = [(0, HOME), (500 * MS, moved(HOME, j, by)), (1_000 * MS, HOME)];
            for kind in [Interpolation::Cubic, Interpolation::Linear] {
                let (mut header, knots) = message(1, &points);
                header.interpolation = kind.wire();
                seal(&mut header, &knots);
                let found = judge(&header, &knots, Some(&held())).map_err(|why| why.reason);
                if fits || kind == Interpolation::Linear {
                    assert_eq!(found.map(|_| ()), Ok(()), "joint {j}, {share}");
                } else {
                    assert_eq!(found.unwrap_err(), Reason::Acceleration, "joint {j}, {share}");
                }
            }
        }
    }
}

/// A polyline that speeds up and slows down by no more than its joint may each cycle needs no
/// leave.
#[test]
fn a_polyline_without_corners_needs_no_leave_for_them() {
    let guard = pr2();
    let step = guard.velocity_tolerance(0);
    let line = |share: f64| {
        let (mut q, mut points) = (HOME, vec![(0, HOME)]);
        for k in 0..100u64 {
            q[0] += share * step * k.min(99 - k) as f64 * 0.01;
            points.push(((k + 1) * 10 * MS, q));
        }
        let (mut header, knots) = message(1, &points);
        header.corners = 0;
        seal(&mut header, &knots);
        judge(&header, &knots, Some(&held()))
    };
    assert_eq!(line(0.99).map(|plan| plan.has_corners()), Ok(false));
    assert_eq!(line(1.5).unwrap_err().reason, Reason::Corner);
}

/// Knots closer than a cycle do not hide a step: what setpoints show is the sum.
#[test]
fn corners_are_summed_over_a_cycle() {
    let guard = pr2();
    let step = guard.velocity_tolerance(0);
    // Speeds up and slows down by `share` of the tolerance in each knot.
    let line = |share: f64, apart_ns: u64, count: u64| {
        let (mut q, mut points) = (HOME, vec![(0, HOME)]);
        for k in 0..count {
            q[0] += share * step * k.min(count - 1 - k) as f64 * apart_ns as f64 * 1e-9;
            points.push(((k + 1) * apart_ns, q));
        }
        let (mut header, knots) = message(1, &points);
        header.corners = 0;
        seal(&mut header, &knots);
        judge(&header, &knots, Some(&held()))
    };
    // From rest to 1.6 rad/s within one cycle, and back.
    assert_eq!(line(0.99, MS / 1000, 800).unwrap_err().reason, Reason::Corner);
    for (share, apart_ns, fits) in [
        (0.99, MS, true),
        // As a planner may round it.
        (0.99, MS - 1, true),
        (0.99, MS - 2, false),
        (0.49, MS / 2, true),
        (0.51, MS / 2, false),
        (0.09, MS / 10, true),
        (0.11, MS / 10, false),
    ] {
        let found = line(share, apart_ns, 100).map(|_| ()).map_err(|why| why.reason);
        let expected = if fits { Ok(()) } else { Err(Reason::Corner) };
        assert_eq!(found, expected, "{share} in {apart_ns} ns");
    }
}

/// Whatever stands for a number: refused, or every figure of the plan is a bounded one.
#[test]
fn no_number_passes_a_bound_that_it_does_not_keep() {
    let odd = [f64::MAX, f64::MIN, 1.79e308, -1e300, 1e200, -1e154, 1e100, 1e15, f64::MIN_POSITIVE];
    let guard = pr2();
    for kind in Interpolation::ALL {
        for (place, odd) in (0..2 * 7 * 5).flat_map(|place| odd.map(|odd| (place, odd))) {
            let (mut header, mut knots) = good();
            gentle_curve(&mut header, &mut knots);
            header.interpolation = kind.wire();
            let knot = &mut knots[place % 5];
            let joint = place / 5 % 7;
            let moves = place >= 35;
            if moves {
                knot.positions[joint] = odd;
            } else {
                knot.velocities[joint] = odd;
            }
            seal(&mut header, &knots);
            let Ok(plan) = judge(&header, &knots, Some(&held())) else { continue };
            for pair in plan.knots().windows(2) {
                for j in 0..7 {
                    let speed = top_speed(&pair[0], &pair[1], *kind, j);
                    assert!(speed <= guard.joints[j].velocity(), "{kind}, joint {joint}: {odd}");
                    let (low, high) = reach(&pair[0], &pair[1], *kind, j);
                    assert!(low >= -Knot::FARTHEST && high <= Knot::FARTHEST, "{kind}: {odd}");
                }
            }
        }
    }
}

#[test]
fn join_rules_are_read() {
    let (mut header, knots) = good();
    header.join_plan = PlanId { epoch: 7, number: 9 };
    header.join_knot = 3;
    let expected =
        [Join::Stop, Join::After, Join::Knot { plan: PlanId { epoch: 7, number: 9 }, knot: 3 }];
    for (rule, join) in JoinRule::ALL.iter().zip(expected) {
        header.join_rule = rule.wire();
        seal(&mut header, &knots);
        assert_eq!(judge(&header, &knots, Some(&held())).unwrap().join(), join);
    }
}

#[test]
fn ramps_are_safe_for_a_cycle_ahead() {
    // A slow segment just before a fast one must already be careful.
    let guard = pr2();
    let points = [
        (0, HOME),
        (100 * MS, moved(HOME, 0, 0.001)),
        (100 * MS + MS / 2, moved(HOME, 0, 0.0012)),
        (200 * MS, moved(HOME, 0, 0.2)),
        (300 * MS, moved(HOME, 0, 0.2)),
    ];
    let (header, knots) = message(1, &points);
    let plan = judge(&header, &knots, Some(&held())).unwrap();
    let top = (0.2 - 0.0012) / 0.0995;
    let ramps: Vec<f64> = plan.knots().iter().map(|k| k.ramp).collect();
    let fast = guard.stop_acceleration / top;
    for (i, expected) in [(0, fast), (1, fast), (2, fast), (3, 50.0), (4, 50.0)] {
        assert!((ramps[i] - expected).abs() < 1e-9, "{i}: {ramps:?}");
    }
}

#[test]
fn the_largest_plan_is_admitted_in_good_time() {
    let points: Vec<_> = (0..MAX_KNOTS as u32)
        .map(|i| (u64::from(i) * MS, moved(HOME, 0, 1e-5 * f64::from(i))))
        .collect();
    let (header, knots) = message(1, &points);
    let start = std::time::Instant::now();
    judge(&header, &knots, Some(&held())).unwrap();
    println!("{MAX_KNOTS} knots admitted in {:?}", start.elapsed());
}

proptest! {
    /// Any bytes: never a panic, and what is admitted is finite and in order.
    #[test]
    fn arbitrary_bytes_never_panic(
        bytes in prop::collection::vec(any::<u8>(), size_of::<PlanHeader>() + 3 * size_of::<Knot>()),
        sealed in any::<bool>(),
        plausible in any::<bool>(),
    ) {
        let (head, rest) = bytes.split_at(size_of::<PlanHeader>());
        let mut header: PlanHeader = bytemuck::pod_read_unaligned(head);
        let knots: Vec<Knot> = rest.chunks(size_of::<Knot>()).map(bytemuck::pod_read_unaligned).collect();
        if plausible {
            let (good, _) = good();
            header = PlanHeader { knot_count: 3, ..good };
        }
        if sealed {
            seal(&mut header, &knots);
        }
        if let Ok(plan) = judge(&header, &knots, Some(&held())) {
            prop_assert!(plan.knots().iter().all(|k| k.q.iter().all(|q| q.is_finite())));
        }
    }
}
