//! Pieces of a plan over which its tool does not work.

use nullsweep_robot::Arm;
use nullsweep_surface::Scan;

use crate::plan::Plan;
use crate::verify::stand_off;

/// Takes out of a plan's work where a tool that works from afar would be too near, too far or too
/// aslant for the scan, in the root frame: the arm goes on as it was planned, the tool does not work there.
/// How many pieces these are.
#[must_use]
pub fn idle(plan: &mut Plan, arm: &Arm, scan: &Scan) -> usize {
    let (_, broken) = stand_off(plan, arm, scan);
    let mut pieces = 0;
    let mut last = None;
    for knot in broken.iter().map(|violation| violation.knot) {
        pieces += usize::from(last.is_none_or(|last| knot > last + 1));
        last = Some(knot);
        (plan.knots[knot].line, plan.knots[knot].patch) = (None, None);
    }
    pieces
}
