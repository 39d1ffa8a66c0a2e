//! Errors as exceptions, in the command line's words.

use nullsweep_cli::calls;
use pyo3::exceptions::{PyException, PyOSError, PyTypeError};
use pyo3::prelude::*;
use pyo3::{PyTypeInfo, create_exception};

create_exception!(nullsweep, Error, PyException, "What nullsweep cannot do, and why.");
create_exception!(nullsweep, UsageError, Error, "A keyword or a value that cannot be.");
create_exception!(
    nullsweep,
    BrokenPlanError,
    Error,
    "A plan was made that breaks a rule: `plan` is that plan, for looking at; `violations` says what it \
     breaks, a line each."
);
create_exception!(
    nullsweep,
    LostError,
    Error,
    "The executor was lost while its answer or a plan's end was waited for."
);

pub(crate) fn add(py: Python<'_>, module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("Error", Error::type_object(py))?;
    module.add("UsageError", UsageError::type_object(py))?;
    module.add("BrokenPlanError", BrokenPlanError::type_object(py))?;
    module.add("LostError", LostError::type_object(py))
}

/// An error of the planner's as an exception. One that is Python's own, from a callback, is told as it
/// is.
pub(crate) fn raised(error: anyhow::Error) -> PyErr {
    let error = match error.downcast::<PyErr>() {
        Ok(own) => return own,
        Err(error) => error,
    };
    let text = calls::told(&error);
    match calls::code(&error) {
        nullsweep_cli::USAGE => UsageError::new_err(text),
        nullsweep_cli::LOST => LostError::new_err(text),
        _ => Error::new_err(text),
    }
}

/// The same of any error.
pub(crate) fn raise(error: impl Into<anyhow::Error>) -> PyErr {
    raised(error.into())
}

/// A file that cannot be read or written.
pub(crate) fn file(path: &std::path::Path, error: &std::io::Error) -> PyErr {
    PyOSError::new_err(format!("cannot write {}: {error}", path.display()))
}

/// An argument of another shape than is wanted.
pub(crate) fn shape(what: &str, wanted: &str, found: &[usize]) -> PyErr {
    PyTypeError::new_err(format!("{what}: an array of {wanted} is wanted, not of shape {found:?}"))
}
