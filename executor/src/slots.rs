//! What lies between the threads: queues of fixed size, each from one thread to one other. Both
//! ends are wait-free: a thread of high priority never waits for one of low priority that was put
//! aside in the middle of it, as it may with queues that several threads put into.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use nullsweep_ipc_types::HISTOGRAM_BUCKETS;

use crate::admit::{Held, ValidPlan};
use crate::cycle::{Ask, EVENTS, Event, Reply, Snapshot};
use crate::sync::{AtomicU64, Consumer, Producer, RingBuffer};

/// Events that may wait for the service thread.
const EVENT_ROOM: usize = if cfg!(feature = "model") { 4 * EVENTS + 2 } else { 512 };
/// Positions of held joints that may wait for the worker.
pub(crate) const HELD_ROOM: usize = 64;

/// The ends of all queues, one for each thread.
#[derive(Debug)]
pub struct Slots {
    /// The real-time thread's.
    pub looping: LoopEnd,
    /// The worker's.
    pub worker: WorkerEnd,
    /// The service's.
    pub service: ServiceEnd,
}

/// The real-time thread's ends.
#[derive(Debug)]
pub struct LoopEnd {
    /// Admitted plans.
    pub offers: Consumer<Arc<ValidPlan>>,
    /// Plans to be freed.
    pub retired: Producer<Arc<ValidPlan>>,
    /// Orders.
    pub asks: Consumer<Ask>,
    /// Their answers.
    pub replies: Producer<Reply>,
    /// What became of plans.
    pub events: Producer<Event>,
    /// Reports; one that finds no room is lost.
    pub reports: Producer<Report>,
    /// Held joints; where the room is full there are newer ones than those that wait.
    pub held: Producer<Held>,
    /// Which order is decided.
    pub claim: Claim,
}

/// The worker's ends.
#[derive(Debug)]
pub struct WorkerEnd {
    /// Admitted plans.
    pub offers: Producer<Arc<ValidPlan>>,
    /// Plans to be freed.
    pub retired: Consumer<Arc<ValidPlan>>,
    /// Held joints.
    pub held: Consumer<Held>,
    /// Plans that were rejected.
    pub events: Producer<Event>,
}

/// The service's ends.
#[derive(Debug)]
pub struct ServiceEnd {
    /// Orders.
    pub asks: Producer<Ask>,
    /// Their answers.
    pub replies: Consumer<Reply>,
    /// What became of plans, from the loop and from the worker.
    pub events: [Consumer<Event>; 2],
    /// Reports.
    pub reports: Consumer<Report>,
    /// Which order is decided.
    pub claim: Claim,
}

impl Default for Slots {
    fn default() -> Self {
        let (offer, offers) = RingBuffer::new(8);
        let (retire, retired) = RingBuffer::new(256);
        let (ask, asks) = RingBuffer::new(16);
        let (reply, replies) = RingBuffer::new(16);
        let (event, events) = RingBuffer::new(EVENT_ROOM);
        let (rejection, rejections) = RingBuffer::new(EVENT_ROOM);
        let (report, reports) = RingBuffer::new(4);
        let (stand, held) = RingBuffer::new(HELD_ROOM);
        let claim = Claim::default();
        Self {
            looping: LoopEnd {
                offers,
                retired: retire,
                asks,
                replies: reply,
                events: event,
                reports: report,
                held: stand,
                claim: claim.clone(),
            },
            worker: WorkerEnd { offers: offer, retired, held, events: rejection },
            service: ServiceEnd {
                asks: ask,
                replies,
                events: [events, rejections],
                reports,
                claim,
            },
        }
    }
}

impl LoopEnd {
    /// Whether all events of one more cycle with an offer in it would find room. The loop takes
    /// no plan while they would not, so that no event is ever lost.
    #[must_use]
    pub fn has_room_for_events(&self) -> bool {
        self.events.slots() >= 4 * EVENTS
    }
}

/// Who decides about the order that waits for the loop: the loop, which carries it out, or the
/// service, which withdraws it. The first one does, so that an order which was answered as
/// withdrawn is never carried out later. Tickets rise; one is open at a time.
#[derive(Clone, Debug, Default)]
pub struct Claim(Arc<AtomicU64>);

impl Claim {
    /// The service's: this ticket is open.
    pub fn open(&self, ticket: u64) {
        self.0.store(ticket << 1, Ordering::Release);
    }

    /// Whether the caller is the one who decides about this ticket.
    #[must_use]
    pub fn decide(&self, ticket: u64) -> bool {
        let open = ticket << 1;
        self.0.compare_exchange(open, open | 1, Ordering::AcqRel, Ordering::Acquire).is_ok()
    }
}

/// What the loop reports 100 times a second.
#[derive(Clone, Copy, Debug)]
pub struct Report {
    /// When. \[ns\]
    pub stamp_ns: u64,
    /// The loop.
    pub snapshot: Snapshot,
    /// Where the held joints were measured last.
    pub held: Held,
    /// Wake-up lateness, see [`nullsweep_ipc_types::bucket_upper_ns`].
    pub lateness: [u32; HISTOGRAM_BUCKETS],
    /// Compute time a cycle.
    pub compute: [u32; HISTOGRAM_BUCKETS],
    /// From a setpoint to the cycle that reads that the endpoint had it.
    pub round_trip: [u32; HISTOGRAM_BUCKETS],
}

#[cfg(test)]
mod tests {
    use std::thread;

    use super::*;

    #[test]
    fn one_of_two_decides() {
        let claim = Claim::default();
        for ticket in 1..2000u64 {
            claim.open(ticket);
            let other = claim.clone();
            let decides = thread::scope(|scope| {
                let there = scope.spawn(move || other.decide(ticket));
                [claim.decide(ticket), there.join().unwrap()]
            });
            assert_eq!(decides.iter().filter(|d| **d).count(), 1, "{ticket}");
            assert!(!claim.decide(ticket), "{ticket}");
        }
        // An old ticket that is still in the queue decides nothing about the next one.
        claim.open(3000);
        assert!(!claim.decide(2999) && claim.decide(3000));
    }
}
