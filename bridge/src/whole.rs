//! Whole plans: each admitted by the executor's own rules and given to the controller as one goal. A
//! plan that joins another one in a knot takes its place there; the controller splices it, or, where that
//! leaves a goal for the next one at once, the goal begins with what is ahead of the old one.

use nullsweep_executor::{
    Guard, Held, Ids, Join, Rejection, Rules, ValidPlan, admit, joins_at, starts_at,
};
use nullsweep_ipc_types::ports::{Ipc, IpcError, PlanReceiver, PortError, Sender, now_ns};
use nullsweep_ipc_types::{
    EventKind, Interpolation, JointStates, Knot, MAX_KNOTS, Mode, PlanEvent, PlanId, Reason,
    Telemetry,
};
use nullsweep_robot::{Arm, JointKind, JointVector};

use crate::stream::{Point, Takeover};

/// A goal starts so long after it is sent. \[ns\]
const AHEAD_NS: u64 = 200_000_000;
/// From where the arm is to the first knot, at most the guard's start tolerance away; meanwhile a goal that
/// was lost may be sent again. \[ns\]
const CONNECT_NS: u64 = 1_500_000_000;
/// A goal must come so long before its first motion. \[ns\]
const EARLY_NS: u64 = 50_000_000;
/// Time between two telemetry samples. \[ns\]
const TELL_NS: u64 = 10_000_000;

/// What the controller is to be given.
#[derive(Clone, Debug, PartialEq)]
pub struct Goal {
    /// Names it, for [`Whole::ended`].
    pub id: String,
    /// When its points' time 0 is. \[ns, `CLOCK_MONOTONIC`\]
    pub start_ns: u64,
    /// When it is too late for it: the arm would have to go on in the midst of it. \[ns\]
    pub until_ns: u64,
    /// At least one.
    pub points: Vec<Point>,
    /// Whether the points' velocities count; else the controller goes straight.
    pub curved: bool,
}

/// What the controller is asked.
#[derive(Clone, Debug, PartialEq)]
pub enum Ask {
    /// To take a goal, in place of one that it has.
    Goal(Goal),
    /// To hold.
    Hold,
}

/// A goal that the controller has.
struct Running {
    plan: ValidPlan,
    goal: Goal,
    /// When its time 0 is. \[ns\]
    start_ns: u64,
    started: bool,
    /// When the controller said that it has come to its end, and since when the arm is measured
    /// there. \[ns\]
    ended_ns: Option<u64>,
    there_ns: Option<u64>,
}

impl Running {
    /// Where it ends, and whether the arm is measured there for long enough; `None` while neither is
    /// decided.
    fn judge(
        &mut self,
        measured: Option<&JointVector>,
        guard: &Guard,
        now_ns: u64,
    ) -> Option<Rejection> {
        let ended_ns = self.ended_ns?;
        let far = Rejection::new(Reason::Goal);
        let last = self.plan.knots().last().map(|k| k.q);
        let off = match (measured, last) {
            (Some(measured), Some(last)) => guard.farthest(measured, &last, guard.goal_tolerance),
            _ => return Some(far),
        };
        let Some((joint, by)) = off else {
            let since = *self.there_ns.get_or_insert(now_ns);
            return (now_ns >= since + guard.settle_ns).then_some(Rejection::new(Reason::None));
        };
        self.there_ns = None;
        let late = now_ns >= ended_ns + guard.goal_ns;
        late.then(|| far.joint(joint).value(by, guard.goal_tolerance))
    }
}

/// The executor's part for whole plans.
pub struct Whole {
    plans: PlanReceiver,
    events: Sender<PlanEvent>,
    telemetry: Sender<Telemetry>,
    rules: Rules,
    takeover: Takeover,
    ids: Ids,
    state: Option<JointStates>,
    running: Option<Running>,
    /// What the arm is on until the running one starts.
    before: Option<Running>,
    event_count: u64,
    sample_count: u64,
    told_ns: u64,
}

impl Whole {
    /// Takes the executor's place at the plan service. `takeover`: when the controller leaves a goal for
    /// the next one.
    ///
    /// # Errors
    /// An executor runs already, or the services cannot be opened.
    pub fn open(ipc: &Ipc, arm: &Arm, takeover: Takeover) -> Result<Self, IpcError> {
        let robot = arm.robot();
        let turns = |name: &str| {
            robot.joints().iter().any(|j| j.name == name && j.kind == JointKind::Continuous)
        };
        let rules = Rules {
            guard: Guard::new(arm.limits()),
            fingerprint: arm.fingerprint(),
            held_continuous: arm.held_joints().iter().map(|h| turns(&h.name)).collect(),
            held_tolerance: Guard::HELD_TOLERANCE,
            since_ns: now_ns(),
        };
        Ok(Self {
            plans: ipc.plan_receiver()?,
            events: ipc.event_sender()?,
            telemetry: ipc.telemetry_sender()?,
            rules,
            takeover,
            ids: Ids::default(),
            state: None,
            running: None,
            before: None,
            event_count: 0,
            sample_count: 0,
            told_ns: 0,
        })
    }

