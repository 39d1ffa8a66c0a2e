//! One cycle around [`crate::cycle::step`]: read the endpoint, take what waits in the slots, step,
//! command, hand on. Generic over the endpoint and given its time, so it runs on a virtual clock
//! as well.

use core::f64::consts::{PI, TAU};
use std::sync::Arc;

use nullsweep_ipc_types::ports::now_ns;
use nullsweep_ipc_types::{
    HISTOGRAM_BUCKETS, JointStates, MAX_HELD_JOINTS, MAX_JOINTS, Mode, PlanId, Setpoint,
    bucket_upper_ns,
};

use crate::MAX_DOF;
use crate::admit::Held;
use crate::cycle::{HELD_MOVED, Input, Measured, State, Target, step};
use crate::guard::Guard;
use crate::hardware::Hardware;
use crate::record::Tape;
use crate::rt::Wake;
use crate::slots::{Report, Slots};

/// Cycles between two reports.
const REPORT_EVERY: u64 = 10;

/// The loop's own data: everything that one cycle touches.
#[derive(Debug)]
pub struct Driver<H> {
    hardware: H,
    guard: Guard,
    state: State,
    slots: Arc<Slots>,
    tape: Option<Arc<Tape>>,
    /// Where the held joints stood when the motion began.
    reference: Option<Held>,
    lateness: [u32; HISTOGRAM_BUCKETS],
    compute: [u32; HISTOGRAM_BUCKETS],
    cycles: u64,
    /// Reads and writes that failed.
    failures: u64,
}

impl<H: Hardware> Driver<H> {
    /// A loop that has not run yet.
    pub fn new(hardware: H, guard: Guard, slots: Arc<Slots>) -> Self {
        Self {
            hardware,
            guard,
            state: State::default(),
            slots,
            tape: None,
            reference: None,
            lateness: [0; HISTOGRAM_BUCKETS],
            compute: [0; HISTOGRAM_BUCKETS],
            cycles: 0,
            failures: 0,
        }
    }

    /// Hands every cycle on to the flight recorder.
    pub(crate) fn record(&mut self, tape: Arc<Tape>) {
        self.tape = Some(tape);
    }

    /// The endpoint.
    pub fn hardware(&mut self) -> &mut H {
        &mut self.hardware
    }

    /// The loop's memory.
    #[must_use]
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Reads and writes that failed so far.
    #[must_use]
    pub fn failures(&self) -> u64 {
        self.failures
    }

    /// Wake-up lateness and compute time a cycle, in buckets.
    #[must_use]
    pub fn histograms(&self) -> ([u32; HISTOGRAM_BUCKETS], [u32; HISTOGRAM_BUCKETS]) {
        (self.lateness, self.compute)
    }

    /// The mode after the last cycle.
    #[must_use]
    pub fn mode(&self) -> Mode {
        self.state.snapshot().mode
    }

    /// Runs one cycle.
    pub fn cycle(&mut self, wake: Wake) {
        self.cycles += 1;
        let states = self.hardware.read().unwrap_or_else(|_| {
            self.failures += 1;
            None
        });
        let measured = states.as_ref().map(|states| {
            let held = held(states);
            // Each cycle, so that the worker has them before anybody can have seen Hold.
            self.slots.held.force_push(held);
            let mut measured = measured(states);
            if self.has_moved(held) {
                measured.status |= HELD_MOVED;
            }
            measured
        });
        let room = self.slots.has_room_for_events();
        let input = Input {
            measured,
            ask: self.slots.asks.pop(),
            offer: if room { self.slots.offers.pop() } else { None },
            missed: wake.missed,
        };
        let record = self.tape.is_some().then(|| Tape::input(&input, wake.now_ns));
        let out = step(&mut self.state, input, wake.now_ns, &self.guard);
        if let Some(target) = &out.setpoint
            && self.hardware.write(&self.setpoint(target, wake)).is_err()
        {
            self.failures += 1;
        }
        if let (Some(tape), Some(record)) = (&self.tape, record) {
            tape.push(record, out.setpoint.as_ref(), &self.state);
        }
        for event in &out.events {
            // There is room: asked before the plan was taken, and faults end what was taken.
            let _ = self.slots.events.push(*event);
        }
        for plan in out.retired {
            if let Err(plan) = self.slots.retired.push(plan) {
                // Freeing here would enter the heap; the worker is stuck anyway.
                std::mem::forget(plan);
            }
        }
        if let Some(reply) = out.reply {
            self.slots.replies.force_push(reply);
        }
        if self.cycles.is_multiple_of(REPORT_EVERY) {
            self.slots.reports.force_push(Report {
                stamp_ns: wake.now_ns,
                snapshot: self.state.snapshot(),
                lateness: self.lateness,
                compute: self.compute,
            });
        }
    }

