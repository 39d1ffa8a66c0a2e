//! The way from a plan's last stop to where it leaves the arm.

use super::attempt::Planning;
use super::job::End;
use crate::motion::{jump, retract};
use crate::plan::{LIFT, Plan, PlanKnot};
use crate::timing;

/// How often a way to where the plan is to end is looked for, each time with other samples.
const TRIES: u64 = 4;
/// Motions off the surface that are gone back to, to look for a way to the start from there.
const BACKWARDS: usize = 6;

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
        if way.is_none() && self.job.end == End::Start && self.go_back(plan) {
            return;
        }
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

    /// Puts the way on which the plan came behind it, back to where it is off the surface and a way to
    /// its start is found, at the latest to the start itself; whether there is such a way.
    fn go_back(&self, plan: &mut Plan) -> bool {
        let knots = &plan.knots;
        let Some(last) = knots.len().checked_sub(1).filter(|_| knots[0].q == self.start) else {
            return false;
        };
        let is_free = |k: &usize| knots[*k].line.is_none();
        // The middle of each motion off the surface, the last one first.
        let mut middles: Vec<usize> = Vec::new();
        let mut k = last;
        while k > 0 {
            let end = k;
            while k > 0 && is_free(&k) {
                k -= 1;
            }
            if end > k {
                middles.push(k + (end - k).div_ceil(2));
            } else {
                k -= 1;
            }
        }
        let ways = middles
            .into_iter()
            .take(BACKWARDS)
            .find_map(|k| Some((k, jump(self.cell, &knots[k].q, &self.start, self.job.seed)?)));
        let (from, way) = ways.unwrap_or((0, vec![self.start]));
        let mut back: Vec<PlanKnot> = knots[from..last].to_vec();
        back.reverse();
        back.iter_mut().for_each(|knot| knot.patch = None);
        plan.knots.extend(back);
        plan.knots.extend(way[1..].iter().map(|q| PlanKnot::free(*q)));
        timing::set_times(&mut plan.knots, &self.velocity);
        true
    }
}
