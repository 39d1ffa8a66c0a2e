//! What a base that does not stand where it should costs.

use rayon::prelude::*;

use super::error::StopsError;
use super::look::Ground;
use super::share::Share;
use crate::workcell::Stance;

/// How far off its place a base may stand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offset {
    /// In any direction on the floor. \[m\]
    pub along: f64,
    /// Turned to either side. \[rad\]
    pub turned: f64,
}

impl Default for Offset {
    /// 2 cm and 2°.
    fn default() -> Self {
        Self { along: 0.02, turned: 2f64.to_radians() }
    }
}

impl Offset {
    /// Stances that are off by it: along each diagonal, turned to the side and to the other.
    fn of(&self, stance: &Stance) -> Vec<Stance> {
        let d = self.along * std::f64::consts::FRAC_1_SQRT_2;
        let turns = [(d, d, 1.0), (d, -d, -1.0), (-d, d, -1.0), (-d, -d, 1.0)];
        let moved = |(dx, dy, side): (f64, f64, f64)| {
            let [x, y, yaw] = stance.base;
            Stance { base: [x + dx, y + dy, yaw + side * self.turned], ..stance.clone() }
        };
        turns.into_iter().map(moved).collect()
    }
}

/// The share of a share's points that is still in reach with the base off its place, the least of several
/// directions; 0 where the robot cannot stand in one of them.
///
/// # Errors
/// See [`StopsError`].
pub(super) fn tolerance(
    ground: &Ground<'_>,
    share: &Share,
    offset: Offset,
) -> Result<f64, StopsError> {
    let points = |patches: &[u32]| -> usize {
        patches.iter().map(|&patch| ground.patches[patch as usize].points.len()).sum()
    };
    let mut of = vec![Vec::new(); ground.limbs.len()];
    of[share.arm].clone_from(&share.patches);
    let all = points(&share.patches).max(1) as f64;
    let kept: Vec<_> = offset
        .of(&share.stance)
        .par_iter()
        .map(|stance| {
            let reached = ground.look(stance, &of)?;
            Ok(reached.map_or(0.0, |reached| points(&reached[share.arm]) as f64 / all))
        })
        .collect();
    kept.into_iter().try_fold(1.0, |least: f64, kept: Result<f64, StopsError>| Ok(least.min(kept?)))
}
