//! Going on under a new cost, speed or scan while a plan runs: from a knot far enough ahead that
//! the new plan is made before the arm gets there, or else from where the arm is stopped. And going
//! on after a stop, from where the arm is held.

use std::fmt;
use std::time::{Duration, Instant};

use nullsweep_ipc_types::ports::{Ipc, IpcError, PortError, Receiver};
use nullsweep_ipc_types::{CommandKind, Mode, PlanEvent, PlanId, Reason, Telemetry, Verdict};
use nullsweep_robot::{JointVector, MAX_DOF};

use crate::link::place::{BRAKING_NS, Off, runs};
use crate::link::publish::{Join, Patience, PublishError, Watcher, newest_telemetry, publish};
use crate::link::pulse::Pulse;
use crate::link::site::Site;
use crate::plan::Plan;

/// How long the arm may take to come to rest.
const STOP: Duration = Duration::from_secs(10);
/// How long planning is taken to take where nobody says it, and the share of what is left to run that
/// it is given at most.
const LEAD: Duration = Duration::from_secs(10);
const SHARE: f64 = 0.5;
/// What planning once more is taken to take: so many times what it took, and so much more.
const AGAIN: (f64, Duration) = (1.25, Duration::from_secs(1));
/// What is to be replaced, and when.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// The plan that runs, or was stopped.
    pub running: &'a Plan,
    /// How long planning may take: where it takes longer, the arm is stopped. `None`: as long as it is
    /// found to take.
    pub lead: Option<Duration>,
    /// Where no plan runs, the knot up to which the plan counts as swept; `None`: where the executor
    /// has stopped it.
    pub from: Option<usize>,
}

/// Where a new plan begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start {
    /// In this knot of the running plan, in passing.
    Knot(usize),
    /// Where the arm was stopped and is held, past this knot of the plan that ran.
    Held {
        /// The last knot that the arm has passed.
        knot: usize,
        /// Commanded joint vector. \[rad\] or \[m\]
        at: JointVector,
    },
}

/// How the new plan came to run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Replanned {
    /// The new plan.
    pub plan: PlanId,
    /// Where it began.
    pub start: Start,
}

impl fmt::Display for Replanned {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { plan, start, .. } = self;
        match start {
            Start::Knot(knot) => write!(f, "plan {plan} goes on from knot {knot}, without a stop"),
            Start::Held { knot, .. } => {
                write!(f, "plan {plan} goes on from where the arm was stopped, past knot {knot}")
            }
        }
    }
}

