//! The ROS side: topics, services, and whether the master is there. Everything that blocks or
//! waits is in tasks of its own; the endpoint's loop exchanges values with them through channels.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc as std_mpsc;
use std::time::Duration;

use anyhow::{Context, bail};
use nullsweep_bridge::wall_time;
use nullsweep_ipc_types::ports::now_ns;
use roslibrust::ros1::NodeHandle;
use tokio::sync::mpsc;

use crate::args::Common;

#[allow(missing_docs, clippy::all)] // Generated from msgs/.
pub mod msgs {
    roslibrust::generate_ros_types!("msgs");
}

use msgs::{control_msgs, sensor_msgs, std_msgs, std_srvs, trajectory_msgs};

/// A service of the driver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Service {
    /// Clears errors and turns the motors on.
    Reset,
    /// Turns the motors off.
    Halt,
}

impl Service {
    fn name(self) -> &'static str {
        match self {
            Self::Reset => "reset_motors",
            Self::Halt => "halt_motors",
        }
    }
}

/// What goes to ROS.
#[derive(Clone, Debug)]
pub enum Order {
    /// To the controller's command topic.
    Command(trajectory_msgs::JointTrajectory),
    /// To its action.
    Goal(Box<control_msgs::FollowJointTrajectoryActionGoal>),
    /// To a service of the driver.
    Call(Service),
}

/// What comes from ROS, with the moment of its arrival. \[ns, `CLOCK_MONOTONIC`\]
#[derive(Debug)]
pub enum News {
    /// All joints.
    Joints(sensor_msgs::JointState, u64),
    /// The end of a goal.
    Result(Box<control_msgs::FollowJointTrajectoryActionResult>),
}

/// What the tasks know, for the loop to look at.
#[derive(Debug, Default)]
pub struct Known {
    /// When the master was last reached. \[ns\]
    pub master_ns: AtomicU64,
    /// Whether the controller listens.
    pub controller: AtomicBool,
    /// Whether the motors are halted, and when that was last said.
    pub halted: AtomicBool,
    /// \[ns\]
    pub halted_ns: AtomicU64,
    /// Whether the joints are calibrated.
    pub calibrated: AtomicBool,
    /// Messages that came too fast for this process.
    pub lost: AtomicU64,
}

/// The loop's end of the channels.
pub struct Link {
    /// To ROS.
    pub orders: mpsc::UnboundedSender<Order>,
    /// From ROS.
    pub news: std_mpsc::Receiver<News>,
    /// What the tasks know.
    pub known: Arc<Known>,
    // Runs the tasks.
    _runtime: tokio::runtime::Runtime,
}

/// Names on the ROS side.
#[derive(Clone, Debug)]
pub struct Names {
    /// The controller's namespace.
    pub controller: String,
    /// Where calibration is told; `None`: it is taken for granted.
    pub calibrated: Option<String>,
    /// Whether the controller takes goals, not commands.
    pub goals: bool,
}

/// This node's name.
const NODE: &str = "/nullsweep_bridge";
/// How often the master is asked, and how long for.
const LOOK: Duration = Duration::from_millis(500);

impl Link {
    /// Connects to the master and starts the tasks.
    pub fn open(common: &Common, names: &Names) -> anyhow::Result<Self> {
        let runtime = runtime()?;
        let (orders, order_queue) = mpsc::unbounded_channel();
        let (news_sender, news) = std_mpsc::channel();
        let known = Arc::new(Known::default());
        known.halted.store(true, Ordering::Relaxed);
        known.calibrated.store(names.calibrated.is_none(), Ordering::Relaxed);
        runtime.block_on(start(common, names, order_queue, news_sender, Arc::clone(&known)))?;
        Ok(Self { orders, news, known, _runtime: runtime })
    }
}

/// Calls a service once.
pub fn call(common: &Common, service: Service) -> anyhow::Result<()> {
    runtime()?.block_on(async {
        let node = connect(&common.master).await?;
        let name = format!("{}/{}", common.driver, service.name());
        let client = node
            .service_client::<std_srvs::Empty>(&name)
            .await
            .with_context(|| format!("no service {name}"))?;
        client.call(&std_srvs::EmptyRequest {}).await.with_context(|| format!("{name} failed"))?;
        println!("{name}: done");
        Ok(())
    })
}

/// ROS time of a moment on `CLOCK_MONOTONIC`.
pub fn ros_time(at_ns: u64) -> roslibrust::codegen::integral_types::Time {
    let (secs, nsecs) = wall_time(at_ns);
    roslibrust::codegen::integral_types::Time { secs, nsecs: nsecs as i32 }
}

fn runtime() -> anyhow::Result<tokio::runtime::Runtime> {
    Ok(tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?)
}

async fn connect(master: &str) -> anyhow::Result<NodeHandle> {
    let limit = Duration::from_secs(5);
    match tokio::time::timeout(limit, NodeHandle::new(master, NODE)).await {
        Ok(Ok(node)) => Ok(node),
        Ok(Err(error)) => Err(error)
            .with_context(|| format!("no ROS master at {master}: start roscore, or set --master")),
        Err(_) => bail!("the ROS master at {master} did not answer within {limit:?}"),
    }
}

async fn start(
    common: &Common,
    names: &Names,
    orders: mpsc::UnboundedReceiver<Order>,
    news: std_mpsc::Sender<News>,
    known: Arc<Known>,
) -> anyhow::Result<()> {
    let node = connect(&common.master).await?;
    known.master_ns.store(now_ns(), Ordering::Relaxed);
    hear_robot(&node, names, news, &known).await?;
    hear_flags(&node, common, names, &known).await?;
    take_orders(&node, common, names, orders).await?;
    watch_master(common, names, known)
}

