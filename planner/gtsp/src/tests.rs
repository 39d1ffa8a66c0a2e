//! Properties of the solver against the exact oracle.

use std::time::Instant;

use proptest::prelude::*;
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

use crate::solve::run_epochs;
use crate::table::Table;
use crate::{
    Block, Budget, Control, Costs, Effort, Ends, Instance, InstanceError, Jump, OnDemand, Progress,
    Solution, SolveError, Tour, TourError, lower_bound, solve, solve_exact, solve_with, tsplib,
};

#[derive(Clone, Copy, Debug)]
pub(super) enum Kind {
    Symmetric,
    Asymmetric,
    Sparse,
    Equal,
    Zero,
    HugeJump,
}

pub(super) const KINDS: [Kind; 6] =
    [Kind::Symmetric, Kind::Asymmetric, Kind::Sparse, Kind::Equal, Kind::Zero, Kind::HugeJump];

pub(super) fn random_instance(
    kind: Kind,
    clusters: usize,
    widest: usize,
    ends: usize,
    seed: u64,
) -> Instance {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let sizes: Vec<usize> = (0..clusters).map(|_| rng.random_range(1..=widest)).collect();
    let n: usize = sizes.iter().sum();
    let mut blocks = Vec::new();
    for a in 0..clusters {
        for b in a + 1..clusters {
            let sparse = matches!(kind, Kind::Sparse | Kind::HugeJump);
            if sparse && rng.random_range(0..3) > 0 {
                continue;
            }
            let mut costs = |rows: usize, columns: usize| -> Vec<f64> {
                (0..rows * columns)
                    .map(|_| match kind {
                        Kind::Equal => 7.0,
                        Kind::Zero => 0.0,
                        Kind::Sparse if rng.random_range(0..6) == 0 => f64::INFINITY,
                        _ => rng.random_range(1.0..1000.0),
                    })
                    .collect()
            };
            if matches!(kind, Kind::Asymmetric) {
                blocks.push(Block { from: a, to: b, costs: costs(sizes[a], sizes[b]) });
                blocks.push(Block { from: b, to: a, costs: costs(sizes[b], sizes[a]) });
            } else {
                blocks.extend(Block::both_ways(a, b, sizes[a], costs(sizes[a], sizes[b])));
            }
        }
    }
    let jump = match kind {
        Kind::HugeJump => Jump::Uniform(1e15),
        Kind::Sparse if seed.is_multiple_of(2) => {
            Jump::Table((0..clusters * clusters).map(|_| rng.random_range(100.0..5000.0)).collect())
        }
        _ => Jump::Uniform(2500.0),
    };
    let ends = match ends {
        0 => Ends::Closed,
        1 => Ends::OpenFromCosts((0..n).map(|_| rng.random_range(0.0..500.0)).collect()),
        _ => Ends::OpenFromCluster(rng.random_range(0..clusters)),
    };
    Instance::new(&sizes, Costs::Blocks(blocks), jump, ends).expect("the parts fit")
}

/// Clusters of 25 to 60 points of the plane, about as far apart as they are wide.
fn scattered(clusters: usize, spread: f64, seed: u64) -> Instance {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let sizes: Vec<usize> = (0..clusters).map(|_| rng.random_range(25..60)).collect();
    let mut points = Vec::new();
    for &size in &sizes {
        let centre = [0; 2].map(|_| rng.random_range(0.0..500.0));
        points.extend((0..size).map(|_| centre.map(|c| c + spread * rng.random_range(-1.0..1.0))));
    }
    let between = |p: [f64; 2], q: [f64; 2]| libm::hypot(p[0] - q[0], p[1] - q[1]);
    let costs = points.iter().flat_map(|&p| points.iter().map(move |&q| between(p, q))).collect();
    Instance::new(&sizes, Costs::Dense(costs), Jump::Forbidden, Ends::Closed)
        .expect("the parts fit")
}

