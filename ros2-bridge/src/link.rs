//! The ROS side: topics and services. Nothing here waits for anybody: the endpoint's loop takes what
//! has come, and a message for which there is no room is lost and counted.

use std::time::{Duration, Instant};

use nullsweep_bridge::Goal;
use nullsweep_ipc_types::ports::now_ns;
use ros2_client::qos::Durability;
use ros2_client::service::Client;
use ros2_client::{Name, Node, Publisher, ServiceMapping, ServiceTypeName, Subscription};

use crate::args::{Common, Interface, RunArgs};
use crate::domain::{absolute, join, newest, reliable, spin, topic};
use crate::follower::{Ended, Follower};
use crate::manager::Manager;
use crate::messages::{
    Bool, ControllerState, Float64MultiArray, JointState, JointTrajectory, SetBoolRequest,
    SetBoolResponse,
};
use crate::threads::Threads;

/// How often it is asked who listens.
const LOOK: Duration = Duration::from_millis(100);
/// An active controller tells its state some 20 to 50 times a second. \[ns\]
const ACTIVE_NS: u64 = 500_000_000;

/// To the controller.
enum Command {
    Trajectory(Publisher<JointTrajectory>),
    Positions(Publisher<Float64MultiArray>),
    Goals(Box<Follower>),
}

/// What is known of the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Known {
    /// Whether somebody takes what is sent to the controller.
    pub listens: bool,
    /// Whether the controller says that it works; `None`: it is not asked.
    pub active: Option<bool>,
    /// Whether the motors are on; `None`: nobody has said so yet. True where the robot has no topic
    /// for it.
    pub running: Option<bool>,
    /// Whether anybody sends joint states.
    pub speaks: bool,
}

/// The loop's end of everything.
pub struct Link {
    node: Node,
    command: Command,
    joints: Subscription<JointState>,
    running: Option<Subscription<Bool>>,
    state: Option<Subscription<ControllerState>>,
    power: Option<Client<SetBoolRequest, SetBoolResponse>>,
    manager: Manager,
    /// What the motors were last asked to be.
    wanted: Option<bool>,
    known: Known,
    looked: Instant,
    /// When the controller last told its state. \[ns\]
    active_ns: u64,
    /// The library's, which are to live as long as this.
    threads: Threads,
    /// Messages that could not be sent.
    pub lost: u64,
}

impl Link {
    /// Joins the domain.
    pub fn open(common: &Common, args: &RunArgs) -> anyhow::Result<Self> {
        let (threads, link) = Threads::of(|| Self::join(common, args));
        Ok(Self { threads, ..link? })
    }

    /// Whether nothing can be heard and said any more: the library's threads have ended.
    pub fn is_deaf(&mut self) -> bool {
        self.threads.has_ended()
    }

    /// Joins the domain anew in place of one that is deaf: as somebody else, who knows nobody yet.
    pub fn again(&mut self, common: &Common, args: &RunArgs) -> anyhow::Result<()> {
        let new = Self { wanted: self.wanted, lost: self.lost, ..Self::open(common, args)? };
        let old = std::mem::replace(self, new);
        // It may wait for those that have ended.
        std::thread::Builder::new().name("ros-old".into()).spawn(move || drop(old))?;
        Ok(())
    }

    fn join(common: &Common, args: &RunArgs) -> anyhow::Result<Self> {
        let mut node = join(common, "nullsweep_bridge")?;
        let controller = absolute(&args.controller);
        let command = match args.interface {
            Interface::Trajectory if args.whole_plan => {
                Command::Goals(Box::new(Follower::open(&mut node, &controller)?))
            }
            Interface::Trajectory => {
                let kind = ("trajectory_msgs", "JointTrajectory");
                let topic = topic(&node, &format!("{controller}/joint_trajectory"), kind)?;
                Command::Trajectory(node.create_publisher(&topic, Some(reliable(10)))?)
            }
            Interface::Position => {
                let kind = ("std_msgs", "Float64MultiArray");
                let topic = topic(&node, &format!("{controller}/commands"), kind)?;
                Command::Positions(node.create_publisher(&topic, Some(reliable(1)))?)
            }
        };
        let states = topic(&node, &absolute(&args.joint_states), ("sensor_msgs", "JointState"))?;
        let joints = node.create_subscription(&states, Some(newest(20)))?;
        let running = match &args.running {
            Some(name) => {
                let topic = topic(&node, &absolute(name), ("std_msgs", "Bool"))?;
                // Told when it changes: who comes later hears the last word.
                let latched = reliable(1).durability(Durability::TransientLocal);
                Some(node.create_subscription(&topic, Some(latched))?)
            }
            None => None,
        };
        let state = if args.no_controller_state || args.interface == Interface::Position {
            None
        } else {
            let kind = ("control_msgs", "JointTrajectoryControllerState");
            let topic = topic(&node, &format!("{controller}/controller_state"), kind)?;
            Some(node.create_subscription(&topic, Some(newest(5)))?)
        };
        let power = match &args.power {
            Some(name) => Some(node.create_client(
                ServiceMapping::Enhanced,
                &Name::parse(&absolute(name))?,
                &ServiceTypeName::new("std_srvs", "SetBool"),
                reliable(10),
                reliable(10),
            )?),
            None => None,
        };
        let manager = Manager::open(&mut node, &args.controller_manager, &controller)?;
        spin(&mut node)?;
        let known = Known {
            listens: false,
            active: state.is_some().then_some(false),
            running: running.is_none().then_some(true),
            speaks: false,
        };
        let looked = Instant::now();
        Ok(Self {
            node,
            command,
            joints,
            running,
            state,
            power,
            manager,
            wanted: None,
            known,
            looked,
            active_ns: 0,
            threads: Threads::default(),
            lost: 0,
        })
    }

