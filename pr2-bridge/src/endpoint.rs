//! The endpoint's loop: states out as they come, setpoints in, messages to the controller.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::{Context, bail};
use nullsweep_executor::Guard;
use nullsweep_executor::rt::become_real_time;
use nullsweep_ipc_types::ports::{Ipc, now_ns};
use nullsweep_ipc_types::{JointStates, MAX_HELD_JOINTS, status};
use nullsweep_robot::{Arm, Continuous};
use signal_hook::consts::{SIGINT, SIGTERM};

use crate::args::{Common, RunArgs};
use crate::link::msgs::sensor_msgs;
use crate::link::{Link, Names, News, Order, Service, moment};
use crate::stream::{DOF, Joints, Rules, Stream};
use crate::trajectory::trajectory;
use crate::whole::Whole;

/// Joint states older than this when they arrive are not passed on: the robot's clock and this
/// one's disagree, or the network stalls. \[ns\]
const OLD_NS: u64 = 500_000_000;
/// The driver says each second whether its motors are halted. \[ns\]
const SILENT_NS: u64 = 3_000_000_000;
/// The master counts as lost so long after it was last reached. \[ns\]
const MASTER_NS: u64 = 2_000_000_000;
/// `/joint_states` comes at 100 Hz; after so long without a usable one it counts as lost. \[ns\]
const UNHEARD_NS: u64 = 200_000_000;
/// Time between two looks. The executor's setpoints wait in their buffer meanwhile.
const ROUND: Duration = Duration::from_micros(500);

/// Runs until SIGINT or SIGTERM.
pub fn run(common: &Common, args: &RunArgs) -> anyhow::Result<()> {
    let arm = args.load()?;
    if arm.dof() != DOF {
        bail!("the arm has {} joints, the PR2's controller takes {DOF}", arm.dof());
    }
    let done = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&done))?;
    }
    let names = Names {
        controller: args.controller(),
        calibrated: (!args.assume_calibrated).then(|| args.calibrated.clone()),
        goals: args.whole_plan,
    };
    // Before the ROS side's threads are made, which inherit it. Where it is denied messages are
    // only later now and then.
    let _ = become_real_time(args.priority, None);
    let link = Link::open(common, &names)?;
    let ipc = Ipc::open(&args.robot_name, args.ipc_root.as_deref())?;
    let mut ear = Ear::new(&arm);
    tracing::info!("arm {} at {}, master {}", args.controller(), args.robot_name, common.master);
    if args.whole_plan {
        return whole_plans(&ipc, &arm, &link, &mut ear, &done);
    }
    let setpoints = ipc.setpoint_receiver().context("an endpoint runs already")?;
    let states = ipc.state_sender().context("an endpoint runs already")?;
    let delay_ns = args.delay * 1_000_000;
    let mut stream = Stream::new(Rules {
        delay_ns,
        timeout_ns: args.timeout * 1_000_000,
        stop_acceleration: args.stop_acceleration,
        start_tolerance: Guard::START_TOLERANCE,
        continuous: Continuous::of(arm.limits()),
    });
    let mut told = Told::default();
    let mut due_ns = now_ns();
    let mut disabled = false;
    let mut stopped = None;
    while !done.load(Ordering::Relaxed) {
        std::thread::sleep(ROUND);
        let health = health(&link, &ear, now_ns());
        told.tell(health, &link);
        while let Ok(News::Joints(message, at_ns)) = link.news.try_recv() {
            let Some(mut state) = ear.hear(&message, at_ns) else { continue };
            state.status = health.status;
            if disabled {
                // The driver tells it up to a second later.
                state.status |= status::HALTED;
            }
            if stopped.is_some() {
                state.status |= status::SETPOINT_TIMEOUT;
            }
            if let Some((sequence, deadline)) = stream.in_force(state.stamp_ns) {
                state.setpoint_sequence = sequence;
                state.setpoint_received_ns = deadline;
            }
            // Without master or controller the state goes stale: the executor then stops the arm
            // on its path, and the setpoints of that stop still go out.
            if health.is_linked {
                states.send(&state)?;
            }
        }
        let Some(measured) = ear.measured else { continue };
        while let Some(setpoint) = setpoints.receive()? {
            if (setpoint.disable != 0) != disabled {
                disabled = setpoint.disable != 0;
                let service = if disabled { Service::Halt } else { Service::Reset };
                link.orders.send(Order::Call(service)).context("the ROS side ended")?;
            }
            stream.take(&setpoint, &measured);
        }
        let off = status::HALTED | status::CALIBRATED;
        if health.status & off != status::CALIBRATED {
            stream.let_go();
        }
        let now = now_ns();
        let before = std::mem::replace(&mut stopped, stream.stopped(now));
        if let Some(why) = stopped.filter(|_| before.is_none()) {
            tracing::warn!("{why}: the arm comes to rest");
        }
        if now >= due_ns {
            due_ns = now.max(due_ns + args.period * 1_000_000);
            if let Some(message) = stream.message(now) {
                let order = Order::Command(trajectory(&message, arm.joint_names()));
                link.orders.send(order).context("the ROS side ended")?;
            }
        }
    }
    tracing::info!(
        "ended: {} joint states, {} lost, {} messages late, {} setpoints refused",
        ear.sequence,
        link.known.lost.load(Ordering::Relaxed),
        stream.late,
        stream.refused
    );
    Ok(())
}