fn search(instance: &Instance, trials: u64, threads: usize) -> Solution {
    let budget = Budget { threads, ..Budget::trials(trials) };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
    let full = Table::new(instance).expect("small enough");
    pool.install(|| run_epochs(instance, &full, &budget, 5, Control::default(), Instant::now()))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, ..ProptestConfig::default() })]

    #[test]
    fn search_reaches_the_exact_optimum(
        kind in 0..KINDS.len(), clusters in 1..9_usize, widest in 1..5_usize, ends in 0..3_usize, seed: u64,
    ) {
        let instance = random_instance(KINDS[kind], clusters, widest, ends, seed);
        let (optimal, cost) = solve_exact(&instance).expect("small enough");
        optimal.check(&instance).expect("valid");
        prop_assert_eq!(optimal.cost(&instance), cost);
        let found = search(&instance, 2000, 1);
        found.tour.check(&instance).expect("valid");
        prop_assert_eq!(found.tour.cost(&instance), found.cost);
        let (least, reached) = (cost.total(), found.cost.total());
        prop_assert!(reached >= least - 1e-6 * least.abs(), "{} below the optimum {}", reached, least);
        prop_assert!(reached <= least + 1e-6 * least.abs(), "{} above the optimum {}", reached, least);
        prop_assert_eq!(found.cost.jumps, cost.jumps);
        let effort = Effort { steps: 400, time: None };
        // The bound comes from any tour, not from the best one alone.
        let some = search(&instance, 1, 1);
        for tour in [&optimal, &some.tour] {
            if let Some(bound) = lower_bound(&instance, tour, effort) {
                prop_assert!(bound <= least + 1e-9 * least.abs(), "{} above the optimum {}", bound, least);
            }
        }
    }

    #[test]
    fn larger_tours_are_valid_and_repeatable(
        kind in 0..KINDS.len(), clusters in 20..60_usize, widest in 1..8_usize, ends in 0..3_usize, seed: u64,
    ) {
        let instance = random_instance(KINDS[kind], clusters, widest, ends, seed);
        let one = search(&instance, 500, 1);
        one.tour.check(&instance).expect("valid");
        prop_assert_eq!(one.tour.cost(&instance), one.cost);
        let two = search(&instance, 500, 2);
        prop_assert_eq!((one.tour, one.cost, one.trials), (two.tour, two.cost, two.trials));
    }
}

proptest! {
    // The oracle is slow on wide clusters.
    #![proptest_config(ProptestConfig { cases: 8, ..ProptestConfig::default() })]

    #[test]
    fn wide_clusters_lose_nothing_by_being_thinned(spread in 0.0..200.0, seed: u64) {
        let instance = scattered(9, spread, seed);
        let (_, cost) = solve_exact(&instance).expect("small enough");
        let found = search(&instance, 3000, 1);
        found.tour.check(&instance).expect("valid");
        prop_assert_eq!(found.tour.cost(&instance), found.cost);
        let (least, reached) = (cost.total(), found.cost.total());
        prop_assert!((reached - least).abs() <= 1e-6 * least, "{} instead of {}", reached, least);
        let two = search(&instance, 3000, 2);
        prop_assert_eq!((found.tour, found.cost, found.trials), (two.tour, two.cost, two.trials));
    }
}

#[test]
fn the_same_seed_gives_the_same_tour_on_any_number_of_threads() {
    let made = KINDS.map(|kind| random_instance(kind, 30, 6, 1, 4));
    // Its clusters are wide enough for candidate nodes.
    for instance in made.iter().chain([&scattered(20, 50.0, 8)]) {
        let [one, two, four] = [1, 2, 4].map(|threads| {
            let budget = Budget { threads, ..Budget::trials(3000) };
            let found = solve(instance, &budget, 7).expect("limited");
            (found.tour, found.cost, found.trials)
        });
        assert_eq!(one, two);
        assert_eq!(one, four);
    }
}

#[test]
fn the_bound_is_near_the_optimum() {
    let effort = Effort { steps: 2000, time: None };
    // Random costs are harder to bound than distances.
    let closed = (Kind::Asymmetric, 0, 0.25);
    for (kind, ends, most) in (0..3).map(|ends| (Kind::Symmetric, ends, 0.2)).chain([closed]) {
        let instance = random_instance(kind, 20, 3, ends, 3);
        let tour = search(&instance, 2000, 1).tour;
        let bound = lower_bound(&instance, &tour, effort).expect("small enough");
        assert_eq!(lower_bound(&instance, &tour, effort), Some(bound), "it is repeatable");
        let gap = tour.cost(&instance).total() / bound - 1.0;
        assert!(gap < most, "{kind:?}, ends {ends}: {gap}");
    }
}

#[test]
fn a_bound_needs_a_tour_without_forbidden_jumps() {
    let block = Block { from: 0, to: 1, costs: vec![1.0] };
    let costs = Costs::Blocks(vec![block]);
    let instance = Instance::new(&[1; 3], costs, Jump::Forbidden, Ends::Closed).expect("fits");
    let effort = Effort { steps: 10, time: None };
    let tour = Tour { clusters: vec![0, 1, 2], nodes: vec![0; 3] };
    assert_eq!(lower_bound(&instance, &tour, effort), None);
    let twice = Tour { clusters: vec![0, 1, 1], nodes: vec![0; 3] };
    assert_eq!(lower_bound(&instance, &twice, effort), None);
}

