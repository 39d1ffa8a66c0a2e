//! The joint that a solver holds where an arm has more joints than a pose asks for.

use std::f64::consts::PI;

use crate::JointVector;

/// The redundant joint and its range; neither for an arm without redundancy.
#[derive(Clone, Copy, Debug)]
pub(super) struct Redundancy {
    /// Index in the chain.
    pub(super) joint: Option<usize>,
    /// Inside the margined limits; ±π for a continuous joint. \[rad\]
    pub(super) range: Option<(f64, f64)>,
}

impl Redundancy {
    /// Of an arm whose joints have these margined limits, without an end where they are continuous.
    pub(super) fn new(
        joint: Option<usize>,
        margined: &[(f64, f64)],
        is_continuous: impl FnOnce(usize) -> bool,
    ) -> Self {
        let range = |joint| if is_continuous(joint) { (-PI, PI) } else { margined[joint] };
        Self { joint, range: joint.map(range) }
    }

    /// Sets the redundant joint; the value that a solution tells, 0 without redundancy.
    #[inline]
    pub(super) fn hold(&self, q: &mut JointVector, value: f64) -> f64 {
        match self.joint {
            Some(joint) => {
                q[joint] = value;
                value
            }
            None => 0.0,
        }
    }

    /// The value that a solution tells, 0 without redundancy.
    #[inline]
    pub(super) fn of(&self, q: &JointVector) -> f64 {
        self.joint.map_or(0.0, |joint| q[joint])
    }
}
