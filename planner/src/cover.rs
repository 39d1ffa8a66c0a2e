//! A weighted set cover: few places that reach much, and how far that can be from the best.
//!
//! Greedy from several first sets, each then by exchanges: a set is added, struck, or put in another's place as long as that gains. The
//! bound is the Lagrangian dual of the cover's linear relaxation, by subgradients: it holds whatever the
//! prices are that it was found with.

/// What is to be covered.
#[derive(Clone, Debug, Default)]
pub struct Problem {
    /// What each element is worth.
    pub weights: Vec<f64>,
    /// The elements of each set, each once.
    pub sets: Vec<Vec<u32>>,
    /// What each set costs, in the weights' unit.
    pub costs: Vec<f64>,
    /// Most sets that are chosen.
    pub most: usize,
}

/// Chosen sets.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cover {
    /// Indices of the sets, the one that gained most first.
    pub sets: Vec<usize>,
    /// What they cover, less what they cost.
    pub value: f64,
    /// No choice has more.
    pub bound: f64,
}

/// Steps of the bound.
const STEPS: usize = 400;
/// Rounds of exchanges at most.
const ROUNDS: usize = 60;
/// Sets that are begun with, those that cover most alone.
const STARTS: usize = 12;
/// Gains below this share of all weights are none.
const NONE: f64 = 1e-9;

struct State<'a> {
    of: &'a Problem,
    /// How many chosen sets have each element.
    times: Vec<u32>,
    chosen: Vec<usize>,
}

impl State<'_> {
    /// What the set would add, less its cost.
    fn gain(&self, set: usize) -> f64 {
        let open = self.of.sets[set].iter().filter(|&&e| self.times[e as usize] == 0);
        open.map(|&e| self.of.weights[e as usize]).sum::<f64>() - self.of.costs[set]
    }

    /// What is covered, less what it costs.
    fn value(&self) -> f64 {
        let covered = self.of.weights.iter().zip(&self.times).filter(|(_, times)| **times > 0);
        let costs: f64 = self.chosen.iter().map(|&set| self.of.costs[set]).sum();
        covered.map(|(weight, _)| weight).sum::<f64>() - costs
    }

    fn add(&mut self, set: usize) {
        self.of.sets[set].iter().for_each(|&e| self.times[e as usize] += 1);
        self.chosen.push(set);
    }

    fn strike(&mut self, at: usize) -> usize {
        let set = self.chosen.remove(at);
        self.of.sets[set].iter().for_each(|&e| self.times[e as usize] -= 1);
        set
    }

    /// The set that gains most, the first of those that are alike, and what it gains.
    fn best(&self) -> Option<(usize, f64)> {
        let open = (0..self.of.sets.len()).filter(|set| !self.chosen.contains(set));
        let gains = open.map(|set| (set, self.gain(set)));
        gains.reduce(|best, next| if next.1 > best.1 { next } else { best })
    }

    /// Adds what gains, as far as there may be more.
    fn fill(&mut self, least: f64) {
        while self.chosen.len() < self.of.most
            && let Some((set, gain)) = self.best()
            && gain > least
        {
            self.add(set);
        }
    }

    /// Puts another set in a chosen one's place, or none, where that gains; whether it did.
    fn exchange(&mut self, least: f64) -> bool {
        for at in 0..self.chosen.len() {
            let set = self.strike(at);
            let without = self.gain(set);
            match self.best() {
                Some((other, gain)) if gain > without.max(0.0) + least => self.add(other),
                _ if without < -least => {}
                _ => {
                    self.add(set);
                    // It goes back to where it was.
                    if let Some(set) = self.chosen.pop() {
                        self.chosen.insert(at, set);
                    }
                    continue;
                }
            }
            return true;
        }
        false
    }
}

/// Chooses sets that cover as much as they can for what they cost.
#[must_use]
pub fn cover(of: &Problem) -> Cover {
    let total: f64 = of.weights.iter().sum();
    let least = NONE * total;
    let empty = || State { of, times: vec![0; of.weights.len()], chosen: Vec::new() };
    let alone = empty();
    let mut firsts: Vec<usize> = (0..of.sets.len()).collect();
    firsts.sort_by(|&a, &b| alone.gain(b).total_cmp(&alone.gain(a)).then(a.cmp(&b)));
    firsts.truncate(if of.most == 0 { 0 } else { STARTS });
    let (mut state, mut most) = (empty(), 0.0);
    for first in firsts {
        let mut next = empty();
        next.add(first);
        next.fill(least);
        for _ in 0..ROUNDS {
            if !next.exchange(least) {
                break;
            }
            next.fill(least);
        }
        let value = next.value();
        if value > most {
            (state, most) = (next, value);
        }
    }
    // In the order in which they gain.
    let sets = std::mem::take(&mut state.chosen);
    state.times.fill(0);
    let (mut order, mut open, mut value) = (Vec::new(), sets, 0.0);
    while !open.is_empty() {
        let gains = open.iter().enumerate().map(|(at, &set)| (at, state.gain(set)));
        let best = gains.reduce(|best, next| if next.1 > best.1 { next } else { best });
        let Some((at, gain)) = best else { break };
        let set = open.remove(at);
        value += gain;
        state.add(set);
        order.push(set);
    }
    Cover { sets: order, value, bound: bound(of, value).max(value) }
}

