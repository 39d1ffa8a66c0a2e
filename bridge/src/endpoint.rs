//! An endpoint's side towards the executor: states out as they come, setpoints in, trajectories for
//! the controller out of them.

use nullsweep_executor::Guard;
use nullsweep_ipc_types::ports::{Ipc, IpcError, PortError, Receiver, Sender};
use nullsweep_ipc_types::{JointStates, Setpoint, status};
use nullsweep_robot::{Arm, Continuous, JointVector};

use crate::ear::{Ear, Heard};
use crate::stream::{Message, Rules, Stop, Stream, Takeover};

/// How often motors that are still on are asked to go off. \[ns\]
const AGAIN_NS: u64 = 1_000_000_000;

/// What is known of the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Health {
    /// Bits of [`nullsweep_ipc_types::status`].
    pub status: u32,
    /// Whether the controller is there and listens.
    pub is_linked: bool,
}

/// What the robot's side is to do.
#[derive(Clone, Debug, PartialEq)]
pub enum Do {
    /// Turn the motors on or off. Off is said again while they are on.
    Power(bool),
    /// Follow this.
    Follow(Message),
    /// Forget what was to be followed: the motors are off.
    LetGo,
}

/// How it works.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// Setpoints are followed so much later. \[ns\]
    pub delay_ns: u64,
    /// Time between two messages to the controller. \[ns\]
    pub period_ns: u64,
    /// Following ends so long after the last setpoint's deadline. \[ns\]
    pub timeout_ns: u64,
    /// Deceleration of the stop that ends every message. \[rad/s²\]
    pub stop_acceleration: f64,
}

impl Timing {
    /// Reads [`Self::stop_acceleration`]. \[rad/s²\]
    ///
    /// # Errors
    /// What is wrong with it: it is to be a number above 0.
    pub fn read_acceleration(text: &str) -> Result<f64, String> {
        let value = text.parse::<f64>().map_err(|why| why.to_string())?;
        let fits = value.is_finite() && value > 0.0;
        fits.then_some(value).ok_or_else(|| "a finite number above 0 is wanted, in rad/s²".into())
    }
}

/// The executor's partner.
#[derive(Debug)]
pub struct Endpoint {
    setpoints: Receiver<Setpoint>,
    states: Sender<JointStates>,
    ear: Ear,
    stream: Stream,
    period_ns: u64,
    due_ns: u64,
    /// Whether the executor wants the motors off.
    disabled: bool,
    /// When it was last said that they shall be off. \[ns\]
    off_ns: u64,
    stopped: Option<Stop>,
}

impl Endpoint {
    /// Takes the endpoint's place beside the executor.
    ///
    /// # Errors
    /// Another endpoint runs already, or the services cannot be opened.
    pub fn open(
        ipc: &Ipc,
        arm: &Arm,
        ear: Ear,
        timing: &Timing,
        takeover: Takeover,
    ) -> Result<Self, IpcError> {
        let rules = Rules {
            joints: arm.dof(),
            takeover,
            delay_ns: timing.delay_ns,
            timeout_ns: timing.timeout_ns,
            stop_acceleration: timing.stop_acceleration,
            start_tolerance: Guard::START_TOLERANCE,
            continuous: Continuous::of(arm.limits()),
        };
        Ok(Self {
            setpoints: ipc.setpoint_receiver()?,
            states: ipc.state_sender()?,
            ear,
            stream: Stream::new(rules),
            period_ns: timing.period_ns,
            due_ns: 0,
            disabled: false,
            off_ns: 0,
            stopped: None,
        })
    }

    /// Takes a message of joint states in and passes it on.
    ///
    /// # Errors
    /// [`PortError`] where it cannot be sent.
    pub fn hear(&mut self, heard: &Heard<'_>, health: Health) -> Result<(), PortError> {
        let Some(mut state) = self.ear.hear(heard) else { return Ok(()) };
        state.status = health.status;
        if self.disabled {
            // The robot tells it later.
            state.status |= status::HALTED;
        }
        if self.stopped.is_some() {
            state.status |= status::SETPOINT_TIMEOUT;
        }
        if let Some((sequence, deadline)) = self.stream.in_force(state.stamp_ns) {
            state.setpoint_sequence = sequence;
            state.setpoint_received_ns = deadline;
        }
        // Without a controller the state goes stale: the executor then stops the arm on its path,
        // and the setpoints of that stop still go out.
        if health.is_linked {
            self.states.send(&state)?;
        }
        Ok(())
    }

    /// Takes setpoints in; what is to be done for them, in this order.
    ///
    /// # Errors
    /// [`PortError`] where they cannot be received.
    pub fn round(&mut self, health: Health, now_ns: u64) -> Result<Vec<Do>, PortError> {
        let mut all = Vec::new();
        let Some(measured) = self.ear.measured() else { return Ok(all) };
        while let Some(setpoint) = self.setpoints.receive()? {
            if (setpoint.disable != 0) != self.disabled {
                self.disabled = setpoint.disable != 0;
                self.off_ns = now_ns;
                all.push(Do::Power(!self.disabled));
            }
            self.stream.take(&setpoint, &measured);
        }
        // A request can be lost or refused, and an executor is told that they are off.
        let is_on = self.disabled && health.status & status::HALTED == 0;
        if is_on && now_ns >= self.off_ns + AGAIN_NS {
            self.off_ns = now_ns;
            all.push(Do::Power(false));
        }
        let off = status::HALTED | status::CALIBRATED;
        if self.disabled || health.status & off != status::CALIBRATED {
            self.stream.let_go();
            all.push(Do::LetGo);
        }
        let before = std::mem::replace(&mut self.stopped, self.stream.stopped(now_ns));
        if let Some(why) = self.stopped.filter(|_| before.is_none()) {
            tracing::warn!("{why}: the arm comes to rest");
        }
        if now_ns >= self.due_ns {
            self.due_ns = now_ns.max(self.due_ns + self.period_ns);
            all.extend(self.stream.message(now_ns).map(Do::Follow));
        }
        Ok(all)
    }

    /// Whether usable joint states come.
    #[must_use]
    pub fn hears(&self, now_ns: u64) -> bool {
        self.ear.hears(now_ns)
    }

    /// Where the arm was last measured. \[rad\] or \[m\]
    #[must_use]
    pub fn measured(&self) -> Option<JointVector> {
        self.ear.measured()
    }

    /// What came and went, in words.
    #[must_use]
    pub fn sum(&self) -> String {
        format!(
            "{} joint states, {} messages late, {} setpoints refused",
            self.ear.count(),
            self.stream.late,
            self.stream.refused
        )
    }
}
