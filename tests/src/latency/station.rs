//! An endpoint that looks for setpoints without pause and takes the time of each.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use nullsweep_ipc_types::ports::{Ipc, now_ns};
use nullsweep_ipc_types::{PlanId, Setpoint};
use nullsweep_robot::Arm;

use super::stats::Times;
use crate::endpoint::{Behaviour, Endpoint};
use crate::judge::Verdict;

const PERIOD_NS: u64 = 1_000_000;

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

/// Plays the hardware endpoint until `done`.
pub(super) fn run(arm: &Arm, robot: &str, root: &Path, done: &AtomicBool) -> anyhow::Result<Seen> {
    let ipc = Ipc::open(robot, Some(root))?;
    let (setpoints, states) = (ipc.setpoint_receiver()?, ipc.state_sender()?);
    let start_ns = now_ns();
    let mut endpoint = Endpoint::new(arm, arm.home(), Behaviour::default(), start_ns)?;
    let (mut transport, mut inter_arrival) = (Times::default(), Times::default());
    let (mut made_late, mut first) = (Times::default(), Vec::with_capacity(4096));
    let mut last: Option<(Setpoint, u64)> = None;
    let mut due_ns = start_ns;
    while !done.load(Ordering::Relaxed) {
        let received = setpoints.receive()?;
        let now = now_ns();
        if let Some(setpoint) = received {
            transport.record(now.saturating_sub(setpoint.stamp_ns));
            if let Some((before, before_ns)) = &last {
                inter_arrival.record(now - before_ns);
                made_late.record(setpoint.stamp_ns.saturating_sub(before.deadline_ns));
            }
            let before = last.as_ref().map_or(PlanId::NONE, |(before, _)| before.plan);
            if setpoint.plan.is_some() && setpoint.plan != before {
                first.push((setpoint.plan, now));
            }
            endpoint.receive(&[setpoint], now);
            last = Some((setpoint, now));
        }
        if now >= due_ns {
            due_ns += ((now - due_ns) / PERIOD_NS + 1) * PERIOD_NS;
            endpoint.receive(&[], now);
            if let Some(state) = endpoint.measure(now) {
                states.send(&state)?;
            }
        }
        std::hint::spin_loop();
    }
    let verdict = endpoint.judge().verdict().clone();
    Ok(Seen { transport, inter_arrival, made_late, first, verdict })
}
