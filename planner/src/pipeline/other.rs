//! Stances that were tried beside the one that was taken.

use serde::{Deserialize, Serialize};

use crate::workcell::stance::{Stance, told};

/// A stance that was tried, and which patches it reaches in a sketch of the scene.
pub(super) struct Other {
    pub(super) stance: Stance,
    pub(super) reached: Vec<bool>,
}

/// Patches that are free from another stance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FreeFrom {
    /// The stance.
    #[serde(flatten)]
    pub stance: Stance,
    /// How many of those that are left out.
    pub patches: usize,
}

impl std::fmt::Display for FreeFrom {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "from base {}", told(&self.stance.base))?;
        for (joint, value) in &self.stance.held {
            write!(f, ", {joint} {value}")?;
        }
        match self.patches {
            1 => f.write_str(" 1 patch is free"),
            n => write!(f, " {n} patches are free"),
        }
    }
}