    /// Takes a state in.
    pub fn measured(&mut self, state: &JointStates) {
        self.state = Some(*state);
    }

    /// Takes plans, watches the robot, tells how it goes; what the controller is to be asked.
    /// `ready`: the robot can move.
    ///
    /// # Errors
    /// [`PortError`] where plans cannot be received or events not be sent.
    pub fn round(&mut self, ready: bool) -> Result<Vec<Ask>, PortError> {
        let mut asks = Vec::new();
        while let Some(plan) = self.plans.receive()? {
            let header = *plan.header();
            let count = plan.knots().len().min(MAX_KNOTS);
            let knots: Vec<Knot> = plan.knots()[..count].to_vec();
            drop(plan);
            let held = self
                .state
                .map(|s| Held { positions: s.held_positions, count: s.held_count as usize });
            let admitted = admit(&header, &knots, held.as_ref(), &self.rules, now_ns());
            let admitted = self.ids.judge(header.id, admitted);
            match admitted.and_then(|plan| self.fit(&plan, ready).map(|start| (plan, start))) {
                Ok((plan, start)) => asks.push(Ask::Goal(self.begin(plan, start)?)),
                Err(why) => {
                    tracing::warn!("plan {} rejected: {why}", header.id);
                    self.tell(header.id, EventKind::Rejected, why)?;
                }
            }
        }
        let now = now_ns();
        if let Some(running) = &mut self.running
            && !running.started
            && now >= running.start_ns
        {
            running.started = true;
            self.before = None;
            let id = running.plan.id();
            self.tell(id, EventKind::Started, Rejection::new(Reason::None))?;
        }
        let measured = self.state.map(|s| self.joints(&s));
        let guard = self.rules.guard;
        if let Some(why) =
            self.running.as_mut().and_then(|r| r.judge(measured.as_ref(), &guard, now))
            && let Some(running) = self.running.take()
        {
            let id = running.plan.id();
            let kind = match why.reason {
                Reason::None => EventKind::Finished,
                _ => EventKind::Aborted,
            };
            if kind == EventKind::Aborted {
                tracing::error!("plan {id} did not come to its end: {why}");
            }
            self.tell(id, kind, why)?;
        }
        if self.running.is_none() {
            self.before = None;
        }
        if !ready && let Some(running) = self.running.take() {
            asks.push(Ask::Hold);
            tracing::error!("plan {} ended: the robot is not ready", running.plan.id());
            self.tell(running.plan.id(), EventKind::Aborted, Rejection::new(Reason::Fault))?;
        }
        if now >= self.told_ns + TELL_NS {
            self.told_ns = now;
            self.show(ready, now)?;
            // Who came since the last event gets the last ones.
            self.events.connect()?;
        }
        Ok(asks)
    }

    /// Takes the end of a goal in: `failed` says why where it is not as planned. Else its plan has
    /// ended once the arm is measured there.
    ///
    /// # Errors
    /// [`PortError`] where it cannot be told.
    pub fn ended(&mut self, goal: &str, failed: Option<&str>) -> Result<(), PortError> {
        let Some(why) = failed else {
            if let Some(running) = self.running.as_mut().filter(|r| r.goal.id == goal) {
                running.ended_ns = Some(now_ns());
            }
            return Ok(());
        };
        let Some(running) = self.running.take_if(|r| r.goal.id == goal) else { return Ok(()) };
        let id = running.plan.id();
        tracing::error!("plan {id} ended by the controller: {why}");
        self.tell(id, EventKind::Aborted, Rejection::new(Reason::Fault))
    }

    /// Ends what runs.
    ///
    /// # Errors
    /// [`PortError`] where it cannot be told.
    pub fn close(&mut self) -> Result<(), PortError> {
        match self.running.take() {
            Some(r) => self.tell(r.plan.id(), EventKind::Aborted, Rejection::new(Reason::Shutdown)),
            None => Ok(()),
        }
    }

    /// When the plan's time 0 is, if it fits the moment.
    fn fit(&self, plan: &ValidPlan, ready: bool) -> Result<u64, Rejection> {
        let state = self.state.filter(|_| ready).ok_or(Rejection::new(Reason::NotReady))?;
        let guard = &self.rules.guard;
        let measured = self.joints(&state);
        let running = self.running.as_ref().map(|r| (&r.plan, r.start_ns));
        // A goal that holds some of both is curved or is not.
        let curved = plan.interpolation() == Interpolation::Cubic;
        if let (Some(r), Join::Knot { .. }, Takeover::AtArrival) =
            (&self.running, plan.join(), self.takeover)
            && r.goal.curved != curved
        {
            return Err(Rejection::new(Reason::JoinPlan));
        }
        fit(plan, running, &measured, guard, now_ns())
    }

    /// The arm's joints as a state tells them.
    fn joints(&self, state: &JointStates) -> JointVector {
        JointVector::from_fn(|j| if j < self.rules.guard.dof { state.positions[j] } else { 0.0 })
    }

