//! What the mock measured, kept in memory while it runs and written as CSV at the end.

use std::io::{self, Write};

use nullsweep_ipc_types::{PlanId, Setpoint};
use nullsweep_robot::{Arm, JointVector};

use crate::tracking::Tracking;

/// One measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// When. [ns, `CLOCK_MONOTONIC`]
    pub stamp_ns: u64,
    /// The plan that was executed.
    pub plan: PlanId,
    /// The knot whose segment was executed.
    pub knot: u32,
    /// Measured positions. \[rad\] or \[m\]
    pub positions: JointVector,
    /// Commanded positions. \[rad\] or \[m\]
    pub commanded: JointVector,
}

/// Measurements at a steady distance in time.
#[derive(Clone, Debug)]
pub struct Recorder {
    every_ns: u64,
    next_ns: u64,
    samples: Vec<Sample>,
}

impl Recorder {
    /// Memory for ten minutes at 5 ms is asked for at once, so that the loop does not.
    const CAPACITY: usize = 120_000;

    /// Keeps a measurement every so many nanoseconds.
    #[must_use]
    pub fn new(every_ns: u64) -> Self {
        Self { every_ns, next_ns: 0, samples: Vec::with_capacity(Self::CAPACITY) }
    }

    /// Keeps this measurement if one is due.
    pub fn offer(&mut self, stamp_ns: u64, positions: &JointVector, setpoint: Option<&Setpoint>) {
        if stamp_ns < self.next_ns {
            return;
        }
        self.next_ns = stamp_ns + self.every_ns;
        let mut commanded = *positions;
        if let Some(setpoint) = setpoint {
            commanded.copy_from_slice(&setpoint.positions[..positions.len()]);
        }
        self.samples.push(Sample {
            stamp_ns,
            plan: setpoint.map_or(PlanId::NONE, |s| s.plan),
            knot: setpoint.map_or(0, |s| s.knot),
            positions: *positions,
            commanded,
        });
    }

    /// The measured positions so far, oldest first.
    pub fn postures(&self) -> impl Iterator<Item = JointVector> + '_ {
        self.samples.iter().map(|s| s.positions)
    }

    /// How the arm followed while plans ran, whole turns of joints without end aside: an endpoint that was
    /// started anew counts them from 0. `None` if none did.
    #[must_use]
    pub fn tracking(&self, arm: &Arm) -> Option<Tracking> {
        let off = |s: &Sample| {
            let apart = arm.continuous().displacement(&s.commanded, &s.positions);
            apart.iter().map(|apart| apart.abs()).fold(0.0, f64::max)
        };
        Tracking::of(self.samples.iter().filter(|s| s.plan != PlanId::NONE).map(off).collect())
    }

    /// Writes time since the first measurement \[s\], plan, knot, measured and commanded joints.
    pub fn write_csv(&self, joints: &[String], out: &mut impl Write) -> io::Result<()> {
        write!(out, "time_s,plan,knot")?;
        for name in joints {
            write!(out, ",{name}")?;
        }
        for name in joints {
            write!(out, ",{name}_commanded")?;
        }
        writeln!(out)?;
        let start_ns = self.samples.first().map_or(0, |s| s.stamp_ns);
        for s in &self.samples {
            write!(out, "{:.4},{},{}", (s.stamp_ns - start_ns) as f64 * 1e-9, s.plan, s.knot)?;
            for q in s.positions[..joints.len()].iter().chain(&s.commanded[..joints.len()]) {
                write!(out, ",{q:.6}")?;
            }
            writeln!(out)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use nullsweep_robot::{ArmSpec, Robot, Side};

    use super::*;

    #[test]
    fn a_record_reads_back() {
        let mut recorder = Recorder::new(5_000_000);
        for k in 0..11u64 {
            let mut q = JointVector::default();
            q[1] = k as f64;
            recorder.offer(1_000_000_000 + k * 1_000_000, &q, None);
        }
        let mut text = Vec::new();
        recorder.write_csv(&["a".into(), "b".into()], &mut text).expect("to memory");
        let text = String::from_utf8(text).expect("UTF-8");
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines[0], "time_s,plan,knot,a,b,a_commanded,b_commanded");
        assert_eq!(lines[2], "0.0050,0/0,0,0.000000,5.000000,0.000000,5.000000");
        assert_eq!(lines.len(), 4);
    }
    #[test]
    fn whole_turns_are_no_error() {
        let robot = Robot::pr2();
        let arm = robot.arm(&ArmSpec::pr2(Side::Right)).expect("an arm");
        let mut recorder = Recorder::new(1);
        let plan = PlanId { epoch: 1, number: 1 };
        let mut setpoint = Setpoint { plan, ..bytemuck::Zeroable::zeroed() };
        assert!(arm.continuous().is(6) && !arm.continuous().is(0));
        setpoint.positions[6] = -4.0 * std::f64::consts::TAU + 0.001;
        recorder.offer(1, &JointVector::ZERO, Some(&setpoint));
        let found = recorder.tracking(&arm).expect("one");
        assert!((found.max - 0.001).abs() < 1e-9, "{found:?}");
        setpoint.positions[0] = 0.5;
        recorder.offer(2, &JointVector::ZERO, Some(&setpoint));
        assert_eq!(recorder.tracking(&arm).expect("two").max, 0.5);
    }
}
