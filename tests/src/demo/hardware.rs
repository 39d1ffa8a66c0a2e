//! What stands in for the robot in the demo: the mock, or MuJoCo behind a Python endpoint.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, ensure};
use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use super::args::{Args, Hardware};
use crate::measured::Swept;
use crate::stage::{Process, Stage};
use crate::system::{PATIENT_MOCK, VERDICT, start_mock};
use crate::tracking::Tracking;

/// What is read from an endpoint's verdict.
#[derive(Debug, Deserialize)]
pub struct Found {
    /// The judge's findings; MuJoCo has no judge.
    pub verdict: Option<Verdict>,
    /// What the endpoint itself did.
    pub endpoint: Counters,
    /// What the measured positions have swept.
    pub swept: Option<Swept>,
    /// How the arm followed.
    pub tracking: Option<Tracking>,
}

/// Of the mock's judge.
#[derive(Debug, Deserialize)]
pub struct Verdict {
    /// Setpoints that were judged.
    pub setpoints: u64,
    violations: std::collections::BTreeMap<String, u64>,
    plans: Vec<Run>,
}

impl Verdict {
    /// Violations of all kinds.
    pub fn violations(&self) -> u64 {
        self.violations.values().sum()
    }

    /// How a plan was joined.
    pub fn run(&self, plan: &str) -> Option<&Run> {
        self.plans.iter().find(|run| run.plan == plan)
    }
}

/// How a plan was joined.
#[derive(Debug, Deserialize)]
pub struct Run {
    plan: String,
    /// The largest step of a joint in that cycle, as a share of v·T.
    pub join_step_ratio: f64,
    /// The largest change of a joint's velocity there. \[rad/s\]
    pub join_velocity_step: f64,
}

/// What the endpoint itself did.
#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
pub struct Counters {
    /// How often it stopped by itself because setpoints ceased.
    pub timeouts: u64,
    /// Setpoints that it did not follow.
    pub refused: u64,
}

/// What a Python endpoint says when a package is missing, and ends with.
const MISSING: i32 = 77;

/// Python packages are missing; the text says which.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Missing(String);

impl Missing {
    /// The demo's exit code then.
    pub const CODE: u8 = MISSING as u8;
}

impl Hardware {
    /// Asks whether everything is there, before anything is planned.
    ///
    /// # Errors
    /// [`Missing`], or Python cannot be started.
    pub(super) fn check(self, args: &Args) -> anyhow::Result<()> {
        if self == Self::Mock {
            return Ok(());
        }
        let script = script()?;
        let asked = Command::new(&args.python).arg(script).arg("--check").output();
        let asked = asked.map_err(|e| Missing(format!("{} cannot run: {e}", args.python)))?;
        let (out, err) =
            (String::from_utf8_lossy(&asked.stdout), String::from_utf8_lossy(&asked.stderr));
        let said = format!("{out}{err}");
        match asked.status.code() {
            Some(0) => Ok(()),
            Some(MISSING) => Err(Missing(said.trim().to_owned()).into()),
            _ => anyhow::bail!("the MuJoCo endpoint cannot be asked: {}", said.trim()),
        }
    }

    /// Starts the endpoint with the arm where `plan` begins.
    pub(super) fn start(self, args: &Args, stage: &Stage, plan: &Path) -> anyhow::Result<Process> {
        if self == Self::Mock {
            let mut options: Vec<OsString> = vec!["--plan".into(), plan.into()];
            options.extend(PATIENT_MOCK.map(Into::into));
            options.extend(["--record".into(), stage.file("record.csv").into()]);
            let fidelity = args.fidelity.to_possible_value();
            options.extend(fidelity.map(|f| format!("--fidelity={}", f.get_name()).into()));
            return Ok(start_mock(stage, "mock", options)?);
        }
        let mut options: Vec<OsString> = vec![script()?.into(), plan.into()];
        options.extend(PATIENT_MOCK.map(Into::into));
        options.extend(stage.place());
        options.extend(["--json".into(), stage.file(VERDICT).into()]);
        options.extend(["--picture".into(), args.picture.clone().into()]);
        Ok(stage.launch(&args.python, "mujoco", options)?)
    }
}

fn script() -> anyhow::Result<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/mujoco/endpoint.py");
    ensure!(path.exists(), "{} is not there: run the demo from a checkout", path.display());
    path.canonicalize().context("the MuJoCo endpoint's path")
}