/// Passes on joint states and the ends of goals.
async fn hear_robot(
    node: &NodeHandle,
    names: &Names,
    news: std_mpsc::Sender<News>,
    known: &Arc<Known>,
) -> anyhow::Result<()> {
    let mut joints = node.subscribe::<sensor_msgs::JointState>("/joint_states", 20).await?;
    let (sender, lost) = (news.clone(), Arc::clone(known));
    tokio::spawn(async move {
        while let Some(message) = joints.next().await {
            match message {
                Ok(state) => drop(sender.send(News::Joints(state, now_ns()))),
                Err(_) => drop(lost.lost.fetch_add(1, Ordering::Relaxed)),
            }
        }
    });
    let topic = format!("{}/follow_joint_trajectory/result", names.controller);
    let mut results =
        node.subscribe::<control_msgs::FollowJointTrajectoryActionResult>(&topic, 10).await?;
    tokio::spawn(async move {
        while let Some(message) = results.next().await {
            if let Ok(result) = message {
                drop(news.send(News::Result(Box::new(result))));
            }
        }
    });
    Ok(())
}

/// Keeps what is told of motors and calibration.
async fn hear_flags(
    node: &NodeHandle,
    common: &Common,
    names: &Names,
    known: &Arc<Known>,
) -> anyhow::Result<()> {
    let topic = format!("{}/motors_halted", common.driver);
    let mut halted = node.subscribe::<std_msgs::Bool>(&topic, 5).await?;
    let own = Arc::clone(known);
    tokio::spawn(async move {
        while let Some(message) = halted.next().await {
            if let Ok(flag) = message {
                own.halted.store(flag.data, Ordering::Relaxed);
                own.halted_ns.store(now_ns(), Ordering::Relaxed);
            }
        }
    });
    if let Some(topic) = &names.calibrated {
        let mut calibrated = node.subscribe::<std_msgs::Bool>(topic, 5).await?;
        let own = Arc::clone(known);
        tokio::spawn(async move {
            while let Some(message) = calibrated.next().await {
                if let Ok(flag) = message {
                    own.calibrated.store(flag.data, Ordering::Relaxed);
                }
            }
        });
    }
    Ok(())
}

/// Sends messages and calls services as they are ordered.
async fn take_orders(
    node: &NodeHandle,
    common: &Common,
    names: &Names,
    mut orders: mpsc::UnboundedReceiver<Order>,
) -> anyhow::Result<()> {
    let topic = format!("{}/command", names.controller);
    let command = node.advertise::<trajectory_msgs::JointTrajectory>(&topic, 20, false).await?;
    let topic = format!("{}/follow_joint_trajectory/goal", names.controller);
    let goal =
        node.advertise::<control_msgs::FollowJointTrajectoryActionGoal>(&topic, 5, false).await?;
    let (node, driver) = (node.clone(), common.driver.clone());
    tokio::spawn(async move {
        while let Some(order) = orders.recv().await {
            let failed = match order {
                Order::Command(message) => command.publish(&message).await.err(),
                Order::Goal(message) => goal.publish(&message).await.err(),
                Order::Call(service) => {
                    let (node, name) = (node.clone(), format!("{driver}/{}", service.name()));
                    tokio::spawn(async move {
                        let called = async {
                            let client = node.service_client::<std_srvs::Empty>(&name).await?;
                            client.call(&std_srvs::EmptyRequest {}).await?;
                            anyhow::Ok(())
                        };
                        match called.await {
                            Ok(()) => tracing::info!("{name}: called"),
                            Err(error) => tracing::error!("{name}: {error:#}"),
                        }
                    });
                    None
                }
            };
            if let Some(error) = failed {
                tracing::error!("a message could not be sent: {error}");
            }
        }
    });
    Ok(())
}

/// Asks the master again and again whether the controller listens.
fn watch_master(common: &Common, names: &Names, known: Arc<Known>) -> anyhow::Result<()> {
    let end = if names.goals { "follow_joint_trajectory/goal" } else { "command" };
    let topic = format!("{}/{end}", names.controller);
    let master = common.master.clone();
    let client = reqwest::Client::builder().no_proxy().timeout(LOOK).build()?;
    tokio::spawn(async move {
        loop {
            match has_subscriber(&client, &master, &topic).await {
                Ok(listens) => {
                    known.controller.store(listens, Ordering::Relaxed);
                    known.master_ns.store(now_ns(), Ordering::Relaxed);
                }
                Err(error) => tracing::debug!("the master does not answer: {error}"),
            }
            tokio::time::sleep(LOOK).await;
        }
    });
    Ok(())
}

/// Whether the master knows a subscriber of a topic. The publisher cannot say: it counts its own
/// accepting task as one.
async fn has_subscriber(
    client: &reqwest::Client,
    master: &str,
    topic: &str,
) -> anyhow::Result<bool> {
    // Publishers, subscribers and services, each as topic and nodes.
    type State = (i32, String, Vec<Vec<(String, Vec<String>)>>);
    let body = serde_xmlrpc::request_to_string("getSystemState", vec![NODE.into()])?;
    let answer = client.post(master).body(body).send().await?.text().await?;
    let (_, _, state): State = serde_xmlrpc::response_from_str(&answer)?;
    let subscribed = state.get(1).context("no subscribers in the master's answer")?;
    Ok(subscribed.iter().any(|(name, nodes)| name == topic && !nodes.is_empty()))
}
