//! Making plans.

use std::ffi::OsString;

use nullsweep_cli::calls;
use nullsweep_planner::pipeline::After;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays;
use crate::cell::Cell;
use crate::keywords::Keywords;
use crate::plan::{Plan, make};
use crate::scan::Scan;
use crate::words;

/// Makes a verified plan that sweeps a scan. Keywords beside these are `planner plan`'s flags.
#[pyfunction]
#[pyo3(signature = (scan, cell=None, *, progress=None, after=None, **settings))]
pub(crate) fn plan(
    py: Python<'_>,
    scan: &Scan,
    cell: Option<&Cell>,
    progress: Option<Py<PyAny>>,
    after: Option<(PyRef<'_, Plan>, usize)>,
    settings: Option<&Bound<'_, PyDict>>,
) -> PyResult<Py<Plan>> {
    let settings = Keywords::of(py, settings)?;
    // As a flag it asks for a plan's file.
    let again = settings.take("again", false)?;
    let after =
        after.map(|(plan, knot)| After { plan: plan.inner().clone(), knot, held: None, again });
    if again && after.is_none() {
        return Err(PyTypeError::new_err("again: with after=(plan, knot) alone"));
    }
    let cell = cell.map_or_else(|| Cell::default_one().of_plan(), Cell::of_plan);
    let words = scan.before(&[cell, words::of(Some(&settings.rest()))?].concat());
    make(py, progress, |told| calls::plan(&words, after, told))
}

/// Makes a verified plan along a given path of the tool in the robot's root frame: poses in their order,
/// or several such segments. Keywords beside these are `planner follow`'s flags.
#[pyfunction]
#[pyo3(signature = (path, cell=None, *, scan=None, progress=None, **settings))]
pub(crate) fn follow(
    py: Python<'_>,
    path: &Bound<'_, PyAny>,
    cell: Option<&Cell>,
    scan: Option<&Scan>,
    progress: Option<Py<PyAny>>,
    settings: Option<&Bound<'_, PyDict>>,
) -> PyResult<Py<Plan>> {
    let segments = arrays::segments(path)?;
    let words = around(cell, scan, settings)?;
    make(py, progress, |told| calls::follow(&words, segments, told))
}

/// Makes a verified plan through given poses of the tool in the robot's root frame. Keywords beside
/// these are `planner task`'s flags.
#[pyfunction]
#[pyo3(signature = (poses, cell=None, *, scan=None, progress=None, **settings))]
pub(crate) fn task(
    py: Python<'_>,
    poses: &Bound<'_, PyAny>,
    cell: Option<&Cell>,
    scan: Option<&Scan>,
    progress: Option<Py<PyAny>>,
    settings: Option<&Bound<'_, PyDict>>,
) -> PyResult<Py<Plan>> {
    let poses = arrays::poses(poses)?.rows;
    let words = around(cell, scan, settings)?;
    make(py, progress, |told| calls::task(&words, poses, told))
}

/// The words of a command that goes through given poses.
fn around(
    cell: Option<&Cell>,
    scan: Option<&Scan>,
    settings: Option<&Bound<'_, PyDict>>,
) -> PyResult<Vec<OsString>> {
    let cell = cell.map_or_else(|| Cell::default_one().of_plan(), Cell::of_plan);
    let scan = scan.map_or(Ok(Vec::new()), Scan::around)?;
    Ok([cell, words::of(settings)?, scan].concat())
}
