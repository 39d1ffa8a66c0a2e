//! What a mock endpoint moves: the joints and their controllers, in simulated time.

use nullsweep_ipc_types::Setpoint;
use nullsweep_robot::JointVector;

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
