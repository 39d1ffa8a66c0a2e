//! Side trips to what the tour leaves out: slivers between patches, and patches into which the
//! layered search found no motion.
//!
//! A side trip follows the surface from a stop nearby and comes back the same way. Where none
//! goes, a jump is put in between two stops that a jump joins anyway, or at the end, where it is
//! the least detour (cheapest insertion).
//!
//! Where the pad cannot lie in the middle of what is left, or would not touch it there, it is moved
//! and tilted as long as it still sweeps enough of it.
//!
//! A stop between two jumps would be a touch that sweeps nothing: it gets a stroke, a side trip to a
//! place beside it.

use std::cell::RefCell;
use std::collections::HashSet;

use nalgebra::UnitVector3;
use nullsweep_robot::JointVector;
use nullsweep_surface::{Patch, SurfacePoint, patches};
use rayon::prelude::*;

use super::attempt::{Attempt, Planning, Visit};
use super::clock::Clock;
use super::swept::SWEPT_SHARE;
use crate::cost::{Cost, Effort, TaskTime};
use crate::motion::layered::{Motion, Moves};
use crate::motion::{Leg, Mover};
use crate::plan::CostKind;
use crate::roadmap::Edge;
use crate::sweep::coverage;
use crate::tour::formulation::{Stop, pose};
use crate::workcell::{Sample, direction, reach, redundancies};

/// Times that patches are put over what is left: a side trip may leave slivers of its own.
const ROUNDS: usize = 3;
/// Least area that is worth a side trip, as a share of what the pad covers at any heading.
const WORTH: f64 = 0.05;
/// Stops nearby that a side trip is tried from.
const STOPS: usize = 8;
/// Samples that a side trip from one stop is tried to, nearest redundancy value first.
const TARGETS: usize = 12;
/// Lengths of a stroke, as shares of the pad's width, the one that sweeps more first.
const STROKES: [f64; 2] = [0.5, 0.15];
/// Directions in which one is tried.
const DIRECTIONS: usize = 8;
/// How far from the middle of what is left the pad is tried, as shares of half its width.
const SHIFTS: [f64; 2] = [0.45, 0.8];
/// Directions in which it is moved, and in which it is tilted.
const ASIDE: usize = 8;
/// How far it is tilted. \[rad\]
const TILT: f64 = 0.2;
/// Places of the pad for one group of points that are looked at, those that sweep most of it first.
const PLACES: usize = 32;
/// Headings that a jump is tried to.
const HEADINGS: usize = 4;
/// Jumps that are tried to one patch, least detour first, so many side by side.
const JUMPS: usize = 24;
const BATCH: usize = 4;

impl Planning<'_> {
    /// Adds visits to what the attempt has left out, as far as motions there are found.
    pub(super) fn complete(&self, attempt: &mut Attempt, clock: &mut Clock) {
        self.progress.stage("side trips", None);
        clock.time("side trips", || match self.job.cost {
            CostKind::Effort => Completion::new(self, &Effort).run(attempt),
            CostKind::Time => {
                Completion::new(self, &TaskTime::new(&self.velocity)).run(attempt);
            }
        });
        let Attempt { patches, sequence, left, .. } = attempt;
        sequence.dropped.retain(|&patch| {
            let points = &patches[patch].points;
            let swept = points.iter().filter(|&&i| !left[i as usize]).count();
            (swept as f64) < SWEPT_SHARE * points.len() as f64
        });
    }
}

struct Completion<'a, C> {
    planning: &'a Planning<'a>,
    cost: &'a C,
    /// Samples to which no jump led as they are not joined to where the arm is at first, no two alike.
    shut: RefCell<Vec<Sample>>,
}

impl<'p, C: Cost> Completion<'p, C> {
    fn new(planning: &'p Planning<'p>, cost: &'p C) -> Self {
        Self { planning, cost, shut: RefCell::default() }
    }

    fn run(&self, attempt: &mut Attempt) {
        let full = patches::full_neighbourhood(self.planning.scan, self.planning.fill_in_radius());
        let worth = ((WORTH * full as f64) as usize).max(1);
        // Backwards: a stroke moves only the stops behind it.
        let stops = attempt.sequence.visits.len();
        let strokes = (0..stops).rev().filter(|&at| self.stroke(attempt, at)).count();
        if strokes > 0 {
            self.renew(attempt);
        }
        for _ in 0..ROUNDS {
            let mut gained = false;
            let mut left = attempt.left.clone();
            for patch in self.planning.fill_in(&attempt.left, worth) {
                // A side trip sweeps more than the patch that it was made for.
                let open = patch.points.iter().filter(|&&i| left[i as usize]).count();
                if open < worth {
                    continue;
                }
                let Some(at) = self.visit_somewhere(attempt, &patch, worth, &left) else {
                    continue;
                };
                gained = true;
                let legs = if self.stroke(attempt, at) { at + 1..at + 2 } else { at..at + 1 };
                attempt.sequence.visits[legs].iter().for_each(|v| self.sweep(&v.leg, &mut left));
            }
            if !gained {
                return;
            }
            self.renew(attempt);
        }
    }

