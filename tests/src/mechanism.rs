//! A PR2 arm at the level of its mechanism: motors take an effort and an enable and nothing else;
//! joint controllers turn setpoints into effort, transmissions carry it to the joints, and the
//! safety controllers bound it, every millisecond, in the order of the PR2's own loop.
//!
//! What is left out: gravity (the PR2's arms are counterbalanced), the coupling of one joint's
//! motion into another's, belts, and friction other than viscous. Each joint's inertia is that of
//! the links beyond it with the elbow bent at a right angle.

use std::f64::consts::TAU;

use nullsweep_ipc_types::Setpoint;
use nullsweep_robot::{Arm, JointVector};

use crate::plant::{Plant, Target};

/// Period of the control loop. \[ns\]
const PERIOD_NS: u64 = 1_000_000;
/// Integration steps in each period.
const SUBSTEPS: u32 = 4;
/// Counts of each motor's encoder in one turn.
const COUNTS: f64 = 1200.0;
const JOINTS: usize = 7;
/// The joint that carries most of a weight in the hand.
const LIFT: usize = 1;
/// Joints that share two motors.
const FLEX: usize = 5;
const ROLL: usize = 6;

/// Gains of a joint's controller and figures of its drive train.
struct Joint {
    /// End of the joint's name, after the side.
    name: &'static str,
    /// Proportional, integral and derivative gain. \[N·m/rad, N·m/(rad·s), N·m·s/rad\]
    gains: [f64; 3],
    /// Bound on the integral's share of the effort. \[N·m\]
    integral: f64,
    /// \[N·m\]
    effort: f64,
    /// Gain of the safety controller on velocity. \[N·m·s/rad\]
    k_velocity: f64,
    /// Viscous. \[N·m·s/rad\]
    damping: f64,
    /// \[kg·m²\]
    inertia: f64,
    /// Turns of the motor for one of the joint; for the wrist, of both motors.
    reduction: f64,
}

const fn joint(
    name: &'static str,
    gains: [f64; 3],
    [integral, effort, k_velocity, damping, inertia, reduction]: [f64; 6],
) -> Joint {
    Joint { name, gains, integral, effort, k_velocity, damping, inertia, reduction }
}

const ARM: [Joint; JOINTS] = [
    joint("shoulder_pan_joint", [2400.0, 800.0, 18.0], [4.0, 30.0, 10.0, 10.0, 2.5, 63.1552453]),
    joint("shoulder_lift_joint", [1200.0, 700.0, 10.0], [4.0, 30.0, 10.0, 10.0, 1.6, 61.89482257]),
    joint("upper_arm_roll_joint", [1000.0, 600.0, 6.0], [4.0, 30.0, 2.0, 0.1, 0.38, 32.65251115]),
    joint("elbow_flex_joint", [700.0, 450.0, 4.0], [4.0, 30.0, 3.0, 1.0, 0.35, -36.16745201]),
    joint("forearm_roll_joint", [300.0, 300.0, 6.0], [2.0, 30.0, 1.0, 0.1, 0.03, -90.51428571]),
    joint("wrist_flex_joint", [300.0, 300.0, 4.0], [2.0, 10.0, 4.0, 0.1, 0.015, 60.17142857]),
    joint("wrist_roll_joint", [300.0, 300.0, 4.0], [2.0, 10.0, 2.0, 0.1, 0.012, 60.17142857]),
];

/// All that a motor takes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct ActuatorCommand {
    enable: bool,
    /// \[N·m\] at the motor
    effort: f64,
}

/// A mechanism was asked for where none is known.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the mechanism is known for the PR2's arms only, and {joint} is none of their joints; use --fidelity servo"
)]
pub struct UnknownMechanism {
    /// The first joint that is not the PR2's.
    pub joint: String,
}

/// The mechanism of one PR2 arm.
#[derive(Clone)]
pub struct Mechanism {
    arm: Arm,
    now_ns: u64,
    positions: JointVector,
    velocities: JointVector,
    efforts: JointVector,
    measured: JointVector,
    target: Target,
    /// Integral shares of the efforts. \[N·m\]
    integrals: JointVector,
    enabled: bool,
    /// What the counterbalance does not carry, on the shoulder lift. \[N·m\]
    payload: f64,
}

