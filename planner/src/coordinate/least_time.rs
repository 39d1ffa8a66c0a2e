//! The shortest way through the coordination diagram.

use super::diagram::Diagram;

/// What moves in a step of the clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Move {
    Both,
    First,
    Second,
}

const MOVES: [Move; 3] = [Move::Both, Move::First, Move::Second];
/// The cost of a step of the clock.
const STEP: u32 = 1;
/// What beginning to wait costs besides, so that waits are few.
const BEGIN: u32 = 2;
/// No way leads there.
const NO_WAY: u32 = u32::MAX;

/// What an arm may do where: the diagram, and in which nodes each arm may wait.
pub(super) struct Room<'a> {
    pub(super) diagram: &'a Diagram<'a>,
    pub(super) may_wait: [&'a [bool]; 2],
}

/// The moves of least time from both starts to both ends; `None` where no way is free.
pub(super) fn least_time(room: &Room<'_>) -> Option<Vec<Move>> {
    let [rows, columns] = room.diagram.steps();
    // For each node the move before the last, by the last: two bits each.
    let mut came = vec![0u8; (rows + 1) * (columns + 1)];
    let mut above = vec![[NO_WAY; 3]; columns + 1];
    for row in 0..=rows {
        let mut costs = vec![[NO_WAY; 3]; columns + 1];
        for column in 0..=columns {
            if row == 0 && column == 0 {
                costs[0][0] = 0;
                continue;
            }
            for (m, &last) in MOVES.iter().enumerate() {
                let Some([from_row, from_column]) = room.before([row, column], last) else {
                    continue;
                };
                let from = if from_row == row { &costs } else { &above };
                let (before, cost) = cheapest(&from[from_column], room, last, [row, column]);
                if cost < NO_WAY {
                    costs[column][m] = cost;
                    came[row * (columns + 1) + column] |= (before as u8) << (2 * m);
                }
            }
        }
        above = costs;
    }
    let (mut last, cost) = least(&above[columns]);
    if cost == NO_WAY {
        return None;
    }
    let (mut at, mut moves) = ([rows, columns], Vec::new());
    while at != [0, 0] {
        let before = (came[at[0] * (columns + 1) + at[1]] >> (2 * last) & 3) as usize;
        moves.push(MOVES[last]);
        at = back(at, MOVES[last])?;
        last = before;
    }
    moves.reverse();
    Some(moves)
}

/// The first of the least.
fn least(costs: &[u32; 3]) -> (usize, u32) {
    let first = (0, costs[0]);
    (1..3)
        .map(|m| (m, costs[m]))
        .fold(first, |best, next| if next.1 < best.1 { next } else { best })
}

/// Which move before `last` is the cheapest, and what it costs with it.
fn cheapest(before: &[u32; 3], room: &Room<'_>, last: Move, to: [usize; 2]) -> (usize, u32) {
    let with = |m: usize| {
        let begins = last != Move::Both && MOVES[m] != last && !room.is_over(last, to);
        before[m].saturating_add(STEP + if begins { BEGIN } else { 0 })
    };
    least(&[with(0), with(1), with(2)])
}

/// The node before a move.
fn back([row, column]: [usize; 2], last: Move) -> Option<[usize; 2]> {
    Some(match last {
        Move::Both => [row.checked_sub(1)?, column.checked_sub(1)?],
        Move::First => [row.checked_sub(1)?, column],
        Move::Second => [row, column.checked_sub(1)?],
    })
}

impl Room<'_> {
    /// The node before a move, where it is allowed.
    fn before(&self, to: [usize; 2], last: Move) -> Option<[usize; 2]> {
        let from = back(to, last)?;
        let is_allowed = match last {
            Move::Both => self.diagram.is_free(from),
            Move::First => {
                self.may_wait[1][to[1]] && self.diagram.is_free_beside(0, from[0], to[1])
            }
            Move::Second => {
                self.may_wait[0][to[0]] && self.diagram.is_free_beside(1, from[1], to[0])
            }
        };
        is_allowed.then_some(from)
    }

    /// Whether who waits in a move has come to its end: that is no wait.
    fn is_over(&self, last: Move, to: [usize; 2]) -> bool {
        let steps = self.diagram.steps();
        match last {
            Move::Both => false,
            Move::First => to[1] == steps[1],
            Move::Second => to[0] == steps[0],
        }
    }
}
