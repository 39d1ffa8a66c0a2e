//! The command line.

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Parser, Subcommand};
use nullsweep_ipc_types::PlanId;
use nullsweep_ipc_types::service::DEFAULT_ROBOT;

/// Carries plans, events, telemetry and commands between two hosts, over zenoh.
#[derive(Debug, Parser)]
#[command(
    name = "relay",
    version,
    after_help = "Exit codes: 0 done, or ended by SIGINT or SIGTERM; 1 failed; 2 wrong usage; 4 the \
                  robot's end gave no answer: ask again."
)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Action,
}

#[derive(Debug, Subcommand)]
pub enum Action {
    /// Be the end beside the executor, until ended
    Robot(RobotArgs),
    /// Be the end beside the planners: in the executor's place there, until ended
    Planner(PlannerArgs),
    /// Ask the robot's end what became of a plan
    Ask(AskArgs),
}

/// Which robot.
#[derive(Clone, Debug, Args)]
pub struct RobotName {
    /// The robot's name in the service names, the same at both ends
    #[arg(long, default_value = DEFAULT_ROBOT)]
    pub robot_name: String,
}

/// How the other end is reached.
#[derive(Clone, Debug, Args)]
pub struct NetArgs {
    /// Listen there, as zenoh writes it: tls/0.0.0.0:7447; may be repeated
    #[arg(long, value_name = "ENDPOINT")]
    pub listen: Vec<String>,
    /// Connect to there: tls/robot.example:7447; may be repeated
    #[arg(long, value_name = "ENDPOINT")]
    pub connect: Vec<String>,
    /// zenoh's own configuration (JSON5): certificates, access control, and all else
    #[arg(long, value_name = "FILE")]
    pub zenoh: Option<PathBuf>,
    /// Listen without TLS on more than this host: whoever reaches the port can move the arm
    #[arg(long)]
    pub unprotected: bool,
}

#[derive(Clone, Debug, Args)]
pub struct RobotArgs {
    #[command(flatten)]
    pub robot: RobotName,
    /// iceoryx2's root path, if not the default
    #[arg(long)]
    pub ipc_root: Option<PathBuf>,
    #[command(flatten)]
    pub net: NetArgs,
    /// Telemetry that is sent on, in samples a second at most
    #[arg(long, value_name = "HZ", default_value_t = 100,
          value_parser = clap::value_parser!(u32).range(1..=100))]
    pub telemetry: u32,
}

#[derive(Clone, Debug, Args)]
pub struct PlannerArgs {
    #[command(flatten)]
    pub robot: RobotName,
    /// iceoryx2's root path, if not the default
    #[arg(long)]
    pub ipc_root: Option<PathBuf>,
    #[command(flatten)]
    pub net: NetArgs,
    /// A plan that has not come to the robot so long after it was published is not executed, in s; as
    /// long as `planner publish --timeout` waits
    #[arg(long, value_name = "S", default_value = "5", value_parser = seconds)]
    pub plan_within: Duration,
}

#[derive(Clone, Debug, Args)]
pub struct AskArgs {
    /// The plan, as `planner publish` names it; without it the last events
    #[arg(value_name = "PLAN", value_parser = plan)]
    pub plan: Option<PlanId>,
    #[command(flatten)]
    pub robot: RobotName,
    #[command(flatten)]
    pub net: NetArgs,
    /// Seconds to wait for an answer
    #[arg(long, value_name = "S", default_value = "10", value_parser = seconds)]
    pub timeout: Duration,
}

fn seconds(text: &str) -> Result<Duration, String> {
    let parsed = text.parse::<f64>().ok().filter(|s| (0.1..=3600.0).contains(s));
    parsed.map(Duration::from_secs_f64).ok_or_else(|| "seconds, 0.1 to 3600".into())
}

/// A plan's id, as it is shown.
fn plan(text: &str) -> Result<PlanId, String> {
    let parsed = text.split_once('/').and_then(|(epoch, number)| {
        let epoch = u64::from_str_radix(epoch, 16).ok()?;
        Some(PlanId { epoch, number: number.parse().ok()? })
    });
    parsed.ok_or_else(|| "a plan's id is like 3f2a61b09c1/1".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plan_is_named_as_it_is_shown() {
        let id = PlanId { epoch: 0x3f2_a61b, number: 12 };
        assert_eq!(plan(&id.to_string()), Ok(id));
        for wrong in ["", "12", "xyz/1", "3f/", "/1"] {
            assert!(plan(wrong).is_err(), "{wrong}");
        }
        assert!(seconds("0").is_err() && seconds("NaN").is_err() && seconds("2.5").is_ok());
    }

    #[test]
    fn the_command_line_is_sound() {
        use clap::CommandFactory;
        Cli::command().debug_assert();
    }
}
