//! A function's keywords, taken one by one.

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Keywords that were given.
pub(crate) struct Keywords<'py>(Bound<'py, PyDict>);

impl<'py> Keywords<'py> {
    pub(crate) fn of(py: Python<'py>, given: Option<&Bound<'py, PyDict>>) -> PyResult<Self> {
        Ok(Self(given.map_or_else(|| Ok(PyDict::new(py)), |given| given.copy())?))
    }

    /// One of them, or what it is where it was not given.
    pub(crate) fn take<T>(&self, name: &str, default: T) -> PyResult<T>
    where
        T: FromPyObjectOwned<'py>,
    {
        let Some(value) = self.0.get_item(name)? else { return Ok(default) };
        self.0.del_item(name)?;
        let read: PyResult<T> = value.extract::<T>().map_err(Into::into);
        read.map_err(|why| PyTypeError::new_err(format!("{name}: {}", why.value(self.0.py()))))
    }

    /// Those that were not taken.
    pub(crate) fn rest(self) -> Bound<'py, PyDict> {
        self.0
    }

    /// # Errors
    /// There are some that were not taken.
    pub(crate) fn end(self) -> PyResult<()> {
        match self.0.keys().iter().next() {
            None => Ok(()),
            Some(name) => Err(PyTypeError::new_err(format!("there is no keyword {name}"))),
        }
    }
}
