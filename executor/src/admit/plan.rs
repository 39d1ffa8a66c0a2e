//! A plan that was admitted.

use nullsweep_ipc_types::{Interpolation, PlanId};

use crate::interpolate::PlanKnot;

/// How a plan joins the motion that is going on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Join {
    /// Stop on the path, then start.
    Stop,
    /// Start when what runs and waits has ended.
    After,
    /// Start in a knot of the running plan.
    Knot {
        /// The running plan.
        plan: PlanId,
        /// Its knot.
        knot: usize,
    },
}

/// What a plan does between its knots, and in them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Shape {
    /// How to move between knots.
    pub(crate) interpolation: Interpolation,
    /// Whether a linear plan's velocity may step in every knot.
    pub(crate) corners: bool,
}

/// A plan that has passed every check that does not depend on the moment. Its fields are
/// private and nothing changes it, so the loop need not look again.
#[derive(Debug, PartialEq)]
pub struct ValidPlan {
    id: PlanId,
    join: Join,
    shape: Shape,
    verified: bool,
    pub(super) knots: Vec<PlanKnot>,
    /// The knots' times once more, close together, to be searched.
    times: Vec<f64>,
    waited: f64,
}

impl ValidPlan {
    /// A plan that was checked.
    pub(crate) fn new(
        id: PlanId,
        join: Join,
        shape: Shape,
        verified: bool,
        knots: Vec<PlanKnot>,
        waited: f64,
    ) -> Self {
        let times = knots.iter().map(|k| k.time).collect();
        Self { id, join, shape, verified, knots, times, waited }
    }

    /// The time from its publication to the end of its check, which the loop tells with its
    /// acceptance. \[s\]
    #[must_use]
    pub fn waited(&self) -> f64 {
        self.waited
    }

    /// Notes that the check is done.
    pub(crate) fn checked(mut self, now_ns: u64) -> Self {
        self.waited = now_ns.saturating_sub(self.id.epoch) as f64 * 1e-9;
        self
    }

    /// Names it.
    #[must_use]
    pub fn id(&self) -> PlanId {
        self.id
    }

    /// How it joins.
    #[must_use]
    pub fn join(&self) -> Join {
        self.join
    }

    /// How to move between knots.
    #[must_use]
    pub fn interpolation(&self) -> Interpolation {
        self.shape.interpolation
    }

    /// Whether its velocity may step in every knot, the first and the last one too: bang-bang.
    #[must_use]
    pub fn has_corners(&self) -> bool {
        self.shape.corners
    }

    /// Whether its sender says that the planner's last check passed it. Whatever the sender says,
    /// the executor's own rules are kept.
    #[must_use]
    pub fn is_verified(&self) -> bool {
        self.verified
    }

    /// At least two knots, times from 0 and rising strictly.
    #[must_use]
    pub fn knots(&self) -> &[PlanKnot] {
        &self.knots
    }

    /// The knots' times. \[ns\]
    pub(crate) fn times(&self) -> &[f64] {
        &self.times
    }

    /// How long it takes at full speed. \[ns\]
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.knots.last().map_or(0.0, |k| k.time)
    }
}
