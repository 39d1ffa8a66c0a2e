//! A plan in rounds: regions of greater priority first, pass after pass, each round from where the one
//! before has left the arm.

use nullsweep_robot::JointVector;
use nullsweep_surface::Patch;
use serde::{Deserialize, Serialize};

use super::attempt::{Attempt, Planning, Sequence};
use super::choice::{Made, made};
use super::clock::Clock;
use super::error::PipelineError;
use super::job::{End, Job};
use super::swept::{is_swept, leave_out_swept};
use crate::plan::{Left, Plan, PlanKnot};
use crate::regions::{Label, Regions, Round};
use crate::sweep::{Held, passes_over};
use crate::timing::Rest;
use crate::workcell::{Sample, Scene};

/// What came of a round.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RoundFigures {
    /// The regions that were to be swept.
    pub regions: Vec<String>,
    /// The how-manieth pass over them it is.
    pub pass: u32,
    /// How long it takes. \[s\]
    pub task_time_s: f64,
    /// How well the tool speed that was asked for is held.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tool_speed: Option<Held>,
}

/// What is to be swept in rounds.
pub(super) struct Course<'a> {
    regions: &'a Regions,
    /// Where each point of the surface belongs.
    labels: Vec<Label>,
    /// Points that are none of the plan's: left to others, or in no region that is to be swept.
    spared: Vec<bool>,
    /// How often the tool has passed over each before the plan begins.
    before: Vec<u32>,
}

/// What one round works on.
struct Turn {
    to_sweep: Vec<bool>,
    already: Vec<bool>,
    visit: Vec<Option<Sample>>,
    start: JointVector,
    job: Job,
}

impl<'a> Course<'a> {
    /// Of a scene in the floor frame, in which points on a border are on the same side whatever the stance.
    pub(super) fn new(scene: &'a Scene, job: &Job, before: Vec<u32>) -> Self {
        let regions = &scene.regions;
        let labels = regions.labels(&scene.surface.points);
        let others = job.spared.iter().copied().chain(std::iter::repeat(false));
        let of = labels.iter().zip(others);
        let spared = of.map(|(label, other)| other || !regions.is_wanted(*label)).collect();
        Self { regions, labels, spared, before }
    }

    /// The points that need not be swept: none of the plan's, or swept before.
    pub(super) fn already(&self) -> Vec<bool> {
        self.before.iter().zip(&self.spared).map(|(n, spared)| *n > 0 || *spared).collect()
    }

    /// The same when the plan was followed.
    pub(super) fn done(&self, swept: &[bool]) -> Vec<bool> {
        swept.iter().zip(&self.spared).map(|(swept, spared)| *swept || *spared).collect()
    }

    /// Says in a plan what it was made for.
    pub(super) fn mark(&self, plan: &mut Plan, to_sweep: &[bool]) {
        plan.regions = self.regions.marks(&self.labels);
        let surface = plan.surface.iter_mut().zip(to_sweep);
        surface.for_each(|(sample, to_sweep)| sample.reachable = *to_sweep);
    }

    /// The points that are not swept as they are in no region that is to be, or to be kept out of.
    pub(super) fn unwanted(&self, swept: &[bool]) -> impl Iterator<Item = Left> {
        let of = |cause: &str, is: &dyn Fn(Label) -> bool| {
            let points = (0..self.labels.len()).filter(|&i| is(self.labels[i]) && !swept[i]);
            Left { cause: cause.to_owned(), points: points.map(|i| i as u32).collect() }
        };
        let none = !self.regions.is_wanted(Label::None);
        let beside = of("in no region that is to be swept", &|l| none && l == Label::None);
        let kept = of("the tool keeps out of it", &|l| matches!(l, Label::KeepOut(_)));
        [beside, kept].into_iter().filter(|left| !left.points.is_empty())
    }

    /// The plan that goes through all rounds that have something to sweep. `whole` is what they share,
    /// and says what is to be swept at all.
    pub(super) fn made(
        &self,
        whole: &Planning<'_>,
        (patches, samples): (Vec<Patch>, Vec<Option<Sample>>),
        rest: Option<&Rest>,
        clock: &mut Clock,
    ) -> Result<(Made, Vec<RoundFigures>), PipelineError> {
        let rounds = self.regions.rounds();
        if let [only] = &rounds[..]
            && only.tool_speed.is_none()
        {
            return Ok((made(whole, patches, samples, rest, clock)?, Vec::new()));
        }
        self.tell_speed(whole, &rounds);
        let found = patches.len();
        let mut make = |turn: &Turn, is_first: bool| {
            let planning = whole.of_round(&turn.job, (&turn.to_sweep, &turn.already), turn.start);
            let rest = rest.filter(|_| is_first);
            made(&planning, patches.clone(), turn.visit.clone(), rest, clock)
        };
        let mut done: Vec<(&Round, Turn, Made)> = Vec::new();
        let mut none = PipelineError::NoMotion { reachable: 0 };
        for (k, round) in rounds.iter().enumerate() {
            let Some(turn) =
                self.turn(whole, round, k + 1 == rounds.len(), (&patches, &samples), &done)
            else {
                continue;
            };
            match make(&turn, done.is_empty()) {
                Ok(made) => done.push((round, turn, made)),
                Err(
                    error @ (PipelineError::NoMotion { .. } | PipelineError::NothingLeft { .. }),
                ) => none = error,
                Err(error) => return Err(error),
            }
        }
        // What was to come last had nothing to sweep.
        let end = whole.end();
        if let Some((round, mut turn, last)) = done.pop() {
            let last = if turn.job.end == end {
                last
            } else {
                turn.job.end = end;
                make(&turn, done.is_empty())?
            };
            done.push((round, turn, last));
        }
        let told = done.iter().map(|(round, turn, made)| self.told(whole, round, &turn.job, made));
        let told = told.collect();
        let all = done.into_iter().map(|(_, _, made)| made);
        Ok((all.reduce(|all, next| join(all, next, found)).ok_or(none)?, told))
    }

