//! A plan.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::PathBuf;
use std::sync::Arc;

use nullsweep_cli::calls::{self, Planned};
use nullsweep_planner::plan::export::{Format, write};
use nullsweep_planner::plan::{self, PlanKnot};
use nullsweep_planner::verify::Violation;
use nullsweep_report as report;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;

use crate::arrays::{of_joints, of_points};
use crate::cell::Cell;
use crate::errors::{BrokenPlanError, Error, UsageError, file, raise, raised};
use crate::listener::Listener;
use crate::scan::Scan;

/// A timed joint path that sweeps a surface.
#[pyclass(frozen, module = "nullsweep")]
pub(crate) struct Plan {
    plan: Arc<plan::Plan>,
    made: Option<Planned>,
    notes: Vec<String>,
}

impl Plan {
    pub(crate) fn made(made: Planned, notes: Vec<String>) -> Self {
        Self { plan: Arc::new(made.plan.clone()), made: Some(made), notes }
    }

    pub(crate) fn inner(&self) -> &plan::Plan {
        &self.plan
    }

    fn joints_of<'py>(
        &self,
        py: Python<'py>,
        of: impl Fn(&PlanKnot) -> nullsweep_robot::JointVector,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        of_joints(py, self.plan.knots.iter().map(of), self.plan.joints.len())
    }

    /// The page that shows it, where it is known what it was made for.
    fn page(&self) -> PyResult<report::ReportData> {
        let made = self.made.as_ref().ok_or_else(|| {
            Error::new_err(
                "a plan from a file does not hold its scene: verify(scan, cell) gives one that can be \
                 shown",
            )
        })?;
        made.page().map_err(raised)
    }
}

#[pymethods]
impl Plan {
    /// Reads a plan file.
    #[staticmethod]
    fn read(path: PathBuf) -> PyResult<Self> {
        let plan = plan::Plan::read(&path).map_err(raise)?;
        Ok(Self { plan: Arc::new(plan), made: None, notes: Vec::new() })
    }

    /// Writes it as a plan file.
    fn write(&self, path: PathBuf) -> PyResult<()> {
        self.plan.write(&path).map_err(raise)
    }

    #[getter]
    fn robot(&self) -> &str {
        &self.plan.robot
    }

    /// The joints' names, base to tip.
    #[getter]
    fn joints(&self) -> Vec<String> {
        self.plan.joints.clone()
    }

    /// The robot's root frame in the floor frame: x, y \[m\], yaw \[rad\].
    #[getter]
    fn base(&self) -> [f64; 3] {
        self.plan.base
    }

    /// Joints outside the arm, where they are held. \[rad\] or \[m\]
    #[getter]
    fn held(&self) -> std::collections::BTreeMap<String, f64> {
        self.plan.held.iter().map(|h| (h.name.clone(), h.position)).collect()
    }

    #[getter]
    fn seed(&self) -> u64 {
        self.plan.seed
    }

    /// How long it takes at full speed. \[s\]
    #[getter]
    fn duration(&self) -> f64 {
        self.plan.duration()
    }

