//! The operators' desk: whoever asks is answered in turn, one at a time before the loop, and nobody
//! can keep the others waiting.
//!
//! What waits is taken in together and answered before more is: a client that asks again and again
//! has at most its active requests among them. An order that the loop has not taken in time is
//! withdrawn and answered as busy; one that it has taken is answered by the loop.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use nullsweep_cell::as_called;
use nullsweep_ipc_types::ports::{CommandServer, PortError, Request, now_ns};
use nullsweep_ipc_types::service::{COMMAND_CLIENTS, COMMAND_REQUESTS};
use nullsweep_ipc_types::{Command, CommandKind, Fault, Mode, PlanId, Response, Verdict};

use crate::cycle::{Ask, Order, Reply, Snapshot};
use crate::journal::Journal;
use crate::slots::ServiceEnd;

/// How long the loop may take to take an order.
const TAKE_WITHIN: Duration = Duration::from_millis(50);
/// How long it may then take to answer: it does so in the same cycle, unless its thread hangs.
const ANSWER_WITHIN: Duration = Duration::from_secs(1);

/// An order that lies before the loop.
#[derive(Debug)]
struct Asked {
    request: Request,
    ticket: u64,
    since: Instant,
    /// The loop has taken it.
    taken: bool,
}

/// What operators ask, and the order that is before the loop.
#[derive(Debug)]
pub(crate) struct Desk {
    server: CommandServer,
    waiting: VecDeque<Request>,
    asked: Option<Asked>,
    tickets: u64,
}

impl Desk {
    pub(crate) fn new(server: CommandServer) -> Self {
        let waiting = VecDeque::with_capacity(COMMAND_CLIENTS * COMMAND_REQUESTS);
        Self { server, waiting, asked: None, tickets: 0 }
    }

    /// Whether an answer of the loop is waited for.
    pub(crate) fn is_waiting(&self) -> bool {
        self.asked.is_some()
    }

    /// Takes in what is asked, puts the next order before the loop, answers what is decided. Never
    /// waits.
    ///
    /// # Errors
    /// When requests cannot be received.
    pub(crate) fn round(
        &mut self,
        slots: &mut ServiceEnd,
        newest: Option<Snapshot>,
    ) -> Result<(), PortError> {
        while let Ok(reply) = slots.replies.pop() {
            self.hear(&reply);
        }
        if let Some(asked) = self.asked.take() {
            self.asked = asked.wait(slots, newest);
        }
        let room = COMMAND_CLIENTS * COMMAND_REQUESTS;
        let mut received = Ok(());
        if self.waiting.is_empty() {
            while self.waiting.len() < room {
                match self.server.receive() {
                    Ok(Some(request)) => self.waiting.push_back(request),
                    Ok(None) => break,
                    Err(e) => {
                        received = Err(e);
                        break;
                    }
                }
            }
        }
        while self.asked.is_none()
            && let Some(request) = self.waiting.pop_front()
        {
            self.ask(request, slots, newest);
        }
        received
    }

    /// An answer of the loop.
    fn hear(&mut self, reply: &Reply) {
        let Reply { ticket, verdict, snapshot } = *reply;
        if ticket == Ask::SIGNAL {
            Journal::signal(&snapshot);
        } else if let Some(asked) = self.asked.take_if(|asked| asked.ticket == ticket) {
            answer(asked.request, response(verdict, Some(snapshot)));
        }
    }

    /// Puts an order before the loop, or says that it cannot be.
    fn ask(&mut self, request: Request, slots: &mut ServiceEnd, newest: Option<Snapshot>) {
        let Some(order) = order(&request.command()) else {
            return answer(request, response(Verdict::Unknown, newest));
        };
        self.tickets += 1;
        let ticket = self.tickets;
        slots.claim.open(ticket);
        if slots.asks.push(Ask { ticket, order }).is_err() {
            return answer(request, response(Verdict::Busy, newest));
        }
        self.asked = Some(Asked { request, ticket, since: Instant::now(), taken: false });
    }
}

impl Asked {
    /// Waits on, unless it has for too long.
    fn wait(mut self, slots: &ServiceEnd, newest: Option<Snapshot>) -> Option<Self> {
        let waited = self.since.elapsed();
        if !self.taken && waited >= TAKE_WITHIN {
            if slots.claim.decide(self.ticket) {
                answer(self.request, response(Verdict::Busy, newest));
                return None;
            }
            self.taken = true;
        }
        if waited >= TAKE_WITHIN + ANSWER_WITHIN {
            // Whether it is carried out is not known here: no answer is the true one.
            let kind = CommandKind::from_wire(self.request.command().kind);
            let text = format!(
                "the loop took {} and has not answered it: `executor ctl status` says whether it was \
                 carried out; if that is not answered either, stop with `executor ctl stop`",
                kind.map_or("a command", CommandKind::text)
            );
            tracing::error!("{}", as_called(text));
            return None;
        }
        Some(self)
    }
}

fn answer(request: Request, response: Response) {
    Journal::command(&request.command(), &response);
    if let Err(e) = request.answer(response) {
        tracing::warn!("a command's answer did not arrive: {e}");
    }
}

fn order(command: &Command) -> Option<Order> {
    Some(match CommandKind::from_wire(command.kind)? {
        CommandKind::Status => Order::Status,
        CommandKind::Pause => Order::Pause,
        CommandKind::Resume => Order::Resume,
        CommandKind::Stop => Order::Stop,
        CommandKind::StopAndDisable => Order::StopAndDisable,
        CommandKind::Speed => Order::Speed(command.value),
        CommandKind::Reset => Order::Reset,
    })
}

