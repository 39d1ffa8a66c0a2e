//! Plans as they come over the wire: admission, and the loop in virtual time with all that may
//! happen around it. Whatever comes, the setpoints go on, none is farther from the last than the
//! joint's velocity allows, and no plan has more ends than admissions.
//!
//! The bytes: a count of deeds (two bytes each, and one for the cycles before it), the deeds, then
//! headers each with its knots. A header with checksum 0 is sealed first.

use std::collections::HashMap;
use std::sync::Arc;

use bytemuck::{Zeroable, bytes_of, pod_read_unaligned};
use nullsweep_executor::cycle::{Ask, Input, Measured, Order, Output, State, step};
use nullsweep_executor::{Guard, Held, Join, Rules, ValidPlan, admit};
use nullsweep_ipc_types::{
    EventKind, Interpolation, Knot, MAX_HELD_JOINTS, PlanHeader, PlanId, PlanMessage, checksum,
    status,
};
use nullsweep_robot::JointVector;

use crate::arm::arm;
use crate::script::{Deed, deed};

/// A script has fewer deeds than this.
const DEEDS: usize = 32;
/// Bytes of a deed, with the cycles before it.
const DEED: usize = 3;
/// Plans of one run.
const PLANS: usize = 4;
/// Cycles after the last deed.
const AFTER: u32 = 400;
/// When the executor started, and when the run begins. \[ns\]
const START: u64 = 1_000;
const NOW: u64 = 10_000_000_000;

pub(crate) fn run(bytes: &[u8]) -> bool {
    let (script, mut rest) = split(bytes);
    let mut stage = Stage::new();
    let mut plans = Vec::new();
    while plans.len() < PLANS
        && let Some(plan) = next_plan(&mut rest, &stage.guard)
    {
        plans.push(plan);
    }
    let all = plans.len();
    let mut offers = plans.into_iter().flatten();
    let mut offered = 0;
    for part in script.chunks_exact(DEED) {
        stage.run(u32::from(part[0]) * 2);
        match deed([part[1], part[2]]) {
            Deed::Order(order) => stage.tick(Some(order), None),
            Deed::Offer => {
                let plan = offers.next();
                offered += usize::from(plan.is_some());
                stage.tick(None, plan);
            }
            Deed::Silence => stage.speaks = !stage.speaks,
            Deed::Status(bits) => stage.status ^= bits,
            Deed::Measured(q) => stage.once = Some(q),
            Deed::Pushed(by) => stage.push = by,
            Deed::Missed(cycles) => stage.missed = cycles,
            Deed::Stamp(off) => stage.stamp_off = off,
        }
    }
    stage.recover();
    offered == all && all > 0 && stage.finished == all
}

fn split(bytes: &[u8]) -> (&[u8], &[u8]) {
    let Some((count, rest)) = bytes.split_first() else { return (&[], &[]) };
    let length = (usize::from(*count) % DEEDS * DEED).min(rest.len());
    rest.split_at(length)
}

/// Takes a header and its knots; the plan, if it is admitted.
fn next_plan(rest: &mut &[u8], guard: &Guard) -> Option<Option<Arc<ValidPlan>>> {
    let (header, after) = rest.split_at_checked(size_of::<PlanHeader>())?;
    let mut header: PlanHeader = pod_read_unaligned(header);
    let size = size_of::<Knot>();
    let count = (after.len() / size).min(header.knot_count as usize);
    let knots: Vec<Knot> = after[..count * size].chunks(size).map(pod_read_unaligned).collect();
    *rest = &after[count * size..];
    if header.checksum == 0 {
        header.checksum = checksum(PlanMessage { header: &header, knots: &knots });
    }
    let rules = Rules {
        guard: *guard,
        fingerprint: arm().1.fingerprint(),
        held_continuous: Vec::new(),
        held_tolerance: Guard::HELD_TOLERANCE,
        since_ns: START,
    };
    let held = Held { positions: [0.0; MAX_HELD_JOINTS], count: 0 };
    let plan = admit(&header, &knots, Some(&held), &rules, NOW).ok();
    if let Some(plan) = &plan {
        assert!(plan.knots().windows(2).all(|w| w[0].time < w[1].time));
        assert!(plan.knots().iter().all(|k| k.q.iter().chain(&k.v).all(|x| x.is_finite())));
        assert!(!matches!(plan.join(), Join::Knot { .. }) || header.join_rule == 2);
    }
    Some(plan.map(Arc::new))
}

/// How often a plan was told of.
#[derive(Default)]
struct Life {
    admissions: u32,
    ends: u32,
}

/// The loop, an arm that follows it two cycles later, and a judge of every setpoint.
struct Stage {
    guard: Guard,
    state: State,
    now: u64,
    last: Option<JointVector>,
    /// Sequence and position of the two setpoints that are on their way.
    pipe: [(u64, JointVector); 2],
    speaks: bool,
    status: u32,
    off: bool,
    push: f64,
    once: Option<f64>,
    missed: u32,
    stamp_off: i64,
    tickets: u64,
    lives: HashMap<PlanId, Life>,
    finished: usize,
}

