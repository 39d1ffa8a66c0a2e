//! The joint vectors from which a plan chooses: at each of its stops all that the planner samples.

use std::collections::HashMap;

use nullsweep_robot::JointVector;
use rayon::prelude::*;

use crate::pipeline::{Job, Outcome};
use crate::tour::formulation::{self, Stop};
use crate::workcell::{Sample, Workcell, redundancies};

/// Headings that are nearer to each other are one. \[rad\]
const SAME: f64 = 1e-9;

/// What is to be visited, and how one plan does it.
#[derive(Clone, Debug, PartialEq)]
pub struct Stops {
    /// Where the arm is before the first motion.
    pub start: JointVector,
    /// The patch of each place that is to be visited.
    pub patches: Vec<usize>,
    /// The joint vectors there: it is to be visited at one of them.
    pub samples: Vec<Vec<Sample>>,
    /// A way of visiting each place once: the place, and the number of its sample.
    pub order: Vec<(usize, usize)>,
}

impl Stops {
    /// The patches and places that a plan stops at, each with the joint vectors that put the pad on its
    /// middle, inside the margined limits and free of collision: at the headings in which the graph's
    /// edges lead on from there, and those that the plan has there, and at the job's redundancy values.
    /// The order is the plan's, at its first stop at each.
    #[must_use]
    pub fn of(outcome: &Outcome, job: &Job) -> Self {
        let cell = Workcell { arm: &outcome.arm, tool: &job.tool, world: &outcome.world };
        let values = redundancies(cell.arm.ik().redundancy_range(), job.ik_samples);
        let mut place: HashMap<usize, usize> = HashMap::new();
        let (mut firsts, mut headings) = (Vec::new(), Vec::<Vec<f64>>::new());
        let turn = job.tool.heading_range();
        for visit in &outcome.visits {
            let next = firsts.len();
            let at = *place.entry(visit.patch).or_insert(next);
            if at == next {
                firsts.push(visit);
                let edges = outcome.graph.incident.get(visit.patch).into_iter().flatten();
                let edges = edges.map(|&edge| outcome.graph.edges[edge].leaving(visit.patch));
                headings.push(edges.collect());
            }
            headings[at].push(visit.sample.heading);
        }
        // Two that are half a turn of a symmetric pad apart are the same two contacts.
        for list in &mut headings {
            list.sort_by(|a, b| a.rem_euclid(turn).total_cmp(&b.rem_euclid(turn)));
            list.dedup_by(|b, a| (b.rem_euclid(turn) - a.rem_euclid(turn)).abs() < SAME);
        }
        let samples: Vec<Vec<Sample>> = firsts
            .par_iter()
            .zip(headings)
            .map(|(visit, headings)| {
                let mut samples = Vec::new();
                let turns = job.tool.turns();
                for (heading, turn) in
                    headings.iter().flat_map(|h| turns.iter().map(move |t| (h, t)))
                {
                    let stop = Stop { patch: visit.patch, heading: heading + turn };
                    let contact = formulation::pose(&outcome.patches, &job.tool, &stop);
                    cell.samples(&contact, *heading, &values, &mut samples);
                }
                samples
            })
            .collect();
        Self::with(outcome, &place, samples)
    }

    /// With all joint vectors that the plan has at its stops among the samples, to the bit.
    fn with(
        outcome: &Outcome,
        place: &HashMap<usize, usize>,
        mut samples: Vec<Vec<Sample>>,
    ) -> Self {
        let mut order = vec![None; samples.len()];
        for visit in &outcome.visits {
            let at = place[&visit.patch];
            let known = samples[at].iter().position(|sample| sample.q == visit.sample.q);
            let sample = known.unwrap_or_else(|| {
                samples[at].push(visit.sample);
                samples[at].len() - 1
            });
            order[at].get_or_insert(sample);
        }
        // Places are numbered in the order in which the plan first comes to them.
        let order = order.into_iter().flatten().enumerate().collect();
        let mut patches = vec![0; samples.len()];
        place.iter().for_each(|(&patch, &at)| patches[at] = patch);
        Self { start: outcome.start, patches, samples, order }
    }
}
