//! States and events, the join rules, and supervision, on a virtual clock.

mod answers;
mod clocks;
mod faults;
mod goals;
mod joins;
mod motion;
mod tables;
mod turns;

use EventKind::{Aborted, Accepted, Finished, Rejected, Started, Superseded};
use nullsweep_ipc_types::{
    EventKind, Fault, Interpolation, JoinRule, Mode, PlanId, Reason, Verdict, status,
};

use crate::JointVector;
use crate::cycle::{Event, Measured, Order};
use crate::guard::tests::pr2;
use crate::testing::{HOME, MS, Sim, cubic, joining, moved, plan, plan_with, tireless};

fn id(number: u64) -> PlanId {
    PlanId { epoch: 1000, number }
}

/// Joint 0 there and on: 0.4 rad in 0.4 s, knots each 50 ms.
fn line(from: JointVector) -> Vec<(u64, JointVector)> {
    (0..=8u32).map(|i| (u64::from(i) * 50 * MS, moved(from, 0, 0.05 * f64::from(i)))).collect()
}

fn only(events: &[Event], kind: EventKind) -> Event {
    let found: Vec<_> = events.iter().filter(|e| e.kind == kind).collect();
    assert_eq!(found.len(), 1, "{kind} in {events:?}");
    *found[0]
}

/// A virtual arm that has come to a mode.
fn in_mode(mode: Mode) -> Sim {
    let guard = pr2();
    if mode == Mode::Init {
        let mut sim = Sim::new(guard);
        sim.status = 0;
        sim.run(5);
        assert_eq!(sim.mode(), mode);
        return sim;
    }
    let mut sim = Sim::holding(guard);
    if mode != Mode::Hold {
        sim.offer(plan(&guard, 1, JoinRule::StopThenStart, &line(HOME)));
        sim.run(100);
    }
    match mode {
        Mode::Paused => {
            sim.order(Order::Pause);
            sim.run_until(Mode::Paused, 200);
        }
        Mode::Stopping => {
            sim.order(Order::Stop);
        }
        Mode::Fault => {
            sim.status |= status::ERROR;
            sim.run(2);
        }
        Mode::Init | Mode::Hold | Mode::Executing => {}
    }
    assert_eq!(sim.mode(), mode);
    sim
}
