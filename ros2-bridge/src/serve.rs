//! The other way round: a controller for ROS programs with the executor behind it. Goals of a
//! FollowJointTrajectory action, and trajectories on a topic, become plans; what becomes of the plans
//! are the goals' ends.
//!
//! A goal that comes while another one runs takes its place: the arm is stopped on its path, and goes
//! from there to the first point whose time is not past, as fast as its joints may.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use anyhow::Context;
use nullsweep_bridge::{front, moment};
use nullsweep_executor::Guard;
use nullsweep_ipc_types::ports::{Asked, CommandClient, Ipc, PlanPublisher, Receiver, now_ns};
use nullsweep_ipc_types::{
    CommandKind, EventKind, Interpolation, JoinRule, Mode, PlanEvent, PlanHeader, PlanId, Reason,
    Telemetry, Verdict,
};
use nullsweep_robot::{Arm, JointVector};
use ros2_client::action::GoalId;
use ros2_client::service::RmwRequestId;

use crate::args::{Common, ServeArgs};
use crate::brake::{Answer, Brake};
use crate::door::{Door, Wanted};
use crate::goals::{Goals, Status};
use crate::messages::{FollowResult, JointTrajectory};
use crate::signals;
use crate::wish::{Wish, waypoints};

/// Time between two looks.
const ROUND: Duration = Duration::from_millis(1);
/// An executor that has not said a word for so long is gone. \[ns\]
const SILENT_NS: u64 = 500_000_000;
/// How long an admission is waited for; twice that, that the arm comes to hold.
const PATIENCE: Duration = Duration::from_secs(5);
/// A goal that begins later than this is refused: the clocks disagree. \[ns\]
const FARTHEST_NS: u64 = 60_000_000_000;
/// What begins so little late begins at its own time 0. \[ns\]
const AT_ONCE_NS: u64 = 20_000_000;
/// How long it is waited at the end that the arm has stopped.
const LAST: Duration = Duration::from_secs(3);

/// What the executor has.
struct Running {
    plan: PlanId,
    goal: Option<GoalId>,
    /// Who is to be told whether it was accepted.
    asker: Option<RmwRequestId>,
    since: Instant,
    /// When it was accepted, by the executor's stamp. \[ns\]
    accepted_ns: Option<u64>,
    /// Whether its goal is to be cancelled as soon as there is one.
    cancelled: bool,
}

/// Runs until SIGINT or SIGTERM.
pub fn run(common: &Common, args: &ServeArgs) -> anyhow::Result<()> {
    let done = signals::done()?;
    let arm = args.load()?;
    let rename = args.arm.names(&arm)?;
    let names: Vec<String> = arm.joint_names().iter().map(|name| rename(name)).collect();
    let mut door = Door::open(common, &args.controller, args.publish_joint_states, names)?;
    let mut server = Server::open(args, &arm)?;
    tracing::info!("robot {}: goals on {}", args.robot_name, door.action());
    let mut sound = door.hears();
    while sound.is_ok() && !done.load(Ordering::Relaxed) {
        std::thread::sleep(ROUND);
        sound = server.round(&mut door).and_then(|()| door.hears());
    }
    server.close(&mut door);
    door.leave();
    sound
}

struct Server {
    plans: PlanPublisher,
    events: Receiver<PlanEvent>,
    telemetry: Receiver<Telemetry>,
    commands: CommandClient,
    header: PlanHeader,
    guard: Guard,
    goals: Goals<GoalId, RmwRequestId>,
    wish: Option<Wish>,
    running: Option<Running>,
    /// The last one that was: telemetry may tell it still.
    last: PlanId,
    /// When the last one ended: what was told before says nothing. \[ns\]
    ended_ns: u64,
    newest: Option<Telemetry>,
    /// What is to be stopped.
    brake: Brake<Asked>,
    /// When it was last told that a stop cannot be asked for.
    told: Option<Instant>,
}

