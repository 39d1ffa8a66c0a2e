//! A plan is finished when the arm rests at its end, not when its last knot was commanded.

use super::*;

/// Runs the plan of `line` with an arm that is `off` in joint 2 until `until`, in cycles.
fn off_until(until: usize, off: f64) -> Sim {
    let mut sim = Sim::holding(pr2());
    let guard = sim.guard;
    sim.offer(plan(&guard, 1, JoinRule::StopThenStart, &line(HOME)));
    let end = moved(HOME, 0, 0.4);
    sim.offer(plan(&guard, 2, JoinRule::AfterCurrent, &line(end)));
    for cycle in 0..1600 {
        let by = if cycle < until { off } else { 0.0 };
        let m = Measured { q: moved(sim.arm, 2, by), ..sim.measured() };
        sim.tick_with(Some(m), None, None);
    }
    sim
}

#[test]
fn an_arm_that_does_not_come_to_the_end_ends_the_plan() {
    for off in [0.021, -0.03, 0.09] {
        let sim = off_until(usize::MAX, off);
        assert_eq!(sim.story(1), [Accepted, Started, Aborted], "{off}");
        assert_eq!(sim.story(2), [Accepted, Aborted], "{off}: it was to begin there");
        let why = sim.events[sim.events.len() - 2].why;
        assert_eq!((why.reason, why.joint, why.knot), (Reason::Goal, 2, 8), "{off}");
        assert!((why.value - off.abs()).abs() < 1e-9 && why.bound == 0.02, "{why:?}");
        let snapshot = sim.state.snapshot();
        assert_eq!((snapshot.mode, snapshot.fault), (Mode::Hold, Fault::FollowingError));
    }
}

#[test]
fn an_arm_that_comes_late_to_the_end_finishes_the_plan() {
    for off in [0.019, 0.09] {
        let sim = off_until(1200, off);
        assert_eq!(sim.story(1), [Accepted, Started, Finished], "{off}");
    }
    // Neither an arm that only swings through is there, nor one that is no number.
    let mut sim = Sim::holding(pr2());
    let guard = sim.guard;
    sim.offer(plan(&guard, 1, JoinRule::StopThenStart, &line(HOME)));
    for cycle in 0..1600 {
        let by = if cycle % 40 < 20 { 0.03 } else { 0.0 };
        let m = Measured { q: moved(sim.arm, 2, by), ..sim.measured() };
        sim.tick_with(Some(m), None, None);
    }
    assert_eq!(sim.story(1), [Accepted, Started, Aborted]);
    assert_eq!(sim.events.last().unwrap().why.reason, Reason::Goal);
}

/// While the arm is waited for, orders and plans are taken as in motion.
#[test]
fn the_wait_for_the_arm_can_be_ended() {
    let waiting = || {
        let mut sim = Sim::holding(pr2());
        let guard = sim.guard;
        sim.offer(plan(&guard, 1, JoinRule::StopThenStart, &line(HOME)));
        for _ in 0..500 {
            let m = Measured { q: moved(sim.arm, 2, 0.05), ..sim.measured() };
            sim.tick_with(Some(m), None, None);
        }
        assert_eq!((sim.mode(), sim.last), (Mode::Executing, Some(moved(HOME, 0, 0.4))));
        sim
    };
    let mut sim = waiting();
    assert_eq!(sim.order(Order::Stop).verdict, Verdict::Accepted);
    assert_eq!((sim.mode(), sim.story(1)), (Mode::Hold, vec![Accepted, Started, Aborted]));
    assert_eq!(sim.events.last().unwrap().why.reason, Reason::Stopped);

    let mut sim = waiting();
    let guard = sim.guard;
    sim.offer(plan(&guard, 2, JoinRule::StopThenStart, &line(moved(HOME, 0, 0.4))));
    sim.run(3);
    assert_eq!(sim.story(1), [Accepted, Started, Superseded]);
    sim.run_until(Mode::Hold, 1000);
    assert_eq!(sim.story(2), [Accepted, Started, Finished]);

    let mut sim = waiting();
    assert_eq!(sim.order(Order::Pause).verdict, Verdict::Accepted);
    sim.run(200);
    assert_eq!((sim.mode(), sim.story(1)), (Mode::Hold, vec![Accepted, Started, Finished]));

    let mut sim = waiting();
    sim.speaks = false;
    sim.run(30);
    assert_eq!((sim.mode(), sim.story(1)), (Mode::Hold, vec![Accepted, Started, Aborted]));
    assert_eq!(sim.state.snapshot().fault, Fault::StaleState);
}
