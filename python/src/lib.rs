//! Nullsweep for Python. What a command of `planner` is told by flags is told here by keywords, which
//! mean the same: they are read by the same parser, so that a word, a default and an error are the same
//! in both.
#![allow(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "`!(x <= bound)` is how a NaN falls on the safe side"
)]

mod arm;
mod arrays;
mod cell;
mod errors;
mod executor;
mod gtsp;
mod keywords;
mod listener;
mod plan;
mod planning;
mod publish;
mod scan;
mod words;

use pyo3::prelude::*;

#[pymodule]
fn _nullsweep(py: Python<'_>, module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    errors::add(py, module)?;
    module.add_class::<scan::Scan>()?;
    module.add_class::<scan::Scene>()?;
    module.add_class::<cell::Cell>()?;
    module.add_class::<arm::Arm>()?;
    module.add_class::<arm::Solutions>()?;
    module.add_class::<plan::Plan>()?;
    module.add_class::<gtsp::Solution>()?;
    module.add_class::<executor::Executor>()?;
    module.add_class::<executor::Telemetry>()?;
    module.add_class::<executor::Status>()?;
    module.add_function(wrap_pyfunction!(planning::plan, module)?)?;
    module.add_function(wrap_pyfunction!(planning::task, module)?)?;
    module.add_function(wrap_pyfunction!(planning::follow, module)?)?;
    module.add_function(wrap_pyfunction!(publish::publish, module)?)?;
    module.add_function(wrap_pyfunction!(gtsp::solve, module)?)?;
    module.add_function(wrap_pyfunction!(gtsp::read, module)?)?;
    Ok(())
}
