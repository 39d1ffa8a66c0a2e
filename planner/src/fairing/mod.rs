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

mod bend;
mod fair;
mod follow;
mod guard;
mod piece;
mod relax;
mod window;

use nalgebra::Point3;
use nullsweep_robot::Tool;
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
/// Rounds of having the pad come over points that it would miss, before it is bent less.
const GUARDED: usize = 12;

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
    let aim = Aim::new(plan, cell, keep);
    let pieces = || Piece::all(plan, cell, bed).into_iter().map(Fair::new).collect::<Vec<_>>();
    let bent = |limits: &Limits, narrowest: f64| {
        let mut pieces = pieces();
        // What they sweep too little is for the bends to win back.
        let _ = aim.averaged(&mut pieces, bed, narrowest);
        aim.relaxed(&mut pieces, bed, limits)
    };
    limits
        .and_then(|limits| [GENTLE, 0.0].into_iter().find_map(|least| bent(limits, least)))
        .or_else(|| aim.averaged(&mut pieces(), bed, 0.0))
        .unwrap_or_else(|| plan.clone())
}

/// What is made fair, and what has to be swept.
struct Aim<'a> {
    plan: &'a Plan,
    cell: Workcell<'a>,
    keep: Keep<'a>,
    before: Vec<bool>,
    /// Of the points to sweep, and of all.
    least: [f64; 2],
}

impl<'a> Aim<'a> {
    fn new(plan: &'a Plan, cell: Workcell<'a>, keep: Keep<'a>) -> Self {
        let before = keep.swept(plan, cell);
        let (own, whole) = (keep.count(&before), keep.count(&vec![true; keep.points.len()]));
        let least = std::array::from_fn(|i| own[i] - LOSS * whole[i]);
        Self { plan, cell, keep, before, least }
    }

    /// How many points are wanted of those that are swept.
    fn wanted(&self, swept: &[bool]) -> usize {
        let counts = self.keep.count(swept);
        (0..2).map(|i| (self.least[i] - counts[i]).max(0.0).ceil() as usize).sum()
    }

    /// How far from the pad's centre it sweeps. \[m\]
    fn reach(&self) -> f64 {
        self.cell.tool.outer_radius()
    }

    /// With averaged pieces, the pad's windows narrowed for what is swept down to a share of the widest;
    /// `None` where too little is swept even so.
    fn averaged(&self, pieces: &mut [Fair], bed: &Bed, narrowest: f64) -> Option<Plan> {
        let mut least = narrowest.max(GENTLE);
        loop {
            pieces.par_iter_mut().for_each(|piece| piece.average(self.cell, bed));
            let made = assembled(self.plan, pieces);
            let after = self.keep.swept(&made, self.cell);
            if self.wanted(&after) == 0 {
                return Some(made);
            }
            let lost = self.keep.lost(&self.before, &after);
            let given = pieces.iter_mut().map(|fair| fair.give_back(&lost, self.reach(), least));
            if given.filter(|given| *given).count() == 0 {
                if least <= narrowest {
                    // What is lost is near none of them, or they are not to be narrowed any more.
                    return None;
                }
                least = narrowest;
            }
        }
    }

    /// With averaged pieces that are bent so as to take less time; `None` where too little is swept even
    /// so.
    fn relaxed(&self, pieces: &mut [Fair], bed: &Bed, limits: &Limits) -> Option<Plan> {
        for round in 0.. {
            pieces.par_iter_mut().for_each(|piece| piece.relax(self.cell, bed, limits));
            let made = assembled(self.plan, pieces);
            let after = self.keep.swept(&made, self.cell);
            let wanted = self.wanted(&after);
            if wanted == 0 {
                return Some(made);
            }
            let lost = self.keep.lost(&self.before, &after);
            if round < GUARDED && guard(pieces, &lost, wanted, self.cell.tool) {
                continue;
            }
            let given = pieces.iter_mut().map(|fair| fair.give_room_back(&lost, self.reach()));
            if given.filter(|given| *given).count() == 0 {
                return None;
            }
        }
        None
    }
}

/// Has the pieces come over some more of the points that are lost, those first that are missed by least;
/// whether there are any.
fn guard(pieces: &mut [Fair], lost: &[Point3<f64>], wanted: usize, tool: &Tool) -> bool {
    let nearest = |point: &Point3<f64>| {
        let misses = pieces.iter().enumerate().filter_map(|(k, f)| Some((k, f.miss(point, tool)?)));
        let least = misses.min_by(|a, b| a.1.0.total_cmp(&b.1.0));
        least.map(|(piece, (miss, u))| (miss, piece, u, *point))
    };
    let mut all: Vec<_> = lost.par_iter().filter_map(nearest).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all.truncate(wanted + wanted / 2 + 1);
    for &(_, piece, u, point) in &all {
        pieces[piece].guard(point, u);
    }
    !all.is_empty()
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
