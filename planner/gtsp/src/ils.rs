//! Construction and localised iterated local search.

use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;

use crate::local::LocalSearch;
use crate::search_tour::SearchTour;
use crate::table::Table;

/// Longest of the two stretches that a kick exchanges.
const KICK: usize = 30;

/// A randomised nearest-neighbour tour, nodes chosen as it goes.
pub(super) fn construct(table: &Table, rng: &mut ChaCha8Rng) -> SearchTour {
    let m = table.m;
    // Some tours keep to the nearest, some stray.
    let odds = rng.random_range(2..12);
    let mut chosen = vec![0; m];
    let mut visited = vec![false; m];
    let mut order = Vec::with_capacity(m);
    // Clusters on the way that may have others near them which are not visited yet, and the first that
    // may not be visited.
    let (mut trail, mut first) = (Vec::with_capacity(m), 0);
    let mut here = table.root as u32;
    chosen[here as usize] = rng.random_range(0..table.sizes[here as usize]);
    loop {
        order.push(here);
        trail.push(here);
        visited[here as usize] = true;
        if order.len() == m {
            return SearchTour::new(table, order, chosen);
        }
        let mut best = (i32::MAX, here, 0);
        let consider = |b: u32, best: &mut (i32, u32, u32), skip: bool| {
            if visited[b as usize] || skip {
                return;
            }
            let (add, row) = table.row(here, chosen[here as usize], b);
            for (j, d) in row.iter().enumerate() {
                if d + add < best.0 {
                    *best = (d + add, b, j as u32);
                }
            }
        };
        for (b, _) in table.near_out(here) {
            let skip = rng.random_range(0..odds) == 0;
            consider(b, &mut best, skip);
        }
        if best.1 == here && table.has_all_pairs() {
            for b in 0..m as u32 {
                consider(b, &mut best, false);
            }
        }
        while best.1 == here {
            // A dead end: what is near the way that led here.
            let Some(&back) = trail.last() else { break };
            table.near_out(back).for_each(|(b, _)| consider(b, &mut best, false));
            if best.1 == here {
                trail.pop();
            }
        }
        while best.1 == here {
            consider(first, &mut best, false);
            first += u32::from(best.1 == here);
        }
        chosen[best.1 as usize] = best.2;
        here = best.1;
    }
}

/// Brings a fresh tour to a local optimum.
pub(super) fn descend(table: &Table, local: &mut LocalSearch, tour: &mut SearchTour) {
    for &c in &tour.order {
        local.push(c);
    }
    local.run(table, tour);
    local.optimiser.optimise_all(table, tour);
}

/// The optimum of a tour of so few clusters that the local search has no room: every order, each
/// with its best nodes.
pub(super) fn enumerate(table: &Table, local: &mut LocalSearch, tour: &mut SearchTour) {
    let m = table.m;
    let mut best = tour.clone();
    let mut counters = vec![0; m];
    let mut k = 1;
    // Heap's algorithm on the positions behind the root.
    while k < m {
        if counters[k] + 1 < k {
            let (x, y) = if k % 2 == 1 { (1, k) } else { (1 + counters[k], k) };
            tour.order.swap(x, y);
            *tour = SearchTour::new(table, tour.order.clone(), tour.chosen.clone());
            local.optimiser.optimise_all(table, tour);
            if tour.cost < best.cost {
                best.copy_from(tour);
            }
            counters[k] += 1;
            k = 1;
        } else {
            counters[k] = 0;
            k += 1;
        }
    }
    tour.copy_from(&best);
}

/// How one run of the iterated local search cools down.
#[derive(Clone, Copy)]
pub(super) struct Cooling {
    /// Trials of the run.
    pub(super) trials: u64,
    /// First and last temperature in units of the typical arc.
    pub(super) from: f64,
    /// See `from`.
    pub(super) to: f64,
}

/// Kicks, repairs and accepts by the temperature; returns the best tour met and the trials made.
/// `stop` is asked every 64 trials.
pub(super) fn iterate(
    table: &Table,
    local: &mut LocalSearch,
    tour: &mut SearchTour,
    cooling: Cooling,
    rng: &mut ChaCha8Rng,
    stop: &dyn Fn() -> bool,
) -> u64 {
    if table.is_small() {
        enumerate(table, local, tour);
        return 0;
    }
    let mut best = tour.clone();
    let mut kept = tour.clone();
    let ratio = cooling.to / cooling.from;
    let mut temperature = cooling.from * table.typical;
    let mut made = 0;
    while made < cooling.trials {
        if made % 64 == 0 {
            if stop() {
                break;
            }
            temperature = cooling.from
                * table.typical
                * libm::pow(ratio, made as f64 / cooling.trials as f64);
        }
        made += 1;
        kick(table, local, tour, rng);
        local.run(table, tour);
        let u: f64 = rng.random_range(f64::MIN_POSITIVE..1.0);
        let allowed = kept.cost + (-libm::log(u) * temperature) as i64;
        if tour.cost <= allowed {
            kept.copy_from(tour);
            if tour.cost < best.cost {
                best.copy_from(tour);
            }
        } else {
            tour.copy_from(&kept);
        }
    }
    local.optimiser.optimise_all(table, &mut best);
    tour.copy_from(&best);
    made
}

/// Turns the order of two or three neighbouring stretches around at a random place; of three, so
/// that no single exchange of the local search undoes it.
fn kick(table: &Table, local: &mut LocalSearch, tour: &mut SearchTour, rng: &mut ChaCha8Rng) {
    let m = tour.order.len();
    let longest = KICK.min((m - 2) / 3).max(1);
    let third = if rng.random::<bool>() { rng.random_range(1..=longest) } else { 0 };
    let lengths = [rng.random_range(1..=longest), rng.random_range(1..=longest), third];
    let all: usize = lengths.iter().sum();
    let first = rng.random_range(1..=m - all);
    let last = first + all - 1;
    let before = tour.stretch_cost(first - 1, last + 1);
    // a b c becomes b c a, then c b a.
    tour.exchange(first, first + lengths[0], last);
    if third > 0 {
        tour.exchange(first, first + lengths[1], first + lengths[1] + third - 1);
    }
    let ends = [first - 1, first + third - 1, first + third + lengths[1] - 1, last];
    for p in ends {
        tour.refresh(table, p);
        local.push(tour.at(p).0);
        local.push(tour.at(p + 1).0);
    }
    tour.cost += tour.stretch_cost(first - 1, last + 1) - before;
}
