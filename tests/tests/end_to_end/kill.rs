//! Processes that die or fall silent in mid-motion.

use std::thread;
use std::time::{Duration, Instant};

use nullsweep_ipc_types::{EventKind, Fault, Mode, PlanId};
use nullsweep_tests::stage::Part;
use nullsweep_tests::witness::PATIENCE;
use rustix::process::Signal;

use crate::common::verdict;
use crate::rig::{Rig, start_executor};

#[test]
fn the_arm_finishes_and_holds_when_the_planner_dies() {
    let mut rig = Rig::start();
    let mut args = rig.stage.place().to_vec();
    args.extend(["--stay", "--swings", "2", "--speed", "0.2"].map(Into::into));
    let mut planner = rig.stage.start(Part::Sketch, "planner", args).expect("it starts");
    let plan = wait_for_plan(&mut rig);
    planner.kill().expect("it can be killed");
    rig.ends(plan, EventKind::Finished);
    let held = rig.witness.mode(Mode::Hold).expect("it holds");
    assert_eq!(held.commanded[..7], rig.arm.home()[..7]);

    // What the dead planner left behind does not hinder the next one.
    let plan = rig.run(&rig.swings(1.0));
    rig.ends(plan, EventKind::Finished);
    rig.verdict();
}

#[test]
fn the_mock_stops_by_itself_when_the_executor_dies() {
    let mut rig = Rig::start();
    let sketch = rig.swings(10.0);
    let plan = rig.run(&sketch);
    rig.executor.kill().expect("it can be killed");
    thread::sleep(Duration::from_secs(1));

    // A new executor takes over without any cleaning by hand, holds, and starts no old plan.
    let executor = start_executor(&rig.stage, "executor-2");
    let held =
        rig.witness.mode(Mode::Hold).unwrap_or_else(|e| panic!("{e}: {}", executor.stderr()));
    assert_eq!(held.plan, PlanId::NONE);
    let away = (0..7).map(|j| (held.commanded[j] - rig.arm.home()[j]).abs()).fold(0.0, f64::max);
    let settled = rig.witness.see("another snapshot", |t| t.cycle > held.cycle + 500);
    let settled = settled.expect("telemetry goes on");
    assert_eq!(settled.plan, PlanId::NONE);
    assert_eq!(settled.commanded, held.commanded, "it stands, {away} rad from home");
    let of_old = rig.witness.events().iter().filter(|e| e.plan == plan);
    assert!(of_old.clone().all(|e| e.kind <= EventKind::Started.wire()), "no end was told");

    let found = verdict(&rig.stage, &mut rig.mock);
    assert_eq!(found["violations"], 0, "{found:#}");
    assert_eq!(found["endpoint"]["timeouts"], 1, "{found:#}");
    assert_eq!(found["verdict"]["sessions"], 2, "{found:#}");
}

#[test]
fn the_executor_stops_when_the_state_goes_stale() {
    let mut rig = Rig::start();
    let plan = rig.run(&rig.swings(10.0));
    rig.mock.signal(Signal::STOP).expect("the mock can be stopped");
    let end = rig.ends(plan, EventKind::Aborted);
    assert_eq!(end.plan, plan);
    let faulty = rig.witness.mode(Mode::Fault).expect("a fault is latched");
    let fault = Fault::from_wire(faulty.fault);
    assert!(matches!(fault, Some(Fault::StaleState | Fault::CommunicationLost)), "{fault:?}");
    let later = rig.witness.see("later", |t| t.cycle > faulty.cycle + 200).expect("telemetry");
    let last = rig.witness.see("still later", |t| t.cycle > later.cycle + 200).expect("telemetry");
    assert_eq!(later.commanded, last.commanded, "it stands");
    rig.mock.signal(Signal::CONT).expect("the mock goes on");
    let found = rig.verdict();
    assert!(found["verdict"]["lost_by_reader"].as_u64() > Some(0), "{found:#}");
}

/// The first plan that anybody started.
fn wait_for_plan(rig: &mut Rig) -> PlanId {
    let end = Instant::now() + PATIENCE;
    while Instant::now() < end {
        rig.witness.look().expect("events");
        let started = |kind| kind == EventKind::Started.wire();
        if let Some(event) = rig.witness.events().iter().find(|e| started(e.kind)) {
            return event.plan;
        }
        thread::sleep(Duration::from_millis(5));
    }
    panic!("no plan was started: {}", rig.witness);
}