    /// What a round works on after those that are done; `None` where it has nothing to sweep.
    fn turn(
        &self,
        whole: &Planning<'_>,
        round: &Round,
        is_last: bool,
        (patches, samples): (&[Patch], &[Option<Sample>]),
        done: &[(&Round, Turn, Made)],
    ) -> Option<Turn> {
        let motions = done.iter().map(|(_, _, made)| made.plan.trajectory());
        let now = passes_over(whole.scan, motions, whole.cell.arm);
        let is_due = |label: Label| match label {
            Label::Sweep(region) => round.regions.contains(&region),
            Label::None | Label::KeepOut(_) => round.regions.is_empty(),
        };
        let due = |i: usize| !self.spared[i] && is_due(self.labels[i]);
        let points = 0..self.labels.len();
        let passed = |i: usize| self.before[i] + now[i] >= round.pass;
        let already: Vec<bool> = points.clone().map(|i| !due(i) || passed(i)).collect();
        let to_sweep = points.map(|i| whole.to_sweep[i] && due(i)).collect();
        let is_of =
            |patch: &Patch| patch.points.first().is_some_and(|&i| is_due(self.labels[i as usize]));
        let of = patches.iter().zip(samples);
        let mut visit: Vec<Option<Sample>> =
            of.map(|(patch, sample)| sample.filter(|_| is_of(patch))).collect();
        let (mut job, mut start) = (whole.job.clone(), whole.start);
        job.tool_speed = round.tool_speed.or(job.tool_speed);
        job.end = if is_last { whole.end() } else { End::Lifted };
        if let Some((_, _, before)) = done.last() {
            leave_out_swept(&mut visit, patches, &already);
            job.after = None;
            start = before.plan.knots.last()?.q;
        }
        let is_open = |(patch, sample): (&Patch, &Option<Sample>)| {
            sample.is_some() && !is_swept(patch, &already)
        };
        let some = patches.iter().zip(&visit).any(is_open);
        some.then_some(Turn { to_sweep, already, visit, start, job })
    }

    fn told(&self, whole: &Planning<'_>, round: &Round, job: &Job, made: &Made) -> RoundFigures {
        let name = |region: &usize| self.regions.all()[*region].name.clone();
        let held = |speed| Held::of(made.plan.trajectory(), whole.cell.arm, speed);
        RoundFigures {
            regions: round.regions.iter().map(name).collect(),
            pass: round.pass,
            task_time_s: made.plan.duration(),
            tool_speed: job.tool_speed.filter(|_| job.profile.is_curved()).map(held),
        }
    }

    fn tell_speed(&self, whole: &Planning<'_>, rounds: &[Round]) {
        let asked = rounds.iter().any(|round| round.tool_speed.is_some());
        if asked && !whole.job.profile.is_curved() {
            whole.progress.note(
                "the regions' tool speeds are not kept: at bang-bang velocity the joints alone say how \
                 fast the tool goes",
            );
        }
    }
}

impl<'a> Planning<'a> {
    /// What a round of it is: for this job, with points to sweep and those that are swept, from here.
    fn of_round<'b>(
        &self,
        job: &'b Job,
        (to_sweep, already): (&'b [bool], &'b [bool]),
        start: JointVector,
    ) -> Planning<'b>
    where
        'a: 'b,
    {
        Planning {
            robot: self.robot,
            job,
            stance: self.stance,
            cell: self.cell,
            scan: self.scan,
            sight: self.sight,
            bed: self.bed,
            start,
            velocity: self.velocity,
            continues: self.continues.clone().filter(|_| job.after.is_some()),
            to_sweep,
            already,
            progress: self.progress,
            memo: crate::motion::Memo::new(job.seed),
        }
    }

    /// Where the arm is left, whichever round is the last: at the start of the whole plan, not its own.
    fn end(&self) -> End {
        match self.job.end {
            End::Start => End::At(self.start),
            end => end,
        }
    }
}

/// One plan behind the other; both visit the same first patches, `found` of them.
fn join(all: Made, next: Made, found: usize) -> Made {
    let extra = all.attempt.patches.len() - found;
    let place = |patch: usize| if patch < found { patch } else { patch + extra };
    let Made { attempt: mut first, mut plan } = all;
    let Made { attempt: second, plan: behind } = next;
    let until = plan.knots.last().map_or(0, |knot| knot.time_ns);
    let Plan { knots, patches, .. } = behind;
    plan.knots.extend(knots.into_iter().skip(1).map(|knot| PlanKnot {
        time_ns: until + knot.time_ns,
        patch: knot.patch.map(|patch| place(patch as usize) as u32),
        ..knot
    }));
    plan.patches.extend(patches.into_iter().skip(found));
    let Sequence { visits, samples, dropped } = second.sequence;
    first.sequence.visits.extend(visits.into_iter().map(|mut visit| {
        visit.patch = place(visit.patch);
        visit
    }));
    first.sequence.samples += samples;
    first.sequence.dropped.extend(dropped.into_iter().map(place));
    first.sequence.dropped.sort_unstable();
    first.sequence.dropped.dedup();
    let attempt = Attempt {
        patches: first.patches.into_iter().chain(second.patches.into_iter().skip(found)).collect(),
        places: first.places + second.places,
        graph: first.graph.joined(second.graph, place),
        ..first
    };
    Made { attempt, plan }
}
