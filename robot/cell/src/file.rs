//! The cell file.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;

/// The name that is looked for.
pub const FILE_NAME: &str = "cell.toml";

/// A robot in its place, as a cell file has it. Paths are those of the file, relative to its folder.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cell {
    /// Name of the robot in the services' names.
    pub robot: Option<String>,
    /// Root path of iceoryx2.
    pub ipc_root: Option<PathBuf>,
    /// The robot's URDF.
    pub urdf: Option<PathBuf>,
    /// `right` or `left` of the PR2, else base and tip link, BASE,TIP.
    pub arm: Option<String>,
    /// The tool's file.
    pub tool: Option<PathBuf>,
    /// The robot's SRDF.
    pub srdf: Option<PathBuf>,
    /// Radius of capsules in place of missing meshes. \[m\]
    pub fit_capsules: Option<f64>,
    /// The program that is the hardware's endpoint, with its arguments.
    pub endpoint: Option<Vec<String>>,
    /// Folders of ROS packages by name.
    #[serde(default)]
    pub packages: BTreeMap<String, PathBuf>,
    /// Positions of joints outside the arm. \[rad\] or \[m\]
    #[serde(default)]
    pub held: BTreeMap<String, f64>,
    /// Joint vectors of the arm by name. \[rad\] or \[m\]
    #[serde(default)]
    pub postures: BTreeMap<String, Vec<f64>>,
    /// How fast the arm may be.
    #[serde(default)]
    pub limits: Limits,
    /// What is around the robot.
    #[serde(default)]
    pub scene: Scene,
    /// How the executor runs.
    #[serde(default)]
    pub executor: Executor,
}

/// How fast the arm may be.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// One velocity for all joints, where the robot's own limits are higher. \[rad/s\]
    pub v_max: Option<f64>,
    /// `velocity`, `acceleration` or `jerk`.
    pub profile: Option<String>,
}

/// How scans stand, and what is around them.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Where the robot stands in the floor frame: x, y \[m\], yaw \[rad\], and, where it is raised
    /// above the floor, z \[m\].
    pub base: Option<Vec<f64>>,
    /// Direction against gravity in the scans' frame.
    pub up: Option<[f64; 3]>,
    /// Height of the sensor above what the object stands on. \[m\]
    pub sensor_height: Option<f64>,
    /// Height above the floor of what the object stands on. \[m\]
    pub support_height: Option<f64>,
    /// Size of the table's top. \[m\]
    pub table: Option<[f64; 2]>,
    /// What unseen space is: `avoid`, `forbid` or `free`.
    pub unseen: Option<String>,
    /// Factor from the files' unit to metres.
    pub scale: Option<f64>,
}

/// How the executor runs.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Executor {
    /// Cycles a second.
    pub rate: Option<u32>,
    /// The CPU of the loop.
    pub cpu: Option<u32>,
    /// SCHED_FIFO priority of the loop.
    pub priority: Option<u8>,
    /// Folder of the flight recorder.
    pub record: Option<PathBuf>,
}

/// Why a cell file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CellError {
    /// It cannot be read.
    #[error("cannot read the cell file {}: {error}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        error: std::io::Error,
    },
    /// It is no cell file.
    #[error("the cell file {}: {}", path.display(), error.to_string().trim_end())]
    Parse {
        /// The file.
        path: PathBuf,
        /// Line, column and what is wrong there.
        error: Box<toml::de::Error>,
    },
    /// A value in it can mean nothing.
    #[error("the cell file {}: {key}: {why}", path.display())]
    Value {
        /// The file.
        path: PathBuf,
        /// Table and key.
        key: &'static str,
        /// What was found, and what is wanted.
        why: String,
    },
}

impl Cell {
    /// The nearest cell file in a folder or above it.
    #[must_use]
    pub fn find(folder: &Path) -> Option<PathBuf> {
        folder.ancestors().map(|above| above.join(FILE_NAME)).find(|path| path.is_file())
    }

