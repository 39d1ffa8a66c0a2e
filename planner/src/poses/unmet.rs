//! Why a pose is not met.

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::fmt;

use nalgebra::Isometry3;
use nullsweep_collision::{Hit, ToolContact, With};
use nullsweep_robot::{JointVector, Solutions};

use super::space::{Point, Space};
use crate::plan::Left;
use crate::progress::{Progress, left_out};
use crate::workcell::redundancies;

/// Values of the redundancy parameter, and turns of a tool that may turn, by which a pose is looked at.
const VALUES: usize = 72;
const SPINS: usize = 12;
/// Postures that collide of which it is found out with what: slow.
const LOOKED: usize = 48;
/// Joint vectors, spread over the arm's ranges, from which it is looked for: where a closed form and
/// the tool's turn hold all that meets it, where a closed form does not hold all, and without one.
const SEEDS: [usize; 3] = [0, 60, 240];

/// Why no joint vector is found for a pose.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Unmet {
    /// No posture of the arm comes there inside its limits.
    Reach,
    /// All that come there collide, by this: see [`telling`].
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
        let mut hits = Vec::new();
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
            if hits.len() < LOOKED {
                hits.push(self.world.hits(&point.q, ToolContact::Allowed));
            }
        }
        Err(match telling(hits) {
            Some(hit) => Unmet::Hit(hit),
            None => Unmet::Reach,
        })
    }
}

/// Of all that postures meet what tells most: of those that meet fewest things what most of them meet,
/// where they come nearest to being free of it. An elbow that would be in the floor as well says nothing
/// of a crate that stands in the pad's place.
fn telling(hits: Vec<Vec<Hit>>) -> Option<Hit> {
    let things = |hits: &[Hit]| {
        let mut things: Vec<String> = hits.iter().map(thing).collect();
        things.sort_unstable();
        things.dedup();
        things
    };
    let fewest = hits.iter().map(|hits| things(hits).len()).filter(|n| *n > 0).min()?;
    let freest: Vec<Vec<Hit>> =
        hits.into_iter().filter(|hits| things(hits).len() == fewest).collect();
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    for thing in freest.iter().flat_map(|hits| things(hits)) {
        *counts.entry(thing).or_default() += 1;
    }
    let common = counts.iter().max_by_key(|(name, count)| (**count, Reverse(*name)))?.0;
    let short = |hit: &Hit| hit.margin - hit.distance;
    let of_it = freest.into_iter().flatten().filter(|hit| thing(hit) == *common);
    of_it.min_by(|a, b| short(a).total_cmp(&short(b)))
}

/// What is met, whatever meets it.
fn thing(hit: &Hit) -> String {
    match &hit.with {
        With::Link(_) => "the robot itself".into(),
        With::Obstacle(name) => format!("obstacle {name}"),
        With::ScanPoint(_) => "what was measured".into(),
        With::KeepOut(_) => "what the tool is to keep out of".into(),
        With::Unseen(_) => "unseen space".into(),
    }
}

/// The poses that are not met, by what is in the way, or that they are out of reach.
pub(crate) fn by_reason(unmet: &[(usize, Unmet)]) -> Vec<Left> {
    let mut reasons: Vec<(&Unmet, Vec<u32>)> = Vec::new();
    for (pose, why) in unmet {
        match reasons.iter_mut().find(|(known, _)| known.is_like(why)) {
            Some((_, which)) => which.push(*pose as u32),
            None => reasons.push((why, vec![*pose as u32])),
        }
    }
    reasons.into_iter().map(|(why, points)| Left { cause: why.to_string(), points }).collect()
}

/// Says which poses are left out, and why.
pub(crate) fn tell_left(left: &[Left], progress: &dyn Progress) {
    for Left { cause, points } in left {
        let which: Vec<usize> = points.iter().map(|pose| *pose as usize).collect();
        progress.note(&left_out(["pose", "poses"], &which, cause));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hit(link: &str, obstacle: &str, distance: f64) -> Hit {
        let with = With::Obstacle(obstacle.into());
        Hit { link: link.into(), with, distance, margin: 0.005 }
    }

    #[test]
    fn what_stands_in_the_pads_place_is_told_and_not_what_some_elbow_meets_as_well() {
        let low = || vec![hit("elbow", "floor", 0.004), hit("pad", "crate", 0.0)];
        let high = || vec![hit("pad", "crate", 0.0)];
        let told = telling(vec![low(), low(), high()]).expect("a hit");
        assert_eq!(told, hit("pad", "crate", 0.0));
        // Where each posture meets something else, what most of them meet.
        let floor = || vec![hit("elbow", "floor", 0.0)];
        let told = telling(vec![high(), floor(), vec![hit("wrist", "floor", 0.003)]]);
        assert_eq!(told, Some(hit("wrist", "floor", 0.003)), "the nearest to being free");
        assert_eq!(telling(vec![Vec::new()]), None);
        assert_eq!(telling(Vec::new()), None);
    }
}
