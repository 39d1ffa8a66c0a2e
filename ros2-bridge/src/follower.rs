//! The controller's action FollowJointTrajectory: goals to it, their ends from it.

use std::time::{Duration, Instant};

use nullsweep_bridge::Goal;
use nullsweep_ipc_types::ports::now_ns;
use ros2_client::action::{ActionClient, ActionClientQosPolicies, GoalId, GoalStatusEnum};
use ros2_client::qos::Durability;
use ros2_client::service::RmwRequestId;
use ros2_client::{ActionTypeName, Name, Node, ServiceMapping};

use crate::domain::{newest, reliable};
use crate::messages::{FollowFeedback, FollowGoal, FollowResult};
use crate::trajectory::whole;

/// How long it is waited for whether a goal is taken before it is sent again.
const ANSWER_WITHIN: Duration = Duration::from_millis(400);

/// A goal that was sent.
struct Sent {
    name: String,
    goal: FollowGoal,
    /// When it is too late to send it again. \[ns\]
    until_ns: u64,
    id: GoalId,
    asked: RmwRequestId,
    /// Who waits for its end, once it was taken.
    result: Option<RmwRequestId>,
    since: Instant,
}

/// A goal's end: its name, and why it is not as planned.
pub type Ended = (String, Option<String>);

/// This program's side of the action.
pub struct Follower {
    client: ActionClient<FollowGoal, FollowResult, FollowFeedback>,
    sent: Vec<Sent>,
    /// How far the arm was from where it was to be, at most. \[rad\]
    farthest: f64,
}

impl Follower {
    /// The action of that controller.
    pub fn open(node: &mut Node, controller: &str) -> anyhow::Result<Self> {
        let latched = newest(1).durability(Durability::TransientLocal);
        let client = node.create_action_client(
            ServiceMapping::Enhanced,
            &Name::parse(&format!("{controller}/follow_joint_trajectory"))?,
            &ActionTypeName::new("control_msgs", "FollowJointTrajectory"),
            ActionClientQosPolicies {
                goal_service: reliable(10),
                result_service: reliable(10),
                cancel_service: reliable(10),
                feedback_subscription: newest(10),
                status_subscription: latched,
            },
        )?;
        Ok(Self { client, sent: Vec::new(), farthest: 0.0 })
    }

    /// Whether a controller has the action.
    pub fn is_there(&self, node: &Node) -> bool {
        self.client.status_subscription().get_publisher_count(node) > 0
    }

    /// Sends a goal; its end comes from [`Self::hear`].
    pub fn send(&mut self, goal: &Goal, names: &[String]) {
        let trajectory = whole(goal, names);
        tracing::info!(
            "{} of {} points, sent as {}",
            goal.id,
            goal.points.len(),
            trajectory.points.len()
        );
        let message = FollowGoal { trajectory, ..FollowGoal::default() };
        self.ask(goal.id.clone(), message, goal.until_ns);
    }

    fn ask(&mut self, name: String, goal: FollowGoal, until_ns: u64) {
        match self.client.send_goal(goal.clone()) {
            Ok((asked, id)) => {
                let since = Instant::now();
                self.sent.push(Sent { name, goal, until_ns, id, asked, result: None, since });
            }
            Err(error) => tracing::error!("a goal could not be sent: {error:?}"),
        }
    }

    /// Sends goals again that nobody has answered: the same motion at the same time, so that one which
    /// did come makes no difference. Where it is too late the arm is to hold.
    fn again(&mut self, ended: &mut Vec<Ended>) {
        let late = |sent: &mut Sent| sent.result.is_none() && sent.since.elapsed() > ANSWER_WITHIN;
        let unanswered: Vec<Sent> = self.sent.extract_if(.., late).collect();
        for sent in unanswered {
            if now_ns() < sent.until_ns {
                tracing::warn!("{}: no answer yet, sent again", sent.name);
                self.ask(sent.name, sent.goal, sent.until_ns);
                continue;
            }
            self.cancel();
            let why = "the controller did not say whether it takes the goal".to_string();
            ended.push((sent.name, Some(why)));
        }
    }

    /// Has the controller hold: all goals are cancelled.
    pub fn cancel(&self) {
        if let Err(error) = self.client.cancel_all_goals() {
            tracing::error!("the goals cannot be cancelled: {error:?}");
        }
    }

    /// Takes in what has come; each end once.
    pub fn hear(&mut self) -> Vec<Ended> {
        let mut ended = Vec::new();
        while let Ok(Some((request, answer))) = self.client.goal_client().receive_response() {
            let Some(at) = self.sent.iter().position(|sent| sent.asked == request) else {
                continue;
            };
            if !answer.accepted {
                let why = "the controller refused the goal".to_string();
                ended.push((self.sent.swap_remove(at).name, Some(why)));
                continue;
            }
            match self.client.request_result(self.sent[at].id) {
                Ok(result) => self.sent[at].result = Some(result),
                Err(error) => tracing::error!("a goal's end cannot be asked for: {error:?}"),
            }
        }
        while let Ok(Some((request, answer))) = self.client.result_client().receive_response() {
            let Some(at) = self.sent.iter().position(|sent| sent.result == Some(request)) else {
                continue;
            };
            let FollowResult { error_code, error_string } = answer.result;
            let failed = (answer.status != GoalStatusEnum::Succeeded)
                .then(|| format!("{:?}, error {error_code} {error_string}", answer.status));
            ended.push((self.sent.swap_remove(at).name, failed));
        }
        while let Ok(Some((message, _))) = self.client.feedback_subscription().take() {
            let errors = message.feedback.error.positions.iter().map(|e| e.abs());
            self.farthest = errors.fold(self.farthest, f64::max);
        }
        self.again(&mut ended);
        ended
    }

    /// How far the controller said that the arm was from where it was to be, at most. \[rad\]
    pub fn farthest(&self) -> f64 {
        self.farthest
    }
}