fn whole_plans(
    ipc: &Ipc,
    arm: &Arm,
    link: &Link,
    ear: &mut Ear,
    done: &AtomicBool,
) -> anyhow::Result<()> {
    let mut whole = Whole::open(ipc, arm)?;
    let mut told = Told::default();
    while !done.load(Ordering::Relaxed) {
        std::thread::sleep(Duration::from_millis(2));
        let health = health(link, ear, now_ns());
        told.tell(health, link);
        while let Ok(news) = link.news.try_recv() {
            match news {
                News::Joints(message, at_ns) => {
                    if let Some(state) = ear.hear(&message, at_ns) {
                        whole.measured(&state);
                    }
                }
                News::Result(result) => whole.ended(&result)?,
            }
        }
        let ready = health.is_linked && health.hears && health.status == status::CALIBRATED;
        whole.round(ready, link)?;
    }
    whole.close()
}

/// What can be said of the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Health {
    status: u32,
    /// Whether master and controller are there.
    is_linked: bool,
    has_master: bool,
    /// Whether joint states come that can be used.
    hears: bool,
}

fn health(link: &Link, ear: &Ear, now: u64) -> Health {
    let known = &link.known;
    let silent = now.saturating_sub(known.halted_ns.load(Ordering::Relaxed)) > SILENT_NS;
    let mut bits = 0;
    if known.calibrated.load(Ordering::Relaxed) {
        bits |= status::CALIBRATED;
    }
    if silent || known.halted.load(Ordering::Relaxed) {
        bits |= status::HALTED;
    }
    let has_master = now.saturating_sub(known.master_ns.load(Ordering::Relaxed)) <= MASTER_NS;
    let is_linked = has_master && known.controller.load(Ordering::Relaxed);
    let hears = now.saturating_sub(ear.heard_ns) <= UNHEARD_NS;
    Health { status: bits, is_linked, has_master, hears }
}

/// Says what changed.
#[derive(Default)]
struct Told(Option<Health>);

impl Told {
    fn tell(&mut self, health: Health, link: &Link) {
        if self.0.replace(health) == Some(health) {
            return;
        }
        if !health.has_master {
            tracing::error!("the ROS master is gone: no state is passed on, the arm stops");
        } else if !health.is_linked {
            tracing::error!("the arm's controller does not listen: no state is passed on");
        } else if !health.hears {
            tracing::error!("/joint_states is silent: no state is passed on, the arm stops");
        } else if health.status & status::CALIBRATED == 0 {
            tracing::warn!("the joints are not calibrated");
        } else if health.status & status::HALTED != 0 {
            let said = link.known.halted.load(Ordering::Relaxed);
            let why = if said { "run stop, halt or error" } else { "motors_halted is silent" };
            tracing::warn!("the motors are halted: {why}");
        } else {
            tracing::info!("calibrated, motors on, controller listening");
        }
    }
}

/// Joint states to the executor's states.
struct Ear {
    names: Vec<String>,
    held: Vec<String>,
    measured: Option<Joints>,
    /// When the last usable one came. \[ns\]
    heard_ns: u64,
    sequence: u64,
    warned: bool,
}

impl Ear {
    fn new(arm: &Arm) -> Self {
        Self {
            names: arm.joint_names().to_vec(),
            held: arm.held_joints().iter().map(|h| h.name.clone()).collect(),
            measured: None,
            heard_ns: 0,
            sequence: 0,
            warned: false,
        }
    }

    /// The state, `None` for a message that cannot be used; the first such one is told.
    fn hear(&mut self, message: &sensor_msgs::JointState, at_ns: u64) -> Option<JointStates> {
        match self.read(message, at_ns) {
            Ok(state) => {
                self.warned = false;
                Some(state)
            }
            Err(why) => {
                if !std::mem::replace(&mut self.warned, true) {
                    tracing::error!("/joint_states cannot be used: {why}");
                }
                None
            }
        }
    }

    fn read(
        &mut self,
        message: &sensor_msgs::JointState,
        at_ns: u64,
    ) -> anyhow::Result<JointStates> {
        let find = |name: &String| {
            let found = message.name.iter().position(|n| n == name);
            let index = found.with_context(|| format!("joint {name} is not in it"))?;
            let position = message.position.get(index).context("fewer positions than names")?;
            anyhow::Ok((index, *position))
        };
        let stamp_ns = moment(&message.header.stamp).min(at_ns);
        if at_ns - stamp_ns > OLD_NS {
            bail!(
                "its stamp is {:.2} s old: set both machines' clocks by NTP",
                (at_ns - stamp_ns) as f64 * 1e-9
            );
        }
        let mut state = <JointStates as bytemuck::Zeroable>::zeroed();
        for (j, name) in self.names.iter().enumerate() {
            let (index, position) = find(name)?;
            state.positions[j] = position;
            state.velocities[j] = message.velocity.get(index).copied().unwrap_or(0.0);
            state.efforts[j] = message.effort.get(index).copied().unwrap_or(0.0);
        }
        if self.held.len() > MAX_HELD_JOINTS {
            bail!("{} joints are held, the wire takes {MAX_HELD_JOINTS}", self.held.len());
        }
        for (h, name) in self.held.iter().enumerate() {
            state.held_positions[h] = find(name)?.1;
        }
        self.heard_ns = at_ns;
        self.sequence += 1;
        state.sequence = self.sequence;
        state.stamp_ns = stamp_ns;
        state.held_count = self.held.len() as u32;
        state.joint_count = DOF as u32;
        self.measured = Some(std::array::from_fn(|j| state.positions[j]));
        Ok(state)
    }
}
