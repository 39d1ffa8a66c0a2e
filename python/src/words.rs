//! Keywords as a command's words: `ik_samples=20` is `--ik-samples=20`.

use std::ffi::OsString;
use std::path::PathBuf;

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyString};

/// Each keyword as a flag; `None` and `False` say nothing, `True` is a flag without a value, of a
/// dictionary each item is NAME=VALUE, numbers of a sequence stand apart by commas, and a sequence of
/// other things is a flag that is given several times.
pub(crate) fn of(keywords: Option<&Bound<'_, PyDict>>) -> PyResult<Vec<OsString>> {
    let mut words = Vec::new();
    for (name, value) in keywords.into_iter().flatten() {
        let name: String = name.extract()?;
        for value in values(&name, &value)? {
            let mut word = OsString::from(format!("--{}", name.replace('_', "-")));
            if let Some(value) = value {
                word.push("=");
                word.push(value);
            }
            words.push(word);
        }
    }
    Ok(words)
}

/// The words of a flag's values, or none where it is given without.
fn values(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<Option<OsString>>> {
    if value.is_none() {
        return Ok(Vec::new());
    }
    if let Ok(flag) = value.cast::<PyBool>() {
        return Ok(if flag.is_true() { vec![None] } else { Vec::new() });
    }
    if let Ok(named) = value.cast::<PyDict>() {
        let pair = |(key, value): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
            let mut pair = OsString::from(format!("{}=", key.extract::<String>()?));
            pair.push(word(name, &value)?);
            Ok(Some(pair))
        };
        return named.iter().map(pair).collect();
    }
    if let Some(single) = single(value) {
        return Ok(vec![Some(single)]);
    }
    // Numbers are one value, of whatever they consist; other things are several.
    if value.extract::<Vec<f64>>().is_ok() {
        return Ok(vec![Some(word(name, value)?)]);
    }
    let each = |item: PyResult<Bound<'_, PyAny>>| word(name, &item?).map(Some);
    value.try_iter()?.map(each).collect()
}

/// Text, a number or a path.
fn single(value: &Bound<'_, PyAny>) -> Option<OsString> {
    if value.is_instance_of::<PyString>() {
        return Some(value.extract::<String>().ok()?.into());
    }
    if let Ok(whole) = value.extract::<i64>() {
        return Some(whole.to_string().into());
    }
    // As many digits as bring the number back.
    if let Ok(number) = value.extract::<f64>() {
        return Some(number.to_string().into());
    }
    value.extract::<PathBuf>().ok().map(PathBuf::into_os_string)
}

/// One value's word.
fn word(name: &str, value: &Bound<'_, PyAny>) -> PyResult<OsString> {
    if let Some(single) = single(value) {
        return Ok(single);
    }
    let numbers: Vec<f64> = value.extract().map_err(|_| {
        PyTypeError::new_err(format!("{name}: text, a number, a path or numbers are wanted"))
    })?;
    let apart = if name == "table" { "x" } else { "," };
    let numbers: Vec<String> = numbers.iter().map(f64::to_string).collect();
    Ok(numbers.join(apart).into())
}
