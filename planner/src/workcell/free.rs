//! A posture that is free of collision.

use nullsweep_collision::{ToolContact, World};
use nullsweep_robot::{Arm, JointVector};

/// Postures that are tried.
const TRIED: usize = 1000;

/// The posture nearest to `home`, as shares of the joints' ranges, of many that are spread over
/// them, the tool clear of everything; `None` where none is free.
#[must_use]
pub fn nearest_free(arm: &Arm, world: &World, home: &JointVector) -> Option<JointVector> {
    let apart = |q: &JointVector| -> f64 {
        let share = |(j, &(low, high)): (usize, &(f64, f64))| {
            let width = if low.is_finite() { high - low } else { std::f64::consts::TAU };
            ((q[j] - home[j]) / width.max(f64::MIN_POSITIVE)).powi(2)
        };
        arm.margined_limits().iter().enumerate().map(share).sum()
    };
    let mut tried: Vec<JointVector> = (0..TRIED).map(|k| arm.spread(k)).collect();
    tried.sort_by(|a, b| apart(a).total_cmp(&apart(b)));
    tried.into_iter().find(|q| world.is_free(q, ToolContact::Forbidden))
}
