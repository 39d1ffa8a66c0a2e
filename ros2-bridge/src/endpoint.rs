//! The endpoint's loop: states out as they come, setpoints in, messages to the controller.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::Context;
use nullsweep_bridge::{Do, Ear, Endpoint, Health, Heard, Player, moment};
use nullsweep_executor::rt::become_real_time;
use nullsweep_ipc_types::ports::{Ipc, now_ns};
use nullsweep_ipc_types::status;
use signal_hook::consts::{SIGINT, SIGTERM};

use crate::args::{Common, Interface, RunArgs};
use crate::link::{Known, Link};
use crate::messages::JointState;
use crate::ticks::Ticks;
use crate::trajectory::{positions, trajectory};

/// Time between two looks. The executor's setpoints wait in their buffer meanwhile.
const ROUND: Duration = Duration::from_micros(500);

/// Runs until SIGINT or SIGTERM.
pub fn run(common: &Common, args: &RunArgs) -> anyhow::Result<()> {
    let arm = args.arm.load()?;
    let rename = args.arm.names(&arm)?;
    let done = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&done))?;
    }
    // Before the ROS side's threads are made, which inherit it. Where it is denied messages are
    // only later now and then.
    let _ = become_real_time(args.priority, None);
    let mut link = Link::open(common, args)?;
    let ipc = Ipc::open(&args.robot_name, args.ipc_root.as_deref())?;
    let ear = Ear::new(&arm, rename);
    let names = ear.names().to_vec();
    tracing::info!(
        "robot {}, controller {}, domain {}: {}",
        args.robot_name,
        args.controller,
        common.domain,
        names.join(" ")
    );
    let mut endpoint = Endpoint::open(&ipc, &arm, ear, &args.timing(), args.takeover())
        .context("an endpoint runs already")?;
    let mut player = Player::new(args.period() * 1_000_000);
    let (mut told, mut ticks) = (Told::default(), Ticks::new(args.period() * 1_000_000));
    let mut placed = 0u64;
    while !done.load(Ordering::Relaxed) {
        std::thread::sleep(ROUND);
        if link.is_deaf() {
            tracing::error!(
                "the DDS library's threads have ended, as they do in a process that was stopped and \
                 goes on: the domain is joined anew, no state is passed on until then"
            );
            link.again(common, args).context("the domain cannot be joined anew")?;
        }
        let states = link.hear();
        let known = link.known();
        told.tell(known, endpoint.hears(now_ns()), args);
        let health = health(known);
        for (state, at_ns) in &states {
            endpoint.hear(&heard(state, *at_ns), health)?;
        }
        for what in endpoint.round(health, now_ns())? {
            match (what, args.interface) {
                (Do::Power(on), _) => link.power(on),
                (Do::Follow(message), Interface::Trajectory) => {
                    link.follow(trajectory(&message, &names));
                }
                (Do::Follow(message), Interface::Position) => player.take(&message),
                (Do::LetGo, _) => player.let_go(),
            }
        }
        if args.interface == Interface::Position
            && let Some(tick_ns) = ticks.due(now_ns())
            && let Some(at) = player.at(tick_ns)
        {
            placed += 1;
            link.place(positions(placed, &at.q, names.len()));
        }
    }
    tracing::info!("ended: {}, {} messages not sent", endpoint.sum(), link.lost);
    Ok(())
}

/// What the executor is told of the robot.
fn health(known: Known) -> Health {
    // ROS 2 has no word for it: an arm whose driver speaks is one that knows where it is.
    let mut status = status::CALIBRATED;
    if known.running != Some(true) {
        status |= status::HALTED;
    }
    Health { status, is_linked: known.listens && known.active != Some(false) }
}

/// A message of joint states.
fn heard(message: &JointState, at_ns: u64) -> Heard<'_> {
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
struct Told(Option<(Known, bool)>);

impl Told {
    fn tell(&mut self, known: Known, hears: bool, args: &RunArgs) {
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
