//! The mock hardware endpoint without its process: setpoints and a time go in, joint states
//! come out. No clock and no port, so that a test runs it in virtual time.

#[cfg(test)]
mod tests;

use std::time::Duration;

use nullsweep_ipc_types::{JointStates, MAX_HELD_JOINTS, Setpoint, status};
use nullsweep_robot::{Arm, Continuous, JointVector, wrap};
use serde::Serialize;

use crate::fault::{FaultAt, FaultKind};
use crate::judge::{Judge, Rules};
use crate::mechanism::{Mechanism, UnknownMechanism};
use crate::plant::Plant;
use crate::servo::Servo;

/// How true to a robot the simulated arm is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Fidelity {
    /// Joints without dynamics behind a stiff position loop, see [`Servo`].
    #[default]
    Servo,
    /// Motors that take effort, transmissions, inertia and safety controllers, see [`Mechanism`].
    Mechanism,
}

/// How the endpoint behaves.
#[derive(Clone, Debug, Default)]
pub struct Behaviour {
    /// What stands behind the setpoints.
    pub fidelity: Fidelity,
    /// For the mechanism, see [`Mechanism::with_payload`]. \[N·m\]
    pub payload: f64,
    /// Whether it tells the angles of continuous joints in (−π, π], as some robots do.
    pub wrap: bool,
    /// What the judge allows; its `session_timeout_ns` is also the endpoint's own watchdog.
    pub rules: Rules,
    /// Faults to play.
    pub faults: Vec<FaultAt>,
}

/// What the endpoint itself did, beside the judge's verdict.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Counters {
    /// How often it stopped by itself because setpoints ceased.
    pub timeouts: u64,
    /// Setpoints that it did not follow, because after a stop they were too far from the arm.
    pub refused: u64,
    /// How often it was asked to disable its motors.
    pub disabled: u64,
    /// States sent.
    pub states: u64,
}

/// A simulated arm behind the setpoint and state services.
pub struct Endpoint {
    dof: usize,
    continuous: Continuous,
    behaviour: Behaviour,
    started_ns: u64,
    plant: Box<dyn Plant>,
    judge: Judge,
    held: Vec<f64>,
    /// Whether the arm follows setpoints. It begins to with one that is where the arm is.
    following: bool,
    /// Setpoints ceased, or those that come begin too far from the arm.
    timed_out: bool,
    disabled: bool,
    /// The deadline of the last sound setpoint. \[ns\]
    deadline_ns: Option<u64>,
    in_force: Option<Received>,
    frozen: Option<JointVector>,
    jumped: bool,
    /// What the last state said, the last finite one.
    reported: JointVector,
    sequence: u64,
    counters: Counters,
}

#[derive(Clone, Copy, Debug)]
struct Received {
    sequence: u64,
    received_ns: u64,
}

impl Endpoint {
    /// An arm at rest at `initial`, with its held joints where `arm` holds them.
    ///
    /// # Errors
    /// A mechanism was asked for that is not known.
    pub fn new(
        arm: &Arm,
        initial: JointVector,
        behaviour: Behaviour,
        now_ns: u64,
    ) -> Result<Self, UnknownMechanism> {
        let plant: Box<dyn Plant> = match behaviour.fidelity {
            Fidelity::Servo => Box::new(Servo::new(arm, initial, now_ns)),
            Fidelity::Mechanism => {
                Box::new(Mechanism::new(arm, initial, now_ns)?.with_payload(behaviour.payload))
            }
        };
        Ok(Self {
            dof: arm.dof(),
            continuous: Continuous::of(arm.limits()),
            started_ns: now_ns,
            plant,
            judge: Judge::new(arm, behaviour.rules.clone()),
            held: arm.held_joints().iter().map(|h| h.position).take(MAX_HELD_JOINTS).collect(),
            behaviour,
            following: false,
            timed_out: false,
            disabled: false,
            deadline_ns: None,
            in_force: None,
            frozen: None,
            jumped: false,
            reported: initial,
            sequence: 0,
            counters: Counters::default(),
        })
    }

