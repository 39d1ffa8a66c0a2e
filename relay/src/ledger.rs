//! The robot's end's book: which plans came, and every event that the executor told.

use std::collections::VecDeque;

use nullsweep_ipc_types::{PlanEvent, PlanId};

use crate::wire::{Entry, Receipt, Taken};

/// Plans, and events, that are remembered.
const REMEMBERED: usize = 1024;

/// A plan that came over a link.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Came {
    origin: PlanId,
    id: PlanId,
    receipt: Receipt,
}

/// What came and what became of it.
#[derive(Clone, Debug)]
pub struct Ledger {
    /// When it was begun. \[ns\]
    began_ns: u64,
    count: u64,
    entries: VecDeque<Entry>,
    plans: VecDeque<Came>,
}

impl Ledger {
    pub fn new(began_ns: u64) -> Self {
        Self { began_ns, count: 0, entries: VecDeque::new(), plans: VecDeque::new() }
    }

    /// How many events it has had.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// When it was begun. \[ns\]
    pub fn began_ns(&self) -> u64 {
        self.began_ns
    }

    /// Enters an event.
    pub fn enter(&mut self, event: PlanEvent) -> Entry {
        self.count += 1;
        let entry = Entry { index: self.count, origin: self.origin(event.plan), event };
        push(&mut self.entries, entry);
        entry
    }

    /// The events behind that index.
    pub fn after(&self, index: u64) -> impl Iterator<Item = &Entry> {
        self.entries.iter().filter(move |entry| entry.index > index)
    }

    /// Enters what was done with a plan: the first word on it stands.
    pub fn note(&mut self, origin: PlanId, id: PlanId, receipt: Receipt) {
        if self.receipt(id).is_none() {
            push(&mut self.plans, Came { origin, id, receipt });
        }
    }

    /// What was done with the plan that the executor knows by this id: also one that it spoke of before
    /// this ledger was begun.
    pub fn receipt(&self, id: PlanId) -> Option<Receipt> {
        let came = self.plans.iter().find(|came| came.id == id).map(|came| came.receipt);
        let told = || self.entries.iter().any(|entry| entry.event.plan == id);
        came.or_else(|| told().then_some(Receipt { taken: Taken::Yes.wire(), age_ns: 0 }))
    }

    /// The same, and the word on one that is not entered: whether it never came, or can have before this
    /// ledger was begun.
    pub fn word(&self, id: PlanId) -> Receipt {
        let never = if id.epoch > self.began_ns { Taken::Never } else { Taken::Unknown };
        self.receipt(id).unwrap_or(Receipt { taken: never.wire(), age_ns: 0 })
    }

    /// The plan's id for the executor; the same where it came on no link.
    pub fn id(&self, origin: PlanId) -> PlanId {
        self.plans.iter().rev().find(|came| came.origin == origin).map_or(origin, |came| came.id)
    }

    /// The plan's id where it was published; [`PlanId::NONE`] where it came on no link.
    pub fn origin(&self, id: PlanId) -> PlanId {
        self.plans.iter().find(|came| came.id == id).map_or(PlanId::NONE, |came| came.origin)
    }

    /// The events of one plan.
    pub fn of(&self, id: PlanId) -> impl Iterator<Item = &Entry> {
        self.entries.iter().filter(move |entry| entry.event.plan == id)
    }
}

fn push<T>(all: &mut VecDeque<T>, one: T) {
    if all.len() >= REMEMBERED {
        all.pop_front();
    }
    all.push_back(one);
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use nullsweep_ipc_types::EventKind;

    use super::*;

    fn id(epoch: u64) -> PlanId {
        PlanId { epoch, number: 1 }
    }

    fn event(plan: PlanId, kind: EventKind) -> PlanEvent {
        PlanEvent { plan, kind: kind.wire(), ..PlanEvent::zeroed() }
    }

    const YES: Receipt = Receipt { taken: 0, age_ns: 3 };

    #[test]
    fn the_first_word_on_a_plan_stands() {
        let mut ledger = Ledger::new(100);
        let late = Receipt { taken: Taken::Late.wire(), age_ns: 9 };
        ledger.note(id(7), id(207), late);
        ledger.note(id(7), id(207), YES);
        assert_eq!(ledger.receipt(id(207)), Some(late));
        assert_eq!((ledger.id(id(7)), ledger.origin(id(207))), (id(207), id(7)));
        assert_eq!((ledger.id(id(8)), ledger.origin(id(208))), (id(8), PlanId::NONE));
        assert_eq!(ledger.word(id(300)).taken, Taken::Never.wire());
        assert_eq!(ledger.word(id(50)).taken, Taken::Unknown.wire(), "from before it began");
    }

    #[test]
    fn events_are_counted_and_those_of_a_plan_found() {
        let mut ledger = Ledger::new(100);
        ledger.note(id(7), id(207), YES);
        let first = ledger.enter(event(id(207), EventKind::Accepted));
        assert_eq!((first.index, first.origin), (1, id(7)));
        let other = ledger.enter(event(id(9), EventKind::Accepted));
        assert_eq!((other.index, other.origin), (2, PlanId::NONE));
        ledger.enter(event(id(207), EventKind::Finished));
        assert_eq!(ledger.after(1).map(|e| e.index).collect::<Vec<_>>(), [2, 3]);
        assert_eq!(ledger.of(id(207)).count(), 2);
        // It was not entered as a plan, but the executor has spoken of it.
        assert_eq!(ledger.receipt(id(9)).map(|r| r.taken), Some(Taken::Yes.wire()));
        for _ in 0..2 * REMEMBERED {
            ledger.enter(event(id(9), EventKind::Started));
        }
        assert_eq!(ledger.after(0).count(), REMEMBERED);
        assert_eq!(ledger.count(), 3 + 2 * REMEMBERED as u64);
    }
}