    /// Counts a wake-up and how long its cycle took, with the lateness of each deadline that was
    /// missed: a stall of m cycles contributes m samples.
    pub fn account(&mut self, wake: Wake) {
        let done = now_ns();
        for i in 0..=u64::from(wake.missed.min(10_000)) {
            let late = wake.lateness_ns() + i * self.guard.period_ns;
            count(&mut self.lateness, late);
        }
        count(&mut self.compute, done.saturating_sub(wake.now_ns));
    }

    /// Whether a held joint has moved since the motion began.
    fn has_moved(&mut self, held: Held) -> bool {
        let resting = self.state.snapshot().plan == PlanId::NONE;
        match &self.reference {
            Some(reference) if !resting => {
                let bound = self.guard.held_drift;
                reference.count != held.count
                    || reference.positions[..held.count]
                        .iter()
                        .zip(&held.positions)
                        .any(|(then, now)| !(turned(*then, *now) <= bound))
            }
            _ => {
                self.reference = Some(held);
                false
            }
        }
    }

    fn setpoint(&self, target: &Target, wake: Wake) -> Setpoint {
        Setpoint {
            sequence: target.sequence,
            stamp_ns: wake.now_ns,
            deadline_ns: wake.deadline_ns + self.guard.period_ns,
            plan: target.plan,
            positions: widen(&target.q),
            velocities: widen(&target.v),
            joint_count: self.guard.dof as u32,
            mode: target.mode.wire(),
            knot: target.knot,
            disable: u32::from(target.disable),
        }
    }
}

/// A joint array as the wire has it.
pub(crate) fn widen(q: &[f64; MAX_DOF]) -> [f64; MAX_JOINTS] {
    let mut wide = [0.0; MAX_JOINTS];
    wide[..MAX_DOF].copy_from_slice(q);
    wide
}

fn measured(states: &JointStates) -> Measured {
    let mut q = [0.0; MAX_DOF];
    q.copy_from_slice(&states.positions[..MAX_DOF]);
    Measured {
        stamp_ns: states.stamp_ns,
        setpoint_sequence: states.setpoint_sequence,
        joint_count: states.joint_count as usize,
        q,
        status: states.status & !HELD_MOVED,
    }
}

/// The distance of two positions, where a whole turn is none: no other joint can move that far
/// between two states.
fn turned(from: f64, to: f64) -> f64 {
    let apart = (to - from).abs();
    if apart > PI { (apart - TAU).abs() } else { apart }
}

fn held(states: &JointStates) -> Held {
    let count = (states.held_count as usize).min(MAX_HELD_JOINTS);
    Held { positions: states.held_positions, count }
}

fn count(histogram: &mut [u32; HISTOGRAM_BUCKETS], value_ns: u64) {
    let last = HISTOGRAM_BUCKETS - 1;
    let bucket = (0..last).find(|b| value_ns < bucket_upper_ns(*b)).unwrap_or(last);
    histogram[bucket] = histogram[bucket].saturating_add(1);
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use nullsweep_ipc_types::{EventKind, Fault, JoinRule, Reason, status};

    use super::*;
    use crate::guard::tests::pr2;
    use crate::hardware::Loopback;
    use crate::testing::{HOME, MS, moved, plan};

    /// A held joint that moves while a plan runs stops the arm on its path; a whole turn, a small
    /// drift, or a move at rest does not.
    #[test]
    fn a_moving_torso_stops_the_arm() {
        for (by, stops) in [(0.015, false), (TAU, false), (0.05, true), (f64::NAN, true)] {
            let guard = pr2();
            let slots = Arc::new(Slots::default());
            let mut states = JointStates {
                joint_count: 7,
                held_count: 2,
                status: status::CALIBRATED,
                stamp_ns: 1,
                ..JointStates::zeroed()
            };
            states.positions[..MAX_DOF].copy_from_slice(&HOME);
            let mut driver = Driver::new(Loopback::new(states, 2), guard, slots.clone());
            let mut run = |cycles: std::ops::Range<u64>, torso: f64| {
                for cycle in cycles {
                    driver.hardware().state.held_positions[1] = torso;
                    driver.cycle(Wake { deadline_ns: cycle * MS, now_ns: cycle * MS, missed: 0 });
                }
            };
            run(1..10, 0.0);
            run(10..20, 0.3);
            let points = [(0, HOME), (400 * MS, moved(HOME, 0, 0.4))];
            slots.offers.push(plan(&guard, 1, JoinRule::StopThenStart, &points)).unwrap();
            run(20..120, 0.3);
            run(120..600, 0.3 + by);
            let end = std::iter::from_fn(|| slots.events.pop()).last().unwrap();
            if stops {
                assert_eq!((end.kind, end.why.reason), (EventKind::Aborted, Reason::HeldJoint));
                assert_eq!(driver.state().snapshot().fault, Fault::HeldJoint);
            } else {
                assert_eq!(end.kind, EventKind::Finished, "{by}");
            }
            assert_eq!(driver.mode(), Mode::Hold, "{by}");
        }
    }
}