    /// The judge of all setpoints so far.
    #[must_use]
    pub fn judge(&self) -> &Judge {
        &self.judge
    }

    /// What the endpoint did so far.
    #[must_use]
    pub fn counters(&self) -> Counters {
        self.counters
    }

    /// Where the arm is measured, whatever a fault makes it report. \[rad\] or \[m\]
    #[must_use]
    pub fn positions(&self) -> &JointVector {
        self.plant.measured()
    }

    /// Whether it stands because setpoints ceased, or begin too far from the arm.
    #[must_use]
    pub fn is_timed_out(&self) -> bool {
        self.timed_out
    }

    /// Joints outside the arm stand here from now on, in the URDF's order. \[rad\] or \[m\]
    pub fn hold(&mut self, held: impl IntoIterator<Item = f64>) {
        self.held.iter_mut().zip(held).for_each(|(own, held)| *own = held);
    }

    /// Plays a fault from now on.
    pub fn play(&mut self, kind: FaultKind, length: Option<Duration>, now_ns: u64) {
        let start = Duration::from_nanos(now_ns.saturating_sub(self.started_ns));
        self.behaviour.faults.push(FaultAt { kind, start, length });
    }

    /// Judges and follows what one reading pass took out of the buffer, oldest first.
    pub fn receive(&mut self, pass: &[Setpoint], now_ns: u64) {
        if !pass.is_empty() {
            self.judge.observe(pass, &self.reported);
        }
        for setpoint in pass {
            // The sender's stamps tell whether setpoints ceased, not when this process woke up.
            self.watch(setpoint.stamp_ns);
            self.follow(setpoint, now_ns);
        }
        self.watch(now_ns);
        self.plant.advance(now_ns);
        let jumped = self.is_active(FaultKind::Jump, now_ns);
        if jumped != self.jumped {
            self.plant.shift_encoder(0, if jumped { FaultKind::JUMP } else { -FaultKind::JUMP });
            self.jumped = jumped;
        }
        if self.is_active(FaultKind::Halt, now_ns) {
            self.plant.release();
            self.following = false;
        }
    }

    /// The state to send now; `None` while a fault keeps it back.
    pub fn measure(&mut self, now_ns: u64) -> Option<JointStates> {
        self.sequence += 1;
        let active = |kind| self.is_active(kind, now_ns);
        if active(FaultKind::Stale) || (active(FaultKind::Drop) && self.sequence.is_multiple_of(2))
        {
            return None;
        }
        let mut bits = 0;
        let mut set = |bit, on| bits |= if on { bit } else { 0 };
        set(status::CALIBRATED, !active(FaultKind::Uncalibrated));
        set(status::HALTED, self.disabled || active(FaultKind::Halt));
        set(status::SETPOINT_TIMEOUT, self.timed_out);
        set(status::ERROR, active(FaultKind::Error));

        let mut positions = *self.plant.measured();
        let mut velocities = *self.plant.velocities();
        if active(FaultKind::Nan) {
            positions[0] = f64::NAN;
        }
        if self.behaviour.wrap {
            for j in (0..self.dof).filter(|j| self.continuous.is(*j)) {
                positions[j] = wrap(positions[j]);
            }
        }
        let stamp_ns = if active(FaultKind::Delay) {
            now_ns.saturating_sub(10_000_000)
        } else if active(FaultKind::Clock) {
            now_ns + FaultKind::CLOCK_AHEAD.as_nanos() as u64
        } else {
            now_ns
        };
        let joint_count = self.dof as u32 - u32::from(active(FaultKind::Count));
        if active(FaultKind::Freeze) {
            positions = *self.frozen.get_or_insert(positions);
            velocities = JointVector::default();
        } else {
            self.frozen = None;
        }

        if positions.iter().all(|q| q.is_finite()) {
            self.reported = positions;
        }
        let mut state = <JointStates as bytemuck::Zeroable>::zeroed();
        state.sequence = self.sequence;
        state.stamp_ns = stamp_ns;
        if let Some(setpoint) = self.in_force {
            state.setpoint_sequence = setpoint.sequence;
            state.setpoint_received_ns = setpoint.received_ns;
        }
        state.setpoint_sequence = self.answer(state.setpoint_sequence, now_ns);
        state.positions[..self.dof].copy_from_slice(&positions[..self.dof]);
        state.velocities[..self.dof].copy_from_slice(&velocities[..self.dof]);
        state.efforts[..self.dof].copy_from_slice(&self.plant.efforts()[..self.dof]);
        state.held_positions[..self.held.len()].copy_from_slice(&self.held);
        state.held_count = self.held.len() as u32;
        state.joint_count = joint_count;
        state.status = bits;
        self.counters.states += 1;
        Some(state)
    }

