//! A small instance, built, solved and printed.

use nullsweep_gtsp::{Block, Budget, Costs, Ends, Instance, Jump, solve};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Three clusters of 2, 1 and 2 nodes; arcs join 0 with 1 and 1 with 2, none joins 0 with 2.
    let mut blocks = Vec::new();
    blocks.extend(Block::both_ways(0, 1, 2, vec![4.0, 1.0]));
    blocks.extend(Block::both_ways(1, 2, 1, vec![f64::INFINITY, 2.0]));
    // An open path: the cost from the start to each node.
    let ends = Ends::OpenFromCosts(vec![0.0, 0.5, 9.0, 9.0, 9.0]);
    let instance = Instance::new(&[2, 1, 2], Costs::Blocks(blocks), Jump::Uniform(100.0), ends)?;

    let solution = solve(&instance, &Budget::trials(1000), 1)?;
    for (cluster, node) in solution.tour.clusters.iter().zip(&solution.tour.nodes) {
        println!("cluster {cluster}, node {node}");
    }
    println!("cost {}, jumps {}", solution.cost.finite, solution.cost.jumps);
    assert_eq!(solution.tour.nodes, [1, 0, 1]);
    assert_eq!(solution.cost.total(), 3.5);
    Ok(())
}
