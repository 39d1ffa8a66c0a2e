//! Plans, joins, pauses and stops, on a virtual clock.

use super::*;

#[test]
fn runs_a_plan_to_its_exact_end() {
    for kind in ["linear", "cubic"] {
        let mut sim = Sim::holding(tireless());
        let guard = sim.guard;
        let points = line(HOME);
        let plan = if kind == "cubic" {
            cubic(&guard, 1, &points)
        } else {
            plan(&guard, 1, JoinRule::StopThenStart, &points)
        };
        sim.offer(plan);
        assert_eq!(sim.mode(), Mode::Executing);
        sim.run(398);
        assert_eq!(sim.mode(), Mode::Executing);
        sim.run(1);
        assert_eq!(sim.last, Some(points[8].1), "the last knot is commanded");
        assert_eq!(sim.story(1), [Accepted, Started], "but the arm has not settled there yet");
        sim.run(51);
        assert_eq!(sim.story(1), [Accepted, Started, Finished], "{kind}");
        assert_eq!(sim.mode(), Mode::Hold);
        assert_eq!(sim.last, Some(points[8].1), "the last knot is hit bit for bit");
        sim.run(50);
        assert_eq!(sim.last, Some(points[8].1));
        assert_eq!(sim.last_v, JointVector::ZERO);
    }
}

#[test]
fn a_connector_leads_to_the_first_knot() {
    let mut sim = Sim::holding(tireless());
    let guard = sim.guard;
    let from = moved(moved(HOME, 0, 0.015), 5, -0.01);
    sim.offer(cubic(&guard, 1, &line(from)));
    sim.top_acceleration = 0.0;
    let mut cycles = 0;
    while sim.state.snapshot().plan_time_ns == 0 {
        sim.run(1);
        cycles += 1;
    }
    // Rest to rest over 0.015 rad at 2 rad/s² takes 173 ms.
    assert!((172..=174).contains(&cycles), "{cycles}");
    sim.run_until(Mode::Hold, 2000);
    assert_eq!(sim.last, Some(moved(from, 0, 0.4)));

    let far = moved(HOME, 3, 0.0201);
    let e = only(&sim.offer(plan(&guard, 2, JoinRule::StopThenStart, &line(far))), Rejected);
    assert_eq!((e.why.reason, e.why.joint), (Reason::Start, 0), "joint 0 has moved on by 0.4");
    assert_eq!(sim.mode(), Mode::Hold);
}

#[test]
fn whole_turns_of_a_continuous_joint_are_no_distance() {
    let mut sim = Sim::holding(pr2());
    let guard = sim.guard;
    let turned = moved(HOME, 6, 3.0 * core::f64::consts::TAU);
    sim.offer(plan(&guard, 1, JoinRule::StopThenStart, &line(turned)));
    sim.run_until(Mode::Hold, 1000);
    assert_eq!(sim.story(1), [Accepted, Started, Finished]);
    let last = sim.last.unwrap();
    assert!((last[6] - HOME[6]).abs() < 1e-9, "it does not unwind: {}", last[6]);
}

#[test]
fn joins_at_a_knot_without_a_stop() {
    let mut sim = Sim::holding(pr2());
    let guard = sim.guard;
    let old = line(HOME);
    sim.offer(plan(&guard, 1, JoinRule::StopThenStart, &old));
    sim.run(120);
    let at = old[5].1;
    let new = vec![(0, at), (100 * MS, moved(at, 1, 0.1)), (300 * MS, moved(at, 1, 0.2))];
    assert_eq!(only(&sim.offer(joining(&guard, 2, &new, id(1), 5)), Accepted).plan, id(2));
    for cycle in 123..=250 {
        assert_eq!(sim.story(2), [Accepted], "cycle {cycle}");
        sim.run(1);
    }
    // The plan's 250th cycle is the knot's time: it is commanded exactly and the new plan has begun.
    assert_eq!(sim.story(1), [Accepted, Started, Superseded]);
    assert_eq!(sim.story(2), [Accepted, Started]);
    assert_eq!(sim.last, Some(at));
    sim.run(100);
    assert_eq!(sim.last, Some(moved(at, 1, 0.1)));
    sim.run_until(Mode::Hold, 1000);
    assert_eq!(sim.story(2), [Accepted, Started, Finished]);
}

