//! What no plan sweeps, and why.

use std::collections::BTreeMap;

use nullsweep_collision::World;
use rayon::prelude::*;

use super::error::StopsError;
use super::rounds::Rounds;
use crate::pipeline::is_swept;
use crate::plan::Unswept;
use crate::workcell::{Cause, Stance, Workcell, obstruction};

/// Points that are to be and are not swept, by cause, what concerns most of them first.
pub(super) fn unswept(of: &Rounds<'_>) -> Result<Vec<Unswept>, StopsError> {
    let union = of.state.survey.union(of.patches.len());
    let mut owner: Vec<Option<usize>> = vec![None; of.swept.len()];
    for (p, patch) in of.patches.iter().enumerate() {
        patch.points.iter().for_each(|&point| owner[point as usize] = Some(p));
    }
    let whys: Vec<Result<String, StopsError>> = (0..of.patches.len())
        .into_par_iter()
        .map(|patch| {
            if is_swept(&of.patches[patch], &of.swept) {
                return Ok(Cause::Passed.to_string());
            }
            let tried =
                |stance: &Stance| of.state.worked.iter().any(|one| one.share.stance == *stance);
            let at = |site: &&super::survey::Site| {
                site.reached.iter().any(|of| of.binary_search(&(patch as u32)).is_ok())
            };
            let mut from = of.state.survey.sites.iter().filter(at);
            if from.any(|site| tried(&site.stance)) {
                return Ok("in reach of a stop, but no motion of its plans sweeps it".into());
            }
            if union[patch] {
                return Ok("in reach from elsewhere, but not worth another stop".into());
            }
            why(of, patch)
        })
        .collect();
    let whys = whys.into_iter().collect::<Result<Vec<_>, _>>()?;
    let uneven = Cause::Uneven.to_string();
    let mut rows: BTreeMap<&str, (usize, Vec<usize>)> = BTreeMap::new();
    let labels = of.scene.regions.labels(&of.scene.surface.points);
    let wanted = labels.iter().map(|label| of.scene.regions.is_wanted(*label));
    let points = owner.iter().zip(&of.swept).zip(wanted);
    for ((owner, _), _) in points.filter(|((_, swept), wanted)| *wanted && !**swept) {
        let row = rows.entry(owner.map_or(uneven.as_str(), |p| &whys[p])).or_default();
        row.0 += 1;
        row.1.extend(owner);
    }
    let total = of.swept.len().max(1) as f64;
    let mut found: Vec<Unswept> = rows
        .into_iter()
        .map(|(why, (points, mut patches))| {
            patches.sort_unstable();
            patches.dedup();
            Unswept { why: why.into(), patches: patches.len(), share: points as f64 / total }
        })
        .collect();
    found.sort_by(|a, b| b.share.total_cmp(&a.share));
    Ok(found)
}

/// What is in the way of a patch that is reached from nowhere: at the stop whose base is nearest to being
/// before it, for the arm that comes nearer.
fn why(of: &Rounds<'_>, patch: usize) -> Result<String, StopsError> {
    let patch = &of.patches[patch];
    let limbs = of.setup.limbs(of.robot)?;
    let outside = patch.centre + patch.normal.into_inner() * BEFORE;
    let apart =
        |stance: &Stance| libm::hypot(stance.base[0] - outside.x, stance.base[1] - outside.y);
    let made = of.made();
    let Some(stance) = made.iter().min_by(|a, b| apart(a).total_cmp(&apart(b))) else {
        return Ok("no stop".into());
    };
    let to_root = stance.pose().inverse();
    let [x, y, _] = stance.base;
    let here = of.scene.near([x, y], of.setup.around(of.robot, &limbs)).0.transformed(&to_root);
    let here = here.sketch();
    let looked = patch.transformed(&to_root);
    let mut nearest: Option<(bool, f64, String)> = None;
    for limb in &limbs {
        let arm = stance.bind(&limb.arm)?;
        let (tool, options) = (&of.setup.job.tool, &of.setup.job.collision);
        let world = World::new(of.robot, &arm, tool, here.points(), &here.obstacles, options)?;
        let found = obstruction(Workcell { arm: &arm, tool, world: &world }, &looked);
        let far = matches!(found.cause, Cause::OutOfReach | Cause::Limit { .. });
        let words = (far, found.short, kind(&found.cause));
        if nearest.as_ref().is_none_or(|n| (words.0, words.1) < (n.0, n.1)) {
            nearest = Some(words);
        }
    }
    Ok(nearest.map_or_else(|| "no arm".into(), |(_, _, words)| words))
}

/// How far before a patch a robot would stand. \[m\]
const BEFORE: f64 = 0.7;

/// A cause without the link that it is of: there are two arms, and many stops.
fn kind(cause: &Cause) -> String {
    match cause {
        Cause::OutOfReach | Cause::Limit { .. } => {
            "from nowhere: the arms are too short, or would leave their limits"
        }
        Cause::Itself { .. } => "from nowhere: the robot would meet itself",
        Cause::Solid { name, .. } => {
            return format!("from nowhere: the robot would meet the {name}");
        }
        Cause::Object { .. } => "from nowhere: the robot would meet the object",
        Cause::Unseen { .. } => "from nowhere: the robot would be in unseen space",
        Cause::KeepOut => "from nowhere: the pad would touch what it is to keep out of",
        Cause::Press => "from nowhere: the pad would be pressed in too deep",
        Cause::NoMotion | Cause::Passed | Cause::Uneven | Cause::Missed => {
            "from nowhere that was looked at"
        }
    }
    .into()
}
