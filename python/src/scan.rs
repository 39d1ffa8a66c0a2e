//! What is to be swept and what is around it.

use std::ffi::OsString;
use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;

use nullsweep_cli::calls;
use nullsweep_planner::workcell;
use numpy::{PyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use tempfile::TempPath;

use crate::arrays::{numbers, of_points, xyz};
use crate::cell::Cell;
use crate::errors::{UsageError, raise, raised, shape};
use crate::listener::Listener;
use crate::words;

/// Scans: files, or arrays of points, and how they stand.
#[pyclass(frozen, module = "nullsweep")]
pub(crate) struct Scan {
    words: Vec<OsString>,
    files: Vec<PathBuf>,
    /// Arrays, as files for as long as this lives: what reads a file reads them.
    _kept: Vec<TempPath>,
}

#[pymethods]
impl Scan {
    #[new]
    #[pyo3(signature = (*scans, **keywords))]
    fn new(scans: &Bound<'_, PyTuple>, keywords: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        if scans.is_empty() {
            return Err(UsageError::new_err("a scan is a file or an array of points: give one"));
        }
        let (mut files, mut kept) = (Vec::new(), Vec::new());
        for scan in scans {
            if let Ok(path) = scan.extract::<PathBuf>() {
                files.push(path);
            } else {
                let path = written(&scan)?;
                files.push(path.to_path_buf());
                kept.push(path);
            }
        }
        Ok(Self { words: words::of(keywords)?, files, _kept: kept })
    }

    /// A simulated one: `chair`, `chair-seat`, `bobby-car` or `car-door`.
    #[staticmethod]
    #[pyo3(signature = (name, **keywords))]
    fn demo(name: &str, keywords: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let mut words = words::of(keywords)?;
        words.push(format!("--demo={name}").into());
        Ok(Self { words, files: Vec::new(), _kept: Vec::new() })
    }

    /// As the planner sees it: placed, joined and cleaned.
    #[pyo3(signature = (cell=None, *, seed=1))]
    fn scene(&self, py: Python<'_>, cell: Option<&Cell>, seed: u64) -> PyResult<Scene> {
        let cell = cell.map_or_else(|| Cell::default_one().of_plan(), Cell::of_plan);
        let words = self.before(&[cell, vec![format!("--seed={seed}").into()]].concat());
        let listener = Arc::new(Listener::new(None));
        let told = Arc::clone(&listener);
        let scene = py.detach(|| calls::scene(&words, told)).map_err(raised)?;
        Ok(Scene { scene, notes: listener.notes()? })
    }

    fn __repr__(&self) -> String {
        let words: Vec<_> = self.words.iter().map(|word| word.to_string_lossy()).collect();
        let files: Vec<_> = self.files.iter().map(|file| file.display().to_string()).collect();
        format!("Scan({})", [files.join(", "), words.join(" ")].join(" "))
    }
}

impl Scan {
    /// The words of a command with this scan's: flags, and the files behind them.
    pub(crate) fn before(&self, words: &[OsString]) -> Vec<OsString> {
        let files = self.files.iter().map(|file| file.clone().into_os_string());
        let files = std::iter::once("--".into()).chain(files);
        words.iter().chain(&self.words).cloned().chain(files).collect()
    }
}

impl Scan {
    /// The words of `planner task`, which has what is around the arm behind `--scene`.
    pub(crate) fn around(&self) -> PyResult<Vec<OsString>> {
        if self.files.is_empty() {
            return Err(UsageError::new_err("scan: what is around given poses is files or arrays"));
        }
        let files = self.files.iter().map(|file| {
            let mut word = OsString::from("--scene=");
            word.push(file);
            word
        });
        Ok(self.words.iter().cloned().chain(files).collect())
    }
}

/// An array as a file of numpy's.
fn written(points: &Bound<'_, PyAny>) -> PyResult<TempPath> {
    let array = numbers(points)?;
    let found = array.shape();
    if !matches!(found, [_, columns] if *columns >= 3) {
        return Err(shape("points", "(n, 3)", found));
    }
    let (rows, columns) = (found[0], found[1]);
    let file = tempfile::Builder::new().prefix("nullsweep-points-").suffix(".npy").tempfile();
    let mut file = file.map_err(raise)?;
    let head =
        format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({rows}, {columns}), }}");
    // The header ends at a multiple of 64 bytes, with a line's end.
    let length = (head.len() + 1 + 10).next_multiple_of(64) - 10;
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((length as u16).to_le_bytes());
    bytes.extend(format!("{head:<width$}\n", width = length - 1).into_bytes());
    bytes.extend(array.as_slice()?.iter().flat_map(|x| x.to_le_bytes()));
    file.write_all(&bytes).map_err(raise)?;
    Ok(file.into_temp_path())
}

/// A scene in the floor frame: z up, the floor at z = 0. \[m\]
#[pyclass(frozen, module = "nullsweep")]
pub(crate) struct Scene {
    scene: workcell::Scene,
    #[pyo3(get)]
    notes: Vec<String>,
}

#[pymethods]
impl Scene {
    /// Points of the surface to sweep, (n, 3).
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        of_points(py, self.scene.surface.points.iter().map(xyz))
    }

    /// Their normals, outward, (n, 3).
    #[getter]
    fn normals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        of_points(py, self.scene.surface.normals.iter().map(|n| n.into_inner().into()))
    }

    /// Points of all else that was measured, (n, 3).
    #[getter]
    fn surroundings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        of_points(py, self.scene.surroundings.iter().map(xyz))
    }

    /// Points on the border of what no view has seen, (n, 3).
    #[getter]
    fn unseen<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        of_points(py, self.scene.unseen.iter().map(xyz))
    }

    fn __repr__(&self) -> String {
        format!("Scene({} points to sweep)", self.scene.surface.points.len())
    }
}