#[test]
fn a_join_that_does_not_fit_leaves_the_plan_alone() {
    let mut sim = Sim::holding(pr2());
    let guard = sim.guard;
    let old = line(HOME);
    sim.offer(plan(&guard, 1, JoinRule::StopThenStart, &old));
    sim.run(120);
    let from = |k: usize| line(old[k].1);
    let cases = [
        (joining(&guard, 2, &from(2), id(1), 2), Reason::JoinKnot),
        (joining(&guard, 3, &from(5), id(1), 9), Reason::JoinKnot),
        (joining(&guard, 4, &from(5), id(7), 5), Reason::JoinPlan),
        (joining(&guard, 5, &from(4), id(1), 5), Reason::Start),
        (plan(&guard, 6, JoinRule::StopThenStart, &from(8)), Reason::Start),
        (plan(&guard, 7, JoinRule::AfterCurrent, &from(7)), Reason::Start),
    ];
    for (offer, reason) in cases {
        let events = sim.offer(offer);
        assert_eq!(only(&events, Rejected).why.reason, reason);
        assert_eq!(events.len(), 1);
    }
    sim.run_until(Mode::Hold, 1000);
    assert_eq!(sim.story(1), [Accepted, Started, Finished]);
    assert_eq!(sim.last, Some(old[8].1));
}

#[test]
fn curves_must_meet_in_velocity_too() {
    let mut sim = Sim::holding(tireless());
    let guard = sim.guard;
    let points = line(HOME);
    // Under way from the first knot on: not from a stand-still.
    let running_start = |number, speed: f64, joined: Option<PlanId>| {
        plan_with(&guard, number, &points, |h, knots| {
            h.interpolation = Interpolation::Cubic.wire();
            let last = knots.len() - 1;
            for knot in &mut knots[..last] {
                knot.velocities[0] = speed;
            }
            if let Some(joined) = joined {
                for knot in knots {
                    knot.positions[0] += 0.2;
                }
                h.join_rule = JoinRule::AtKnot.wire();
                (h.join_plan, h.join_knot) = (joined, 4);
            }
        })
    };
    let why = only(&sim.offer(running_start(1, 1.0, None)), Rejected).why;
    assert_eq!((why.reason, why.joint, why.value), (Reason::Speed, 0, 1.0));
    only(&sim.offer(cubic(&guard, 2, &points)), Accepted);
    only(&sim.offer(running_start(3, 0.5, Some(id(2)))), Rejected);
    only(&sim.offer(running_start(4, 1.0, Some(id(2)))), Accepted);
    sim.top_acceleration = 0.0;
    sim.run(198);
    assert_eq!(sim.story(4), [Accepted, Started]);
    assert!((sim.last_v[0] - 1.0).abs() < 1e-6, "{}", sim.last_v[0]);
    sim.run_until(Mode::Hold, 1000);
}

#[test]
fn stop_then_start_stops_where_it_was_predicted() {
    let mut sim = Sim::holding(pr2());
    let guard = sim.guard;
    sim.offer(plan(&guard, 1, JoinRule::StopThenStart, &line(HOME)));
    sim.run(150);
    // 1 rad/s at 10 rad/s² is 0.05 rad past the 0.151 rad of this cycle, within a step.
    let stop = moved(HOME, 0, 0.2005);
    let events = sim.offer(plan(&guard, 2, JoinRule::StopThenStart, &line(stop)));
    assert_eq!(events.iter().map(|e| e.kind).collect::<Vec<_>>(), [Accepted]);
    assert_eq!(sim.mode(), Mode::Stopping);
    // Another one that would not fit is rejected while the first waits.
    let away = moved(stop, 0, 0.1);
    only(&sim.offer(plan(&guard, 3, JoinRule::StopThenStart, &line(away))), Rejected);
    sim.run_until(Mode::Executing, 110);
    assert_eq!(sim.story(1), [Accepted, Started, Superseded]);
    assert_eq!(sim.story(2), [Accepted, Started]);
    sim.run_until(Mode::Hold, 1000);
    assert_eq!(sim.last, Some(moved(stop, 0, 0.4)));
}