fn response(verdict: Verdict, snapshot: Option<Snapshot>) -> Response {
    Response {
        stamp_ns: now_ns(),
        plan: snapshot.map_or(PlanId::NONE, |s| s.plan),
        speed_scale: snapshot.map_or(0.0, |s| s.scale),
        verdict: verdict.wire(),
        mode: snapshot.map_or(Mode::Init, |s| s.mode).wire(),
        fault: snapshot.map_or(Fault::None, |s| s.fault).wire(),
        knot: snapshot.map_or(0, |s| s.stopped.unwrap_or(s.knot)),
        unverified: u32::from(snapshot.is_some_and(|s| s.unverified)),
        stopped: u32::from(snapshot.is_some_and(|s| s.stopped.is_some())),
    }
}

#[cfg(test)]
mod tests {
    use nullsweep_ipc_types::ports::{CommandClient, Ipc};

    use super::*;
    use crate::cycle::{Input, State, step};
    use crate::guard::tests::pr2;
    use crate::slots::{LoopEnd, Slots};

    /// A desk and the loop's ends, and a client that asks and does not wait.
    struct Office {
        _root: tempfile::TempDir,
        ipc: Ipc,
        desk: Desk,
        service: ServiceEnd,
        looping: LoopEnd,
        state: State,
    }

    impl Office {
        fn new() -> Self {
            let root = tempfile::TempDir::new().unwrap();
            let ipc = Ipc::open("pr2", Some(root.path())).unwrap();
            let desk = Desk::new(ipc.command_server().unwrap());
            let Slots { looping, service, worker: _ } = Slots::default();
            Self { _root: root, ipc, desk, service, looping, state: State::default() }
        }

        fn client(&self) -> CommandClient {
            self.ipc.command_client().unwrap()
        }

        fn round(&mut self) {
            self.desk.round(&mut self.service, None).unwrap();
        }

        /// One cycle of the loop: whether there was an order that it could carry out.
        fn cycle(&mut self) -> bool {
            let Ok(ask) = self.looping.asks.pop() else { return false };
            if !self.looping.claim.decide(ask.ticket) {
                return false;
            }
            let input = Input { ask: Some(ask), ..Input::default() };
            let out = step(&mut self.state, input, 1, &pr2());
            self.looping.replies.push(out.reply.unwrap()).unwrap();
            true
        }
    }

    #[test]
    fn a_client_that_never_rests_keeps_nobody_waiting() {
        let mut office = Office::new();
        let (greedy, other) = (office.client(), office.client());
        let ask = |client: &CommandClient, kind| client.ask(kind, 0.0).unwrap();
        let mut flood: Vec<_> =
            (0..COMMAND_REQUESTS).map(|_| ask(&greedy, CommandKind::Status)).collect();
        let wanted = ask(&other, CommandKind::Stop);
        let mut rounds = 0;
        while wanted.answer().unwrap().is_none() {
            office.round();
            office.cycle();
            // As soon as one is answered it asks the next.
            flood.retain(|pending| pending.answer().unwrap().is_none());
            while flood.len() < COMMAND_REQUESTS {
                flood.push(ask(&greedy, CommandKind::Status));
            }
            rounds += 1;
            assert!(rounds <= 2 * (COMMAND_REQUESTS + 2), "the other one is not answered");
        }
    }

    #[test]
    fn what_is_answered_as_busy_is_not_carried_out_later() {
        let mut office = Office::new();
        let client = office.client();
        let pending = client.ask(CommandKind::Speed, 0.5).unwrap();
        office.round();
        std::thread::sleep(TAKE_WITHIN);
        office.round();
        let verdict = pending.answer().unwrap().unwrap().verdict;
        assert_eq!(Verdict::from_wire(verdict), Some(Verdict::Busy));
        assert!(!office.cycle() && office.state.snapshot().scale == 1.0);
        // The loop is back: the next one is carried out.
        let pending = client.ask(CommandKind::Speed, 0.25).unwrap();
        office.round();
        assert!(office.cycle());
        office.round();
        let verdict = pending.answer().unwrap().unwrap().verdict;
        assert_eq!(Verdict::from_wire(verdict), Some(Verdict::Accepted));
        assert_eq!(office.state.snapshot().scale, 0.25);
    }

    #[test]
    fn what_the_loop_has_taken_is_not_answered_as_busy() {
        let mut office = Office::new();
        let pending = office.client().ask(CommandKind::Speed, 0.5).unwrap();
        office.round();
        assert!(office.cycle());
        // The service was put aside for long; the loop's answer waits all the same.
        std::thread::sleep(2 * TAKE_WITHIN);
        office.round();
        let verdict = pending.answer().unwrap().unwrap().verdict;
        assert_eq!(Verdict::from_wire(verdict), Some(Verdict::Accepted));
    }

    #[test]
    fn a_stuck_loop_gets_no_more_orders_than_it_has_room_for() {
        let mut office = Office::new();
        let client = office.client();
        let mut busy = 0;
        for _ in 0..20 {
            let pending = client.ask(CommandKind::Status, 0.0).unwrap();
            office.round();
            std::thread::sleep(TAKE_WITHIN);
            office.round();
            busy += u32::from(pending.answer().unwrap().unwrap().verdict == Verdict::Busy.wire());
        }
        assert_eq!(busy, 20);
    }
}
