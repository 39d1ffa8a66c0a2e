//! What happens in a soak run, one deed after another, drawn by lot.

use std::fmt;
use std::thread;
use std::time::{Duration, Instant};

use nullsweep_ipc_types::ports::{Ipc, IpcError, PlanPublisher};
use nullsweep_ipc_types::{CommandKind, JoinRule, Mode, PlanId, Verdict};
use nullsweep_robot::{Arm, ArmSpec, JointVector, MAX_DOF, Robot, Side};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

use super::tally::Tally;
use crate::sketch::{Sketch, swung};
use crate::stage::{Part, Process, Stage};
use crate::system::System;
use crate::witness::{PATIENCE, Witness};

/// Longest pause between two deeds. \[ms\]
const PAUSE_MS: u64 = 400;
/// Share of the joints' velocity limits, at most.
const SPEED: f64 = 0.4;
/// Most clients of a run at a time.
const CLIENTS: usize = 3;
/// Knots that a join is ahead of where the arm is: what a stalled machine takes.
const AHEAD: u32 = 6;

/// The system and all who have to do with it.
pub(super) struct Life<'a> {
    stage: &'a Stage,
    system: System,
    arm: Arm,
    random: ChaCha8Rng,
    publisher: PlanPublisher,
    clients: Vec<Process>,
    /// Events that were counted.
    counted: usize,
    /// The plan that was published last.
    newest: Option<(PlanId, Sketch)>,
    tally: Tally,
}

impl<'a> Life<'a> {
    pub(super) fn new(
        stage: &'a Stage,
        system: System,
        random: ChaCha8Rng,
    ) -> anyhow::Result<Self> {
        let arm = Robot::pr2().arm(&ArmSpec::pr2(Side::Right))?;
        let publisher = system.ipc.plan_publisher(nullsweep_ipc_types::MAX_KNOTS / 8)?;
        Ok(Self {
            stage,
            system,
            arm,
            random,
            publisher,
            clients: Vec::new(),
            counted: 0,
            newest: None,
            tally: Tally::default(),
        })
    }

    /// One deed, and a pause.
    pub(super) fn go_on(&mut self) -> anyhow::Result<()> {
        match self.random.random_range(0..12) {
            0..=3 => self.publish()?,
            4 | 5 => self.swap()?,
            6 | 7 => self.command()?,
            8 => self.come()?,
            9 => self.leave()?,
            10 => self.watch()?,
            _ => self.renew()?,
        }
        self.recover()?;
        self.count()?;
        thread::sleep(Duration::from_millis(self.random.random_range(0..PAUSE_MS)));
        Ok(())
    }

    /// Ends everything; what happened, and what the endpoint says of it.
    pub(super) fn end(mut self) -> anyhow::Result<(Tally, Value)> {
        self.clients.clear();
        self.system.witness.command(CommandKind::Stop, 0.0)?;
        let rests = Instant::now() + PATIENCE;
        // Every plan has its end by then, those of clients too.
        while self.tally.check().is_err() && Instant::now() < rests {
            thread::sleep(Duration::from_millis(100));
            self.count()?;
        }
        let verdict = self.system.end(self.stage)?;
        Ok((self.tally, verdict))
    }

    /// A plan from where the arm is commanded, which is taken or not.
    fn publish(&mut self) -> anyhow::Result<()> {
        let from = self.commanded()?;
        let rule =
            [JoinRule::StopThenStart, JoinRule::AfterCurrent][self.random.random_range(0..2)];
        self.send(from, rule, "published", |sketch| sketch)
    }

    /// A plan that joins the newest one in a knot ahead, without a stop.
    fn swap(&mut self) -> anyhow::Result<()> {
        let now = self.system.witness.see("telemetry", |_| true)?;
        let Some((plan, sketch)) = self.newest.clone().filter(|(plan, _)| *plan == now.plan) else {
            return Ok(());
        };
        let knot = now.knot + AHEAD;
        if knot as usize >= sketch.knots.len() {
            return Ok(());
        }
        let from = sketch.posture(knot as usize);
        self.send(from, JoinRule::AtKnot, "swapped", |sketch| sketch.at_knot(plan, knot))
    }

    fn send(
        &mut self,
        from: JointVector,
        rule: JoinRule,
        what: &str,
        join: impl FnOnce(Sketch) -> Sketch,
    ) -> anyhow::Result<()> {
        let angle = self.random.random_range(0.02..0.25);
        let speed = self.random.random_range(0.05..SPEED);
        let home = self.arm.home();
        let postures = [from, swung(&self.arm, &home, angle), home];
        let mut sketch = Sketch::through(&self.arm, &postures, speed);
        sketch.header.join_rule = rule.wire();
        let sketch = join(sketch);
        let plan = self.publisher.publish(&sketch.header, &sketch.knots)?;
        self.tally.published(plan);
        self.tally.did(what);
        self.newest = Some((plan, sketch));
        Ok(())
    }