impl Mechanism {
    /// An arm at rest.
    ///
    /// # Errors
    /// The arm is not a PR2's.
    pub fn new(arm: &Arm, positions: JointVector, now_ns: u64) -> Result<Self, UnknownMechanism> {
        let known = |j: usize| ARM.get(j).is_some_and(|k| arm.joint_names()[j].ends_with(k.name));
        if let Some(j) = (0..arm.dof()).find(|&j| !known(j)) {
            return Err(UnknownMechanism { joint: arm.joint_names()[j].clone() });
        }
        let zero = JointVector::default();
        let mut mechanism = Self {
            arm: arm.clone(),
            now_ns,
            positions,
            velocities: zero,
            efforts: zero,
            measured: positions,
            target: Target::rest(positions, now_ns),
            integrals: zero,
            enabled: true,
            payload: 0.0,
        };
        mechanism.measured = mechanism.encoders();
        Ok(mechanism)
    }

    /// The same arm with a weight in its hand that the counterbalance does not carry: a constant
    /// effort on the shoulder lift. \[N·m\]
    #[must_use]
    pub fn with_payload(mut self, payload: f64) -> Self {
        self.payload = payload;
        self
    }

    /// One period: read encoders, control, bound, command the motors, move.
    fn cycle(&mut self) {
        self.now_ns += PERIOD_NS;
        let dt = PERIOD_NS as f64 * 1e-9;
        self.measured = self.encoders();
        let mut efforts = JointVector::default();
        for j in 0..JOINTS {
            // Velocity as the encoders give it is too coarse a number to damp with; the PR2
            // filters it, here the true one stands for the filtered one.
            let moving = self.now_ns <= self.target.reached_ns;
            let wanted = if moving { self.target.velocities[j] } else { 0.0 };
            let error = self.target.positions[j] - self.measured[j];
            let [p, i, d] = ARM[j].gains;
            let bound = ARM[j].integral;
            self.integrals[j] = (self.integrals[j] + i * error * dt).clamp(-bound, bound);
            efforts[j] = p * error + self.integrals[j] + d * (wanted - self.velocities[j]);
            efforts[j] = self.safe(j, efforts[j]);
        }
        let commands = self.motors(&efforts);
        self.efforts = joint_efforts(&commands);
        let dt = dt / f64::from(SUBSTEPS);
        for _ in 0..SUBSTEPS {
            for j in 0..JOINTS {
                // Damping taken at the end of the step, so that it cannot overshoot.
                let weight = if j == LIFT { self.payload } else { 0.0 };
                let impulse = self.velocities[j] + (self.efforts[j] + weight) * dt / ARM[j].inertia;
                self.velocities[j] = impulse / (1.0 + ARM[j].damping * dt / ARM[j].inertia);
                self.positions[j] += self.velocities[j] * dt;
            }
        }
        self.end_stops();
    }

    /// The safety controller: near a soft limit less and less effort towards it is allowed, and
    /// beyond it the effort is turned against the motion.
    fn safe(&self, j: usize, effort: f64) -> f64 {
        let limits = &self.arm.limits()[j];
        let (v, k) = (limits.velocity, limits.k_position.unwrap_or(0.0));
        let (mut high, mut low) = (v, -v);
        if !limits.continuous && k > 0.0 {
            high = (-k * (self.measured[j] - limits.upper)).clamp(-v, v);
            low = (-k * (self.measured[j] - limits.lower)).clamp(-v, v);
        }
        let most = ARM[j].effort;
        let bound =
            |speed: f64| (-ARM[j].k_velocity * (self.velocities[j] - speed)).clamp(-most, most);
        let (low, high) = (bound(low), bound(high));
        effort.max(low).min(high)
    }

    /// Joint efforts as commands to the motors. The wrist's two motors share flex and roll, so a
    /// full effort in one leaves nothing for the other.
    fn motors(&self, efforts: &JointVector) -> [ActuatorCommand; JOINTS] {
        let mut commands = [ActuatorCommand { enable: self.enabled, effort: 0.0 }; JOINTS];
        for j in 0..FLEX {
            commands[j].effort = efforts[j] / ARM[j].reduction;
        }
        let n = ARM[FLEX].reduction;
        // Joint reductions are −1 (flex) and 1 (roll).
        let (flex, roll) = (-efforts[FLEX], efforts[ROLL]);
        let most = ARM[FLEX].effort / n;
        commands[FLEX].effort = ((flex - roll) / (2.0 * n)).clamp(-most, most);
        commands[ROLL].effort = ((-flex - roll) / (2.0 * n)).clamp(-most, most);
        commands
    }