    /// Takes in what has come; the joint states among it, each with the moment of its arrival.
    /// \[ns, `CLOCK_MONOTONIC`\]
    pub fn hear(&mut self) -> Vec<(JointState, u64)> {
        let mut states = Vec::new();
        while let Ok(Some((state, _))) = self.joints.take() {
            states.push((state, now_ns()));
        }
        if let Some(topic) = &self.running {
            while let Ok(Some((flag, _))) = topic.take() {
                self.known.running = Some(flag.data);
            }
        }
        if let Some(topic) = &self.state {
            while let Ok(Some(_)) = topic.take() {
                self.active_ns = now_ns();
            }
            self.known.active = Some(now_ns().saturating_sub(self.active_ns) <= ACTIVE_NS);
        }
        if let Some(client) = &self.power {
            while let Ok(Some((_, answer))) = client.receive_response() {
                if answer.success {
                    tracing::info!("the robot's power service: done {}", answer.message);
                    // Where no topic tells it, that is what is known.
                    if self.running.is_none() && self.wanted == Some(false) {
                        self.known.running = Some(false);
                    }
                } else {
                    tracing::error!("the robot's power service refused: {}", answer.message);
                }
            }
        }
        if self.looked.elapsed() >= LOOK {
            self.looked = Instant::now();
            self.known.listens = match &self.command {
                Command::Trajectory(topic) => topic.get_subscription_count(&self.node) > 0,
                Command::Positions(topic) => topic.get_subscription_count(&self.node) > 0,
                Command::Goals(follower) => follower.is_there(&self.node),
            };
            self.known.speaks = self.joints.get_publisher_count(&self.node) > 0;
            if self.known.listens && self.known.active != Some(false) {
                self.manager.forget();
            } else {
                self.manager.ask();
            }
        }
        states
    }

    /// What the controller_manager says, while no controller listens or the one that is meant is not
    /// active; `None` where it has not answered.
    pub fn said(&self) -> Option<String> {
        self.manager.said()
    }

    /// What is known of the robot.
    pub fn known(&self) -> Known {
        self.known
    }

    /// Sends a trajectory.
    pub fn follow(&mut self, trajectory: JointTrajectory) {
        if let Command::Trajectory(topic) = &self.command {
            self.lost += u64::from(topic.publish(trajectory).is_err());
        }
    }

    /// Sends a whole plan.
    pub fn send(&mut self, goal: &Goal, names: &[String]) {
        if let Command::Goals(follower) = &mut self.command {
            follower.send(goal, names);
        }
    }

    /// Has the controller hold, where it has whole plans.
    pub fn hold(&self) {
        if let Command::Goals(follower) = &self.command {
            follower.cancel();
        }
    }

    /// The ends of whole plans that came.
    pub fn ends(&mut self) -> Vec<Ended> {
        match &mut self.command {
            Command::Goals(follower) => follower.hear(),
            _ => Vec::new(),
        }
    }

    /// How far the controller said that the arm was from a whole plan's path, at most. \[rad\]
    pub fn farthest(&self) -> f64 {
        match &self.command {
            Command::Goals(follower) => follower.farthest(),
            _ => 0.0,
        }
    }

    /// Sends positions.
    pub fn place(&mut self, positions: Float64MultiArray) {
        if let Command::Positions(topic) = &self.command {
            self.lost += u64::from(topic.publish(positions).is_err());
        }
    }

    /// Asks for the motors on or off. Whether that was done is logged.
    pub fn power(&mut self, on: bool) {
        let word = if on { "on" } else { "off" };
        let again = self.wanted.replace(on) == Some(on);
        if on && self.running.is_none() {
            self.known.running = Some(true);
        }
        if again && self.power.is_some() {
            tracing::error!("the motors are not {word} yet: the power service is asked again");
        }
        match &self.power {
            None if again => {}
            None => tracing::warn!(
                "the executor wants the motors {word}, but no service does that here (--power): the \
                 arm holds, its controller's motors as they are"
            ),
            Some(client) => {
                if let Err(error) = client.send_request(SetBoolRequest { data: on }) {
                    tracing::error!("the robot's power service cannot be asked: {error:?}");
                }
            }
        }
    }
}