    fn command(&mut self) -> anyhow::Result<()> {
        let (kind, value) = match self.random.random_range(0..10) {
            0 | 1 => (CommandKind::Pause, 0.0),
            2..=4 => (CommandKind::Resume, 0.0),
            5 | 6 => (CommandKind::Speed, self.random.random_range(0.2..=1.0)),
            7 => (CommandKind::Stop, 0.0),
            8 => (CommandKind::StopAndDisable, 0.0),
            _ => (CommandKind::Status, 0.0),
        };
        self.order(kind, value)
    }

    fn order(&mut self, kind: CommandKind, value: f64) -> anyhow::Result<()> {
        let answer = self.system.witness.command(kind, value)?;
        let verdict = Verdict::from_wire(answer.verdict).map_or("unknown answer", Verdict::text);
        self.tally.did(format!("`{kind:?}`: {verdict}"));
        Ok(())
    }

    /// A client comes: somebody who publishes, or who asks for the status.
    fn come(&mut self) -> anyhow::Result<()> {
        if self.clients.len() >= CLIENTS {
            self.clients.remove(0);
        }
        let place = self.stage.place();
        let client = if self.random.random_range(0..2) == 0 {
            self.tally.did("publishers started");
            // One file for all of them: they are many.
            self.stage.start(Part::Sketch, "client", place)?
        } else {
            self.tally.did("`ctl status` started");
            let ask = ["ctl".into(), "status".into()].into_iter().chain(place);
            self.stage.start(Part::Executor, "client", ask)?
        };
        self.clients.push(client);
        Ok(())
    }

    /// A client is killed, whatever it does.
    fn leave(&mut self) -> anyhow::Result<()> {
        if !self.clients.is_empty() {
            let which = self.random.random_range(0..self.clients.len());
            self.clients.swap_remove(which).kill()?;
            self.tally.did("clients killed");
        }
        Ok(())
    }

    /// Somebody looks for a moment.
    fn watch(&mut self) -> anyhow::Result<()> {
        let ipc = Ipc::open(self.stage.robot(), Some(&self.stage.root()))?;
        let mut other = Witness::open(&ipc)?;
        other.see("telemetry", |_| true)?;
        self.tally.did("watchers");
        Ok(())
    }

    /// The publisher goes and comes again.
    fn renew(&mut self) -> anyhow::Result<()> {
        // A service that is full of the dead has room again after the executor's next sweep.
        let end = Instant::now() + PATIENCE;
        self.publisher = loop {
            match self.system.ipc.plan_publisher(nullsweep_ipc_types::MAX_KNOTS / 8) {
                Ok(publisher) => break publisher,
                Err(IpcError::Port { .. }) if Instant::now() < end => {
                    self.tally.did("waits for room for a publisher");
                    thread::sleep(Duration::from_millis(200));
                }
                Err(error) => return Err(error.into()),
            }
        };
        self.tally.did("publishers renewed");
        Ok(())
    }

    /// What an operator does: resets a fault once its cause is gone, and lets motion go on.
    fn recover(&mut self) -> anyhow::Result<()> {
        let end = Instant::now() + PATIENCE;
        let mut asked = false;
        loop {
            let now = self.system.witness.see("telemetry", |_| true)?;
            match Mode::from_wire(now.mode) {
                Some(Mode::Fault) => {
                    if !asked {
                        self.tally.did("faults");
                    }
                    asked = true;
                    self.system.witness.command(CommandKind::Reset, 0.0)?;
                }
                Some(Mode::Init | Mode::Stopping) => {}
                Some(Mode::Paused) if self.random.random_range(0..3) == 0 => {
                    self.order(CommandKind::Resume, 0.0)?;
                }
                _ => {
                    if asked || self.random.random_range(0..8) == 0 {
                        self.order(CommandKind::Speed, 1.0)?;
                        self.order(CommandKind::Resume, 0.0)?;
                    }
                    return Ok(());
                }
            }
            anyhow::ensure!(Instant::now() < end, "the arm does not come to hold");
            thread::sleep(Duration::from_millis(20));
        }
    }

    fn commanded(&mut self) -> anyhow::Result<JointVector> {
        let now = self.system.witness.see("telemetry", |_| true)?;
        let mut q = JointVector::default();
        q.copy_from_slice(&now.commanded[..MAX_DOF]);
        Ok(q)
    }

    /// Counts what was told since.
    fn count(&mut self) -> anyhow::Result<()> {
        self.system.witness.look()?;
        for event in &self.system.witness.events()[self.counted..] {
            self.tally.event(event);
        }
        self.counted = self.system.witness.events().len();
        Ok(())
    }
}

impl fmt::Display for Life<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.tally.fmt(f)
    }
}
