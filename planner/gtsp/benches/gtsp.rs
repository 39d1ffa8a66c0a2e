//! GTSP solver: trials of the search on made instances, against the transformation on the same ones.
//!
//! Run with `cargo bench -p nullsweep-gtsp`. One item is one trial, so the reports
//! compare as trials a second whatever the budget; both methods get the same number of trials.

use divan::Bencher;
use divan::counter::ItemsCount;
use nullsweep_gtsp::{Block, Budget, Costs, Ends, Instance, Jump, solve, solve_transformed};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

const TRIALS: u64 = 2000;
/// Clusters and nodes per cluster.
const SIZES: [(usize, usize); 3] = [(50, 5), (200, 5), (100, 20)];

fn main() {
    divan::main();
}

/// Clusters at random places of the unit square, nodes around them.
fn places(clusters: usize, nodes: usize) -> Vec<Vec<[f64; 2]>> {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    (0..clusters)
        .map(|_| {
            let centre: [f64; 2] = [rng.random(), rng.random()];
            (0..nodes).map(|_| centre.map(|x| x + 0.05 * rng.random::<f64>())).collect()
        })
        .collect()
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

fn dense((clusters, nodes): (usize, usize)) -> Instance {
    let points: Vec<[f64; 2]> = places(clusters, nodes).into_iter().flatten().collect();
    let matrix = points.iter().flat_map(|&a| points.iter().map(move |&b| distance(a, b))).collect();
    Instance::new(&vec![nodes; clusters], Costs::Dense(matrix), Jump::Forbidden, Ends::Closed)
        .expect("the parts fit")
}

/// Arcs between clusters at most three mean spacings apart, a path from a free start.
fn sparse((clusters, nodes): (usize, usize)) -> Instance {
    let places = places(clusters, nodes);
    let reach = 3.0 / (clusters as f64).sqrt() / 2.0;
    let mut blocks = Vec::new();
    for a in 0..clusters {
        for b in a + 1..clusters {
            if distance(places[a][0], places[b][0]) < reach {
                let costs =
                    places[a].iter().flat_map(|&x| places[b].iter().map(move |&y| distance(x, y)));
                blocks.extend(Block::both_ways(a, b, nodes, costs.collect()));
            }
        }
    }
    let start = Ends::OpenFromCosts(vec![0.0; clusters * nodes]);
    Instance::new(&vec![nodes; clusters], Costs::Blocks(blocks), Jump::Uniform(100.0), start)
        .expect("the parts fit")
}

fn bench_search(bencher: Bencher<'_, '_>, instance: &Instance) {
    let budget = Budget { threads: 1, ..Budget::trials(TRIALS) };
    bencher
        .counter(ItemsCount::new(TRIALS))
        .bench_local(|| solve(instance, &budget, 1).expect("limited").cost);
}

#[divan::bench(args = SIZES, sample_count = 5)]
fn dense_search(bencher: Bencher<'_, '_>, size: (usize, usize)) {
    bench_search(bencher, &dense(size));
}

#[divan::bench(args = SIZES, sample_count = 5)]
fn sparse_search(bencher: Bencher<'_, '_>, size: (usize, usize)) {
    bench_search(bencher, &sparse(size));
}

#[divan::bench(args = SIZES, sample_count = 5)]
fn dense_transformed(bencher: Bencher<'_, '_>, size: (usize, usize)) {
    let instance = dense(size);
    bencher
        .counter(ItemsCount::new(TRIALS))
        .bench_local(|| solve_transformed(&instance, TRIALS, 1, &|| false).1);
}
