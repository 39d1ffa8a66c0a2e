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

mod follow;
mod piece;
mod window;

use rayon::prelude::*;

use self::follow::{Station, follow};
use self::piece::Piece;
use self::window::Windows;
use crate::plan::{Plan, PlanKnot};
use crate::sweep::{Sight, coverage};
use crate::workcell::{Bed, Workcell};

/// Share of the points to sweep that a fair way may leave out of what the way as it was sweeps.
const LOSS: f64 = 0.003;
/// Share of the widest windows down to which they are narrowed first, for the sake of what is swept:
/// a scan's unevenness is averaged by narrow ones too, and corners are hardly cut.
const GENTLE: f64 = 0.25;
/// Rounds of narrowing windows where a piece cannot be followed, and where it sweeps too little.
const ROUNDS: usize = 40;

/// What is to be swept.
#[derive(Clone, Copy)]
pub struct Keep<'a> {
    /// The scanned points, in the root frame.
    pub sight: Sight<'a>,
    /// Which of them count.
    pub points: &'a [bool],
    /// What the tool goes at: a nozzle lays on by it. \[m/s\]
    pub speed: f64,
}

/// The plan (which must be of bang-bang velocity) with fair contact pieces, proven free of
/// collision; its times are to be set anew. Where a piece cannot be made fair it is as it was.
#[must_use]
pub fn fair(plan: &Plan, cell: Workcell<'_>, bed: &Bed, keep: Keep<'_>) -> Plan {
    let mut pieces: Vec<Fair> = Piece::all(plan, cell, bed).into_iter().map(Fair::new).collect();
    let swept =
        |plan: &Plan| coverage::done_by(keep.sight, plan.trajectory(), cell.arm, keep.speed);
    // Of the points to sweep, and of all.
    let count = |swept: &[bool]| {
        let counts = swept.iter().zip(keep.points).filter(|(swept, counts)| **swept && **counts);
        [counts.count(), swept.iter().filter(|s| **s).count()].map(|count| count as f64)
    };
    let before = swept(plan);
    let whole = count(&vec![true; keep.points.len()]);
    let least: [f64; 2] = std::array::from_fn(|i| count(&before)[i] - LOSS * whole[i]);
    let mut narrowest = GENTLE;
    loop {
        pieces.par_iter_mut().for_each(|piece| piece.make(cell, bed));
        let made = assembled(plan, &pieces);
        let after = swept(&made);
        if count(&after).iter().zip(least).all(|(count, least)| *count >= least) {
            return made;
        }
        let lost = (0..after.len()).filter(|&i| before[i] && !after[i]);
        let lost: Vec<_> = lost.map(|i| keep.sight.scan.points[i]).collect();
        let reach = cell.tool.outer_radius();
        let given = pieces.iter_mut().map(|fair| fair.give_back(&lost, reach, narrowest));
        if given.filter(|given| *given).count() == 0 {
            if narrowest == 0.0 {
                // What is lost is near none of them: who knows why, so all is as it was.
                return plan.clone();
            }
            narrowest = 0.0;
        }
    }
}

/// A piece and what has become of it.
struct Fair {
    piece: Piece,
    windows: Windows,
    /// `None`: to be made; without stations: as it was.
    made: Option<Vec<Station>>,
}

impl Fair {
    fn new(piece: Piece) -> Self {
        let windows = Windows::new(piece.length());
        Self { piece, windows, made: None }
    }

    /// Follows the piece, with windows as wide as it goes.
    fn make(&mut self, cell: Workcell<'_>, bed: &Bed) {
        if self.made.is_some() {
            return;
        }
        for _ in 0..ROUNDS {
            match follow(&self.piece, &self.windows, cell, bed) {
                Ok(stations) => {
                    self.made = Some(stations);
                    return;
                }
                Err(places) => {
                    if !self.windows.narrow(&places) {
                        break;
                    }
                }
            }
        }
        self.made = Some(Vec::new());
    }

    /// Narrows the pad's windows, down to a share of the widest, wherever the piece as it was came near
    /// to what is swept no more; whether there was anything to narrow.
    fn give_back(&mut self, lost: &[nalgebra::Point3<f64>], reach: f64, narrowest: f64) -> bool {
        let mut places: Vec<f64> =
            lost.iter().filter_map(|point| self.piece.nearest(point, reach)).collect();
        places.sort_by(f64::total_cmp);
        places.dedup_by(|b, a| *b - *a < 0.005);
        if self.made.as_ref().is_some_and(Vec::is_empty) || places.is_empty() {
            return false;
        }
        if self.windows.narrow_pad(&places, narrowest) {
            self.made = None;
        } else if narrowest == 0.0 {
            self.made = Some(Vec::new());
        } else {
            return false;
        }
        true
    }
}

/// The plan with the pieces in their places.
fn assembled(plan: &Plan, pieces: &[Fair]) -> Plan {
    let mut knots: Vec<PlanKnot> = Vec::with_capacity(plan.knots.len());
    let mut next = 0;
    for Fair { piece, made, .. } in pieces {
        let Some(stations) = made.as_ref().filter(|made| !made.is_empty()) else { continue };
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
