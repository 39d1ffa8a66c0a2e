//! The ROS side of a controller: its action, its topic, and what it tells. Nothing here waits for
//! anybody.

use std::time::{Duration as Span, Instant};

use anyhow::ensure;
use nullsweep_ipc_types::Telemetry;
use nullsweep_ipc_types::ports::now_ns;
use ros2_client::action::{
    ActionServer, ActionServerQosPolicies, GetResultResponse, GoalId, GoalStatusEnum,
    SendGoalResponse,
};
use ros2_client::action_msgs::{GoalInfo as StatusInfo, GoalStatus, GoalStatusArray};
use ros2_client::builtin_interfaces::Time as RosTime;
use ros2_client::qos::Durability;
use ros2_client::service::{RmwRequestId, Server};
use ros2_client::{
    ActionTypeName, Name, Node, Publisher, ServiceMapping, ServiceTypeName, Subscription,
};

use crate::args::Common;
use crate::domain::{absolute, join, reliable, spin, topic};
use crate::goals::{Goals, Status};
use crate::messages::{
    CancelRequest, CancelResponse, FollowFeedback, FollowGoal, FollowResult, GoalInfo, Header,
    JointState, JointTrajectory, JointTrajectoryPoint,
};
use crate::threads::Threads;
use crate::trajectory::ros_time;

/// Time between two words about how a goal goes.
const TELL: Span = Span::from_millis(50);
/// Time between two joint states.
const SHOW_NS: u64 = 10_000_000;

/// What somebody wants.
#[derive(Debug)]
pub enum Wanted {
    /// A goal.
    Goal { asker: RmwRequestId, id: GoalId, trajectory: JointTrajectory },
    /// A trajectory on the topic.
    Trajectory(JointTrajectory),
    /// No more of one goal, or of all.
    Cancel { asker: RmwRequestId, id: Option<GoalId> },
    /// A goal's end.
    Result { asker: RmwRequestId, id: GoalId },
}

/// The door.
pub struct Door {
    _node: Node,
    action: String,
    names: Vec<String>,
    goals: ActionServer<FollowGoal, FollowResult, FollowFeedback>,
    cancels: Server<CancelRequest, CancelResponse>,
    trajectories: Subscription<JointTrajectory>,
    states: Option<Publisher<JointState>>,
    shown_ns: u64,
    told: Instant,
    /// What was last told of all goals.
    statuses: Vec<(GoalId, Status)>,
    /// The library's, which are to live as long as this.
    threads: Threads,
}

impl Door {
    /// Opens it in a domain.
    pub fn open(
        common: &Common,
        controller: &str,
        with_states: bool,
        names: Vec<String>,
    ) -> anyhow::Result<Self> {
        let (threads, door) = Threads::of(|| Self::build(common, controller, with_states, names));
        Ok(Self { threads, ..door? })
    }

    /// Whether anything can be heard and said.
    ///
    /// # Errors
    /// The library's threads have ended.
    pub fn hears(&mut self) -> anyhow::Result<()> {
        ensure!(
            !self.threads.has_ended(),
            "the DDS library's threads have ended, as they do in a process that was stopped and goes \
             on: nobody can be heard any more, the arm is stopped; start it again"
        );
        Ok(())
    }

    /// Leaves the domain; not where that would wait for threads that have ended.
    pub fn leave(mut self) {
        if self.threads.has_ended() {
            std::mem::forget(self);
        }
    }

    fn build(
        common: &Common,
        controller: &str,
        with_states: bool,
        names: Vec<String>,
    ) -> anyhow::Result<Self> {
        let mut node = join(common, "nullsweep_controller")?;
        let controller = absolute(controller);
        let action = format!("{controller}/follow_joint_trajectory");
        let latched = reliable(1).durability(Durability::TransientLocal);
        let goals = node.create_action_server(
            ServiceMapping::Enhanced,
            &Name::parse(&action)?,
            &ActionTypeName::new("control_msgs", "FollowJointTrajectory"),
            ActionServerQosPolicies {
                goal_service: reliable(20),
                result_service: reliable(20),
                // Its requests cannot be read: another one below answers them.
                cancel_service: reliable(1),
                feedback_publisher: reliable(10),
                status_publisher: latched,
            },
        )?;
        let cancels = node.create_server(
            ServiceMapping::Enhanced,
            &Name::parse(&format!("{action}/_action/cancel_goal"))?,
            &ServiceTypeName::new("action_msgs", "CancelGoal"),
            reliable(20),
            reliable(20),
        )?;
        let kind = ("trajectory_msgs", "JointTrajectory");
        let own = topic(&node, &format!("{controller}/joint_trajectory"), kind)?;
        let trajectories = node.create_subscription(&own, Some(reliable(10)))?;
        let states = if with_states {
            let own = topic(&node, "/joint_states", ("sensor_msgs", "JointState"))?;
            Some(node.create_publisher(&own, Some(reliable(10)))?)
        } else {
            None
        };
        spin(&mut node)?;
        let told = Instant::now();
        Ok(Self {
            _node: node,
            action,
            names,
            goals,
            cancels,
            trajectories,
            states,
            shown_ns: 0,
            told,
            statuses: Vec::new(),
            threads: Threads::default(),
        })
    }

