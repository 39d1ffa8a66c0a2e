//! numpy's arrays, in and out. One row or many: what comes back has as many.

use nalgebra::{Isometry3, Matrix3, Point3, Quaternion, Rotation3, Translation3, UnitQuaternion};
use nullsweep_robot::JointVector;
use numpy::{
    PyArray1, PyArray2, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyList;

use crate::errors::shape;

/// Anything that numpy makes an array of numbers of.
pub(crate) fn numbers<'py>(value: &Bound<'py, PyAny>) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
    let py = value.py();
    let made = py.import("numpy")?.call_method1("ascontiguousarray", (value, "float64"))?;
    Ok(made.cast_into::<PyArrayDyn<f64>>()?.readonly())
}

/// Rows, and whether there is one that stands by itself.
pub(crate) struct Rows<T> {
    pub(crate) rows: Vec<T>,
    pub(crate) is_one: bool,
}

/// Joint vectors of an arm: (joints,) or (n, joints). \[rad\] or \[m\]
pub(crate) fn joints(value: &Bound<'_, PyAny>, dof: usize) -> PyResult<Rows<JointVector>> {
    let array = numbers(value)?;
    let (found, is_one) = (array.shape(), array.ndim() == 1);
    if found.last() != Some(&dof) || found.len() > 2 {
        return Err(shape("q", &format!("({dof},) or (n, {dof})"), found));
    }
    let numbers = array.as_slice()?;
    finite("q", numbers)?;
    let vector = |row: &[f64]| JointVector::from_fn(|j| row.get(j).copied().unwrap_or(0.0));
    Ok(Rows { rows: numbers.chunks_exact(dof).map(vector).collect(), is_one })
}

/// Poses: matrices (4, 4) or (n, 4, 4), or x, y, z, qx, qy, qz, qw (7,) or (n, 7). \[m\]
pub(crate) fn poses(value: &Bound<'_, PyAny>) -> PyResult<Rows<Isometry3<f64>>> {
    let array = numbers(value)?;
    let found = array.shape();
    let (size, is_one) = match found {
        [4, 4] => (16, true),
        [_, 4, 4] => (16, false),
        [7] => (7, true),
        [_, 7] => (7, false),
        _ => return Err(shape("poses", "(4, 4), (n, 4, 4), (7,) or (n, 7)", found)),
    };
    let numbers = array.as_slice()?;
    finite("poses", numbers)?;
    let rows = numbers.chunks_exact(size).enumerate();
    let rows = rows.map(|(i, row)| if size == 7 { seven(i, row) } else { matrix(i, row) });
    Ok(Rows { rows: rows.collect::<PyResult<_>>()?, is_one })
}

/// Segments of poses: poses as [`poses`] takes them are one, a list of (n, 7) or (n, 4, 4) is several.
pub(crate) fn segments(value: &Bound<'_, PyAny>) -> PyResult<Vec<Vec<Isometry3<f64>>>> {
    let is_segment = |item: &Bound<'_, PyAny>| {
        let shape = numbers(item).map(|array| array.shape().to_vec());
        matches!(shape.as_deref(), Ok([_, 7] | [_, 4, 4]))
    };
    match value.cast::<PyList>() {
        Ok(list) if list.get_item(0).is_ok_and(|item| is_segment(&item)) => {
            list.iter().map(|segment| Ok(poses(&segment)?.rows)).collect()
        }
        _ => Ok(vec![poses(value)?.rows]),
    }
}

fn seven(i: usize, row: &[f64]) -> PyResult<Isometry3<f64>> {
    let turn = UnitQuaternion::try_new(Quaternion::new(row[6], row[3], row[4], row[5]), 1e-6);
    let turn = turn.ok_or_else(|| {
        PyValueError::new_err(format!("poses[{i}]: the quaternion must not be zero"))
    })?;
    Ok(Isometry3::from_parts(Translation3::new(row[0], row[1], row[2]), turn))
}

fn matrix(i: usize, row: &[f64]) -> PyResult<Isometry3<f64>> {
    let at = |r: usize, c: usize| row[4 * r + c];
    let turn = Matrix3::from_fn(at);
    let apart = (turn.transpose() * turn - Matrix3::identity()).abs().max();
    if !(apart < 1e-6) || turn.determinant() < 0.0 || row[12..] != [0.0, 0.0, 0.0, 1.0] {
        let why =
            format!("poses[{i}]: no rigid motion: a rotation and a last row 0, 0, 0, 1 are wanted");
        return Err(PyValueError::new_err(why));
    }
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turn));
    Ok(Isometry3::from_parts(Translation3::new(at(0, 3), at(1, 3), at(2, 3)), turn))
}

fn finite(what: &str, numbers: &[f64]) -> PyResult<()> {
    match numbers.iter().position(|x| !x.is_finite()) {
        None => Ok(()),
        Some(at) => {
            let value = numbers[at];
            Err(PyValueError::new_err(format!(
                "{what}: number {at} is {value}, finite ones are wanted"
            )))
        }
    }
}

/// Numbers in a shape of n of something, or of that alone.
pub(crate) fn shaped<'py>(
    py: Python<'py>,
    numbers: Vec<f64>,
    row: &[usize],
    is_one: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let size: usize = row.iter().product();
    let count = numbers.len() / size.max(1);
    let dims = if is_one { row.to_vec() } else { [&[count], row].concat() };
    PyArray1::from_vec(py, numbers).call_method1("reshape", (dims,))
}

/// Joint vectors as (n, joints).
pub(crate) fn of_joints<'py>(
    py: Python<'py>,
    rows: impl ExactSizeIterator<Item = JointVector>,
    dof: usize,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let count = rows.len();
    let numbers: Vec<f64> = rows.flat_map(|q| (0..dof).map(move |j| q[j])).collect();
    PyArray1::from_vec(py, numbers).reshape([count, dof])
}

/// Points as (n, 3).
pub(crate) fn of_points<'py>(
    py: Python<'py>,
    points: impl ExactSizeIterator<Item = [f64; 3]>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let count = points.len();
    PyArray1::from_vec(py, points.flatten().collect()).reshape([count, 3])
}

/// A point's coordinates.
pub(crate) fn xyz(point: &Point3<f64>) -> [f64; 3] {
    point.coords.into()
}

/// A pose as a matrix, row by row.
pub(crate) fn matrix_of(pose: &Isometry3<f64>) -> [f64; 16] {
    let m = pose.to_homogeneous();
    std::array::from_fn(|i| m[(i / 4, i % 4)])
}

/// Finite numbers, one or some.
pub(crate) fn finite_numbers(what: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let array = numbers(value)?;
    let numbers = array.as_slice()?;
    finite(what, numbers)?;
    Ok(numbers.to_vec())
}
