//! Endpoint and executor on one stage and somebody who watches them: how the demo, the killing lab and
//! the tests begin and end.

use std::ffi::OsString;
use std::{fs, io};

use anyhow::Context;
use nullsweep_ipc_types::Mode;
use nullsweep_ipc_types::ports::Ipc;
use serde::de::DeserializeOwned;

use crate::stage::{Part, Process, Stage};
use crate::witness::{PATIENCE, Witness};

/// For an executor on a desktop, which stalls a process now and then for longer than a robot would.
pub const PATIENT: [&str; 4] = ["--stale-ms", "100", "--lost-ms", "400"];
/// For a mock there.
pub const PATIENT_MOCK: [&str; 2] = ["--timeout", "100"];

/// Where the endpoint writes its verdict, a file of the stage.
pub const VERDICT: &str = "endpoint.json";

/// A system that holds the arm and takes plans.
#[derive(Debug)]
pub struct System {
    /// The endpoint, mostly the mock.
    pub endpoint: Process,
    /// The executor.
    pub executor: Process,
    /// Who watches.
    pub witness: Witness,
    /// For further ports.
    pub ipc: Ipc,
}

impl System {
    /// Starts mock and executor with these options beside the usual ones, and waits until the arm
    /// is held: from then on plans can be published.
    pub fn start(
        stage: &Stage,
        mock: impl IntoIterator<Item = impl Into<OsString>>,
        executor: impl IntoIterator<Item = impl Into<OsString>>,
    ) -> anyhow::Result<Self> {
        Self::around(stage, start_mock(stage, "mock", mock)?, executor)
    }

    /// The same with an endpoint that was started before.
    pub fn around(
        stage: &Stage,
        endpoint: Process,
        executor: impl IntoIterator<Item = impl Into<OsString>>,
    ) -> anyhow::Result<Self> {
        let ipc = Ipc::open(stage.robot(), Some(&stage.root()))?;
        let witness = Witness::open(&ipc)?;
        let executor = start_executor(stage, "executor", executor)?;
        let mut system = Self { endpoint, executor, witness, ipc };
        system.until(|witness| witness.mode(Mode::Hold))?;
        Ok(system)
    }

    /// What is waited for, or why it could not be had: a process that ended says more than what it
    /// left undone.
    pub fn until<T, E: Into<anyhow::Error>>(
        &mut self,
        wait: impl FnOnce(&mut Witness) -> Result<T, E>,
    ) -> anyhow::Result<T> {
        wait(&mut self.witness).map_err(|error| {
            for process in [&mut self.endpoint, &mut self.executor] {
                if let Ok(Some(status)) = process.status() {
                    let (name, said) = (process.name(), process.last_words());
                    return anyhow::anyhow!("{name} ended ({status}): {said}");
                }
            }
            error.into()
        })
    }

    /// Ends executor and endpoint and reads the endpoint's verdict.
    pub fn end<T: DeserializeOwned>(&mut self, stage: &Stage) -> anyhow::Result<T> {
        self.executor.terminate(PATIENCE)?;
        verdict(stage, &mut self.endpoint)
    }
}

/// Starts a mock whose verdict [`verdict`] reads.
pub fn start_mock(
    stage: &Stage,
    name: &str,
    options: impl IntoIterator<Item = impl Into<OsString>>,
) -> io::Result<Process> {
    let mut args = stage.place().to_vec();
    args.extend(["--json".into(), stage.file(VERDICT).into()]);
    args.extend(options.into_iter().map(Into::into));
    stage.start(Part::Mock, name, args)
}

/// Starts an executor.
pub fn start_executor(
    stage: &Stage,
    name: &str,
    options: impl IntoIterator<Item = impl Into<OsString>>,
) -> io::Result<Process> {
    let mut args: Vec<OsString> = vec!["run".into()];
    args.extend(stage.place());
    args.extend(options.into_iter().map(Into::into));
    stage.start(Part::Executor, name, args)
}

/// Ends an endpoint and reads its verdict.
pub fn verdict<T: DeserializeOwned>(stage: &Stage, endpoint: &mut Process) -> anyhow::Result<T> {
    endpoint.terminate(PATIENCE)?.context("the endpoint does not end on SIGTERM")?;
    let text = fs::read(stage.file(VERDICT))
        .with_context(|| format!("no verdict of the endpoint: {}", endpoint.last_words()))?;
    serde_json::from_slice(&text).context("the endpoint's verdict")
}