#[test]
fn the_readme_shows_the_example() {
    let example = include_str!("../examples/solve.rs");
    let code = &example[example.find("use ").expect("imports")..];
    assert!(include_str!("../README.md").contains(code), "README.md and examples/solve.rs differ");
}

#[test]
fn bad_instances_are_named() {
    let dense = |costs: Vec<f64>, jump, ends| {
        Instance::new(&[1, 2], Costs::Dense(costs), jump, ends).expect_err("does not fit")
    };
    let mut costs = vec![1.0; 9];
    assert_eq!(
        dense(vec![1.0; 8], Jump::Forbidden, Ends::Closed).to_string(),
        "the dense matrix has 8 entries, expected 9"
    );
    assert_eq!(
        dense(costs.clone(), Jump::Table(vec![1.0, 2.0, f64::INFINITY, 0.0]), Ends::Closed),
        InstanceError::JumpPrice { entry: 2, value: f64::INFINITY }
    );
    assert_eq!(
        dense(costs.clone(), Jump::Forbidden, Ends::OpenFromCluster(2)),
        InstanceError::StartCluster { cluster: 2, clusters: 2 }
    );
    costs[5] = f64::NAN; // inside the second cluster: never read
    costs[6] = f64::NEG_INFINITY;
    assert_eq!(
        dense(costs, Jump::Forbidden, Ends::Closed),
        InstanceError::Cost {
            what: "the dense matrix".to_owned(),
            entry: 6,
            value: f64::NEG_INFINITY
        }
    );
    let neighbours = Some(vec![vec![1], vec![1]]);
    let on_demand = OnDemand { neighbours, cost: std::sync::Arc::new(|_, _, _, _| 1.0) };
    assert_eq!(
        Instance::new(&[1, 2], Costs::OnDemand(on_demand), Jump::Forbidden, Ends::Closed)
            .expect_err("a cluster joined with itself"),
        InstanceError::ClusterPair { from: 1, to: 1, clusters: 2 }
    );
}

#[test]
fn a_budget_without_a_limit_is_refused() {
    let instance = random_instance(KINDS[0], 3, 2, 0, 1);
    let unlimited = Budget { trials: None, ..Budget::trials(0) };
    assert_eq!(solve(&instance, &unlimited, 1), Err(SolveError::NoLimit));
}

#[test]
fn more_costs_than_32_bits_count_are_refused() {
    let cost = std::sync::Arc::new(|_, i, _, j| (i * j) as f64);
    let costs = Costs::OnDemand(OnDemand { neighbours: None, cost });
    let instance =
        Instance::new(&[10_000; 20], costs, Jump::Forbidden, Ends::Closed).expect("fits");
    let error = SolveError::TooLarge { clusters: 20, nodes: 200_000 };
    assert_eq!(solve(&instance, &Budget::trials(1), 1), Err(error));
}

#[test]
fn one_cluster_costs_nothing() {
    let costs = || Costs::Dense(vec![0.0; 9]);
    let closed = Instance::new(&[3], costs(), Jump::Forbidden, Ends::Closed).expect("fits");
    let solution = solve(&closed, &Budget::trials(10), 0).expect("limited");
    assert_eq!((solution.cost.total(), solution.proven), (0.0, true));
    let open =
        Instance::new(&[3], costs(), Jump::Forbidden, Ends::OpenFromCosts(vec![5.0, 2.0, 3.0]))
            .expect("fits");
    let solution = solve(&open, &Budget::trials(10), 0).expect("limited");
    assert_eq!((solution.tour.nodes, solution.cost.finite), (vec![1], 2.0));
}

#[test]
fn bad_tours_are_named() {
    let instance =
        Instance::new(&[1, 2], Costs::Dense(vec![1.0; 9]), Jump::Forbidden, Ends::Closed)
            .expect("fits");
    let check = |clusters: &[usize], nodes: &[usize]| {
        Tour { clusters: clusters.to_vec(), nodes: nodes.to_vec() }.check(&instance)
    };
    assert_eq!(check(&[0, 1], &[0, 1]), Ok(()));
    assert_eq!(check(&[1], &[0]), Err(TourError::Length { clusters: 1, nodes: 1, expected: 2 }));
    assert_eq!(check(&[1, 1], &[0, 1]), Err(TourError::Twice { cluster: 1 }));
    assert_eq!(check(&[0, 1], &[0, 2]), Err(TourError::Index { position: 1, cluster: 1, node: 2 }));
}

