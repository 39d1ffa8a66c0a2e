//! A whole simulated robot on a stage, an executor for each of its arms, and those who work through a program
//! with it.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use std::{fs, thread};

use anyhow::{Context, bail};
use nullsweep_ipc_types::Mode;
use nullsweep_ipc_types::ports::Ipc;
use nullsweep_planner::plan::Program;
use serde::Deserialize;

use crate::stage::{Part, Process, Stage};
use crate::system::{start_mock, verdict};
use crate::whole::SweptOf;
use crate::witness::{PATIENCE, Witness};

/// The robot and its executors.
#[derive(Debug)]
pub struct Crew {
    /// The robot.
    pub mock: Process,
    /// An executor for each arm of the program.
    pub seats: Vec<Seat>,
    program: PathBuf,
    options: Vec<OsString>,
}

/// An arm's executor.
#[derive(Debug)]
pub struct Seat {
    /// Base and tip link of the arm: BASE,TIP.
    pub arm: String,
    /// The robot's name in its services' names.
    pub robot: String,
    /// The executor.
    pub process: Process,
}

/// What is read from the robot's verdict.
#[derive(Debug, Deserialize)]
pub struct Found {
    /// Violations of all arms.
    pub violations: u64,
    /// Each arm.
    pub arms: Vec<ArmFound>,
    /// How often the base was sent somewhere.
    pub drives: u64,
    /// What was swept.
    pub swept: SweptOf,
}

/// Of an arm.
#[derive(Debug, Deserialize)]
pub struct ArmFound {
    /// What the judge found.
    pub verdict: Judged,
}

/// What a judge found.
#[derive(Debug, Deserialize)]
pub struct Judged {
    /// Setpoints that were judged.
    pub setpoints: u64,
}

impl Crew {
    /// Starts the robot with these options beside the usual ones, and an executor with its own for each arm
    /// of the program at `path`, and waits until every arm is held.
    pub fn start(
        stage: &Stage,
        path: &Path,
        mock: &[&str],
        executor: &[&str],
    ) -> anyhow::Result<Self> {
        let program = Program::read(path)?.context("it is no program")?;
        let mut arms: Vec<String> = Vec::new();
        for (_, work) in program.works() {
            if !arms.contains(&work.arm) {
                arms.push(work.arm.clone());
            }
        }
        let name = |k: usize| format!("{}-{}", stage.robot(), k + 1);
        let mut options: Vec<OsString> = Vec::new();
        for (k, arm) in arms.iter().enumerate() {
            options.extend(["--executor".into(), format!("{arm}={}", name(k)).into()]);
        }
        let mut all: Vec<OsString> = vec!["--program".into(), path.into()];
        all.extend(mock.iter().map(OsString::from));
        all.extend(options.iter().cloned());
        let mock = start_mock(stage, "mock", all)?;
        let seat = |(k, arm): (usize, String)| {
            let robot = name(k);
            let process = seated(stage, &arm, &robot, "executor", executor)?;
            Ok(Seat { arm, robot, process })
        };
        let seats = arms.into_iter().enumerate().map(seat).collect::<anyhow::Result<_>>()?;
        Ok(Self { mock, seats, program: path.into(), options })
    }

    /// Kills an arm's executor in whatever it does, and starts another one in its place.
    pub fn replace(&mut self, stage: &Stage, seat: usize, options: &[&str]) -> anyhow::Result<()> {
        let Seat { arm, robot, process } = &mut self.seats[seat];
        process.kill()?;
        *process = seated(stage, arm, robot, "executor-again", options)?;
        Ok(())
    }

    /// Starts to work through the program.
    pub fn publish(&self, stage: &Stage, name: &str, more: &[&str]) -> anyhow::Result<Process> {
        self.publish_as(stage, stage.robot(), name, more)
    }

    /// The same with the base's service of another name.
    pub fn publish_as(
        &self,
        stage: &Stage,
        robot: &str,
        name: &str,
        more: &[&str],
    ) -> anyhow::Result<Process> {
        let mut options: Vec<OsString> = vec!["publish".into(), self.program.clone().into()];
        options.extend(["--robot-name".into(), robot.into()]);
        options.extend(["--ipc-root".into(), stage.root().into_os_string()]);
        options.extend(self.options.iter().cloned());
        options.extend(more.iter().map(OsString::from));
        Ok(stage.start(Part::Planner, name, options)?)
    }

    /// Waits until the journal tells of so many plans that were begun; whoever works is watched.
    pub fn begun(&self, count: usize, who: &mut Process, patience: Duration) -> anyhow::Result<()> {
        let start = Instant::now();
        while self.count("\"begun\"") < count {
            if let Some(status) = who.status()? {
                bail!("{} ended ({status}): {}", who.name(), who.last_words());
            }
            if start.elapsed() > patience {
                bail!("plan {count} was not begun within {} s", patience.as_secs());
            }
            thread::sleep(Duration::from_millis(10));
        }
        Ok(())
    }

    /// How many lines of the journal hold these words.
    #[must_use]
    pub fn count(&self, words: &str) -> usize {
        let text = fs::read_to_string(self.journal()).unwrap_or_default();
        text.lines().filter(|line| line.contains(words)).count()
    }

    /// The program's journal.
    #[must_use]
    pub fn journal(&self) -> PathBuf {
        let mut name = self.program.as_os_str().to_owned();
        name.push(".journal");
        name.into()
    }

    /// Ends all, and reads the robot's verdict.
    pub fn end(&mut self, stage: &Stage) -> anyhow::Result<Found> {
        for seat in &mut self.seats {
            seat.process.terminate(PATIENCE)?;
        }
        verdict(stage, &mut self.mock)
    }
}

/// Starts the executor of an arm, and waits until it holds it.
fn seated(
    stage: &Stage,
    arm: &str,
    robot: &str,
    name: &str,
    options: &[&str],
) -> anyhow::Result<Process> {
    let root = stage.root();
    let mut args: Vec<OsString> =
        ["run", "--arm", arm, "--robot-name", robot].map(Into::into).into();
    args.extend(["--ipc-root".into(), root.clone().into_os_string()]);
    args.extend(options.iter().map(OsString::from));
    let mut process = stage.start(Part::Executor, &format!("{name}-{robot}"), args)?;
    let held = Witness::open(&Ipc::open(robot, Some(&root))?)?.mode(Mode::Hold);
    held.map_err(|error| match process.status() {
        Ok(Some(status)) => anyhow::anyhow!("{name} ended ({status}): {}", process.last_words()),
        _ => error.into(),
    })?;
    Ok(process)
}