#[test]
fn a_plan_that_was_stopped_is_told_with_its_knot_until_another_one_begins() {
    let mut sim = Sim::holding(pr2());
    let guard = sim.guard;
    let left = |sim: &Sim| (sim.state.snapshot().stopped, sim.state.snapshot().plan);
    sim.offer(plan(&guard, 1, JoinRule::StopThenStart, &line(HOME)));
    sim.run(150);
    assert_eq!(left(&sim), (None, id(1)));
    sim.order(Order::Stop);
    sim.run_until(Mode::Hold, 110);
    // At 0.2005 rad, knots are 0.05 rad apart.
    assert_eq!(left(&sim), (Some(4), PlanId::NONE));
    sim.run(500);
    let at = moved(HOME, 0, 0.2005);
    only(&sim.offer(plan(&guard, 2, JoinRule::StopThenStart, &line(at))), Accepted);
    assert_eq!(left(&sim), (None, id(2)));
    sim.run_until(Mode::Hold, 1000);
    assert_eq!(left(&sim), (None, PlanId::NONE), "it has come to its end");
}

#[test]
fn plans_wait_in_line_and_the_newest_wins() {
    let mut sim = Sim::holding(pr2());
    let guard = sim.guard;
    let points = line(HOME);
    let back: Vec<_> = (0..9).map(|i| (points[i].0, points[8 - i].1)).collect();
    sim.offer(plan(&guard, 1, JoinRule::AfterCurrent, &points));
    for (number, points) in [(2, &back), (3, &points), (4, &back), (5, &points)] {
        only(&sim.offer(plan(&guard, number, JoinRule::AfterCurrent, points)), Accepted);
    }
    let full = sim.offer(plan(&guard, 6, JoinRule::AfterCurrent, &back));
    assert_eq!(only(&full, Rejected).why.reason, Reason::QueueFull);
    sim.run(460);
    assert_eq!(sim.story(1), [Accepted, Started, Finished]);
    assert_eq!(sim.story(2), [Accepted, Started]);
    let at = back[4].1;
    sim.offer(joining(&guard, 7, &line(at), id(2), 4));
    for number in 3..=5 {
        assert_eq!(sim.story(number), [Accepted, Superseded], "{number}");
    }
    // Two that would join: the later one wins, the running plan is the same.
    sim.offer(joining(&guard, 8, &line(at), id(2), 4));
    assert_eq!(sim.story(7), [Accepted, Superseded]);
    sim.run_until(Mode::Hold, 2000);
    assert_eq!(sim.story(2), [Accepted, Started, Superseded]);
    assert_eq!(sim.story(8), [Accepted, Started, Finished]);
}

#[test]
fn pause_speed_and_resume_are_ramps_on_the_path() {
    let mut sim = Sim::holding(pr2());
    let guard = sim.guard;
    let points = line(HOME);
    sim.offer(plan(&guard, 1, JoinRule::StopThenStart, &points));
    sim.run(50);
    sim.top_acceleration = 0.0;
    assert_eq!(sim.order(Order::Speed(0.5)).verdict, Verdict::Accepted);
    sim.run(60);
    assert!((sim.last_v[0] - 0.5).abs() < 1e-9, "{}", sim.last_v[0]);
    assert_eq!(sim.order(Order::Pause).verdict, Verdict::Accepted);
    assert_eq!(sim.mode(), Mode::Executing, "it still slows down");
    sim.run_until(Mode::Paused, 100);
    let held = sim.last;
    sim.run(500);
    assert_eq!(sim.last, held);
    assert_eq!(sim.order(Order::Resume).verdict, Verdict::Accepted);
    assert_eq!(sim.mode(), Mode::Executing);
    sim.order(Order::Speed(1.0));
    sim.run(110);
    assert!((sim.last_v[0] - 1.0).abs() < 1e-9);
    assert!(sim.top_acceleration <= 10.0 + 1e-6, "{}", sim.top_acceleration);
    sim.run_until(Mode::Hold, 1000);
    assert_eq!(sim.last, Some(points[8].1));
    for bad in [-0.1, 1.1, f64::NAN, f64::INFINITY] {
        assert_eq!(sim.order(Order::Speed(bad)).verdict, Verdict::BadValue);
    }
}