#[test]
fn many_clusters_are_solved_by_near_arcs() {
    // A grid: a tour of steps of length 1 is optimal.
    let side = 46;
    let at = move |c: usize| [(c % side) as f64, (c / side) as f64];
    let cost = move |a: usize, i: usize, b: usize, j: usize| {
        let (p, q) = (at(a), at(b));
        libm::hypot(p[0] - q[0], p[1] - q[1]) + (i + j) as f64
    };
    let costs = Costs::OnDemand(OnDemand { neighbours: None, cost: std::sync::Arc::new(cost) });
    let sizes = vec![2; side * side];
    let instance = Instance::new(&sizes, costs, Jump::Forbidden, Ends::Closed).expect("fits");
    let run = |threads| {
        let budget = Budget { threads, ..Budget::trials(1200) };
        solve(&instance, &budget, 1).expect("limited")
    };
    let (one, two) = (run(1), run(2));
    one.tour.check(&instance).expect("valid");
    let least = (side * side) as f64;
    assert!(one.cost.total() < 1.08 * least, "{} instead of {least}", one.cost.total());
    assert_eq!((one.tour, one.cost, one.trials), (two.tour, two.cost, two.trials));
}

#[test]
fn costs_on_demand_equal_stored_ones() {
    let sizes = vec![4; 30];
    let point = |a: usize, i: usize| {
        let k = (a * 4 + i) as f64;
        [libm::sin(k * 0.7) * 10.0, libm::cos(k * 1.3) * 10.0]
    };
    let cost = move |a: usize, i: usize, b: usize, j: usize| {
        let (p, q) = (point(a, i), point(b, j));
        libm::hypot(p[0] - q[0], p[1] - q[1])
    };
    let n = 120;
    let matrix: Vec<f64> =
        (0..n * n).map(|k| (k / n, k % n)).map(|(u, v)| cost(u / 4, u % 4, v / 4, v % 4)).collect();
    let solve = |costs| {
        let instance = Instance::new(&sizes, costs, Jump::Forbidden, Ends::Closed).expect("fits");
        solve(&instance, &Budget::trials(3000), 3).expect("limited")
    };
    let on_demand = OnDemand { neighbours: None, cost: std::sync::Arc::new(cost) };
    let (one, two) = (solve(Costs::Dense(matrix)), solve(Costs::OnDemand(on_demand)));
    assert_eq!((one.tour, one.cost), (two.tour, two.cost));
}

#[test]
fn progress_improves_and_can_stop_the_search() {
    let instance = random_instance(KINDS[0], 40, 4, 0, 1);
    let mut told = Vec::new();
    let mut observe = |p: &Progress<'_>| {
        p.tour.check(&instance).expect("valid");
        told.push(p.cost.total());
        if told.len() == 2 {
            std::ops::ControlFlow::Break(())
        } else {
            std::ops::ControlFlow::Continue(())
        }
    };
    let control = Control { progress: Some(&mut observe), ..Control::default() };
    let solution = solve_with(&instance, &Budget::trials(u64::MAX), 1, control).expect("limited");
    assert_eq!(told.len(), 2);
    assert!(told[1] < told[0]);
    assert_eq!(solution.cost.total(), told[1]);
    let cancelled = std::sync::atomic::AtomicBool::new(true);
    let control = Control { cancel: Some(&cancelled), ..Control::default() };
    let solution = solve_with(&instance, &Budget::trials(u64::MAX), 1, control).expect("limited");
    solution.tour.check(&instance).expect("valid even so");
}

#[test]
fn a_search_goes_on_from_a_tour() {
    for kind in KINDS {
        let instance = random_instance(kind, 25, 3, 1, 2);
        let budget = |trials| Budget { threads: 1, ..Budget::trials(trials) };
        let good = solve(&instance, &budget(20_000), 1).expect("limited");
        let control = Control { start: Some(&good.tour), ..Control::default() };
        let next = solve_with(&instance, &budget(1), 2, control).expect("limited");
        next.tour.check(&instance).expect("valid");
        assert!(!good.cost.better_than(&next.cost), "{:?} {:?}", next.cost, good.cost);
    }
}

#[test]
fn published_optima_are_reached() {
    let dir = std::env::var_os("GTSPLIB").map_or_else(
        || concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/gtsplib").into(),
        std::path::PathBuf::from,
    );
    if !dir.is_dir() {
        eprintln!("skipped: no GTSPLIB instances at {}; name them by GTSPLIB=DIR", dir.display());
        return;
    }
    for (name, optimum) in
        [("11berlin52", 4040.0), ("14ft70", 7707.0), ("35ftv170", 1205.0), ("53gil262", 1013.0)]
    {
        let file = tsplib::read_gtsp(dir.join(name).with_extension("gtsp")).expect("readable");
        let budget = Budget { target: Some(optimum), ..Budget::trials(60_000) };
        let solution = solve(&file.instance, &budget, 1).expect("limited");
        solution.tour.check(&file.instance).expect("valid");
        assert_eq!(solution.cost.total(), optimum, "{name}");
    }
}
