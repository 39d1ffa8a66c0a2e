//! Executor and endpoint in one thread under a virtual clock: the same loop logic and the same
//! endpoint as the processes have, without processes, so that hours take seconds and every run is
//! the same.

use std::sync::Arc;

use bytemuck::Zeroable;
use nullsweep_executor::cycle::{Ask, Event, Input, Measured, Order, Reply, Snapshot, State, step};
use nullsweep_executor::{Guard, Held, Rejection, Rules, ValidPlan, admit};
use nullsweep_ipc_types::{JointStates, PlanHeader, PlanId, PlanMessage, Setpoint, checksum};
use nullsweep_robot::{Arm, JointVector, MAX_DOF};

use crate::endpoint::{Behaviour, Endpoint};
use crate::mechanism::UnknownMechanism;
use crate::sketch::Sketch;

/// The system.
pub struct Loopback {
    /// The arm that both sides know.
    pub arm: Arm,
    /// The endpoint.
    pub endpoint: Endpoint,
    /// Everything that became of plans, in order.
    pub events: Vec<Event>,
    guard: Guard,
    rules: Rules,
    state: State,
    now_ns: u64,
    plans: u64,
    tickets: u64,
    held: Option<Held>,
}

impl Loopback {
    /// An arm at its home, an executor that has just started.
    ///
    /// # Errors
    /// A mechanism was asked for that is not known.
    pub fn new(arm: &Arm, behaviour: Behaviour) -> Result<Self, UnknownMechanism> {
        let start_ns = 1_000_000_000;
        let endpoint = Endpoint::new(arm, arm.home(), behaviour, start_ns)?;
        let guard = Guard::new(arm.limits());
        let rules = Rules {
            guard,
            fingerprint: arm.fingerprint(),
            held_continuous: vec![false; arm.held_joints().len()],
            held_tolerance: Guard::HELD_TOLERANCE,
            since_ns: start_ns,
        };
        Ok(Self {
            arm: arm.clone(),
            endpoint,
            events: Vec::new(),
            guard,
            rules,
            state: State::default(),
            now_ns: start_ns,
            plans: 0,
            tickets: 0,
            held: None,
        })
    }

    /// Virtual time. \[ns\]
    #[must_use]
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// What the executor tells about itself.
    #[must_use]
    pub fn snapshot(&self) -> Snapshot {
        self.state.snapshot()
    }

    /// Lets so many cycles pass.
    pub fn run(&mut self, cycles: u32) {
        for _ in 0..cycles {
            self.cycle(None, None);
        }
    }

    /// Gives an order and returns its answer.
    pub fn order(&mut self, order: Order) -> Option<Reply> {
        self.tickets += 1;
        self.cycle(Some(Ask { ticket: self.tickets, order }), None)
    }

    /// Seals a plan, admits it and offers it to the loop; its id, or why it was not admitted.
    pub fn publish(&mut self, sketch: &Sketch) -> Result<PlanId, Rejection> {
        self.plans += 1;
        let id = PlanId { epoch: self.now_ns, number: self.plans };
        let mut header = PlanHeader { id, ..sketch.header };
        header.checksum = checksum(PlanMessage { header: &header, knots: &sketch.knots });
        let plan = admit(&header, &sketch.knots, self.held.as_ref(), &self.rules, self.now_ns)?;
        self.cycle(None, Some(Arc::new(plan)));
        Ok(id)
    }

    /// What became of one plan, in order.
    #[must_use]
    pub fn story(&self, plan: PlanId) -> Vec<Event> {
        self.events.iter().filter(|e| e.plan == plan).copied().collect()
    }

    /// Where the arm is commanded. \[rad\] or \[m\]
    #[must_use]
    pub fn commanded(&self) -> JointVector {
        self.snapshot().commanded
    }

    fn cycle(&mut self, ask: Option<Ask>, offer: Option<Arc<ValidPlan>>) -> Option<Reply> {
        self.now_ns += self.guard.period_ns;
        let state = self.endpoint.measure(self.now_ns);
        if let Some(state) = &state {
            let count = state.held_count as usize;
            self.held = Some(Held { positions: state.held_positions, count });
        }
        let input = Input { measured: state.as_ref().map(measured), ask, offer, missed: 0 };
        let out = step(&mut self.state, input, self.now_ns, &self.guard);
        self.events.extend(out.events.iter().copied());
        let mut pass: Option<Setpoint> = None;
        if let Some(target) = out.setpoint {
            let mut setpoint = Setpoint::zeroed();
            setpoint.sequence = target.sequence;
            setpoint.stamp_ns = self.now_ns;
            setpoint.deadline_ns = self.now_ns + self.guard.period_ns;
            setpoint.plan = target.plan;
            setpoint.positions[..MAX_DOF].copy_from_slice(&target.q[..]);
            setpoint.velocities[..MAX_DOF].copy_from_slice(&target.v[..]);
            setpoint.joint_count = self.guard.dof as u32;
            setpoint.mode = target.mode.wire();
            setpoint.knot = target.knot;
            setpoint.disable = u32::from(target.disable);
            pass = Some(setpoint);
        }
        self.endpoint.receive(pass.as_slice(), self.now_ns);
        out.reply
    }
}

fn measured(state: &JointStates) -> Measured {
    let mut q = JointVector::default();
    q.copy_from_slice(&state.positions[..MAX_DOF]);
    Measured {
        stamp_ns: state.stamp_ns,
        setpoint_sequence: state.setpoint_sequence,
        joint_count: state.joint_count as usize,
        q,
        status: state.status,
    }
}
