//! How fast a plan goes along its path: the tool's speed on the surface, and what the joints do.

use nalgebra::Point3;
use nullsweep_robot::{Arm, JointVector};
use serde::{Deserialize, Serialize};

use super::percentile::percentile;
use crate::plan::{Trajectory, TrajectoryCursor};

/// Time between two looks: a cycle of the executor. \[ns\]
const SAMPLE_NS: u64 = 1_000_000;
/// The same. \[s\]
const SAMPLE: f64 = SAMPLE_NS as f64 * 1e-9;
/// A tool that is slower than this on the surface has all but stopped. \[m/s\]
pub const DIP: f64 = 0.05;
/// A dip is over when the tool is this much faster again.
const OVER: f64 = 1.2;

/// How fast a plan goes, as setpoints 1 ms apart show it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pace {
    /// Time with the pad on the surface. \[s\]
    pub contact_s: f64,
    /// Speed of the pad's centre on the surface, 5th percentile over that time. \[m/s\]
    pub tool_speed_p5: f64,
    /// Median. \[m/s\]
    pub tool_speed_p50: f64,
    /// 95th percentile. \[m/s\]
    pub tool_speed_p95: f64,
    /// How often the tool falls below `dip_speed` on the surface and rises again before it is
    /// lifted off.
    pub dips: usize,
    /// What counts as a dip. \[m/s\]
    pub dip_speed: f64,
    /// What each joint does, base to tip.
    pub joints: Vec<JointPace>,
}

/// What one joint does.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JointPace {
    /// Its name in the URDF.
    pub name: String,
    /// Its share of the sum of all joint displacements.
    pub effort_share: f64,
    /// Its largest speed. \[rad/s\] or \[m/s\]
    pub velocity: f64,
    /// Its largest acceleration, of the setpoints' second differences: steps of the velocity
    /// count with what a cycle makes of them. \[rad/s²\] or \[m/s²\]
    pub acceleration: f64,
    /// Its largest jerk, of their third differences. \[rad/s³\] or \[m/s³\]
    pub jerk: f64,
}

impl Pace {
    /// Of a plan's motion, with a tool speed below which it dips. \[m/s\] `moving`: it takes over from
    /// another plan in motion, so that what the joints did before is not known here; else they were
    /// at rest.
    #[must_use]
    pub fn of(path: Trajectory<'_>, moving: bool, arm: &Arm, dip_speed: f64) -> Self {
        let pad = path.tool.on(arm);
        let mut speeds = Vec::new();
        let mut dips = Dips { speed: dip_speed, ..Dips::default() };
        let mut joints: Vec<JointPace> =
            arm.joint_names().iter().map(|name| JointPace::named(name)).collect();
        let mut cursor = TrajectoryCursor::new(path);
        let end_ns = path.knots.last().map_or(0, |k| k.time_ns);
        let mut before: Option<(JointVector, Option<Point3<f64>>)> = None;
        // Velocity and acceleration of the last sample, where they are known.
        let mut rates = if moving { [None; 2] } else { [Some(JointVector::ZERO); 2] };
        for sample in 0..=end_ns / SAMPLE_NS + 3 {
            let (knot, q) = cursor.at((sample * SAMPLE_NS).min(end_ns));
            let centre = path.on_surface(knot).then(|| pad.centre(&q));
            if let Some((last, from)) = before {
                let velocity = JointVector::from_fn(|j| (q[j] - last[j]) / SAMPLE);
                let change = |to: JointVector, from: JointVector| {
                    JointVector::from_fn(|j| (to[j] - from[j]) / SAMPLE)
                };
                let acceleration = rates[0].map(|last| change(velocity, last));
                let jerk = acceleration.zip(rates[1]).map(|(to, from)| change(to, from));
                let size = |of: Option<JointVector>, j: usize| of.map_or(0.0, |v| v[j].abs());
                for (j, joint) in joints.iter_mut().enumerate() {
                    joint.effort_share += (q[j] - last[j]).abs();
                    joint.velocity = joint.velocity.max(velocity[j].abs());
                    joint.acceleration = joint.acceleration.max(size(acceleration, j));
                    joint.jerk = joint.jerk.max(size(jerk, j));
                }
                rates = [Some(velocity), acceleration];
                match from.zip(centre) {
                    Some((from, to)) => {
                        let speed = (to - from).norm() / SAMPLE;
                        dips.see(speed);
                        speeds.push(speed);
                    }
                    None => dips.lift(),
                }
            }
            before = Some((q, centre));
        }
        let all: f64 = joints.iter().map(|j| j.effort_share).sum();
        if all > 0.0 {
            joints.iter_mut().for_each(|j| j.effort_share /= all);
        }
        speeds.sort_by(f64::total_cmp);
        Self {
            contact_s: speeds.len() as f64 * SAMPLE,
            tool_speed_p5: percentile(&speeds, 0.05),
            tool_speed_p50: percentile(&speeds, 0.5),
            tool_speed_p95: percentile(&speeds, 0.95),
            dips: dips.count,
            dip_speed,
            joints,
        }
    }
}

