//! Sending a plan to the executor and waiting for what becomes of it.

use std::path::Path;
use std::time::{Duration, Instant};

use nullsweep_ipc_types::ports::{Ipc, IpcError, PortError, Receiver};
use nullsweep_ipc_types::{EventKind, JoinRule, PlanEvent, PlanId, Reason, Telemetry};

use crate::link::pulse::{Lost, Pulse};
use crate::link::site::Site;
use crate::plan::{Held, Plan, PlanError};

/// How a plan joins what is going on, as it is asked for on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Join {
    /// Stop on the running plan's path, then start.
    Stop,
    /// Start after the running plan.
    After,
    /// Start in the knot that the plan was made for.
    Knot,
}

/// How long to wait.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patience {
    /// For the executor's admission.
    pub admission: Duration,
    /// For the plan's end once it was accepted; `None`: do not wait for it.
    pub end: Option<Duration>,
}

/// Why a plan was not published, or came to no good end.
#[derive(Debug, thiserror::Error)]
pub enum PublishError {
    /// The plan cannot go over the wire.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// The services cannot be opened, or there is no executor.
    #[error(transparent)]
    Ipc(#[from] IpcError),
    /// A port failed while waiting.
    #[error("waiting for the executor: {0}")]
    Port(#[from] PortError),
    /// To be joined at a knot, but it continues no plan.
    #[error("the plan does not continue another one, so there is no knot to join")]
    ContinuesNothing,
    /// To be joined at a knot while nothing is executed.
    #[error("the executor executes no plan that could be joined")]
    NothingRuns,
    /// No telemetry came.
    #[error("the executor sends no telemetry: is it running?")]
    NoTelemetry,
    /// No admission came in time.
    #[error("the executor did not answer within {0:?}")]
    NoAdmission(Duration),
    /// The executor refused it.
    #[error("{}", describe(.0))]
    Rejected(Box<PlanEvent>),
    /// It did not end in time.
    #[error("the plan has not ended within {0:?}")]
    NoEnd(Duration),
    /// The executor was lost before it told what was waited for.
    #[error("{0}")]
    Lost(Box<Lost>),
    /// It was ended early.
    #[error("{}", ended(.0))]
    EndedEarly(Box<PlanEvent>),
}

/// How a plan ended before its own end: that another one took over may well be what was wanted.
fn ended(event: &PlanEvent) -> String {
    let replaced = event.kind == EventKind::Superseded.wire();
    let how = if replaced { "not gone through to its end" } else { "ended early" };
    format!("{how}: {}", describe(event))
}

/// Who is told what becomes of a plan.
pub trait Watcher {
    /// An event of the plan.
    fn event(&mut self, event: &PlanEvent);
    /// How far the executor is: its newest telemetry while the plan's end is waited for.
    fn progress(&mut self, _: &Telemetry) {}
}

impl<F: FnMut(&PlanEvent)> Watcher for F {
    fn event(&mut self, event: &PlanEvent) {
        self(event);
    }
}

/// Publishes the plan to `robot`'s executor and waits for its admission and, if asked, its end.
/// The executor is told whether the plan is as it was verified, and tells it on while the plan runs.
/// `watcher` is told every event of this plan. Returns the plan's id. An executor that dies
/// meanwhile is noticed within a second.
///
/// # Errors
/// No executor, a rejection with its reason, an early end, or an executor that was lost: see
/// [`PublishError`].
pub fn publish(
    plan: &Plan,
    robot: &str,
    root: Option<&Path>,
    join: Join,
    patience: Patience,
    watcher: &mut dyn Watcher,
) -> Result<PlanId, PublishError> {
    let (mut header, knots) = plan.message_parts()?;
    header.verified = u32::from(plan.check_seal().is_ok());
    let ipc = Ipc::open(robot, root)?;
    let events = ipc.event_receiver()?;
    let mut publisher = ipc.plan_publisher(knots.len())?;
    header.join_rule = match join {
        Join::Stop => JoinRule::StopThenStart,
        Join::After => JoinRule::AfterCurrent,
        Join::Knot => {
            let at = plan.continues.as_ref().ok_or(PublishError::ContinuesNothing)?;
            if !publisher.has_executor() {
                return Err(IpcError::NoExecutor {
                    robot: robot.into(),
                    root: root.map(Path::to_path_buf),
                }
                .into());
            }
            header.join_plan = running(&ipc, patience.admission)?;
            header.join_knot = at.knot;
            JoinRule::AtKnot
        }
    }
    .wire();
    while events.receive()?.is_some() {} // Older plans' events.
    let pulse = Pulse::open(&ipc);
    let id = publisher.publish(&header, &knots)?;
    let mut ear = Ear { id, events, pulse };

    let is_admission = |k| matches!(k, EventKind::Accepted | EventKind::Rejected);
    let admission = ear
        .wait(patience.admission, is_admission, watcher)?
        .ok_or(PublishError::NoAdmission(patience.admission))?;
    if admission.kind == EventKind::Rejected.wire() {
        return Err(PublishError::Rejected(Box::new(admission)));
    }
    let Some(limit) = patience.end else { return Ok(id) };
    let end = ear.wait(limit, is_end, watcher)?.ok_or(PublishError::NoEnd(limit))?;
    if end.kind == EventKind::Finished.wire() {
        Ok(id)
    } else {
        Err(PublishError::EndedEarly(Box::new(end)))
    }
}

/// What became of a plan that was published before, maybe by a process that is no more; one that runs is
/// waited for. `None` where the executor knows nothing of it: another one has taken its place, or has had
/// too many plans since.
///
/// # Errors
/// No executor, one that was lost, or a plan that does not end in time: see [`PublishError`].
pub fn fate(
    id: PlanId,
    site: Site<'_>,
    patience: Patience,
    watcher: &mut dyn Watcher,
) -> Result<Option<PlanEvent>, PublishError> {
    let ipc = Ipc::open(site.robot, site.root)?;
    // Who comes late gets the last events.
    let events = ipc.event_receiver()?;
    let running = newest_telemetry(&ipc, patience.admission)?.plan == id;
    let mut ear = Ear { id, events, pulse: Pulse::open(&ipc) };
    if running {
        let limit = patience.end.unwrap_or(Duration::MAX);
        return ear.wait(limit, is_end, watcher)?.ok_or(PublishError::NoEnd(limit)).map(Some);
    }
    ear.wait(HISTORY, is_end, watcher)
}

/// How long an executor's last events may take to come.
const HISTORY: Duration = Duration::from_millis(500);

fn is_end(kind: EventKind) -> bool {
    matches!(kind, EventKind::Finished | EventKind::Superseded | EventKind::Aborted)
}

/// Listens for what becomes of a plan.
struct Ear<'a> {
    id: PlanId,
    events: Receiver<PlanEvent>,
    pulse: Pulse<'a>,
}

impl Ear<'_> {
    /// The first event of a wanted kind; `None` where none comes in time.
    fn wait(
        &mut self,
        limit: Duration,
        wanted: fn(EventKind) -> bool,
        watcher: &mut dyn Watcher,
    ) -> Result<Option<PlanEvent>, PublishError> {
        let start = Instant::now();
        while start.elapsed() < limit {
            while let Some(event) = self.events.receive()? {
                if event.plan == self.id {
                    watcher.event(&event);
                    if EventKind::from_wire(event.kind).is_some_and(wanted) {
                        return Ok(Some(event));
                    }
                }
            }
            if let Some(lost) = self.pulse.look()? {
                return Err(PublishError::Lost(Box::new(lost)));
            }
            if let Some(telemetry) = self.pulse.last() {
                watcher.progress(telemetry);
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        Ok(None)
    }
}

/// The plan that the executor executes.
fn running(ipc: &Ipc, patience: Duration) -> Result<PlanId, PublishError> {
    let telemetry = newest_telemetry(ipc, patience)?;
    if telemetry.plan.is_some() { Ok(telemetry.plan) } else { Err(PublishError::NothingRuns) }
}

/// The executor's newest telemetry.
///
/// # Errors
/// [`PublishError::NoTelemetry`] if none came in time.
pub fn newest_telemetry(ipc: &Ipc, patience: Duration) -> Result<Telemetry, PublishError> {
    let receiver = ipc.telemetry_receiver()?;
    let start = Instant::now();
    while start.elapsed() < patience {
        if let Some(newest) = receiver.newest()? {
            return Ok(newest.value);
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    Err(PublishError::NoTelemetry)
}

/// An event in words, with the joint, knot, value and bound that it names.
#[must_use]
pub fn describe(event: &PlanEvent) -> String {
    describe_for(event, &[], &[])
}

/// The same, its joint by its name among those that the plan moves, or holds where it is one of these.
#[must_use]
pub fn describe_for(event: &PlanEvent, joints: &[String], held: &[Held]) -> String {
    let kind = EventKind::from_wire(event.kind).map_or("unknown event", EventKind::text);
    let mut text = format!("plan {} {kind}", event.plan);
    if let Some(reason) = Reason::from_wire(event.reason).filter(|r| *r != Reason::None) {
        text += &format!(": {reason}");
    }
    if event.knot != u32::MAX {
        text += &format!(", knot {}", event.knot);
    }
    let of_held = event.reason == Reason::HeldJoint.wire();
    if event.joint != u32::MAX {
        let at = event.joint as usize;
        let name = if of_held { held.get(at).map(|h| &h.name) } else { joints.get(at) };
        text += &match name {
            Some(name) => format!(", {name}"),
            None if of_held => format!(", held joint {at}"),
            None => format!(", joint {at}"),
        };
    }
    if event.kind == EventKind::Accepted.wire() {
        if event.value.is_finite() {
            text += &format!(" {:.1} ms after its publication", event.value * 1e3);
        }
        return text;
    }
    let (value, bound) = match Reason::from_wire(event.reason) {
        Some(Reason::HeldJoint) => ("planned for", "measured at"),
        Some(Reason::Start | Reason::Speed) => ("off by", "at most"),
        _ => ("value", "bound"),
    };
    if event.value.is_finite() {
        text += &format!(", {value} {:.6}", event.value);
    }
    if event.bound.is_finite() {
        text += &format!(", {bound} {:.6}", event.bound);
    }
    text
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;

    #[test]
    fn a_held_joint_is_named_and_no_joint_of_the_arm() {
        let joints = ["shoulder".to_owned(), "elbow".to_owned()];
        let held = ["torso", "head"].map(|name| Held { name: name.into(), position: 0.2 });
        let event = |reason: Reason| PlanEvent {
            kind: EventKind::Rejected.wire(),
            reason: reason.wire(),
            knot: u32::MAX,
            joint: 0,
            value: 0.2,
            bound: 0.1,
            ..PlanEvent::zeroed()
        };
        let text = describe_for(&event(Reason::HeldJoint), &joints, &held);
        assert!(text.ends_with(", torso, planned for 0.200000, measured at 0.100000"), "{text}");
        assert!(describe(&event(Reason::HeldJoint)).contains(", held joint 0, planned for"));
        let text = describe_for(&event(Reason::Velocity), &joints, &held);
        assert!(text.ends_with(", shoulder, value 0.200000, bound 0.100000"), "{text}");
    }
}
