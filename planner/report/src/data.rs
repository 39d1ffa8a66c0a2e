//! What a report shows.

use std::path::PathBuf;

use nalgebra::{Point3, UnitVector3};
use thiserror::Error;

/// Everything on the page. All points in one frame, z up. \[m\]
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReportData {
    /// Heading of the page.
    pub title: String,
    /// A line under it: input, robot, seed.
    pub subtitle: String,
    /// Tables of figures, in order.
    pub tables: Vec<Table>,
    /// The scan.
    pub points: Vec<Point3<f64>>,
    /// Whether each of `points` is swept by all motions together; empty: not known.
    pub swept: Vec<bool>,
    /// The patches.
    pub patches: Vec<PatchMark>,
    /// The graph's edges, each as its line on the surface (two ends are enough).
    pub edges: Vec<Vec<Point3<f64>>>,
    /// The joints, in the order of [`Motion::joints`].
    pub joints: Vec<JointAxis>,
    /// Planned motions, first to last; after a swap the second is the plan swapped in.
    pub plans: Vec<Motion>,
    /// Measured motions.
    pub measured: Vec<Motion>,
}

/// A table; the first column of each row names it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// Heading.
    pub title: String,
    /// Column headings; empty: none.
    pub columns: Vec<String>,
    /// Rows of cells.
    pub rows: Vec<Vec<String>>,
}

/// One patch.
#[derive(Clone, Debug, PartialEq)]
pub struct PatchMark {
    /// Centre. \[m\]
    pub centre: Point3<f64>,
    /// Outward normal.
    pub normal: UnitVector3<f64>,
    /// Why it is not visited; `None`: it is.
    pub unreachable: Option<String>,
}

/// One joint of the arm.
#[derive(Clone, Debug, PartialEq)]
pub struct JointAxis {
    /// Its URDF name.
    pub name: String,
    /// Soft limits; `None` for a continuous joint. \[rad\]
    pub limits: Option<(f64, f64)>,
}

/// A motion over time, planned or measured. All lists run parallel to `times`, except that an
/// empty one is not shown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Motion {
    /// Name in the legends.
    pub name: String,
    /// Ascending. \[s\]
    pub times: Vec<f64>,
    /// For each joint its positions. \[rad\]
    pub joints: Vec<Vec<f64>>,
    /// The pad's centre. \[m\]
    pub tool: Vec<Point3<f64>>,
    /// Whether the pad is on the surface; empty: always.
    pub contact: Vec<bool>,
}

/// Why a report could not be made.
#[derive(Debug, Error)]
pub enum ReportError {
    /// The file could not be written.
    #[error("{}: the report cannot be written", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// Lists that must run parallel do not.
    #[error("report: {what} has {found} entries, {expected} are due")]
    Length {
        /// Which list.
        what: String,
        /// Its length.
        found: usize,
        /// The length of the list that it runs parallel to.
        expected: usize,
    },
}

impl ReportData {
    /// Checks that parallel lists are parallel.
    pub(super) fn check(&self) -> Result<(), ReportError> {
        let same = |what: String, found: usize, expected: usize| {
            if found == 0 || found == expected {
                Ok(())
            } else {
                Err(ReportError::Length { what, found, expected })
            }
        };
        same("swept".into(), self.swept.len(), self.points.len())?;
        for motion in self.plans.iter().chain(&self.measured) {
            let name = &motion.name;
            let samples = motion.times.len();
            same(format!("tool path of {name}"), motion.tool.len(), samples)?;
            same(format!("contact of {name}"), motion.contact.len(), samples)?;
            same(format!("joints of {name}"), motion.joints.len(), self.joints.len())?;
            for (joint, positions) in self.joints.iter().zip(&motion.joints) {
                same(format!("{} of {name}", joint.name), positions.len(), samples)?;
            }
        }
        Ok(())
    }
}
