//! Attempts whose stops are places on strips side by side, in place of the patches.

use nullsweep_surface::Patch;
use rayon::prelude::*;

use super::attempt::{Attempt, Planning};
use super::clock::Clock;
use super::error::PipelineError;
use super::swept::leave_out_swept;
use crate::plan::Method;
use crate::roadmap::graph::Step;
use crate::roadmap::{GraphConfig, Nodes, graph};
use crate::tour::formulation::{Stop, pose};
use crate::tour::raster::{Face, Place, order};
use crate::workcell::{Sample, middle_out, redundancies};

/// Farthest that strips are joined along the surface, as a share of the pad's length: it goes from
/// one strip to the next.
const JOIN: f64 = 1.5;
/// Farthest between neighbouring patches of a face, \[m\] and in radii of a patch's neighbourhood.
const NEAR_FACE: f64 = 0.10;
const NEAR_RADII: f64 = 2.5;
/// What lifting off counts as, in lengths of way. \[m\]
const LIFT: f64 = 1.0;
/// Turns of the pad from along its strip that are tried, in their order. \[°\]
const TURNS: [f64; 6] = [0.0, 30.0, -30.0, 60.0, -60.0, 90.0];
/// What a place off its strip's own heading costs, against turning from one place to the next.
const ASIDE: f64 = 0.2;
/// Fewest places of a strip, but over what others leave out.
const SHORTEST: usize = 2;
/// Times that strips are put over what others leave out.
const ROUNDS: usize = 2;

/// A place that the arm comes to.
#[derive(Clone)]
struct Reached {
    place: Place,
    sample: Sample,
}

/// For each face its rasters, those first that are likely to take the least time.
pub(super) struct Rasters(Vec<Vec<Vec<Vec<Place>>>>);

impl Rasters {
    /// The strips of all faces, of each those that come at `rank` or last; `None` where no face has
    /// so many.
    pub(super) fn at(&self, rank: usize) -> Option<Vec<Vec<Place>>> {
        self.0.iter().any(|of| of.len() > rank).then(|| {
            let of = |of: &Vec<Vec<Vec<Place>>>| of.get(rank).or(of.last()).cloned();
            self.0.iter().filter_map(of).flatten().collect()
        })
    }
}

