//! The best tour so far, and who is told of it.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::instance::Instance;
use crate::tour::{Tour, TourCost};

/// State of the search, told whenever the best tour has improved.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
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

/// Takes the progress; `Break` ends the search.
pub type Observer<'a> = dyn FnMut(&Progress<'_>) -> ControlFlow<()> + Send + 'a;

/// Keeps the best tour by its true cost and tells the observer.
pub(super) struct Record<'a, 'b> {
    instance: &'a Instance,
    best: Option<(Tour, TourCost)>,
    /// Trials made so far.
    pub(super) made: u64,
    target: Option<f64>,
    progress: Option<&'b mut Observer<'b>>,
    started: Instant,
    stopped: &'a AtomicBool,
}

impl<'a, 'b> Record<'a, 'b> {
    /// An empty record; sets `stopped` once a tour costs no more than `target`, or the observer
    /// breaks off.
    pub(super) fn new(
        instance: &'a Instance,
        target: Option<f64>,
        progress: Option<&'b mut Observer<'b>>,
        started: Instant,
        stopped: &'a AtomicBool,
    ) -> Self {
        Self { instance, best: None, made: 0, target, progress, started, stopped }
    }

    /// Considers a tour of the search.
    pub(super) fn offer(&mut self, tour: Tour) {
        let cost = tour.cost(self.instance);
        if self.best.as_ref().is_some_and(|(_, best)| !cost.better_than(best)) {
            return;
        }
        let mut end = self.target.is_some_and(|t| cost.total() <= t);
        if let Some(progress) = &mut self.progress {
            let elapsed = self.started.elapsed();
            end |= progress(&Progress { tour: &tour, cost, elapsed, trials: self.made }).is_break();
        }
        self.best = Some((tour, cost));
        if end {
            self.stopped.store(true, Ordering::Relaxed);
        }
    }

    /// The best tour, once one was offered.
    pub(super) fn best(&self) -> Option<&Tour> {
        self.best.as_ref().map(|(tour, _)| tour)
    }

    /// The best tour and its cost.
    pub(super) fn into_best(self) -> Option<(Tour, TourCost)> {
        self.best
    }
}
