//! The way from a plan's last stop to where it leaves the arm.

use super::attempt::Planning;
use super::job::End;
use crate::motion::{jump, retract};
use crate::plan::{LIFT, Plan, PlanKnot};
use crate::timing;

/// How often a way to where the plan is to end is looked for, each time with other samples.
const TRIES: u64 = 4;

impl Planning<'_> {
    /// Puts the way from the last stop to where the plan is to end behind a plan with bang-bang
    /// velocity. Where there is none the plan ends nearer to its last stop, which is told.
    pub(super) fn leave(&self, plan: &mut Plan) {
        let Some(last) = plan.knots.last().map(|knot| knot.q) else { return };
        let goal = match self.job.end {
            End::Contact => return,
            End::Lifted => None,
            End::Start => Some(self.start),
            End::At(q) => Some(q),
        };
        let tried = |k: u64| {
            goal.and_then(|goal| jump(self.cell, &last, &goal, self.job.seed.wrapping_add(k)))
        };
        let way = (0..TRIES).find_map(tried);
        if goal.is_some() && way.is_none() {
            self.progress.note("no way free of collision to where the plan is to end was found");
        }
        let cell = self.cell;
        let lifted = || retract(cell.world, cell.arm, cell.tool, &last, LIFT);
        let Some(way) = way.or_else(lifted) else {
            self.progress.note(
                "the plan ends on the surface: the tool cannot be lifted off at the last stop",
            );
            return;
        };
        plan.knots.extend(way[1..].iter().map(|q| PlanKnot::free(*q)));
        timing::set_times(&mut plan.knots, &self.velocity);
    }
}
