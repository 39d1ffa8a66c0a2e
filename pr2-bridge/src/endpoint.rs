//! The endpoint's loop: states out as they come, setpoints in, messages to the controller.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::{Context, bail};
use nullsweep_bridge::{Ask, Do, Ear, Endpoint, Heard, Takeover, Timing, Whole, moment};
use nullsweep_executor::rt::become_real_time;
use nullsweep_ipc_types::ports::{Ipc, now_ns};
use nullsweep_ipc_types::status;
use nullsweep_robot::Arm;
use signal_hook::consts::{SIGINT, SIGTERM};

use crate::args::{Common, RunArgs};
use crate::link::msgs::sensor_msgs;
use crate::link::{Link, Names, News, Order, Service};
use crate::trajectory::{action_goal, trajectory};

/// Joints of the arm.
pub const DOF: usize = 7;
/// The driver says each second whether its motors are halted. \[ns\]
const SILENT_NS: u64 = 3_000_000_000;
/// The master counts as lost so long after it was last reached. \[ns\]
const MASTER_NS: u64 = 2_000_000_000;
/// The controller's code for an end as planned.
const SUCCEEDED: u8 = 3;
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
    let ear = Ear::new(&arm, str::to_string);
    tracing::info!("arm {} at {}, master {}", args.controller(), args.robot_name, common.master);
    if args.whole_plan {
        return whole_plans(&ipc, &arm, &link, ear, &done);
    }
    let timing = Timing {
        delay_ns: args.delay * 1_000_000,
        period_ns: args.period * 1_000_000,
        timeout_ns: args.timeout * 1_000_000,
        stop_acceleration: args.stop_acceleration,
    };
    let mut endpoint = Endpoint::open(&ipc, &arm, ear, &timing, Takeover::AtStamp)
        .context("an endpoint runs already")?;
    let mut told = Told::default();
    while !done.load(Ordering::Relaxed) {
        std::thread::sleep(ROUND);
        let health = health(&link, endpoint.hears(now_ns()), now_ns());
        told.tell(health, &link);
        let known = health.known();
        while let Ok(News::Joints(message, at_ns)) = link.news.try_recv() {
            endpoint.hear(&heard(&message, at_ns), known)?;
        }
        for what in endpoint.round(known, now_ns())? {
            let order = match what {
                Do::Power(true) => Order::Call(Service::Reset),
                Do::Power(false) => Order::Call(Service::Halt),
                Do::Follow(message) => Order::Command(trajectory(&message, arm.joint_names())),
                // The controller itself begins anew when its motors come on.
                Do::LetGo => continue,
            };
            link.orders.send(order).context("the ROS side ended")?;
        }
    }
    let lost = link.known.lost.load(Ordering::Relaxed);
    tracing::info!("ended: {}, {lost} messages lost", endpoint.sum());
    Ok(())
}

fn whole_plans(
    ipc: &Ipc,
    arm: &Arm,
    link: &Link,
    mut ear: Ear,
    done: &AtomicBool,
) -> anyhow::Result<()> {
    let mut whole = Whole::open(ipc, arm, Takeover::AtStamp)?;
    let mut told = Told::default();
    while !done.load(Ordering::Relaxed) {
        std::thread::sleep(Duration::from_millis(2));
        let health = health(link, ear.hears(now_ns()), now_ns());
        told.tell(health, link);
        while let Ok(news) = link.news.try_recv() {
            match news {
                News::Joints(message, at_ns) => {
                    if let Some(state) = ear.hear(&heard(&message, at_ns)) {
                        whole.measured(&state);
                    }
                }
                News::Result(result) => {
                    let (code, text) = (result.result.error_code, &result.status.text);
                    let failed =
                        (result.status.status != SUCCEEDED).then(|| format!("error {code} {text}"));
                    whole.ended(&result.status.goal_id.id, failed.as_deref())?;
                }
            }
        }
        let ready = health.is_linked && health.hears && health.status == status::CALIBRATED;
        for ask in whole.round(ready)? {
            let order = match ask {
                Ask::Goal(goal) => Order::Goal(Box::new(action_goal(&goal, arm.joint_names()))),
                // An empty trajectory makes the controller hold.
                Ask::Hold => Order::Command(Default::default()),
            };
            let _ = link.orders.send(order);
        }
    }
    Ok(whole.close()?)
}

/// A message of joint states.
fn heard(message: &sensor_msgs::JointState, at_ns: u64) -> Heard<'_> {
    let stamp = &message.header.stamp;
    Heard {
        stamp_ns: moment(stamp.secs, stamp.nsecs as u32),
        at_ns,
        names: &message.name,
        positions: &message.position,
        velocities: &message.velocity,
        efforts: &message.effort,
    }
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

impl Health {
    fn known(&self) -> nullsweep_bridge::Health {
        nullsweep_bridge::Health { status: self.status, is_linked: self.is_linked }
    }
}

fn health(link: &Link, hears: bool, now: u64) -> Health {
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
