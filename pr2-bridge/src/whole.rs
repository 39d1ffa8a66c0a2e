//! Whole plans: each admitted by the executor's own rules and sent as one goal. A plan that joins
//! another one in a knot takes its place there; the controller splices it.

use nullsweep_executor::{Guard, Held, Ids, Join, Rejection, Rules, ValidPlan, admit};
use nullsweep_ipc_types::ports::{Ipc, PlanReceiver, Sender, now_ns};
use nullsweep_ipc_types::{
    EventKind, Interpolation, JointStates, Knot, MAX_KNOTS, Mode, PlanEvent, Reason, Telemetry,
};
use nullsweep_robot::{Arm, JointKind};

use crate::link::msgs::control_msgs;
use crate::link::{Link, Order, ros_time};
use crate::stream::{DOF, Joints};
use crate::trajectory::point;

/// A goal starts so long after it is sent. \[ns\]
const AHEAD_NS: u64 = 200_000_000;
/// From where the arm is to the first knot, at most the guard's start tolerance away. \[ns\]
const CONNECT_NS: u64 = 500_000_000;
/// Time between two telemetry samples. \[ns\]
const TELL_NS: u64 = 10_000_000;
/// The controller's code for an end as planned.
const SUCCEEDED: u8 = 3;

/// A goal that the controller has.
struct Running {
    plan: ValidPlan,
    goal: String,
    /// When its time 0 is. \[ns\]
    start_ns: u64,
    started: bool,
}

/// The executor's part for whole plans.
pub struct Whole {
    plans: PlanReceiver,
    events: Sender<PlanEvent>,
    telemetry: Sender<Telemetry>,
    rules: Rules,
    ids: Ids,
    names: Vec<String>,
    state: Option<JointStates>,
    running: Option<Running>,
    event_count: u64,
    sample_count: u64,
    told_ns: u64,
}

impl Whole {
    /// Takes the executor's place at the plan service.
    pub fn open(ipc: &Ipc, arm: &Arm) -> anyhow::Result<Self> {
        let robot = arm.robot();
        let held_continuous = arm
            .held_joints()
            .iter()
            .map(|h| {
                robot.joints().iter().any(|j| j.name == h.name && j.kind == JointKind::Continuous)
            })
            .collect();
        let rules = Rules {
            guard: Guard::new(arm.limits()),
            fingerprint: arm.fingerprint(),
            held_continuous,
            held_tolerance: Rules::HELD_TOLERANCE,
            since_ns: now_ns(),
        };
        Ok(Self {
            plans: ipc.plan_receiver()?,
            events: ipc.event_sender()?,
            telemetry: ipc.telemetry_sender()?,
            rules,
            ids: Ids::default(),
            names: arm.joint_names().to_vec(),
            state: None,
            running: None,
            event_count: 0,
            sample_count: 0,
            told_ns: 0,
        })
    }

    /// Takes a state in.
    pub fn measured(&mut self, state: &JointStates) {
        self.state = Some(*state);
    }

