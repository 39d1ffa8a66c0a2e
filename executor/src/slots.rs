//! What lies between the threads: bounded lock-free queues. No thread ever waits for another.

use std::sync::Arc;

use crossbeam::queue::ArrayQueue;
use nullsweep_ipc_types::HISTOGRAM_BUCKETS;

use crate::admit::{Held, ValidPlan};
use crate::cycle::{Ask, EVENTS, Event, Reply, Snapshot};

/// Events that may wait for the service thread.
const EVENT_ROOM: usize = 512;

/// Every queue. The comment says from which thread to which.
#[derive(Debug)]
pub struct Slots {
    /// Worker → loop: admitted plans.
    pub offers: ArrayQueue<Arc<ValidPlan>>,
    /// Loop → worker: plans to be freed.
    pub retired: ArrayQueue<Arc<ValidPlan>>,
    /// Service, main → loop: orders.
    pub asks: ArrayQueue<Ask>,
    /// Loop → service: their answers.
    pub replies: ArrayQueue<Reply>,
    /// Loop, worker → service: what became of plans.
    pub events: ArrayQueue<Event>,
    /// Loop → service: the newest report.
    pub reports: ArrayQueue<Report>,
    /// Loop → worker: the newest held joints.
    pub held: ArrayQueue<Held>,
}

impl Default for Slots {
    fn default() -> Self {
        Self {
            offers: ArrayQueue::new(8),
            retired: ArrayQueue::new(256),
            asks: ArrayQueue::new(16),
            replies: ArrayQueue::new(16),
            events: ArrayQueue::new(EVENT_ROOM),
            reports: ArrayQueue::new(1),
            held: ArrayQueue::new(1),
        }
    }
}

impl Slots {
    /// Whether all events of one more cycle with an offer in it would find room. The loop takes
    /// no plan while they would not, so that no event is ever lost.
    #[must_use]
    pub fn has_room_for_events(&self) -> bool {
        self.events.len() + 4 * EVENTS <= EVENT_ROOM
    }
}

/// What the loop reports 100 times a second.
#[derive(Clone, Copy, Debug)]
pub struct Report {
    /// When. \[ns\]
    pub stamp_ns: u64,
    /// The loop.
    pub snapshot: Snapshot,
    /// Wake-up lateness, see [`nullsweep_ipc_types::bucket_upper_ns`].
    pub lateness: [u32; HISTOGRAM_BUCKETS],
    /// Compute time a cycle.
    pub compute: [u32; HISTOGRAM_BUCKETS],
    /// From a setpoint to the cycle that reads that the endpoint had it.
    pub round_trip: [u32; HISTOGRAM_BUCKETS],
}