    /// Reads a cell file; its paths are from the file's folder on.
    ///
    /// # Errors
    /// Names the file, and line and column, or table and key, of what is wrong in it.
    pub fn read(path: &Path) -> Result<Self, CellError> {
        let text = std::fs::read_to_string(path)
            .map_err(|error| CellError::Read { path: path.into(), error })?;
        let cell: Self = toml::from_str(&text)
            .map_err(|error| CellError::Parse { path: path.into(), error: Box::new(error) })?;
        let value = |(key, why)| CellError::Value { path: path.into(), key, why };
        cell.check().map_err(value)?;
        Ok(cell.within(path.parent().unwrap_or(Path::new(""))))
    }

    /// Whether every value can mean something; which one does not, and why.
    fn check(&self) -> Result<(), (&'static str, String)> {
        let one_of = |key, value: &Option<String>, known: &[&str]| match value {
            Some(value) if !known.contains(&value.as_str()) => {
                Err((key, format!("`{value}` is none of {}", known.join(", "))))
            }
            _ => Ok(()),
        };
        let positive =
            |key, values: &[f64]| match values.iter().find(|v| !(**v > 0.0 && v.is_finite())) {
                Some(value) => Err((key, format!("{value} is not above 0"))),
                None => Ok(()),
            };
        one_of("[limits] profile", &self.limits.profile, &["velocity", "acceleration", "jerk"])?;
        positive("[limits] v_max", self.limits.v_max.as_slice())?;
        positive("fit_capsules", self.fit_capsules.as_slice())?;
        let scene = &self.scene;
        one_of("[scene] unseen", &scene.unseen, &["avoid", "forbid", "free"])?;
        positive("[scene] scale", scene.scale.as_slice())?;
        positive("[scene] table", scene.table.as_ref().map_or(&[], |t| &t[..]))?;
        if let Some(up) = scene.up {
            let length = up.iter().map(|v| v * v).sum::<f64>().sqrt();
            if !(length > 1e-6 && length.is_finite()) {
                return Err(("[scene] up", format!("{up:?} is no direction: it has no length")));
            }
        }
        if let Some(base) = &scene.base
            && !(matches!(base.len(), 3 | 4) && base.iter().all(|v| v.is_finite()))
        {
            return Err(("[scene] base", format!("{base:?} is not x, y, yaw, or x, y, yaw, z")));
        }
        if let Some(command) = &self.endpoint
            && command.first().is_none_or(|program| program.trim().is_empty())
        {
            return Err(("endpoint", "no program is named".into()));
        }
        Ok(())
    }

    fn within(mut self, folder: &Path) -> Self {
        let files = [
            &mut self.ipc_root,
            &mut self.urdf,
            &mut self.tool,
            &mut self.srdf,
            &mut self.executor.record,
        ];
        for path in files.into_iter().flatten().chain(self.packages.values_mut()) {
            *path = folder.join(&path);
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_that_can_mean_nothing_is_refused_by_its_key() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join(FILE_NAME);
        let read = |text: &str| {
            std::fs::write(&path, text).expect("written");
            Cell::read(&path)
        };
        for (text, key, why) in [
            ("[limits]\nprofile = \"fast\"", "[limits] profile", "`fast` is none of velocity"),
            ("[limits]\nv_max = 0", "[limits] v_max", "0 is not above 0"),
            ("[scene]\nup = [0, 0, 0]", "[scene] up", "no direction"),
            ("[scene]\nup = [0, nan, 1]", "[scene] up", "no direction"),
            ("[scene]\nbase = [0, 1]", "[scene] base", "[0.0, 1.0] is not x, y, yaw"),
            ("[scene]\nunseen = \"fre\"", "[scene] unseen", "`fre` is none of avoid"),
            ("[scene]\nscale = -1", "[scene] scale", "-1 is not above 0"),
            ("[scene]\ntable = [1, 0]", "[scene] table", "0 is not above 0"),
            ("endpoint = []", "endpoint", "no program"),
            ("fit_capsules = inf", "fit_capsules", "inf is not above 0"),
        ] {
            let said = read(text).expect_err(text).to_string();
            assert!(
                said.contains(&format!("{FILE_NAME}: {key}: ")) && said.contains(why),
                "{said}"
            );
        }
        let raised = read("[scene]\nbase = [0, 1, 0.5, 0.3]").expect("a cell");
        assert_eq!(raised.scene.base, Some(vec![0.0, 1.0, 0.5, 0.3]));
    }
}
