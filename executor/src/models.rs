//! The orders in which the threads can meet between two operations on what they share, drawn by
//! lot: `cargo test -p nullsweep-executor --features model --lib models`. An order that fails is
//! printed, and replayed with `shuttle::replay`.

use bytemuck::Zeroable;
use nullsweep_ipc_types::{EventKind, JoinRule, JointStates, status};
use shuttle::scheduler::RandomScheduler;
use shuttle::thread;
use shuttle::{Config, Runner};

use crate::cycle::{Ask, Order};
use crate::guard::tests::pr2;
use crate::record::{Recorder, replay};
use crate::rt::Wake;
use crate::slots::{LoopEnd, Slots};
use crate::testing::{HOME, MS, moved, plan};
use crate::{Driver, Loopback};

/// Tries so many orders.
fn orders(count: usize, run: impl Fn() + Send + Sync + 'static) {
    let mut config = Config::new();
    config.stack_size = 8 << 20;
    Runner::new(RandomScheduler::new_from_seed(1, count), config).run(run);
}

fn driver(looping: LoopEnd) -> Driver<Loopback> {
    let mut states = JointStates {
        joint_count: 7,
        status: status::CALIBRATED,
        stamp_ns: 1,
        ..JointStates::zeroed()
    };
    states.positions[..8].copy_from_slice(&HOME[..]);
    Driver::new(Loopback::new(states, 2), pr2(), looping)
}

fn wake(cycle: u64) -> Wake {
    Wake { deadline_ns: cycle * MS, now_ns: cycle * MS + 3, missed: 0 }
}

/// Each order is either carried out, and answered by the loop, or withdrawn, and answered as busy.
#[test]
fn an_order_is_carried_out_or_withdrawn_and_never_both() {
    orders(3000, || {
        let Slots { looping, mut service, worker: _worker } = Slots::default();
        let looped = thread::spawn(move || {
            let mut driver = driver(looping);
            for cycle in 1..=6 {
                driver.rehearse(cycle * MS);
                driver.cycle(wake(cycle));
            }
            driver
        });
        let mut withdrawn = Vec::new();
        for ticket in 1..=3 {
            service.claim.open(ticket);
            service.asks.push(Ask { ticket, order: Order::Pause }).unwrap();
            thread::yield_now();
            if service.claim.decide(ticket) {
                withdrawn.push(ticket);
            }
        }
        let mut driver = looped.join().unwrap();
        // What it has taken in beforehand it carries out in the next cycle.
        driver.cycle(wake(7));
        let mut carried = Vec::new();
        while let Ok(reply) = service.replies.pop() {
            carried.push(reply.ticket);
        }
        let mut all = [withdrawn, carried].concat();
        all.sort_unstable();
        assert_eq!(all, [1, 2, 3], "an order was lost, or carried out and withdrawn");
    });
}

/// Whatever the worker misses, no recording has a hole in it, and recording goes on.
#[test]
fn a_recording_has_no_hole() {
    orders(400, || {
        let folder = tempfile::TempDir::new().unwrap();
        let (mut recorder, tape) = Recorder::new(folder.path(), 1 << 30, pr2()).unwrap();
        let Slots { looping, mut worker, service: _service } = Slots::default();
        let looped = thread::spawn(move || {
            let mut driver = driver(looping);
            driver.record(tape);
            (1..=40).for_each(|cycle| driver.cycle(wake(cycle)));
            driver
        });
        for round in 0..6 {
            if round == 2 {
                let points = [(0, HOME), (10 * MS, moved(HOME, 0, 0.005))];
                let plan = plan(&pr2(), 1, JoinRule::StopThenStart, &points);
                recorder.plan(&plan);
                worker.offers.push(plan).unwrap();
            }
            recorder.round().unwrap();
            thread::yield_now();
        }
        let mut driver = looped.join().unwrap();
        recorder.round().unwrap();
        // The plan, if it was lost, is over long before.
        let last = 1000;
        for cycle in 41..=last {
            driver.cycle(wake(cycle));
            recorder.round().unwrap();
        }
        recorder.finish().unwrap();
        let mut newest = 0;
        for turn in 0..2 {
            let path = folder.path().join(format!("flight-{turn}.nswrec"));
            if path.exists() {
                let replayed = replay(&path).unwrap_or_else(|e| panic!("{e}"));
                newest = newest.max(replayed.setpoints);
            }
        }
        assert!(newest > 0, "recording did not go on");
        let ended = driver.state().sequence();
        assert!(ended >= last - 3, "{ended} setpoints");
    });
}

/// While the service does nothing for long, no event is lost: the loop takes plans as it has room.
#[test]
fn each_plan_is_told_of_however_late_the_service_looks() {
    orders(300, || {
        let Slots { looping, mut worker, mut service } = Slots::default();
        const PLANS: u64 = 7;
        let looped = thread::spawn(move || {
            let mut driver = driver(looping);
            (1..=60).for_each(|cycle| driver.cycle(wake(cycle)));
            driver
        });
        let offered = thread::spawn(move || {
            for number in 1..=PLANS {
                // Elsewhere than the arm: the loop refuses it.
                let points = [0.4, 0.401].map(|by| moved(HOME, 0, by));
                let points = [(0, points[0]), (10 * MS, points[1])];
                let plan = plan(&pr2(), number, JoinRule::StopThenStart, &points);
                worker.offers.push(plan).unwrap();
                thread::yield_now();
            }
            worker
        });
        let mut told = Vec::new();
        for _ in 0..10 {
            told.extend(service.events[0].pop());
            thread::yield_now();
        }
        let (mut driver, _worker) = (looped.join().unwrap(), offered.join().unwrap());
        for cycle in 61..=120 {
            driver.cycle(wake(cycle));
            told.extend(service.events[0].pop());
        }
        let answers = [EventKind::Accepted, EventKind::Rejected];
        let admissions = told.iter().filter(|event| answers.contains(&event.kind)).count();
        assert_eq!(admissions as u64, PLANS, "{told:?}");
    });
}
