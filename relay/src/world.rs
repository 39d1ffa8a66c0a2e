//! The executor's place in the planners' world, while there is an executor at the other end.

use nullsweep_ipc_types::ports::{
    CommandServer, Ipc, IpcError, PlanReceiver, PortError, Sender, now_ns,
};
use nullsweep_ipc_types::{PlanEvent, Telemetry};

/// The executor's ends of the services.
pub struct World {
    pub plans: PlanReceiver,
    pub commands: CommandServer,
    events: Sender<PlanEvent>,
    telemetry: Sender<Telemetry>,
    told: u64,
}

impl World {
    /// Takes the executor's place.
    ///
    /// # Errors
    /// An executor of this world has it; or shared memory cannot be used.
    pub fn open(ipc: &Ipc) -> Result<Self, IpcError> {
        // What a killed one left behind is in the way.
        ipc.sweep_dead_nodes();
        Ok(Self {
            telemetry: ipc.telemetry_sender()?,
            events: ipc.event_sender()?,
            commands: ipc.command_server()?,
            // The last: who finds somebody listening for plans finds the rest too.
            plans: ipc.plan_receiver()?,
            told: 0,
        })
    }

    /// Tells an event. They are counted here, since some are this end's own.
    ///
    /// # Errors
    /// A port that failed.
    pub fn tell(&mut self, event: &PlanEvent) -> Result<(), PortError> {
        self.told += 1;
        let stamp_ns = if event.stamp_ns == 0 { now_ns() } else { event.stamp_ns };
        self.events.send(&PlanEvent { sequence: self.told, stamp_ns, ..*event }).map(|_| ())
    }

    /// Hands the last events to who came since the last one.
    ///
    /// # Errors
    /// A port that failed.
    pub fn connect(&self) -> Result<(), PortError> {
        self.events.connect()
    }

    /// Tells how the executor is.
    ///
    /// # Errors
    /// A port that failed.
    pub fn show(&self, telemetry: &Telemetry) -> Result<(), PortError> {
        self.telemetry.send(telemetry).map(|_| ())
    }
}