impl Server {
    fn open(args: &ServeArgs, arm: &Arm) -> anyhow::Result<Self> {
        let ipc = Ipc::open(&args.robot_name, args.ipc_root.as_deref())?;
        let mut header = PlanHeader {
            fingerprint: arm.fingerprint(),
            joint_count: arm.dof() as u32,
            held_count: arm.held_joints().len() as u32,
            join_rule: JoinRule::StopThenStart.wire(),
            ..PlanHeader::default()
        };
        header.base_pose[6] = 1.0;
        for (slot, held) in header.held_positions.iter_mut().zip(arm.held_joints()) {
            *slot = held.position;
        }
        Ok(Self {
            plans: ipc.plan_publisher(nullsweep_ipc_types::MAX_KNOTS)?,
            events: ipc.event_receiver()?,
            telemetry: ipc.telemetry_receiver()?,
            commands: ipc.command_client().context("the executor takes no more clients")?,
            header,
            guard: Guard::new(arm.limits()),
            goals: Goals::default(),
            wish: None,
            running: None,
            last: PlanId::NONE,
            ended_ns: 0,
            newest: None,
            brake: Brake::default(),
            told: None,
        })
    }

    fn round(&mut self, door: &mut Door) -> anyhow::Result<()> {
        self.hear(door)?;
        for wanted in door.wanted() {
            match wanted {
                Wanted::Goal { asker, id, trajectory } => {
                    if self.goals.knows(id) {
                        door.answer_goal(asker, false);
                    } else {
                        self.wish(Some((asker, id)), &trajectory, door);
                    }
                }
                Wanted::Trajectory(trajectory) => self.wish(None, &trajectory, door),
                Wanted::Cancel { asker, id } => self.cancel(asker, id, door),
                Wanted::Result { asker, id } => match self.goals.ask(id, asker) {
                    Ok(Some((asker, goal))) => {
                        door.answer_result(asker, Some(goal.status), &goal.result)
                    }
                    Ok(None) => {}
                    Err(asker) => door.answer_result(asker, None, &FollowResult::default()),
                },
            }
        }
        self.lose(door);
        // One that is to begin later leaves what runs until then.
        if self.wish.as_ref().is_some_and(Wish::is_due) {
            self.stop();
        }
        self.brake();
        self.begin(door);
        door.tell(&self.goals, self.running.as_ref().and_then(|r| r.goal), self.newest.as_ref());
        Ok(())
    }

    /// Takes in what the executor tells.
    fn hear(&mut self, door: &mut Door) -> anyhow::Result<()> {
        while let Some(telemetry) = self.telemetry.receive()? {
            door.show(&telemetry);
            self.newest = Some(telemetry);
        }
        while let Some(event) = self.events.receive()? {
            self.event(&event, door);
        }
        Ok(())
    }

    /// What the executor did with a plan.
    fn event(&mut self, event: &PlanEvent, door: &mut Door) {
        let Some(kind) = EventKind::from_wire(event.kind) else { return };
        if self.brake.wants(event.plan) {
            self.ended_ns = event.stamp_ns;
            match kind {
                EventKind::Accepted => self.brake.accepted(event.plan, event.stamp_ns),
                EventKind::Started => {}
                _ => self.brake.over(event.plan),
            }
        }
        let Some(running) = self.running.as_mut().filter(|r| r.plan == event.plan) else { return };
        self.ended_ns = event.stamp_ns;
        let reason = Reason::from_wire(event.reason).unwrap_or(Reason::None);
        match kind {
            EventKind::Accepted => {
                running.accepted_ns = Some(event.stamp_ns);
                if let (Some(id), Some(asker)) = (running.goal, running.asker.take()) {
                    self.goals.accept(id, Instant::now());
                    if running.cancelled {
                        self.goals.cancel(id);
                    }
                    door.answer_goal(asker, true);
                }
            }
            EventKind::Started => {}
            EventKind::Rejected => {
                let place = |n: u32| if n == u32::MAX { "-".into() } else { n.to_string() };
                tracing::warn!(
                    "a goal was refused by the executor: {reason}, knot {}, joint {}: {} against {}",
                    place(event.knot),
                    place(event.joint),
                    event.value,
                    event.bound
                );
                if let Some(asker) = running.asker.take() {
                    door.answer_goal(asker, false);
                }
                self.running = None;
            }
            EventKind::Finished => self.end(Status::Succeeded, FollowResult::SUCCESSFUL, "", door),
            EventKind::Superseded | EventKind::Aborted => {
                let code = match reason {
                    Reason::Goal => FollowResult::GOAL_TOLERANCE_VIOLATED,
                    Reason::Fault => FollowResult::PATH_TOLERANCE_VIOLATED,
                    _ => FollowResult::INVALID_GOAL,
                };
                self.end(Status::Aborted, code, reason.text(), door);
            }
        }
    }

