//! What happened, and how often.

use std::collections::BTreeMap;
use std::fmt;

use anyhow::ensure;
use nullsweep_ipc_types::{EventKind, PlanEvent, PlanId};

/// The life of a plan as its events tell it.
#[derive(Clone, Copy, Debug, Default)]
struct Fate {
    admissions: u32,
    accepted: u32,
    ends: u32,
}

/// Counts of all that happened.
#[derive(Debug, Default)]
pub(super) struct Tally {
    deeds: BTreeMap<String, u64>,
    events: BTreeMap<&'static str, u64>,
    fates: BTreeMap<(u64, u64), Fate>,
    /// Of the last event.
    sequence: u64,
    /// Events that never came.
    lost: u64,
}

impl Tally {
    /// Counts something that was done.
    pub(super) fn did(&mut self, what: impl Into<String>) {
        *self.deeds.entry(what.into()).or_default() += 1;
    }

    /// A plan that was published, and is to have its admission and its end.
    pub(super) fn published(&mut self, plan: PlanId) {
        self.fates.entry((plan.epoch, plan.number)).or_default();
    }

    /// Takes an event in, whosever plan it tells of.
    pub(super) fn event(&mut self, event: &PlanEvent) {
        let Some(kind) = EventKind::from_wire(event.kind) else { return };
        *self.events.entry(kind.text()).or_default() += 1;
        if self.sequence > 0 {
            self.lost += event.sequence.saturating_sub(self.sequence + 1);
        }
        self.sequence = event.sequence;
        let fate = self.fates.entry((event.plan.epoch, event.plan.number)).or_default();
        match kind {
            EventKind::Accepted => {
                fate.admissions += 1;
                fate.accepted += 1;
            }
            EventKind::Rejected => fate.admissions += 1,
            EventKind::Started => {}
            EventKind::Finished | EventKind::Superseded | EventKind::Aborted => fate.ends += 1,
        }
    }

    /// Whether every plan had what it is due, and nothing got lost.
    pub(super) fn check(&self) -> anyhow::Result<()> {
        ensure!(self.lost == 0, "{} events never came", self.lost);
        ensure!(!self.fates.is_empty(), "no plan was published");
        for ((epoch, number), fate) in &self.fates {
            ensure!(
                fate.admissions == 1 && fate.ends == fate.accepted,
                "plan {epoch:x}/{number}: {fate:?}"
            );
        }
        Ok(())
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let list = |of: Vec<String>| of.join(", ");
        let events = self.events.iter().map(|(what, n)| format!("{n} {what}")).collect();
        let deeds = self.deeds.iter().map(|(what, n)| format!("{n} {what}")).collect();
        write!(f, "{} plans: {}; done: {}", self.fates.len(), list(events), list(deeds))
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;

    fn event(sequence: u64, number: u64, kind: EventKind) -> PlanEvent {
        let plan = PlanId { epoch: 1, number };
        PlanEvent { sequence, plan, kind: kind.wire(), ..PlanEvent::zeroed() }
    }

    #[test]
    fn a_plan_without_its_end_and_a_lost_event_are_found() {
        use EventKind::{Accepted, Finished, Rejected, Started};
        let tally = |events: &[(u64, u64, EventKind)]| {
            let mut tally = Tally::default();
            tally.published(PlanId { epoch: 1, number: 1 });
            events.iter().for_each(|&(s, n, k)| tally.event(&event(s, n, k)));
            tally.check().is_ok()
        };
        let whole = [(5, 1, Accepted), (6, 1, Started), (7, 2, Rejected), (8, 1, Finished)];
        assert!(tally(&whole));
        assert!(!tally(&[]), "no admission");
        assert!(!tally(&whole[..3]), "no end");
        assert!(!tally(&[(5, 1, Rejected), (7, 2, Rejected)]), "event 6 is lost");
        assert!(!tally(&[(5, 1, Rejected), (6, 1, Rejected)]), "two admissions");
        assert!(!tally(&[(5, 1, Accepted), (6, 1, Finished), (7, 1, Finished)]), "two ends");
    }
}