    /// The plan of the sequence as it is now, and what it leaves out.
    fn renew(&self, attempt: &mut Attempt) {
        attempt.plan = self.planning.assemble(attempt.method, &attempt.patches, &attempt.sequence);
        attempt.left = self.planning.left(&attempt.plan);
    }

    /// Gives a stop between two jumps a stroke along the surface and back, wherever beside it one
    /// goes; whether it did.
    fn stroke(&self, attempt: &mut Attempt, at: usize) -> bool {
        let Planning { bed, job, .. } = *self.planning;
        let visits = &attempt.sequence.visits;
        let jumps_on = visits.get(at + 1).is_none_or(|next| next.leg.is_jump());
        if !(visits[at].leg.is_jump() && jumps_on) {
            return false;
        }
        let Visit { patch, sample, .. } = &visits[at];
        let (stop, heading) = (attempt.patches[*patch].clone(), sample.heading);
        let mut choices = STROKES.iter().flat_map(|share| (0..DIRECTIONS).map(move |k| (share, k)));
        choices.any(|(share, k)| {
            let turn = std::f64::consts::TAU * k as f64 / DIRECTIONS as f64;
            if !job.tool.may_travel(turn) {
                return false;
            }
            let [_, along] = job.tool.track();
            let way = direction(&stop.normal, heading + turn) * (share * along);
            let Some(foot) = bed.surface().project(&(stop.centre + way), &stop.normal) else {
                return false;
            };
            let SurfacePoint { point: centre, normal } = foot;
            let beside = Patch { centre, normal, points: Vec::new(), rmse: 0.0 };
            let Some(beside) = bed.laid(beside) else { return false };
            attempt.patches.push(beside);
            let Some((sample, motion)) = self.insertion(attempt).reach_from(at) else {
                attempt.patches.pop();
                return false;
            };
            let to = Visit { patch: attempt.patches.len() - 1, sample, leg: motion.path };
            there_and_back(&mut attempt.sequence.visits, at + 1, to);
            true
        })
    }

    /// The search for motions to the last patch.
    fn insertion<'a>(&'a self, attempt: &'a Attempt) -> Insertion<'a, C> {
        let Planning { cell, job, start, ref memo, .. } = *self.planning;
        Insertion {
            planning: self.planning,
            cost: self.cost,
            mover: Mover::new(cell, &attempt.graph, &[], self.cost, start, memo),
            patches: &attempt.patches,
            visits: &attempt.sequence.visits,
            patch: attempt.patches.len() - 1,
            values: redundancies(cell.arm.ik().redundancy_range(), job.ik_samples),
        }
    }

    /// Takes out what the leg sweeps.
    fn sweep(&self, leg: &Leg, left: &mut [bool]) {
        let Planning { cell, sight, job, .. } = self.planning;
        let tool = job.tool.on(cell.arm);
        let poses: Vec<_> = leg.joints.iter().map(|q| tool.pose(q)).collect();
        for (left, swept) in left.iter_mut().zip(coverage::swept(*sight, &poses, &job.tool)) {
            *left &= !swept;
        }
    }

    /// Puts visits into the sequence from which the pad sweeps enough of the patch's points that are
    /// `left`: their first index.
    fn visit_somewhere(
        &self,
        attempt: &mut Attempt,
        patch: &Patch,
        worth: usize,
        left: &[bool],
    ) -> Option<usize> {
        let Planning { cell, job, .. } = *self.planning;
        let mut places = self.places(patch, worth, left);
        let reached = reach(cell, &places, job.ik_samples, &|| ());
        let mut reached = reached.into_iter();
        places.retain(|_| reached.next().is_some_and(|sample| sample.is_some()));
        places.into_iter().find_map(|place| {
            attempt.patches.push(place);
            let at = self.visit(attempt);
            if at.is_none() {
                attempt.patches.pop();
            }
            at
        })
    }

