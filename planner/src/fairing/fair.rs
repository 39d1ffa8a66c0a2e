//! A contact piece and what has become of it.

use nalgebra::Point3;
use nullsweep_robot::Tool;

use super::bend::Bend;
use super::follow::{Station, follow};
use super::guard::{Guard, missed_by};
use super::piece::Piece;
use super::relax::Relaxation;
use super::window::Windows;
use crate::timing::Limits;
use crate::workcell::{Bed, Workcell};

/// Rounds of narrowing windows, or the room of a bend, where a piece cannot be followed.
const ROUNDS: usize = 40;
/// Farther from the pad's centre, and than twice its reach, a point is none of its. \[m\]
const FAR: f64 = 0.15;

/// A piece and what has become of it.
pub(super) struct Fair {
    pub(super) piece: Piece,
    windows: Windows,
    /// Averaged. `None`: to be made; without stations: as it was.
    averaged: Option<Vec<Station>>,
    /// How it is bent.
    bend: Bend,
    /// Bent. `None`: to be made; without stations: as it was averaged.
    bent: Option<Vec<Station>>,
    /// What the pad must come over.
    guards: Vec<Guard>,
}

impl Fair {
    pub(super) fn new(piece: Piece) -> Self {
        let (windows, bend) = (Windows::new(piece.length()), Bend::none(piece.length()));
        Self { piece, windows, averaged: None, bend, bent: None, guards: Vec::new() }
    }

    /// What takes the piece's place; nothing where it stays as it was.
    pub(super) fn stations(&self) -> &[Station] {
        let made = [&self.bent, &self.averaged].into_iter().flatten();
        made.map(Vec::as_slice).find(|made| !made.is_empty()).unwrap_or_default()
    }

    /// Follows the averaged piece, with windows as wide as it goes.
    pub(super) fn average(&mut self, cell: Workcell<'_>, bed: &Bed) {
        if self.averaged.is_some() {
            return;
        }
        for _ in 0..ROUNDS {
            match follow(&self.piece, &self.windows, &self.bend, cell, bed) {
                Ok(stations) => {
                    self.averaged = Some(stations);
                    return;
                }
                Err(places) => {
                    if !self.windows.narrow(&places) {
                        break;
                    }
                }
            }
        }
        self.averaged = Some(Vec::new());
    }

    /// Bends the averaged piece so that it takes less time, where it goes.
    pub(super) fn relax(&mut self, cell: Workcell<'_>, bed: &Bed, limits: &Limits) {
        if self.bent.is_some() {
            return;
        }
        self.bent = Some(Vec::new());
        if self.averaged.as_ref().is_none_or(Vec::is_empty) || self.bend.controls.is_empty() {
            return;
        }
        for _ in 0..ROUNDS {
            let Self { piece, windows, guards, .. } = &*self;
            let relaxation = Relaxation { piece, windows, cell, bed, limits, guards };
            let straight = Bend::none(self.piece.length());
            let relaxed = relaxation.relaxed(self.bend.clone());
            let Some((bend, won)) = relaxed.or_else(|| relaxation.relaxed(straight)) else {
                return;
            };
            if won <= 0.0 {
                return;
            }
            self.bend = bend;
            match follow(&self.piece, &self.windows, &self.bend, cell, bed) {
                Ok(stations) => {
                    self.bent = Some(stations);
                    return;
                }
                Err(places) => {
                    if !self.windows.narrow_room(&places) {
                        return;
                    }
                }
            }
        }
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
    /// not bent. \[m\]
    pub(super) fn miss(&self, point: &Point3<f64>, tool: &Tool) -> Option<(f64, f64)> {
        let bent = self.bent.as_ref()?.iter();
        let far = FAR.max(2.0 * tool.outer_radius());
        let near = |s: &&Station| (s.pose.translation.vector - point.coords).norm() < far;
        let misses = bent.filter(near).map(|s| (missed_by(point, &s.pose, tool), s.u));
        misses.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Has the pad come over a point at a place of the piece.
    pub(super) fn guard(&mut self, point: Point3<f64>, u: f64) {
        self.guards.push(Guard { u, point });
        self.bent = None;
    }

    /// Narrows the room of the bend in the same way; where there is none left, the piece is bent no more.
    pub(super) fn give_room_back(&mut self, lost: &[Point3<f64>], reach: f64) -> bool {
        let places = self.near(lost, reach);
        if self.bent.as_ref().is_none_or(Vec::is_empty) || places.is_empty() {
            return false;
        }
        let narrowed = self.windows.narrow_room(&places);
        self.bent = if narrowed { None } else { Some(Vec::new()) };
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
