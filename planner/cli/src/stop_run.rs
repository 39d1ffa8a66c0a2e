//! A program on its way: the base to a stop, its plans one after the other, what was left on its way before.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::Context;
use nullsweep_ipc_types::ports::Ipc;
use nullsweep_ipc_types::{EventKind, PlanEvent};
use nullsweep_planner::link::base::{Mover, Stands, displacement};
use nullsweep_planner::link::journal::{Begun, Journal, Progress};
use nullsweep_planner::link::left_at;
use nullsweep_planner::link::posture::{Posture, posture};
use nullsweep_planner::link::publish::{Join, PublishError, newest_telemetry};
use nullsweep_planner::plan::{Plan, PlanError, Program, ProgramStop, Work};
use nullsweep_planner::stops::{LeftOff, Rest, rest};
use nullsweep_planner::workcell::{Scene, Stance};
use nullsweep_robot::{Arm, JointVector, Robot};

use crate::bars::Bars;
use crate::output::tell;
use crate::program::{place, tip};
use crate::program_args::{Asked, Limb, arm_of};
use crate::program_error::{Astray, Off, Within};
use crate::program_report::{Outcome, Report, Step, Stood};
use crate::send::{BRIDGED, HeldElsewhere, LISTEN, Stopped, apart, held_apart};
use crate::way::Way;

/// How long joints may take to settle that the base has set.
const SETTLE: Duration = Duration::from_secs(3);

/// A program on its way.
pub(super) struct Run<'a> {
    pub(super) asked: Asked<'a>,
    pub(super) program: &'a Program,
    pub(super) robot: Robot,
    pub(super) limbs: Vec<Limb>,
    /// What is there, where that was said.
    pub(super) scene: Option<Scene>,
    pub(super) journal: Journal,
    pub(super) mover: Option<Mover>,
    pub(super) report: Report,
}

