//! `executor ctl`: an operator's commands.
//!
//! A stop goes to the process as a signal, before all else: whatever is wrong with shared memory or
//! with the other clients, the arm stops. Then it is asked as every other command is, to tell how
//! it was taken; that takes a bounded time.

use std::io::Write;
use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::Context;
use clap::{Args, Subcommand};
use nullsweep_cell::as_called;
use nullsweep_ipc_types::ports::{Ipc, IpcError, within};
use nullsweep_ipc_types::{BaseCommand, BaseOrder, CommandKind, Fault, Mode, Response, Verdict};

use crate::log::last_words;
use crate::pidfile::Running;
use crate::system::SystemArgs;

/// How long an answer is waited for.
const ANSWER_WITHIN: Duration = Duration::from_secs(1);
/// How long a command may take with everything that has to be opened for it.
const COMMAND_WITHIN: Duration = Duration::from_secs(10);
/// What to do where it takes longer.
const HANGS: &str = "something of iceoryx2's hangs: look for files of length 0 in /dev/shm and for \
                     processes of this robot that are stopped";

#[derive(Debug, Args)]
pub(crate) struct CtlArgs {
    #[command(flatten)]
    system: SystemArgs,
    #[command(subcommand)]
    order: Ctl,
}

#[derive(Clone, Copy, Debug, Subcommand)]
enum Ctl {
    /// Slow down to a stand-still on the path and keep the plan.
    Pause,
    /// Go on; after a halt or a disable, allow motion again.
    Resume,
    /// Ramp the speed to this percentage.
    Speed {
        /// 0 to 100.
        percent: f64,
    },
    /// Slow down on the path, drop the plan, hold. Goes to the executor as a signal first, so it
    /// stops also where no command can be sent.
    Stop {
        /// Then ask the endpoint to disable its motors.
        #[arg(long)]
        disable: bool,
        /// Only send the signal, to the process of this number.
        #[arg(long, value_name = "PID")]
        pid: Option<i32>,
    },
    /// Clear a latched fault; the arm then holds where it is measured.
    Reset,
    /// Tell mode, fault, plan and speed.
    Status,
    /// Tell a program that waits for the robot's base, whose robot name this is, that the base stands
    /// where the program has asked for it, and that the joints are set. Goes to `planner publish`, not to
    /// the executor.
    Arrived,
}

/// Sends a command and tells how it was taken.
pub(crate) fn command(args: &CtlArgs) -> anyhow::Result<ExitCode> {
    let SystemArgs { robot_name, ipc_root } = &args.system;
    let (kind, value) = match args.order {
        Ctl::Pause => (CommandKind::Pause, 0.0),
        Ctl::Resume => (CommandKind::Resume, 0.0),
        Ctl::Speed { percent } => (CommandKind::Speed, percent / 100.0),
        Ctl::Stop { disable, pid: Some(pid) } => {
            let process = || format!("process {pid}");
            let running = Running::of_pid(pid).with_context(process)?;
            running.stop(disable).with_context(process)?;
            tell(&format!("stop sent to process {pid} as a signal"));
            return Ok(ExitCode::SUCCESS);
        }
        Ctl::Stop { disable: false, pid: None } => (CommandKind::Stop, 0.0),
        Ctl::Stop { disable: true, pid: None } => (CommandKind::StopAndDisable, 0.0),
        Ctl::Reset => (CommandKind::Reset, 0.0),
        Ctl::Status => (CommandKind::Status, 0.0),
        Ctl::Arrived => return arrived(&args.system),
    };
    let signalled = match args.order {
        Ctl::Stop { disable, .. } => Running::stopped(&args.system, disable),
        _ => None,
    };
    let (robot, root) = (robot_name.clone(), ipc_root.clone());
    let response = within(COMMAND_WITHIN, move || ask(&robot, root.as_deref(), kind, value))
        .context(HANGS)
        .and_then(|answer| Ok(answer?));
    match (response, signalled) {
        (Ok(response), _) => {
            tell(&as_called(Answer(kind, &response).to_string()));
            let accepted = Verdict::from_wire(response.verdict) == Some(Verdict::Accepted);
            Ok(if accepted { ExitCode::SUCCESS } else { ExitCode::FAILURE })
        }
        (Err(e), Some(running)) => {
            tell(&format!("stop sent to process {} as a signal", running.pid));
            last_words(&as_called(format!(
                "executor: the stop was sent, but how it was taken is not known: {e:#}"
            )));
            Ok(ExitCode::SUCCESS)
        }
        (Err(e), None) => Err(e),
    }
}

fn ask(
    robot: &str,
    root: Option<&Path>,
    kind: CommandKind,
    value: f64,
) -> Result<Response, IpcError> {
    let ipc = Ipc::open(robot, root)?;
    ipc.command_client()?.call(kind, value, ANSWER_WITHIN)
}

