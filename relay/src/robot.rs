//! The end beside the executor: a client of its like any other. It hands over what comes and tells what
//! it hears; whether anybody is at the other end changes nothing for the executor.

use std::collections::VecDeque;
use std::sync::mpsc;
use std::time::{Duration, Instant};

use nullsweep_ipc_types::ports::{
    Asked, CommandClient, Ipc, IpcError, PlanPublisher, Receiver, now_ns,
};
use nullsweep_ipc_types::service::COMMAND_REQUESTS;
use nullsweep_ipc_types::{
    Command, CommandKind, Knot, MAX_KNOTS, PlanEvent, PlanHeader, PlanId, PlanMessage, Response,
    Telemetry, checksum,
};
use zenoh::Wait as _;
use zenoh::qos::Priority;
use zenoh::query::{Query, Queryable};

use crate::args::RobotArgs;
use crate::keys;
use crate::ledger::Ledger;
use crate::net::Net;
use crate::schema::Schema;
use crate::wire::{
    self, After, Answer, Entry, Order, Parcel, Pulse, Reading, Receipt, Snapshot, Taken, sealed,
};

/// Time between two looks at the services.
const ROUND: Duration = Duration::from_millis(1);
/// Time between two signs of life.
const PULSE: Duration = Duration::from_millis(100);
/// Silence after which the executor is looked for: it sends telemetry 100 times a second.
const SILENCE: Duration = Duration::from_millis(500);
/// How long the executor's answer to a command is waited for.
const ANSWER_WITHIN: Duration = Duration::from_secs(2);

/// Runs until `done` says so.
///
/// # Errors
/// The network, or the services, cannot be opened or fail.
pub fn run(args: &RobotArgs, done: &dyn Fn() -> bool) -> anyhow::Result<()> {
    let ipc = Ipc::open(&args.robot.robot_name, args.ipc_root.as_deref())?;
    let net = Net::open(&args.net, &args.robot.robot_name)?;
    let mut end = RobotEnd::open(&ipc, net, args)?;
    let (sender, questions) = mpsc::channel();
    let mut open: Vec<Queryable<()>> = Vec::new();
    for key in keys::QUESTIONS {
        let sender = sender.clone();
        open.push(end.net.take(key, move |query| {
            // Whoever asks while this ends gets no answer.
            let _ = sender.send((key, query));
        })?);
    }
    tracing::info!("the robot's end of {}", args.robot.robot_name);
    while !done() {
        match questions.recv_timeout(ROUND) {
            Ok((key, query)) => end.question(key, query),
            Err(mpsc::RecvTimeoutError::Timeout | mpsc::RecvTimeoutError::Disconnected) => {}
        }
        end.round()?;
    }
    for queryable in open {
        let _ = queryable.undeclare().wait();
    }
    Ok(())
}

/// A command that the executor was asked.
struct Open {
    asked: Asked,
    query: Query,
    since: Instant,
}

struct RobotEnd<'a> {
    ipc: &'a Ipc,
    net: Net,
    schema: Schema,
    seal: u64,
    plans: PlanPublisher,
    events: Receiver<PlanEvent>,
    telemetry: Receiver<Telemetry>,
    commands: CommandClient,
    ledger: Ledger,
    orders: VecDeque<(Order, Query)>,
    open: Vec<Open>,
    /// Time between two samples that are sent on.
    apart: Duration,
    told: Instant,
    heard: Instant,
    sought: Instant,
    pulsed: Option<Instant>,
    executor: bool,
}

impl<'a> RobotEnd<'a> {
    fn open(ipc: &'a Ipc, net: Net, args: &RobotArgs) -> Result<Self, IpcError> {
        let (now, schema) = (Instant::now(), Schema::own());
        Ok(Self {
            ipc,
            net,
            seal: schema.seal(),
            schema,
            plans: ipc.plan_publisher(MAX_KNOTS)?,
            events: ipc.event_receiver()?,
            telemetry: ipc.telemetry_receiver()?,
            commands: ipc.command_client()?,
            ledger: Ledger::new(now_ns()),
            orders: VecDeque::new(),
            open: Vec::new(),
            // A sample that comes a little early is not the next one left out.
            apart: Duration::from_secs_f64(0.8 / f64::from(args.telemetry)),
            told: now,
            heard: now,
            sought: now,
            pulsed: None,
            executor: false,
        })
    }

