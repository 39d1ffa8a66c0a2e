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
use rtrb::PushError;

use crate::admit::{Held, ValidPlan};
use crate::alarm::Alarm;
use crate::cycle::{Ask, HELD_MOVED, Input, Measured, State, Target, step};
use crate::guard::Guard;
use crate::hardware::Hardware;
use crate::record::Tape;
use crate::rt::Wake;
use crate::slots::{LoopEnd, Report};
use crate::{JointVector, MAX_DOF};

/// Setpoints whose round trip is told.
const MADE: usize = 64;
/// Cycles between two reports.
const REPORT_EVERY: u64 = 10;

/// The loop's own data: everything that one cycle touches.
#[derive(Debug)]
pub struct Driver<H> {
    hardware: H,
    guard: Guard,
    state: State,
    slots: LoopEnd,
    alarm: Alarm,
    tape: Option<Tape>,
    /// Where the held joints stood when the motion began.
    reference: Option<Held>,
    /// Where they were measured last.
    held: Held,
    lateness: [u32; HISTOGRAM_BUCKETS],
    compute: [u32; HISTOGRAM_BUCKETS],
    round_trip: [u32; HISTOGRAM_BUCKETS],
    /// When the last setpoints were made, by their sequence. \[ns\]
    made: [u64; MADE],
    /// The newest of them that the endpoint is known to have had.
    heard: u64,
    early: Early,
    /// Whether the coming cycle was rehearsed.
    rehearsed: bool,
    /// Cycles since the last report.
    unreported: u64,
    /// When the last cycle was. \[ns\]
    stamp_ns: u64,
    cycles: u64,
    /// Reads and writes that failed.
    failures: u64,
}

/// What came for the next cycle.
#[derive(Debug, Default)]
struct Early {
    states: Option<JointStates>,
    ask: Option<Ask>,
    offer: Option<Arc<ValidPlan>>,
}

impl<H: Hardware> Driver<H> {
    /// A loop that has not run yet.
    pub fn new(hardware: H, guard: Guard, slots: LoopEnd) -> Self {
        Self {
            hardware,
            guard,
            state: State::default(),
            slots,
            alarm: Alarm::default(),
            tape: None,
            reference: None,
            held: Held { positions: [0.0; MAX_HELD_JOINTS], count: 0 },
            lateness: [0; HISTOGRAM_BUCKETS],
            compute: [0; HISTOGRAM_BUCKETS],
            round_trip: [0; HISTOGRAM_BUCKETS],
            made: [0; MADE],
            heard: 0,
            early: Early::default(),
            rehearsed: false,
            unreported: 0,
            stamp_ns: 0,
            cycles: 0,
            failures: 0,
        }
    }

    /// Hands every cycle on to the flight recorder.
    pub(crate) fn record(&mut self, tape: Tape) {
        self.tape = Some(tape);
    }

