//! One plan for one set of patches, and the patches that are put over what it leaves out.

use nullsweep_robot::{JointVector, Robot};
use nullsweep_surface::{Patch, PatchConfig, Scan, patches};
use rayon::prelude::*;

use super::clock::Clock;
use super::error::PipelineError;
use super::job::Job;
use crate::cost::{Cost, Effort, TaskTime};
use crate::motion::{Leg, Memo, Mover, layered};
use crate::plan::{Continues, CostKind, Method, Plan};
use crate::progress::{Progress, left_out};
use crate::roadmap::{Graph, Nodes, graph};
use crate::sweep::{Sight, coverage};
use crate::tour::formulation::{self, Stop};
use crate::workcell::stance::Stance;
use crate::workcell::{Bed, Sample, Workcell, reach, redundancies};

/// What every attempt at a plan shares, in the root frame.
pub(super) struct Planning<'a> {
    pub(super) robot: &'a Robot,
    pub(super) job: &'a Job,
    pub(super) stance: &'a Stance,
    pub(super) cell: Workcell<'a>,
    pub(super) scan: &'a Scan,
    /// The scan, and what may hide it.
    pub(super) sight: Sight<'a>,
    pub(super) bed: &'a Bed,
    pub(super) start: JointVector,
    /// Of each joint. \[rad/s\] or \[m/s\]
    pub(super) velocity: JointVector,
    /// Where the plan takes over from another one.
    pub(super) continues: Option<Continues>,
    /// The points of reachable patches.
    pub(super) to_sweep: &'a [bool],
    /// The points that were swept before the plan begins.
    pub(super) already: &'a [bool],
    pub(super) progress: &'a dyn Progress,
    /// Motions that were made before.
    pub(super) memo: Memo,
}

/// A plan with what it was made from.
pub(super) struct Attempt {
    pub(super) method: Method,
    pub(super) patches: Vec<Patch>,
    /// How many of them are places on strips.
    pub(super) places: usize,
    pub(super) visit: Vec<Option<Sample>>,
    pub(super) graph: Graph,
    pub(super) sequence: Sequence,
    pub(super) plan: Plan,
    /// The points to sweep that are not swept.
    pub(super) left: Vec<bool>,
}

impl Attempt {
    /// How many of all points to sweep are swept, up to a constant.
    pub(super) fn swept_points(&self) -> usize {
        self.left.iter().filter(|l| !**l).count()
    }
}

/// The joint path of the whole tour.
pub(super) struct Sequence {
    pub(super) visits: Vec<Visit>,
    pub(super) samples: usize,
    pub(super) dropped: Vec<usize>,
}

/// A stop of the arm with the way to it.
#[derive(Clone, Debug)]
pub struct Visit {
    /// The patch.
    pub patch: usize,
    /// The joint vector there.
    pub sample: Sample,
    /// How the arm comes there from the stop before, or from where it starts.
    pub leg: Leg,
}

impl Sequence {
    pub(super) fn jumps(&self) -> usize {
        self.visits.iter().filter(|v| v.leg.is_jump()).count()
    }
}