    fn round(&mut self) -> anyhow::Result<()> {
        while let Some(event) = self.events.receive()? {
            let entry = self.ledger.enter(event);
            let bytes = sealed(self.seal, &[bytemuck::bytes_of(&entry)]);
            self.net.tell(keys::EVENT, bytes, Priority::InteractiveHigh);
        }
        if let Some(newest) = self.telemetry.newest()? {
            self.heard = Instant::now();
            if self.told.elapsed() >= self.apart {
                self.told = Instant::now();
                let telemetry = newest.value;
                let origin = self.ledger.origin(telemetry.plan);
                let snapshot = Snapshot { origin, telemetry };
                let bytes = sealed(self.seal, &[bytemuck::bytes_of(&snapshot)]);
                self.net.tell(keys::TELEMETRY, bytes, Priority::Data);
            }
        }
        self.seek();
        if self.pulsed.is_none_or(|at| at.elapsed() >= PULSE) {
            self.pulsed = Some(Instant::now());
            let pulse = Pulse {
                began_ns: self.ledger.began_ns(),
                entries: self.ledger.count(),
                executor: u64::from(self.executor),
            };
            let bytes = sealed(self.seal, &[bytemuck::bytes_of(&pulse)]);
            self.net.tell(keys::PULSE, bytes, Priority::InteractiveHigh);
        }
        self.command_round();
        Ok(())
    }

    /// Whether an executor is there. A process that was killed stays in the services' books until
    /// somebody sweeps.
    fn seek(&mut self) {
        if self.heard.elapsed() >= SILENCE && self.sought.elapsed() >= SILENCE {
            self.sought = Instant::now();
            self.ipc.sweep_dead_nodes();
        }
        let is_there = self.telemetry.senders() > 0;
        if is_there != self.executor {
            self.executor = is_there;
            tracing::info!(
                "{}",
                if is_there { "an executor is there" } else { "the executor has gone" }
            );
        }
    }

    fn question(&mut self, key: &str, query: Query) {
        let bytes = query.payload().map(|p| p.to_bytes().to_vec()).unwrap_or_default();
        if key == keys::HELLO {
            self.greet(&String::from_utf8_lossy(&bytes));
            return self.net.answer(query, self.schema.text().into());
        }
        // What an end of another schema asks is not answered: it was told so when it came.
        let Some(body) = wire::opened(self.seal, &bytes) else { return };
        let answer = match key {
            keys::CLOCK => reading(body).map(|reading| bytemuck::bytes_of(&reading).to_vec()),
            keys::PLAN => Some(bytemuck::bytes_of(&self.plan(body)).to_vec()),
            keys::EVENTS => self.entries(body),
            keys::OUTCOME => self.outcome(body),
            _ => {
                if let Some(order) = wire::next::<Order>(&mut { body }) {
                    self.orders.push_back((order, query));
                }
                return;
            }
        };
        if let Some(answer) = answer {
            self.net.answer(query, sealed(self.seal, &[&answer]));
        }
    }

    fn greet(&self, theirs: &str) {
        let differences = self.schema.differences(&Schema::read(theirs));
        if differences.is_empty() {
            return tracing::info!("a planner's end has come");
        }
        tracing::error!(
            "another end was refused: it is of another build, install one on both hosts: {}",
            differences.join("; ")
        );
    }

    /// Hands a plan to the executor, if it is the first time that it comes.
    fn plan(&mut self, mut body: &[u8]) -> Receipt {
        let failed = Receipt { taken: Taken::Failed.wire(), age_ns: 0 };
        let parcel = wire::next::<Parcel>(&mut body);
        let header = wire::next::<PlanHeader>(&mut body);
        let (Some(parcel), Some(header)) = (parcel, header) else { return failed };
        let Some(knots) = wire::all::<Knot>(body) else { return failed };
        if let Some(receipt) = self.ledger.receipt(parcel.id) {
            return receipt;
        }
        let age_ns = now_ns().saturating_sub(parcel.id.epoch);
        let taken = if age_ns > parcel.within_ns {
            Taken::Late
        } else {
            self.hand_over(&parcel, &header, &knots)
        };
        let receipt = Receipt { taken: taken.wire(), age_ns };
        self.ledger.note(header.id, parcel.id, receipt);
        tracing::info!(
            "plan {} of {} knots, {:.0} ms old: {}, here as {}",
            header.id,
            knots.len(),
            age_ns as f64 * 1e-6,
            taken.text(),
            parcel.id
        );
        receipt
    }