    /// Heeds this alarm.
    pub(crate) fn heed(&mut self, alarm: Alarm) {
        self.alarm = alarm;
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

    /// Goes through a cycle shortly before its deadline, on a copy of the loop's memory, so that
    /// code and data are in the caches when it counts: a thread that sleeps for most of a
    /// millisecond finds them cold. Nothing is commanded; what waits for the cycle is taken out of
    /// its queue and kept.
    pub fn rehearse(&mut self, deadline_ns: u64) {
        self.rehearsed = true;
        if self.unreported >= REPORT_EVERY {
            self.report();
        }
        self.hardware.prepare();
        self.gather();
        let Early { states, ask, offer } = &self.early;
        let measured = states.as_ref().map(measured);
        let input = Input { measured, ask: *ask, offer: offer.clone(), missed: 0 };
        // `step` has no effect but on what it is given. A plan that the copy retires is not freed
        // here: the loop's own memory, or `early`, still holds it.
        std::hint::black_box(step(&mut self.state.clone(), input, deadline_ns, &self.guard));
    }

    /// Takes what waits for the next cycle.
    fn gather(&mut self) {
        if let Some(states) = self.read() {
            self.early.states = Some(states);
        }
        if self.early.ask.is_none() {
            self.early.ask = self.slots.asks.pop().ok();
        }
        if self.early.offer.is_none() && self.slots.has_room_for_events() {
            self.early.offer = self.slots.offers.pop().ok();
        }
    }

    fn read(&mut self) -> Option<JointStates> {
        self.hardware.read().unwrap_or_else(|_| {
            self.failures += 1;
            None
        })
    }

    /// Runs one cycle.
    pub fn cycle(&mut self, wake: Wake) {
        self.cycles += 1;
        self.gather();
        let Early { states, ask, offer } = std::mem::take(&mut self.early);
        let ask = self.decide(ask);
        let tell_held = self.mode() == Mode::Init || self.cycles.is_multiple_of(REPORT_EVERY);
        let measured = states.as_ref().map(|states| {
            let held = held(states);
            self.held = held;
            // Each cycle at first, so that the worker has them before anybody can have seen Hold.
            if tell_held {
                // The worker sees that newer ones found no room.
                let _ = self.slots.held.push(held);
            }
            let mut measured = measured(states);
            if self.has_moved(held) {
                measured.status |= HELD_MOVED;
            }
            measured
        });
        let input = Input { measured, ask, offer, missed: wake.missed };
        self.count_round_trip(states.as_ref(), wake.now_ns);
        let record = self.tape.is_some().then(|| Tape::input(&input, wake.now_ns));
        let out = step(&mut self.state, input, wake.now_ns, &self.guard);
        if let Some(target) = &out.setpoint {
            self.made[(target.sequence % MADE as u64) as usize] = wake.now_ns;
            if self.hardware.write(&self.setpoint(target, wake)).is_err() {
                self.failures += 1;
            }
        }
        if let (Some(tape), Some(record)) = (&mut self.tape, record) {
            tape.push(record, out.setpoint.as_ref(), &self.state);
        }
        for event in &out.events {
            // There is room: asked before the plan was taken, and faults end what was taken.
            let _ = self.slots.events.push(*event);
        }
        for plan in out.retired {
            if let Err(PushError::Full(plan)) = self.slots.retired.push(plan) {
                // Freeing here would enter the heap; the worker is stuck anyway.
                std::mem::forget(plan);
            }
        }
        if let Some(reply) = out.reply {
            // There is room: one order is asked at a time. Only answers to signals may have filled it
            // while the service hangs, and then nobody reads them.
            let _ = self.slots.replies.push(reply);
        }
        self.unreported += 1;
        self.stamp_ns = wake.now_ns;
        // A loop that rehearses has the time for it then.
        if self.unreported >= REPORT_EVERY && !self.rehearsed {
            self.report();
        }
        self.rehearsed = false;
    }

    /// Tells the state after the last cycle.
    fn report(&mut self) {
        self.unreported = 0;
        let report = Report {
            stamp_ns: self.stamp_ns,
            snapshot: self.state.snapshot(),
            held: self.held,
            lateness: self.lateness,
            compute: self.compute,
            round_trip: self.round_trip,
        };
        // Without room nobody reads them.
        let _ = self.slots.reports.push(report);
    }

    /// What is carried out in this cycle: what a signal asks for before all else, then the order
    /// that waits, unless it was withdrawn.
    fn decide(&mut self, ask: Option<Ask>) -> Option<Ask> {
        if let Some(order) = self.alarm.take(self.state.is_shutting_down()) {
            self.early.ask = ask;
            return Some(Ask { ticket: Ask::SIGNAL, order });
        }
        ask.filter(|ask| self.slots.claim.decide(ask.ticket))
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

    /// Counts how long ago the newest setpoint was made that the endpoint says it has had, once.
    fn count_round_trip(&mut self, states: Option<&JointStates>, now_ns: u64) {
        let Some(heard) = states.map(|s| s.setpoint_sequence) else { return };
        let newest = self.state.sequence();
        if heard > self.heard && heard <= newest && newest - heard < MADE as u64 {
            let made_ns = self.made[(heard % MADE as u64) as usize];
            count(&mut self.round_trip, now_ns.saturating_sub(made_ns));
        }
        self.heard = heard;
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
    let mut q = JointVector::ZERO;
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
mod tests;
