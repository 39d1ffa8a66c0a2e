//! The executor: what it tells, and what it is asked.

use std::time::{Duration, Instant};

use nullsweep_ipc_types::ports::{CommandClient, Ipc, Receiver};
use nullsweep_ipc_types::{self as wire, CommandKind, Fault, Mode, Response, Verdict};
use numpy::PyArray1;
use pyo3::exceptions::PyTimeoutError;
use pyo3::prelude::*;

use crate::cell::Cell;
use crate::errors::{Error, UsageError, raise};

/// Time between two looks.
const LOOK: Duration = Duration::from_millis(2);
/// How long an answer is waited for.
const ANSWER: Duration = Duration::from_secs(2);

/// An executor that runs.
#[pyclass(unsendable, module = "nullsweep")]
pub(crate) struct Executor {
    telemetry: Receiver<wire::Telemetry>,
    commands: Option<CommandClient>,
    ipc: Ipc,
    timeout: Duration,
}

#[pymethods]
impl Executor {
    /// `timeout`: after so many seconds without a word it counts as silent.
    #[new]
    #[pyo3(signature = (cell=None, *, timeout=5.0))]
    fn new(cell: Option<&Cell>, timeout: f64) -> PyResult<Self> {
        let timeout = Duration::try_from_secs_f64(timeout)
            .map_err(|why| UsageError::new_err(format!("timeout: {why}")))?;
        let default = Cell::default_one();
        let cell = cell.unwrap_or(&default);
        let ipc = Ipc::open(cell.robot_name(), cell.root()).map_err(raise)?;
        let telemetry = ipc.telemetry_receiver().map_err(raise)?;
        Ok(Self { telemetry, commands: None, ipc, timeout })
    }

    fn __iter__(this: PyRef<'_, Self>) -> PyRef<'_, Self> {
        this
    }

    /// The next word of its, in order; TimeoutError where none comes in time.
    fn __next__(&mut self, py: Python<'_>) -> PyResult<Telemetry> {
        self.wait(py, |telemetry| telemetry.receive())
    }

    /// The newest word of its.
    #[getter]
    fn telemetry(&mut self, py: Python<'_>) -> PyResult<Telemetry> {
        self.wait(py, |telemetry| Ok(telemetry.newest()?.map(|newest| newest.value)))
    }

    fn status(&mut self, py: Python<'_>) -> PyResult<Status> {
        self.ask(py, CommandKind::Status, 0.0)
    }

    fn pause(&mut self, py: Python<'_>) -> PyResult<Status> {
        self.ask(py, CommandKind::Pause, 0.0)
    }

    fn resume(&mut self, py: Python<'_>) -> PyResult<Status> {
        self.ask(py, CommandKind::Resume, 0.0)
    }

    fn reset(&mut self, py: Python<'_>) -> PyResult<Status> {
        self.ask(py, CommandKind::Reset, 0.0)
    }

    /// Ramps the speed to a share of the plan's, 0…1.
    fn speed(&mut self, py: Python<'_>, share: f64) -> PyResult<Status> {
        self.ask(py, CommandKind::Speed, share)
    }

    /// Stops on the path and drops the plan; then, if asked, has the motors off.
    #[pyo3(signature = (*, disable=false))]
    fn stop(&mut self, py: Python<'_>, disable: bool) -> PyResult<Status> {
        let kind = if disable { CommandKind::StopAndDisable } else { CommandKind::Stop };
        self.ask(py, kind, 0.0)
    }
}

impl Executor {
    fn wait(
        &self,
        py: Python<'_>,
        next: impl Fn(
            &Receiver<wire::Telemetry>,
        ) -> Result<Option<wire::Telemetry>, wire::ports::PortError>,
    ) -> PyResult<Telemetry> {
        let began = Instant::now();
        loop {
            if let Some(found) = next(&self.telemetry).map_err(raise)? {
                return Ok(Telemetry(found));
            }
            if began.elapsed() >= self.timeout {
                let robot = self.ipc.robot();
                let why = format!("the executor of {robot} sends no telemetry: is it running?");
                return Err(PyTimeoutError::new_err(why));
            }
            py.check_signals()?;
            py.detach(|| std::thread::sleep(LOOK));
        }
    }