    /// What it says of the setpoint that is in force.
    fn answer(&self, in_force: u64, now_ns: u64) -> u64 {
        match |kind| self.is_active(kind, now_ns) {
            active if active(FaultKind::Unanswered) => 0,
            active if active(FaultKind::Stuck) => 1,
            active if active(FaultKind::Ahead) => in_force + 1_000_000,
            _ => in_force,
        }
    }

    fn is_active(&self, kind: FaultKind, now_ns: u64) -> bool {
        let since = Duration::from_nanos(now_ns.saturating_sub(self.started_ns));
        self.behaviour.faults.iter().any(|f| f.shows(kind, since))
    }

    /// Stops by itself when the last setpoint's deadline and the grace have passed.
    fn watch(&mut self, now_ns: u64) {
        let Some(deadline_ns) = self.deadline_ns else { return };
        let end_ns = deadline_ns.saturating_add(self.behaviour.rules.session_timeout_ns);
        if self.timed_out || now_ns <= end_ns {
            return;
        }
        self.plant.advance(end_ns);
        self.plant.hold();
        self.timed_out = true;
        self.following = false;
        self.counters.timeouts += 1;
    }

    fn follow(&mut self, setpoint: &Setpoint, now_ns: u64) {
        let sound = setpoint.joint_count as usize == self.dof
            && setpoint.positions[..self.dof].iter().all(|q| q.is_finite())
            && setpoint.velocities[..self.dof].iter().all(|v| v.is_finite());
        if !sound {
            self.counters.refused += 1;
            return;
        }
        self.deadline_ns = Some(setpoint.deadline_ns);
        if setpoint.disable != 0 && !self.disabled {
            self.counters.disabled += 1;
            self.plant.release();
        }
        self.disabled = setpoint.disable != 0;
        // Whole turns of a joint that turns without end are no way to go.
        let near = self.nearest(setpoint);
        let setpoint = &near;
        let able = !self.disabled
            && !self.is_active(FaultKind::Halt, now_ns)
            && !self.is_active(FaultKind::Deaf, now_ns);
        if able && !self.following && !self.is_near(setpoint) {
            self.counters.refused += 1;
            self.timed_out = true;
            return;
        }
        self.following = able;
        self.timed_out = false;
        self.in_force = Some(Received { sequence: setpoint.sequence, received_ns: now_ns });
        if able {
            self.plant.follow(setpoint);
        }
    }

    /// The setpoint with its continuous joints by whole turns nearest to where the arm is.
    fn nearest(&self, setpoint: &Setpoint) -> Setpoint {
        let (mut near, mut q) = (*setpoint, JointVector::default());
        q[..self.dof].copy_from_slice(&setpoint.positions[..self.dof]);
        q = self.continuous.nearest_turn(&q, self.plant.measured());
        near.positions[..self.dof].copy_from_slice(&q[..self.dof]);
        near
    }

    /// Whether the arm is where a setpoint wants it.
    fn is_near(&self, setpoint: &Setpoint) -> bool {
        let measured = self.plant.measured();
        let tolerance = self.behaviour.rules.start_tolerance;
        (0..self.dof).all(|j| (setpoint.positions[j] - measured[j]).abs() <= tolerance)
    }
}
