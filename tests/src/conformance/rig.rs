//! In the executor's place before any endpoint: one cycle after another, each with the newest
//! state and, if wanted, a setpoint.

use std::cell::Cell;
use std::rc::Rc;

use bytemuck::Zeroable;
use nullsweep_executor::Hardware;
use nullsweep_ipc_types::ports::PortError;
use nullsweep_ipc_types::{JointStates, Mode, Setpoint};
use nullsweep_robot::{Arm, JointVector};

use crate::clock::{Grid, Tick};
use crate::endpoint::Endpoint;

/// Cycle time. \[ns\]
pub(super) const PERIOD_NS: u64 = 1_000_000;

/// What gives the cycles their times.
pub trait Clock {
    /// Waits for the next cycle.
    fn tick(&mut self) -> Tick;
}

/// `CLOCK_MONOTONIC`, for an endpoint in another process.
impl Clock for Grid {
    fn tick(&mut self) -> Tick {
        self.wait()
    }
}

/// A clock that is a millisecond further at each look, for an endpoint that shares it.
#[derive(Clone, Debug)]
pub struct VirtualClock(Rc<Cell<u64>>);

impl Default for VirtualClock {
    fn default() -> Self {
        Self(Rc::new(Cell::new(1_000_000_000)))
    }
}

impl VirtualClock {
    /// What it shows. \[ns\]
    #[must_use]
    pub fn now_ns(&self) -> u64 {
        self.0.get()
    }
}

impl Clock for VirtualClock {
    fn tick(&mut self) -> Tick {
        self.0.set(self.0.get() + PERIOD_NS);
        Tick { due_ns: self.0.get(), now_ns: self.0.get(), skipped: 0 }
    }
}

/// The mock's endpoint in this process, on a virtual clock.
pub struct VirtualEndpoint {
    endpoint: Endpoint,
    clock: VirtualClock,
    sent: Option<Setpoint>,
}

impl VirtualEndpoint {
    /// An endpoint that was made at the clock's time.
    #[must_use]
    pub fn new(endpoint: Endpoint, clock: VirtualClock) -> Self {
        Self { endpoint, clock, sent: None }
    }
}

impl Hardware for VirtualEndpoint {
    fn read(&mut self) -> Result<Option<JointStates>, PortError> {
        let now_ns = self.clock.now_ns();
        self.endpoint.receive(self.sent.take().as_slice(), now_ns);
        Ok(self.endpoint.measure(now_ns))
    }

    fn write(&mut self, setpoint: &Setpoint) -> Result<(), PortError> {
        self.sent = Some(Setpoint { stamp_ns: self.clock.now_ns(), ..*setpoint });
        Ok(())
    }
}

/// What one cycle asks of the endpoint.
#[derive(Clone, Copy, Debug)]
pub(super) struct Command {
    /// \[rad\] or \[m\]
    pub(super) q: JointVector,
    /// \[rad/s\] or \[m/s\]
    pub(super) v: JointVector,
    pub(super) disable: bool,
    pub(super) joint_count: u32,
}

/// An endpoint and the time.
pub struct Rig<H, C> {
    pub(super) arm: Arm,
    pub(super) now_ns: u64,
    pub(super) sequence: u64,
    pub(super) newest: Option<JointStates>,
    hardware: H,
    clock: C,
}

impl<H: Hardware, C: Clock> Rig<H, C> {
    /// An endpoint of this arm.
    pub fn new(hardware: H, mut clock: C, arm: &Arm) -> Self {
        let now_ns = clock.tick().now_ns;
        Self { arm: arm.clone(), now_ns, sequence: 0, newest: None, hardware, clock }
    }

    /// One cycle; the state that came in it.
    pub(super) fn cycle(
        &mut self,
        command: Option<&Command>,
    ) -> Result<Option<JointStates>, PortError> {
        let Tick { due_ns, now_ns, skipped } = self.clock.tick();
        self.now_ns = now_ns;
        let state = self.hardware.read()?;
        self.newest = state.or(self.newest);
        if let Some(command) = command {
            self.sequence += 1;
            let mut setpoint = Setpoint::zeroed();
            setpoint.sequence = self.sequence;
            setpoint.stamp_ns = self.now_ns;
            // On the grid, as the executor's.
            setpoint.deadline_ns = due_ns + (skipped + 1) * PERIOD_NS;
            let dof = self.arm.dof();
            setpoint.positions[..dof].copy_from_slice(&command.q[..dof]);
            setpoint.velocities[..dof].copy_from_slice(&command.v[..dof]);
            setpoint.joint_count = command.joint_count;
            setpoint.mode = Mode::Hold.wire();
            setpoint.disable = u32::from(command.disable);
            self.hardware.write(&setpoint)?;
        }
        Ok(state)
    }

    /// Where the arm was last measured. \[rad\] or \[m\]
    pub(super) fn measured(&self) -> JointVector {
        let mut q = JointVector::default();
        if let Some(state) = &self.newest {
            let dof = self.arm.dof();
            q[..dof].copy_from_slice(&state.positions[..dof]);
        }
        q
    }

    /// The command to be at `q`, at rest.
    pub(super) fn at(&self, q: JointVector) -> Command {
        let joint_count = self.arm.dof() as u32;
        Command { q, v: JointVector::default(), disable: false, joint_count }
    }
}
