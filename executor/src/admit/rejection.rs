//! Why a plan was not admitted.

use core::fmt;

use nullsweep_ipc_types::Reason;

/// Why a plan was not admitted, and where.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rejection {
    /// The rule that it breaks.
    pub reason: Reason,
    /// The joint, or held joint, `u32::MAX` for none.
    pub joint: u32,
    /// The knot, `u32::MAX` for none.
    pub knot: u32,
    /// The offending value, NaN for none.
    pub value: f64,
    /// The bound that it broke, NaN for none.
    pub bound: f64,
}

impl Rejection {
    /// A rejection without a place.
    #[must_use]
    pub fn new(reason: Reason) -> Self {
        Self { reason, joint: u32::MAX, knot: u32::MAX, value: f64::NAN, bound: f64::NAN }
    }

    /// With the value and its bound.
    #[must_use]
    pub fn value(self, value: f64, bound: f64) -> Self {
        Self { value, bound, ..self }
    }

    /// At a joint.
    #[must_use]
    pub fn joint(self, joint: usize) -> Self {
        Self { joint: small(joint), ..self }
    }

    /// At a knot.
    #[must_use]
    pub fn knot(self, knot: usize) -> Self {
        Self { knot: small(knot), ..self }
    }
}

impl fmt::Display for Rejection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.reason)?;
        if self.knot != u32::MAX {
            write!(f, ", knot {}", self.knot)?;
        }
        if self.joint != u32::MAX {
            write!(f, ", joint {}", self.joint)?;
        }
        if !self.value.is_nan() || !self.bound.is_nan() {
            write!(f, ": {} against {}", self.value, self.bound)?;
        }
        Ok(())
    }
}

fn small(index: usize) -> u32 {
    u32::try_from(index).unwrap_or(u32::MAX)
}
