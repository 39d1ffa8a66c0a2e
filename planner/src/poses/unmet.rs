//! Why a pose is not met.

use std::fmt;

use nalgebra::Isometry3;
use nullsweep_collision::{Hit, ToolContact};
use nullsweep_robot::{JointVector, Solutions};

use super::space::{Point, Space};
use crate::progress::{Progress, left_out};
use crate::workcell::redundancies;

/// Values of the redundancy parameter, and turns of a tool that may turn, by which a pose is looked at.
const VALUES: usize = 72;
const SPINS: usize = 12;
/// Joint vectors, spread over the arm's ranges, from which it is looked for: where a closed form and
/// the tool's turn hold all that meets it, where a closed form does not hold all, and without one.
const SEEDS: [usize; 3] = [0, 60, 240];

/// Why no joint vector is found for a pose.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Unmet {
    /// No posture of the arm comes there inside its limits.
    Reach,
    /// All that come there collide: the first by this.
    Hit(Hit),
}

impl Unmet {
    /// Whether it is the same reason, by whatever distance.
    fn is_like(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Reach, Self::Reach) => true,
            (Self::Hit(one), Self::Hit(two)) => (&one.link, &one.with) == (&two.link, &two.with),
            _ => false,
        }
    }
}

impl fmt::Display for Unmet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Reach => f.write_str("no joint vector inside the arm's limits meets it"),
            Self::Hit(hit) => write!(f, "whatever meets it collides: {hit}"),
        }
    }
}

impl Space<'_> {
    /// Joint vectors from which a pose may be met: the closed form's over redundancy and turn, where
    /// there is one, and others spread over the arm's ranges.
    pub(crate) fn seeds(&self, pose: &Isometry3<f64>, spread: usize) -> Vec<JointVector> {
        let mut seeds: Vec<JointVector> = Vec::new();
        if !self.arm.has_numeric_ik() {
            let values = redundancies(self.arm.ik().redundancy_range(), VALUES);
            let spins = if self.tolerance.0[5] > 0.0 { SPINS } else { 1 };
            let mut solutions = Solutions::new();
            for spin in 0..spins {
                let turn = std::f64::consts::TAU * spin as f64 / spins as f64;
                let turn = turn.min(self.tolerance.0[5]);
                let tip = self.tip_at(pose, turn);
                for &value in &values {
                    self.arm.ik().solve(&tip, value, &mut solutions);
                    let inside = solutions.iter().filter(|s| self.arm.within_margins(&s.q));
                    seeds.extend(inside.map(|s| s.q));
                }
            }
        }
        seeds.extend((0..spread).map(|k| self.arm.spread(k)));
        seeds
    }

    /// A joint vector that meets a pose, looked for over all seeds; else why there is none.
    pub(crate) fn meet(&self, pose: &Isometry3<f64>) -> Result<Point, Unmet> {
        let mut hit = None;
        let exact = self.tolerance.0[..5].iter().all(|t| *t == 0.0);
        let spread = match (self.arm.has_numeric_ik(), exact) {
            (true, _) => SEEDS[2],
            (false, false) => SEEDS[1],
            (false, true) => SEEDS[0],
        };
        for seed in self.seeds(pose, spread) {
            let Some(point) = self.project(pose, &seed) else { continue };
            if self.is_free(&point) {
                return Ok(point);
            }
            hit = hit.or(Some(point));
        }
        let what = |point: Point| self.world.why_not(&point.q, ToolContact::Allowed);
        Err(match hit.and_then(what) {
            Some(hit) => Unmet::Hit(hit),
            None => Unmet::Reach,
        })
    }
}

/// Says why poses are not met: what is in the way, or that they are out of reach.
pub(crate) fn tell_unmet(unmet: &[(usize, Unmet)], progress: &dyn Progress) {
    let mut reasons: Vec<(&Unmet, Vec<usize>)> = Vec::new();
    for (pose, why) in unmet {
        match reasons.iter_mut().find(|(known, _)| known.is_like(why)) {
            Some((_, which)) => which.push(*pose),
            None => reasons.push((why, vec![*pose])),
        }
    }
    for (why, which) in reasons {
        progress.note(&left_out(["pose", "poses"], &which, &why.to_string()));
    }
}
