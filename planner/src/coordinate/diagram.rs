//! The coordination diagram: where the plane of both plans' times is free.

use nullsweep_collision::{Arms, Span};
use rayon::prelude::*;

use super::clock::{Clocked, Hull};

/// A step is halved so often before what is not proven counts as taken.
const HALVINGS: usize = 2;
/// A tile, which is looked at as one first, is so many steps wide.
const TILE: usize = 32;

/// Which cells of the plane of both times are free, a step of each arm wide.
pub(super) struct Diagram<'a> {
    arms: &'a Arms<'a>,
    sides: [Side; 2],
    free: Vec<bool>,
}

/// One arm's times: what it does in ever longer parts of them.
struct Side {
    /// From parts of a step up to a tile, each part twice as long as one of the level below.
    levels: Vec<Vec<Span>>,
    /// Where it is in each node.
    nodes: Vec<Span>,
}

impl Side {
    fn new(arms: &Arms<'_>, arm: usize, clocked: &Clocked) -> Self {
        let span = |hull: &Hull| arms.span(arm, &hull.middle(), &hull.travel());
        let (steps, parts) = (clocked.steps() as u64, 1 << HALVINGS);
        let part_ns = clocked.step_ns / parts;
        let mut hulls: Vec<Hull> = (0..steps * parts)
            .into_par_iter()
            .map(|part| clocked.hull(part * part_ns, (part + 1) * part_ns))
            .collect();
        let mut levels = Vec::new();
        for _ in 0..=HALVINGS + TILE.ilog2() as usize {
            levels.push(hulls.par_iter().map(span).collect());
            let both = |two: &[Hull]| two.iter().fold(two[0], |all, one| all.with(one));
            hulls = hulls.chunks(2).map(both).collect();
        }
        let at = |node: u64| span(&clocked.hull(node * clocked.step_ns, node * clocked.step_ns));
        Self { levels, nodes: (0..=steps).map(at).collect() }
    }

    fn steps(&self) -> usize {
        self.nodes.len() - 1
    }
}

impl<'a> Diagram<'a> {
    pub(super) fn new(arms: &'a Arms<'a>, clocked: [&Clocked; 2]) -> Self {
        let sides = [0, 1].map(|arm| Side::new(arms, arm, clocked[arm]));
        let mut diagram = Self { arms, sides, free: Vec::new() };
        let [rows, columns] = diagram.steps();
        let (tiles, across) = (rows.div_ceil(TILE), columns.div_ceil(TILE));
        let level = HALVINGS + TILE.ilog2() as usize;
        let found: Vec<Vec<[usize; 2]>> = (0..tiles * across)
            .into_par_iter()
            .map(|tile| {
                let mut free = Vec::new();
                diagram.look(level, [tile / across, tile % across], &mut free);
                free
            })
            .collect();
        diagram.free = vec![false; rows * columns];
        for [row, column] in found.into_iter().flatten() {
            diagram.free[row * columns + column] = true;
        }
        diagram
    }

    /// Steps of each arm.
    pub(super) fn steps(&self) -> [usize; 2] {
        [self.sides[0].steps(), self.sides[1].steps()]
    }

    /// Whether both may go through these steps at once, however each does.
    pub(super) fn is_free(&self, [row, column]: [usize; 2]) -> bool {
        self.free[row * self.steps()[1] + column]
    }

    /// Whether one arm may go through a step while the other stands in a node.
    pub(super) fn is_free_beside(&self, moving: usize, step: usize, node: usize) -> bool {
        let cell = |other: usize| if moving == 0 { [step, other] } else { [other, step] };
        let [before, after] = [node.checked_sub(1), Some(node)];
        let near = [before, after.filter(|&after| after < self.sides[1 - moving].steps())];
        near.into_iter().flatten().any(|other| self.is_free(cell(other)))
            || self.beside(moving, HALVINGS, step, &self.sides[1 - moving].nodes[node])
    }

    fn beside(&self, moving: usize, level: usize, part: usize, stands: &Span) -> bool {
        let moves = &self.sides[moving].levels[level][part];
        let [one, other] = if moving == 0 { [moves, stands] } else { [stands, moves] };
        if self.arms.are_apart(one, other) {
            return true;
        }
        level > 0
            && self.arms.are_apart_in_the_middle(one, other)
            && (0..2).all(|half| self.beside(moving, level - 1, 2 * part + half, stands))
    }

    /// Collects the free cells of a part of the plane, by the parts of both times.
    fn look(&self, level: usize, part: [usize; 2], free: &mut Vec<[usize; 2]>) {
        let Some([one, other]) = self.spans(level, part) else { return };
        if self.arms.are_apart(one, other) {
            let wide = 1 << (level - HALVINGS);
            let [rows, columns] = self.steps();
            let of = |part: usize, most: usize| part * wide..((part + 1) * wide).min(most);
            for row in of(part[0], rows) {
                free.extend(of(part[1], columns).map(|column| [row, column]));
            }
        } else if level > HALVINGS {
            quarters(part).for_each(|part| self.look(level - 1, part, free));
        } else if self.is_proven(level, part) {
            free.push(part);
        }
    }

    fn is_proven(&self, level: usize, part: [usize; 2]) -> bool {
        let Some([one, other]) = self.spans(level, part) else { return true };
        if self.arms.are_apart(one, other) {
            return true;
        }
        level > 0
            && self.arms.are_apart_in_the_middle(one, other)
            && quarters(part).all(|part| self.is_proven(level - 1, part))
    }

    fn spans(&self, level: usize, part: [usize; 2]) -> Option<[&Span; 2]> {
        let [one, other] = [0, 1].map(|arm| self.sides[arm].levels[level].get(part[arm]));
        Some([one?, other?])
    }
}

/// The parts of the level below.
fn quarters([row, column]: [usize; 2]) -> impl Iterator<Item = [usize; 2]> {
    (0..4).map(move |quarter| [2 * row + quarter / 2, 2 * column + quarter % 2])
}