impl Run<'_> {
    /// Works through all that is not done.
    pub(super) fn all(&mut self) -> anyhow::Result<()> {
        let program = self.program;
        if self.asked.program.resume {
            self.await_begun()?;
        }
        for (s, stop) in program.stops.iter().enumerate() {
            let works = 0..stop.works.len();
            let is_done = |w: usize| self.journal.progress((s, w)) == Progress::Finished;
            if works.clone().all(is_done) {
                continue;
            }
            let at = format!("stop {}", s + 1);
            let here = Within { at, program: self.asked.file.into() };
            self.stand(s).context(here)?;
            for w in works {
                let work = &stop.works[w];
                let at = format!("stop {}, plan {} ({})", s + 1, w + 1, tip(work));
                let here = Within { at, program: self.asked.file.into() };
                self.work((s, w), work).context(here)?;
            }
        }
        Ok(())
    }

    /// Waits for plans that run, and keeps what has come to its end while nobody waited for it.
    fn await_begun(&mut self) -> anyhow::Result<()> {
        let program = self.program;
        for (s, stop) in program.stops.iter().enumerate() {
            for (w, work) in stop.works.iter().enumerate() {
                let here = format!("stop {}, plan {} ({})", s + 1, w + 1, tip(work));
                let begun = match self.journal.progress((s, w)) {
                    Progress::Finished => continue,
                    Progress::Begun(begun) => Some(begun),
                    Progress::Open => self.unwritten((s, w), work)?,
                };
                let Some(begun) = begun else { continue };
                let read = begun.file.as_deref().map(rest_file).transpose()?;
                let plan = read.as_ref().unwrap_or(&work.plan);
                tell!("{here} was begun: asking what became of it");
                let site = self.limb(work)?.site(self.asked);
                let fate = self.asked.send.fate(begun.id, plan, site)?;
                if fate.as_ref().is_some_and(|event| event.kind == EventKind::Finished.wire()) {
                    self.journal.finished((s, w))?;
                    self.note((s, w), work, Outcome::FoundFinished);
                }
            }
        }
        Ok(())
    }

    /// A plan that runs and was sent by a process that died before it could write so.
    fn unwritten(&mut self, at: (usize, usize), work: &Work) -> anyhow::Result<Option<Begun>> {
        let site = self.limb(work)?.site(self.asked);
        let now = newest_telemetry(&Ipc::open(site.robot, site.root)?, LISTEN)?;
        let runs =
            now.plan.is_some() && left_at(&work.plan, &now, Some(now.knot as usize)).is_some();
        if !runs {
            return Ok(None);
        }
        self.journal.begun(at, now.plan, None)?;
        Ok(Some(Begun { id: now.plan, file: None, knot: None }))
    }

    /// Has the base stand at a stop, its joints set.
    fn stand(&mut self, s: usize) -> anyhow::Result<()> {
        let stop = &self.program.stops[s];
        let mover = match self.mover.take() {
            Some(mover) => mover,
            None => {
                let site = self.asked.site.site();
                Mover::find(&Ipc::open(site.robot, site.root)?)?
            }
        };
        let mover = self.mover.insert(mover);
        let before = self.journal.stands().filter(|(at, _)| *at == s).map(|(_, stands)| stands);
        let now = match mover {
            Mover::Driver(_) => mover.stands()?,
            Mover::Person(_) => before,
        };
        let bound = self.asked.program.base_off;
        let there = now.filter(|now| off_place(stop, now.pose) <= bound);
        if let Some(stands) = there
            && self.held_off(s)?.is_empty()
        {
            if !stands.measured {
                tell!(
                    "stop {}: the base is taken to stand there still, as the journal says",
                    s + 1
                );
            }
            if before.is_none() {
                self.journal.arrived(s, stands)?;
            }
            return self.stood(s, stands, false);
        }
        self.tucked()?;
        let (of, count, at) = (s + 1, self.program.stops.len(), place(stop));
        tell!("stop {of} of {count}: the base to {at}");
        let Some(mover) = &self.mover else { return Ok(()) };
        if matches!(mover, Mover::Person(_)) {
            let robot = self.asked.site.site().robot;
            tell!(
                "nothing answers that drives the base of robot `{robot}`: drive it there, set its joints, then \
                 `executor ctl arrived`"
            );
        }
        let stands = mover.drive(stop)?;
        self.journal.arrived(s, stands)?;
        self.stood(s, stands, true)
    }

    /// Checks where the base stands, and that its joints are set.
    fn stood(&mut self, s: usize, stands: Stands, drove: bool) -> anyhow::Result<()> {
        let off = off_place(&self.program.stops[s], stands.pose);
        let measured = stands.measured;
        self.report.stops.push(Stood {
            stop: s + 1,
            base: stands.pose,
            measured,
            drove,
            off_m: off,
        });
        let bound = self.asked.program.base_off;
        if off > bound {
            return Err(Off { stands: stands.pose, off, bound }.into());
        }
        let how = if measured {
            format!(
                "what is to be swept lies {:.1} mm at most from where the plans have it",
                1e3 * off
            )
        } else {
            "where it stands nobody has measured".into()
        };
        tell!("stop {}: the base stands there; {how}", s + 1);
        let start = Instant::now();
        loop {
            let joints = self.held_off(s)?;
            if joints.is_empty() {
                return Ok(());
            }
            if start.elapsed() > SETTLE {
                return Err(HeldElsewhere { joints, plan: None }.into());
            }
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// The held joints that a stop sets and that are measured elsewhere.
    fn held_off(&self, s: usize) -> anyhow::Result<Vec<crate::send::HeldOff>> {
        let stop = &self.program.stops[s];
        let mut off = Vec::new();
        for work in &stop.works {
            let (arm, now) = self.posture(work, &work.plan)?;
            off = held_apart(&work.plan, &arm, &now);
            off.retain(|off| stop.held.iter().any(|(name, _)| *name == off.name));
            if !off.is_empty() {
                break;
            }
        }
        Ok(off)
    }

    /// That every arm of the program rests where it may be driven about.
    fn tucked(&self) -> anyhow::Result<()> {
        for limb in &self.limbs {
            let own = |work: &&Work| work.arm == limb.spec.to_string();
            let works = self.program.works().map(|(_, work)| work);
            let Some(work) = works.into_iter().find(own) else { continue };
            let (arm, now) = self.posture(work, &work.plan)?;
            let joints = apart(&work.plan, &arm, &now, BRIDGED);
            if !joints.is_empty() {
                return Err(Astray::Drive { arm: tip(work).into(), joints }.into());
            }
        }
        Ok(())
    }

    /// The executor's arm of a plan, as the plan has it, and where it is held.
    fn posture(&self, work: &Work, plan: &Plan) -> anyhow::Result<(Arm, Posture)> {
        let limb = self.limb(work)?;
        let arm = arm_of(&self.robot, &limb.spec, plan)?;
        let now = posture(limb.site(self.asked), &arm, LISTEN);
        let now = now.with_context(|| format!("executor `{}`", limb.name))?;
        Ok((arm, now))
    }

    fn limb(&self, work: &Work) -> anyhow::Result<&Limb> {
        let limb = self.limbs.iter().find(|limb| limb.spec.to_string() == work.arm);
        limb.with_context(|| format!("no executor of {}", work.arm))
    }

    /// Does a plan that is not done, or what of it is left.
    fn work(&mut self, at: (usize, usize), work: &Work) -> anyhow::Result<()> {
        match self.journal.progress(at) {
            Progress::Finished => return Ok(()),
            Progress::Begun(begun) => return self.go_on(at, work, &begun),
            Progress::Open => {}
        }
        self.begin(at, work, Outcome::Finished)
    }

    /// Sends a plan from its start, where the arm is brought if need be.
    fn begin(&mut self, at: (usize, usize), work: &Work, how: Outcome) -> anyhow::Result<()> {
        let (arm, now) = self.posture(work, &work.plan)?;
        if !apart(&work.plan, &arm, &now, BRIDGED).is_empty() {
            self.bring(work, &work.plan)?;
        }
        self.send(at, work, (&work.plan, None), how)
    }

    /// Goes on with a plan that was begun.
    fn go_on(&mut self, at: (usize, usize), work: &Work, begun: &Begun) -> anyhow::Result<()> {
        let read = begun.file.as_deref().map(rest_file).transpose()?;
        let plan = read.as_ref().unwrap_or(&work.plan);
        let site = self.limb(work)?.site(self.asked);
        // That it has not come to its end is known by now.
        let fate = self.asked.send.fate(begun.id, plan, site)?;
        let (_, rests) = self.posture(work, plan)?;
        let now = newest_telemetry(&Ipc::open(site.robot, site.root)?, LISTEN)?;
        let ended = fate.and_then(|event| (event.knot != u32::MAX).then_some(event.knot as usize));
        let knot = ended.or(begun.knot).or(rests.stopped);
        let Some(knot) = left_at(plan, &now, knot) else {
            let name = tip(work);
            tell!("where on its plan {name} was left is not known: the plan is begun again");
            return self.begin(at, work, Outcome::BegunAgain);
        };
        let Some(scene) = &self.scene else {
            return Err(Astray::Unseen { arm: tip(work).into() }.into());
        };
        tell!(
            "{} was left past knot {knot} of {}: planning what is left",
            tip(work),
            plan.knots.len()
        );
        let left = LeftOff { program: self.program, work, plan, knot, at: rests.q };
        match rest(&self.robot, scene, left, self.asked.robot.collision()) {
            Ok(Rest::Plan(made, notes)) => {
                notes.iter().for_each(|note| tell!("note: {note}"));
                let file = self.write(at, &made)?;
                self.send(at, work, (&made, Some(&file)), Outcome::RestFinished)
            }
            Ok(Rest::Swept) => {
                tell!("nothing is left that it could sweep");
                self.bring(work, &work.plan)?;
                self.journal.finished(at)?;
                self.note(at, work, Outcome::NothingLeft);
                Ok(())
            }
            Err(why) => {
                tell!("what is left cannot be planned ({why}): the plan is begun again");
                self.begin(at, work, Outcome::BegunAgain)
            }
        }
    }

    /// Writes a plan of what is left beside the journal.
    fn write(&self, (s, w): (usize, usize), plan: &Plan) -> anyhow::Result<PathBuf> {
        let name = |n: usize| {
            let mut name = self.journal.path().as_os_str().to_owned();
            name.push(format!(".{}-{}-rest-{n}.json", s + 1, w + 1));
            PathBuf::from(name)
        };
        let file = (1..).map(name).find(|file| !file.exists()).unwrap_or_default();
        plan.write(&file)?;
        Ok(file)
    }

    /// Brings an arm to where a plan begins, and ends, free of collision.
    fn bring(&self, work: &Work, plan: &Plan) -> anyhow::Result<()> {
        let limb = self.limb(work)?;
        let Some(scene) = &self.scene else {
            return Err(Astray::Unseen { arm: tip(work).into() }.into());
        };
        let to = plan.knots.first().map_or(JointVector::ZERO, |knot| knot.q);
        let held = plan.held.iter().map(|h| (h.name.clone(), h.position)).collect();
        let way = Way {
            robot: &self.asked.robot.with_arm(limb.spec.clone()),
            site: limb.site(self.asked),
            scans: &[],
            stance: Stance { base: plan.base, height: plan.base_height, held },
            tool: plan.tool.clone(),
            plan: None,
            unwinds: false,
        };
        let [x, y, _] = plan.base;
        let (here, _) = scene.near([x, y], self.program.near_m);
        let Some(found) = self.asked.way.find_in(&way, &here, to, &Bars::new())? else {
            return Ok(());
        };
        tell!("{} to where its plan begins, {:.1} s", tip(work), found.plan.duration());
        let arm = way.arm()?;
        self.asked.send.send((&found.plan, None), Some(&arm), way.site, Join::Stop, true)
    }

    /// Sends a plan, waits for its end, and keeps what became of it.
    fn send(
        &mut self,
        at: (usize, usize),
        work: &Work,
        (plan, file): (&Plan, Option<&Path>),
        how: Outcome,
    ) -> anyhow::Result<()> {
        let done = self.journal.done() + 1;
        let (s, w, of) = (at.0 + 1, at.1 + 1, self.report.plans);
        tell!("plan {done} of {of}: stop {s}, plan {w}, {}, {:.1} s", tip(work), plan.duration());
        let limb = self.limb(work)?.clone();
        let arm = arm_of(&self.robot, &limb.spec, plan)?;
        let (asked, journal) = (self.asked, &mut self.journal);
        let mut begun = None;
        let mut told = |event: &PlanEvent| {
            if event.kind == EventKind::Accepted.wire() {
                begun = Some(journal.begun(at, event.plan, file));
            }
        };
        let to = (Some(&arm), limb.site(asked));
        let sent = asked.send.send_told((plan, None), to, Join::Stop, true, &mut told);
        let taken = begun.transpose()?.is_some();
        match sent {
            Ok(()) => {
                self.journal.finished(at)?;
                self.note(at, work, how);
                Ok(())
            }
            Err(error) => {
                if taken {
                    self.journal.left(at, knot_of(&error))?;
                }
                Err(error)
            }
        }
    }

    fn note(&mut self, (s, w): (usize, usize), work: &Work, outcome: Outcome) {
        let arm = work.arm.clone();
        self.report.steps.push(Step { stop: s + 1, plan: w + 1, arm, outcome });
    }
}

/// The knot in which a plan was left, where its error tells it.
fn knot_of(error: &anyhow::Error) -> Option<usize> {
    let of = |event: &PlanEvent| (event.knot != u32::MAX).then_some(event.knot as usize);
    if let Some(stopped) = error.downcast_ref::<Stopped>() {
        return of(&stopped.event);
    }
    match error.downcast_ref::<PublishError>()? {
        PublishError::EndedEarly(event) => of(event),
        PublishError::Lost(lost) => {
            lost.last.filter(|last| last.plan.is_some()).map(|last| last.knot as usize)
        }
        _ => None,
    }
}

/// How far what the plans of a stop are to sweep lies from where they have it, the most of all. \[m\]
fn off_place(stop: &ProgramStop, stands: [f64; 3]) -> f64 {
    stop.works.iter().map(|work| displacement(&work.plan, stands)).fold(0.0, f64::max)
}

/// A plan that was written beside the journal, if it is as it was verified.
fn rest_file(file: &Path) -> Result<Plan, PlanError> {
    let plan = Plan::read(file)?;
    plan.check_seal()?;
    Ok(plan)
}
