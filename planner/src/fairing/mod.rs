//! The pad's way on the surface made fair: a curve of bounded turning in place of lines from patch
//! to patch.
//!
//! Coverage does not ask for the patches' centres: a pad of 7 × 10 cm passes over them anyway. So
//! each contact piece, from where the tool is set down to where it is lifted off, is averaged along
//! its length: the pad's place and normal over a window of some centimetres, its heading and the
//! joints over a wider one (`Piece`). The joints are then brought onto the averaged
//! pose by the least motion, so that what they do in the null space is averaged too. Where that
//! does not go, collides, or sweeps too little, the window is narrowed and the piece made again;
//! without a window it is what it was.

mod band;
mod bend;
mod fair;
mod follow;
mod piece;
mod relax;
mod window;

use nalgebra::Point3;
use nullsweep_surface::Scan;
use rayon::prelude::*;

use self::fair::Fair;
use self::piece::Piece;
use crate::plan::{Plan, PlanKnot};
use crate::sweep::{contact_motion, coverage};
use crate::timing::Limits;
use crate::workcell::{Bed, Workcell};

/// Share of the points to sweep that a fair way may leave out of what the way as it was sweeps.
const LOSS: f64 = 0.003;
/// Share of the widest windows down to which they are narrowed first, for the sake of what is swept:
/// a scan's unevenness is averaged by narrow ones too, and corners are hardly cut.
const GENTLE: f64 = 0.25;

/// What is to be swept.
#[derive(Clone, Copy)]
pub struct Keep<'a> {
    /// The scanned points, in the root frame.
    pub scan: &'a Scan,
    /// Which of them count.
    pub points: &'a [bool],
}

/// The plan (which must be of bang-bang velocity) with fair contact pieces, proven free of
/// collision; its times are to be set anew. Where a piece cannot be made fair it is as it was.
/// With `limits` of acceleration the pieces are bent too, so that they take less time.
#[must_use]
pub fn fair(
    plan: &Plan,
    cell: Workcell<'_>,
    bed: &Bed,
    keep: Keep<'_>,
    limits: Option<&Limits>,
) -> Plan {
    let mut pieces: Vec<Fair> = Piece::all(plan, cell, bed).into_iter().map(Fair::new).collect();
    let before = keep.swept(plan, cell);
    let whole = keep.count(&vec![true; keep.points.len()]);
    let least: [f64; 2] = std::array::from_fn(|i| keep.count(&before)[i] - LOSS * whole[i]);
    let fits =
        |swept: &[bool]| keep.count(swept).iter().zip(least).all(|(count, least)| *count >= least);
    let reach = 0.5 * cell.tool.width.hypot(cell.tool.length);
    let mut narrowest = GENTLE;
    let (averaged, kept) = loop {
        pieces.par_iter_mut().for_each(|piece| piece.average(cell, bed));
        let made = assembled(plan, &pieces);
        let after = keep.swept(&made, cell);
        if fits(&after) {
            break (made, after);
        }
        let lost = keep.lost(&before, &after);
        let given = pieces.iter_mut().map(|fair| fair.give_back(&lost, reach, narrowest));
        if given.filter(|given| *given).count() == 0 {
            if narrowest == 0.0 {
                // What is lost is near none of them: who knows why, so all is as it was.
                return plan.clone();
            }
            narrowest = 0.0;
        }
    };
    let Some(limits) = limits else { return averaged };
    loop {
        pieces.par_iter_mut().for_each(|piece| piece.relax(cell, bed, limits));
        let made = assembled(plan, &pieces);
        let after = keep.swept(&made, cell);
        if fits(&after) {
            return made;
        }
        let lost = keep.lost(&kept, &after);
        let given = pieces.iter_mut().map(|fair| fair.give_room_back(&lost, reach));
        if given.filter(|given| *given).count() == 0 {
            return averaged;
        }
    }
}

impl Keep<'_> {
    fn swept(&self, plan: &Plan, cell: Workcell<'_>) -> Vec<bool> {
        coverage::swept(self.scan, &contact_motion(plan.trajectory(), cell.arm), cell.tool)
    }

    /// Of the points to sweep, and of all.
    fn count(&self, swept: &[bool]) -> [f64; 2] {
        let counts = swept.iter().zip(self.points).filter(|(swept, counts)| **swept && **counts);
        [counts.count(), swept.iter().filter(|s| **s).count()].map(|count| count as f64)
    }

    fn lost(&self, before: &[bool], after: &[bool]) -> Vec<Point3<f64>> {
        let lost = (0..after.len()).filter(|&i| before[i] && !after[i]);
        lost.map(|i| self.scan.points[i]).collect()
    }
}

/// The plan with the pieces in their places.
fn assembled(plan: &Plan, pieces: &[Fair]) -> Plan {
    let mut knots: Vec<PlanKnot> = Vec::with_capacity(plan.knots.len());
    let mut next = 0;
    for fair in pieces {
        let (piece, stations) = (&fair.piece, fair.stations());
        if stations.is_empty() {
            continue;
        }
        knots.extend(&plan.knots[next..piece.first]);
        knots.extend(stations.iter().map(|s| PlanKnot {
            time_ns: 0,
            q: s.q,
            line: Some(s.pose.translation.vector.into()),
            patch: s.patch,
            ..PlanKnot::free(s.q)
        }));
        next = piece.last + 1;
    }
    knots.extend(&plan.knots[next..]);
    Plan { knots, ..plan.clone() }
}
