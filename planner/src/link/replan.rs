//! Going on under a new cost, speed or scan while a plan runs: from a knot far enough ahead that
//! the new plan is made before the arm gets there, or else from where the arm is stopped.

use std::fmt;
use std::time::{Duration, Instant};

use nullsweep_ipc_types::ports::{Ipc, IpcError, PortError, Receiver};
use nullsweep_ipc_types::{
    CommandKind, JointArray, Mode, PlanEvent, PlanId, Reason, Telemetry, Verdict,
};
use nullsweep_robot::{JointVector, MAX_DOF};

use crate::link::publish::{Join, Patience, PublishError, Watcher, newest_telemetry, publish};
use crate::link::pulse::Pulse;
use crate::link::site::Site;
use crate::plan::Plan;

/// How far the arm may be commanded from the plan that it is said to run: cubic segments leave the
/// straight line between two knots by less. \[rad\] or \[m\]
const ON_PLAN: f64 = 0.05;
/// How long the arm may take to come to rest.
const STOP: Duration = Duration::from_secs(10);

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
    /// Whether a plan from a knot came too late and the arm was stopped for the next one.
    pub late: bool,
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
    /// Another plan runs than the one that was given.
    #[error(
        "the executor does not run the plan that was given: {joint} is commanded to {commanded:.4}, knots {knot} and {} have it in {low:.4} … {high:.4}", .knot + 1
    )]
    OtherPlan {
        /// The joint that is elsewhere.
        joint: String,
        /// Where it is commanded.
        commanded: f64,
        /// The knot whose segment is executed.
        knot: usize,
        /// Least position of the joint there.
        low: f64,
        /// Greatest position of the joint there.
        high: f64,
    },
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

/// Replaces the plan that runs by one that `make` makes from the start that it is given. `lead` is
/// how long that may take; where it takes longer and the knot has passed, the arm is stopped on its
/// path and `make` is called once more. `watcher` is told every event of the new plan.
///
/// # Errors
/// See [`ReplanError`].
pub fn replan(
    site: Site<'_>,
    running: &Plan,
    lead: Duration,
    patience: Patience,
    make: &mut dyn FnMut(Start) -> Result<Plan, String>,
    watcher: &mut dyn Watcher,
) -> Result<Replanned, ReplanError> {
    let ipc = Ipc::open(site.robot, site.root)?;
    let telemetry = newest_telemetry(&ipc, patience.admission)?;
    if !telemetry.plan.is_some() {
        return Err(PublishError::NothingRuns.into());
    }
    runs(running, &telemetry.commanded, telemetry.knot)?;
    let old = telemetry.plan;
    let knot = knot_ahead(running, telemetry.plan_time_ns, lead)?;
    let plan = make(Start::Knot(knot)).map_err(ReplanError::Make)?;
    // Whoever published another plan meanwhile wants that one.
    let still = newest_telemetry(&ipc, patience.admission)?;
    if still.plan == old {
        match publish(&plan, site.robot, site.root, Join::Knot, patience, watcher) {
            Ok(plan) => return Ok(Replanned { plan, start: Start::Knot(knot), late: false }),
            Err(PublishError::NothingRuns) => {}
            Err(PublishError::Rejected(why)) if is_late(&why) => {}
            Err(error) => return Err(error.into()),
        }
    } else if still.plan.is_some() {
        runs(running, &still.commanded, still.knot)?;
    }
    let start = stop(&ipc, old, knot, patience.admission)?;
    let plan = make(start).map_err(ReplanError::Make)?;
    let plan = publish(&plan, site.robot, site.root, Join::Stop, patience, watcher)?;
    Ok(Replanned { plan, start, late: true })
}

/// Whether the arm is commanded to where this plan has it in this knot's segment.
fn runs(plan: &Plan, at: &JointArray, knot: u32) -> Result<(), ReplanError> {
    let knot = (knot as usize).min(plan.knots.len().saturating_sub(2));
    let Some([a, b]) = plan.knots.get(knot..knot + 2) else { return Ok(()) };
    for (j, name) in plan.joints.iter().enumerate().take(MAX_DOF) {
        let (low, high) = (a.q[j].min(b.q[j]), a.q[j].max(b.q[j]));
        // Whole turns of a continuous joint make no difference.
        let turns = (at[j] - 0.5 * (low + high)) / std::f64::consts::TAU;
        let commanded = at[j] - turns.round() * std::f64::consts::TAU;
        if !(low - ON_PLAN..=high + ON_PLAN).contains(&commanded) {
            let joint = name.clone();
            return Err(ReplanError::OtherPlan { joint, commanded, knot, low, high });
        }
    }
    Ok(())
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
        Some(Reason::JoinKnot | Reason::JoinPlan | Reason::Start)
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
    use nullsweep_ipc_types::MAX_JOINTS;
    use nullsweep_robot::Tool;

    use super::*;
    use crate::plan::{CostKind, FORMAT, Method, PlanKnot, Profile};

    /// One joint that turns by 0.1 rad a second.
    fn plan() -> Plan {
        let knot = |k: u64| {
            let mut q = [0.0; MAX_DOF];
            q[0] = 0.1 * k as f64;
            PlanKnot {
                time_ns: k * 1_000_000_000,
                q: JointVector::new(q),
                v: JointVector::ZERO,
                line: None,
                patch: None,
            }
        };
        Plan {
            format: FORMAT,
            robot: "one".into(),
            fingerprint: 1,
            joints: vec!["roll".into()],
            held: Vec::new(),
            tool: Tool::default(),
            base: [0.0; 3],
            base_height: 0.0,
            method: Method::Tsp,
            cost: CostKind::Time,
            profile: Profile::Velocity,
            jerk: None,
            seed: 1,
            knots: (0..10).map(knot).collect(),
            patches: Vec::new(),
            surface: Vec::new(),
            continues: None,
            past: Vec::new(),
            seal: None,
        }
    }

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
    fn another_plan_is_told_apart() {
        let plan = plan();
        let mut at = [0.0; MAX_JOINTS];
        at[0] = 0.35;
        runs(&plan, &at, 3).expect("on the plan");
        at[0] += 3.0 * std::f64::consts::TAU;
        runs(&plan, &at, 3).expect("as far, whole turns on");
        let error = runs(&plan, &at, 7).expect_err("elsewhere");
        assert!(matches!(error, ReplanError::OtherPlan { knot: 7, .. }), "{error}");
    }
}
