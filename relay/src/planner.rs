//! The end beside the planners: to them it is the executor. It sends on what they publish and ask, and
//! tells what comes from the robot.

use std::collections::HashMap;
use std::sync::mpsc;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use bytemuck::Zeroable;
use nullsweep_ipc_types::ports::{Ipc, ReceivedPlan, Request, now_ns};
use nullsweep_ipc_types::{CommandKind, PlanEvent, PlanId, Response, Telemetry, Verdict};
use zenoh::bytes::ZBytes;
use zenoh::qos::Priority;

use crate::args::PlannerArgs;
use crate::clock::Clock;
use crate::keys;
use crate::link::Link;
use crate::net::{Manner, Net};
use crate::schema::Schema;
use crate::sent::{Sent, Task};
use crate::wire::{
    self, After, Answer, Entry, Order, Parcel, Pulse, Reading, Receipt, Snapshot, sealed,
};
use crate::world::World;

/// Time between two looks at the services.
const ROUND: Duration = Duration::from_millis(1);
/// Time between two readings of the robot's clock, and between two attempts to greet it.
const AGAIN: Duration = Duration::from_secs(1);
/// How long what the executor told last is still told after it has gone.
const GRACE: Duration = Duration::from_secs(1);
/// How late a command may be carried out, unless it only stops the arm. \[ns\]
const COMMAND_WITHIN_NS: u64 = 1_000_000_000;
/// How long a short answer is waited for.
const ANSWER_WITHIN: Duration = Duration::from_secs(3);
/// What a link carries at least. \[bytes/s\]
const SLOWEST: f64 = 50_000.0;

/// Runs until `done` says so.
///
/// # Errors
/// The network, or the services, cannot be opened or fail; the robot's end is of another build.
pub fn run(args: &PlannerArgs, done: &dyn Fn() -> bool) -> anyhow::Result<()> {
    let ipc = Ipc::open(&args.robot.robot_name, args.ipc_root.as_deref())?;
    let net = Net::open(&args.net, &args.robot.robot_name)?;
    let (sender, news) = mpsc::channel();
    let mut end = PlannerEnd::new(&ipc, net, sender, args);
    end.listen()?;
    tracing::info!("the planners' end of {}: waits for the robot's", args.robot.robot_name);
    while !done() {
        match news.recv_timeout(ROUND) {
            Ok(news) => end.hear(news)?,
            Err(mpsc::RecvTimeoutError::Timeout | mpsc::RecvTimeoutError::Disconnected) => {}
        }
        end.round()?;
    }
    Ok(())
}

/// What comes from the network.
enum News {
    Pulse(Pulse),
    Snapshot(Box<Snapshot>),
    Event(Entry),
    /// Answers, if they came.
    Events(Option<Vec<Entry>>),
    Hello(Option<String>),
    Clock(Option<Reading>),
    Word(PlanId, Option<(Receipt, Vec<Entry>)>),
    Answer(u64, Option<Answer>),
    /// Something of another schema.
    Foreign,
}

struct PlannerEnd<'a> {
    ipc: &'a Ipc,
    net: Net,
    sender: mpsc::Sender<News>,
    schema: Schema,
    seal: u64,
    within_ns: u64,
    link: Link,
    clock: Clock,
    world: Option<World>,
    /// Since when there has been no executor.
    absent: Option<Instant>,
    sent: Sent<ZBytes>,
    commands: HashMap<u64, Request>,
    tickets: u64,
    last: Option<Telemetry>,
}

impl<'a> PlannerEnd<'a> {
    fn new(ipc: &'a Ipc, net: Net, sender: mpsc::Sender<News>, args: &PlannerArgs) -> Self {
        let within_ns = args.plan_within.as_nanos() as u64;
        let schema = Schema::own();
        Self {
            ipc,
            net,
            sender,
            seal: schema.seal(),
            schema,
            within_ns,
            link: Link::default(),
            clock: Clock::default(),
            world: None,
            absent: None,
            sent: Sent::new(within_ns),
            commands: HashMap::new(),
            tickets: 0,
            last: None,
        }
    }