    fn ask(&mut self, py: Python<'_>, kind: CommandKind, value: f64) -> PyResult<Status> {
        let client = match self.commands.take() {
            Some(client) => client,
            None => self.ipc.command_client().map_err(raise)?,
        };
        let client = self.commands.insert(client);
        let asked = client.ask(kind, value).map_err(raise)?;
        let began = Instant::now();
        loop {
            if let Some(answer) = asked.answer().map_err(raise)? {
                return Status::of(&answer);
            }
            if began.elapsed() >= ANSWER {
                let (robot, millis) = (self.ipc.robot().to_owned(), ANSWER.as_millis());
                return Err(raise(wire::ports::IpcError::NoAnswer { robot, millis }));
            }
            py.check_signals()?;
            py.detach(|| std::thread::sleep(LOOK));
        }
    }
}

/// An answer to a command.
#[pyclass(frozen, get_all, module = "nullsweep")]
pub(crate) struct Status {
    mode: &'static str,
    fault: Option<&'static str>,
    plan: Option<String>,
    knot: u32,
    speed: f64,
    is_verified: bool,
}

impl Status {
    /// # Errors
    /// The command was not accepted.
    fn of(answer: &Response) -> PyResult<Self> {
        let verdict = Verdict::from_wire(answer.verdict);
        let mode = Mode::from_wire(answer.mode).map_or("unknown", Mode::text);
        if verdict != Some(Verdict::Accepted) {
            let verdict = verdict.map_or("unknown verdict", Verdict::text);
            return Err(Error::new_err(format!("not accepted: {verdict} ({mode})")));
        }
        Ok(Self {
            mode,
            fault: fault(answer.fault),
            plan: answer.plan.is_some().then(|| answer.plan.to_string()),
            knot: answer.knot,
            speed: answer.speed_scale,
            is_verified: answer.unverified == 0,
        })
    }
}

#[pymethods]
impl Status {
    fn __repr__(&self) -> String {
        let plan = self.plan.as_ref().map_or(String::new(), |plan| format!(", plan {plan}"));
        let fault = self.fault.map_or(String::new(), |fault| format!(", {fault}"));
        format!("Status({}{fault}{plan}, speed {:.0} %)", self.mode, 100.0 * self.speed)
    }
}

fn fault(code: u32) -> Option<&'static str> {
    Fault::from_wire(code).filter(|fault| *fault != Fault::None).map(Fault::text)
}

/// What the executor tells.
#[pyclass(frozen, module = "nullsweep")]
pub(crate) struct Telemetry(wire::Telemetry);

impl Telemetry {
    fn joints<'py>(&self, py: Python<'py>, all: &[f64]) -> Bound<'py, PyArray1<f64>> {
        let used = (self.0.joint_count as usize).min(all.len());
        PyArray1::from_slice(py, &all[..used])
    }
}

#[pymethods]
impl Telemetry {
    /// Counts its words.
    #[getter]
    fn sequence(&self) -> u64 {
        self.0.sequence
    }

    /// When it was, on CLOCK_MONOTONIC. \[s\]
    #[getter]
    fn stamp(&self) -> f64 {
        self.0.stamp_ns as f64 * 1e-9
    }

    #[getter]
    fn mode(&self) -> &'static str {
        Mode::from_wire(self.0.mode).map_or("unknown", Mode::text)
    }

    #[getter]
    fn fault(&self) -> Option<&'static str> {
        fault(self.0.fault)
    }

    /// The plan in execution.
    #[getter]
    fn plan(&self) -> Option<String> {
        self.0.plan.is_some().then(|| self.0.plan.to_string())
    }

    /// Time within that plan. \[s\]
    #[getter]
    fn plan_time(&self) -> f64 {
        self.0.plan_time_ns as f64 * 1e-9
    }

    #[getter]
    fn knot(&self) -> u32 {
        self.0.knot
    }

    /// The share of full speed that is gone at.
    #[getter]
    fn speed(&self) -> f64 {
        self.0.speed_scale
    }

    /// Commanded positions. \[rad\] or \[m\]
    #[getter]
    fn commanded<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.joints(py, &self.0.commanded[..])
    }

    /// Newest measured positions. \[rad\] or \[m\]
    #[getter]
    fn measured<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.joints(py, &self.0.measured[..])
    }

    #[getter]
    fn cycle(&self) -> u64 {
        self.0.cycle
    }

    #[getter]
    fn missed_cycles(&self) -> u64 {
        self.0.missed_cycles
    }

    #[getter]
    fn is_verified(&self) -> bool {
        self.0.unverified == 0
    }

    fn __repr__(&self) -> String {
        let (mode, time) = (self.mode(), self.plan_time());
        let plan =
            self.plan().map_or(String::new(), |plan| format!(", plan {plan} at {time:.2} s"));
        format!("Telemetry({mode}{plan})")
    }
}
