//! What the judge finds.

use std::collections::BTreeMap;
use std::fmt;

use nullsweep_ipc_types::Setpoint;
use serde::Serialize;

/// How a setpoint can be wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Another joint count than the arm's, or a mode that does not exist.
    Malformed,
    /// A position or velocity is NaN or infinite.
    NotFinite,
    /// Outside the soft limits, moved in by the braking distance at the present speed.
    SoftLimit,
    /// Further from the last setpoint than v·T·Δsequence.
    Step,
    /// The feed-forward velocity exceeds the joint's limit.
    Velocity,
    /// The first setpoint of a session, or after a fault, is not where the arm was measured.
    Jump,
    /// The sender skipped sequence numbers.
    Gap,
    /// A sequence number or stamp that does not rise.
    Reordered,
}

impl Kind {
    /// Every kind, in the order of the table.
    pub const ALL: [Self; 8] = [
        Self::Malformed,
        Self::NotFinite,
        Self::SoftLimit,
        Self::Step,
        Self::Velocity,
        Self::Jump,
        Self::Gap,
        Self::Reordered,
    ];

    /// A few words for people.
    #[must_use]
    pub fn text(self) -> &'static str {
        match self {
            Self::Malformed => "malformed",
            Self::NotFinite => "not finite",
            Self::SoftLimit => "outside the soft limits",
            Self::Step => "step above v·T",
            Self::Velocity => "velocity above its limit",
            Self::Jump => "start away from the arm",
            Self::Gap => "gap by the sender",
            Self::Reordered => "out of order",
        }
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.text())
    }
}

/// One violation in full.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Violation {
    /// What is wrong.
    pub kind: Kind,
    /// The setpoint's sequence number.
    pub sequence: u64,
    /// The executor's mode when it was sent, as text.
    pub mode: &'static str,
    /// The plan that was executed, `0/0` for none.
    pub plan: String,
    /// The knot whose segment was executed.
    pub knot: u32,
    /// Name of the joint, where one joint is at fault.
    pub joint: Option<String>,
    /// The offending value, in the unit of what it is compared with.
    pub value: f64,
    /// The bound that it broke.
    pub bound: f64,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "setpoint {}: {}", self.sequence, self.kind)?;
        if let Some(joint) = &self.joint {
            write!(f, ", {joint}")?;
        }
        write!(f, ", {:.6} against {:.6}", self.value, self.bound)?;
        write!(f, " ({}, plan {}, knot {})", self.mode, self.plan, self.knot)
    }
}

/// A run of setpoints of one plan.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlanRun {
    /// The plan, `0/0` while none was executed.
    pub plan: String,
    /// Sequence number of its first setpoint.
    pub first_sequence: u64,
    /// Sequence number of its last setpoint.
    pub last_sequence: u64,
    /// Largest change of a joint's velocity from the setpoint before the first one to it.
    /// \[rad/s\] or \[m/s\]
    pub join_velocity_step: f64,
    /// Largest step of a joint from the setpoint before the first one, as a share of v·T.
    pub join_step_ratio: f64,
}

impl PlanRun {
    pub(super) fn new(s: &Setpoint) -> Self {
        Self {
            plan: s.plan.to_string(),
            first_sequence: s.sequence,
            last_sequence: s.sequence,
            join_velocity_step: 0.0,
            join_step_ratio: 0.0,
        }
    }
}

/// What the judge found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// Setpoints that were read.
    pub setpoints: u64,
    /// Streams without a break: an executor that restarts opens another one.
    pub sessions: u64,
    /// Violations of each kind, also those that are zero.
    pub violations: BTreeMap<Kind, u64>,
    /// The first violations in full.
    pub first: Vec<Violation>,
    /// Setpoints that this reader lost because it was slower than its buffer is long.
    pub lost_by_reader: u64,
    /// Setpoints that were made more than one period after they were due.
    pub late: u64,
    /// The largest such lateness. \[ns\]
    pub worst_lateness_ns: u64,
    /// The largest step of any joint, as a share of v·T·Δsequence.
    pub largest_step_ratio: f64,
    /// The least distance of any setpoint from a soft limit moved in by its braking distance; negative
    /// outside, infinite where no joint has limits. \[rad\] or \[m\]
    pub least_margin: f64,
    /// The plans in the order in which they were executed.
    pub plans: Vec<PlanRun>,
}

impl Verdict {
    /// How many violations there were in all.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.violations.values().sum()
    }

    /// Whether setpoints came and none of them was wrong.
    #[must_use]
    pub fn is_clean(&self) -> bool {
        self.setpoints > 0 && self.total() == 0
    }
}