    fn listen(&self) -> anyhow::Result<()> {
        fn read<T: bytemuck::Pod>(seal: u64, bytes: &[u8], make: impl Fn(T) -> News) -> News {
            wire::opened(seal, bytes)
                .and_then(|mut body| wire::next(&mut body))
                .map_or(News::Foreign, make)
        }
        let seal = self.seal;
        let hear = |key, make: fn(u64, &[u8]) -> News| {
            let sender = self.sender.clone();
            // Nobody hears it while this ends.
            self.net.hear(key, move |bytes| drop(sender.send(make(seal, &bytes))))
        };
        hear(keys::PULSE, |seal, bytes| read(seal, bytes, News::Pulse))?;
        hear(keys::EVENT, |seal, bytes| read(seal, bytes, News::Event))?;
        hear(keys::TELEMETRY, |seal, bytes| {
            read(seal, bytes, |snapshot| News::Snapshot(Box::new(snapshot)))
        })
    }

    /// Asks the robot's end; the answer comes as news.
    fn ask<T: Send + 'static>(
        &self,
        key: &'static str,
        body: &[u8],
        read: impl Fn(&[u8]) -> Option<T> + Send + 'static,
        news: impl Fn(Option<T>) -> News + Send + 'static,
    ) {
        let (sender, seal) = (self.sender.clone(), self.seal);
        let manner = Manner::brief(ANSWER_WITHIN);
        self.net.ask(key, sealed(seal, &[body]), manner, move |answer| {
            let read =
                answer.as_deref().and_then(|bytes| wire::opened(seal, bytes)).and_then(&read);
            let _ = sender.send(news(read));
        });
    }

    fn hear(&mut self, news: News) -> anyhow::Result<()> {
        match news {
            News::Pulse(pulse) => self.pulse(pulse),
            News::Foreign => self.greet(),
            News::Hello(theirs) => self.greeted(theirs)?,
            News::Clock(reading) => self.read(reading),
            News::Snapshot(snapshot) => self.show(*snapshot)?,
            News::Event(entry) => {
                // One that does not follow on the last comes with those before it.
                if self.link.heard == Some(entry.index - 1) && !self.link.is_catching_up {
                    self.event(&entry)?;
                }
            }
            News::Events(entries) => {
                self.link.is_catching_up = false;
                for entry in entries.unwrap_or_default() {
                    if self.link.heard.is_some_and(|heard| entry.index > heard) {
                        self.event(&entry)?;
                    }
                }
            }
            News::Word(id, word) => {
                let event = self.sent.word(id, word.as_ref().map(|(receipt, _)| *receipt));
                self.tell(event)?;
                for entry in word.map(|(_, entries)| entries).unwrap_or_default() {
                    self.tell_entry(&entry)?;
                }
            }
            News::Answer(ticket, answer) => self.answer(ticket, answer),
        }
        Ok(())
    }

    fn pulse(&mut self, pulse: Pulse) {
        if self.link.sign(pulse) {
            self.clock.forget();
            self.greet();
        }
    }

    fn greet(&mut self) {
        if self.link.greeting.is_some_and(|at| at.elapsed() < AGAIN) {
            return;
        }
        self.link.greeting = Some(Instant::now());
        let sender = self.sender.clone();
        let text: Vec<u8> = self.schema.text().into();
        self.net.ask(keys::HELLO, text, Manner::brief(ANSWER_WITHIN), move |answer| {
            let text = answer.map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
            let _ = sender.send(News::Hello(text));
        });
    }

    fn greeted(&mut self, theirs: Option<String>) -> anyhow::Result<()> {
        let Some(theirs) = theirs else { return Ok(()) };
        let differences = self.schema.differences(&Schema::read(&theirs));
        if !differences.is_empty() {
            bail!(
                "the robot's end is of another build, install one on both hosts: {}",
                differences.join("; ")
            );
        }
        self.link.greeted = true;
        Ok(())
    }

    fn read(&mut self, reading: Option<Reading>) {
        let Some(reading) = reading else { return };
        let is_first = self.clock.ahead().is_none();
        self.clock.take(reading, now_ns());
        if let Some((ahead, error)) = self.clock.ahead().filter(|_| is_first) {
            let [ahead, error] = [ahead as f64, error as f64].map(|ns| ns * 1e-6);
            tracing::info!("its clock is ahead by {ahead:.3} ms, give or take {error:.3} ms");
        }
    }

    fn round(&mut self) -> anyhow::Result<()> {
        self.link.look();
        self.keep_up();
        self.place()?;
        if let Some(world) = &self.world {
            world.connect()?;
            self.plans()?;
            self.orders()?;
        }
        let overdue = self.sent.overdue(now_ns());
        self.tell(overdue)?;
        if self.link.is_up
            && self.link.greeted
            && let Some(task) = self.sent.next()
        {
            self.carry(task);
        }
        Ok(())
    }

    /// Greets, reads the clock, asks for events that were missed.
    fn keep_up(&mut self) {
        if !self.link.is_up {
            return;
        }
        if !self.link.greeted {
            return self.greet();
        }
        if self.link.read.is_none_or(|at| at.elapsed() >= AGAIN) {
            self.link.read = Some(Instant::now());
            let reading = Reading { asked_ns: now_ns(), answered_ns: 0 };
            let read = |mut body: &[u8]| wire::next(&mut body);
            self.ask(keys::CLOCK, bytemuck::bytes_of(&reading), read, News::Clock);
        }
        if self.world.is_none() || self.link.is_catching_up {
            return;
        }
        let Some(pulse) = self.link.pulse() else { return };
        let first = pulse.entries.saturating_sub(keys::LAST_EVENTS);
        let heard = *self.link.heard.get_or_insert(first);
        if pulse.entries > heard {
            self.link.is_catching_up = true;
            let after = After { index: heard };
            self.ask(keys::EVENTS, bytemuck::bytes_of(&after), wire::all, News::Events);
        }
    }

    /// Takes the executor's place when there is one at the robot, and leaves it when there is none. While
    /// nothing is known it stays as it is.
    fn place(&mut self) -> anyhow::Result<()> {
        let Some(pulse) = self.link.pulse() else { return Ok(()) };
        if pulse.executor != 0 {
            self.absent = None;
            if self.world.is_none() && self.link.greeted && self.clock.ahead().is_some() {
                let world = World::open(self.ipc).context("the executor's place is taken here")?;
                self.world = Some(world);
                tracing::info!("its executor is there: plans and commands are taken");
            }
        } else if self.world.is_some() {
            let absent = *self.absent.get_or_insert_with(Instant::now);
            if absent.elapsed() >= GRACE {
                self.world = None;
                tracing::warn!("its executor has gone: no plans are taken");
            }
        }
        Ok(())
    }

    fn plans(&mut self) -> anyhow::Result<()> {
        while self.sent.has_room()
            && let Some(plan) =
                self.world.as_ref().map(|world| world.plans.receive()).transpose()?
            && let Some(plan) = plan
        {
            self.plan(&plan)?;
        }
        Ok(())
    }

    fn plan(&mut self, plan: &ReceivedPlan) -> anyhow::Result<()> {
        let header = *plan.header();
        let Some(epoch) = self.clock.earliest_there(header.id.epoch) else { return Ok(()) };
        let id = PlanId { epoch, ..header.id };
        let parcel = Parcel { id, within_ns: self.within_ns };
        let knots: &[u8] = bytemuck::cast_slice(plan.knots());
        let parts = [bytemuck::bytes_of(&parcel), bytemuck::bytes_of(&header), knots];
        let body = ZBytes::from(sealed(self.seal, &parts));
        tracing::info!("plan {} of {} knots, there as {id}", header.id, plan.knots().len());
        let event = self.sent.take((header.id, id), body, now_ns());
        self.tell(event)
    }

    fn carry(&self, task: Task<ZBytes>) {
        let sender = self.sender.clone();
        let seal = self.seal;
        let read = move |bytes: &[u8]| {
            let mut body = wire::opened(seal, bytes)?;
            Some((wire::next::<Receipt>(&mut body)?, wire::all::<Entry>(body)?))
        };
        let told = move |id, answer: Option<Vec<u8>>| {
            let _ = sender.send(News::Word(id, answer.as_deref().and_then(read)));
        };
        match task {
            Task::Send(id, body) => {
                let seconds = body.len() as f64 / SLOWEST;
                let within = Duration::from_secs(2) + Duration::from_secs_f64(seconds);
                let manner = Manner { within, priority: Priority::DataLow, is_freight: true };
                self.net.ask(keys::PLAN, body, manner, move |answer| told(id, answer));
            }
            Task::Ask(id) => {
                let body = sealed(seal, &[bytemuck::bytes_of(&id)]);
                let manner = Manner::brief(ANSWER_WITHIN);
                self.net.ask(keys::OUTCOME, body, manner, move |answer| told(id, answer));
            }
        }
    }

    /// An event in the order of the robot's ledger.
    fn event(&mut self, entry: &Entry) -> anyhow::Result<()> {
        self.link.heard = Some(entry.index);
        self.tell_entry(entry)
    }

    fn tell_entry(&mut self, entry: &Entry) -> anyhow::Result<()> {
        if !self.sent.is_news(&entry.event) {
            return Ok(());
        }
        let plan = self.known(entry.event.plan, entry.origin);
        let stamp_ns = self.clock.here(entry.event.stamp_ns).unwrap_or_else(now_ns);
        self.tell(Some(PlanEvent { plan, stamp_ns, ..entry.event }))
    }

    /// The plan's id here.
    fn known(&self, id: PlanId, origin: PlanId) -> PlanId {
        match origin {
            PlanId::NONE => self.sent.origin(id).unwrap_or(id),
            origin => origin,
        }
    }

    fn tell(&mut self, event: Option<PlanEvent>) -> anyhow::Result<()> {
        if let (Some(event), Some(world)) = (event, &mut self.world) {
            world.tell(&event)?;
        }
        Ok(())
    }

    fn show(&mut self, snapshot: Snapshot) -> anyhow::Result<()> {
        let Snapshot { origin, telemetry } = snapshot;
        let plan = self.known(telemetry.plan, origin);
        let stamp_ns = self.clock.here(telemetry.stamp_ns).unwrap_or_else(now_ns);
        let telemetry = Telemetry { plan, stamp_ns, ..telemetry };
        self.last = Some(telemetry);
        if let Some(world) = &self.world {
            world.show(&telemetry)?;
        }
        Ok(())
    }

    fn orders(&mut self) -> anyhow::Result<()> {
        while let Some(request) = self.world.as_ref().map(|w| w.commands.receive()).transpose()?
            && let Some(request) = request
        {
            let command = request.command();
            let until_ns = match CommandKind::from_wire(command.kind) {
                // What stops the arm is never too late.
                Some(CommandKind::Pause | CommandKind::Stop | CommandKind::StopAndDisable) => {
                    Some(u64::MAX)
                }
                _ => self.clock.there(now_ns() + COMMAND_WITHIN_NS),
            };
            let (Some(until_ns), true) = (until_ns, self.link.is_up) else {
                answer(request, self.busy());
                continue;
            };
            self.tickets += 1;
            let ticket = self.tickets;
            self.commands.insert(ticket, request);
            let order = Order { until_ns, command };
            let read = |mut body: &[u8]| wire::next(&mut body);
            let news = move |answer| News::Answer(ticket, answer);
            self.ask(keys::COMMAND, bytemuck::bytes_of(&order), read, news);
        }
        Ok(())
    }

    /// Answers a command. Where no answer came it may have been carried out: no answer is the true one.
    fn answer(&mut self, ticket: u64, there: Option<Answer>) {
        let Some(request) = self.commands.remove(&ticket) else { return };
        let Some(Answer { asked, response }) = there else { return };
        let stamp_ns = self.clock.here(response.stamp_ns).unwrap_or_else(now_ns);
        let plan = self.known(response.plan, PlanId::NONE);
        let taken = Response { stamp_ns, plan, ..response };
        answer(request, if asked == 0 { self.busy() } else { taken });
    }

    /// The answer to a command that was not given to the executor.
    fn busy(&self) -> Response {
        let last = self.last.unwrap_or_else(Telemetry::zeroed);
        Response {
            stamp_ns: now_ns(),
            plan: last.plan,
            speed_scale: last.speed_scale,
            verdict: Verdict::Busy.wire(),
            mode: last.mode,
            fault: last.fault,
            knot: last.knot,
            unverified: last.unverified,
            stopped: last.stopped,
        }
    }
}

fn answer(request: Request, response: Response) {
    if let Err(e) = request.answer(response) {
        tracing::warn!("a command's answer did not arrive: {e}");
    }
}
