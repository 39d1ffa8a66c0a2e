//! What long work tells, for a callback and for Python's log.

use std::sync::Mutex;
use std::time::{Duration, Instant};

use nullsweep_planner::progress::Progress;
use pyo3::prelude::*;

/// Time between two calls of the callback within a stage.
const OFTEN: Duration = Duration::from_millis(50);

/// Calls `progress(stage, done, total)`, at most 20 times a second within a stage, and warns of what was
/// taken to be so.
pub(crate) struct Listener {
    progress: Option<Py<PyAny>>,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    stage: &'static str,
    done: usize,
    total: Option<usize>,
    called: Option<Instant>,
    notes: Vec<String>,
    failed: Option<PyErr>,
}

impl Listener {
    pub(crate) fn new(progress: Option<Py<PyAny>>) -> Self {
        Self { progress, state: Mutex::default() }
    }

    /// What was noted.
    ///
    /// # Errors
    /// What the callback raised: it was not called again.
    pub(crate) fn notes(&self) -> PyResult<Vec<String>> {
        let Ok(mut state) = self.state.lock() else { return Ok(Vec::new()) };
        state.failed.take().map_or(Ok(()), Err)?;
        Ok(std::mem::take(&mut state.notes))
    }

    fn call(&self, (stage, done, total): (&'static str, usize, Option<usize>)) {
        let Some(progress) = &self.progress else { return };
        let called = Python::attach(|py| progress.call1(py, (stage, done, total)).map(|_| ()));
        if let (Err(error), Ok(mut state)) = (called, self.state.lock()) {
            state.failed.get_or_insert(error);
        }
    }
}

impl Progress for Listener {
    fn stage(&self, name: &'static str, total: Option<usize>) {
        let Ok(mut state) = self.state.lock() else { return };
        (state.stage, state.done, state.total) = (name, 0, total);
        state.called = Some(Instant::now());
        let is_deaf = state.failed.is_some();
        drop(state);
        // The lock is not held while Python's is waited for.
        if !is_deaf {
            self.call((name, 0, total));
        }
    }

    fn tick(&self) {
        let Ok(mut state) = self.state.lock() else { return };
        state.done += 1;
        let last = Some(state.done) == state.total;
        let is_due = last || state.called.is_none_or(|at| at.elapsed() >= OFTEN);
        if !is_due || state.failed.is_some() || self.progress.is_none() {
            return;
        }
        state.called = Some(Instant::now());
        let told = (state.stage, state.done, state.total);
        drop(state);
        self.call(told);
    }

    fn note(&self, text: &str) {
        if let Ok(mut state) = self.state.lock() {
            state.notes.push(text.to_owned());
        }
        Python::attach(|py| {
            let warn = || {
                let log = py.import("logging")?.call_method1("getLogger", ("nullsweep",))?;
                log.call_method1("warning", ("%s", text))
            };
            // A log that cannot be written stops no plan.
            let _: PyResult<Bound<'_, PyAny>> = warn();
        });
    }
}