/// What no choice exceeds. For prices u of the elements, 0 ≤ u ≤ w, no choice is worth more than
/// Σ (w − u) + Σ max(0, Σ u − c) over the sets, the `most` best of them.
fn bound(of: &Problem, known: f64) -> f64 {
    let mut price: Vec<f64> = of.weights.iter().map(|w| 0.5 * w).collect();
    let (mut best, mut scale, mut since) = (f64::INFINITY, 1.0, 0);
    for _ in 0..STEPS {
        let worth = |set: usize| -> f64 {
            of.sets[set].iter().map(|&e| price[e as usize]).sum::<f64>() - of.costs[set]
        };
        let mut taken: Vec<(f64, usize)> =
            (0..of.sets.len()).map(|set| (worth(set), set)).filter(|(w, _)| *w > 0.0).collect();
        taken.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        taken.truncate(of.most);
        let left: f64 = of.weights.iter().zip(&price).map(|(w, u)| w - u).sum();
        let dual = left + taken.iter().map(|(w, _)| w).sum::<f64>();
        if best.is_infinite() || dual < best - 1e-6 * best.abs() {
            (best, since) = (dual, 0);
        } else {
            since += 1;
            if since >= 15 {
                (scale, since) = (0.5 * scale, 0);
            }
        }
        // An element's price falls where it is taken more than once, and rises where it is not.
        let mut times = vec![-1.0; price.len()];
        for (_, set) in &taken {
            of.sets[*set].iter().for_each(|&e| times[e as usize] += 1.0);
        }
        let norm: f64 = times.iter().map(|t| t * t).sum();
        if norm == 0.0 || dual - known <= 1e-9 * dual.abs() {
            break;
        }
        let step = scale * (dual - known) / norm;
        for ((u, t), w) in price.iter_mut().zip(&times).zip(&of.weights) {
            *u = (*u - step * t).clamp(0.0, *w);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn drawn(seed: u64) -> Problem {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let weights: Vec<f64> = (0..30).map(|_| rng.random_range(1.0..20.0)).collect();
        let mut set = || -> Vec<u32> {
            let (middle, half) = (rng.random_range(0..30i32), rng.random_range(1..7i32));
            (0..30).filter(|e| (*e as i32 - middle).abs() <= half && rng.random_bool(0.7)).collect()
        };
        let sets: Vec<Vec<u32>> = (0..12).map(|_| set()).collect();
        Problem { costs: vec![12.0; sets.len()], weights, sets, most: 4 }
    }

    /// What a choice is worth, by the definition.
    fn worth(of: &Problem, chosen: u32) -> f64 {
        let taken: Vec<usize> = (0..of.sets.len()).filter(|s| chosen >> s & 1 == 1).collect();
        let has = |e: u32| taken.iter().any(|&s| of.sets[s].contains(&e));
        let covered = (0..of.weights.len()).filter(|&e| has(e as u32)).map(|e| of.weights[e]);
        covered.sum::<f64>() - taken.iter().map(|&s| of.costs[s]).sum::<f64>()
    }

    #[test]
    fn what_is_chosen_is_nearly_the_best_and_no_choice_passes_the_bound() {
        let (mut gaps, mut exact) = (0.0, 0);
        for seed in 0..40 {
            let problem = drawn(seed);
            let best = (0..1u32 << problem.sets.len())
                .filter(|c| c.count_ones() as usize <= problem.most)
                .map(|c| worth(&problem, c))
                .fold(0.0, f64::max);
            let found = cover(&problem);
            let chosen = found.sets.iter().map(|s| 1 << s).sum();
            assert!((worth(&problem, chosen) - found.value).abs() < 1e-9, "seed {seed}");
            assert!(found.sets.len() <= problem.most);
            assert!(found.bound >= best - 1e-9, "seed {seed}: {} < {best}", found.bound);
            assert!(found.value >= 0.95 * best, "seed {seed}: {} of {best}", found.value);
            exact += usize::from(found.value >= best - 1e-9);
            gaps += (found.bound - found.value) / found.value.max(1.0);
        }
        assert!(exact >= 32, "the best was found {exact} times of 40");
        assert!(gaps / 40.0 < 0.1, "mean gap {}", gaps / 40.0);
    }

    #[test]
    fn a_set_that_gains_less_than_it_costs_is_not_chosen() {
        let of = Problem {
            weights: vec![5.0, 1.0],
            sets: vec![vec![0], vec![0, 1]],
            costs: vec![1.0, 2.5],
            most: 9,
        };
        let found = cover(&of);
        assert_eq!((found.sets, found.value), (vec![0], 4.0));
        assert_eq!(cover(&Problem::default()).sets, Vec::<usize>::new());
    }
}
