//! The planner's end's book: plans that were published here, and what is known of them.
//!
//! A plan is sent again until the robot's end has said what it did with it, under one id, and not
//! after its time. Its events are told once each, whatever comes twice: one admission, one end.

use std::collections::VecDeque;

use bytemuck::Zeroable;
use nullsweep_ipc_types::{EventKind, PlanEvent, PlanId, Reason};

use crate::wire::{Receipt, Taken};

/// Plans that are remembered.
const REMEMBERED: usize = 1024;
/// Plans that may wait: as many as an executor lets wait.
const WAITING: usize = 4;

/// What is known of a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// It waits, or is under way for the first time.
    Waiting,
    /// Its time is over, and no word came on what was sent: it is asked for.
    Unknown,
    /// The robot's end has it.
    Taken,
    /// It was refused.
    Refused,
}

#[derive(Clone, Debug)]
struct Plan<B> {
    origin: PlanId,
    id: PlanId,
    /// What is sent, while it may be.
    body: Option<B>,
    came_ns: u64,
    stage: Stage,
    /// How often it was sent.
    tries: u32,
    /// It or a question for it is under way.
    under_way: bool,
    told: Told,
}

/// What of a plan's life was told here.
#[derive(Clone, Copy, Debug, Default)]
struct Told {
    admission: bool,
    start: bool,
    end: bool,
}

/// What is to be done for a plan.
#[derive(Clone, Debug, PartialEq)]
pub enum Task<B> {
    /// To send it.
    Send(PlanId, B),
    /// To ask for it.
    Ask(PlanId),
}

/// The plans. `B` is what is sent of one.
#[derive(Clone, Debug)]
pub struct Sent<B> {
    plans: VecDeque<Plan<B>>,
    /// How long a plan is sent. \[ns\]
    within_ns: u64,
}

impl<B: Clone> Sent<B> {
    pub fn new(within_ns: u64) -> Self {
        Self { plans: VecDeque::new(), within_ns }
    }

    /// Whether another one may wait.
    pub fn has_room(&self) -> bool {
        self.plans.iter().filter(|plan| plan.stage == Stage::Waiting).count() < WAITING
    }

    /// Takes a plan over. One whose id came before is refused: that event is to be told.
    pub fn take(
        &mut self,
        (origin, id): (PlanId, PlanId),
        body: B,
        now_ns: u64,
    ) -> Option<PlanEvent> {
        if self.plans.iter().any(|plan| plan.origin == origin) {
            return Some(rejection(origin, Reason::Repeated));
        }
        if self.plans.len() >= REMEMBERED {
            self.plans.pop_front();
        }
        let plan = Plan {
            origin,
            id,
            body: Some(body),
            came_ns: now_ns,
            stage: Stage::Waiting,
            tries: 0,
            under_way: false,
            told: Told::default(),
        };
        self.plans.push_back(plan);
        None
    }

    /// What is to be done next, while the link stands: one plan at a time, in their order.
    pub fn next(&mut self) -> Option<Task<B>> {
        if self.plans.iter().any(|plan| plan.under_way) {
            return None;
        }
        let open = |plan: &&mut Plan<B>| matches!(plan.stage, Stage::Waiting | Stage::Unknown);
        let plan = self.plans.iter_mut().find(open)?;
        plan.under_way = true;
        if plan.stage == Stage::Unknown {
            return Some(Task::Ask(plan.id));
        }
        plan.tries += 1;
        plan.body.clone().map(|body| Task::Send(plan.id, body))
    }

    /// Looks at those whose time is over. One that was never sent is refused: the event is to be told.
    pub fn overdue(&mut self, now_ns: u64) -> Option<PlanEvent> {
        let within_ns = self.within_ns;
        let late = |plan: &&mut Plan<B>| {
            plan.stage == Stage::Waiting && now_ns > plan.came_ns + within_ns && !plan.under_way
        };
        let plan = self.plans.iter_mut().find(late)?;
        plan.body = None;
        if plan.tries > 0 {
            plan.stage = Stage::Unknown;
            return None;
        }
        let age_ns = now_ns - plan.came_ns;
        refuse(plan, Receipt { taken: Taken::Late.wire(), age_ns }, within_ns)
    }

