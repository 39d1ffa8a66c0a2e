//! The points around the robot.

use nalgebra::Point3;

use crate::rules::With;

/// The points around the robot, in the root frame. \[m\]
///
/// A list of points alone is a surface: `Points::from(&points)`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Points<'a> {
    /// Of the smoothed surface. The pad may be pressed against them.
    pub surface: &'a [Point3<f64>],
    /// Measured ones that no surface stands for. The pad may be pressed against them too.
    pub surroundings: &'a [Point3<f64>],
    /// Measurements for which the surface stands, with the sensor's noise. Only the pad in contact
    /// may be among them.
    pub raw: &'a [Point3<f64>],
    /// On the border of the space that no view has seen, no farther apart than what moves is thick.
    pub unseen: &'a [Point3<f64>],
    /// Those of the others that not even the pad may touch.
    pub keep_out: &'a [Point3<f64>],
}

impl<'a, T: AsRef<[Point3<f64>]> + ?Sized> From<&'a T> for Points<'a> {
    fn from(surface: &'a T) -> Self {
        Self { surface: surface.as_ref(), ..Self::default() }
    }
}

impl Points<'_> {
    /// All of them, first what presses on the pad: surface, surroundings, unseen, raw.
    pub(crate) fn all(&self) -> impl Iterator<Item = &Point3<f64>> {
        self.surface.iter().chain(self.surroundings).chain(self.unseen).chain(self.raw)
    }

    /// The points in the order of [`Self::all`], and where the kinds begin.
    pub(crate) fn sorted(&self) -> Sorted {
        let unseen = self.surface.len() + self.surroundings.len();
        let raw = unseen + self.unseen.len();
        Sorted {
            points: self.all().copied().collect(),
            unseen,
            raw,
            keep_out: self.keep_out.to_vec(),
        }
    }
}

/// The points in one list.
pub(crate) struct Sorted {
    pub(crate) points: Vec<Point3<f64>>,
    /// The first unseen one.
    unseen: usize,
    /// The first raw one.
    raw: usize,
    /// Those that not even the pad may touch, once more.
    pub(crate) keep_out: Vec<Point3<f64>>,
}

impl Sorted {
    /// What presses on the pad.
    pub(crate) fn firm(&self) -> &[Point3<f64>] {
        &self.points[..self.raw]
    }

    /// Whether a point presses on the pad.
    pub(crate) fn is_firm(&self, index: usize) -> bool {
        index < self.raw
    }

    /// A point as the other side of a hit.
    pub(crate) fn name(&self, index: usize) -> With {
        let point = self.points[index];
        let is_unseen = (self.unseen..self.raw).contains(&index);
        if is_unseen { With::Unseen(point) } else { With::ScanPoint(point) }
    }
}
