//! A contact piece and what has become of it.

use nalgebra::Point3;
use nullsweep_robot::Tool;

use super::averaged::Averaged;
use super::bend::Bend;
use super::follow::{Followed, Station, follow};
use super::guard::{Guard, missed_by};
use super::piece::Piece;
use super::relax::{LEAST_ROOM, Relaxation};
use super::window::Windows;
use crate::timing::Limits;
use crate::workcell::{Bed, Workcell};

/// Rounds of narrowing windows where a piece cannot be followed.
const ROUNDS: usize = 40;
/// Farther from the pad's centre, and than twice its reach, a point is none of its. \[m\]
const FAR: f64 = 0.15;

/// A piece and what has become of it.
pub(super) struct Fair {
    pub(super) piece: Piece,
    windows: Windows,
    /// Averaged. `None`: to be made; without stations: as it was.
    averaged: Option<Vec<Station>>,
    /// What it is averaged to, if that goes.
    straight: Option<Averaged>,
    /// How it is bent.
    bend: Bend,
    bent: Bent,
    /// What the pad must come over.
    guards: Vec<Guard>,
}

/// What a piece is bent to.
enum Bent {
    /// It is to be made, as what it depends on has changed.
    Not,
    /// It goes so, but is not free everywhere.
    Stuck(Vec<Station>),
    /// It is free; without stations as it was averaged.
    Free(Vec<Station>),
}

impl Bent {
    fn stations(&self) -> &[Station] {
        match self {
            Self::Not => &[],
            Self::Stuck(stations) | Self::Free(stations) => stations,
        }
    }
}

impl Fair {
    pub(super) fn new(piece: Piece) -> Self {
        let (windows, bend) = (Windows::new(piece.length()), Bend::none(piece.length()));
        let (straight, bent, guards) = (None, Bent::Not, Vec::new());
        Self { piece, windows, averaged: None, straight, bend, bent, guards }
    }

    /// What takes the piece's place; nothing where it stays as it was.
    pub(super) fn stations(&self) -> &[Station] {
        let averaged = self.averaged.as_deref().unwrap_or_default();
        [self.bent.stations(), averaged]
            .into_iter()
            .find(|made| !made.is_empty())
            .unwrap_or_default()
    }

    /// Follows the averaged piece, with windows as wide as it goes.
    pub(super) fn average(&mut self, cell: Workcell<'_>, bed: &Bed) {
        if self.averaged.is_some() {
            return;
        }
        for _ in 0..ROUNDS {
            let averaged = Averaged::new(&self.piece, &self.windows);
            let Followed { stations, stuck } =
                follow(&self.piece, &averaged.bent(&self.bend, bed), cell);
            if stuck.is_empty() {
                (self.averaged, self.straight) = (Some(stations), Some(averaged));
                return;
            }
            if !self.windows.narrow(&stuck) {
                break;
            }
        }
        (self.averaged, self.straight) = (Some(Vec::new()), None);
    }

    /// Bends the averaged piece so that it takes less time, where it is to be made or was not free;
    /// whether it is free now. Where it is not its room is narrowed.
    pub(super) fn relax(&mut self, cell: Workcell<'_>, bed: &Bed, limits: &Limits) -> bool {
        if matches!(self.bent, Bent::Free(_)) {
            return true;
        }
        let Some((bend, Followed { stations, stuck })) = self.relaxed(cell, bed, limits) else {
            self.bent = Bent::Free(Vec::new());
            return true;
        };
        self.bend = bend;
        self.bent = if stuck.is_empty() {
            Bent::Free(stations)
        } else if self.narrow(|windows| windows.narrow_room(&stuck)) {
            Bent::Stuck(stations)
        } else {
            Bent::Free(Vec::new())
        };
        matches!(self.bent, Bent::Free(_))
    }

