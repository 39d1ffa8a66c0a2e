//! The command line's parts that the endpoint reads.

use std::collections::BTreeMap;
use std::net::IpAddr;
use std::path::PathBuf;

use anyhow::bail;
use nullsweep_bridge::{Takeover, Timing};
use nullsweep_ipc_types::service::DEFAULT_ROBOT;
use nullsweep_robot::{Arm, ArmSpec, Robot, Side};

/// How ROS 2 is reached.
#[derive(Clone, Debug, clap::Args)]
pub struct Common {
    /// DDS domain
    #[arg(long, env = "ROS_DOMAIN_ID", default_value_t = 0, global = true,
          value_parser = clap::value_parser!(u16).range(0..=232))]
    pub domain: u16,
    /// Address of a network interface to speak on, may be repeated; without it all of them, or
    /// 127.0.0.1 alone where ROS_AUTOMATIC_DISCOVERY_RANGE is LOCALHOST
    #[arg(long, value_name = "ADDRESS", global = true)]
    pub network: Vec<IpAddr>,
}

/// What the controller takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Interface {
    /// Trajectories on its topic joint_trajectory: a joint_trajectory_controller.
    Trajectory,
    /// Positions on its topic commands: a forward_position_controller. The arm stops at once, not
    /// in a ramp, when this program dies.
    Position,
}

/// When the controller leaves a trajectory for the next one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Splice {
    /// When it comes, as joint_trajectory_controllers do.
    Arrival,
    /// At its stamp: those with allow_trajectory_replacement.
    Stamp,
}

/// Which arm.
#[derive(Clone, Debug, clap::Args)]
pub struct ArmArgs {
    /// The robot's URDF; without it the PR2
    #[arg(long, requires = "arm")]
    pub urdf: Option<PathBuf>,
    /// The arm: right or left of the PR2, else its first and last link in the URDF, BASE,TIP;
    /// without it the PR2's right
    #[arg(long, value_name = "ARM")]
    pub arm: Option<ArmSpec>,
    /// What ROS calls a joint that has another name in the URDF, as URDF=ROS; may be repeated
    #[arg(long, value_name = "URDF=ROS", value_parser = renaming)]
    pub rename: Vec<(String, String)>,
}

/// How the endpoint works.
#[derive(Clone, Debug, clap::Args)]
pub struct RunArgs {
    /// The robot's name in the service names
    #[arg(long, default_value = DEFAULT_ROBOT)]
    pub robot_name: String,
    /// iceoryx2's root path, if not the default
    #[arg(long)]
    pub ipc_root: Option<PathBuf>,
    #[command(flatten)]
    pub arm: ArmArgs,
    /// The controller's name
    #[arg(long, default_value = "/joint_trajectory_controller")]
    pub controller: String,
    /// What it takes
    #[arg(long, value_enum, default_value = "trajectory")]
    pub interface: Interface,
    /// When it leaves a trajectory for the next one
    #[arg(long, value_enum, default_value = "arrival")]
    pub splice: Splice,
    /// Do without the controller's topic controller_state, which tells whether it is active
    #[arg(long)]
    pub no_controller_state: bool,
    /// The controller_manager that is asked which controllers there are, when none listens or the one
    /// that is meant is not active
    #[arg(long, value_name = "NAME", default_value = "/controller_manager")]
    pub controller_manager: String,
    /// Topic of the arm's joint states
    #[arg(long, default_value = "/joint_states")]
    pub joint_states: String,
    /// Topic (std_msgs/Bool) that says whether the robot's motors are on, where it has one
    #[arg(long, value_name = "TOPIC")]
    pub running: Option<String>,
    /// Service (std_srvs/SetBool) that turns the robot's motors on and off, where it has one
    #[arg(long, value_name = "SERVICE")]
    pub power: Option<String>,
    /// Setpoints are followed so much later, in ms: a message must take less
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u64).range(10..=500))]
    pub delay: u64,
    /// Time between two messages to the controller, in ms; 2 for --interface position unless given
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..=100))]
    pub period: Option<u64>,
    /// Stop following so long after the last setpoint's deadline, in ms
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u64).range(5..=1000))]
    pub timeout: u64,
    /// Deceleration of the stop that ends every message, in rad/s²
    #[arg(long, default_value_t = 4.0, value_parser = Timing::read_acceleration)]
    pub stop_acceleration: f64,
    /// SCHED_FIFO priority, where permitted; 0 for the default scheduler
    #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u8).range(0..=99))]
    pub priority: u8,
    /// Take whole plans instead of setpoints, each as one goal of the controller's action: no executor
    /// runs then
    #[arg(long, conflicts_with = "interface")]
    pub whole_plan: bool,
}