    /// The action's name.
    pub fn action(&self) -> &str {
        &self.action
    }

    /// The arm's joints as ROS calls them.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// What came since it was last asked for.
    pub fn wanted(&self) -> Vec<Wanted> {
        let mut all = Vec::new();
        while let Ok(Some((asker, request))) = self.goals.receive_goal() {
            let (id, goal) = (request.goal_id, request.goal);
            all.push(Wanted::Goal { asker, id, trajectory: goal.trajectory });
        }
        while let Ok(Some((trajectory, _))) = self.trajectories.take() {
            all.push(Wanted::Trajectory(trajectory));
        }
        while let Ok(Some((asker, request))) = self.cancels.receive_request() {
            let id = request.goal_info.goal_id;
            all.push(Wanted::Cancel { asker, id: (id != GoalId::ZERO).then_some(id) });
        }
        while let Ok(Some((asker, request))) = self.goals.receive_result_request() {
            all.push(Wanted::Result { asker, id: request.goal_id });
        }
        all
    }

    /// Tells whether a goal is taken.
    pub fn answer_goal(&self, asker: RmwRequestId, accepted: bool) {
        let answer = SendGoalResponse { accepted, stamp: RosTime::now() };
        log(self.goals.send_goal_response(asker, answer).is_ok(), "a goal's answer");
    }

    /// Tells which goals are being cancelled; `all`: none was named, `ended`: the one that was has
    /// ended before.
    pub fn answer_cancel(&self, asker: RmwRequestId, all: bool, canceling: &[GoalId], ended: bool) {
        let return_code = match (canceling, ended) {
            _ if all => CancelResponse::NONE,
            ([], true) => CancelResponse::GOAL_TERMINATED,
            ([], false) => CancelResponse::UNKNOWN_GOAL,
            _ => CancelResponse::NONE,
        };
        let stamp = ros_time(now_ns());
        let goals_canceling =
            canceling.iter().map(|&goal_id| GoalInfo { goal_id, stamp }).collect();
        let answer = CancelResponse { return_code, goals_canceling };
        log(self.cancels.send_response(asker, answer).is_ok(), "a cancel's answer");
    }

    /// Tells a goal's end; `None` for one that is not known.
    pub fn answer_result(
        &self,
        asker: RmwRequestId,
        status: Option<Status>,
        result: &FollowResult,
    ) {
        let status = status.map_or(GoalStatusEnum::Unknown, wire);
        let answer = GetResultResponse { status, result: result.clone() };
        log(self.goals.send_result(asker, answer).is_ok(), "a goal's end");
    }

    /// Tells all goals' statuses when they change, and how the one that runs goes.
    pub fn tell(
        &mut self,
        goals: &Goals<GoalId, RmwRequestId>,
        running: Option<GoalId>,
        telemetry: Option<&Telemetry>,
    ) {
        let statuses: Vec<(GoalId, Status)> = goals.iter().map(|g| (g.id, g.status)).collect();
        if statuses != self.statuses {
            let status_list = statuses
                .iter()
                .map(|&(goal_id, status)| GoalStatus {
                    goal_info: StatusInfo { goal_id, stamp: RosTime::now() },
                    status: wire(status),
                })
                .collect();
            let told = self.goals.send_goal_statuses(GoalStatusArray { status_list });
            log(told.is_ok(), "the goals' statuses");
            self.statuses = statuses;
        }
        let (Some(id), Some(t)) = (running, telemetry) else { return };
        if self.told.elapsed() < TELL || !goals.knows(id) {
            return;
        }
        self.told = Instant::now();
        let joints = self.names.len();
        let point = |at: &dyn Fn(usize) -> f64| JointTrajectoryPoint {
            positions: (0..joints).map(at).collect(),
            ..JointTrajectoryPoint::default()
        };
        let feedback = FollowFeedback {
            header: Header { stamp: ros_time(t.stamp_ns), frame_id: String::new() },
            joint_names: self.names.clone(),
            desired: point(&|j| t.commanded[j]),
            actual: point(&|j| t.measured[j]),
            error: point(&|j| t.commanded[j] - t.measured[j]),
            ..FollowFeedback::default()
        };
        let _ = self.goals.send_feedback(id, feedback);
    }

    /// Tells where the arm is measured, where that is wanted.
    pub fn show(&mut self, t: &Telemetry) {
        let Some(states) = &self.states else { return };
        if t.stamp_ns < self.shown_ns + SHOW_NS {
            return;
        }
        self.shown_ns = t.stamp_ns;
        let _ = states.publish(JointState {
            header: Header { stamp: ros_time(t.stamp_ns), frame_id: String::new() },
            name: self.names.clone(),
            position: t.measured[..self.names.len()].to_vec(),
            ..JointState::default()
        });
    }
}

fn wire(status: Status) -> GoalStatusEnum {
    match status {
        Status::Executing => GoalStatusEnum::Executing,
        Status::Canceling => GoalStatusEnum::Canceling,
        Status::Succeeded => GoalStatusEnum::Succeeded,
        Status::Canceled => GoalStatusEnum::Canceled,
        Status::Aborted => GoalStatusEnum::Aborted,
    }
}

fn log(done: bool, what: &str) {
    if !done {
        tracing::error!("{what} could not be sent");
    }
}
