//! Streams of fixed-size samples: setpoints, states, telemetry, plan events.

use core::cell::Cell;
use core::fmt::Debug;
use core::mem::MaybeUninit;

use bytemuck::Pod;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::{BackpressureStrategy, PortFactory as _, ipc};
use iceoryx2::sample_mut_uninit::SampleMutUninit;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use iceoryx2_bb_elementary_traits::zero_copy_send::ZeroCopySend;

use super::error::{IpcError, PortError};
use super::node::Ipc;
use crate::service::{MAX_NODES, Qos};
use crate::{JointStates, PlanEvent, Setpoint, Telemetry};

/// A fixed-size payload that streams.
pub trait Payload: Pod + ZeroCopySend + Debug {}
impl Payload for Setpoint {}
impl Payload for JointStates {}
impl Payload for Telemetry {}
impl Payload for PlanEvent {}

/// The sending end of a stream. Sending never blocks; it allocates one small block (iceoryx2
/// 0.10's chunk state), makes no system call while no receiver joins, and overwrites the oldest
/// sample of a receiver that does not read.
pub struct Sender<T: Payload> {
    /// Taken ahead of its time by [`Self::prepare`].
    ready: Cell<Option<Loan<T>>>,
    publisher: Publisher<ipc::Service, T, ()>,
    service: PortFactory<ipc::Service, T, ()>,
}

type Loan<T> = SampleMutUninit<ipc::Service, MaybeUninit<T>, ()>;

impl<T: Payload> Debug for Sender<T> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Sender").field("publisher", &self.publisher).finish_non_exhaustive()
    }
}

impl<T: Payload> Sender<T> {
    pub(super) fn open(ipc: &Ipc, qos: &Qos) -> Result<Self, IpcError> {
        let service = open(ipc, qos)?;
        let publisher = ipc.retry(qos.name, || {
            service
                .publisher_builder()
                .max_loaned_samples(1)
                .backpressure_strategy(BackpressureStrategy::DiscardData)
                .create()
        })?;
        Ok(Self { ready: Cell::new(None), publisher, service })
    }

    /// Sends a copy; to how many receivers.
    pub fn send(&self, value: &T) -> Result<usize, PortError> {
        let loan = match self.ready.take() {
            Some(loan) => loan,
            None => self.publisher.loan_uninit()?,
        };
        Ok(loan.write_payload(*value).send()?)
    }

    /// Takes the memory for the next send, and brings it into this processor's caches: what of a
    /// send can be done before its content is known.
    pub fn prepare(&self) -> Result<(), PortError> {
        let mut loan = match self.ready.take() {
            Some(loan) => loan,
            None => self.publisher.loan_uninit()?,
        };
        loan.payload_mut().write(T::zeroed());
        self.ready.set(Some(loan));
        self.connect()
    }

    /// Connects to receivers that joined since the last send, and hands them the history. Does
    /// what the next send would do, at a moment of one's own choice.
    pub fn connect(&self) -> Result<(), PortError> {
        self.publisher.update_connections().map_err(|_| PortError::Connection)
    }

    /// How many receivers there are.
    #[must_use]
    pub fn receivers(&self) -> usize {
        self.service.dynamic_config().number_of_subscribers()
    }
}

/// The receiving end of a stream. Receiving neither blocks nor allocates while no sender joins.
#[derive(Debug)]
pub struct Receiver<T: Payload> {
    subscriber: Subscriber<ipc::Service, T, ()>,
    service: PortFactory<ipc::Service, T, ()>,
}

/// The newest sample of a stream and how many older ones were passed over to get it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Newest<T> {
    /// The sample.
    pub value: T,
    /// Older samples that were read with it and dropped.
    pub skipped: usize,
}

impl<T: Payload> Receiver<T> {
    pub(super) fn open(ipc: &Ipc, qos: &Qos) -> Result<Self, IpcError> {
        let service = open(ipc, qos)?;
        let subscriber =
            ipc.retry(qos.name, || service.subscriber_builder().buffer_size(qos.buffer).create())?;
        Ok(Self { subscriber, service })
    }

    /// A copy of the oldest sample that waits.
    pub fn receive(&self) -> Result<Option<T>, PortError> {
        Ok(self.subscriber.receive()?.map(|sample| *sample))
    }

    /// A copy of the newest sample that waits; the older ones are dropped and counted. Reads at
    /// most one buffer, so that a fast sender cannot keep a reader busy.
    pub fn newest(&self) -> Result<Option<Newest<T>>, PortError> {
        // The samples are looked at where they lie; only the last one is copied.
        let mut newest = None;
        let mut skipped = 0;
        for _ in 0..self.subscriber.buffer_size() {
            let Some(sample) = self.subscriber.receive()? else { break };
            skipped += usize::from(newest.is_some());
            newest = Some(sample);
        }
        Ok(newest.map(|sample| Newest { value: *sample, skipped }))
    }

    /// How many senders there are.
    #[must_use]
    pub fn senders(&self) -> usize {
        self.service.dynamic_config().number_of_publishers()
    }
}

fn open<T: Payload>(ipc: &Ipc, qos: &Qos) -> Result<PortFactory<ipc::Service, T, ()>, IpcError> {
    let name = ipc.service_name(qos.name)?;
    ipc.retry(qos.name, || {
        ipc.node
            .service_builder(&name)
            .publish_subscribe::<T>()
            .max_publishers(qos.publishers)
            .max_subscribers(qos.subscribers)
            .max_nodes(MAX_NODES)
            .subscriber_max_buffer_size(qos.buffer)
            .subscriber_max_borrowed_samples(qos.borrowed)
            .history_size(qos.history)
            .enable_safe_overflow(qos.overflow)
            .open_or_create()
    })
}