impl Planning<'_> {
    /// A plan that visits the patches for which `visit` has a sample; the first patches are those
    /// of `before`.
    pub(super) fn attempt(
        &self,
        method: Method,
        patches: Vec<Patch>,
        visit: Vec<Option<Sample>>,
        before: Option<&Attempt>,
        clock: &mut Clock,
    ) -> Result<Attempt, PipelineError> {
        let Self { job, cell, progress, .. } = *self;
        let graph = clock.time("graph", || {
            let nodes = Nodes { bed: self.bed, patches: &patches, reached: &visit };
            graph::build(cell, nodes, &job.graph, before.map(|b| &b.graph), progress)
        });
        progress.stage("tour", None);
        let tool_pose = job.tool.on(cell.arm).pose(&self.start);
        let tour = clock.time("gtsp", || {
            let order = match method {
                Method::Tsp => formulation::shortest,
                // Where there are no strips, or patches are put over what they leave out.
                Method::Curvature | Method::Raster => formulation::smoothest,
                Method::Joint => return self.joint_tour(&graph, &patches, &tool_pose),
            };
            order(&graph, &patches, &job.tool, &tool_pose, &job.formulation, job.seed)
        })?;
        self.attempted(method, patches, visit, graph, &tour, clock)
    }

    /// The attempt along a tour over the graph's patches.
    pub(super) fn attempted(
        &self,
        method: Method,
        patches: Vec<Patch>,
        visit: Vec<Option<Sample>>,
        graph: Graph,
        tour: &[Stop],
        clock: &mut Clock,
    ) -> Result<Attempt, PipelineError> {
        self.progress.stage("layered graph and transfers", None);
        let context =
            TourContext { planning: self, graph: &graph, patches: &patches, visit: &visit };
        let sequence = clock.time("layered", || match self.job.cost {
            CostKind::Effort => context.sequence(&Effort, tour),
            CostKind::Time => context.sequence(&TaskTime::new(&self.velocity), tour),
        })?;
        let plan = self.assemble(method, &patches, &sequence);
        let left = clock.time("coverage", || self.left(&plan));
        Ok(Attempt { method, patches, places: 0, visit, graph, sequence, plan, left })
    }

    /// Says which stops an attempt comes to in no way.
    pub(super) fn tell_left_out(&self, attempt: &Attempt) {
        let dropped = &attempt.sequence.dropped;
        let names = match attempt.method {
            Method::Raster => ["place", "places"],
            Method::Tsp | Method::Curvature | Method::Joint => ["patch", "patches"],
        };
        if !dropped.is_empty() {
            self.progress.note(&left_out(names, dropped, "no motion there was found"));
        }
    }

    /// The points to sweep that the plan leaves out.
    pub(super) fn left(&self, plan: &Plan) -> Vec<bool> {
        let (motion, speed) = (plan.trajectory(), self.job.working_speed());
        let swept = coverage::done_by(self.sight, motion, self.cell.arm, speed);
        (0..swept.len()).map(|i| self.to_sweep[i] && !swept[i] && !self.already[i]).collect()
    }

    /// Patches of at least `min_points` over what is left, at most as far across as the pad is
    /// wide: swept at any heading.
    pub(super) fn fill_in(&self, left: &[bool], min_points: usize) -> Vec<Patch> {
        let epsilon = self.fill_in_radius();
        let config = PatchConfig { epsilon, min_points, ..self.job.patches.clone() };
        let found = patches::fill_in(self.scan, left, &config, self.job.tool.reach_angle);
        found.into_iter().filter_map(|patch| self.bed.laid(patch)).collect()
    }

    pub(super) fn fill_in_radius(&self) -> f64 {
        self.job.patches.epsilon.min(self.job.tool.inner_radius())
    }

    /// The patches with others over what the attempt leaves out; `None` where nothing can be
    /// gained.
    pub(super) fn refine(
        &self,
        attempt: &Attempt,
        clock: &mut Clock,
    ) -> Option<(Vec<Patch>, Vec<Option<Sample>>)> {
        self.progress.stage("fill in", None);
        let extra = self.fill_in(&attempt.left, self.job.patches.min_points);
        let reached = clock.time("reach", || reach(self.cell, &extra, self.job.ik_samples, &|| ()));
        if !reached.iter().any(Option::is_some) {
            return None;
        }
        let mut patches = attempt.patches.clone();
        let mut visit = attempt.visit.clone();
        // What was out of reach of every motion would only be tried in vain again.
        for &patch in &attempt.sequence.dropped {
            visit[patch] = None;
        }
        for (patch, sample) in extra.into_iter().zip(reached).filter(|(_, s)| s.is_some()) {
            patches.push(patch);
            visit.push(sample);
        }
        Some((patches, visit))
    }
}

/// What the layered search needs.
struct TourContext<'a> {
    planning: &'a Planning<'a>,
    graph: &'a Graph,
    patches: &'a [Patch],
    visit: &'a [Option<Sample>],
}

impl TourContext<'_> {
    /// The cheapest joint path through the tour's poses. A stop into which no motion is found is
    /// left out.
    fn sequence<C: Cost>(&self, cost: &C, tour: &[Stop]) -> Result<Sequence, PipelineError> {
        let Planning { cell, job, start, .. } = *self.planning;
        let continuous = cell.arm.continuous();
        let values = redundancies(cell.arm.ik().redundancy_range(), job.ik_samples);
        let layers: Vec<Vec<Sample>> =
            tour.par_iter().map(|stop| self.layer(stop, &values)).collect();
        let stops: Vec<usize> = tour.iter().map(|stop| stop.patch).collect();
        let memo = &self.planning.memo;
        let mover = Mover::new(cell, self.graph, &stops, cost, start, memo);
        let mut dropped = Vec::new();
        let path = layered::shortest(cost, continuous, &start, &layers, &mover, &mut |layer| {
            dropped.push(stops[layer]);
        });
        if path.layers.is_empty() {
            return Err(PipelineError::NoMotion { reachable: tour.len() });
        }
        let visits = path
            .layers
            .iter()
            .zip(&path.choice)
            .zip(path.motions)
            .map(|((&layer, &choice), motion)| Visit {
                patch: stops[layer],
                sample: layers[layer][choice],
                leg: motion.path,
            })
            .collect();
        Ok(Sequence { visits, samples: layers.iter().map(Vec::len).sum(), dropped })
    }

    /// All samples at a stop, or where it has none at the heading that reached the patch.
    fn layer(&self, stop: &Stop, values: &[f64]) -> Vec<Sample> {
        let layer = self.layer_at(stop, values);
        match self.visit[stop.patch] {
            Some(sample) if layer.is_empty() => {
                self.layer_at(&Stop { heading: sample.heading, ..*stop }, values)
            }
            _ => layer,
        }
    }

    /// All samples at a stop, also at the headings that are as good.
    fn layer_at(&self, stop: &Stop, values: &[f64]) -> Vec<Sample> {
        let cell = self.planning.cell;
        let mut layer = Vec::new();
        for turn in cell.tool.turns() {
            let stop = Stop { heading: stop.heading + turn, ..*stop };
            let contact = formulation::pose(self.patches, cell.tool, &stop);
            cell.samples(&contact, stop.heading, values, &mut layer);
        }
        layer
    }
}
