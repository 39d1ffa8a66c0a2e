//! Every trouble in every mode, and what supervision makes of it.

use super::*;

/// A fault's name, what makes it, what it is called, and whether the arm brakes on its path.
type Trouble = (&'static str, fn(&mut Sim) -> Option<Measured>, Fault, bool);

const TROUBLES: &[Trouble] = &[
    ("silence", |_| None, Fault::CommunicationLost, true),
    (
        "frozen",
        |s| Some(Measured { stamp_ns: 1100 * MS, ..s.measured() }),
        Fault::CommunicationLost,
        true,
    ),
    (
        "halt",
        |s| Some(Measured { status: s.status | status::HALTED, ..s.measured() }),
        Fault::Halted,
        false,
    ),
    ("uncalibrated", |s| Some(Measured { status: 0, ..s.measured() }), Fault::NotCalibrated, false),
    (
        "endpoint error",
        |s| Some(Measured { status: s.status | status::ERROR, ..s.measured() }),
        Fault::Endpoint,
        false,
    ),
    (
        "endpoint hears nothing",
        |s| Some(Measured { status: s.status | status::SETPOINT_TIMEOUT, ..s.measured() }),
        Fault::Endpoint,
        false,
    ),
    (
        "nan",
        |s| Some(Measured { q: moved(s.arm, 3, f64::NAN), ..s.measured() }),
        Fault::NotFinite,
        true,
    ),
    (
        "infinite",
        |s| Some(Measured { q: moved(s.arm, 0, f64::INFINITY), ..s.measured() }),
        Fault::NotFinite,
        true,
    ),
    ("joint count", |s| Some(Measured { joint_count: 6, ..s.measured() }), Fault::JointCount, true),
    (
        "stuck",
        |s| Some(Measured { q: moved(s.arm, 2, 0.2), ..s.measured() }),
        Fault::FollowingError,
        true,
    ),
];

/// The fault matrix: every trouble in every mode. The right fault is latched, every plan ends
/// once, the commanded position never jumps, and once the trouble is gone a reset leads to Hold.
#[test]
fn fault_matrix() {
    for (name, trouble, fault, brakes) in TROUBLES {
        for mode in [Mode::Init, Mode::Hold, Mode::Executing, Mode::Paused, Mode::Stopping] {
            let mut sim = in_mode(mode);
            let moving = sim.last_v[0] != 0.0;
            let at_once = sim.last;
            sim.top_acceleration = 0.0;
            for _ in 0..250 {
                let measured = trouble(&mut sim);
                sim.tick_with(measured, None, None);
            }
            if mode == Mode::Init {
                assert_eq!(sim.mode(), Mode::Init, "{name}");
                sim.status = status::CALIBRATED;
            } else {
                assert_eq!(sim.mode(), Mode::Fault, "{name} in {mode}");
                assert_eq!(sim.state.snapshot().fault, *fault, "{name} in {mode}");
                assert_eq!(sim.order(Order::Pause).verdict, Verdict::WrongMode);
                if moving && *brakes {
                    assert!(sim.last != at_once, "{name} in {mode}: it brakes on its path");
                    assert!(
                        sim.top_acceleration <= 10.0 + 1e-6,
                        "{name}: {}",
                        sim.top_acceleration
                    );
                }
            }
            for (plan, life) in &sim.lives {
                assert_eq!(life.ended, life.accepted, "{plan} after {name} in {mode}");
            }
            // The trouble is gone: nothing moves by itself, and a reset leads back.
            sim.run(50);
            let held = sim.last;
            if mode != Mode::Init {
                assert_eq!(sim.mode(), Mode::Fault, "{name}: it is latched");
                let offer = plan(&sim.guard, 8, JoinRule::StopThenStart, &line(HOME));
                assert_eq!(only(&sim.offer(offer), Rejected).why.reason, Reason::NotReady);
                assert_eq!(sim.order(Order::Reset).verdict, Verdict::Accepted, "{name} in {mode}");
            }
            sim.run(200);
            assert_eq!(sim.mode(), Mode::Hold, "{name} in {mode}");
            let still = sim.last.unwrap();
            let held = held.unwrap();
            assert!((0..7).all(|j| (still[j] - held[j]).abs() < 0.02), "{name} in {mode}");
        }
    }
}

#[test]
fn a_stale_state_stops_on_the_path_and_does_not_restart() {
    let mut sim = Sim::holding(pr2());
    let guard = sim.guard;
    sim.offer(plan(&guard, 1, JoinRule::StopThenStart, &line(HOME)));
    sim.run(100);
    sim.speaks = false;
    sim.run(19);
    assert_eq!(sim.mode(), Mode::Executing);
    sim.top_acceleration = 0.0;
    sim.run(2);
    assert_eq!(sim.mode(), Mode::Stopping);
    sim.speaks = true;
    sim.run(150);
    assert!(sim.top_acceleration <= 10.0 + 1e-6);
    assert_eq!((sim.mode(), sim.state.snapshot().fault), (Mode::Hold, Fault::StaleState));
    assert_eq!(sim.story(1), [Accepted, Started, Aborted]);
    let held = sim.last.unwrap();
    only(&sim.offer(plan(&guard, 2, JoinRule::StopThenStart, &line(held))), Accepted);
    assert_eq!(sim.state.snapshot().fault, Fault::None);
}

#[test]
fn a_halt_is_over_with_a_resume() {
    let mut sim = in_mode(Mode::Executing);
    sim.status |= status::HALTED;
    sim.run(5);
    // The arm sags while its motors are off, and the commanded position goes with it.
    for _ in 0..100 {
        sim.arm[1] += 0.001;
        let measured = sim.measured();
        sim.tick_with(Some(measured), None, None);
        let sagged = sim.measured().q;
        sim.arm = sagged;
    }
    assert_eq!(sim.order(Order::Resume).verdict, Verdict::StillFaulty);
    sim.status = status::CALIBRATED;
    sim.run(5);
    assert_eq!(sim.mode(), Mode::Fault);
    assert_eq!(sim.order(Order::Resume).verdict, Verdict::Accepted);
    sim.run(5);
    assert_eq!(sim.mode(), Mode::Hold);
}

#[test]
fn a_low_rate_is_a_fault() {
    for (slow, fails) in [(1.2, false), (1.5, true)] {
        let mut sim = in_mode(Mode::Hold);
        for _ in 0..1000 {
            sim.now += ((slow - 1.0) * 1e6) as u64;
            sim.run(1);
        }
        let failed = sim.mode() == Mode::Fault;
        assert_eq!(failed, fails, "{slow} ms a cycle");
        assert!(!failed || sim.state.snapshot().fault == Fault::LowRate);
    }
}

#[test]
fn a_lag_that_the_endpoint_reports_is_no_following_error() {
    // The virtual arm lags by two cycles; at 2 rad/s that is far less than the bound, so judge
    // the arithmetic: with no allowance at all only the reported delay explains the distance.
    let mut guard = pr2();
    guard.following_error = 1e-6;
    guard.following_lag = 0.0;
    let mut sim = Sim::holding(guard);
    let fast: Vec<_> =
        (0..=4u32).map(|i| (u64::from(i) * 50 * MS, moved(HOME, 0, 0.1 * f64::from(i)))).collect();
    sim.offer(plan(&guard, 1, JoinRule::StopThenStart, &fast));
    sim.run_until(Mode::Hold, 400);
    assert_eq!(sim.story(1), [Accepted, Started, Finished]);
}

/// After a loss the endpoint may be another one, or have stopped by itself: while it says that it
/// follows nothing, the command goes to where the arm is, so that it can begin to. While it
/// follows, the command stands.
#[test]
fn an_endpoint_that_follows_nothing_is_met_where_the_arm_is() {
    type Says = fn(Measured) -> Measured;
    let cases: [(&str, Says, bool); 4] = [
        ("stopped", |m| Measured { status: m.status | status::SETPOINT_TIMEOUT, ..m }, true),
        ("begun anew", |m| Measured { setpoint_sequence: 0, ..m }, true),
        ("halted", |m| Measured { status: m.status | status::HALTED, ..m }, true),
        ("follows", |m| m, false),
    ];
    for (name, says, comes) in cases {
        for mode in [Mode::Hold, Mode::Executing, Mode::Paused, Mode::Stopping] {
            let mut sim = in_mode(mode);
            sim.speaks = false;
            sim.run(400);
            assert_eq!(sim.state.snapshot().fault, Fault::CommunicationLost, "{name} in {mode}");
            let stood = sim.last.unwrap();
            let elsewhere = moved(moved(stood, 0, 0.05), 3, -0.08);
            for _ in 0..200 {
                let measured = says(Measured { q: elsewhere, ..sim.measured() });
                sim.tick_with(Some(measured), None, None);
            }
            let commanded = sim.last.unwrap();
            let to = if comes { elsewhere } else { stood };
            // One that answers nothing yet may follow all the same: near is enough for it.
            let within = if name == "begun anew" { 0.01 } else { 0.0 };
            let near = (0..7).all(|j| (commanded[j] - to[j]).abs() <= within + 1e-12);
            assert!(near, "{name} in {mode}: {commanded:?}");
            assert_eq!(sim.mode(), Mode::Fault, "{name} in {mode}: it is latched");
            assert_eq!(sim.state.snapshot().fault, Fault::CommunicationLost);
        }
    }
}

/// An arm that brakes on its path and then follows nothing any more: the brake is over, and the
/// command goes to where the arm is without a jump (`Sim` judges that).
#[test]
fn what_follows_nothing_needs_no_brake() {
    for bit in [status::HALTED, status::SETPOINT_TIMEOUT] {
        let mut sim = in_mode(Mode::Executing);
        let nan = Measured { q: moved(sim.arm, 3, f64::NAN), ..sim.measured() };
        sim.tick_with(Some(nan), None, None);
        assert_eq!((sim.mode(), sim.state.snapshot().fault), (Mode::Fault, Fault::NotFinite));
        let at = moved(sim.arm, 0, -0.05);
        for _ in 0..200 {
            let m = sim.measured();
            sim.tick_with(Some(Measured { q: at, status: m.status | bit, ..m }), None, None);
        }
        assert_eq!(sim.state.snapshot().fault, Fault::NotFinite, "no step, no limit was broken");
        assert_eq!(sim.last, Some(at));
    }
}

/// The last look before a setpoint goes out. Admission lets no such plan through, so the bound is
/// tightened beneath a plan that runs: nothing of the setpoint that breaks it is commanded, the
/// arm stands where it was, and every plan ends.
#[test]
fn a_setpoint_that_would_break_a_bound_is_not_commanded() {
    type Tightens = fn(&mut Sim);
    let cases: [(&str, Tightens, Fault); 3] = [
        ("slower", |s| s.guard.joints[0].limits.velocity = 0.5, Fault::Step),
        ("lower", |s| s.guard.joints[0].limits.upper = HOME[0] + 0.2, Fault::SoftLimit),
        ("a weak brake", |s| s.guard.joints[0].limits.k_position = Some(0.5), Fault::SoftLimit),
    ];
    for (name, tighten, fault) in cases {
        let mut sim = in_mode(Mode::Executing);
        let points = line(moved(HOME, 0, 0.4));
        let waits = plan(&sim.guard, 2, JoinRule::AfterCurrent, &points);
        only(&sim.offer(waits), Accepted);
        tighten(&mut sim);
        let upper = sim.guard.joints[0].limits.upper;
        for _ in 0..400 {
            let before = sim.last;
            sim.run(1);
            if sim.mode() == Mode::Fault {
                assert_eq!(sim.last, before, "{name}: the last good one stands");
                break;
            }
        }
        assert_eq!((sim.mode(), sim.state.snapshot().fault), (Mode::Fault, fault), "{name}");
        assert_eq!(sim.last_v, JointVector::ZERO, "{name}");
        let stood = sim.last.unwrap();
        assert!(stood[0] <= upper, "{name}");
        assert_eq!(sim.story(1), [Accepted, Started, Aborted], "{name}");
        assert_eq!(sim.story(2), [Accepted, Aborted], "{name}");
        assert_eq!(sim.events.last().unwrap().why.reason, Reason::Fault, "{name}");
        sim.run(100);
        assert_eq!((sim.mode(), sim.last), (Mode::Fault, Some(stood)), "{name}: it is latched");
        assert_eq!(sim.order(Order::Reset).verdict, Verdict::Accepted, "{name}");
        sim.run(5);
        assert_eq!(sim.mode(), Mode::Hold, "{name}");
    }
}
