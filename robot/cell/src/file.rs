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
    /// Where the robot stands in the floor frame: x, y \[m\], yaw \[rad\].
    pub base: Option<[f64; 3]>,
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
    /// Names the file, and line and column of what is wrong in it.
    pub fn read(path: &Path) -> Result<Self, CellError> {
        let text = std::fs::read_to_string(path)
            .map_err(|error| CellError::Read { path: path.into(), error })?;
        let cell: Self = toml::from_str(&text)
            .map_err(|error| CellError::Parse { path: path.into(), error: Box::new(error) })?;
        Ok(cell.within(path.parent().unwrap_or(Path::new(""))))
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