impl Stage {
    fn new() -> Self {
        Self {
            guard: Guard::new(arm().1.limits()),
            state: State::default(),
            now: NOW,
            last: None,
            pipe: [(0, JointVector::ZERO); 2],
            speaks: true,
            status: status::CALIBRATED,
            off: false,
            push: 0.0,
            once: None,
            missed: 0,
            stamp_off: 0,
            tickets: 0,
            lives: HashMap::new(),
            finished: 0,
        }
    }

    fn run(&mut self, cycles: u32) {
        for _ in 0..cycles {
            self.tick(None, None);
        }
    }

    fn measured(&mut self) -> Option<Measured> {
        let (setpoint_sequence, mut q) = self.pipe[0];
        q[0] += self.push;
        if let Some(once) = self.once.take() {
            q[0] = once;
        }
        let off = if self.off { status::HALTED } else { 0 };
        let stamp_ns = self.now.saturating_add_signed(std::mem::take(&mut self.stamp_off));
        let joint_count = self.guard.dof;
        let status = self.status | off;
        self.speaks.then_some(Measured { stamp_ns, setpoint_sequence, joint_count, q, status })
    }

    fn tick(&mut self, order: Option<Order>, offer: Option<Arc<ValidPlan>>) {
        let missed = std::mem::take(&mut self.missed);
        self.now += self.guard.period_ns * (1 + u64::from(missed));
        self.tickets += 1;
        let ask = order.map(|order| Ask { ticket: self.tickets, order });
        let input = Input { measured: self.measured(), ask, offer, missed };
        let out = step(&mut self.state, input, self.now, &self.guard);
        assert_eq!(out.reply.map(|r| r.ticket), ask.map(|a| a.ticket), "an order has its answer");
        self.judge(&out);
    }

    fn judge(&mut self, out: &Output) {
        for event in &out.events {
            let life = self.lives.entry(event.plan).or_default();
            match event.kind {
                EventKind::Accepted | EventKind::Rejected => life.admissions += 1,
                EventKind::Started => {}
                EventKind::Finished | EventKind::Superseded | EventKind::Aborted => life.ends += 1,
            }
            self.finished += usize::from(event.kind == EventKind::Finished);
        }
        let Some(target) = out.setpoint else {
            assert!(self.last.is_none(), "setpoints ceased");
            return;
        };
        for (j, bound) in self.guard.used().iter().enumerate() {
            assert!(target.q[j].is_finite() && target.v[j].is_finite(), "{target:?}");
            if let Some(last) = self.last {
                let moved = (target.q[j] - last[j]).abs();
                let most = bound.velocity() * self.guard.period() * (1.0 + 1e-6) + 1e-9;
                assert!(moved <= most, "joint {j} moved {moved} of {most}: {target:?}");
            }
        }
        self.off = target.disable;
        self.last = Some(target.q);
        self.pipe = [self.pipe[1], (target.sequence, target.q)];
    }

    /// All is well again around the loop: it is led back to where it holds and would move.
    fn recover(&mut self) {
        self.run(AFTER);
        (self.speaks, self.status, self.push) = (true, status::CALIBRATED, 0.0);
        self.run(AFTER);
        for order in [Order::Reset, Order::Speed(1.0), Order::Resume] {
            self.tick(Some(order), None);
            self.run(AFTER);
        }
        for (plan, life) in &self.lives {
            // Two plans may have the same id here: the worker keeps such from the loop.
            assert!(life.ends <= life.admissions, "{plan}: more ends than admissions");
        }
    }
}

/// A straight plan, a curve that follows it, and a stop in between.
pub(crate) fn made() -> Vec<Vec<u8>> {
    let deeds = |deeds: &[[u8; 3]]| {
        let mut bytes = vec![deeds.len() as u8];
        bytes.extend(deeds.iter().flatten());
        bytes
    };
    let mut one = deeds(&[[2, 15, 0]]);
    one.extend(message(1, Interpolation::Linear, 0));
    let mut two = deeds(&[[2, 15, 0], [2, 15, 0], [10, 0, 0], [9, 1, 0], [1, 4, 128]]);
    two.extend(message(1, Interpolation::Linear, 0));
    two.extend(message(2, Interpolation::Cubic, 1));
    vec![one, two]
}

fn message(number: u64, interpolation: Interpolation, join_rule: u32) -> Vec<u8> {
    let arm = &arm().1;
    let reach =
        if interpolation == Interpolation::Cubic { [0.04, 0.02, 0.04] } else { [0.0, 0.02, 0.04] };
    let knots: Vec<Knot> = reach
        .iter()
        .enumerate()
        .map(|(k, q)| {
            let mut knot = Knot::zeroed();
            knot.time_from_start_ns = 200_000_000 * k as u64;
            knot.positions[0] = *q;
            knot.positions[2] = -q;
            knot
        })
        .collect();
    let header = PlanHeader {
        id: PlanId { epoch: NOW - 5, number },
        fingerprint: arm.fingerprint(),
        joint_count: arm.dof() as u32,
        corners: u32::from(interpolation == Interpolation::Linear),
        knot_count: knots.len() as u32,
        interpolation: interpolation.wire(),
        join_rule,
        ..PlanHeader::default()
    };
    let mut bytes = bytes_of(&header).to_vec();
    knots.iter().for_each(|knot| bytes.extend_from_slice(bytes_of(knot)));
    bytes
}