/// Why there is no new plan in execution.
#[derive(Debug, thiserror::Error)]
pub enum ReplanError {
    /// The executor cannot be reached, or refused the plan for good.
    #[error(transparent)]
    Publish(#[from] PublishError),
    /// The services cannot be opened.
    #[error(transparent)]
    Ipc(#[from] IpcError),
    /// A port failed.
    #[error("reading from the executor: {0}")]
    Port(#[from] PortError),
    /// Nothing runs, and nothing was stopped.
    #[error("the executor executes no plan, and has stopped none on its way")]
    Idle,
    /// No plan runs, and the arm is not at rest.
    #[error("the arm is not at rest in the executor's hold: its mode is {}", .0.text())]
    NotHeld(Mode),
    /// A knot was given for a plan that runs.
    #[error("the plan runs: where it has got to is the executor's to say")]
    Runs,
    /// The plan has no such knot.
    #[error("the plan has knots 0 to {last}, not {knot}")]
    NoSuchKnot {
        /// The knot that was given.
        knot: usize,
        /// The last one.
        last: usize,
    },
    /// The arm is not where the plan was stopped, or another plan was.
    #[error("the arm is not where the plan that was given was stopped: {0}")]
    Moved(Off),
    /// Another plan runs than the one that was given.
    #[error("the executor does not run the plan that was given: {0}")]
    OtherPlan(Off),
    /// It ends before a new one could take over.
    #[error(
        "the running plan ends in {left:.1} s, before a new one that takes {lead:.1} s to make could \
         take over"
    )]
    Ends {
        /// Until its end at full speed. \[s\]
        left: f64,
        /// How long a new plan may take. \[s\]
        lead: f64,
    },
    /// The arm cannot be stopped to go on from there.
    #[error("the executor does not stop the arm: {}", .0.text())]
    NotStopped(Verdict),
    /// It did not come to rest, or ended in a fault.
    #[error("the arm did not come to hold within {0:?}: see `executor ctl status`")]
    NoHold(Duration),
    /// No plan could be made; what ran goes on, or the arm holds.
    #[error("no new plan: {0}")]
    Make(String),
}

/// Replaces the plan that runs by one that `make` makes from the start that it is given. Where that
/// takes longer than its lead and the knot has passed, `make` is called once more: for a knot that is
/// far enough ahead by the time that it took, if no lead was asked for and there is one, else for
/// where the arm is stopped on its path. An arm that was stopped before is planned for from where it
/// is held. `watcher` is told every event of the new plan.
///
/// # Errors
/// See [`ReplanError`].
pub fn replan(
    site: Site<'_>,
    request: Request<'_>,
    patience: Patience,
    make: &mut dyn FnMut(Start) -> Result<Plan, String>,
    watcher: &mut dyn Watcher,
) -> Result<Replanned, ReplanError> {
    let Request { running, lead, from } = request;
    let ipc = Ipc::open(site.robot, site.root)?;
    let telemetry = newest_telemetry(&ipc, patience.admission)?;
    let old = telemetry.plan;
    let start = if old.is_some() {
        if from.is_some() {
            return Err(ReplanError::Runs);
        }
        runs(running, &telemetry.commanded, telemetry.knot as usize)
            .map_err(ReplanError::OtherPlan)?;
        let left = running.duration() - telemetry.plan_time_ns as f64 * 1e-9;
        let guess = LEAD.min(Duration::from_secs_f64((SHARE * left).max(0.0)));
        let mut knot = knot_ahead(running, telemetry.plan_time_ns, lead.unwrap_or(guess))?;
        let mut tries = if lead.is_some() { 1 } else { 2 };
        loop {
            let begun = Instant::now();
            let plan = make(Start::Knot(knot)).map_err(ReplanError::Make)?;
            let took = begun.elapsed();
            // Whoever published another plan meanwhile wants that one.
            let still = newest_telemetry(&ipc, patience.admission)?;
            if still.plan == old {
                match publish(&plan, site.robot, site.root, Join::Knot, patience, watcher) {
                    Ok(plan) => return Ok(Replanned { plan, start: Start::Knot(knot) }),
                    Err(PublishError::NothingRuns) => {}
                    Err(PublishError::Rejected(why)) if is_late(&why) => {}
                    Err(error) => return Err(error.into()),
                }
            } else if still.plan.is_some() {
                runs(running, &still.commanded, still.knot as usize)
                    .map_err(ReplanError::OtherPlan)?;
            }
            tries -= 1;
            let enough = took.mul_f64(AGAIN.0) + AGAIN.1;
            match knot_ahead(running, still.plan_time_ns, enough) {
                Ok(later) if tries > 0 && still.plan == old => knot = later,
                _ => break stop(&ipc, old, knot, patience.admission)?,
            }
        }
    } else {
        held(running, &telemetry, from)?
    };
    let plan = make(start).map_err(ReplanError::Make)?;
    let plan = publish(&plan, site.robot, site.root, Join::Stop, patience, watcher)?;
    Ok(Replanned { plan, start })
}

/// Where an arm goes on from that runs no plan: up to which knot it has come is asked for, or told by the
/// executor that has stopped it; then the arm must be there.
fn held(plan: &Plan, now: &Telemetry, from: Option<usize>) -> Result<Start, ReplanError> {
    let mode = Mode::from_wire(now.mode).unwrap_or(Mode::Init);
    if mode != Mode::Hold {
        return Err(ReplanError::NotHeld(mode));
    }
    let mut at = JointVector::default();
    at.copy_from_slice(&now.commanded[..MAX_DOF]);
    let stopped = (now.stopped != 0).then_some(now.knot as usize);
    let knot = from.or(stopped).ok_or(ReplanError::Idle)?;
    let last = plan.knots.len().saturating_sub(1);
    if knot > last {
        return Err(ReplanError::NoSuchKnot { knot, last });
    }
    if from.is_some() {
        return Ok(Start::Held { knot, at });
    }
    let end = plan.knots[knot].time_ns.saturating_add(BRAKING_NS);
    let braked = plan.knots.partition_point(|k| k.time_ns <= end);
    let there = (knot..braked).find(|k| runs(plan, &now.commanded, *k).is_ok());
    let knot = there.unwrap_or(knot);
    runs(plan, &now.commanded, knot).map_err(ReplanError::Moved)?;
    Ok(Start::Held { knot, at })
}

/// The first knot that is not reached within `lead` at full speed, before the last one: there nothing
/// would be left to replace.
fn knot_ahead(plan: &Plan, time_ns: u64, lead: Duration) -> Result<usize, ReplanError> {
    let due = time_ns.saturating_add(u64::try_from(lead.as_nanos()).unwrap_or(u64::MAX));
    let ahead = plan.knots.partition_point(|k| k.time_ns <= due);
    if ahead + 1 < plan.knots.len() {
        return Ok(ahead);
    }
    let left = plan.duration() - time_ns as f64 * 1e-9;
    Err(ReplanError::Ends { left: left.max(0.0), lead: lead.as_secs_f64() })
}

/// Whether a later start may be taken although this one was not.
fn is_late(why: &PlanEvent) -> bool {
    matches!(
        Reason::from_wire(why.reason),
        Some(Reason::JoinKnot | Reason::JoinPlan | Reason::Start | Reason::Speed)
    )
}

/// Stops the arm on its path and waits until it holds. `knot` is told where the old plan ended
/// before its stop could be watched: it was passed by then.
fn stop(ipc: &Ipc, old: PlanId, knot: usize, patience: Duration) -> Result<Start, ReplanError> {
    let telemetry = ipc.telemetry_receiver()?;
    let mut pulse = Pulse::open(ipc);
    let mut passed = None;
    let mut newest = look(&telemetry, old, &mut passed)?;
    let answer = ipc.command_client()?.call(CommandKind::Stop, 0.0, patience)?;
    let verdict = Verdict::from_wire(answer.verdict).unwrap_or(Verdict::Unknown);
    // In Hold there is nothing to stop.
    if !matches!(verdict, Verdict::Accepted | Verdict::WrongMode) {
        return Err(ReplanError::NotStopped(verdict));
    }
    let begun = Instant::now();
    while begun.elapsed() < STOP {
        if let Some(held) = newest.filter(|t| t.stamp_ns >= answer.stamp_ns)
            && held.mode == Mode::Hold.wire()
        {
            let mut at = JointVector::default();
            at.copy_from_slice(&held.commanded[..MAX_DOF]);
            return Ok(Start::Held { knot: passed.unwrap_or(knot), at });
        }
        if let Some(lost) = pulse.look()? {
            return Err(PublishError::Lost(Box::new(lost)).into());
        }
        std::thread::sleep(Duration::from_millis(2));
        newest = look(&telemetry, old, &mut passed)?.or(newest);
    }
    Err(ReplanError::NoHold(STOP))
}

/// Reads all telemetry that waits, and notes how far the old plan has come.
fn look(
    telemetry: &Receiver<Telemetry>,
    old: PlanId,
    passed: &mut Option<usize>,
) -> Result<Option<Telemetry>, PortError> {
    let mut newest = None;
    while let Some(sample) = telemetry.receive()? {
        if sample.plan == old {
            *passed = Some(sample.knot as usize);
        }
        newest = Some(sample);
    }
    Ok(newest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::link::place::tests::plan;

    #[test]
    fn the_knot_lies_beyond_the_lead() {
        let plan = plan();
        let ahead = |time_s: f64, lead_s: f64| {
            knot_ahead(&plan, (time_s * 1e9) as u64, Duration::from_secs_f64(lead_s))
        };
        let found = |time_s: f64, lead_s: f64| ahead(time_s, lead_s).expect("a knot");
        assert_eq!(found(0.0, 0.0), 1);
        assert_eq!(found(2.5, 3.0), 6);
        assert_eq!(found(2.5, 2.5), 6, "a knot that is due at once is too near");
        for (time_s, lead_s) in [(2.5, 100.0), (0.0, 8.5), (8.5, 0.0)] {
            let error = ahead(time_s, lead_s).expect_err("it ends before").to_string();
            assert!(error.contains(&format!("ends in {:.1} s", 9.0 - time_s)), "{error}");
        }
    }

    #[test]
    fn a_stopped_arm_goes_on_from_where_it_is_held() {
        let plan = plan();
        let stopped = |knot: u32, at: f64| {
            let mut now = Telemetry {
                mode: Mode::Hold.wire(),
                stopped: 1,
                knot,
                ..bytemuck::Zeroable::zeroed()
            };
            now.commanded[0] = at;
            now
        };
        let knot = |now: &Telemetry, from| match held(&plan, now, from) {
            Ok(Start::Held { knot, at }) if at[0] == now.commanded[0] => Ok(knot),
            Ok(start) => panic!("{start:?}"),
            Err(error) => Err(error.to_string()),
        };
        assert_eq!(knot(&stopped(3, 0.35), None), Ok(3));
        assert_eq!(knot(&stopped(3, 0.52), None), Ok(4), "a fault braked on its path");
        let moved = knot(&stopped(3, 1.5), None).expect_err("it was moved away");
        assert!(moved.contains("roll is commanded to 1.5000, knots 3 and 4"), "{moved}");
        assert_eq!(knot(&stopped(3, 1.5), Some(3)), Ok(3), "as its user says");
        let none = Telemetry { stopped: 0, ..stopped(0, 0.0) };
        let idle = knot(&none, None).expect_err("nothing was stopped");
        assert!(idle.contains("executes no plan"), "{idle}");
        assert_eq!(knot(&none, Some(9)), Ok(9));
        assert!(knot(&none, Some(10)).expect_err("too far").contains("knots 0 to 9, not 10"));
        assert!(knot(&stopped(10, 0.9), None).expect_err("another plan").contains("not 10"));
        let fault = Telemetry { mode: Mode::Fault.wire(), ..stopped(3, 0.35) };
        assert!(knot(&fault, None).expect_err("a fault").contains("fault"));
    }
}
