//! Sending plans to the executor.

use std::time::Duration;

use nullsweep_ipc_types::PlanEvent;
use nullsweep_planner::link::publish::{self as link, Join, Patience, Watcher, describe_for};
use nullsweep_planner::plan::Held;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::cell::Cell;
use crate::errors::{UsageError, raise};
use crate::keywords::Keywords;
use crate::plan::Plan;

/// Tells a callback what becomes of a plan.
struct Told {
    event: Option<Py<PyAny>>,
    joints: Vec<String>,
    held: Vec<Held>,
    failed: Option<PyErr>,
}

impl Watcher for Told {
    fn event(&mut self, event: &PlanEvent) {
        let (Some(callback), None) = (&self.event, &self.failed) else { return };
        let text = describe_for(event, &self.joints, &self.held);
        let called = Python::attach(|py| callback.call1(py, (text,)).map(|_| ()));
        self.failed = called.err();
    }
}

/// Sends a plan to the executor and waits for its admission, or for its end; its id.
#[pyfunction]
#[pyo3(signature = (plan, cell=None, **how))]
pub(crate) fn publish(
    py: Python<'_>,
    plan: PyRef<'_, Plan>,
    cell: Option<&Cell>,
    how: Option<&Bound<'_, PyDict>>,
) -> PyResult<String> {
    let how = Keywords::of(py, how)?;
    let (join, event) = (how.take::<Option<String>>("join", None)?, how.take("event", None)?);
    let (wait, unverified) = (how.take("wait", false)?, how.take("unverified", false)?);
    let timeout = how.take("timeout", 5.0)?;
    how.end()?;
    let plan = plan.inner();
    if !unverified {
        plan.check_seal().map_err(raise)?;
    }
    let join = match join.as_deref() {
        None if plan.continues.is_some() => Join::Knot,
        None | Some("stop") => Join::Stop,
        Some("after") => Join::After,
        Some("knot") => Join::Knot,
        Some(other) => {
            let why = format!("join: {other} is none of stop, after, knot");
            return Err(UsageError::new_err(why));
        }
    };
    let admission = Duration::try_from_secs_f64(timeout)
        .map_err(|why| UsageError::new_err(format!("timeout: {why}")))?;
    let end = wait.then(|| Duration::from_secs_f64(10.0 * plan.duration() + 600.0));
    let default = Cell::default_one();
    let cell = cell.unwrap_or(&default);
    let (robot, root) = (cell.robot_name(), cell.root());
    let (joints, held) = (plan.joints.clone(), plan.held.clone());
    let mut told = Told { event, joints, held, failed: None };
    let patience = Patience { admission, end };
    let sent = py.detach(|| link::publish(plan, robot, root, join, patience, &mut told));
    let id = sent.map_err(raise)?;
    told.failed.map_or(Ok(id.to_string()), Err)
}
