//! The order by the cost of the joint motion, in the tracked model.

use nalgebra::Isometry3;
use nullsweep_surface::Patch;
use rayon::prelude::*;

use super::attempt::Planning;
use crate::cost::{Cost, Effort, TaskTime};
use crate::motion::lift_cost;
use crate::plan::CostKind;
use crate::roadmap::Graph;
use crate::tour::formulation::{self, FormulationError, JUMP, Stop};
use crate::tour::joint::{self, Cluster, JointConfig, Metric, Problem};
use crate::workcell::redundancies;

impl Planning<'_> {
    /// The tour by [`Method::Joint`](crate::plan::Method::Joint) over the samples that are free of collision. The
    /// straight joint motion stands for the tracked one, which it bounds; a change of branch costs
    /// what lifting off does besides.
    pub(super) fn joint_tour(
        &self,
        graph: &Graph,
        patches: &[Patch],
        tool_pose: &Isometry3<f64>,
    ) -> Result<Vec<Stop>, FormulationError> {
        match self.job.cost {
            CostKind::Effort => self.tour_by(&Effort, graph, patches, tool_pose),
            CostKind::Time => {
                self.tour_by(&TaskTime::new(&self.velocity), graph, patches, tool_pose)
            }
        }
    }

    fn tour_by<C: Cost>(
        &self,
        cost: &C,
        graph: &Graph,
        patches: &[Patch],
        tool_pose: &Isometry3<f64>,
    ) -> Result<Vec<Stop>, FormulationError> {
        let Self { job, cell, .. } = *self;
        let lift = lift_cost(cost, cell.arm.dof());
        let metric = &Metric::new(cost, cell.arm.continuous(), cell.arm.dof(), lift);
        let values = redundancies(cell.arm.ik().redundancy_range(), job.ik_samples);
        let (mut source, mut seed) = (Some(self.start), job.seed);
        formulation::over_components(graph, patches, &job.tool, tool_pose, |component, here| {
            // A patch without a sample at any of its headings is for the layered search to see to.
            let (mut members, mut clusters, mut rest) = (Vec::new(), Vec::new(), Vec::new());
            let made: Vec<Cluster> = component
                .par_iter()
                .map(|&patch| self.cluster(graph, patches, patch, &values))
                .collect();
            for (&patch, cluster) in component.iter().zip(made) {
                if cluster.samples().is_empty() {
                    rest.push(formulation::incident_stops(graph, patch, &job.tool)[0]);
                } else {
                    members.push(patch);
                    clusters.push(cluster);
                }
            }
            if members.is_empty() {
                return Ok(rest);
            }
            let problem = Problem {
                metric,
                clusters: &clusters,
                adjacent: &joint::adjacent(graph, &members),
                jump: JUMP,
                jump_extra: lift,
                source: source.take(),
                first: formulation::nearest(patches, &members, here),
            };
            seed += 1;
            let tour = joint::solve(&problem, &JointConfig::default(), seed)?;
            let stops = tour.order.iter().zip(&tour.choice).map(|(&c, &k)| Stop {
                patch: members[c],
                heading: clusters[c].samples()[k].heading,
            });
            Ok(stops.chain(rest).collect())
        })
    }

    /// The samples of a patch at the headings in which its edges leave it.
    fn cluster(&self, graph: &Graph, patches: &[Patch], patch: usize, values: &[f64]) -> Cluster {
        let mut samples = Vec::new();
        for stop in formulation::incident_stops(graph, patch, self.cell.tool) {
            // All turns are of the one stop, whose heading the tour is told.
            for turn in self.cell.tool.turns() {
                let turned = Stop { heading: stop.heading + turn, ..stop };
                let contact = formulation::pose(patches, self.cell.tool, &turned);
                self.cell.samples(&contact, stop.heading, values, &mut samples);
            }
        }
        Cluster::new(samples)
    }
}