    /// The running plan has ended.
    fn end(&mut self, status: Status, code: i32, why: &str, door: &mut Door) {
        let Some(running) = self.running.take() else { return };
        let Some(id) = running.goal else { return };
        if let Some(asker) = running.asker {
            door.answer_goal(asker, false);
            return;
        }
        let result = FollowResult { error_code: code, error_string: why.into() };
        let askers = self.goals.end(id, status, result, Instant::now());
        if let Some(goal) = self.goals.get(id) {
            for asker in askers {
                door.answer_result(asker, Some(goal.status), &goal.result);
            }
        }
    }

    /// Something is to be followed, in place of what is and of what was to be.
    fn wish(
        &mut self,
        goal: Option<(RmwRequestId, GoalId)>,
        trajectory: &JointTrajectory,
        door: &mut Door,
    ) {
        let refuse = |why: &str, door: &mut Door| {
            tracing::warn!("a goal is refused: {why}");
            if let Some((asker, _)) = goal {
                door.answer_goal(asker, false);
            }
        };
        let Some(points) = waypoints(trajectory, door.names()) else {
            return refuse("it has other joints than the arm, or points of another size", door);
        };
        let Some(now) = self.fresh() else {
            return refuse("no executor is there, or it is silent", door);
        };
        let ours = now.plan == self.last || self.brake.wants(now.plan);
        if self.running.is_none() && now.plan.is_some() && !ours {
            return refuse("the executor has a plan of somebody else's", door);
        }
        let stamp = trajectory.header.stamp;
        let stamp_ns = if stamp.sec == 0 && stamp.nanosec == 0 {
            now_ns()
        } else {
            moment(stamp.sec, stamp.nanosec)
        };
        let ahead_ns = stamp_ns.saturating_sub(now_ns());
        if ahead_ns > FARTHEST_NS {
            let why = format!(
                "its stamp is {:.0} s ahead: set both machines' clocks by NTP",
                ahead_ns as f64 * 1e-9
            );
            return refuse(&why, door);
        }
        if let Some((asker, _)) = self.wish.take().and_then(|old| old.goal) {
            door.answer_goal(asker, false);
        }
        let since = Instant::now() + Duration::from_nanos(ahead_ns);
        self.wish = Some(Wish { goal, points, begins_ns: stamp_ns, since });
    }

    /// Has the arm stop on the path of what runs, or is about to.
    fn stop(&mut self) {
        if let Some(running) = &self.running {
            self.brake.want(running.plan, running.accepted_ns, Instant::now());
        }
    }

    /// Asks the executor to stop what is to be stopped.
    fn brake(&mut self) {
        let tells = self.fresh().map(|t| (t.plan, t.stamp_ns));
        let (commands, told) = (&self.commands, &mut self.told);
        let ask = || match commands.ask(CommandKind::Stop, 0.0) {
            Ok(asked) => Some(asked),
            Err(error) => {
                if told.is_none_or(|at| at.elapsed() > PATIENCE) {
                    *told = Some(Instant::now());
                    tracing::error!("the executor cannot be asked to stop, tried again: {error}");
                }
                None
            }
        };
        self.brake.round(tells, Instant::now(), ask, |asked| match asked.answer() {
            Ok(None) => Answer::None,
            Ok(Some(answer)) if answer.verdict == Verdict::Accepted.wire() => Answer::Taken,
            Ok(Some(_)) | Err(_) => Answer::Busy,
        });
    }

    /// Ends one goal, or all: also what is not accepted yet, and what came on the topic.
    fn cancel(&mut self, asker: RmwRequestId, id: Option<GoalId>, door: &mut Door) {
        let meant: Vec<GoalId> = id.map_or_else(|| self.goals.open().collect(), |id| vec![id]);
        let mut canceling = Vec::new();
        let mut ended = false;
        for id in meant {
            match self.goals.cancel(id) {
                Some(status) if status.is_end() => ended = true,
                Some(_) => canceling.push(id),
                None => {}
            }
        }
        let is_meant =
            |goal: Option<GoalId>| id.is_none_or(|id| goal.is_some_and(|goal| goal == id));
        if self.wish.as_ref().is_some_and(|w| is_meant(w.goal.map(|(_, id)| id))) {
            self.refuse_wish("it was cancelled", door);
        }
        if let Some(running) = self.running.as_mut().filter(|r| is_meant(r.goal)) {
            running.cancelled = true;
            self.stop();
        }
        door.answer_cancel(asker, id.is_none(), &canceling, ended);
    }

