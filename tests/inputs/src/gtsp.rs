//! A GTSPLIB file: read, solved, written and read again.

use nullsweep_gtsp::tsplib::{export, parse_gtsp, parse_tour_numbers};
use nullsweep_gtsp::{Budget, Effort, lower_bound, solve};

/// Nodes of an instance that is solved here.
const NODES: usize = 60;

pub(crate) fn run(bytes: &[u8]) -> bool {
    let _ = parse_tour_numbers(bytes);
    let Ok(file) = parse_gtsp(bytes) else { return false };
    if file.instance.nodes() > NODES {
        return true;
    }
    let budget = Budget { threads: 1, ..Budget::trials(3) };
    if let Ok(found) = solve(&file.instance, &budget, 1) {
        found.tour.check(&file.instance).expect("a tour of the instance");
        let numbers = file.tour_numbers(&found.tour);
        assert_eq!(numbers.len(), found.tour.clusters.len());
        let effort = Effort { steps: 60, time: None };
        if let Some(bound) = lower_bound(&file.instance, &found.tour, effort) {
            assert!(bound <= found.cost.total(), "{bound} above a tour");
        }
    }
    let mut text = Vec::new();
    export(&file.instance, "again", &mut text).expect("memory takes it");
    parse_gtsp(&text).expect("what was written can be read");
    true
}