    /// When each knot is, (n,). \[s\]
    #[getter]
    fn times<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.plan.knots.iter().map(|k| k.time_ns as f64 * 1e-9))
    }

    /// Joint vectors of the knots, (n, joints). \[rad\] or \[m\]
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.joints_of(py, |k| k.q)
    }

    /// Their velocities, (n, joints); 0 in a plan of bang-bang velocity. \[rad/s\] or \[m/s\]
    #[getter]
    fn velocities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.joints_of(py, |k| k.v)
    }

    /// The planned centre of the pad in the root frame, (n, 3); NaN off the surface. \[m\]
    #[getter]
    fn line<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        of_points(py, self.plan.knots.iter().map(|k| k.line.unwrap_or([f64::NAN; 3])))
    }

    /// The patch that is reached in each knot, (n,); −1 for none.
    #[getter]
    fn patch<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        PyArray1::from_iter(py, self.plan.knots.iter().map(|k| k.patch.map_or(-1, i64::from)))
    }

    /// The points to sweep in the root frame, (m, 3). \[m\]
    #[getter]
    fn surface<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        of_points(py, self.plan.surface.iter().map(|s| s.point))
    }

    /// Whether each of those belongs to a patch that can be reached, (m,).
    #[getter]
    fn reachable<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        PyArray1::from_iter(py, self.plan.surface.iter().map(|s| s.reachable))
    }

    /// Whether it is as it was verified.
    #[getter]
    fn is_verified(&self) -> bool {
        self.plan.check_seal().is_ok()
    }

    /// Every figure of the run, as `--json` writes them; of a plan from a file none.
    #[getter]
    fn figures<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let text = self.made.as_ref().map_or("{}", |made| made.figures.as_str());
        py.import("json")?.call_method1("loads", (text,))
    }

    /// What it breaks, a line each.
    #[getter]
    fn violations(&self) -> Vec<String> {
        let line = |v: &Violation| format!("knot {}: {:?}: {}", v.knot, v.kind, v.detail);
        self.made.iter().flat_map(|made| made.violations.iter().map(line)).collect()
    }

    /// What was taken to be so while it was made.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    /// Checks it against a scan, or against the floor alone: the same plan as verified, with what was
    /// found as its figures.
    #[pyo3(signature = (scan=None, cell=None, *, progress=None))]
    fn verify(
        &self,
        py: Python<'_>,
        scan: Option<&Scan>,
        cell: Option<&Cell>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Py<Self>> {
        let cell = cell.map_or_else(|| Cell::default_one().of_robot(), Cell::of_robot);
        let words = scan.map_or_else(|| cell.clone(), |scan| scan.before(&cell));
        let plan = Arc::clone(&self.plan);
        make(py, progress, move |told| calls::verify(&words, &plan, told))
    }

    /// Writes it for other programs: `csv`, `json`, `ros-yaml` or `ros2-yaml`; without a path as text.
    #[pyo3(signature = (path=None, *, format="csv"))]
    fn export(&self, path: Option<PathBuf>, format: &str) -> PyResult<Option<String>> {
        let format = match format {
            "csv" => Format::Csv,
            "json" => Format::Json,
            "ros-yaml" => Format::RosYaml,
            "ros2-yaml" => Format::Ros2Yaml,
            other => {
                let why = format!("format: {other} is none of csv, json, ros-yaml, ros2-yaml");
                return Err(UsageError::new_err(why));
            }
        };
        let Some(path) = path else {
            let mut text = Vec::new();
            write(&self.plan, format, &mut text).map_err(raise)?;
            return Ok(Some(String::from_utf8_lossy(&text).into_owned()));
        };
        let written = File::create(&path).and_then(|file| {
            let mut out = BufWriter::new(file);
            write(&self.plan, format, &mut out)?;
            out.flush()
        });
        written.map_err(|error| file(&path, &error))?;
        Ok(None)
    }

    /// Writes a page that shows it; without a path as text.
    #[pyo3(signature = (path=None))]
    fn report(&self, py: Python<'_>, path: Option<PathBuf>) -> PyResult<Option<String>> {
        let page = self.page()?;
        py.detach(|| match path {
            None => report::render(&page).map(Some),
            Some(path) => report::write(&path, &page).map(|()| None),
        })
        .map_err(raise)
    }

    /// The page in a frame, as a notebook shows it; of a plan from a file its figures.
    fn _repr_html_(&self) -> PyResult<String> {
        if self.made.is_none() {
            return Ok(format!("<pre>{}</pre>", escaped(&self.__repr__())));
        }
        let page = report::render(&self.page()?).map_err(raise)?;
        Ok(format!(
            "<iframe style=\"width:100%;height:640px;border:0\" sandbox=\"allow-scripts\" \
             srcdoc=\"{}\"></iframe>",
            escaped(&page)
        ))
    }

    fn __len__(&self) -> usize {
        self.plan.knots.len()
    }

    fn __repr__(&self) -> String {
        let (plan, seal) = (&self.plan, if self.is_verified() { "" } else { ", not verified" });
        let (joints, knots) = (plan.joints.len(), plan.knots.len());
        let seconds = plan.duration();
        format!("Plan({}, {joints} joints, {knots} knots, {seconds:.1} s{seal})", plan.robot)
    }
}

/// Text as it stands within an attribute or an element.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('"', "&quot;").replace('<', "&lt;")
}

/// A plan, without Python's lock while it is made.
pub(crate) fn make(
    py: Python<'_>,
    progress: Option<Py<PyAny>>,
    work: impl FnOnce(calls::Listener) -> anyhow::Result<Planned> + Send,
) -> PyResult<Py<Plan>> {
    let listener = Arc::new(Listener::new(progress));
    let told: calls::Listener = Arc::clone(&listener) as calls::Listener;
    let made = py.detach(|| work(told)).map_err(raised);
    let notes = listener.notes()?;
    let made = made?;
    let broken: Vec<String> = made
        .violations
        .iter()
        .map(|v| format!("violation at knot {}: {:?}: {}", v.knot, v.kind, v.detail))
        .collect();
    let plan = Py::new(py, Plan::made(made, notes))?;
    if broken.is_empty() {
        return Ok(plan);
    }
    let error = BrokenPlanError::new_err(format!("the plan breaks {} rules", broken.len()));
    error.value(py).setattr("plan", plan)?;
    error.value(py).setattr("violations", broken)?;
    Err(error)
}
