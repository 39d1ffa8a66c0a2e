//! What a plan does not sweep, by what is in the way.

use std::collections::{BTreeMap, BTreeSet};

use nullsweep_robot::Arm;
use nullsweep_surface::{Patch, Scan};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::longer::Longer;
use super::other::FreeFrom;
use crate::plan::{Left, Plan, Stretch};
use crate::sweep::{MissedPoints, Unswept, missed};
use crate::workcell::{Cause, Workcell, obstruction};

/// All that one cause keeps from being swept.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LeftOut {
    /// What is in the way.
    #[serde(flatten)]
    pub cause: Cause,
    /// Patches that it concerns.
    pub patches: usize,
    /// Share of all scanned points.
    pub share: f64,
    /// By how much the posture that comes nearest falls short, least and most of the patches: of a
    /// margin \[m\], of a limit \[rad\] or \[m\]; none for what is no matter of postures.
    pub short: Option<[f64; 2]>,
    /// From where else the arm would come to some of them, of the stances that were tried: for what
    /// the arm meets something at.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub free_from: Option<FreeFrom>,
    /// What a longer tool would come to: for what the arm meets something at.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub longer: Option<Longer>,
    /// The patches.
    #[serde(skip)]
    pub(super) of: Vec<usize>,
    /// The points, as indices into the scan, ascending.
    #[serde(skip)]
    pub points: Vec<u32>,
}

impl LeftOut {
    /// As a plan file tells it.
    pub(super) fn told(&self) -> Left {
        Left { cause: self.cause.to_string(), points: self.points.clone() }
    }
}

impl std::fmt::Display for LeftOut {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let percent = 100.0 * self.share;
        match self.patches {
            0 => write!(f, "{percent:.1} % of the surface"),
            1 => write!(f, "1 patch, {percent:.1} % of the surface"),
            n => write!(f, "{n} patches, {percent:.1} % of the surface"),
        }?;
        match (&self.cause, self.short) {
            (Cause::Limit { slides, .. }, Some([least, most])) => {
                let unit = if *slides { "m" } else { "rad" };
                write!(f, ", by {} {unit}", span(least, most, 2))
            }
            (_, Some([least, most])) => {
                write!(f, ", short by {} mm", span(1e3 * least, 1e3 * most, 0))
            }
            (_, None) => Ok(()),
        }?;
        self.free_from.as_ref().map_or(Ok(()), |free| write!(f, "; {free}"))?;
        self.longer.map_or(Ok(()), |longer| write!(f, "; {longer}"))
    }
}

/// From the least to the most with so many digits; what is too little for them is told as that.
fn span(least: f64, most: f64, digits: usize) -> String {
    let smallest = 0.1_f64.powi(digits as i32);
    let [low, high] = [least, most].map(|value| format!("{value:.digits$}"));
    match (least < 0.5 * smallest, most < 0.5 * smallest) {
        (_, true) => format!("less than {smallest:.digits$}"),
        (true, false) => format!("up to {high}"),
        _ if low == high => high,
        _ => format!("{low} … {high}"),
    }
}

/// What is known of the surface.
pub(super) struct Known<'a> {
    pub(super) scan: &'a Scan,
    pub(super) patches: &'a [Patch],
    /// Which patches the arm reaches.
    pub(super) reachable: &'a [bool],
    /// Reached patches that no motion leads to.
    pub(super) dropped: &'a [usize],
    /// Which points are swept.
    pub(super) swept: &'a [bool],
}

impl<'a> Known<'a> {
    /// Nothing is reached.
    pub(super) fn unreached(scan: &'a Scan, patches: &'a [Patch], none: &'a [bool]) -> Self {
        let (reachable, swept) = (&none[..patches.len()], &none[..scan.points.len()]);
        Self { scan, patches, reachable, dropped: &[], swept }
    }
}

/// The points that are not swept, by cause, the one that concerns most of them first: their shares
/// add up to what is not swept.
pub(super) fn left_out(cell: Workcell<'_>, known: &Known<'_>) -> Vec<LeftOut> {
    let Known { scan, patches, reachable, dropped, swept } = *known;
    let mut owner: Vec<Option<usize>> = vec![None; scan.points.len()];
    for (p, patch) in patches.iter().enumerate() {
        patch.points.iter().for_each(|&i| owner[i as usize] = Some(p));
    }
    let causes: Vec<(Cause, Option<f64>)> = patches
        .par_iter()
        .enumerate()
        .map(|(p, patch)| match (reachable[p], dropped.contains(&p)) {
            (true, false) => (Cause::Passed, None),
            (true, true) => (Cause::NoMotion, None),
            (false, _) if patch.points.iter().all(|&i| swept[i as usize]) => (Cause::Passed, None),
            (false, _) => {
                let found = obstruction(cell, patch);
                (found.cause, Some(found.short).filter(|short| *short > 0.0))
            }
        })
        .collect();
    let mut rows: BTreeMap<&Cause, (Vec<u32>, BTreeSet<usize>)> = BTreeMap::new();
    for (i, (owner, _)) in owner.iter().zip(swept).enumerate().filter(|(_, (_, swept))| !**swept) {
        let row = rows.entry(owner.map_or(&Cause::Uneven, |p| &causes[p].0)).or_default();
        row.0.push(i as u32);
        row.1.extend(owner);
    }
    let total = scan.points.len().max(1) as f64;
    let mut found: Vec<LeftOut> = rows
        .into_iter()
        .map(|(cause, (points, of))| {
            let short = of.iter().filter_map(|&p| causes[p].1).map(|s| [s, s]);
            let short = short.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
            let share = points.len() as f64 / total;
            let (cause, patches, of) = (cause.clone(), of.len(), of.into_iter().collect());
            LeftOut { cause, patches, share, short, free_from: None, longer: None, of, points }
        })
        .collect();
    found.sort_by(|a, b| b.share.total_cmp(&a.share));
    found
}

/// The reachable points that a plan leaves, given which of its surface are swept, by why its pad's
/// motion, and that of what led to it, does.
#[must_use]
pub fn missed_by(plan: &Plan, swept: &[bool], arm: &Arm) -> Vec<MissedPoints> {
    let reachable: Vec<bool> = plan.surface.iter().map(|sample| sample.reachable).collect();
    let told = Cause::NoMotion.to_string();
    let points = plan.left.iter().filter(|left| left.cause == told).flat_map(|left| &left.points);
    let no_motion: Vec<u32> =
        points.copied().filter(|&i| (i as usize) < plan.surface.len()).collect();
    let left = Unswept { reachable: &reachable, swept, no_motion: &no_motion };
    let followed = plan.followed(plan.knots.len());
    missed(&plan.scan(), left, followed.iter().map(Stretch::trajectory), arm)
}

/// The first few causes in a line, for an error.
pub(super) fn in_words(causes: &[LeftOut]) -> String {
    const FEW: usize = 4;
    let said = causes.iter().take(FEW).map(|c| format!("{}: {c}", c.cause));
    said.collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_span_goes_from_nothing_to_nothing() {
        assert_eq!(span(0.01, 0.3, 0), "less than 1");
        assert_eq!(span(0.2, 3.4, 0), "up to 3");
        assert_eq!(span(0.9, 1.4, 0), "1");
        assert_eq!(span(1.0, 5.2, 0), "1 … 5");
        assert_eq!(span(0.026, 0.474, 2), "0.03 … 0.47");
        assert_eq!(span(0.001, 0.004, 2), "less than 0.01");
    }
}
