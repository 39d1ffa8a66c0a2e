//! Runs along given poses, joined through free space.

use nullsweep_robot::JointVector;

use super::assemble::{Piece, Stop};
use crate::motion::{Hub, back_away, jump, reconfigure};
use crate::workcell::Workcell;

/// Seeds by which a way through free space is looked for.
const TRIES: u64 = 4;
/// Runs that are tried next from one place.
const NEXT: usize = 8;
/// Places of a run that are tried for leaving it, or for coming to it.
const PLACES: usize = 40;

/// Runs in an order that the arm can go through.
pub(crate) struct Chain {
    pub(crate) pieces: Vec<Piece>,
    /// The runs that no way leads to, by their index.
    pub(crate) left_out: Vec<usize>,
}

/// Whether runs may change their order, and be gone through backwards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Order {
    Kept,
    Free,
}

/// Joins the runs, none of them empty, by ways that lift the tool off, lead through free space and set
/// it down again, beginning at `start` where that is said. What cannot be come to is left out; with a
/// free order it is tried again from other places.
pub(crate) fn chain(
    cell: Workcell<'_>,
    runs: &[Vec<Stop>],
    start: Option<&JointVector>,
    order: Order,
    seed: u64,
) -> Chain {
    let mut chain = Chain { pieces: Vec::new(), left_out: Vec::new() };
    let mut open: Vec<usize> = (0..runs.len()).collect();
    let mut at = start.copied();
    let hub = Hub::of(cell, start);
    while !open.is_empty() {
        let next = match order {
            Order::Kept => 1,
            Order::Free => NEXT,
        };
        let found = open.iter().take(next).enumerate().find_map(|(k, &run)| {
            let backwards: &[bool] = if order == Order::Free { &[false, true] } else { &[false] };
            let joined = |&back: &bool| {
                let mut stops = runs[run].clone();
                if back {
                    stops.reverse();
                }
                join((cell, hub.as_ref()), &chain.pieces, at.as_ref(), stops, seed)
            };
            backwards.iter().find_map(joined).map(|joined| (k, joined))
        });
        match found {
            Some((k, joined)) => {
                open.remove(k);
                joined.put(&mut chain.pieces);
                at = match chain.pieces.last() {
                    Some(Piece::Along(stops)) => stops.last().map(|stop| stop.point.q),
                    _ => at,
                };
            }
            None if order == Order::Kept => chain.left_out.push(open.remove(0)),
            None => chain.left_out.append(&mut open),
        }
    }
    chain.left_out.sort_unstable();
    chain
}

/// A run with the way to it.
struct Joined {
    /// Back along the last run to where the tool comes off.
    back: Vec<Stop>,
    way: Option<Vec<JointVector>>,
    stops: Vec<Stop>,
}

impl Joined {
    fn put(self, pieces: &mut Vec<Piece>) {
        if let Some(Piece::Along(last)) = pieces.last_mut() {
            last.extend(self.back);
        }
        pieces.extend(self.way.map(Piece::Through));
        pieces.push(Piece::Along(self.stops));
    }
}

/// The way from the end of the last piece, or from the start, to a run.
fn join(
    (cell, hub): (Workcell<'_>, Option<&Hub>),
    pieces: &[Piece],
    at: Option<&JointVector>,
    stops: Vec<Stop>,
    seed: u64,
) -> Option<Joined> {
    let Some(at) = at else { return Some(Joined { back: Vec::new(), way: None, stops }) };
    let (entry, _) = lifts(cell, stops.iter())?;
    // Where the tool cannot come down at the run's beginning, it goes there along the run.
    let goal = stops[entry].point.q;
    let ahead = stops[1..=entry].iter().rev().map(unmet);
    let stops: Vec<Stop> = ahead.chain(stops.iter().copied()).collect();
    let Some(Piece::Along(last)) = pieces.last() else {
        let way = (0..TRIES).find_map(|k| jump(cell, at, &goal, seed.wrapping_add(k)));
        let way = way.or_else(|| by_hub(cell, hub?, at, &goal, seed))?;
        return Some(Joined { back: Vec::new(), way: Some(way), stops });
    };
    let (exit, from) = lifts(cell, last.iter().rev())?;
    let way = (0..TRIES).find_map(|k| reconfigure(cell, &from, &goal, seed.wrapping_add(k)));
    let way = way.or_else(|| by_hub(cell, hub?, &from, &goal, seed))?;
    let back = last.iter().rev().skip(1).take(exit).map(unmet).collect();
    Some(Joined { back, way: Some(way), stops })
}

/// The way by way of a hub.
fn by_hub(
    cell: Workcell<'_>,
    hub: &Hub,
    from: &JointVector,
    to: &JointVector,
    seed: u64,
) -> Option<Vec<JointVector>> {
    let [from, to] = [hub.spoke(cell, from, seed)?, hub.spoke(cell, to, seed)?];
    Some(from.to(&to, cell, seed))
}

/// The first of the stops where the tool comes off: how many are before it, and its joint vector.
fn lifts<'a>(
    cell: Workcell<'_>,
    stops: impl Iterator<Item = &'a Stop>,
) -> Option<(usize, JointVector)> {
    let mut places = stops.map(|stop| stop.point.q).enumerate().take(PLACES);
    places.find(|(_, q)| back_away(cell, q).is_some())
}

/// The same place, gone through once more.
fn unmet(stop: &Stop) -> Stop {
    Stop { pose: None, ..*stop }
}
