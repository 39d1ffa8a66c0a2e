//! Cycles on a virtual clock, and what other threads see of them.

use bytemuck::Zeroable;
use nullsweep_ipc_types::{EventKind, Fault, JoinRule, Reason, Verdict, status};

use super::*;
use crate::cycle::Order;
use crate::guard::tests::pr2;
use crate::hardware::Loopback;
use crate::slots::{ServiceEnd, Slots, WorkerEnd};
use crate::testing::{HOME, MS, moved, plan};

/// An arm that stands at home.
fn at_home() -> JointStates {
    let mut states = JointStates {
        joint_count: 7,
        status: status::CALIBRATED,
        stamp_ns: 1,
        ..JointStates::zeroed()
    };
    states.positions[..MAX_DOF].copy_from_slice(&HOME[..]);
    states
}

/// A held joint that moves while a plan runs stops the arm on its path; a whole turn, a small
/// drift, or a move at rest does not.
#[test]
fn a_moving_torso_stops_the_arm() {
    for (by, stops) in [(0.0015, false), (TAU, false), (0.0025, true), (f64::NAN, true)] {
        let guard = pr2();
        let Slots { looping, mut worker, mut service } = Slots::default();
        let states = JointStates { held_count: 2, ..at_home() };
        let mut driver = Driver::new(Loopback::new(states, 2), guard, looping);
        let mut run = |cycles: std::ops::Range<u64>, torso: f64| {
            for cycle in cycles {
                driver.hardware().state.held_positions[1] = torso;
                driver.cycle(Wake { deadline_ns: cycle * MS, now_ns: cycle * MS, missed: 0 });
            }
        };
        run(1..10, 0.0);
        run(10..20, 0.3);
        let points = [(0, HOME), (400 * MS, moved(HOME, 0, 0.4))];
        worker.offers.push(plan(&guard, 1, JoinRule::StopThenStart, &points)).unwrap();
        run(20..120, 0.3);
        run(120..600, 0.3 + by);
        let end = std::iter::from_fn(|| service.events[0].pop().ok()).last().unwrap();
        if stops {
            assert_eq!((end.kind, end.why.reason), (EventKind::Aborted, Reason::HeldJoint));
            assert_eq!(driver.state().snapshot().fault, Fault::HeldJoint);
        } else {
            assert_eq!(end.kind, EventKind::Finished, "{by}");
        }
        assert_eq!(driver.mode(), Mode::Hold, "{by}");
    }
}

/// A rehearsal leaves no trace: the same setpoints, events and answers with it as without.
#[test]
fn a_rehearsed_loop_does_the_same() {
    let run = |rehearsed: bool| {
        let guard = pr2();
        let Slots { looping, mut worker, mut service } = Slots::default();
        let mut driver = Driver::new(Loopback::new(at_home(), 2), guard, looping);
        let (mut seen, mut replies) = (Vec::new(), Vec::new());
        for cycle in 1..1100 {
            match cycle {
                20 | 300 => {
                    let (near, far) = (HOME, moved(HOME, 0, 0.4));
                    let (from, to) = if cycle == 20 { (near, far) } else { (far, near) };
                    let points = [(0, from), (400 * MS, to)];
                    let plan = plan(&guard, cycle, JoinRule::AfterCurrent, &points);
                    worker.offers.push(plan).unwrap();
                }
                100 => ask(&mut service, 1, Order::Pause),
                200 => ask(&mut service, 2, Order::Resume),
                _ => {}
            }
            let wake = Wake { deadline_ns: cycle * MS, now_ns: cycle * MS, missed: 0 };
            if rehearsed {
                driver.rehearse(wake.deadline_ns);
                driver.rehearse(wake.deadline_ns);
            }
            driver.cycle(wake);
            seen.push(driver.hardware().state);
            replies.extend(std::iter::from_fn(|| service.replies.pop().ok()));
        }
        let events: Vec<_> = std::iter::from_fn(|| service.events[0].pop().ok())
            .map(|e| (e.plan, e.kind, e.why.reason))
            .collect();
        (seen, replies, events)
    };
    let (rehearsed, plain) = (run(true), run(false));
    assert_eq!(rehearsed, plain);
    assert!(plain.2.len() == 6 && plain.1.len() == 2, "{:?}", plain.2);
}