/// Says that the base has arrived, to the program that waits for it.
fn arrived(system: &SystemArgs) -> anyhow::Result<ExitCode> {
    let SystemArgs { robot_name, ipc_root } = system.clone();
    let told = within(COMMAND_WITHIN, move || {
        let ipc = Ipc::open(&robot_name, ipc_root.as_deref())?;
        ipc.base_client()?.call(BaseCommand::of(BaseOrder::Arrived), ANSWER_WITHIN)
    });
    let status = told.context(HANGS).and_then(|answer| Ok(answer?))?;
    let verdict = Verdict::from_wire(status.verdict);
    let accepted = verdict == Some(Verdict::Accepted);
    let words = match verdict {
        Some(Verdict::Accepted) => {
            let [x, y, yaw] = status.pose;
            format!("accepted; the base is taken to stand at {x:.3} m, {y:.3} m, {yaw:.3} rad")
        }
        Some(Verdict::WrongMode) => {
            "not accepted: what drives the base tells by itself when it has arrived".to_owned()
        }
        verdict => verdict.map_or("unknown answer", Verdict::text).to_owned(),
    };
    tell(&format!("arrived: {words}"));
    Ok(if accepted { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Done is done, also where the answer cannot be shown: the exit code tells it too.
fn tell(text: &str) {
    let _ = writeln!(std::io::stdout(), "{text}");
}

/// The answer to a command, in words: how the command was taken, then what the executor does.
struct Answer<'a>(CommandKind, &'a Response);

impl std::fmt::Display for Answer<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self(asked, response) = self;
        let verdict = Verdict::from_wire(response.verdict);
        if *asked != CommandKind::Status || verdict != Some(Verdict::Accepted) {
            write!(f, "{asked}: {}; ", verdict.map_or("unknown answer", Verdict::text))?;
        }
        let doing = match Mode::from_wire(response.mode) {
            Some(Mode::Init) => "waiting for a sound state of the endpoint",
            Some(Mode::Hold) => "holding, no plan runs",
            Some(Mode::Executing) => "executing",
            Some(Mode::Paused) => "paused on the path, `executor ctl resume` goes on",
            Some(Mode::Stopping) => "stopping on the path",
            Some(Mode::Fault) => "holding in a fault, `executor ctl reset` clears it",
            None => "in an unknown mode",
        };
        f.write_str(doing)?;
        match Fault::from_wire(response.fault) {
            Some(Fault::None) => {}
            Some(fault) => write!(f, ", {fault}")?,
            None => write!(f, ", fault {}", response.fault)?,
        }
        if response.plan.is_some() {
            write!(f, ", plan {} at knot {}", response.plan, response.knot)?;
            if response.unverified != 0 {
                f.write_str(" (NOT VERIFIED)")?;
            }
        }
        write!(f, ", speed {:.0} %", response.speed_scale * 100.0)?;
        self.next(f)
    }
}

impl Answer<'_> {
    /// What leads on from a plan that was stopped, or is about to be.
    fn next(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self(asked, response) = self;
        let disabling = *asked == CommandKind::StopAndDisable;
        let stops = disabling || *asked == CommandKind::Stop;
        if response.stopped != 0 {
            write!(f, "; the last plan was left in knot {}", response.knot)?;
        } else if !(stops && response.plan.is_some()) {
            return Ok(());
        }
        let first = if disabling { "`executor ctl resume`, then " } else { "" };
        write!(f, "; {first}`planner replan --running PLAN SCAN…` goes on with what it has left")
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use nullsweep_ipc_types::PlanId;

    use super::*;

    fn said(asked: CommandKind, response: &Response) -> String {
        Answer(asked, response).to_string()
    }

    #[test]
    fn a_plan_that_is_not_verified_is_told() {
        let plan = PlanId { epoch: 0xabc, number: 2 };
        let mode = Mode::Executing.wire();
        let verified = Response { plan, mode, speed_scale: 1.0, knot: 3, ..Response::zeroed() };
        let text = said(CommandKind::Status, &verified);
        assert_eq!(text, "executing, plan abc/2 at knot 3, speed 100 %");
        let text = said(CommandKind::Status, &Response { unverified: 1, ..verified });
        assert!(text.contains("plan abc/2 at knot 3 (NOT VERIFIED), speed"), "{text}");
    }

    #[test]
    fn a_stop_says_what_leads_on() {
        const LEADS: &str = "; `planner replan --running PLAN SCAN…` goes on with what it has left";
        let plan = PlanId { epoch: 0xabc, number: 2 };
        let stopping = Response {
            plan,
            mode: Mode::Stopping.wire(),
            speed_scale: 1.0,
            knot: 3,
            ..Response::zeroed()
        };
        let text = said(CommandKind::Stop, &stopping);
        let told = "stop: accepted; stopping on the path, plan abc/2 at knot 3, speed 100 %";
        assert_eq!(text, format!("{told}{LEADS}"));
        let text = said(CommandKind::StopAndDisable, &stopping);
        assert!(text.contains("%; `executor ctl resume`, then `planner replan"), "{text}");
        assert!(!said(CommandKind::Status, &stopping).contains("replan"), "it may be replaced");
        let plan = PlanId::NONE;
        let held = Response { plan, mode: Mode::Hold.wire(), stopped: 1, ..stopping };
        let text = said(CommandKind::Status, &held);
        let told = "holding, no plan runs, speed 100 %; the last plan was left in knot 3";
        assert_eq!(text, format!("{told}{LEADS}"));
    }

    #[test]
    fn what_was_accepted_is_the_command_and_never_a_plan() {
        let holds = Response { mode: Mode::Hold.wire(), speed_scale: 0.5, ..Response::zeroed() };
        let text = said(CommandKind::Status, &holds);
        assert_eq!(text, "holding, no plan runs, speed 50 %");
        let text = said(CommandKind::Speed, &holds);
        assert_eq!(text, "speed: accepted; holding, no plan runs, speed 50 %");
        let refused = Response { verdict: Verdict::WrongMode.wire(), ..holds };
        let text = said(CommandKind::Resume, &refused);
        assert!(text.starts_with("resume: not possible in this mode; holding"), "{text}");
        let busy = Response { verdict: Verdict::Busy.wire(), ..holds };
        assert!(said(CommandKind::Status, &busy).starts_with("status: busy; "));
    }
}