/// How goals are served.
#[derive(Clone, Debug, clap::Args)]
pub struct ServeArgs {
    /// The robot's name in the service names
    #[arg(long, default_value = DEFAULT_ROBOT)]
    pub robot_name: String,
    /// iceoryx2's root path, if not the default
    #[arg(long)]
    pub ipc_root: Option<PathBuf>,
    #[command(flatten)]
    pub arm: ArmArgs,
    /// Where a joint outside the arm stands, as JOINT=POSITION in rad or m; may be repeated
    #[arg(long, value_name = "JOINT=POSITION", value_parser = held)]
    pub held: Vec<(String, f64)>,
    /// The name of the controller that this is
    #[arg(long, default_value = "/nullsweep")]
    pub controller: String,
    /// Tell where the arm is measured on /joint_states, for robots whose driver does not
    #[arg(long)]
    pub publish_joint_states: bool,
}

/// What is shown.
#[derive(Clone, Debug, clap::Args)]
pub struct ShowArgs {
    /// The robot's name in the service names
    #[arg(long, default_value = DEFAULT_ROBOT)]
    pub robot_name: String,
    /// iceoryx2's root path, if not the default
    #[arg(long)]
    pub ipc_root: Option<PathBuf>,
    #[command(flatten)]
    pub arm: ArmArgs,
    /// Where a joint outside the arm stands, as JOINT=POSITION in rad or m; may be repeated
    #[arg(long, value_name = "JOINT=POSITION", value_parser = held)]
    pub held: Vec<(String, f64)>,
    /// A plan file, whose way is shown
    #[arg(value_name = "PLAN")]
    pub plan: Option<PathBuf>,
    /// Topic of the markers
    #[arg(long, default_value = "/nullsweep/markers")]
    pub topic: String,
    /// Tell the arm's frames on /tf, for robots without a robot_state_publisher
    #[arg(long)]
    pub publish_tf: bool,
    /// Tell where the arm is measured on /joint_states, for robots whose driver does not
    #[arg(long)]
    pub publish_joint_states: bool,
}

/// Which cloud, and where to.
#[derive(Clone, Debug, clap::Args)]
pub struct ScanArgs {
    /// Topic of the clouds (sensor_msgs/PointCloud2)
    #[arg(long, default_value = "/points")]
    pub topic: String,
    /// The file that is written
    #[arg(long, value_name = "FILE.pcd", default_value = "scan.pcd")]
    pub out: PathBuf,
    /// The frame, with z up, in which the sensor's pose is looked up by TF: told as the planner's
    /// --sensor-pose, and written as the file's viewpoint
    #[arg(long)]
    pub frame: Option<String>,
    /// Seconds to wait for a cloud and its pose
    #[arg(long, value_name = "S", default_value = "10", value_parser = seconds)]
    pub timeout: std::time::Duration,
}

fn seconds(text: &str) -> Result<std::time::Duration, String> {
    let parsed = text.parse::<f64>().ok().filter(|s| (0.1..=3600.0).contains(s));
    parsed.map(std::time::Duration::from_secs_f64).ok_or_else(|| "seconds, 0.1 to 3600".into())
}

impl ShowArgs {
    /// The arm, with the others where they are held.
    pub fn load(&self) -> anyhow::Result<Arm> {
        at_hold(&self.arm, &self.held)
    }
}

/// The arm, with the others where they are held.
fn at_hold(arm: &ArmArgs, held: &[(String, f64)]) -> anyhow::Result<Arm> {
    let held: Vec<(&str, f64)> =
        held.iter().map(|(name, position)| (name.as_str(), *position)).collect();
    Ok(arm.load()?.with_held(&held)?)
}

impl ServeArgs {
    /// The arm, with the others where they are held.
    pub fn load(&self) -> anyhow::Result<Arm> {
        at_hold(&self.arm, &self.held)
    }
}

impl Common {
    /// The addresses to speak on; empty for all.
    pub fn networks(&self) -> Vec<IpAddr> {
        let range = std::env::var("ROS_AUTOMATIC_DISCOVERY_RANGE");
        if self.network.is_empty() && range.is_ok_and(|range| range == "LOCALHOST") {
            return vec![IpAddr::from([127, 0, 0, 1])];
        }
        self.network.clone()
    }
}

impl ArmArgs {
    /// The arm as its URDF has it.
    pub fn load(&self) -> anyhow::Result<Arm> {
        let robot = match &self.urdf {
            Some(path) => Robot::from_urdf_file(path)?,
            None => Robot::pr2(),
        };
        let right = ArmSpec::pr2(Side::Right);
        Ok(robot.arm(self.arm.as_ref().unwrap_or(&right))?)
    }