#[test]
fn a_plan_that_replaces_a_paused_one_waits_for_the_resume() {
    let mut sim = Sim::holding(pr2());
    let guard = sim.guard;
    sim.offer(plan(&guard, 1, JoinRule::StopThenStart, &line(HOME)));
    sim.run(100);
    sim.order(Order::Pause);
    sim.run_until(Mode::Paused, 200);
    let held = sim.last.unwrap();
    sim.offer(plan(&guard, 2, JoinRule::StopThenStart, &line(held)));
    sim.run(200);
    assert_eq!(sim.mode(), Mode::Paused);
    assert_eq!(sim.story(1), [Accepted, Started, Superseded]);
    assert_eq!(sim.last, Some(held));
    sim.order(Order::Resume);
    sim.run_until(Mode::Hold, 1000);
    assert_eq!(sim.story(2), [Accepted, Started, Finished]);
}

#[test]
fn stop_drops_every_plan_and_disable_comes_at_stand_still() {
    for disable in [false, true] {
        let mut sim = Sim::holding(pr2());
        let guard = sim.guard;
        let points = line(HOME);
        sim.offer(plan(&guard, 1, JoinRule::StopThenStart, &points));
        let back: Vec<_> = (0..9).map(|i| (points[i].0, points[8 - i].1)).collect();
        sim.offer(plan(&guard, 2, JoinRule::AfterCurrent, &back));
        sim.run(100);
        sim.top_acceleration = 0.0;
        let order = if disable { Order::StopAndDisable } else { Order::Stop };
        assert_eq!(sim.order(order).verdict, Verdict::Accepted);
        assert_eq!(sim.mode(), Mode::Stopping);
        assert_eq!(sim.story(2), [Accepted, Aborted]);
        only(&sim.offer(plan(&guard, 3, JoinRule::StopThenStart, &line(HOME))), Rejected);
        while sim.mode() == Mode::Stopping {
            let out = sim.tick(None, None);
            assert!(!out.setpoint.unwrap().disable || sim.mode() == Mode::Hold);
        }
        assert!(sim.top_acceleration <= 10.0 + 1e-6, "{}", sim.top_acceleration);
        assert_eq!(sim.story(1), [Accepted, Started, Aborted]);
        assert_eq!(sim.events.last().unwrap().why.reason, Reason::Stopped);
        assert_eq!(sim.tick(None, None).setpoint.unwrap().disable, disable);
        let held = sim.last.unwrap();
        let next = plan(&guard, 4, JoinRule::StopThenStart, &line(held));
        if disable {
            assert_eq!(only(&sim.offer(next), Rejected).why.reason, Reason::NotReady);
            assert_eq!(sim.order(Order::Resume).verdict, Verdict::Accepted);
            sim.run(3);
            assert_eq!(sim.mode(), Mode::Hold);
            assert!(!sim.tick(None, None).setpoint.unwrap().disable);
        } else {
            only(&sim.offer(next), Accepted);
        }
    }
}

#[test]
fn shutdown_stops_tells_and_stays_down() {
    let mut sim = Sim::holding(pr2());
    let guard = sim.guard;
    sim.offer(plan(&guard, 1, JoinRule::StopThenStart, &line(HOME)));
    sim.run(100);
    sim.order(Order::Shutdown);
    assert!(!sim.state.is_down());
    sim.run(110);
    assert!(sim.state.is_down());
    assert_eq!(sim.events.last().unwrap().why.reason, Reason::Shutdown);
    assert_eq!(sim.order(Order::Resume).verdict, Verdict::WrongMode);
    assert!(sim.tick(None, None).setpoint.unwrap().disable);
}