    /// What the robot's end said of a plan; `None`: no word came. An event that is to be told.
    pub fn word(&mut self, id: PlanId, receipt: Option<Receipt>) -> Option<PlanEvent> {
        let within_ns = self.within_ns;
        let plan = self.plans.iter_mut().find(|plan| plan.id == id)?;
        plan.under_way = false;
        let receipt = receipt?;
        match Taken::from_wire(receipt.taken)? {
            _ if !matches!(plan.stage, Stage::Waiting | Stage::Unknown) => None,
            Taken::Yes => {
                (plan.stage, plan.body) = (Stage::Taken, None);
                None
            }
            // Only whoever asks later, or the executor's own events, can tell.
            Taken::Unknown => {
                (plan.stage, plan.body) = (Stage::Taken, None);
                None
            }
            _ => refuse(plan, receipt, within_ns),
        }
    }

    /// The plan's id here, of the one that the executor knows by `id`.
    pub fn origin(&self, id: PlanId) -> Option<PlanId> {
        self.plans.iter().find(|plan| plan.id == id).map(|plan| plan.origin)
    }

    /// Whether an event of the executor's is to be told: of these plans each step once, and that a plan
    /// came before is no step of one that was sent twice.
    pub fn is_news(&mut self, event: &PlanEvent) -> bool {
        let Some(plan) = self.plans.iter_mut().find(|plan| plan.id == event.plan) else {
            return true;
        };
        if plan.tries > 1 && event.reason == Reason::Repeated.wire() {
            return false;
        }
        if plan.stage != Stage::Refused {
            (plan.stage, plan.body) = (Stage::Taken, None);
        }
        let told = match EventKind::from_wire(event.kind) {
            Some(EventKind::Accepted | EventKind::Rejected) => &mut plan.told.admission,
            Some(EventKind::Started) => &mut plan.told.start,
            Some(EventKind::Finished | EventKind::Superseded | EventKind::Aborted) => {
                &mut plan.told.end
            }
            None => return true,
        };
        !std::mem::replace(told, true)
    }
}

/// Refuses a plan here, unless its admission was told.
fn refuse<B>(plan: &mut Plan<B>, receipt: Receipt, within_ns: u64) -> Option<PlanEvent> {
    (plan.stage, plan.body) = (Stage::Refused, None);
    let taken = Taken::from_wire(receipt.taken);
    let reason = match taken {
        Some(Taken::Full) => Reason::QueueFull,
        Some(Taken::Failed) => Reason::Malformed,
        _ => Reason::NotReady,
    };
    let mut event = rejection(plan.origin, reason);
    if taken == Some(Taken::Late) {
        (event.value, event.bound) = (receipt.age_ns as f64 * 1e-9, within_ns as f64 * 1e-9);
    }
    (!std::mem::replace(&mut plan.told.admission, true)).then_some(event)
}