    /// What ROS calls each joint.
    pub fn names(&self, arm: &Arm) -> anyhow::Result<impl Fn(&str) -> String + use<>> {
        let names: BTreeMap<String, String> = self.rename.iter().cloned().collect();
        for joint in names.keys() {
            if !arm.robot().joints().iter().any(|j| j.name == *joint) {
                bail!("--rename: the robot has no joint {joint}");
            }
        }
        Ok(move |name: &str| names.get(name).map_or(name, String::as_str).to_string())
    }
}

impl RunArgs {
    /// Time between two messages. \[ms\]
    pub fn period(&self) -> u64 {
        self.period.unwrap_or(match self.interface {
            Interface::Trajectory => 20,
            Interface::Position => 2,
        })
    }

    /// When what is done.
    pub fn timing(&self) -> Timing {
        Timing {
            delay_ns: self.delay * 1_000_000,
            // Positions are played from trajectories made here, which need not be so many.
            period_ns: self.period().max(5) * 1_000_000,
            timeout_ns: self.timeout * 1_000_000,
            stop_acceleration: self.stop_acceleration,
        }
    }

    /// When a trajectory is left for the next one.
    pub fn takeover(&self) -> Takeover {
        match (self.interface, self.splice) {
            (Interface::Trajectory, Splice::Arrival) => Takeover::AtArrival,
            _ => Takeover::AtStamp,
        }
    }
}

/// A joint and where it is held.
fn held(text: &str) -> Result<(String, f64), String> {
    let parsed = text.split_once('=').and_then(|(name, at)| Some((name, at.parse::<f64>().ok()?)));
    match parsed {
        Some((name, at)) if !name.is_empty() && at.is_finite() => Ok((name.into(), at)),
        _ => Err("it is JOINT=POSITION, in rad or m".into()),
    }
}

/// A name of the URDF's and ROS' for it.
fn renaming(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((urdf, ros)) if !urdf.is_empty() && !ros.is_empty() => Ok((urdf.into(), ros.into())),
        _ => Err("it is URDF=ROS, the joint's name there and here".into()),
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Debug, Parser)]
    struct Cli {
        #[command(flatten)]
        run: RunArgs,
    }

    fn parse(words: &[&str]) -> Result<RunArgs, clap::Error> {
        let all = std::iter::once("ros2-bridge").chain(words.iter().copied());
        Cli::try_parse_from(all).map(|cli| cli.run)
    }

    #[test]
    fn joints_have_the_names_that_they_are_given() {
        let args = parse(&["--rename", "r_elbow_flex_joint=elbow"]).expect("sound");
        let arm = args.arm.load().expect("the PR2's");
        let names = args.arm.names(&arm).expect("its joint");
        assert_eq!(names("r_elbow_flex_joint"), "elbow");
        assert_eq!(names("r_wrist_roll_joint"), "r_wrist_roll_joint");
        let args = parse(&["--rename", "nobody=elbow"]).expect("sound");
        let why = args.arm.names(&arm).map(|_| ()).unwrap_err().to_string();
        assert_eq!(why, "--rename: the robot has no joint nobody");
        assert!(parse(&["--rename", "elbow"]).is_err() && parse(&["--rename", "=elbow"]).is_err());
    }

    #[test]
    fn each_kind_of_controller_gets_what_it_takes() {
        let args = parse(&[]).expect("sound");
        assert_eq!((args.takeover(), args.period()), (Takeover::AtArrival, 20));
        let args = parse(&["--splice", "stamp", "--period", "10"]).expect("sound");
        assert_eq!((args.takeover(), args.timing().period_ns), (Takeover::AtStamp, 10_000_000));
        let args = parse(&["--interface", "position"]).expect("sound");
        assert_eq!((args.takeover(), args.period()), (Takeover::AtStamp, 2));
    }

    #[test]
    fn a_stop_has_a_deceleration() {
        let sound = parse(&["--stop-acceleration", "2.5"]).expect("sound");
        assert_eq!(sound.timing().stop_acceleration, 2.5);
        for wrong in ["0", "-1", "NaN", "inf", "fast"] {
            assert!(parse(&[&format!("--stop-acceleration={wrong}")]).is_err(), "{wrong}");
        }
    }

    #[test]
    fn held_joints_have_positions() {
        assert_eq!(held("torso_lift_joint=0.2"), Ok(("torso_lift_joint".into(), 0.2)));
        for wrong in ["torso_lift_joint", "=0.2", "a=b", "a=NaN"] {
            assert!(held(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_urdf_needs_its_arm_and_an_arm_its_urdf() {
        assert!(parse(&["--urdf", "arm.urdf"]).is_err());
        assert!(parse(&["--arm", "base"]).is_err());
        assert!(parse(&["--arm", "base,tip"]).expect("an arm").arm.load().is_err());
        let left = parse(&["--arm", "left"]).expect("an arm").arm.load().expect("the PR2's");
        assert_eq!(*left.spec(), ArmSpec::pr2(Side::Left));
    }
}
