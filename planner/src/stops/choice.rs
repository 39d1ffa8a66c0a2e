//! Which places become stops, and what is shared out to their arms.

use nullsweep_surface::Patch;

use super::floor::union;
use super::share::Share;
use super::survey::Site;
use crate::cover::{Cover, Problem, cover};
use crate::workcell::Stance;

/// What a stop must gain to be worth the drive, as a share of all points.
const STOP: f64 = 0.008;
/// What a point costs that makes one arm of two that work at once take longer than the other, as a share
/// of one that is swept.
const ALONE: f64 = 0.5;
/// What another plan at a stop must gain.
const PLAN: f64 = 0.002;

/// What is open to choice.
pub(super) struct Open<'a> {
    pub(super) patches: &'a [Patch],
    /// The places, with what each arm could still sweep there.
    pub(super) sites: Vec<Site>,
    /// Stops that are made already.
    pub(super) made: Vec<Stance>,
    /// How many there are at most.
    pub(super) most: Option<usize>,
    /// For each point whether it was swept.
    pub(super) swept: &'a [bool],
    /// Whether two arms work at once at a stop.
    pub(super) together: bool,
}

/// A stop with what each arm is to sweep.
#[derive(Clone, Debug)]
pub struct Stop {
    /// Where.
    pub stance: Stance,
    /// The shares of the arms that have something to do.
    pub shares: Vec<Share>,
}

/// Stops, and the cover that chose new ones.
pub(super) struct Choice {
    pub(super) stops: Vec<Stop>,
    pub(super) cover: Cover,
}

/// Chooses what is worth it: first at stops that are made already, which cost no drive, then new ones.
pub(super) fn choose(open: &Open<'_>) -> Choice {
    let points = open.swept.len() as f64;
    let weight = |patch: &Patch| {
        let left = patch.points.iter().filter(|&&point| !open.swept[point as usize]);
        left.count() as f64
    };
    let mut weights: Vec<f64> = open.patches.iter().map(weight).collect();
    let is_made = |site: &&Site| open.made.contains(&site.stance);
    let (old, new): (Vec<&Site>, Vec<&Site>) = open.sites.iter().partition(|site| is_made(site));
    let again = solve(&old, &weights, vec![PLAN * points; old.len()], old.len());
    let mut stops = split(&old, &again, &weights, PLAN * points);
    for patch in stops.iter().flat_map(|stop| &stop.shares).flat_map(|share| &share.patches) {
        weights[*patch as usize] = 0.0;
    }
    let room = open.most.map_or(new.len(), |most| most.saturating_sub(open.made.len()));
    let uneven = |site: &&Site| if open.together { ALONE * uneven(site, &weights) } else { 0.0 };
    let costs = new.iter().map(|site| STOP * points + uneven(site)).collect();
    let cover = solve(&new, &weights, costs, room);
    stops.extend(split(&new, &cover, &weights, PLAN * points));
    Choice { stops, cover }
}

/// How many points more than half of all the busier of two arms sweeps at a place, however what both reach
/// is shared.
fn uneven(site: &Site, weights: &[f64]) -> f64 {
    let sum = |of: &[u32]| of.iter().map(|&patch| weights[patch as usize]).sum::<f64>();
    let all = sum(&union(&site.reached));
    // What the other one reaches it may leave to that one.
    let alone = site.reached.iter().map(|reached| all - sum(reached)).fold(0.0, f64::max);
    (alone - 0.5 * all).max(0.0)
}

fn solve(sites: &[&Site], weights: &[f64], costs: Vec<f64>, most: usize) -> Cover {
    cover(&Problem {
        weights: weights.to_vec(),
        sets: sites.iter().map(|site| union(&site.reached)).collect(),
        costs,
        most,
    })
}

/// Shares out what the chosen places reach: each time all that is left to whoever reaches most of it.
/// What is less than `least` is not worth a plan.
fn split(sites: &[&Site], cover: &Cover, weights: &[f64], least: f64) -> Vec<Stop> {
    let mut left = weights.to_vec();
    let mut stops: Vec<Stop> = cover
        .sets
        .iter()
        .map(|&site| Stop { stance: sites[site].stance.clone(), shares: Vec::new() })
        .collect();
    loop {
        let pairs = cover.sets.iter().enumerate().flat_map(|(stop, &site)| {
            (0..sites[site].reached.len()).map(move |arm| (stop, site, arm))
        });
        let worth = |(stop, site, arm): (usize, usize, usize)| -> (f64, usize, usize, usize) {
            let reached = sites[site].reached[arm].iter();
            (reached.map(|&patch| left[patch as usize]).sum(), stop, site, arm)
        };
        let best = pairs.map(worth).reduce(|best, next| if next.0 > best.0 { next } else { best });
        let Some((worth, stop, site, arm)) = best else { break };
        if worth <= least {
            break;
        }
        let is_open = |patch: &&u32| left[**patch as usize] > 0.0;
        let patches: Vec<u32> = sites[site].reached[arm].iter().filter(is_open).copied().collect();
        patches.iter().for_each(|&patch| left[patch as usize] = 0.0);
        stops[stop].shares.push(Share { stance: sites[site].stance.clone(), arm, patches });
    }
    stops.retain(|stop| !stop.shares.is_empty());
    stops
}
