//! A joint servo without dynamics: each joint follows the setpoints like a stiff, critically
//! damped position loop with velocity feed-forward.

use nullsweep_ipc_types::Setpoint;
use nullsweep_robot::{Arm, JointVector};

use crate::plant::{Plant, Target};

/// Joints without inertia.
#[derive(Clone, Debug)]
pub struct Servo {
    /// Natural frequency of the loop. \[rad/s\]
    omega: f64,
    speed_limits: JointVector,
    dof: usize,
    now_ns: u64,
    positions: JointVector,
    velocities: JointVector,
    efforts: JointVector,
    target: Target,
}

impl Servo {
    /// Bandwidth of the position loop: the error after a corner of 1 rad/s stays below
    /// 1/(e·ω) = 3 mrad. \[rad/s\]
    pub const OMEGA: f64 = 125.0;
    /// How much faster than the velocity limit the servo may catch up.
    const CATCH_UP: f64 = 1.05;

    /// An arm at rest.
    #[must_use]
    pub fn new(arm: &Arm, positions: JointVector, now_ns: u64) -> Self {
        let mut speed_limits = JointVector::default();
        for (j, limits) in arm.limits().iter().enumerate() {
            speed_limits[j] = limits.velocity * Self::CATCH_UP;
        }
        Self {
            omega: Self::OMEGA,
            speed_limits,
            dof: arm.dof(),
            now_ns,
            positions,
            velocities: JointVector::default(),
            efforts: JointVector::default(),
            target: Target::rest(positions, now_ns),
        }
    }

    /// The exact solution of ë + 2ωė + ω²e = 0 for the distance e from a target that moves
    /// evenly (`moving`) or rests, over one stretch of time.
    fn step(&mut self, to_ns: u64, moving: bool) {
        if to_ns <= self.now_ns {
            return;
        }
        let dt = (to_ns - self.now_ns) as f64 * 1e-9;
        let left = self.target.reached_ns.saturating_sub(self.now_ns) as f64 * 1e-9;
        let decay = (-self.omega * dt).exp();
        for j in 0..self.dof {
            let rate = if moving { self.target.velocities[j] } else { 0.0 };
            let target = self.target.positions[j] - if moving { rate * left } else { 0.0 };
            let error = self.positions[j] - target;
            let drift = self.velocities[j] - rate;
            let slope = drift + self.omega * error;
            let end = target + rate * dt + (error + slope * dt) * decay;
            let speed = rate + (drift - self.omega * slope * dt) * decay;
            let reach = self.speed_limits[j] * dt;
            self.positions[j] = end.clamp(self.positions[j] - reach, self.positions[j] + reach);
            self.velocities[j] = speed.clamp(-self.speed_limits[j], self.speed_limits[j]);
        }
        self.now_ns = to_ns;
    }
}

impl Plant for Servo {
    fn measured(&self) -> &JointVector {
        &self.positions
    }

    fn velocities(&self) -> &JointVector {
        &self.velocities
    }

    fn efforts(&self) -> &JointVector {
        &self.efforts
    }

    fn follow(&mut self, setpoint: &Setpoint) {
        self.advance(setpoint.stamp_ns);
        self.target = Target::of(setpoint, self.dof, self.now_ns);
    }

    fn hold(&mut self) {
        self.target = Target::rest(self.positions, self.now_ns);
    }

    /// Brakes locked: the joints stand at once.
    fn release(&mut self) {
        self.velocities = JointVector::default();
        self.hold();
    }

    fn shift_encoder(&mut self, joint: usize, by: f64) {
        // The servo closes its loop over what the encoder says.
        self.positions[joint] += by;
    }

    fn advance(&mut self, to_ns: u64) {
        if self.now_ns < self.target.reached_ns {
            self.step(to_ns.min(self.target.reached_ns), true);
        }
        self.step(to_ns, false);
    }
}

#[cfg(test)]
mod tests {
    use nullsweep_robot::{ArmSpec, Robot, Side};

    use super::*;

    fn arm() -> Arm {
        Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).expect("the embedded PR2 has a right arm")
    }

    fn setpoint(k: u64, positions: &JointVector, velocity: f64) -> Setpoint {
        let mut s = <Setpoint as bytemuck::Zeroable>::zeroed();
        (s.sequence, s.stamp_ns, s.deadline_ns) = (k, k * 1_000_000, (k + 1) * 1_000_000);
        s.positions[..7].copy_from_slice(&positions[..7]);
        s.velocities[0] = velocity;
        s
    }

    /// Drives joint 0 at 1 rad/s for 200 cycles, measured at the end of each.
    fn run(servo: &mut Servo, home: &JointVector, measure_every: u64) -> Vec<f64> {
        let mut errors = Vec::new();
        for k in 0..200 {
            let mut q = *home;
            q[0] -= 1e-3 * (k + 1) as f64;
            servo.follow(&setpoint(k, &q, -1.0));
            if k % measure_every == 0 {
                servo.advance((k + 1) * 1_000_000);
                errors.push((servo.measured()[0] - q[0]).abs());
            }
        }
        errors
    }

    #[test]
    fn it_follows_a_ramp_and_comes_to_rest() {
        let arm = arm();
        let home = arm.home();
        let mut servo = Servo::new(&arm, home, 0);
        let errors = run(&mut servo, &home, 1);
        let worst = errors.iter().copied().fold(0.0, f64::max);
        assert!(worst < 1.0 / (std::f64::consts::E * Servo::OMEGA) + 1e-4, "corner {worst}");
        assert!(errors[199] < 1e-6, "no error remains at constant speed: {}", errors[199]);
        servo.advance(500_000_000);
        assert!((servo.measured()[0] - (home[0] - 0.2)).abs() < 1e-9);
        assert!(servo.velocities()[0].abs() < 1e-9);
    }

    #[test]
    fn a_stalled_process_changes_nothing() {
        let arm = arm();
        let home = arm.home();
        let (mut steady, mut stalled) = (Servo::new(&arm, home, 0), Servo::new(&arm, home, 0));
        run(&mut steady, &home, 1);
        run(&mut stalled, &home, 67);
        for servo in [&mut steady, &mut stalled] {
            servo.advance(200_000_000);
        }
        assert!((steady.measured()[0] - stalled.measured()[0]).abs() < 1e-9);
    }

    #[test]
    fn it_never_exceeds_its_speed() {
        let arm = arm();
        let home = arm.home();
        let mut servo = Servo::new(&arm, home, 0);
        let mut far = home;
        far[0] -= 1.0;
        servo.follow(&setpoint(0, &far, 0.0));
        let mut last = home[0];
        for k in 1..100u64 {
            servo.advance(k * 1_000_000);
            let step = (servo.measured()[0] - last).abs();
            assert!(step <= 2.088e-3 * 1.05 + 1e-12, "{step}");
            last = servo.measured()[0];
        }
        assert!(last < home[0] - 0.15, "but it moves: {last}");
    }
}
