//! The judge on hand-made streams.

use nullsweep_robot::{ArmSpec, Robot, Side};

use super::*;

fn arm() -> Arm {
    Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).expect("the embedded PR2 has a right arm")
}

/// Setpoints that turn the shoulder pan by `rate` rad/s, starting at home.
fn stream(arm: &Arm, count: u64, rate: f64) -> Vec<Setpoint> {
    (0..count)
        .map(|k| {
            let mut s = <Setpoint as bytemuck::Zeroable>::zeroed();
            s.sequence = k + 1;
            s.stamp_ns = k * 1_000_000;
            s.deadline_ns = s.stamp_ns + 1_000_000;
            s.joint_count = arm.dof() as u32;
            s.mode = Mode::Executing.wire();
            s.positions[..arm.dof()].copy_from_slice(&arm.home()[..arm.dof()]);
            s.positions[0] += rate * k as f64 * 1e-3;
            s.velocities[0] = rate;
            s
        })
        .collect()
}

/// Feeds the setpoints in passes of `pass` and gives the verdict.
fn judged(setpoints: &[Setpoint], pass: usize) -> Verdict {
    let arm = arm();
    let mut judge = Judge::new(&arm, Rules::default());
    for chunk in setpoints.chunks(pass) {
        judge.observe(chunk, &arm.home());
    }
    judge.verdict().clone()
}

fn only(verdict: &Verdict, kind: Kind, count: u64) {
    assert_eq!(verdict.violations[&kind], count, "{:?}", verdict.first);
    assert_eq!(verdict.total(), count, "{:?}", verdict.first);
}

#[test]
fn a_sound_stream_is_clean_whatever_the_pass() {
    for pass in [1, 3, 64, 200] {
        let verdict = judged(&stream(&arm(), 200, 0.5), pass);
        assert!(verdict.is_clean(), "{:?}", verdict.first);
        assert_eq!((verdict.setpoints, verdict.sessions, verdict.late), (200, 1, 0));
        assert!((verdict.largest_step_ratio - 0.5 / 2.088).abs() < 1e-6);
    }
}

#[test]
fn nothing_received_is_not_clean() {
    assert!(!judged(&[], 1).is_clean());
}

#[test]
fn a_step_above_the_velocity_limit_is_named() {
    let mut s = stream(&arm(), 20, 0.0);
    for s in &mut s[10..] {
        s.positions[3] -= 0.01;
    }
    let verdict = judged(&s, 1);
    only(&verdict, Kind::Step, 1);
    assert_eq!(verdict.first[0].sequence, 11);
    assert_eq!(verdict.first[0].joint.as_deref(), Some("r_elbow_flex_joint"));
    assert!((verdict.first[0].value - 0.01).abs() < 1e-12);
    assert!((verdict.first[0].bound - 3.3e-3).abs() < 1e-12);
}

#[test]
fn the_same_motion_over_lost_samples_is_no_step() {
    // 2 rad/s is below the limit of 2.088: 50 samples apart it moves 0.1 rad.
    let all = stream(&arm(), 300, -2.0);
    let mut first = all[..20].to_vec();
    let kept = all[70..150].to_vec();
    let arm = arm();
    let mut judge = Judge::new(&arm, Rules::default());
    judge.observe(&first, &arm.home());
    judge.observe(&kept, &arm.home());
    only(judge.verdict(), Kind::Gap, 0);
    assert_eq!(judge.verdict().lost_by_reader, 50);

    // The same gap in a pass that emptied a half-full buffer is the sender's.
    first.extend_from_slice(&all[70..80]);
    only(&judged(&first, 30), Kind::Gap, 1);
}

#[test]
fn a_gap_does_not_excuse_a_faster_motion() {
    let mut s = stream(&arm(), 40, 0.0);
    s.drain(10..14);
    for s in &mut s[10..] {
        s.positions[0] -= 5.0 * 2.088e-3 * 1.01;
    }
    let verdict = judged(&s, 1);
    assert_eq!(verdict.violations[&Kind::Step], 1);
    assert_eq!(verdict.violations[&Kind::Gap], 1);
}

#[test]
fn soft_limits_move_in_with_speed() {
    let arm = arm();
    let j = 5; // wrist flex: k_position 20, so 3 rad/s needs 0.15 rad
    let (_, upper) = arm.braking_limits(j, 0.0);
    let mut s = stream(&arm, 60, 0.0);
    for (k, s) in s.iter_mut().enumerate() {
        s.positions[j] = upper - 0.16 + 0.003 * (k as f64).min(50.0);
    }
    let mut judge = Judge::new(&arm, Rules::default());
    let mut measured = arm.home();
    measured[j] = upper - 0.16;
    judge.observe(&s, &measured);
    let found = judge.verdict();
    // It may go on to 0.01 below the limit, but not at 3 rad/s.
    assert!(found.violations[&Kind::SoftLimit] >= 40, "{:?}", found.violations);
    assert_eq!(found.total(), found.violations[&Kind::SoftLimit]);
    let v = &found.first[0];
    assert!((v.bound - (upper - 0.15)).abs() < 1e-6, "{v}");
}

