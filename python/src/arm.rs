//! An arm's kinematics, by rows.

use nalgebra::Isometry3;
use nullsweep_robot::{Arm as RobotArm, JointLimits, JointVector, Solution, Tool};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::arrays::{self, finite_numbers, joints, matrix_of, of_joints, shaped};

/// Values of the redundancy where none are given.
const SAMPLES: usize = 24;
/// Rows that are worth a thread.
const ROWS: usize = 64;

/// An arm, its other joints where they are held. Frames: the robot's root and the arm's tip, or the
/// tool's contact frame. SI units.
#[pyclass(frozen, module = "nullsweep")]
pub(crate) struct Arm {
    arm: RobotArm,
    contact: Isometry3<f64>,
}

impl Arm {
    pub(crate) fn new(arm: RobotArm, tool: &Tool) -> Self {
        Self { arm, contact: tool.contact_in_tip() }
    }

    fn limits<'py>(
        &self,
        py: Python<'py>,
        of: impl Fn(&JointLimits) -> f64,
    ) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.arm.limits().iter().map(of))
    }

    /// The values of the redundancy that are tried, in order.
    fn values(&self, given: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<f64>> {
        if let Some(given) = given {
            return finite_numbers("redundancy", given);
        }
        let Some((low, high)) = self.arm.ik().redundancy_range() else { return Ok(vec![0.0]) };
        let step = (high - low) / SAMPLES as f64;
        Ok((0..SAMPLES).map(|k| low + step * (k as f64 + 0.5)).collect())
    }
}

#[pymethods]
impl Arm {
    /// The joints' names, base to tip.
    #[getter]
    fn joints(&self) -> Vec<String> {
        self.arm.joint_names().to_vec()
    }

    #[getter]
    fn dof(&self) -> usize {
        self.arm.dof()
    }

    /// Soft limits; infinite for joints that turn without end. \[rad\] or \[m\]
    #[getter]
    fn lower<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.limits(py, |l| if l.continuous { f64::NEG_INFINITY } else { l.lower })
    }

    #[getter]
    fn upper<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.limits(py, |l| if l.continuous { f64::INFINITY } else { l.upper })
    }

    #[getter]
    fn velocity<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.limits(py, |l| l.velocity)
    }

    #[getter]
    fn acceleration<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.limits(py, |l| l.acceleration)
    }

    /// Other joints, where they are held. \[rad\] or \[m\]
    #[getter]
    fn held(&self) -> std::collections::BTreeMap<String, f64> {
        self.arm.held_joints().iter().map(|h| (h.name.clone(), h.position)).collect()
    }

    /// The joint that is the redundancy of the inverse kinematics, and its range; None where each pose
    /// has finitely many solutions.
    #[getter]
    fn redundancy(&self) -> Option<(String, f64, f64)> {
        let ik = self.arm.ik();
        let (joint, (low, high)) = (ik.redundant_joint()?, ik.redundancy_range()?);
        Some((self.arm.joint_names().get(joint)?.clone(), low, high))
    }

    /// Whether the inverse kinematics is numeric, not in closed form.
    #[getter]
    fn is_numeric(&self) -> bool {
        self.arm.has_numeric_ik()
    }

    /// Poses of the tip, or of the tool's contact frame, in the root frame: (4, 4) or (n, 4, 4).
    #[pyo3(signature = (q, *, tool=false))]
    fn fk<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'_, PyAny>,
        tool: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let rows = joints(q, self.arm.dof())?;
        let after = if tool { self.contact } else { Isometry3::identity() };
        let of = |q: &JointVector| matrix_of(&(self.arm.tip_pose(q) * after));
        let found: Vec<[f64; 16]> = py.detach(|| each(&rows.rows, of));
        shaped(py, found.into_flattened(), &[4, 4], rows.is_one)
    }

    /// Geometric Jacobians of the tip in the root frame: (6, joints) or (n, 6, joints), linear rows
    /// before angular ones.
    fn jacobian<'py>(&self, py: Python<'py>, q: &Bound<'_, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let dof = self.arm.dof();
        let rows = joints(q, dof)?;
        let of = |q: &JointVector| {
            let jacobian = self.arm.jacobian(q);
            (0..6 * dof).map(|i| jacobian[(i / dof, i % dof)]).collect::<Vec<f64>>()
        };
        let found: Vec<f64> = py.detach(|| each(&rows.rows, of)).concat();
        shaped(py, found, &[6, dof], rows.is_one)
    }

    /// All solutions for poses of the tip, or of the tool's contact frame, in the root frame, at each
    /// value of the redundancy, inside the limits.
    #[pyo3(signature = (poses, *, redundancy=None, tool=false, within_limits=true))]
    fn ik(
        &self,
        py: Python<'_>,
        poses: &Bound<'_, PyAny>,
        redundancy: Option<&Bound<'_, PyAny>>,
        tool: bool,
        within_limits: bool,
    ) -> PyResult<Solutions> {
        let targets = arrays::poses(poses)?.rows;
        let values = self.values(redundancy)?;
        let before = if tool { self.contact.inverse() } else { Isometry3::identity() };
        let (arm, ik) = (&self.arm, self.arm.ik());
        let solve = |(row, pose): (usize, &Isometry3<f64>)| {
            let (target, mut some) = (pose * before, nullsweep_robot::Solutions::new());
            let mut found = Vec::with_capacity(8 * values.len());
            for value in &values {
                ik.solve(&target, *value, &mut some);
                let sound = some.iter().filter(|s| !within_limits || arm.within_margins(&s.q));
                found.extend(sound.map(|s| (row, *s)));
            }
            found
        };
        let found: Vec<(usize, Solution)> = py.detach(|| {
            let rows = targets.par_iter().enumerate().with_min_len(ROWS);
            rows.flat_map_iter(solve).collect()
        });
        Ok(Solutions { found, dof: arm.dof() })
    }

    fn __repr__(&self) -> String {
        let spec = self.arm.spec();
        format!("Arm({} … {}, {} joints)", spec.base, spec.tip, self.arm.dof())
    }
}

/// Each row by itself, many of them on all threads.
fn each<T: Send>(rows: &[JointVector], of: impl Fn(&JointVector) -> T + Sync + Send) -> Vec<T> {
    rows.par_iter().with_min_len(ROWS).map(of).collect()
}

/// What the inverse kinematics found, for all poses, in their order.
#[pyclass(frozen, module = "nullsweep")]
pub(crate) struct Solutions {
    found: Vec<(usize, Solution)>,
    dof: usize,
}

#[pymethods]
impl Solutions {
    /// Joint vectors, (k, joints). \[rad\] or \[m\]
    #[getter]
    fn q<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        of_joints(py, self.found.iter().map(|(_, s)| s.q), self.dof)
    }

    /// Of which pose each is, (k,).
    #[getter]
    fn row<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        PyArray1::from_iter(py, self.found.iter().map(|(row, _)| *row as i64))
    }

    /// On which branch, (k,).
    #[getter]
    fn branch<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u8>> {
        PyArray1::from_iter(py, self.found.iter().map(|(_, s)| s.branch.0))
    }

    /// At which value of the redundancy, (k,). \[rad\]
    #[getter]
    fn redundancy<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.found.iter().map(|(_, s)| s.redundancy))
    }

    fn __len__(&self) -> usize {
        self.found.len()
    }

    fn __repr__(&self) -> String {
        format!("Solutions({} of {} joints)", self.found.len(), self.dof)
    }
}
