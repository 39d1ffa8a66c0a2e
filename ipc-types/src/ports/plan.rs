//! Plans: published with their knots in place, received as a borrowed sample.

use std::path::{Path, PathBuf};
use std::string::String;

use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{AllocationStrategy, BackpressureStrategy, PortFactory as _, ipc};
use iceoryx2::sample::Sample;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use super::clock::now_ns;
use super::error::{IpcError, PortError};
use super::node::{Ipc, need_shared_memory};
use crate::service::{MAX_NODES, PLAN};
use crate::{Knot, MAX_KNOTS, PlanHeader, PlanId, PlanMessage, checksum};

/// A planner's end of the plan service.
///
/// A plan reaches only an executor that is there, and a publisher that exits takes its
/// undelivered plan with it: keep this alive until the plan's admission has come as an event.
#[derive(Debug)]
pub struct PlanPublisher {
    publisher: Publisher<ipc::Service, [Knot], PlanHeader>,
    service: PortFactory<ipc::Service, [Knot], PlanHeader>,
    robot: String,
    root: Option<PathBuf>,
    max_knots: usize,
    published: u64,
}

impl PlanPublisher {
    pub(super) fn open(ipc: &Ipc, max_knots: usize) -> Result<Self, IpcError> {
        if !(1..=MAX_KNOTS).contains(&max_knots) {
            return Err(IpcError::KnotCount { knots: max_knots, limit: MAX_KNOTS });
        }
        let service = open(ipc)?;
        let publisher = ipc.retry(PLAN.name, || {
            service
                .publisher_builder()
                .initial_max_slice_len(max_knots)
                .max_loaned_samples(1)
                .backpressure_strategy(BackpressureStrategy::DiscardData)
                .allocation_strategy(AllocationStrategy::Static)
                .create()
        })?;
        let (robot, root) = (ipc.robot().into(), ipc.root().map(Path::to_path_buf));
        Ok(Self { publisher, service, robot, root, max_knots, published: 0 })
    }

    /// Gives the plan its id (the present time and this publisher's count) and its checksum,
    /// publishes it, and returns the id. `header.id` and `header.checksum` are overwritten,
    /// `header.knot_count` is set to the number of knots.
    pub fn publish(&mut self, header: &PlanHeader, knots: &[Knot]) -> Result<PlanId, IpcError> {
        let id = PlanId { epoch: now_ns(), number: self.published + 1 };
        let knot_count = u32::try_from(knots.len()).unwrap_or(u32::MAX);
        let mut sealed = PlanHeader { id, knot_count, checksum: 0, ..*header };
        sealed.checksum = checksum(PlanMessage { header: &sealed, knots });
        self.publish_raw(&sealed, knots)?;
        self.published += 1;
        Ok(id)
    }

    /// Publishes a header as it is, with whatever id and checksum it has.
    pub fn publish_raw(&self, header: &PlanHeader, knots: &[Knot]) -> Result<(), IpcError> {
        if !(1..=self.max_knots).contains(&knots.len()) {
            return Err(IpcError::KnotCount { knots: knots.len(), limit: self.max_knots });
        }
        if !self.has_executor() {
            return Err(self.absent());
        }
        // Twice the plan: the page of another process may be filled between asking and filling.
        need_shared_memory(2 * size_of_val(knots) as u64)?;
        let port = |error: PortError| IpcError::Port { what: PLAN.name, error };
        let mut sample =
            self.publisher.loan_slice_uninit(knots.len()).map_err(|e| port(e.into()))?;
        *sample.user_header_mut() = *header;
        let sample = sample.write_from_slice(knots);
        match sample.send().map_err(|e| port(e.into()))? {
            0 if self.has_executor() => Err(IpcError::PlanBufferFull),
            0 => Err(self.absent()),
            _ => Ok(()),
        }
    }

    fn absent(&self) -> IpcError {
        IpcError::NoExecutor { robot: self.robot.clone(), root: self.root.clone() }
    }

    /// Whether an executor listens for plans.
    #[must_use]
    pub fn has_executor(&self) -> bool {
        self.service.dynamic_config().number_of_subscribers() > 0
    }
}

/// The executor's end of the plan service.
#[derive(Debug)]
pub struct PlanReceiver {
    subscriber: Subscriber<ipc::Service, [Knot], PlanHeader>,
    // Held so that the service outlives its publishers.
    _service: PortFactory<ipc::Service, [Knot], PlanHeader>,
}

impl PlanReceiver {
    pub(super) fn open(ipc: &Ipc) -> Result<Self, IpcError> {
        let service = open(ipc)?;
        let subscriber = ipc
            .retry(PLAN.name, || service.subscriber_builder().buffer_size(PLAN.buffer).create())?;
        Ok(Self { subscriber, _service: service })
    }

    /// The oldest plan that waits.
    pub fn receive(&self) -> Result<Option<ReceivedPlan>, PortError> {
        Ok(self.subscriber.receive()?.map(ReceivedPlan))
    }
}

/// A plan in shared memory, untrusted: its publisher can still write to it. Copy it before
/// looking closer.
#[derive(Debug)]
pub struct ReceivedPlan(Sample<ipc::Service, [Knot], PlanHeader>);

impl ReceivedPlan {
    /// The header as it now is.
    #[must_use]
    pub fn header(&self) -> &PlanHeader {
        self.0.user_header()
    }

    /// The knots as they now are.
    #[must_use]
    pub fn knots(&self) -> &[Knot] {
        self.0.payload()
    }
}

fn open(ipc: &Ipc) -> Result<PortFactory<ipc::Service, [Knot], PlanHeader>, IpcError> {
    let name = ipc.service_name(PLAN.name)?;
    ipc.retry(PLAN.name, || {
        ipc.node
            .service_builder(&name)
            .publish_subscribe::<[Knot]>()
            .user_header::<PlanHeader>()
            .max_publishers(PLAN.publishers)
            .max_subscribers(PLAN.subscribers)
            .max_nodes(MAX_NODES)
            .subscriber_max_buffer_size(PLAN.buffer)
            .subscriber_max_borrowed_samples(PLAN.borrowed)
            .history_size(PLAN.history)
            .enable_safe_overflow(PLAN.overflow)
            .open_or_create()
    })
}
