//! The hardware endpoint as the loop sees it.

use nullsweep_ipc_types::ports::{Ipc, IpcError, PortError, Receiver, Sender, now_ns};
use nullsweep_ipc_types::{JointStates, Setpoint};

/// Something that measures joints and follows setpoints. Neither call may block.
pub trait Hardware {
    /// The newest joint state since the last call.
    ///
    /// # Errors
    /// When the connection is broken; the loop goes on and supervision judges the silence.
    fn read(&mut self) -> Result<Option<JointStates>, PortError>;

    /// Commands a setpoint.
    ///
    /// # Errors
    /// When it could not be handed over.
    fn write(&mut self, setpoint: &Setpoint) -> Result<(), PortError>;

    /// Shortly before a cycle, where there is time: does of the next write what can be done
    /// before its content is known. It may be left out, and may come several times.
    fn prepare(&mut self) {}
}

/// An endpoint in another process.
#[derive(Debug)]
pub struct IpcHardware {
    states: Receiver<JointStates>,
    setpoints: Sender<Setpoint>,
}

impl IpcHardware {
    /// Opens the executor's ends. Call it on the thread that runs the loop.
    ///
    /// # Errors
    /// When another executor has them, or shared memory cannot be used.
    pub fn open(ipc: &Ipc) -> Result<Self, IpcError> {
        Ok(Self { states: ipc.state_receiver()?, setpoints: ipc.setpoint_sender()? })
    }
}

impl Hardware for IpcHardware {
    fn read(&mut self) -> Result<Option<JointStates>, PortError> {
        Ok(self.states.newest()?.map(|n| n.value))
    }

    fn write(&mut self, setpoint: &Setpoint) -> Result<(), PortError> {
        let stamped = Setpoint { stamp_ns: now_ns(), ..*setpoint };
        self.setpoints.send(&stamped).map(|_| ())
    }

    fn prepare(&mut self) {
        // What fails here fails again at the send, which counts it.
        let _ = self.setpoints.prepare();
    }
}

/// An endpoint in the same process on a virtual clock: it is where its setpoint of `delay`
/// writes ago was.
#[derive(Clone, Debug)]
pub struct Loopback {
    /// The state that the next read gives; its stamp and positions are set by [`Hardware::write`].
    pub state: JointStates,
    pipe: std::collections::VecDeque<Setpoint>,
    delay: usize,
}

impl Loopback {
    /// An arm at rest in `state`, which follows `delay` setpoints late.
    #[must_use]
    pub fn new(state: JointStates, delay: usize) -> Self {
        Self { state, pipe: std::collections::VecDeque::with_capacity(delay + 2), delay }
    }
}

impl Hardware for Loopback {
    fn read(&mut self) -> Result<Option<JointStates>, PortError> {
        Ok(Some(self.state))
    }

    fn write(&mut self, setpoint: &Setpoint) -> Result<(), PortError> {
        self.pipe.push_back(*setpoint);
        self.state.sequence += 1;
        self.state.stamp_ns = setpoint.stamp_ns + 1;
        if self.pipe.len() > self.delay
            && let Some(reached) = self.pipe.pop_front()
        {
            self.state.positions = reached.positions;
            self.state.velocities = reached.velocities;
            self.state.setpoint_sequence = reached.sequence;
            self.state.setpoint_received_ns = reached.stamp_ns;
        }
        Ok(())
    }
}
