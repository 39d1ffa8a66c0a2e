//! The endpoint's loop: states out as they come, setpoints in, messages to the controller.

use std::sync::atomic::Ordering;
use std::time::Duration;

use anyhow::Context;
use nullsweep_bridge::{Do, Ear, Endpoint, Player};
use nullsweep_executor::rt::become_real_time;
use nullsweep_ipc_types::ports::{Ipc, now_ns};

use crate::args::{Common, Interface, RunArgs};
use crate::link::Link;
use crate::signals;
use crate::ticks::Ticks;
use crate::told::{DEAF, Told, health, heard};
use crate::trajectory::{positions, trajectory};
use crate::whole;

/// Time between two looks. The executor's setpoints wait in their buffer meanwhile.
const ROUND: Duration = Duration::from_micros(500);

/// Runs until SIGINT or SIGTERM.
pub fn run(common: &Common, args: &RunArgs) -> anyhow::Result<()> {
    let arm = args.arm.load()?;
    let rename = args.arm.names(&arm)?;
    let done = signals::done()?;
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
    if args.whole_plan {
        return whole::run((common, args), &ipc, &arm, link, ear, &done);
    }
    let mut endpoint = Endpoint::open(&ipc, &arm, ear, &args.timing(), args.takeover())
        .context("an endpoint runs already")?;
    let mut player = Player::new(args.period() * 1_000_000);
    let (mut told, mut ticks) = (Told::default(), Ticks::new(args.period() * 1_000_000));
    let mut placed = 0u64;
    while !done.load(Ordering::Relaxed) {
        std::thread::sleep(ROUND);
        if link.is_deaf() {
            tracing::error!("{DEAF}");
            link.again(common, args).context("the domain cannot be joined anew")?;
        }
        let states = link.hear();
        let known = link.known();
        told.tell(known, endpoint.hears(now_ns()), args);
        told.manager(link.said());
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
