//! A joint that turns without end, measured within a turn.

use core::f64::consts::TAU;

use super::*;

/// What an endpoint says that keeps its continuous joints within ±π.
fn wrapped(sim: &Sim) -> Measured {
    let mut m = sim.measured();
    for (j, joint) in sim.guard.used().iter().enumerate() {
        if joint.limits.continuous {
            m.q[j] -= (m.q[j] / TAU).round() * TAU;
        }
    }
    m
}

fn run_wrapped(sim: &mut Sim, cycles: usize) {
    for _ in 0..cycles {
        let m = wrapped(sim);
        sim.tick_with(Some(m), None, None);
    }
}

/// Through ±π and on, there and back: no fault, and after a stop, a fault and a loss the command
/// is where it was, not a turn away.
#[test]
fn a_wrapped_angle_is_the_same_angle() {
    let mut sim = Sim::holding(pr2());
    let guard = sim.guard;
    let turn = |by: f64| moved(moved(HOME, 6, by), 4, -by);
    let there = [(0, HOME), (4000 * MS, turn(4.0)), (8000 * MS, turn(8.0))];
    sim.offer(plan(&guard, 1, JoinRule::StopThenStart, &there));
    run_wrapped(&mut sim, 8100);
    assert_eq!(sim.story(1), [Accepted, Started, Finished], "{:?}", sim.state.snapshot());
    assert_eq!(sim.last, Some(turn(8.0)));

    sim.status |= status::HALTED;
    run_wrapped(&mut sim, 100);
    assert_eq!(sim.state.snapshot().fault, Fault::Halted);
    sim.status = status::CALIBRATED;
    run_wrapped(&mut sim, 10);
    assert_eq!(sim.order(Order::Reset).verdict, Verdict::Accepted);
    run_wrapped(&mut sim, 10);
    assert_eq!(sim.mode(), Mode::Hold);
    let stood = sim.last.unwrap();
    assert!((0..7).all(|j| (stood[j] - turn(8.0)[j]).abs() < 1e-9), "{stood:?}");

    // A plan that begins a turn away begins here.
    let back = [(0, moved(stood, 6, -TAU)), (4000 * MS, moved(stood, 6, -4.0 - TAU))];
    sim.offer(plan(&guard, 2, JoinRule::StopThenStart, &back));
    run_wrapped(&mut sim, 4100);
    assert_eq!(sim.story(2), [Accepted, Started, Finished]);
    assert!((sim.last.unwrap()[6] - (stood[6] - 4.0)).abs() < 1e-9);
}

/// Turns are nothing, but half a turn is: and no other joint has turns.
#[test]
fn a_wrapped_angle_hides_no_error() {
    for (joint, by, fault) in [(6, TAU, Fault::None), (6, 2.9, Fault::FollowingError)] {
        let mut sim = in_mode(Mode::Hold);
        for _ in 0..100 {
            let m = Measured { q: moved(sim.arm, joint, by), ..sim.measured() };
            sim.tick_with(Some(m), None, None);
        }
        assert_eq!(sim.state.snapshot().fault, fault, "joint {joint} by {by}");
    }
    let mut sim = in_mode(Mode::Hold);
    for huge in [f64::MAX, -f64::MAX, 1e300] {
        let m = Measured { q: moved(sim.arm, 6, huge), ..sim.measured() };
        sim.tick_with(Some(m), None, None);
        assert!(sim.last.unwrap().iter().all(|q| q.is_finite()));
    }
    let mut sim = in_mode(Mode::Hold);
    for _ in 0..100 {
        let m = Measured { q: moved(sim.arm, 0, TAU), ..sim.measured() };
        sim.tick_with(Some(m), None, None);
    }
    assert_eq!(sim.state.snapshot().fault, Fault::FollowingError);
}