    /// What cannot come any more.
    fn lose(&mut self, door: &mut Door) {
        if self.fresh().is_none() && self.running.is_some() {
            tracing::error!("the executor is silent: its goal ends, and its plan if it goes on");
            self.stop();
            self.end(Status::Aborted, FollowResult::INVALID_GOAL, "the executor was lost", door);
        }
        let unheard = |r: &Running| r.accepted_ns.is_none() && r.since.elapsed() > PATIENCE;
        if self.running.as_ref().is_some_and(unheard) {
            self.stop();
            self.end(
                Status::Aborted,
                FollowResult::INVALID_GOAL,
                "the executor says nothing",
                door,
            );
        }
        if let Some(wish) = self.wish.take_if(|w| w.since.elapsed() > 2 * PATIENCE) {
            tracing::warn!("a goal is refused: the arm did not come to hold");
            if let Some((asker, _)) = wish.goal {
                door.answer_goal(asker, false);
            }
        }
    }

    /// Publishes what is to be followed, once the arm holds.
    fn begin(&mut self, door: &mut Door) {
        let Some(now) = self.fresh().copied() else { return };
        let known = now.stamp_ns > self.ended_ns && now.plan == PlanId::NONE;
        if !self.wish.as_ref().is_some_and(Wish::is_due) {
            return;
        }
        let open = self.running.is_some() || self.brake.is_open(Instant::now());
        if open || !known || now.mode != Mode::Hold.wire() {
            if self.running.is_none() && now.mode == Mode::Fault.wire() {
                self.refuse_wish("the executor is in a fault", door);
            }
            return;
        }
        let Some(wish) = self.wish.take() else { return };
        let holds =
            JointVector::from_fn(|j| if j < self.guard.dof { now.commanded[j] } else { 0.0 });
        let passed_ns = now_ns().saturating_sub(wish.begins_ns);
        let passed_ns = if passed_ns < AT_ONCE_NS { 0 } else { passed_ns };
        let made = match front(&wish.points, passed_ns, &holds, &self.guard) {
            Ok(made) => made,
            Err(why) => {
                self.wish = Some(wish);
                return self.refuse_wish(&why.to_string(), door);
            }
        };
        let header = PlanHeader {
            interpolation: made.interpolation.wire(),
            // Straight segments are what was asked for, corners and all.
            corners: u32::from(made.interpolation == Interpolation::Linear),
            ..self.header
        };
        match self.plans.publish(&header, &made.knots) {
            Ok(plan) => {
                self.last = plan;
                let (asker, goal) = wish.goal.unzip();
                let since = Instant::now();
                self.running =
                    Some(Running { plan, goal, asker, since, accepted_ns: None, cancelled: false });
            }
            Err(why) => {
                self.wish = Some(wish);
                self.refuse_wish(&why.to_string(), door);
            }
        }
    }

    fn refuse_wish(&mut self, why: &str, door: &mut Door) {
        let Some(wish) = self.wish.take() else { return };
        tracing::warn!("a goal is refused: {why}");
        if let Some((asker, _)) = wish.goal {
            door.answer_goal(asker, false);
        }
    }

    /// The newest telemetry, of an executor that is there.
    fn fresh(&self) -> Option<&Telemetry> {
        self.newest.as_ref().filter(|t| now_ns().saturating_sub(t.stamp_ns) < SILENT_NS)
    }

    /// Ends what runs: nobody would hear of it. Waits until the arm has stopped, for a while.
    fn close(&mut self, door: &mut Door) {
        self.refuse_wish("ros2-bridge ends", door);
        self.stop();
        let began = Instant::now();
        while self.running.is_some() && began.elapsed() < LAST {
            std::thread::sleep(ROUND);
            if self.hear(door).is_err() {
                tracing::error!("the executor cannot be heard, and is asked to stop all the same");
                std::thread::sleep(ROUND * 20);
            }
            self.brake();
        }
        if let Some(running) = &self.running {
            tracing::error!(
                "plan {} may go on, the executor has not said that it stopped: `executor ctl stop`",
                running.plan
            );
        }
        self.end(Status::Aborted, FollowResult::INVALID_GOAL, "ros2-bridge ended", door);
        std::thread::sleep(Duration::from_millis(100));
    }
}