    /// The plan as a goal.
    fn begin(&mut self, plan: ValidPlan, start_ns: u64) -> Result<Goal, PortError> {
        let id = plan.id();
        let joins = matches!(plan.join(), Join::Knot { .. });
        let lead = if joins { 0 } else { CONNECT_NS };
        let mut goal = Goal {
            id: format!("nullsweep-{id}"),
            start_ns: start_ns - lead,
            until_ns: start_ns - EARLY_NS,
            // A joining plan's first knot is where the splice is.
            points: plan
                .knots()
                .iter()
                .skip(usize::from(joins))
                .map(|k| Point { after_ns: k.time as u64 + lead, q: k.q, v: k.v })
                .collect(),
            curved: plan.interpolation() == Interpolation::Cubic,
        };
        if let (Some(old), true, Takeover::AtArrival) = (&self.running, joins, self.takeover) {
            goal = goal.behind(&old.goal, now_ns());
        }
        let waited = now_ns().saturating_sub(id.epoch) as f64 * 1e-9;
        let told = Rejection::new(Reason::None).value(waited, plan.duration() * 1e-9);
        let running = Running {
            goal: goal.clone(),
            plan,
            start_ns,
            started: false,
            ended_ns: None,
            there_ns: None,
        };
        self.tell(id, EventKind::Accepted, told)?;
        if let Some(old) = self.running.replace(running) {
            self.tell(old.plan.id(), EventKind::Superseded, Rejection::new(Reason::None))?;
            if old.started {
                self.before = Some(old);
            }
        }
        Ok(goal)
    }

    fn tell(&mut self, plan: PlanId, kind: EventKind, why: Rejection) -> Result<(), PortError> {
        self.event_count += 1;
        tracing::info!("plan {plan} {kind}");
        self.events.send(&PlanEvent {
            sequence: self.event_count,
            stamp_ns: now_ns(),
            plan,
            value: why.value,
            bound: why.bound,
            kind: kind.wire(),
            reason: why.reason.wire(),
            joint: why.joint,
            knot: why.knot,
        })?;
        Ok(())
    }

    /// Telemetry, so that planners can ask what runs.
    fn show(&mut self, ready: bool, now: u64) -> Result<(), PortError> {
        self.sample_count += 1;
        let mut sample = <Telemetry as bytemuck::Zeroable>::zeroed();
        sample.sequence = self.sample_count;
        sample.stamp_ns = now;
        sample.joint_count = self.rules.guard.dof as u32;
        sample.speed_scale = 1.0;
        sample.mode = if ready { Mode::Hold.wire() } else { Mode::Init.wire() };
        if let Some(state) = &self.state {
            sample.measured = state.positions;
            sample.commanded = state.positions;
        }
        if let Some(r) = moving(self.running.as_ref(), self.before.as_ref(), now) {
            sample.mode = Mode::Executing.wire();
            sample.plan = r.plan.id();
            sample.unverified = u32::from(!r.plan.is_verified());
            sample.plan_time_ns = now - r.start_ns;
            let passed = r.plan.knots().partition_point(|k| k.time as u64 <= sample.plan_time_ns);
            sample.knot = passed.saturating_sub(1) as u32;
        }
        self.telemetry.send(&sample)?;
        Ok(())
    }
}

/// What the arm is on: the one before until its successor's time 0.
fn moving<'a>(
    running: Option<&'a Running>,
    before: Option<&'a Running>,
    now_ns: u64,
) -> Option<&'a Running> {
    running.filter(|r| now_ns >= r.start_ns).or(before)
}

/// When the plan's time 0 is, if it fits the moment: what runs with its time 0, and where the arm is.
/// \[ns\]
///
/// # Errors
/// The reason for which the executor would refuse it too, or [`Reason::QueueFull`] for what a
/// controller cannot do: stop on a path, or keep a plan for later.
pub fn fit(
    plan: &ValidPlan,
    running: Option<(&ValidPlan, u64)>,
    measured: &JointVector,
    guard: &Guard,
    now_ns: u64,
) -> Result<u64, Rejection> {
    match (plan.join(), running) {
        (Join::Knot { plan: joined, knot }, Some((runs, start_ns))) if runs.id() == joined => {
            let passed = Rejection::new(Reason::JoinKnot).value(knot as f64, f64::NAN);
            let at = runs.knots().get(knot).ok_or(passed)?;
            let start = start_ns + at.time as u64;
            if start < now_ns + AHEAD_NS / 2 {
                return Err(passed);
            }
            joins_at(plan, runs, knot, &at.q, guard).map(|()| start)
        }
        (Join::Knot { .. }, _) => Err(Rejection::new(Reason::JoinPlan)),
        (Join::Stop | Join::After, Some(_)) => Err(Rejection::new(Reason::QueueFull)),
        (Join::Stop | Join::After, None) => {
            starts_at(plan, measured, guard).map(|()| now_ns + AHEAD_NS + CONNECT_NS)
        }
    }
}

#[cfg(test)]
mod tests;
