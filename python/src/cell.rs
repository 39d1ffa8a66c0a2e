//! Which robot is meant, with which tool, and where its executor is.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use nullsweep_cli::calls;
use nullsweep_ipc_types::service::DEFAULT_ROBOT;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arm::Arm;
use crate::errors::{UsageError, raise, raised};
use crate::words;

/// Keywords that say which robot it is and what its links look like.
const ROBOT: [&str; 6] = ["urdf", "arm", "package", "fit_capsules", "srdf", "posture"];
/// Keywords that say how it stands there.
const STANCE: [&str; 3] = ["tool", "torso", "held"];

/// A robot in its place: from a cell file, by keywords, or both, and keywords win.
#[pyclass(frozen, module = "nullsweep")]
pub(crate) struct Cell {
    path: PathBuf,
    robot: Vec<OsString>,
    stance: Vec<OsString>,
    robot_name: String,
    ipc_root: Option<PathBuf>,
}

#[pymethods]
impl Cell {
    #[new]
    #[pyo3(signature = (path=None, *, robot_name=None, ipc_root=None, **keywords))]
    fn new(
        path: Option<PathBuf>,
        robot_name: Option<String>,
        ipc_root: Option<PathBuf>,
        keywords: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        if let Some(keywords) = keywords {
            for name in keywords.keys() {
                let name: String = name.extract()?;
                if !ROBOT.contains(&name.as_str()) && !STANCE.contains(&name.as_str()) {
                    let known = [&ROBOT[..], &STANCE[..]].concat().join(", ");
                    let why =
                        format!("a cell has no {name}: it has {known}, robot_name and ipc_root");
                    return Err(UsageError::new_err(why));
                }
            }
        }
        let of = |names: &[&str]| -> PyResult<Vec<OsString>> {
            let Some(keywords) = keywords else { return Ok(Vec::new()) };
            let own = PyDict::new(keywords.py());
            for name in names {
                if let Some(value) = keywords.get_item(name)? {
                    own.set_item(name, value)?;
                }
            }
            words::of(Some(&own))
        };
        let file = path.as_deref().map(nullsweep_cell::Cell::read).transpose().map_err(raise)?;
        let file = file.unwrap_or_default();
        Ok(Self {
            path: path.unwrap_or_default(),
            robot: of(&ROBOT)?,
            stance: of(&STANCE)?,
            robot_name: robot_name.or(file.robot).unwrap_or_else(|| DEFAULT_ROBOT.into()),
            ipc_root: ipc_root.or(file.ipc_root),
        })
    }

    /// The arm's kinematics.
    #[getter]
    fn arm(&self) -> PyResult<Arm> {
        let words = [self.file(), self.robot.clone(), self.stance.clone()].concat();
        let (arm, tool) = calls::arm(&words).map_err(raised)?;
        Ok(Arm::new(arm, &tool))
    }

    /// The robot's name in the services' names.
    #[getter]
    pub(crate) fn robot_name(&self) -> &str {
        &self.robot_name
    }

    /// iceoryx2's root path, if it is not the default.
    #[getter]
    fn ipc_root(&self) -> Option<&Path> {
        self.ipc_root.as_deref()
    }

    fn __repr__(&self) -> String {
        let words = [self.robot.clone(), self.stance.clone()].concat();
        let words: Vec<_> = words.iter().map(|word| word.to_string_lossy()).collect();
        format!("Cell({:?}, {:?}, {})", self.path, self.robot_name, words.join(" "))
    }
}

impl Cell {
    /// The PR2's right arm.
    pub(crate) fn default_one() -> Self {
        Self {
            path: PathBuf::new(),
            robot: Vec::new(),
            stance: Vec::new(),
            robot_name: DEFAULT_ROBOT.into(),
            ipc_root: None,
        }
    }

    /// Words that name the cell file; without one, that none is looked for.
    fn file(&self) -> Vec<OsString> {
        let mut word = OsString::from("--cell=");
        word.push(&self.path);
        vec![word]
    }

    /// For what knows the robot alone.
    pub(crate) fn of_robot(&self) -> Vec<OsString> {
        [self.file(), self.robot.clone()].concat()
    }

    /// For what makes a plan.
    pub(crate) fn of_plan(&self) -> Vec<OsString> {
        let mut site = vec![format!("--robot-name={}", self.robot_name).into()];
        if let Some(root) = &self.ipc_root {
            let mut word = OsString::from("--ipc-root=");
            word.push(root);
            site.push(word);
        }
        [self.of_robot(), self.stance.clone(), site].concat()
    }

    pub(crate) fn root(&self) -> Option<&Path> {
        self.ipc_root.as_deref()
    }
}