fn rejection(plan: PlanId, reason: Reason) -> PlanEvent {
    PlanEvent {
        plan,
        value: f64::NAN,
        bound: f64::NAN,
        kind: EventKind::Rejected.wire(),
        reason: reason.wire(),
        joint: u32::MAX,
        knot: u32::MAX,
        ..PlanEvent::zeroed()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WITHIN: u64 = 1000;

    fn ids(n: u64) -> (PlanId, PlanId) {
        let id = |epoch| PlanId { epoch, number: 1 };
        (id(n), id(n + 500))
    }

    fn receipt(taken: Taken) -> Option<Receipt> {
        Some(Receipt { taken: taken.wire(), age_ns: 1 })
    }

    fn event(n: u64, kind: EventKind) -> PlanEvent {
        PlanEvent { kind: kind.wire(), reason: 0, ..rejection(ids(n).1, Reason::None) }
    }

    fn sent(plans: &[u64]) -> Sent<u64> {
        let mut sent = Sent::new(WITHIN);
        for n in plans {
            assert!(sent.take(ids(*n), *n, 0).is_none());
        }
        sent
    }

    #[test]
    fn plans_go_one_at_a_time_in_their_order_until_there_is_word() {
        let mut sent = sent(&[1, 2]);
        assert_eq!(sent.next(), Some(Task::Send(ids(1).1, 1)));
        assert_eq!(sent.next(), None, "one is under way");
        assert_eq!(sent.word(ids(1).1, None), None);
        assert_eq!(sent.next(), Some(Task::Send(ids(1).1, 1)), "again, under the same id");
        assert_eq!(sent.word(ids(1).1, receipt(Taken::Yes)), None);
        assert_eq!(sent.next(), Some(Task::Send(ids(2).1, 2)));
        assert!(sent.has_room());
        let repeated = sent.take(ids(2), 2, 0).expect("its id came before");
        assert_eq!((repeated.plan, repeated.reason), (ids(2).0, Reason::Repeated.wire()));
    }

    #[test]
    fn a_plan_that_was_never_sent_is_refused_when_its_time_is_over() {
        let mut sent = sent(&[1]);
        assert_eq!(sent.overdue(WITHIN), None);
        let told = sent.overdue(WITHIN + 1).expect("it is late");
        assert_eq!((told.plan, told.kind), (ids(1).0, EventKind::Rejected.wire()));
        assert_eq!(told.reason, Reason::NotReady.wire());
        assert_eq!((sent.overdue(WITHIN + 2), sent.next()), (None, None), "once");
    }

    #[test]
    fn one_that_may_have_come_is_asked_for_until_it_is_known() {
        let mut sent = sent(&[1]);
        sent.next();
        assert_eq!(sent.overdue(WITHIN + 1), None, "it is under way");
        sent.word(ids(1).1, None);
        assert_eq!(sent.overdue(WITHIN + 1), None, "nothing is known");
        assert_eq!(sent.next(), Some(Task::Ask(ids(1).1)));
        sent.word(ids(1).1, None);
        assert_eq!(sent.next(), Some(Task::Ask(ids(1).1)), "again");
        let told = sent.word(ids(1).1, receipt(Taken::Never)).expect("it never came");
        assert_eq!((told.kind, told.plan), (EventKind::Rejected.wire(), ids(1).0));
        assert_eq!(sent.next(), None, "it is known");
        assert!(!sent.is_news(&event(1, EventKind::Rejected)), "its one admission was told");
    }

    #[test]
    fn each_step_is_told_once_whatever_comes_twice() {
        let mut sent = sent(&[1]);
        sent.next();
        sent.word(ids(1).1, None);
        sent.next();
        // Its events tell that it came, though no receipt did.
        for kind in [EventKind::Accepted, EventKind::Started, EventKind::Finished] {
            assert!(sent.is_news(&event(1, kind)));
            assert!(!sent.is_news(&event(1, kind)), "{kind}");
        }
        let repeated =
            PlanEvent { reason: Reason::Repeated.wire(), ..event(1, EventKind::Rejected) };
        assert!(!sent.is_news(&repeated), "it was sent twice");
        assert_eq!(sent.word(ids(1).1, receipt(Taken::NoExecutor)), None, "it ended long ago");
        assert_eq!(sent.origin(ids(1).1), Some(ids(1).0));
        assert!(sent.is_news(&event(77, EventKind::Started)), "another planner's");
    }

    #[test]
    fn a_refusal_is_told_with_its_reason() {
        for (taken, reason) in [
            (Taken::NoExecutor, Reason::NotReady),
            (Taken::Full, Reason::QueueFull),
            (Taken::Failed, Reason::Malformed),
            (Taken::Late, Reason::NotReady),
        ] {
            let mut sent = sent(&[1]);
            sent.next();
            let told = sent.word(ids(1).1, receipt(taken)).expect("refused");
            assert_eq!(told.reason, reason.wire(), "{taken:?}");
            assert_eq!(told.value.is_finite(), taken == Taken::Late);
        }
    }
}
