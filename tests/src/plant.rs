//! What a mock endpoint moves: the joints and their controllers, in simulated time.

use nullsweep_ipc_types::Setpoint;
use nullsweep_robot::JointVector;

/// A line in joint space that ends in `positions` at `reached_ns` and rests there.
#[derive(Clone, Debug)]
pub struct Target {
    /// \[rad\] or \[m\]
    pub positions: JointVector,
    /// Along the line. \[rad/s\] or \[m/s\]
    pub velocities: JointVector,
    /// \[ns\]
    pub reached_ns: u64,
}

impl Target {
    /// A setpoint is never approached for longer than this; a longer deadline is not believed.
    const LONGEST_APPROACH_NS: u64 = 2_000_000;

    /// Stay there.
    #[must_use]
    pub fn rest(positions: JointVector, now_ns: u64) -> Self {
        Self { positions, velocities: JointVector::default(), reached_ns: now_ns }
    }

    /// What a setpoint asks of `dof` joints.
    #[must_use]
    pub fn of(setpoint: &Setpoint, dof: usize, now_ns: u64) -> Self {
        let mut target = Self::rest(JointVector::default(), now_ns);
        target.positions[..dof].copy_from_slice(&setpoint.positions[..dof]);
        target.velocities[..dof].copy_from_slice(&setpoint.velocities[..dof]);
        target.reached_ns = setpoint.deadline_ns.clamp(now_ns, now_ns + Self::LONGEST_APPROACH_NS);
        target
    }
}

/// Simulated joints. Time only goes on when it is told to, so that a process which stalls
/// simulates what the arm did meanwhile.
pub trait Plant: Send {
    /// Measured positions. \[rad\] or \[m\]
    fn measured(&self) -> &JointVector;
    /// Measured velocities. \[rad/s\] or \[m/s\]
    fn velocities(&self) -> &JointVector;
    /// Efforts at the joints, 0 where there is no model of them. \[N·m\] or \[N\]
    fn efforts(&self) -> &JointVector;
    /// Follows a setpoint from the moment of its stamp; turns the motors on.
    fn follow(&mut self, setpoint: &Setpoint);
    /// Stops following and holds where the arm is measured.
    fn hold(&mut self);
    /// Turns the motors off.
    fn release(&mut self);
    /// The encoder of a joint jumps: from now on it is read so much further. \[rad\] or \[m\]
    fn shift_encoder(&mut self, joint: usize, by: f64);
    /// Moves on to a later time; an earlier one changes nothing. \[ns\]
    fn advance(&mut self, to_ns: u64);
}