fn ask(service: &mut ServiceEnd, ticket: u64, order: Order) {
    service.claim.open(ticket);
    service.asks.push(Ask { ticket, order }).unwrap();
}

/// A loop that holds, its ends, and the cycle that comes next.
fn holding() -> (Driver<Loopback>, WorkerEnd, ServiceEnd, u64) {
    let Slots { looping, worker, service } = Slots::default();
    let mut driver = Driver::new(Loopback::new(at_home(), 2), pr2(), looping);
    for cycle in 1..20 {
        driver.cycle(at(cycle));
    }
    assert_eq!(driver.mode(), Mode::Hold);
    (driver, worker, service, 20)
}

fn at(cycle: u64) -> Wake {
    Wake { deadline_ns: cycle * MS, now_ns: cycle * MS, missed: 0 }
}

/// What was answered as withdrawn is not carried out later, whether it was still in the queue or
/// in the loop's hands already.
#[test]
fn a_withdrawn_order_is_not_carried_out() {
    for rehearsed in [false, true] {
        let (mut driver, _worker, mut service, cycle) = holding();
        ask(&mut service, 1, Order::Speed(0.5));
        if rehearsed {
            driver.rehearse(cycle * MS);
        }
        assert!(service.claim.decide(1));
        driver.cycle(at(cycle));
        driver.cycle(at(cycle + 1));
        assert_eq!(driver.state().snapshot().scale, 1.0, "rehearsed: {rehearsed}");
        assert!(service.replies.pop().is_err());
        ask(&mut service, 2, Order::Speed(0.25));
        driver.cycle(at(cycle + 2));
        assert!(!service.claim.decide(2), "the loop has decided");
        let reply = service.replies.pop().unwrap();
        assert_eq!((reply.ticket, reply.snapshot.scale), (2, 0.25));
    }
}

/// An alarm needs no queue and goes before what an operator asks, which is not lost.
#[test]
fn an_alarm_stops_the_arm_though_every_queue_is_full() {
    let (mut driver, mut worker, mut service, mut cycle) = holding();
    let alarm = Alarm::default();
    driver.heed(alarm.clone());
    let points = [(0, HOME), (4000 * MS, moved(HOME, 0, 0.4))];
    worker.offers.push(plan(&pr2(), 1, JoinRule::StopThenStart, &points)).unwrap();
    for _ in 0..500 {
        driver.cycle(at(cycle));
        cycle += 1;
    }
    assert_eq!(driver.mode(), Mode::Executing);
    while service.asks.push(Ask { ticket: 7, order: Order::Status }).is_ok() {}
    service.claim.open(7);
    alarm.ring(false);
    driver.cycle(at(cycle));
    assert_eq!(driver.mode(), Mode::Stopping);
    let reply = service.replies.pop().unwrap();
    assert_eq!((reply.ticket, reply.verdict), (Ask::SIGNAL, Verdict::Accepted));
    driver.cycle(at(cycle + 1));
    assert_eq!(service.replies.pop().unwrap().ticket, 7);
    for next in cycle + 2..cycle + 500 {
        driver.cycle(at(next));
    }
    assert_eq!(driver.mode(), Mode::Hold);
    let end = std::iter::from_fn(|| service.events[0].pop().ok()).last().unwrap();
    assert_eq!((end.kind, end.why.reason), (EventKind::Aborted, Reason::Stopped));
    alarm.shut_down();
    driver.cycle(at(cycle + 500));
    assert!(driver.state().is_down());
}