    /// Places of the pad in and around the middle of a patch, upright and tilted, where it sweeps at
    /// least `worth` of the patch's points that are `left` at any heading, those where it sweeps most
    /// first.
    fn places(&self, patch: &Patch, worth: usize, left: &[bool]) -> Vec<Patch> {
        let Planning { bed, scan, job, .. } = *self.planning;
        let turn = |k: usize| std::f64::consts::TAU * k as f64 / ASIDE as f64;
        let half = job.tool.inner_radius();
        let aside =
            SHIFTS.iter().flat_map(|share| (0..ASIDE).map(move |k| (share * half, turn(k))));
        let feet = std::iter::once((0.0, 0.0)).chain(aside).filter_map(|(far, to)| {
            let at = patch.centre + direction(&patch.normal, to) * far;
            bed.surface().project(&at, &patch.normal)
        });
        let around = feet.flat_map(|SurfacePoint { point: centre, normal }| {
            let tilted = (0..ASIDE).map(move |k| {
                let aside = direction(&normal, turn(k)) * libm::sin(TILT);
                UnitVector3::new_normalize(normal.scale(libm::cos(TILT)) + aside)
            });
            let normals = std::iter::once(normal).chain(tilted);
            normals.filter_map(move |normal| bed.laid(Patch { centre, normal, ..patch.clone() }))
        });
        let swept = |place: Patch| {
            let of =
                |i: &&u32| left[**i as usize] && coverage::sweeps(scan, **i, &place, &job.tool);
            (patch.points.iter().filter(of).count(), place)
        };
        let mut found: Vec<(usize, Patch)> = std::iter::once(patch.clone())
            .chain(around)
            .map(swept)
            .filter(|(points, _)| *points >= worth)
            .collect();
        found.sort_by_key(|(points, _)| std::cmp::Reverse(*points));
        found.truncate(PLACES);
        found.into_iter().map(|(_, place)| place).collect()
    }

    /// Puts visits of the last patch into the sequence; their first index, `None` where no motion
    /// there is found.
    fn visit(&self, attempt: &mut Attempt) -> Option<usize> {
        let insertion = self.insertion(attempt);
        let shut = &mut *self.shut.borrow_mut();
        let (at, there, after) =
            insertion.along_the_surface().or_else(|| insertion.through_free_space(shut))?;
        let visits = &mut attempt.sequence.visits;
        match after {
            After::Back => there_and_back(visits, at, there),
            After::On(leg) => {
                visits[at].leg = leg;
                visits.insert(at, there);
            }
            After::End => visits.push(there),
        }
        Some(at)
    }
}

/// Puts a visit to which a way along the surface leads behind the stop that it comes from, and the
/// same way back.
fn there_and_back(visits: &mut Vec<Visit>, at: usize, there: Visit) {
    let Visit { patch, sample, .. } = visits[at - 1];
    let back = Visit { patch, sample, leg: there.leg.reversed() };
    visits.splice(at..at, [there, back]);
}

/// How the arm goes on from a side insertion.
enum After {
    /// To the stop that it came from, the same way.
    Back,
    /// To the next stop, by this leg instead of the one it had.
    On(Leg),
    /// Not at all: it was the last one.
    End,
}

/// The search for motions to one patch.
struct Insertion<'a, C> {
    planning: &'a Planning<'a>,
    cost: &'a C,
    mover: Mover<'a, C>,
    patches: &'a [Patch],
    visits: &'a [Visit],
    /// Where to.
    patch: usize,
    /// Redundancy values to try. \[rad\]
    values: Vec<f64>,
}

