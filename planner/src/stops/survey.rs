//! What is reached from where: many places on the floor, each looked at exactly.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use nullsweep_robot::Robot;
use nullsweep_surface::Patch;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::error::StopsError;
use super::floor::{Place, places, union};
use super::look::Ground;
use super::setup::Setup;
use crate::progress::Progress;
use crate::workcell::{Scene, Stance};

/// A place that was looked at.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Site {
    /// Where the robot stands.
    pub stance: Stance,
    /// For each arm the patches that it reaches, ascending.
    pub reached: Vec<Vec<u32>>,
}

impl Site {
    /// Patches that some arm reaches, ascending.
    #[must_use]
    pub fn union(&self) -> Vec<u32> {
        union(&self.reached)
    }
}

/// What is reached from where.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Survey {
    /// Places from which something is reached.
    pub sites: Vec<Site>,
    /// Places from which an arm is long enough for something, the body clear.
    pub places: usize,
    /// How many of them were looked at.
    pub looked: usize,
}

impl Survey {
    /// Which of so many patches are reached from somewhere.
    #[must_use]
    pub fn union(&self, patches: usize) -> Vec<bool> {
        let mut union = vec![false; patches];
        let all = self.sites.iter().flat_map(|site| site.reached.iter().flatten());
        all.for_each(|&patch| union[patch as usize] = true);
        union
    }
}

/// Places that are looked at side by side before the next are picked.
const SIDE_BY_SIDE: usize = 12;
/// Places that are looked at: for each patch so many shares of one, but no fewer and no more than these.
const LOOKS_EACH: f64 = 1.2;
const LOOKS: [usize; 2] = [100, 4000];
/// What another place that reaches a patch is worth beside one that does, and beside one that promised
/// it in vain.
const AGAIN: f64 = 0.5;
const IN_VAIN: f64 = 0.85;

/// Looks at places, each time at those that promise most of what fewest places reach; scene and patches
/// in the floor frame.
///
/// # Errors
/// See [`StopsError`].
pub fn survey(
    robot: &Robot,
    setup: &Setup,
    scene: &Scene,
    patches: &[Patch],
    progress: &dyn Progress,
) -> Result<Survey, StopsError> {
    let limbs = &setup.limbs(robot)?;
    progress.stage("places on the floor", None);
    let places = places(robot, setup, limbs, scene, patches)?;
    let count = places.len();
    let sketch = scene.sketch();
    let around = setup.around(robot, limbs);
    let ground = Ground { robot, setup, limbs, scene: &sketch, patches, around };
    let looks = ((LOOKS_EACH * patches.len() as f64) as usize).clamp(LOOKS[0], LOOKS[1]);
    progress.stage("stops: what is reached", Some(looks.min(count)));
    let mut worth: Vec<f64> = patches.iter().map(|p| p.points.len() as f64).collect();
    let mut open = Open::new(places, &worth);
    let (mut sites, mut looked) = (Vec::new(), 0);
    while looked < looks.min(count) {
        let batch = open.pick(&worth, SIDE_BY_SIDE.min(looks - looked));
        looked += batch.len();
        let found: Vec<_> = batch
            .par_iter()
            .map(|&at| {
                let place = &open.places[at];
                let found = ground.look(&place.stance, &ground.near(&place.stance)?);
                progress.tick();
                found
            })
            .collect();
        for (at, reached) in batch.into_iter().zip(found) {
            let place = &open.places[at];
            let reached = reached?.unwrap_or_default();
            let site = Site { stance: place.stance.clone(), reached };
            let union = site.union();
            for &patch in &place.promised {
                if union.binary_search(&patch).is_err() {
                    worth[patch as usize] *= IN_VAIN;
                }
            }
            union.iter().for_each(|&patch| worth[patch as usize] *= AGAIN);
            if !union.is_empty() {
                sites.push(site);
            }
        }
    }
    if sites.is_empty() {
        return Err(StopsError::NothingReached { patches: patches.len(), looked, places: count });
    }
    Ok(Survey { sites, places: count, looked })
}

/// Places by what they promise, so that the best are found without looking at all each time: what a
/// place promises beside those that were looked at only ever gets less.
struct Open {
    places: Vec<Place>,
    /// What each promises at most; below 0: taken.
    most: Vec<f64>,
}

impl Open {
    fn new(places: Vec<Place>, weights: &[f64]) -> Self {
        let most = places.par_iter().map(|place| promise(place, weights)).collect();
        Self { places, most }
    }

    /// The places that promise most, each after what those before it promise.
    fn pick(&mut self, now: &[f64], count: usize) -> Vec<usize> {
        let mut then = now.to_vec();
        let mut heap: BinaryHeap<Bid> = (0..self.places.len())
            .filter(|&at| self.most[at] >= 0.0)
            .map(|at| Bid { value: self.most[at], at, after: usize::MAX })
            .collect();
        let mut picked = Vec::new();
        while picked.len() < count
            && let Some(bid) = heap.pop()
        {
            let place = &self.places[bid.at];
            if bid.after == picked.len() {
                self.most[bid.at] = -1.0;
                place.promised.iter().for_each(|&patch| then[patch as usize] *= AGAIN);
                picked.push(bid.at);
                continue;
            }
            self.most[bid.at] = promise(place, now);
            heap.push(Bid { value: promise(place, &then), after: picked.len(), ..bid });
        }
        picked
    }
}

fn promise(place: &Place, worth: &[f64]) -> f64 {
    place.promised.iter().map(|&patch| worth[patch as usize]).sum()
}

/// What a place promises, looked at when so many were picked: the earlier one of two that are alike is
/// greater.
struct Bid {
    value: f64,
    at: usize,
    after: usize,
}

impl Ord for Bid {
    fn cmp(&self, other: &Self) -> Ordering {
        self.value.total_cmp(&other.value).then_with(|| other.at.cmp(&self.at))
    }
}

impl PartialOrd for Bid {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Bid {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Bid {}
