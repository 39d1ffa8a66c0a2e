//! Keywords as a command's words: `ik_samples=20` is `--ik-samples=20`.

use std::ffi::{OsStr, OsString};
use std::path::PathBuf;

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyString};

use crate::errors::UsageError;

/// Flags of a command alone: what it writes is returned here, and what it reads is given otherwise.
const ELSEWHERE: [&str; 14] = [
    "out", "json", "report", "cell", "continue", "help", "version", "quat", "offset", "stops", "arms",
    "together", "jobs", "job",
];

/// Each keyword as a flag; `None` and `False` say nothing, `True` is a flag without a value, of a
/// dictionary each item is NAME=VALUE, numbers of a sequence stand apart by commas, and a sequence of
/// other things is a flag that is given several times.
pub(crate) fn of(keywords: Option<&Bound<'_, PyDict>>) -> PyResult<Vec<OsString>> {
    let mut words = Vec::new();
    for (name, value) in keywords.into_iter().flatten() {
        let name: String = name.extract()?;
        if ELSEWHERE.contains(&name.as_str()) {
            return Err(UsageError::new_err(format!(
                "{name}: a command has it, a function has not"
            )));
        }
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
    // With numbers among them they are one value; other things are several.
    let items = value.try_iter()?.collect::<PyResult<Vec<_>>>()?;
    let is_number = |item: &Bound<'_, PyAny>| item.extract::<f64>().is_ok();
    if items.iter().any(is_number) {
        return Ok(vec![Some(word(name, value)?)]);
    }
    items.iter().map(|item| word(name, item).map(Some)).collect()
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
    let wanted =
        || PyTypeError::new_err(format!("{name}: text, a number, a path or numbers are wanted"));
    let items = value.try_iter().map_err(|_| wanted())?;
    let part = |item: PyResult<Bound<'_, PyAny>>| single(&item?).ok_or_else(wanted);
    let parts = items.map(part).collect::<PyResult<Vec<_>>>()?;
    Ok(parts.join(OsStr::new(if name == "table" { "x" } else { "," })))
}