    fn hand_over(&self, parcel: &Parcel, header: &PlanHeader, knots: &[Knot]) -> Taken {
        // Where the seal was broken it stays so: what differs is kept.
        let broken = header.checksum ^ checksum(PlanMessage { header, knots });
        let mut own =
            PlanHeader { id: parcel.id, join_plan: self.ledger.id(header.join_plan), ..*header };
        own.checksum = checksum(PlanMessage { header: &own, knots }) ^ broken;
        match self.plans.publish_raw(&own, knots) {
            Ok(()) => Taken::Yes,
            Err(IpcError::NoExecutor { .. }) => Taken::NoExecutor,
            Err(IpcError::PlanBufferFull) => Taken::Full,
            Err(e) => {
                tracing::error!("plan {}: {e}", header.id);
                Taken::Failed
            }
        }
    }

    fn entries(&self, mut body: &[u8]) -> Option<Vec<u8>> {
        let after: After = wire::next(&mut body)?;
        let entries: Vec<Entry> = self.ledger.after(after.index).copied().collect();
        Some(bytemuck::cast_slice(&entries).to_vec())
    }

    /// What became of a plan, by its id here or where it was published; of no plan the last events.
    fn outcome(&mut self, mut body: &[u8]) -> Option<Vec<u8>> {
        let plan: PlanId = wire::next(&mut body)?;
        let id = self.ledger.id(plan);
        let receipt = self.ledger.word(id);
        if Taken::from_wire(receipt.taken) == Some(Taken::Never) {
            // Said once, it stays so: a copy that is still under way comes too late.
            self.ledger.note(plan, id, Receipt { taken: Taken::Late.wire(), age_ns: 0 });
        }
        let since = self.ledger.count().saturating_sub(keys::LAST_EVENTS);
        let entries: Vec<Entry> = match plan {
            PlanId::NONE => self.ledger.after(since).copied().collect(),
            _ => self.ledger.of(id).copied().collect(),
        };
        let mut answer = bytemuck::bytes_of(&receipt).to_vec();
        answer.extend_from_slice(bytemuck::cast_slice(&entries));
        Some(answer)
    }

    /// Asks the executor what is to be asked, and answers what it has answered.
    fn command_round(&mut self) {
        while self.open.len() < COMMAND_REQUESTS
            && let Some((order, query)) = self.orders.pop_front()
        {
            let Order { until_ns, command: Command { value, kind, .. } } = order;
            let kind = CommandKind::from_wire(kind);
            let asked = match kind {
                Some(kind) if now_ns() <= until_ns => self.commands.ask(kind, value).ok(),
                _ => None,
            };
            match asked {
                Some(asked) => self.open.push(Open { asked, query, since: Instant::now() }),
                None => self.reply(query, None),
            }
        }
        let mut i = 0;
        while i < self.open.len() {
            match self.open[i].asked.answer() {
                Ok(Some(response)) => {
                    let Open { query, .. } = self.open.swap_remove(i);
                    self.reply(query, Some(response));
                }
                // Whether it is carried out is not known: no answer is the true one.
                Err(_) => drop(self.open.swap_remove(i)),
                Ok(None) if self.open[i].since.elapsed() > ANSWER_WITHIN => {
                    drop(self.open.swap_remove(i));
                }
                Ok(None) => i += 1,
            }
        }
    }

    fn reply(&self, query: Query, response: Option<Response>) {
        let known = |plan| match self.ledger.origin(plan) {
            PlanId::NONE => plan,
            origin => origin,
        };
        let answer = match response {
            Some(r) => Answer { asked: 1, response: Response { plan: known(r.plan), ..r } },
            None => Answer { asked: 0, response: bytemuck::Zeroable::zeroed() },
        };
        self.net.answer(query, sealed(self.seal, &[bytemuck::bytes_of(&answer)]));
    }
}

fn reading(mut body: &[u8]) -> Option<Reading> {
    let reading: Reading = wire::next(&mut body)?;
    Some(Reading { answered_ns: now_ns(), ..reading })
}
