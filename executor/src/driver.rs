//! One cycle around [`crate::cycle::step`]: read the endpoint, take what waits in the slots, step,
//! command, hand on. Generic over the endpoint and given its time, so it runs on a virtual clock
//! as well.

use std::sync::Arc;

use nullsweep_ipc_types::ports::now_ns;
use nullsweep_ipc_types::{
    HISTOGRAM_BUCKETS, JointStates, MAX_HELD_JOINTS, MAX_JOINTS, Mode, Setpoint, bucket_upper_ns,
};

use crate::MAX_DOF;
use crate::admit::Held;
use crate::cycle::{Input, Measured, State, Target, step};
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
        if let Some(states) = &states {
            self.slots.held.force_push(held(states));
        }
        let room = self.slots.has_room_for_events();
        let input = Input {
            measured: states.as_ref().map(measured),
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
        status: states.status,
    }
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
