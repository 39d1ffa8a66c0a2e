//! A free posture by way of which others are come to, where no way straight from one to the other is
//! found: what is not joined to it is shut in, whatever it is to be joined to.

use nullsweep_collision::ToolContact;
use nullsweep_robot::JointVector;

use super::jump::back_away;
use super::rrt_connect::{Options, rrt_connect, shortened};
use crate::workcell::{Workcell, nearest_free};

/// Seeds by which a way to it is looked for, and samples of each.
const SEEDS: u64 = 3;
const SAMPLES: usize = 600;

/// A free posture.
#[derive(Clone, Copy, Debug)]
pub struct Hub(JointVector);

/// The way from a posture to a hub.
#[derive(Clone, Debug)]
pub struct Spoke {
    /// Off the surface.
    up: Vec<JointVector>,
    /// From there to the hub, but for whole turns of continuous joints.
    across: Vec<JointVector>,
}

impl Hub {
    /// Where the arm starts, if it is free there, else the free posture that is nearest to home.
    #[must_use]
    pub fn of(cell: Workcell<'_>, start: Option<&JointVector>) -> Option<Self> {
        let free = |q: &&JointVector| cell.world.is_free(q, ToolContact::Forbidden);
        let near_home = || nearest_free(cell.arm, cell.world, &cell.arm.home());
        start.filter(free).copied().or_else(near_home).map(Self)
    }

    /// The way from a contact, or a free posture, to the hub; `None` where none is found.
    #[must_use]
    pub fn spoke(&self, cell: Workcell<'_>, q: &JointVector, seed: u64) -> Option<Spoke> {
        if *q == self.0 {
            return Some(Spoke { up: vec![*q], across: vec![*q] });
        }
        let up = back_away(cell, q)?;
        let above = up.last()?;
        let options = Options { samples: SAMPLES, shortcuts: 0, ..Options::default() };
        let across = (0..SEEDS).find_map(|k| {
            rrt_connect(cell.world, cell.arm, above, &self.0, &options, seed.wrapping_add(k))
        })?;
        Some(Spoke { up, across })
    }
}

impl Spoke {
    /// The way from the posture of one spoke to that of another, by way of the hub, made shorter where
    /// that goes.
    #[must_use]
    pub fn to(&self, other: &Self, cell: Workcell<'_>, seed: u64) -> Vec<JointVector> {
        let ends = [&self.across, &other.across].map(|way| way[way.len() - 1]);
        // The way back turns with the end of the way there.
        let turns = ends[0] - ends[1];
        let turned = |way: &[JointVector]| -> Vec<JointVector> {
            way.iter().rev().skip(1).map(|q| *q + turns).collect()
        };
        let through = [self.across.clone(), turned(&other.across)].concat();
        let through = shortened(cell.world, through, &Options::default(), seed);
        [&self.up[..self.up.len() - 1], &through, &turned(&other.up)].concat()
    }
}