    /// Joint positions from whole counts of the motors' encoders.
    fn encoders(&self) -> JointVector {
        let count = |turns: f64| (turns * COUNTS / TAU).round() * TAU / COUNTS;
        let mut q = self.positions;
        for j in 0..FLEX {
            q[j] = count(self.positions[j] * ARM[j].reduction) / ARM[j].reduction;
        }
        let n = ARM[FLEX].reduction;
        let (flex, roll) = (-self.positions[FLEX], self.positions[ROLL]);
        let (right, left) = (count(n * (flex - roll)), count(-n * (flex + roll)));
        q[FLEX] = -(right - left) / (2.0 * n);
        q[ROLL] = (-right - left) / (2.0 * n);
        q
    }

    /// Nothing turns past its hard stop; those lie a little beyond the soft limits.
    fn end_stops(&mut self) {
        for j in 0..JOINTS {
            let limits = &self.arm.limits()[j];
            let stops = (limits.lower - 0.05, limits.upper + 0.05);
            if self.positions[j] < stops.0 || self.positions[j] > stops.1 {
                self.positions[j] = self.positions[j].clamp(stops.0, stops.1);
                self.velocities[j] = 0.0;
            }
        }
    }
}

impl Plant for Mechanism {
    fn measured(&self) -> &JointVector {
        &self.measured
    }

    fn velocities(&self) -> &JointVector {
        &self.velocities
    }

    fn efforts(&self) -> &JointVector {
        &self.efforts
    }

    fn follow(&mut self, setpoint: &Setpoint) {
        self.advance(setpoint.stamp_ns);
        if !self.enabled {
            self.hold();
            self.enabled = true;
        }
        self.target = Target::of(setpoint, JOINTS, self.now_ns);
    }

    /// Holds where it is measured and forgets the integrals, as the PR2's controllers do.
    fn hold(&mut self) {
        self.target = Target::rest(self.measured, self.now_ns);
        self.integrals = JointVector::default();
    }

    /// Motors off: no effort, only damping.
    fn release(&mut self) {
        self.hold();
        self.enabled = false;
    }

    fn shift_encoder(&mut self, joint: usize, by: f64) {
        // Positions are those that the encoders and the control loop know.
        self.positions[joint] += by;
        self.measured[joint] += by;
    }

    fn advance(&mut self, to_ns: u64) {
        while self.now_ns + PERIOD_NS <= to_ns {
            self.cycle();
        }
    }
}

/// What the motors' efforts are at the joints.
fn joint_efforts(commands: &[ActuatorCommand; JOINTS]) -> JointVector {
    let motor = |j: usize| if commands[j].enable { commands[j].effort } else { 0.0 };
    let mut efforts = JointVector::default();
    for j in 0..FLEX {
        efforts[j] = motor(j) * ARM[j].reduction;
    }
    let n = ARM[FLEX].reduction;
    efforts[FLEX] = -n * (motor(FLEX) - motor(ROLL));
    efforts[ROLL] = -n * (motor(FLEX) + motor(ROLL));
    efforts
}

#[cfg(test)]
mod tests {
    use nullsweep_robot::{ArmSpec, Robot, Side};

    use super::*;

    const MS: u64 = 1_000_000;

