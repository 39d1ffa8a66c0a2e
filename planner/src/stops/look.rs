//! An exact look at a place: whether the robot can stand there, and what its arms reach among all that
//! is there.

use nullsweep_collision::{ToolContact, World};
use nullsweep_robot::Robot;
use nullsweep_surface::Patch;

use super::error::StopsError;
use super::setup::{Limb, Setup};
use crate::workcell::{Scene, Stance, Workcell, reach};

/// Where something is looked at: scene and patches in the floor frame.
pub(super) struct Ground<'a> {
    pub(super) robot: &'a Robot,
    pub(super) setup: &'a Setup,
    pub(super) limbs: &'a [Limb],
    pub(super) scene: &'a Scene,
    pub(super) patches: &'a [Patch],
    /// See [`Setup::around`]. \[m\]
    pub(super) around: f64,
}

impl Ground<'_> {
    /// For each arm the patches that it is long enough for.
    pub(super) fn near(&self, stance: &Stance) -> Result<Vec<Vec<u32>>, StopsError> {
        let to_root = stance.pose().inverse();
        let of = |limb: &Limb| {
            let pivot = self.setup.pivot(self.robot, &stance.bind(&limb.arm)?);
            let apart =
                |patch: &u32| (to_root * self.patches[*patch as usize].centre - pivot).norm();
            Ok((0..self.patches.len() as u32).filter(|p| apart(p) <= limb.reach).collect())
        };
        self.limbs.iter().map(of).collect()
    }

    /// For each arm which of some patches it reaches; `None` where the robot cannot stand there with its
    /// arms tucked.
    pub(super) fn look(
        &self,
        stance: &Stance,
        of: &[Vec<u32>],
    ) -> Result<Option<Vec<Vec<u32>>>, StopsError> {
        let Self { robot, setup, limbs, scene, patches, around } = *self;
        let [x, y, _] = stance.base;
        let to_root = stance.pose().inverse();
        let here = scene.near([x, y], around).0.transformed(&to_root);
        let mut found = Vec::new();
        for (limb, of) in limbs.iter().zip(of) {
            let arm = stance.bind(&limb.arm)?;
            let (tool, options) = (&setup.job.tool, &setup.job.collision);
            let world = World::new(robot, &arm, tool, here.points(), &here.obstacles, options)?;
            let tucked = limb.tucked;
            let is_tucked =
                arm.within_margins(&tucked) && world.is_free(&tucked, ToolContact::Forbidden);
            if !is_tucked || world.stance_hit().is_some() {
                return Ok(None);
            }
            let cell = Workcell { arm: &arm, tool, world: &world };
            let looked: Vec<Patch> =
                of.iter().map(|&p| patches[p as usize].transformed(&to_root)).collect();
            let reached = reach(cell, &looked, REDUNDANCIES, &|| ());
            let reached = of.iter().zip(reached).filter(|(_, r)| r.is_some()).map(|(p, _)| *p);
            found.push(reached.collect());
        }
        Ok(Some(found))
    }
}

/// Redundancy values that are looked at.
const REDUNDANCIES: usize = 24;