#[test]
fn disorder_nonsense_and_speed_are_found() {
    let good = stream(&arm(), 30, 0.1);

    let mut s = good.clone();
    s.swap(10, 11);
    let verdict = judged(&s, 1);
    assert_eq!(verdict.violations[&Kind::Gap], 1);
    assert_eq!(verdict.violations[&Kind::Reordered], 1);

    let mut s = good.clone();
    s[5].positions[2] = f64::NAN;
    only(&judged(&s, 1), Kind::NotFinite, 1);
    let mut s = good.clone();
    s[5].velocities[2] = f64::NEG_INFINITY;
    only(&judged(&s, 1), Kind::NotFinite, 1);

    let mut s = good.clone();
    s[5].joint_count = 6;
    let verdict = judged(&s, 1);
    assert_eq!(verdict.violations[&Kind::Malformed], 1);

    let mut s = good.clone();
    s[5].velocities[0] = 2.1;
    only(&judged(&s, 1), Kind::Velocity, 1);
}

#[test]
fn a_session_starts_where_the_arm_is() {
    let mut s = stream(&arm(), 10, 0.0);
    for s in &mut s {
        s.positions[1] += 0.03;
    }
    only(&judged(&s, 1), Kind::Jump, 1);

    // A restarted executor counts from one again, after a silence or at once: another session.
    for pause_ns in [500_000_000, 12_000_000] {
        let mut s = stream(&arm(), 10, 0.0);
        let again: Vec<_> = s
            .iter()
            .map(|s| Setpoint {
                stamp_ns: s.stamp_ns + pause_ns,
                deadline_ns: s.deadline_ns + pause_ns,
                ..*s
            })
            .collect();
        s.extend(again);
        let verdict = judged(&s, 1);
        assert!(verdict.is_clean(), "{:?}", verdict.first);
        assert_eq!(verdict.sessions, 2);
    }
}

#[test]
fn an_executor_that_was_there_before_must_come_to_the_arm() {
    // Two joints off for 50 ms: it may not have heard yet. For longer: it does not listen.
    let off = |count: u64, mode: Mode| {
        let mut s = stream(&arm(), count, 0.0);
        for s in &mut s {
            s.sequence += 5000;
            s.mode = mode.wire();
            s.positions[1] += 0.03;
            s.positions[2] += 0.02;
        }
        s
    };
    for mode in [Mode::Hold, Mode::Executing, Mode::Stopping] {
        assert!(judged(&off(50, mode), 1).is_clean());
        only(&judged(&off(300, mode), 1), Kind::Jump, 1);
    }
    // While it waits for a reset it may be anywhere, but not when it no longer does.
    let mut s = off(300, Mode::Fault);
    assert!(judged(&s, 1).is_clean());
    for s in &mut s[10..] {
        s.mode = Mode::Hold.wire();
    }
    only(&judged(&s, 1), Kind::Jump, 1);
    // It came to the arm: what it does then is motion.
    let mut s = off(300, Mode::Hold);
    for (k, s) in s.iter_mut().enumerate() {
        s.positions[1] -= 1e-3 * (k as f64).min(30.0);
        s.positions[2] -= 1e-3 * (k as f64).min(20.0);
        s.positions[0] += 2e-3 * (k as f64 - 150.0).clamp(0.0, 50.0);
    }
    let verdict = judged(&s, 1);
    assert!(verdict.is_clean(), "{:?}", verdict.first);
}

#[test]
fn plans_and_lateness_are_followed() {
    let mut s = stream(&arm(), 30, 0.2);
    for (k, s) in s.iter_mut().enumerate() {
        s.plan.number = if k < 15 { 1 } else { 2 };
        if k >= 20 {
            s.stamp_ns += 5_000_000;
            s.deadline_ns += 5_000_000;
        }
        if k >= 15 {
            s.positions[0] -= 0.4e-3 * (k - 14) as f64; // turns back with the second plan
        }
    }
    let verdict = judged(&s, 1);
    assert!(verdict.is_clean(), "{:?}", verdict.first);
    let runs: Vec<_> = verdict.plans.iter().map(|r| (r.first_sequence, r.last_sequence)).collect();
    assert_eq!(runs, [(1, 15), (16, 30)]);
    assert!((verdict.plans[1].join_velocity_step - 0.4).abs() < 1e-6);
    assert_eq!((verdict.late, verdict.worst_lateness_ns), (1, 5_000_000));
}
