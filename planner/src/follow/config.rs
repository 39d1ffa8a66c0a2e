//! What is to be followed, and how.

use crate::poses::Setup;

/// How a path is to be followed.
#[derive(Clone, Debug)]
pub struct FollowConfig {
    /// How its poses are met.
    pub setup: Setup,
    /// The most that a turning and a sliding joint may move from a place of the path to the next, which
    /// are at most 1 cm and 0.05 rad apart. \[rad\], \[m\]
    pub step: [f64; 2],
}

impl FollowConfig {
    /// What counts as following and not as jumping, unless it is said: 7° and 2 cm.
    pub const STEP: [f64; 2] = [0.12, 0.02];
}
