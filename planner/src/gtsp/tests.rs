//! Properties of the solver against the exact oracle.

use std::time::Instant;

use proptest::prelude::*;
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

use super::solve::rounds;
use super::{
    Block, Budget, Control, Costs, Ends, Instance, Jump, Solution, Tour, TourError, solve,
    solve_exact,
};

#[derive(Clone, Copy, Debug)]
enum Kind {
    Symmetric,
    Asymmetric,
    Sparse,
    Equal,
    Zero,
    HugeJump,
}

const KINDS: [Kind; 6] =
    [Kind::Symmetric, Kind::Asymmetric, Kind::Sparse, Kind::Equal, Kind::Zero, Kind::HugeJump];

fn random_instance(kind: Kind, clusters: usize, widest: usize, ends: usize, seed: u64) -> Instance {
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

fn search(instance: &Instance, trials: u64, threads: usize) -> Solution {
    let budget = Budget { threads, ..Budget::trials(trials) };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
    pool.install(|| rounds(instance, &budget, 5, Control::default(), Instant::now()))
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

#[test]
fn one_cluster_costs_nothing() {
    let costs = || Costs::Dense(vec![0.0; 9]);
    let closed = Instance::new(&[3], costs(), Jump::Forbidden, Ends::Closed).expect("fits");
    let solution = solve(&closed, &Budget::trials(10), 0).expect("limited");
    assert_eq!((solution.cost.total(), solution.gap()), (0.0, Some(0.0)));
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
