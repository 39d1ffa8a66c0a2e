//! Whole plans in place of setpoints: each one goal of the controller's. No executor runs then.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::Context;
use nullsweep_bridge::{Ask, Ear, Whole};
use nullsweep_ipc_types::ports::{Ipc, now_ns};
use nullsweep_ipc_types::status;
use nullsweep_robot::Arm;

use crate::args::{Common, RunArgs};
use crate::link::Link;
use crate::told::{DEAF, Told, health, heard};

/// Time between two looks.
const ROUND: Duration = Duration::from_millis(2);
/// The controller has the whole plan: it is ended where nothing is heard of the arm for so long, or nobody
/// listens.
const SILENT: Duration = Duration::from_secs(1);

/// Runs until `done`.
pub fn run(
    (common, args): (&Common, &RunArgs),
    ipc: &Ipc,
    arm: &Arm,
    mut link: Link,
    mut ear: Ear,
    done: &AtomicBool,
) -> anyhow::Result<()> {
    let names = ear.names().to_vec();
    let mut whole = Whole::open(ipc, arm, args.takeover())?;
    let mut told = Told::default();
    let mut sound: Option<Instant> = None;
    while !done.load(Ordering::Relaxed) {
        std::thread::sleep(ROUND);
        if link.is_deaf() {
            tracing::error!("{DEAF}");
            link.again(common, args).context("the domain cannot be joined anew")?;
        }
        for (state, at_ns) in &link.hear() {
            if let Some(state) = ear.hear(&heard(state, *at_ns)) {
                whole.measured(&state);
            }
        }
        for (goal, failed) in link.ends() {
            whole.ended(&goal, failed.as_deref())?;
        }
        let (known, hears) = (link.known(), ear.hears(now_ns()));
        told.tell(known, hears, args);
        told.manager(link.said());
        let health = health(known);
        if health.is_linked && hears && health.status == status::CALIBRATED {
            sound = Some(Instant::now());
        }
        // Motors that are off are told, and no silence.
        let ready =
            health.status == status::CALIBRATED && sound.is_some_and(|at| at.elapsed() < SILENT);
        for ask in whole.round(ready)? {
            match ask {
                Ask::Goal(goal) => link.send(&goal, &names),
                Ask::Hold => link.hold(),
            }
        }
    }
    tracing::info!("ended: the arm was at most {:.4} rad from its goals' paths", link.farthest());
    whole.close()?;
    Ok(())
}