    fn arm() -> Arm {
        Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).expect("the PR2 has a right arm")
    }

    fn mechanism() -> Mechanism {
        Mechanism::new(&arm(), arm().home(), 0).expect("a PR2 arm")
    }

    /// Feeds setpoints for `ms` milliseconds; `posture` gives them by time in seconds.
    fn drive(m: &mut Mechanism, from: u64, ms: u64, posture: impl Fn(f64) -> JointVector) -> f64 {
        let mut worst = 0.0f64;
        for k in from..from + ms {
            let (q, next) = (posture(k as f64 * 1e-3), posture((k + 1) as f64 * 1e-3));
            let mut s = <Setpoint as bytemuck::Zeroable>::zeroed();
            (s.stamp_ns, s.deadline_ns) = (k * MS, (k + 1) * MS);
            for j in 0..JOINTS {
                s.positions[j] = next[j];
                s.velocities[j] = (next[j] - q[j]) * 1e3;
            }
            m.follow(&s);
            m.advance((k + 1) * MS);
            let off = |j: usize| (m.positions[j] - next[j]).abs();
            worst = (0..JOINTS).map(off).fold(worst, f64::max);
        }
        worst
    }

    #[test]
    fn efforts_come_back_through_the_transmissions() {
        let m = mechanism();
        let efforts = JointVector::new([3.0, -2.0, 1.0, 0.5, -0.4, 4.0, -3.0, 0.0]);
        let back = joint_efforts(&m.motors(&efforts));
        for j in 0..JOINTS {
            assert!((back[j] - efforts[j]).abs() < 1e-12, "joint {j}: {}", back[j]);
        }
        // Both wrist joints at their limit ask more of one motor than it has.
        let greedy = JointVector::new([0.0, 0.0, 0.0, 0.0, 0.0, 10.0, 10.0, 0.0]);
        let back = joint_efforts(&m.motors(&greedy));
        assert!(back[FLEX] < 10.0 + 1e-12 && back[FLEX] + back[ROLL] <= 20.0 + 1e-9);
        let more = JointVector::new([0.0, 0.0, 0.0, 0.0, 0.0, 20.0, 20.0, 0.0]);
        let back = joint_efforts(&m.motors(&more));
        assert!((back[FLEX] - 10.0).abs() < 1e-9, "{}", back[FLEX]);
    }

    #[test]
    fn encoders_are_as_fine_as_their_counts() {
        let m = mechanism();
        let fine = TAU / COUNTS / 32.65251115;
        for j in 0..JOINTS {
            assert!((m.measured[j] - m.positions[j]).abs() <= fine, "joint {j}");
        }
    }

    #[test]
    fn it_follows_a_slow_sine() {
        let (mut m, home) = (mechanism(), arm().home());
        let sine = |t: f64| {
            let mut q = home;
            for j in 0..JOINTS {
                q[j] += 0.1 * (1.0 - (TAU * 0.25 * t).cos()) * if j == 5 { -1.0 } else { 1.0 };
            }
            q
        };
        let worst = drive(&mut m, 0, 4000, sine);
        assert!(worst < 0.02, "{worst}");
        let rest = drive(&mut m, 4000, 2000, |_| sine(4.0));
        assert!(rest < 0.02);
        for j in 0..JOINTS {
            assert!((m.positions[j] - home[j]).abs() < 2e-3, "joint {j} settles");
        }
    }

    #[test]
    fn the_safety_controller_keeps_the_soft_limits() {
        let (mut m, arm) = (mechanism(), arm());
        let upper = arm.limits()[3].upper;
        let home = arm.home();
        // A setpoint that runs far past the elbow's soft limit.
        drive(&mut m, 0, 3000, |t| {
            let mut q = home;
            q[3] += t.min(2.0);
            q
        });
        assert!(m.positions[3] < upper + 0.03, "{} past {upper}", m.positions[3]);
        assert!(m.positions[3] > upper - 0.1);
    }

    #[test]
    fn without_motors_there_is_no_effort() {
        let (mut m, home) = (mechanism(), arm().home());
        let far = |t: f64| {
            let mut q = home;
            q[0] -= 0.5 * t;
            q
        };
        drive(&mut m, 0, 500, far);
        assert!(m.efforts[0].abs() > 0.0 && m.velocities[0] < -0.2);
        m.release();
        m.advance(1000 * MS);
        assert_eq!(m.efforts, JointVector::default());
        m.advance(3000 * MS);
        assert!(m.velocities[0].abs() < 0.01, "damped out: {}", m.velocities[0]);
        // Enabled again, it stays where it is until it is led away.
        let here = m.measured;
        drive(&mut m, 3000, 500, |_| here);
        assert!((m.positions[0] - here[0]).abs() < 2e-3);
    }

    #[test]
    fn a_weight_in_the_hand_is_held_and_sinks_without_motors() {
        let home = arm().home();
        let mut m = mechanism().with_payload(2.0);
        drive(&mut m, 0, 4000, |_| home);
        assert!((m.positions[LIFT] - home[LIFT]).abs() < 1e-3, "{}", m.positions[LIFT]);
        m.release();
        m.advance(5000 * MS);
        assert!(m.positions[LIFT] > home[LIFT] + 0.05, "{}", m.positions[LIFT]);
    }

    #[test]
    fn other_arms_are_refused() {
        let xml = r#"<robot name="one"><link name="a"/><link name="b"/>
            <joint name="elbow" type="revolute"><parent link="a"/><child link="b"/>
            <axis xyz="0 0 1"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>"#;
        let robot = Robot::from_urdf_str(xml).expect("a robot");
        let arm = robot.arm(&ArmSpec { base: "a".into(), tip: "b".into() }).expect("an arm");
        let error = Mechanism::new(&arm, arm.home(), 0).err().expect("not a PR2");
        assert_eq!(error.joint, "elbow");
    }
}