impl JointPace {
    fn named(name: &str) -> Self {
        Self { name: name.to_owned(), ..Self::default() }
    }
}

/// Counts the dips.
#[derive(Default)]
struct Dips {
    speed: f64,
    count: usize,
    /// Whether the tool was fast since it was set down.
    was_fast: bool,
    is_slow: bool,
}

impl Dips {
    fn see(&mut self, speed: f64) {
        if speed < self.speed {
            self.is_slow = true;
        } else if speed > OVER * self.speed {
            self.count += usize::from(self.was_fast && self.is_slow);
            (self.was_fast, self.is_slow) = (true, false);
        }
    }

    fn lift(&mut self) {
        (self.was_fast, self.is_slow) = (false, false);
    }
}

#[cfg(test)]
mod tests {
    use nullsweep_robot::{ArmSpec, Robot, Side, Tool};

    use super::*;
    use crate::plan::{PlanKnot, Profile};

    /// What the plan before it did is not this plan's acceleration.
    #[test]
    fn a_plan_that_begins_in_motion_does_not_begin_with_a_jolt() {
        let arm = Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).expect("an arm");
        // From 0.5 rad/s to rest: q = 0.5 (t − t²/2), so −0.5 rad/s² all along.
        let knot = |time: f64| {
            let (mut q, mut v) = (JointVector::ZERO, JointVector::ZERO);
            (q[0], v[0]) = (0.5 * (time - 0.5 * time * time), 0.5 * (1.0 - time));
            PlanKnot { time_ns: (time * 1e9) as u64, q, v, line: None, patch: None }
        };
        let knots: Vec<PlanKnot> = (0..=4).map(|k| knot(0.25 * f64::from(k))).collect();
        let (tool, profile) = (Tool::default(), Profile::Acceleration);
        let path = Trajectory { tool: &tool, profile, knots: &knots };
        let of = |moving: bool| Pace::of(path, moving, &arm, DIP).joints[0].clone();
        assert!((of(true).acceleration - 0.5).abs() < 1e-3, "{:?}", of(true));
        // From rest it is a step of 0.5 rad/s in a cycle.
        assert!(of(false).acceleration > 400.0, "{:?}", of(false));
    }

    #[test]
    fn a_dip_is_a_fall_and_a_rise_on_the_surface() {
        let mut dips = Dips { speed: 0.05, ..Dips::default() };
        // From rest up is no dip, nor is a tremble around the bound, nor a stop to be lifted off.
        for speed in [0.0, 0.1, 0.2, 0.04, 0.055, 0.045, 0.07, 0.3, 0.01, 0.0] {
            dips.see(speed);
        }
        assert_eq!(dips.count, 1);
        dips.lift();
        for speed in [0.0, 0.1, 0.0, 0.2] {
            dips.see(speed);
        }
        assert_eq!(dips.count, 2);
    }
}