impl Planning<'_> {
    /// The rasters of the faces of the patches that are marked.
    pub(super) fn rasters(&self, patches: &[Patch], marked: &[bool]) -> Rasters {
        let near = NEAR_FACE.max(NEAR_RADII * self.job.patches.epsilon);
        let faces = Face::all(self.scan, patches, marked, near);
        let of = |face: &Face| face.rasters(self.scan, self.bed, &self.job.tool);
        Rasters(faces.par_iter().map(of).collect())
    }

    /// The best of some attempts along strips, each with strips over what the one before has left
    /// out; `None` where the arm comes to none of them.
    pub(super) fn along_strips(
        &self,
        found: &[Patch],
        strips: Vec<Vec<Place>>,
        clock: &mut Clock,
    ) -> Result<Option<Attempt>, PipelineError> {
        let Self { job, .. } = *self;
        let mut runs = clock.time("reach", || self.reached(strips, SHORTEST));
        if runs.is_empty() {
            return Ok(None);
        }
        let mut best = self.through(found, &self.ordered(&runs, clock)?, clock)?;
        let spare = self.spare();
        for _ in 0..ROUNDS {
            let mut extra = self.fill_in(&best.left, job.patches.min_points);
            // The largest first, and no more than have to be.
            let mut left = best.left.iter().filter(|left| **left).count();
            extra.retain(|patch| {
                let is_wanted = left > spare;
                left = left.saturating_sub(patch.points.len());
                is_wanted
            });
            let rasters = self.rasters(&extra, &vec![true; extra.len()]);
            let more = self.reached(rasters.at(0).unwrap_or_default(), 1);
            if more.is_empty() {
                break;
            }
            runs.extend(more);
            let next = self.through(found, &self.ordered(&runs, clock)?, clock)?;
            if next.swept_points() <= best.swept_points() {
                break;
            }
            best = next;
        }
        Ok(Some(best))
    }

    /// The places of the strips in the order in which they are gone along.
    fn ordered(
        &self,
        runs: &[Vec<Reached>],
        clock: &mut Clock,
    ) -> Result<Vec<Reached>, PipelineError> {
        let Self { job, cell, .. } = *self;
        let start = job.tool.on(cell.arm).centre(&self.start);
        let trials = job.formulation.trials_per_cluster;
        let order = clock.time("gtsp", || {
            let strips: Vec<Vec<&Patch>> =
                runs.iter().map(|run| run.iter().map(|r| &r.place.patch).collect()).collect();
            order(&strips, &start, [self.join(), LIFT], trials, job.seed)
        })?;
        let mut stops: Vec<Reached> = Vec::new();
        for (strip, backwards) in order {
            let run = runs[strip].iter().cloned();
            if backwards { stops.extend(run.rev()) } else { stops.extend(run) }
        }
        Ok(stops)
    }

    fn join(&self) -> f64 {
        JOIN * self.job.tool.track()[0]
    }

    /// The strips as far as the arm comes to their places, cut where it does not, those of
    /// at least so many places.
    fn reached(&self, strips: Vec<Vec<Place>>, shortest: usize) -> Vec<Vec<Reached>> {
        let of = |strip: Vec<Place>| -> Vec<Vec<Reached>> {
            let samples: Vec<[Option<Sample>; TURNS.len()]> =
                strip.par_iter().map(|place| self.samples_of(place)).collect();
            let patches: Vec<Patch> = strip.iter().map(|p| p.patch.clone()).collect();
            let mut any: Vec<Option<Sample>> =
                samples.iter().map(|of| of.iter().flatten().next().copied()).collect();
            leave_out_swept(&mut any, &patches, self.already);
            let mut runs = Vec::new();
            let mut at = 0;
            for run in any.chunk_by(|a, b| a.is_some() == b.is_some()) {
                let here = at..at + run.len();
                at += run.len();
                if run[0].is_none() || run.len() < shortest {
                    continue;
                }
                let chosen = least_turning(&samples[here.clone()]);
                let places = strip[here].iter().cloned().zip(chosen);
                runs.push(places.map(|(place, sample)| Reached { place, sample }).collect());
            }
            runs
        };
        strips.into_iter().flat_map(of).collect()
    }

    /// A sample at a place for each turn of the pad from along its strip.
    fn samples_of(&self, place: &Place) -> [Option<Sample>; TURNS.len()] {
        let Self { job, cell, .. } = *self;
        let values = middle_out(redundancies(cell.arm.ik().redundancy_range(), job.ik_samples));
        TURNS.map(|turn| {
            if !job.tool.may_travel(turn.to_radians()) {
                return None;
            }
            let heading = place.heading + turn.to_radians();
            let stop = Stop { patch: 0, heading };
            let contact = pose(std::slice::from_ref(&place.patch), cell.tool, &stop);
            cell.first_sample(&contact, heading, &values)
        })
    }

    /// The attempt through some places in their order.
    fn through(
        &self,
        found: &[Patch],
        stops: &[Reached],
        clock: &mut Clock,
    ) -> Result<Attempt, PipelineError> {
        let Self { job, .. } = *self;
        let mut patches = found.to_vec();
        patches.extend(stops.iter().map(|stop| stop.place.patch.clone()));
        let mut visit: Vec<Option<Sample>> = vec![None; found.len()];
        visit.extend(stops.iter().map(|stop| Some(stop.sample)));
        let first = found.len();
        let tour: Vec<Stop> = (first..patches.len())
            .zip(stops)
            .map(|(patch, stop)| Stop { patch, heading: stop.sample.heading })
            .collect();
        // A stop may turn out not to be reached from the one before it.
        let near = |[(a, _), (b, _)]: &Step| {
            (patches[*b].centre - patches[*a].centre).norm() <= self.join()
        };
        let node = |k: usize| Some((tour.get(k)?.patch, tour[k].heading));
        let ahead = (0..tour.len()).flat_map(|k| [(k, k + 1), (k, k + 2)]);
        let steps = ahead.filter_map(|(a, b)| Some([node(a)?, node(b)?]));
        let steps: Vec<Step> = steps.filter(near).collect();
        let config = GraphConfig { radius: self.join(), ..job.graph };
        let graph = clock.time("graph", || {
            let nodes = Nodes { bed: self.bed, patches: &patches, reached: &visit };
            graph::of_steps(self.cell, nodes, &config, &steps)
        });
        let made = self.attempted(Method::Raster, patches, visit, graph, &tour, clock)?;
        Ok(Attempt { places: tour.len(), ..made })
    }
}

/// Of the samples of each place of a run one, so that the pad turns least along it; each place has
/// one.
fn least_turning(samples: &[[Option<Sample>; TURNS.len()]]) -> Vec<Sample> {
    let own = |turn: usize| ASIDE * TURNS[turn].abs();
    let change = |a: usize, b: usize| (TURNS[a] - TURNS[b]).abs();
    // The least to each turn of each place, and the turn before it.
    let mut labels: Vec<[(f64, usize); TURNS.len()]> = Vec::with_capacity(samples.len());
    for of in samples {
        let before = labels.last().copied();
        labels.push(std::array::from_fn(|turn| {
            if of[turn].is_none() {
                return (f64::INFINITY, 0);
            }
            let least = before.map_or((0.0, 0), |before| {
                let to = |k: usize| before[k].0 + change(k, turn);
                let from = (0..TURNS.len()).min_by(|&a, &b| to(a).total_cmp(&to(b)));
                from.map_or((f64::INFINITY, 0), |k| (to(k), k))
            });
            (least.0 + own(turn), least.1)
        }));
    }
    let mut chosen = Vec::with_capacity(samples.len());
    let ends = labels.last().map(|last| {
        let least = (0..TURNS.len()).min_by(|&a, &b| last[a].0.total_cmp(&last[b].0));
        least.unwrap_or(0)
    });
    let mut turn = ends.unwrap_or(0);
    for (of, label) in samples.iter().zip(&labels).rev() {
        chosen.extend(of[turn]);
        turn = label[turn].1;
    }
    chosen.reverse();
    chosen
}
