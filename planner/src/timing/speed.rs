//! How fast a plan is to go along its path.

use nullsweep_robot::{Arm, JointVector};

use super::accelerate::{Pace, paced};
use super::{Limits, jerks};
use crate::cost;
use crate::plan::{Plan, Profile};
use crate::workcell::Workcell;

/// How fast a plan is to go along its path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Speed {
    /// By which limits.
    pub profile: Profile,
    /// One velocity for all joints; `None`: the robot's limits. \[rad/s\]
    pub v_max: Option<f64>,
    /// The greatest jerk of each joint, of [`Profile::Jerk`]; `None`: what the robot's model says.
    /// \[rad/s³\] or \[m/s³\]
    pub jerk: Option<JointVector>,
    /// The greatest speed of the tool on its line, with limited accelerations. \[m/s\]
    pub tool: Option<f64>,
}

impl Speed {
    /// The velocity of each joint. \[rad/s\] or \[m/s\]
    #[must_use]
    pub fn velocity(&self, arm: &Arm) -> JointVector {
        cost::velocities(arm, self.v_max)
    }

    /// A bang-bang plan, as it is to go; with limited accelerations the arm rests at the knots `stops`.
    #[must_use]
    pub fn set(&self, plan: Plan, cell: Workcell<'_>, stops: &[usize]) -> Plan {
        if !self.profile.is_curved() {
            return plan;
        }
        let limited = self.profile == Profile::Jerk;
        let jerk = limited.then(|| self.jerk.unwrap_or_else(|| jerks(cell.arm)));
        let pace = Pace { stops, jerk, tool_speed: self.tool };
        paced(&plan, cell, &Limits::of(cell.arm, self.v_max), &pace)
    }
}
