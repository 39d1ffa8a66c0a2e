//! A way into a stop.

use nalgebra::Point3;
use nullsweep_robot::JointVector;

/// A joint path into a stop.
#[derive(Clone, Debug)]
pub struct Leg {
    /// Joint vectors from where the arm was to the stop's sample. \[rad\] or \[m\]
    pub joints: Vec<JointVector>,
    /// For each of them the planned pad centre while the pad is on the surface, root frame. \[m\]
    pub line: Vec<Option<Point3<f64>>>,
}

impl Leg {
    /// Whether it leaves the surface.
    #[must_use]
    pub fn is_jump(&self) -> bool {
        self.line.iter().any(Option::is_none)
    }

    /// The same way back.
    #[must_use]
    pub fn reversed(&self) -> Self {
        let mut back = self.clone();
        back.joints.reverse();
        back.line.reverse();
        back
    }
}
