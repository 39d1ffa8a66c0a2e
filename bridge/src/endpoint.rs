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
/// How long setpoints go out to a controller that does not listen: an executor's stop on its path
/// takes no longer. One that listens again after that stands somewhere else. \[ns\]
const UNLINKED_NS: u64 = 1_000_000_000;

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
    /// Since when the controller does not listen. \[ns\]
    unlinked_ns: Option<u64>,
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
            unlinked_ns: None,
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
        let since = (!health.is_linked).then(|| self.unlinked_ns.unwrap_or(now_ns));
        self.unlinked_ns = since;
        let gone = since.is_some_and(|since| now_ns >= since + UNLINKED_NS);
        if self.disabled || gone || health.status & off != status::CALIBRATED {
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

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use nullsweep_robot::{ArmSpec, Robot, Side};

    use super::*;

    const MS: u64 = 1_000_000;
    const ON: Health = Health { status: status::CALIBRATED, is_linked: true };
    const OFF: Health = Health { status: status::CALIBRATED | status::HALTED, is_linked: true };

    /// A request can be lost or refused, while the executor is told that the motors are off.
    #[test]
    fn motors_that_are_still_on_are_asked_again_to_go_off() {
        let root = tempfile::tempdir().expect("a folder");
        let ipc = Ipc::open("pr2", Some(root.path())).expect("a node");
        let arm = Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).expect("an arm");
        let ear = Ear::new(&arm, str::to_owned);
        let mut names = ear.names().to_vec();
        names.extend(arm.held_joints().iter().map(|h| h.name.clone()));
        let timing = Timing {
            delay_ns: 60 * MS,
            period_ns: 20 * MS,
            timeout_ns: 20 * MS,
            stop_acceleration: 4.0,
        };
        let mut endpoint =
            Endpoint::open(&ipc, &arm, ear, &timing, Takeover::AtStamp).expect("an endpoint");
        let executor = ipc.setpoint_sender().expect("a sender");
        let positions = vec![0.0; names.len()];
        let heard = Heard {
            stamp_ns: 1000 * MS,
            at_ns: 1000 * MS,
            names: &names,
            positions: &positions,
            velocities: &[],
            efforts: &[],
        };
        endpoint.hear(&heard, ON).expect("sent");
        let send = |sequence, disable| {
            let setpoint = Setpoint { sequence, joint_count: 7, disable, ..Setpoint::zeroed() };
            executor.send(&setpoint).expect("sent");
        };
        let mut asked = |ms: u64, health| {
            let all = endpoint.round(health, ms * MS).expect("received");
            all.into_iter().filter(|what| matches!(what, Do::Power(_))).collect::<Vec<_>>()
        };
        assert_eq!(asked(1001, ON), []);
        send(1, 1);
        assert_eq!(asked(1002, ON), [Do::Power(false)]);
        assert_eq!(asked(1900, ON), []);
        assert_eq!(asked(2002, ON), [Do::Power(false)]);
        assert_eq!(asked(2500, ON), []);
        assert_eq!(asked(3002, ON), [Do::Power(false)]);
        // They are off, and on again by somebody else's hand while they shall be off.
        assert_eq!(asked(4500, OFF), []);
        assert_eq!(asked(4501, ON), [Do::Power(false)]);
        send(2, 0);
        assert_eq!(asked(4502, OFF), [Do::Power(true)]);
        assert_eq!(asked(9000, OFF), []);
        // A controller that has not listened for long does not go on where it was left.
        let gone = Health { is_linked: false, ..ON };
        let mut lets_go = |ms: u64, health| {
            endpoint.round(health, ms * MS).expect("received").contains(&Do::LetGo)
        };
        assert!(!lets_go(10_000, gone) && !lets_go(10_999, gone) && lets_go(11_000, gone));
        assert!(!lets_go(11_001, ON) && !lets_go(11_002, gone));
    }
}
