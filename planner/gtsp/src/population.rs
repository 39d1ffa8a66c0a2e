//! The genetic algorithm: a population of local optima, crossed until nothing improves.

use rand::SeedableRng as _;
use rand::seq::SliceRandom as _;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::eax::Crossover;
use crate::ils::{Cooling, construct, descend, iterate};
use crate::local::LocalSearch;
use crate::record::Record;
use crate::search_tour::SearchTour;
use crate::table::Table;

/// Tours in the first epoch's population; later epochs double it up to three times.
const FIRST_POPULATION: usize = 30;
/// Trials per cluster that each tour of a fresh population gets.
const TRIALS_PER_CLUSTER: u64 = 5;
/// Trials that must suffice for a tour and its crossing, or one for each cluster where they are more.
const LEAST_TRIALS: u64 = 64;
/// Children made of one pair of parents at most.
const CHILDREN: usize = 30;
/// Generations without an improvement that end an epoch.
const IDLE_GENERATIONS: u32 = 3;

/// Random streams of one seed, handed out in a fixed order before the threads start.
pub(super) struct Streams {
    seed: u64,
    next: u64,
}

impl Streams {
    pub(super) fn new(seed: u64) -> Self {
        Self { seed, next: 0 }
    }

    /// A generator that no other task shares.
    fn next(&mut self) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(self.next);
        self.next += 1;
        rng
    }
}

/// How large an epoch may be.
#[derive(Clone, Copy)]
pub(super) struct Epoch {
    /// From 0 on.
    pub(super) number: u32,
    /// Most trials.
    pub(super) limit: u64,
    /// How many the time may suffice for.
    pub(super) likely: u64,
}

/// One epoch: a fresh population, crossed until nothing improves; then its best tour is crossed with
/// those of the earlier epochs, whose list it joins.
pub(super) fn evolve(
    table: &Table,
    epoch: Epoch,
    elite: &mut Vec<SearchTour>,
    streams: &mut Streams,
    stop: &(dyn Fn() -> bool + Sync),
    record: &mut Record<'_, '_>,
) {
    let Epoch { number, limit, likely } = epoch;
    let size = (FIRST_POPULATION as u64) << number.min(3);
    // Small budgets get small pools of tours that are worth crossing: half of the trials are left for
    // that.
    let sure = limit.min(likely);
    let size = size.min(sure / LEAST_TRIALS.max(table.m as u64)).max(1) as usize;
    let size = if table.is_small() { 1 } else { size };
    let trials = (TRIALS_PER_CLUSTER * table.m as u64).min(sure / (2 * size as u64));
    let tasks: Vec<_> = (0..size).map(|k| (k, streams.next())).collect();
    let fresh: Vec<(SearchTour, u64)> = tasks
        .into_par_iter()
        .filter_map(|(k, mut rng)| {
            if k > 0 && stop() {
                return None;
            }
            let mut local = LocalSearch::new(table.m);
            let mut tour = construct(table, &mut rng);
            descend(table, &mut local, &mut tour);
            let cooling = Cooling { trials, from: 0.3, to: 0.03 };
            let made = iterate(table, &mut local, &mut tour, cooling, &mut rng, stop);
            Some((tour, made + 1))
        })
        .collect();
    record.made += fresh.iter().map(|(_, made)| made).sum::<u64>();
    let mut population: Vec<SearchTour> = fresh.into_iter().map(|(tour, _)| tour).collect();
    record.offer(population[best_of(&population)].to_tour(table));
    let end = record.made.saturating_add(limit.saturating_sub(trials * size as u64));
    cross_until_idle(table, &mut population, end, streams, stop, record);
    let winner = best_of(&population);
    elite.push(population.swap_remove(winner));
    if elite.len() > 1 {
        cross_until_idle(table, &mut elite.clone(), end, streams, stop, record);
    }
}

fn best_of(population: &[SearchTour]) -> usize {
    (0..population.len()).min_by_key(|&k| population[k].cost).unwrap_or(0)
}

fn cross_until_idle(
    table: &Table,
    population: &mut [SearchTour],
    end: u64,
    streams: &mut Streams,
    stop: &(dyn Fn() -> bool + Sync),
    record: &mut Record<'_, '_>,
) {
    if table.is_small() {
        return; // Each tour is an optimum already.
    }
    let mut idle = 0;
    while idle < IDLE_GENERATIONS && population.len() > 1 && record.made < end && !stop() {
        population.shuffle(&mut streams.next());
        let pairs: Vec<_> = (0..population.len()).map(|k| (k, streams.next())).collect();
        let children: Vec<(Option<SearchTour>, u64)> = pairs
            .into_par_iter()
            .map(|(k, mut rng)| {
                if stop() {
                    return (None, 0);
                }
                cross(table, &population[k], &population[(k + 1) % population.len()], &mut rng)
            })
            .collect();
        idle += 1;
        record.made += 1;
        for (slot, (child, made)) in population.iter_mut().zip(children) {
            record.made += made;
            if let Some(child) = child {
                *slot = child;
                idle = 0;
            }
        }
        record.offer(population[best_of(population)].to_tour(table));
    }
}

/// The best child of two parents that is better than the first, and how many were tried.
fn cross(
    table: &Table,
    a: &SearchTour,
    b: &SearchTour,
    rng: &mut ChaCha8Rng,
) -> (Option<SearchTour>, u64) {
    let mut crossover = Crossover::default();
    let cycles = crossover.prepare(table, a, b, rng);
    let mut local = LocalSearch::new(table.m);
    let mut child = a.clone();
    let mut best: Option<SearchTour> = None;
    let mut chosen: Vec<usize> = (0..cycles).collect();
    chosen.shuffle(rng);
    chosen.truncate(CHILDREN);
    let made = chosen.len() as u64;
    for k in chosen {
        crossover.child(table, [a, b], k, &mut local, &mut child);
        if child.cost < best.as_ref().map_or(a.cost, |t| t.cost) {
            match &mut best {
                Some(best) => best.copy_from(&child),
                None => best = Some(child.clone()),
            }
        }
    }
    if let Some(best) = &mut best {
        local.optimiser.optimise_all(table, best);
    }
    (best, made)
}