    /// A bend by which the piece takes less time, and what came of following it; `None` where none is
    /// worth it.
    fn relaxed(&self, cell: Workcell<'_>, bed: &Bed, limits: &Limits) -> Option<(Bend, Followed)> {
        let Self { piece, windows, straight, guards, .. } = self;
        let averaged = straight.as_ref().filter(|_| !self.bend.controls.is_empty())?;
        let relaxation = Relaxation { averaged, windows, cell, bed, limits, guards };
        let straight = || Bend::none(piece.length());
        let way = relaxation
            .relaxed(self.bend.clone())
            .or_else(|| relaxation.relaxed(straight()))
            .filter(|way| {
                relaxation.way(straight()).is_none_or(|plain| way.time() < plain.time())
            })?;
        let followed = follow(piece, &way.nodes, cell);
        Some((way.bend, followed))
    }

    /// Narrows the room of the bend, which becomes less with it; whether there was any.
    fn narrow(&mut self, narrow: impl FnOnce(&mut Windows) -> bool) -> bool {
        let rooms = |windows: &Windows, bend: &Bend| -> Vec<[f64; 2]> {
            (0..bend.controls.len()).map(|k| windows.room(bend.middle(k))).collect()
        };
        let before = rooms(&self.windows, &self.bend);
        let narrowed = narrow(&mut self.windows);
        let after = rooms(&self.windows, &self.bend);
        for (control, (before, after)) in before.iter().zip(&after).enumerate() {
            let share = |k: usize| if after[k] < LEAST_ROOM { 0.0 } else { after[k] / before[k] };
            self.bend.shrink(control, [share(0), share(1)]);
        }
        narrowed
    }

    /// Narrows the pad's windows, down to a share of the widest, wherever the piece as it was came near
    /// to what is swept no more; whether there was anything to narrow.
    pub(super) fn give_back(&mut self, lost: &[Point3<f64>], reach: f64, narrowest: f64) -> bool {
        let places = self.near(lost, reach);
        if self.averaged.as_ref().is_some_and(Vec::is_empty) || places.is_empty() {
            return false;
        }
        if self.windows.narrow_pad(&places, narrowest) {
            self.averaged = None;
        } else if narrowest == 0.0 {
            self.averaged = Some(Vec::new());
        } else {
            return false;
        }
        true
    }

    /// By how much the bent piece misses a point, and where it comes nearest to it; `None` where it is
    /// bent nowhere near. \[m\]
    pub(super) fn miss(&self, point: &Point3<f64>, tool: &Tool) -> Option<(f64, f64)> {
        let far = FAR.max(2.0 * tool.outer_radius());
        let near = |s: &&Station| (s.pose.translation.vector - point.coords).norm() < far;
        let is_bent = |s: &&Station| self.windows.room(s.u)[0] >= LEAST_ROOM;
        let misses = self
            .bent
            .stations()
            .iter()
            .filter(near)
            .filter(is_bent)
            .map(|s| (missed_by(point, &s.pose, tool), s.u));
        misses.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Has the pad come over a point at a place of the piece.
    pub(super) fn guard(&mut self, point: Point3<f64>, u: f64) {
        self.guards.push(Guard { u, point });
        self.bent = Bent::Not;
    }

    /// Narrows the room of the bend in the same way; where there is none left, the piece is bent no more.
    pub(super) fn give_room_back(&mut self, lost: &[Point3<f64>], reach: f64) -> bool {
        let places = self.near(lost, reach);
        if self.bent.stations().is_empty() || places.is_empty() {
            return false;
        }
        let narrowed = self.narrow(|windows| windows.narrow_pads_room(&places));
        self.bent = if narrowed { Bent::Not } else { Bent::Free(Vec::new()) };
        true
    }

    /// Where along the piece as it was it came near to some points. \[m\]
    fn near(&self, lost: &[Point3<f64>], reach: f64) -> Vec<f64> {
        let mut places: Vec<f64> =
            lost.iter().filter_map(|point| self.piece.nearest(point, reach)).collect();
        places.sort_by(f64::total_cmp);
        places.dedup_by(|b, a| *b - *a < 0.005);
        places
    }
}
