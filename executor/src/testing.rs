//! What the tests of several modules share: plans made through admission, and a virtual arm with
//! a judge and a book of every plan's life.

use std::collections::HashMap;
use std::sync::Arc;

use bytemuck::Zeroable;
use nullsweep_ipc_types::{
    EventKind, Interpolation, JoinRule, Knot, MAX_HELD_JOINTS, Mode, PlanHeader, PlanId,
    PlanMessage, checksum, status,
};

use crate::admit::{Held, Rules, ValidPlan, admit};
use crate::cycle::{Ask, Event, Input, Measured, Order, Output, Reply, State, step};
use crate::guard::Guard;
use crate::guard::tests::pr2;
use crate::{JointVector, MAX_DOF};

pub(crate) const MS: u64 = 1_000_000;
pub(crate) const FINGERPRINT: u64 = 0xfeed;

/// Where the virtual arm starts: inside every margin.
pub(crate) const HOME: JointVector = JointVector::new([-0.5, 0.3, -1.0, -1.2, 0.4, -1.0, 0.2, 0.0]);

pub(crate) fn rules(guard: &Guard) -> Rules {
    Rules {
        guard: *guard,
        fingerprint: FINGERPRINT,
        held_continuous: vec![false, true],
        held_tolerance: Guard::HELD_TOLERANCE,
        since_ns: 100,
    }
}

pub(crate) fn held() -> Held {
    let mut positions = [0.0; MAX_HELD_JOINTS];
    positions[0] = 0.2;
    positions[1] = 3.1;
    Held { positions, count: 2 }
}

/// The PR2's right arm, its joints as quick as they please: for curves through a few points.
pub(crate) fn tireless() -> Guard {
    let mut guard = pr2();
    for joint in &mut guard.joints {
        joint.limits.acceleration = 1e4;
    }
    guard
}

/// A sealed message that passes admission: knots of (time, positions).
pub(crate) fn message(number: u64, points: &[(u64, JointVector)]) -> (PlanHeader, Vec<Knot>) {
    let knots: Vec<Knot> = points
        .iter()
        .map(|(time, q)| {
            let mut knot = Knot::zeroed();
            knot.time_from_start_ns = *time;
            knot.positions[..MAX_DOF].copy_from_slice(&q[..]);
            knot
        })
        .collect();
    let mut header = PlanHeader {
        id: PlanId { epoch: 1000, number },
        fingerprint: FINGERPRINT,
        joint_count: 7,
        knot_count: points.len() as u32,
        held_count: 2,
        corners: 1,
        ..PlanHeader::default()
    };
    header.held_positions[..2].copy_from_slice(&[0.2, 3.1 - core::f64::consts::TAU]);
    seal(&mut header, &knots);
    (header, knots)
}

pub(crate) fn seal(header: &mut PlanHeader, knots: &[Knot]) {
    header.checksum = checksum(PlanMessage { header, knots });
}

pub(crate) fn plan_with(
    guard: &Guard,
    number: u64,
    points: &[(u64, JointVector)],
    edit: impl FnOnce(&mut PlanHeader, &mut Vec<Knot>),
) -> Arc<ValidPlan> {
    let (mut header, mut knots) = message(number, points);
    edit(&mut header, &mut knots);
    seal(&mut header, &knots);
    let now = u64::MAX;
    match admit(&header, &knots, Some(&held()), &rules(guard), now) {
        Ok(plan) => Arc::new(plan),
        Err(e) => panic!("the test's plan was rejected: {e}"),
    }
}

pub(crate) fn plan(
    guard: &Guard,
    number: u64,
    rule: JoinRule,
    points: &[(u64, JointVector)],
) -> Arc<ValidPlan> {
    plan_with(guard, number, points, |h, _| h.join_rule = rule.wire())
}

pub(crate) fn joining(
    guard: &Guard,
    number: u64,
    points: &[(u64, JointVector)],
    joined: PlanId,
    knot: usize,
) -> Arc<ValidPlan> {
    plan_with(guard, number, points, |h, _| {
        h.join_rule = JoinRule::AtKnot.wire();
        h.join_plan = joined;
        h.join_knot = knot as u32;
    })
}

/// A cubic plan from the same points, at rest at both ends and with central differences between.
pub(crate) fn cubic(guard: &Guard, number: u64, points: &[(u64, JointVector)]) -> Arc<ValidPlan> {
    plan_with(guard, number, points, |h, knots| {
        h.interpolation = Interpolation::Cubic.wire();
        for i in 1..knots.len().saturating_sub(1) {
            let (a, b) = (knots[i - 1], knots[i + 1]);
            let t = (b.time_from_start_ns - a.time_from_start_ns) as f64 * 1e-9;
            for j in 0..7 {
                knots[i].velocities[j] = (b.positions[j] - a.positions[j]) / t;
            }
        }
    })
}

/// `q` with joint `j` moved by `by`.
pub(crate) fn moved(mut q: JointVector, j: usize, by: f64) -> JointVector {
    q[j] += by;
    q
}

/// The life of one plan as its events tell it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Life {
    pub accepted: u32,
    pub rejected: u32,
    pub started: u32,
    pub ended: u32,
}

/// An arm that follows its setpoints with a delay of two cycles, a virtual clock, a judge of
/// every step, and a book of every plan.
pub(crate) struct Sim {
    pub guard: Guard,
    pub state: State,
    pub now: u64,
    pub arm: JointVector,
    pub status: u32,
    /// Whether its motors were asked off: then they are.
    pub off: bool,
    /// Whether the endpoint sends states.
    pub speaks: bool,
    pub events: Vec<Event>,
    pub lives: HashMap<PlanId, Life>,
    /// How many events of each kind.
    pub tally: [u64; 6],
    pub last: Option<JointVector>,
    pub last_v: JointVector,
    /// Greatest change of commanded velocity, as an acceleration. \[rad/s²\]
    pub top_acceleration: f64,
    pipe: [(u64, JointVector); 2],
    tickets: u64,
}

