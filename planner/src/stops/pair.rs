//! Both arms of a stop at once: what both reach is split so that both take as long, and their plans are
//! brought onto one clock.

use nalgebra::Point3;

use super::choice::Stop;
use super::error::StopsError;
use super::rounds::Rounds;
use super::share::{Share, Worked};
use crate::coordinate::{Together, coordinate};
use crate::pipeline::Figures;
use crate::plan::Plan;
use crate::verify::{Given, between, verify};
use crate::workcell::Stance;

/// How often the split is made anew: by how long the plans really take, and then beside the best one, by
/// this share of what both reach.
const SPLITS: usize = 4;
const BESIDE: f64 = 0.1;
/// A pair that sweeps at least this share of what another one does may win by its time.
const AS_MUCH: f64 = 0.99;

/// Plans what is to be swept at a stop by two arms at once; one after the other where that cannot be.
///
/// # Errors
/// See [`work`](super::share::work).
pub(super) fn work_together(of: &Rounds<'_>, stop: &Stop) -> Result<Vec<Worked>, StopsError> {
    let split = Split::new(of, stop)?;
    let (mut best, mut paces, mut tried): (Option<Pair>, _, Vec<usize>) = (None, [1.0; 2], vec![]);
    while tried.len() < SPLITS {
        let beside = best.as_ref().map_or([0; 2], |best| split.beside(best.place));
        let next = [split.place(paces), beside[0], beside[1]];
        let Some(place) = next.into_iter().find(|place| !tried.contains(place)) else { break };
        tried.push(place);
        let shares = split.shares(place);
        if shares.iter().any(|share| share.patches.is_empty()) {
            continue;
        }
        let (first, second) = rayon::join(|| of.work(&shares[0]), || of.work(&shares[1]));
        let worked = [first?, second?];
        let [Ok(one), Ok(other)] = [&worked[0].plan, &worked[1].plan] else { continue };
        let weights = split.weights(place);
        paces = [one.duration() / weights[0].max(1.0), other.duration() / weights[1].max(1.0)];
        if let Some(pair) = paired(of, &worked, place, best.as_ref())? {
            best = Some(pair);
        }
    }
    match best {
        Some(pair) => Ok(pair.worked.into()),
        None => stop.shares.iter().map(|share| of.work(share)).collect(),
    }
}

/// Two plans that may be done at once.
struct Pair {
    worked: [Worked; 2],
    seconds: f64,
    /// Points that they sweep, and nothing before them.
    gained: usize,
    /// See [`Split::place`].
    place: usize,
}

/// Both arms' plans of a split on one clock, each verified anew and both against each other; `None` where
/// they cannot be done at once, or are no better than `best`.
fn paired(
    of: &Rounds<'_>,
    worked: &[Worked; 2],
    place: usize,
    best: Option<&Pair>,
) -> Result<Option<Pair>, StopsError> {
    let Rounds { robot, setup, scene, swept, .. } = of;
    let collision = &setup.job.collision;
    let arms = [&setup.arms[worked[0].share.arm], &setup.arms[worked[1].share.arm]];
    let [Ok(one), Ok(other)] = [&worked[0].plan, &worked[1].plan] else { return Ok(None) };
    let Some(Together { plans, seconds, .. }) = coordinate(robot, arms, [one, other], collision)?
    else {
        return Ok(None);
    };
    let gained = gained(swept, [&worked[0].swept, &worked[1].swept]);
    if best.is_some_and(|best| !best.is_beaten(seconds, gained)) {
        return Ok(None);
    }
    let [x, y, _] = worked[0].share.stance.base;
    let (here, kept) = scene.near([x, y], setup.around(robot, &setup.limbs(robot)?));
    let given = arms.map(|arm| Given { robot, arm, scene: &here, collision });
    if !between([&plans[0], &plans[1]], given)?.0.is_empty() {
        return Ok(None);
    }
    let again = |arm: usize, plan: &Plan| -> Result<Option<Worked>, StopsError> {
        let found = verify(plan, given[arm], &|| ())?;
        if !found.violations.is_empty() {
            return Ok(None);
        }
        let swept = kept.iter().zip(&found.swept).filter(|(_, s)| **s).map(|(point, _)| *point);
        let (swept, task_time_s, knots) = (swept.collect(), plan.duration(), plan.knots.len());
        let figures = worked[arm].figures.clone();
        Ok(Some(Worked {
            plan: Ok(plan.clone()),
            swept,
            figures: figures.map(|f| Figures { verification: found, task_time_s, knots, ..f }),
            at_once: arm == 1,
            ..worked[arm].clone()
        }))
    };
    let both = again(0, &plans[0])?.zip(again(1, &plans[1])?);
    Ok(both.map(|(one, other)| Pair { worked: [one, other], seconds, gained, place }))
}

