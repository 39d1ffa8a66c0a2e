//! The solver's front: budget, progress, cancellation, and the rounds of the search.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::exact;
use super::instance::Instance;
use super::local::LocalSearch;
use super::search::{Cooling, construct, iterate, settle};
use super::table::Table;
use super::tour::{Tour, TourCost};

/// Limits on the work.
///
/// With trials alone the result depends on (instance, seed, trials) and nothing else. A time limit
/// cuts the search wherever it then stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Budget {
    /// Trials (kick, local search, acceptance); rounded up to whole rounds of runs.
    pub trials: Option<u64>,
    /// Wall-clock limit.
    pub time: Option<Duration>,
    /// Threads; 0: one for every core.
    pub threads: usize,
    /// Stop as soon as the total cost is this low.
    pub target: Option<f64>,
}

impl Budget {
    /// A number of trials on all cores: the reproducible kind.
    pub fn trials(trials: u64) -> Self {
        Self { trials: Some(trials), time: None, threads: 0, target: None }
    }

    /// A wall-clock limit on all cores.
    pub fn time(time: Duration) -> Self {
        Self { trials: None, time: Some(time), threads: 0, target: None }
    }
}

/// State of the search, told whenever the best tour has improved and after every round.
#[derive(Clone, Copy, Debug)]
pub struct Progress<'a> {
    /// Best tour so far.
    pub tour: &'a Tour,
    /// Its cost.
    pub cost: TourCost,
    /// Time since the start.
    pub elapsed: Duration,
    /// Trials made.
    pub trials: u64,
}

/// The best tour found.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// Order of the clusters and the node chosen in each.
    pub tour: Tour,
    /// Its cost, recomputed from the instance.
    pub cost: TourCost,
    /// Trials made; 0 where the exact method sufficed.
    pub trials: u64,
    /// Time spent.
    pub elapsed: Duration,
    /// No tour costs less than this.
    pub lower_bound: Option<f64>,
}

impl Solution {
    /// (cost − bound) / |bound|; `None` without a bound, 0 for a proven optimum.
    pub fn gap(&self) -> Option<f64> {
        self.lower_bound.map(|bound| {
            let excess = self.cost.total() - bound;
            if excess <= 0.0 { 0.0 } else { excess / bound.abs().max(f64::MIN_POSITIVE) }
        })
    }
}

/// Why there is nothing to return.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SolveError {
    /// Neither trials nor time limit the search.
    #[error("the budget has no limit: set trials, time or both")]
    NoLimit,
    /// The thread pool could not be made.
    #[error("could not start {threads} threads")]
    Threads {
        /// Threads asked for.
        threads: usize,
    },
}

/// Takes the progress; `Break` ends the search.
pub type Observer<'a> = dyn FnMut(&Progress<'_>) -> ControlFlow<()> + Send + 'a;

/// Watches and stops a search from outside.
#[derive(Default)]
pub struct Control<'a> {
    /// Called with every improvement; `Break` ends the search.
    pub progress: Option<&'a mut Observer<'a>>,
    /// Set it from any thread: the search ends within milliseconds, the best tour is returned.
    pub cancel: Option<&'a AtomicBool>,
}

/// Best tour found within the budget; the same for the same (instance, seed, trials) whatever the
/// number of threads.
pub fn solve(instance: &Instance, budget: &Budget, seed: u64) -> Result<Solution, SolveError> {
    solve_with(instance, budget, seed, Control::default())
}

/// [`solve`], watched and cancellable.
pub fn solve_with(
    instance: &Instance,
    budget: &Budget,
    seed: u64,
    control: Control<'_>,
) -> Result<Solution, SolveError> {
    if budget.trials.is_none() && budget.time.is_none() {
        return Err(SolveError::NoLimit);
    }
    let started = Instant::now();
    if let Some((tour, cost)) = exact::solve(instance) {
        let total = cost.total();
        let solution = Solution {
            tour,
            cost,
            trials: 0,
            elapsed: started.elapsed(),
            lower_bound: Some(total),
        };
        if let Some(progress) = control.progress {
            // Nothing is left to be stopped.
            let _ = progress(&Progress {
                tour: &solution.tour,
                cost,
                elapsed: solution.elapsed,
                trials: 0,
            });
        }
        return Ok(solution);
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(budget.threads)
        .build()
        .map_err(|_| SolveError::Threads { threads: budget.threads })?;
    Ok(pool.install(|| rounds(instance, budget, seed, control, started)))
}

/// Runs side by side in a round.
const RUNS: u64 = 8;
/// Trials of the first round's runs; later rounds double them.
const FIRST_TRIALS: u64 = 4000;

/// The search without the exact method; at least one run is always made.
pub(super) fn rounds(
    instance: &Instance,
    budget: &Budget,
    seed: u64,
    mut control: Control<'_>,
    started: Instant,
) -> Solution {
    let table = Table::new(instance);
    let stopped = AtomicBool::new(false);
    let cancel = control.cancel;
    let stop = || {
        stopped.load(Ordering::Relaxed)
            || cancel.is_some_and(|c| c.load(Ordering::Relaxed))
            || budget.time.is_some_and(|t| started.elapsed() >= t)
    };
    let limit = budget.trials.unwrap_or(u64::MAX);
    let mut best: Option<(Tour, TourCost)> = None;
    let mut made = 0;
    let mut round = 0;
    loop {
        let runs: Vec<_> = (0..RUNS)
            .into_par_iter()
            .filter_map(|run| {
                if run > 0 && stop() {
                    return None;
                }
                let mut rng = ChaCha8Rng::seed_from_u64(seed);
                rng.set_stream(round * RUNS + run);
                let mut local = LocalSearch::new(table.m);
                let mut tour = construct(&table, &mut rng);
                settle(&table, &mut local, &mut tour);
                let left = limit.saturating_sub(made).div_ceil(RUNS);
                let trials = (FIRST_TRIALS << round.min(8)).min(left);
                let cooling = Cooling { trials, from: 0.5, to: 0.03 };
                let made = iterate(&table, &mut local, &mut tour, cooling, &mut rng, &stop);
                Some((tour, made))
            })
            .collect();
        for (tour, trials) in runs {
            made += trials.max(1);
            let tour = table.tour(&tour.order, &tour.chosen);
            let cost = tour.cost(instance);
            if best.as_ref().is_none_or(|(_, b)| cost.better_than(b)) {
                best = Some((tour, cost));
                report(&best, &mut control, started, made, &stopped);
            }
        }
        round += 1;
        let reached = best.as_ref().zip(budget.target).is_some_and(|((_, c), t)| c.total() <= t);
        if made >= limit || stop() || reached {
            break;
        }
    }
    let (tour, cost) = best.expect("the first run of a round is never skipped");
    Solution { tour, cost, trials: made, elapsed: started.elapsed(), lower_bound: None }
}

fn report(
    best: &Option<(Tour, TourCost)>,
    control: &mut Control<'_>,
    started: Instant,
    trials: u64,
    stopped: &AtomicBool,
) {
    if let (Some((tour, cost)), Some(progress)) = (best, control.progress.as_mut()) {
        let told = Progress { tour, cost: *cost, elapsed: started.elapsed(), trials };
        if progress(&told).is_break() {
            stopped.store(true, Ordering::Relaxed);
        }
    }
}