impl Sim {
    pub(crate) fn new(guard: Guard) -> Self {
        Self {
            guard,
            state: State::default(),
            now: 1_000 * MS,
            arm: HOME,
            status: status::CALIBRATED,
            off: false,
            speaks: true,
            events: Vec::new(),
            lives: HashMap::new(),
            tally: [0; 6],
            last: None,
            last_v: JointVector::ZERO,
            top_acceleration: 0.0,
            pipe: [(0, HOME); 2],
            tickets: 0,
        }
    }

    /// One that holds.
    pub(crate) fn holding(guard: Guard) -> Self {
        let mut sim = Self::new(guard);
        sim.run(3);
        assert_eq!(sim.mode(), Mode::Hold);
        sim
    }

    /// Puts an arm that has not begun yet somewhere, and lets the executor hold it there.
    pub(crate) fn stand_at(&mut self, q: JointVector) {
        self.arm = q;
        self.pipe = [(0, q); 2];
        self.run(3);
        assert_eq!((self.mode(), self.last), (Mode::Hold, Some(q)));
    }

    pub(crate) fn mode(&self) -> Mode {
        self.state.snapshot().mode
    }

    pub(crate) fn measured(&self) -> Measured {
        Measured {
            stamp_ns: self.now,
            setpoint_sequence: self.pipe[0].0,
            joint_count: self.guard.dof,
            q: self.arm,
            status: self.status | if self.off { status::HALTED } else { 0 },
        }
    }

    pub(crate) fn tick(&mut self, ask: Option<Order>, offer: Option<Arc<ValidPlan>>) -> Output {
        let measured = self.speaks.then(|| self.measured());
        self.tick_with(measured, ask, offer)
    }

    pub(crate) fn tick_with(
        &mut self,
        measured: Option<Measured>,
        ask: Option<Order>,
        offer: Option<Arc<ValidPlan>>,
    ) -> Output {
        let now = self.now + self.guard.period_ns;
        let measured = measured
            .map(|m| Measured { stamp_ns: now.min(m.stamp_ns + self.guard.period_ns), ..m });
        self.tick_stamped(measured, ask, offer)
    }

    /// A cycle with a state whose stamp is as it is given.
    pub(crate) fn tick_stamped(
        &mut self,
        measured: Option<Measured>,
        ask: Option<Order>,
        offer: Option<Arc<ValidPlan>>,
    ) -> Output {
        self.now += self.guard.period_ns;
        self.tickets += 1;
        let ask = ask.map(|order| Ask { ticket: self.tickets, order });
        let input = Input { measured, ask, offer, missed: 0 };
        let out = step(&mut self.state, input, self.now, &self.guard);
        self.judge(&out);
        out
    }

    pub(crate) fn run(&mut self, cycles: usize) {
        for _ in 0..cycles {
            self.tick(None, None);
        }
    }

    pub(crate) fn order(&mut self, order: Order) -> Reply {
        self.tick(Some(order), None).reply.expect("every order is answered at once")
    }

    /// Offers a plan; the events of that cycle.
    pub(crate) fn offer(&mut self, plan: Arc<ValidPlan>) -> Vec<Event> {
        self.tick(None, Some(plan)).events.to_vec()
    }

    pub(crate) fn run_until(&mut self, mode: Mode, at_most: usize) {
        for _ in 0..at_most {
            if self.mode() == mode {
                return;
            }
            self.run(1);
        }
        panic!("still {} after {at_most} cycles, not {mode}", self.mode());
    }

    /// The kinds of a plan's events so far.
    pub(crate) fn story(&self, number: u64) -> Vec<EventKind> {
        self.events.iter().filter(|e| e.plan.number == number).map(|e| e.kind).collect()
    }

    fn judge(&mut self, out: &Output) {
        for event in &out.events {
            self.tally[event.kind as usize] += 1;
            let life = self.lives.entry(event.plan).or_default();
            match event.kind {
                EventKind::Accepted => life.accepted += 1,
                EventKind::Rejected => life.rejected += 1,
                EventKind::Started => life.started += 1,
                EventKind::Finished | EventKind::Superseded | EventKind::Aborted => life.ended += 1,
            }
            assert!(life.accepted + life.rejected == 1, "admissions of {event:?}: {life:?}");
            assert!(life.ended <= life.accepted && life.started <= life.accepted, "{event:?}");
            self.events.push(*event);
        }
        let Some(target) = out.setpoint else {
            assert!(self.last.is_none(), "setpoints ceased");
            return;
        };
        assert!(target.q[self.guard.dof..].iter().all(|q| *q == 0.0));
        for j in 0..self.guard.dof {
            let bound = self.guard.joints[j];
            assert!(target.q[j].is_finite() && target.v[j].is_finite());
            if let Some(last) = self.last {
                let step = (target.q[j] - last[j]).abs();
                let most = bound.velocity() * self.guard.period() * (1.0 + 1e-6) + 1e-9;
                assert!(step <= most, "joint {j} stepped {step} at {:?}", target);
            }
            let a = (target.v[j] - self.last_v[j]).abs() / self.guard.period();
            self.top_acceleration = self.top_acceleration.max(a);
        }
        self.off = target.disable;
        self.last = Some(target.q);
        self.last_v = target.v;
        self.arm = self.pipe[0].1;
        self.pipe = [self.pipe[1], (target.sequence, target.q)];
        self.arm = self.pipe[0].1;
    }
}