impl<C: Cost> Insertion<'_, C> {
    /// The cheapest way from a stop nearby and back: the place of the new visit, the visit, and
    /// the way on.
    fn along_the_surface(&self) -> Option<(usize, Visit, After)> {
        let centre = self.patches[self.patch].centre;
        let mut near: Vec<(f64, usize)> = self
            .visits
            .iter()
            .enumerate()
            .map(|(i, v)| ((self.patches[v.patch].centre - centre).norm(), i))
            .filter(|&(distance, _)| distance > 1e-6 && distance <= self.planning.job.graph.radius)
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        near.truncate(STOPS);
        let found: Vec<Option<(usize, Sample, Motion<Leg>)>> =
            near.par_iter().map(|&(_, i)| self.reach_from(i).map(|(s, m)| (i, s, m))).collect();
        let (stop, sample, motion) =
            found.into_iter().flatten().min_by(|a, b| a.2.cost.total_cmp(&b.2.cost))?;
        let visit = Visit { patch: self.patch, sample, leg: motion.path };
        Some((stop + 1, visit, After::Back))
    }

    /// A way along the surface from one stop, the pad turned from the line as it is there.
    fn reach_from(&self, stop: usize) -> Option<(Sample, Motion<Leg>)> {
        let Planning { job, bed, .. } = self.planning;
        let Visit { patch, sample: from, .. } = &self.visits[stop];
        let [_, along] = job.tool.track();
        let edge = Edge::between(bed, self.patches, *patch, self.patch, &job.graph, along)?;
        let heading = edge.heading_b + from.heading - edge.heading_a;
        let mut targets: Vec<Sample> = self.samples(heading);
        targets.retain(|to| to.branch == from.branch);
        let apart = |to: &Sample| (to.redundancy - from.redundancy).abs();
        targets.sort_by(|a, b| apart(a).total_cmp(&apart(b)));
        targets
            .iter()
            .take(TARGETS)
            .find_map(|to| self.mover.along(&edge, false, from, to).map(|motion| (*to, motion)))
    }

    /// A jump to the patch and one from there on, in place of a jump or at the end. Samples that are
    /// like one of those that are `shut` in are not tried.
    fn through_free_space(&self, shut: &mut Vec<Sample>) -> Option<(usize, Visit, After)> {
        let continuous = self.planning.cell.arm.continuous();
        let straight =
            |from: &JointVector, to: &JointVector| self.cost.of(&continuous.displacement(from, to));
        let before = |at: usize| at.checked_sub(1).map(|b| &self.visits[b].sample);
        let q_before = |at: usize| before(at).map_or(&self.planning.start, |s| &s.q);
        let places: Vec<usize> = (0..self.visits.len())
            .filter(|&at| self.visits[at].leg.is_jump())
            .chain([self.visits.len()])
            .collect();
        let turn = self.planning.job.tool.heading_range();
        let mut choices: Vec<(f64, usize, Sample)> = (0..HEADINGS)
            .flat_map(|h| self.samples(turn * h as f64 / HEADINGS as f64))
            .flat_map(|sample| places.iter().map(move |&at| (at, sample)))
            .map(|(at, sample)| {
                let q = &sample.q;
                let detour = match self.visits.get(at).map(|next| &next.sample.q) {
                    None => straight(q_before(at), q),
                    Some(next) => {
                        straight(q_before(at), q) + straight(q, next) - straight(q_before(at), next)
                    }
                };
                (detour, at, sample)
            })
            .collect();
        choices.sort_by(|a, b| a.0.total_cmp(&b.0));
        // The best place of each sample is enough, and a sample that cannot be lifted off is none.
        let mut seen = HashSet::new();
        choices.retain(|(_, _, s)| seen.insert(s.q.map(f64::to_bits)));
        let is_shut = |shut: &[Sample], sample: &Sample| {
            shut.iter().any(|other| self.mover.are_alike(other, sample))
        };
        choices.retain(|(_, _, sample)| !is_shut(shut, sample));
        choices.truncate(JUMPS);
        choices.chunks(BATCH).find_map(|batch| {
            let made: Vec<Result<_, Option<Sample>>> = batch
                .par_iter()
                .filter(|(_, _, sample)| !is_shut(shut, sample))
                .map(|(_, at, sample)| {
                    let jump = self.mover.jump(before(*at), sample);
                    let is_joined = jump.is_some() || self.mover.is_joined(sample);
                    let there = jump.ok_or((!is_joined).then_some(*sample))?.path;
                    let after = match self.visits.get(*at) {
                        None => After::End,
                        Some(next) => {
                            After::On(self.mover.jump(Some(sample), &next.sample).ok_or(None)?.path)
                        }
                    };
                    Ok((*at, Visit { patch: self.patch, sample: *sample, leg: there }, after))
                })
                .collect();
            let mut found = None;
            for result in made {
                match result {
                    Ok(visit) => found = found.or(Some(visit)),
                    Err(Some(sample)) if !is_shut(shut, &sample) => shut.push(sample),
                    Err(_) => {}
                }
            }
            found
        })
    }

    /// All samples at the patch at one heading.
    fn samples(&self, heading: f64) -> Vec<Sample> {
        let Planning { cell, job, .. } = self.planning;
        let contact = pose(self.patches, &job.tool, &Stop { patch: self.patch, heading });
        let mut samples = Vec::new();
        cell.samples(&contact, heading, &self.values, &mut samples);
        samples
    }
}
