//! An endpoint that waits for each setpoint as the executor waits for its deadline: asleep until
//! shortly before, then without a pause, so that it takes the time of each without holding a
//! processor.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use nullsweep_executor::rt::become_real_time;
use nullsweep_ipc_types::ports::{Ipc, PortError, Receiver, now_ns};
use nullsweep_ipc_types::{PlanId, Setpoint, service};
use nullsweep_robot::Arm;

use super::stats::Times;
use crate::clock::sleep_until;
use crate::endpoint::{Behaviour, Endpoint};
use crate::judge::Verdict;

/// How long before a setpoint is due it is looked for without a pause. \[ns\]
const EARLY_NS: u64 = 60_000;
/// How long after, before the reader sleeps between looks. \[ns\]
const LATE_NS: u64 = 300_000;
/// Sleep between two looks for a setpoint that is late. \[ns\]
const LOOK_NS: u64 = 100_000;
/// How long a late setpoint is waited for at a time. \[ns\]
const PATIENCE_NS: u64 = 1_000_000;

/// What the endpoint saw.
#[derive(Clone, Debug)]
pub(super) struct Seen {
    /// From the executor's stamp to the endpoint's hand.
    pub(super) transport: Times,
    /// Between one setpoint and the next.
    pub(super) inter_arrival: Times,
    /// From when a setpoint was due to when it was made.
    pub(super) made_late: Times,
    /// When the first setpoint of each plan came. \[ns\]
    pub(super) first: Vec<(PlanId, u64)>,
    /// The judge's findings.
    pub(super) verdict: Verdict,
}

/// Plays the hardware endpoint until `done`, at a real-time priority where it is granted.
pub(super) fn run(
    arm: &Arm,
    robot: &str,
    root: &Path,
    priority: u8,
    done: &AtomicBool,
) -> anyhow::Result<Seen> {
    let ipc = Ipc::open(robot, Some(root))?;
    let (setpoints, states) = (ipc.setpoint_receiver()?, ipc.state_sender()?);
    let start_ns = now_ns();
    let mut endpoint = Endpoint::new(arm, arm.home(), Behaviour::default(), start_ns)?;
    let (mut transport, mut inter_arrival) = (Times::default(), Times::default());
    let (mut made_late, mut first) = (Times::default(), Vec::with_capacity(4096));
    let mut last: Option<(Setpoint, u64)> = None;
    let mut pass = Vec::with_capacity(2 * service::SETPOINT.buffer);
    let _ = become_real_time(priority, None);
    while !done.load(Ordering::Relaxed) {
        let due_ns = last.as_ref().map_or_else(now_ns, |(setpoint, _)| setpoint.deadline_ns);
        let mut next = wait(&setpoints, due_ns)?;
        pass.clear();
        while let Some(setpoint) = next {
            let now = now_ns();
            transport.record(now.saturating_sub(setpoint.stamp_ns));
            if let Some((before, before_ns)) = &last {
                inter_arrival.record(now - before_ns);
                made_late.record(setpoint.stamp_ns.saturating_sub(before.deadline_ns));
            }
            let before = last.as_ref().map_or(PlanId::NONE, |(before, _)| before.plan);
            if setpoint.plan.is_some() && setpoint.plan != before {
                first.push((setpoint.plan, now));
            }
            last = Some((setpoint, now));
            pass.push(setpoint);
            next = if pass.len() < pass.capacity() { setpoints.receive()? } else { None };
        }
        let now = now_ns();
        endpoint.receive(&pass, now);
        if let Some(state) = endpoint.measure(now) {
            states.send(&state)?;
        }
    }
    let verdict = endpoint.judge().verdict().clone();
    Ok(Seen { transport, inter_arrival, made_late, first, verdict })
}

/// The next setpoint, due at a time; `None` when it did not come within a period of it.
pub(super) fn wait(
    setpoints: &Receiver<Setpoint>,
    due_ns: u64,
) -> Result<Option<Setpoint>, PortError> {
    sleep_until(due_ns.saturating_sub(EARLY_NS));
    let start_ns = now_ns();
    let patience_ns = start_ns.max(due_ns) + PATIENCE_NS;
    loop {
        if let Some(setpoint) = setpoints.receive()? {
            return Ok(Some(setpoint));
        }
        let now = now_ns();
        if now >= patience_ns {
            return Ok(None);
        }
        if now >= start_ns.max(due_ns) + LATE_NS {
            sleep_until(now + LOOK_NS);
        }
        std::hint::spin_loop();
    }
}
