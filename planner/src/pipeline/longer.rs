//! What a longer tool would come to.

use serde::{Deserialize, Serialize};

/// Patches that a longer tool comes to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Longer {
    /// By how much longer, on a stick of 2 cm across. \[m\]
    pub by: f64,
    /// How many of those that are left out.
    pub patches: usize,
}

impl std::fmt::Display for Longer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let by = 100.0 * self.by;
        match self.patches {
            1 => write!(f, "a tool {by:.0} cm longer would reach 1 patch more"),
            n => write!(f, "a tool {by:.0} cm longer would reach {n} patches more"),
        }
    }
}
