//! The command line's parts that the endpoint reads.

use std::path::PathBuf;

use nullsweep_bridge::Timing;
use nullsweep_ipc_types::service::DEFAULT_ROBOT;
use nullsweep_robot::{Arm, ArmSpec, Robot, Side};

/// What every command needs.
#[derive(Debug, clap::Args)]
pub struct Common {
    /// URI of the ROS master
    #[arg(long, env = "ROS_MASTER_URI", default_value = "http://127.0.0.1:11311", global = true)]
    pub master: String,
    /// Namespace of the EtherCAT driver: its services and motors_halted
    #[arg(long, default_value = "/pr2_ethercat", global = true)]
    pub driver: String,
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
    /// The robot's URDF; without it the PR2
    #[arg(long)]
    pub urdf: Option<PathBuf>,
    /// Which arm
    #[arg(long, value_enum, default_value = "right")]
    pub arm: ArmSide,
    /// Namespace of the arm's controller; without it /r_arm_controller or /l_arm_controller
    #[arg(long)]
    pub controller: Option<String>,
    /// Topic that says whether the joints are calibrated (std_msgs/Bool, latched)
    #[arg(long, default_value = "/calibrated")]
    pub calibrated: String,
    /// Take the joints as calibrated: for robots without that topic
    #[arg(long)]
    pub assume_calibrated: bool,
    /// Setpoints are followed so much later, in ms: a message must take less
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u64).range(10..=500))]
    pub delay: u64,
    /// Time between two messages to the controller, in ms
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u64).range(5..=100))]
    pub period: u64,
    /// Stop following so long after the last setpoint's deadline, in ms
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u64).range(5..=1000))]
    pub timeout: u64,
    /// Deceleration of the stop that ends every message, in rad/s²
    #[arg(long, default_value_t = 4.0, value_parser = Timing::read_acceleration)]
    pub stop_acceleration: f64,
    /// SCHED_FIFO priority, where permitted; 0 for the default scheduler
    #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u8).range(0..=99))]
    pub priority: u8,
    /// Take whole plans instead of setpoints, each as one goal: no executor runs then
    #[arg(long)]
    pub whole_plan: bool,
}

/// An arm of the PR2.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum ArmSide {
    /// The left one.
    Left,
    /// The right one.
    Right,
}

impl RunArgs {
    /// The arm as its URDF has it.
    pub fn load(&self) -> anyhow::Result<Arm> {
        let robot = match &self.urdf {
            Some(path) => Robot::from_urdf_file(path)?,
            None => Robot::pr2(),
        };
        let side = match self.arm {
            ArmSide::Left => Side::Left,
            ArmSide::Right => Side::Right,
        };
        Ok(robot.arm(&ArmSpec::pr2(side))?)
    }

    /// The controller's namespace.
    pub fn controller(&self) -> String {
        let own = match self.arm {
            ArmSide::Left => "/l_arm_controller",
            ArmSide::Right => "/r_arm_controller",
        };
        self.controller.clone().unwrap_or_else(|| own.into())
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

    #[test]
    fn a_stop_has_a_deceleration() {
        let parse = |value: &str| {
            Cli::try_parse_from(["pr2-bridge".into(), format!("--stop-acceleration={value}")])
        };
        assert_eq!(parse("2.5").expect("sound").run.stop_acceleration, 2.5);
        for wrong in ["0", "-1", "NaN", "inf", "fast"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }
}