    /// Takes plans, watches the robot, tells how it goes. `ready`: the robot can move.
    pub fn round(&mut self, ready: bool, link: &Link) -> anyhow::Result<()> {
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
                Ok((plan, start)) => self.begin(plan, start, link)?,
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
            let id = running.plan.id();
            self.tell(id, EventKind::Started, Rejection::new(Reason::None))?;
        }
        if !ready && let Some(running) = self.running.take() {
            // Halted motors, or no link: an empty trajectory makes the controller hold.
            let _ = link.orders.send(Order::Command(Default::default()));
            tracing::error!("plan {} ended: the robot is not ready", running.plan.id());
            self.tell(running.plan.id(), EventKind::Aborted, Rejection::new(Reason::Fault))?;
        }
        if now >= self.told_ns + TELL_NS {
            self.told_ns = now;
            self.show(ready, now)?;
        }
        Ok(())
    }

    /// Takes the end of a goal in.
    pub fn ended(
        &mut self,
        result: &control_msgs::FollowJointTrajectoryActionResult,
    ) -> anyhow::Result<()> {
        let ours = |r: &Running| r.goal == result.status.goal_id.id;
        let Some(running) = self.running.take_if(|r| ours(r)) else { return Ok(()) };
        let id = running.plan.id();
        if result.status.status == SUCCEEDED {
            return self.tell(id, EventKind::Finished, Rejection::new(Reason::None));
        }
        let (code, text) = (result.result.error_code, &result.status.text);
        tracing::error!("plan {id} ended by the controller: error {code} {text}");
        self.tell(id, EventKind::Aborted, Rejection::new(Reason::Fault))
    }

    /// Ends what runs.
    pub fn close(&mut self) -> anyhow::Result<()> {
        match self.running.take() {
            Some(r) => self.tell(r.plan.id(), EventKind::Aborted, Rejection::new(Reason::Shutdown)),
            None => Ok(()),
        }
    }

    /// When the plan's time 0 is, if it fits the moment.
    fn fit(&self, plan: &ValidPlan, ready: bool) -> Result<u64, Rejection> {
        let state = self.state.filter(|_| ready).ok_or(Rejection::new(Reason::NotReady))?;
        let first = &plan.knots()[0];
        let guard = &self.rules.guard;
        match (plan.join(), &self.running) {
            (Join::Knot { plan: joined, knot }, Some(r)) if r.plan.id() == joined => {
                let passed = Rejection::new(Reason::JoinKnot).value(knot as f64, f64::NAN);
                let at = r.plan.knots().get(knot).ok_or(passed)?;
                let start = r.start_ns + at.time as u64;
                if start < now_ns() + AHEAD_NS / 2 {
                    return Err(passed);
                }
                match guard.farthest(&at.q, &first.q, guard.join_tolerance) {
                    Some((joint, by)) => {
                        Err(Rejection::new(Reason::Start).joint(joint).value(by, 0.0))
                    }
                    None => Ok(start),
                }
            }
            (Join::Knot { .. }, _) => Err(Rejection::new(Reason::JoinPlan)),
            // The controller cannot stop on a path: only what joins in a knot replaces a plan.
            (Join::Stop | Join::After, Some(_)) => Err(Rejection::new(Reason::QueueFull)),
            (Join::Stop | Join::After, None) => {
                let mut at = first.q;
                at[..DOF].copy_from_slice(&state.positions[..DOF]);
                let tolerance = guard.start_tolerance;
                match guard.farthest(&at, &first.q, tolerance) {
                    Some((joint, by)) => {
                        Err(Rejection::new(Reason::Start).joint(joint).value(by, tolerance))
                    }
                    None => Ok(now_ns() + AHEAD_NS + CONNECT_NS),
                }
            }
        }
    }

    /// Sends the plan as a goal.
    fn begin(&mut self, plan: ValidPlan, start_ns: u64, link: &Link) -> anyhow::Result<()> {
        let id = plan.id();
        let joins = matches!(plan.join(), Join::Knot { .. });
        let mut goal = control_msgs::FollowJointTrajectoryActionGoal::default();
        goal.header.stamp = ros_time(now_ns());
        goal.goal_id.stamp = goal.header.stamp.clone();
        goal.goal_id.id = format!("nullsweep-{id}");
        let lead = if joins { 0 } else { CONNECT_NS };
        goal.goal.trajectory.header.stamp = ros_time(start_ns - lead);
        goal.goal.trajectory.joint_names = self.names.clone();
        let curved = plan.interpolation() == Interpolation::Cubic;
        // A joining plan's first knot is where the splice is.
        goal.goal.trajectory.points = plan
            .knots()
            .iter()
            .skip(usize::from(joins))
            .map(|k| {
                let q: Joints = std::array::from_fn(|j| k.q[j]);
                let v: Joints = std::array::from_fn(|j| k.v[j]);
                point(&q, curved.then_some(&v), k.time as u64 + lead)
            })
            .collect();
        let waited = now_ns().saturating_sub(id.epoch) as f64 * 1e-9;
        let told = Rejection::new(Reason::None).value(waited, plan.duration() * 1e-9);
        let running = Running { goal: goal.goal_id.id.clone(), plan, start_ns, started: false };
        link.orders.send(Order::Goal(Box::new(goal)))?;
        self.tell(id, EventKind::Accepted, told)?;
        if let Some(old) = self.running.replace(running) {
            self.tell(old.plan.id(), EventKind::Superseded, Rejection::new(Reason::None))?;
        }
        Ok(())
    }

    fn tell(
        &mut self,
        plan: nullsweep_ipc_types::PlanId,
        kind: EventKind,
        why: Rejection,
    ) -> anyhow::Result<()> {
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
    fn show(&mut self, ready: bool, now: u64) -> anyhow::Result<()> {
        self.sample_count += 1;
        let mut sample = <Telemetry as bytemuck::Zeroable>::zeroed();
        sample.sequence = self.sample_count;
        sample.stamp_ns = now;
        sample.joint_count = DOF as u32;
        sample.speed_scale = 1.0;
        sample.mode = if ready { Mode::Hold.wire() } else { Mode::Init.wire() };
        if let Some(state) = &self.state {
            sample.measured = state.positions;
            sample.commanded = state.positions;
        }
        if let Some(r) = self.running.as_ref().filter(|r| now >= r.start_ns) {
            sample.mode = Mode::Executing.wire();
            sample.plan = r.plan.id();
            sample.plan_time_ns = now - r.start_ns;
            let passed = r.plan.knots().partition_point(|k| k.time as u64 <= sample.plan_time_ns);
            sample.knot = passed.saturating_sub(1) as u32;
        }
        self.telemetry.send(&sample)?;
        Ok(())
    }
}
