//! How it stands with the robot: for the executor, and in words when it changes.

use nullsweep_bridge::{Health, Heard, moment};
use nullsweep_ipc_types::status;

use crate::args::RunArgs;
use crate::link::Known;
use crate::messages::JointState;

/// What is told of a process that was stopped.
pub const DEAF: &str = "the DDS library's threads have ended, as they do in a process that was stopped \
                               and goes on: the domain is joined anew, no state is passed on until then";

/// What the executor is told of the robot.
pub fn health(known: Known) -> Health {
    // ROS 2 has no word for it: an arm whose driver speaks is one that knows where it is.
    let mut status = status::CALIBRATED;
    if known.running != Some(true) {
        status |= status::HALTED;
    }
    Health { status, is_linked: known.listens && known.active != Some(false) }
}

/// A message of joint states.
pub fn heard(message: &JointState, at_ns: u64) -> Heard<'_> {
    let stamp = message.header.stamp;
    Heard {
        stamp_ns: moment(stamp.sec, stamp.nanosec),
        at_ns,
        names: &message.name,
        positions: &message.position,
        velocities: &message.velocity,
        efforts: &message.effort,
    }
}

/// Says what changed.
#[derive(Default)]
pub struct Told(Option<(Known, bool)>, Option<String>);

impl Told {
    /// What the controller_manager says, if it is another thing than before.
    pub fn manager(&mut self, said: Option<String>) {
        if said != self.1 {
            if let Some(said) = &said {
                tracing::error!("{said}");
            }
            self.1 = said;
        }
    }

    pub fn tell(&mut self, known: Known, hears: bool, args: &RunArgs) {
        if self.0.replace((known, hears)) == Some((known, hears)) {
            return;
        }
        let (controller, states) = (&args.controller, &args.joint_states);
        if !known.listens {
            tracing::error!(
                "no controller listens: nobody takes what is sent to {controller}; no state is \
                 passed on, the arm stops. Is it loaded, in this domain (ROS_DOMAIN_ID), on this \
                 network?"
            );
        } else if known.active == Some(false) {
            tracing::error!(
                "the controller {controller} is not active: its controller_state is silent; no state \
                 is passed on. `ros2 control switch_controllers --activate` it"
            );
        } else if !known.speaks {
            tracing::error!("{states} has no sender: no state is passed on, the arm stops");
        } else if !hears {
            tracing::error!("{states} is silent: no state is passed on, the arm stops");
        } else if known.running != Some(true) {
            let topic = args.running.as_deref().unwrap_or_default();
            let why = if known.running.is_none() { "has not said a word" } else { "says so" };
            tracing::warn!("the motors are off: {topic} {why}");
        } else {
            tracing::info!("joint states come, motors on, controller listening");
        }
    }
}
