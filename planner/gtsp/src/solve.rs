//! The solver's front: budget, cancellation, and the epochs of the search.

use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

use crate::candidate_nodes::{CandidateNodes, polish};
use crate::exact;
use crate::ils::{Cooling, construct, descend, iterate};
use crate::instance::Instance;
use crate::local::LocalSearch;
use crate::population::{Epoch, Streams, evolve};
use crate::record::{Observer, Progress, Record};
use crate::search_tour::SearchTour;
use crate::table::Table;
use crate::tour::{Tour, TourCost};

/// Limits on the work: set trials, time or both.
///
/// Without a time limit the result depends on (instance, seed, trials, target) and nothing else, not
/// on the number of threads. A time limit cuts the search wherever it then stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Budget {
    /// Trials: kicks with their local search, and children of a crossing. The last generation is
    /// completed, so more may be made.
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

/// The best tour found.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Solution {
    /// Order of the clusters and the node chosen in each.
    pub tour: Tour,
    /// Its cost, recomputed from the instance.
    pub cost: TourCost,
    /// Trials made; 0 where the exact method sufficed.
    pub trials: u64,
    /// Time spent.
    pub elapsed: Duration,
    /// No tour costs less: the exact method found it.
    pub proven: bool,
}

/// Why there is nothing to return.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SolveError {
    /// Neither trials nor time limit the search.
    #[error("the budget has no limit: set trials, time or both")]
    NoLimit,
    /// The search keeps more costs than 32 bits count.
    #[error(
        "{nodes} nodes in {clusters} clusters are too many: the search counts costs in 32 bits"
    )]
    TooLarge {
        /// Clusters of the instance.
        clusters: usize,
        /// Nodes of the instance.
        nodes: usize,
    },
    /// The thread pool could not be made.
    #[error("could not start {threads} threads (0: one for every core): {reason}")]
    Threads {
        /// Threads asked for.
        threads: usize,
        /// What the thread pool said.
        reason: String,
    },
}

/// Watches and stops a search from outside.
#[derive(Default)]
pub struct Control<'a> {
    /// Called with every improvement; `Break` ends the search.
    pub progress: Option<&'a mut Observer<'a>>,
    /// Set it from any thread: the search ends within milliseconds, the best tour is returned.
    pub cancel: Option<&'a AtomicBool>,
    /// A tour of the same instance that the search goes on from; the result is never worse. One that
    /// does not fit the instance is passed over.
    pub start: Option<&'a Tour>,
}

impl fmt::Debug for Control<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Control")
            .field("progress", &self.progress.is_some())
            .field("cancel", &self.cancel)
            .field("start", &self.start)
            .finish()
    }
}

/// Best tour found within the budget; see [`Budget`] for what it depends on. Instances of a few
/// clusters are solved exactly, whatever the budget.
///
/// # Errors
/// Where the budget has no limit, the instance is too large, or the threads do not start.
pub fn solve(instance: &Instance, budget: &Budget, seed: u64) -> Result<Solution, SolveError> {
    solve_with(instance, budget, seed, Control::default())
}

/// [`solve`], watched and cancellable.
///
/// # Errors
/// As [`solve`].
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
        let solution = Solution { tour, cost, trials: 0, elapsed: started.elapsed(), proven: true };
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
        .map_err(|e| SolveError::Threads { threads: budget.threads, reason: e.to_string() })?;
    let full = pool
        .install(|| Table::new(instance))
        .ok_or(SolveError::TooLarge { clusters: instance.clusters(), nodes: instance.nodes() })?;
    Ok(pool.install(|| run_epochs(instance, &full, budget, seed, control, started)))
}

/// The search without the exact method; at least one tour is always made.
pub(super) fn run_epochs(
    instance: &Instance,
    full: &Table,
    budget: &Budget,
    seed: u64,
    control: Control<'_>,
    started: Instant,
) -> Solution {
    let mut candidates = CandidateNodes::select(full);
    let stopped = AtomicBool::new(false);
    let cancel = control.cancel;
    let stop = || {
        stopped.load(Ordering::Relaxed)
            || cancel.is_some_and(|c| c.load(Ordering::Relaxed))
            || budget.time.is_some_and(|t| started.elapsed() >= t)
    };
    let mut record = Record::new(instance, budget.target, control.progress, started, &stopped);
    let mut streams = Streams::new(seed);
    let limit = budget.trials.unwrap_or(u64::MAX);
    let mut elite: Vec<SearchTour> = Vec::new();
    if let Some(start) = control.start.filter(|start| start.check(instance).is_ok()) {
        elite.push(SearchTour::from_tour(full, start));
        record.offer(start.clone());
    }
    for number in 0.. {
        let left = limit.saturating_sub(record.made);
        let epoch = |table: &Table| {
            let likely = budget.time.map_or(u64::MAX, |time| {
                let rate = trials_a_second(table, seed) * rayon::current_num_threads() as f64;
                (rate * time.saturating_sub(started.elapsed()).as_secs_f64()) as u64
            });
            Epoch { number, limit: left, likely }
        };
        // Every other epoch has all nodes.
        if let Some(candidates) = candidates.as_mut().filter(|_| number % 2 == 0) {
            elite.iter().for_each(|tour| candidates.add_chosen(tour));
            let table = candidates.table(full);
            let mut reduced: Vec<SearchTour> =
                elite.iter().map(|tour| candidates.reduce(&table, tour)).collect();
            evolve(&table, epoch(&table), &mut reduced, &mut streams, &stop, &mut record);
            if !stopped.load(Ordering::Relaxed) {
                elite.extend(reduced.last().map(|winner| polish(full, &winner.to_tour(&table))));
                let best = record.best().map(|tour| polish(full, tour).to_tour(full));
                best.into_iter().for_each(|best| record.offer(best));
            }
        } else {
            evolve(full, epoch(full), &mut elite, &mut streams, &stop, &mut record);
        }
        // So few clusters are enumerated: one epoch has the optimum.
        if record.made >= limit || stop() || full.is_small() {
            break;
        }
    }
    let made = record.made;
    let (tour, cost) = record.into_best().expect("every epoch records a tour");
    Solution { tour, cost, trials: made, elapsed: started.elapsed(), proven: false }
}

/// How fast one thread is, by a few trials on a fresh tour.
fn trials_a_second(table: &Table, seed: u64) -> f64 {
    const TRIALS: u64 = 64;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut local = LocalSearch::new(table.m);
    let mut tour = construct(table, &mut rng);
    descend(table, &mut local, &mut tour);
    let cooling = Cooling { trials: TRIALS, from: 0.3, to: 0.03 };
    let started = Instant::now();
    iterate(table, &mut local, &mut tour, cooling, &mut rng, &|| false);
    TRIALS as f64 / started.elapsed().as_secs_f64().max(1e-9)
}