/// How many points are in either list, and were not swept before.
fn gained(swept: &[bool], lists: [&[u32]; 2]) -> usize {
    let mut new: Vec<u32> = lists.concat();
    new.sort_unstable();
    new.dedup();
    new.into_iter().filter(|&point| !swept[point as usize]).count()
}

impl Pair {
    fn is_beaten(&self, seconds: f64, gained: usize) -> bool {
        let (own, others) = (self.gained as f64, gained as f64);
        AS_MUCH * others > own || (others >= AS_MUCH * own && seconds < self.seconds)
    }
}

/// What is to be swept at a stop, by who reaches it.
struct Split {
    stance: Stance,
    /// Patches that one arm alone reaches, for each arm.
    own: [Vec<u32>; 2],
    /// Those that both reach, ascending by how much nearer they are to the first arm than to the second,
    /// each with its points that are left.
    both: Vec<(u32, f64)>,
    own_weights: [f64; 2],
}

impl Split {
    fn new(of: &Rounds<'_>, stop: &Stop) -> Result<Self, StopsError> {
        let Rounds { robot, setup, patches, swept, .. } = of;
        let to_root = stop.stance.pose().inverse();
        let limbs = setup.limbs(robot)?;
        let pivots: Vec<Point3<f64>> = limbs
            .iter()
            .map(|limb| Ok(setup.pivot(robot, &stop.stance.bind(&limb.arm)?)))
            .collect::<Result<_, StopsError>>()?;
        let site = of.state.survey.sites.iter().find(|site| site.stance == stop.stance);
        let reaches = |arm: usize, patch: u32| {
            let is_given = |share: &Share| share.arm == arm && share.patches.contains(&patch);
            site.is_some_and(|site| site.reached[arm].binary_search(&patch).is_ok())
                || stop.shares.iter().any(is_given)
        };
        let weight = |patch: u32| {
            let points = patches[patch as usize].points.iter();
            points.filter(|&&point| !swept[point as usize]).count() as f64
        };
        let mut wanted: Vec<u32> =
            stop.shares.iter().flat_map(|share| share.patches.iter().copied()).collect();
        wanted.sort_unstable();
        let mut split = Self {
            stance: stop.stance.clone(),
            own: [Vec::new(), Vec::new()],
            both: Vec::new(),
            own_weights: [0.0; 2],
        };
        let mut order = Vec::new();
        for patch in wanted {
            if let Some(arm) = [0, 1].into_iter().find(|&arm| !reaches(1 - arm, patch)) {
                split.own[arm].push(patch);
                split.own_weights[arm] += weight(patch);
            } else {
                let centre = to_root * patches[patch as usize].centre;
                let nearer = (centre - pivots[0]).norm() - (centre - pivots[1]).norm();
                order.push((nearer, patch));
            }
        }
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        split.both = order.into_iter().map(|(_, patch)| (patch, weight(patch))).collect();
        Ok(split)
    }

    /// What each arm is to sweep where the first one takes so many of what both reach, in points.
    fn weights(&self, place: usize) -> [f64; 2] {
        let sum = |of: &[(u32, f64)]| of.iter().map(|(_, weight)| weight).sum::<f64>();
        let (first, second) = self.both.split_at(place);
        [self.own_weights[0] + sum(first), self.own_weights[1] + sum(second)]
    }

    /// How many of what both reach the first arm takes so that both take as long, by how long each takes
    /// for a point.
    fn place(&self, paces: [f64; 2]) -> usize {
        let apart = |place: usize| {
            let [first, second] = self.weights(place);
            (paces[0] * first - paces[1] * second).abs()
        };
        let places = (0..=self.both.len()).map(|place| (apart(place), place));
        places.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(0, |(_, place)| place)
    }

    /// Two places next to one.
    fn beside(&self, place: usize) -> [usize; 2] {
        let by = (BESIDE * self.both.len() as f64).ceil() as usize;
        [place.saturating_sub(by), (place + by).min(self.both.len())]
    }

    fn shares(&self, place: usize) -> [Share; 2] {
        let (first, second) = self.both.split_at(place);
        let share = |arm: usize, both: &[(u32, f64)]| {
            let both = both.iter().map(|(patch, _)| *patch);
            let mut patches: Vec<u32> = self.own[arm].iter().copied().chain(both).collect();
            patches.sort_unstable();
            Share { stance: self.stance.clone(), arm, patches }
        };
        [share(0, first), share(1, second)]
    }
}
