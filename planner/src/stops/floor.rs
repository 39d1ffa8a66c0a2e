//! Places on the floor around the surface, and what each of them promises by inverse kinematics alone.

use std::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::{Isometry3, Point3, Vector3};
use nullsweep_robot::{Arm, ArmError, Robot, Solutions, Tool, wrap};
use nullsweep_surface::{Grid, Patch};
use rayon::prelude::*;

use super::setup::{Limb, Setup};
use crate::workcell::stance::{OUTLINE, body_boxes, in_the_way};
use crate::workcell::{Scene, Stance, contact_pose, direction, redundancies};

/// A place whose body is clear of what is there, and what may be reached from it.
pub(super) struct Place {
    pub(super) stance: Stance,
    /// Patches for which some arm has joint vectors within its limits, ascending; collisions are not
    /// looked at. Where two arms are to work at once those that both have them for count twice.
    pub(super) promised: Vec<u32>,
}

/// Step of the places on the floor. \[m\]
const STEP: f64 = 0.12;
/// Directions in which the robot may look; one for an arm that turns all round.
const YAWS: u32 = 16;
/// A first joint about the vertical with such a range makes up for any yaw. \[rad\]
const ALL_ROUND: f64 = 5.0;
/// Redundancy values by which a patch is judged, and how many of them must have a solution: one alone
/// hardly ever leads on to the next patch.
const REDUNDANCIES: usize = 8;
const ROBUST: usize = 2;

/// An arm at one position of the lift.
struct Raised {
    arm: Arm,
    pivot: Point3<f64>,
    reach: f64,
    values: Vec<f64>,
}

/// The robot at one position of the lift.
struct Figure {
    lift: Option<f64>,
    arms: Vec<Raised>,
    body: Vec<(Point3<f64>, Point3<f64>)>,
}

/// The places from which some arm may reach something, in a fixed order; scene and patches in the floor
/// frame.
pub(super) fn places(
    robot: &Robot,
    setup: &Setup,
    limbs: &[Limb],
    scene: &Scene,
    patches: &[Patch],
) -> Result<Vec<Place>, ArmError> {
    let figures = setup.heights().into_iter().map(|lift| figure(robot, setup, limbs, lift));
    let figures = figures.collect::<Result<Vec<_>, _>>()?;
    let centres: Vec<Point3<f64>> = patches.iter().map(|p| p.centre).collect();
    let contacts: Vec<[Isometry3<f64>; 2]> =
        patches.iter().map(|patch| contacts(patch, &setup.job.tool)).collect();
    let outline = scene.outline(OUTLINE);
    let flat = |p: &Point3<f64>| Point3::new(p.x, p.y, 0.0);
    let (flat_centres, flat_outline): (Vec<_>, Vec<_>) =
        (centres.iter().map(flat).collect(), outline.iter().map(flat).collect());
    let around = setup.around(robot, limbs);
    let (near, things) = (Grid::new(&flat_centres, 0.5 * around), Grid::new(&flat_outline, 0.5));
    let yaws = yaws(&figures);
    let found: Vec<Vec<Place>> = spots(&flat_centres, around)
        .par_iter()
        .map(|spot| {
            let (mut here, mut beside) = (Vec::new(), Vec::new());
            near.within(spot, around, |patch, _, _| here.push(patch));
            here.sort_unstable();
            if here.is_empty() {
                return Vec::new();
            }
            things.within(spot, around, |point, _, _| beside.push(outline[point as usize]));
            let mut places = Vec::new();
            for figure in &figures {
                for yaw in &yaws {
                    let stance = setup.stance([spot.x, spot.y, *yaw], figure.lift);
                    if in_the_way(&stance, &figure.body, &beside) {
                        continue;
                    }
                    let from_floor = stance.pose().inverse();
                    let promise =
                        |arm: &Raised| promised(arm, &here, &centres, &contacts, &from_floor);
                    let promised: Vec<Vec<u32>> = figure.arms.iter().map(promise).collect();
                    let promised = if setup.together { sum(&promised) } else { union(&promised) };
                    if !promised.is_empty() {
                        places.push(Place { stance, promised });
                    }
                }
            }
            places
        })
        .collect();
    Ok(found.into_iter().flatten().collect())
}

/// All that is in the lists, ascending.
fn sum(lists: &[Vec<u32>]) -> Vec<u32> {
    let mut all: Vec<u32> = lists.concat();
    all.sort_unstable();
    all
}

/// What is in some of the lists, ascending.
pub(super) fn union(lists: &[Vec<u32>]) -> Vec<u32> {
    let mut all: Vec<u32> = lists.iter().flatten().copied().collect();
    all.sort_unstable();
    all.dedup();
    all
}

fn figure(
    robot: &Robot,
    setup: &Setup,
    limbs: &[Limb],
    lift: Option<f64>,
) -> Result<Figure, ArmError> {
    let stance = setup.stance([0.0; 3], lift);
    let (mut arms, mut body) = (Vec::new(), Vec::new());
    for limb in limbs {
        let arm = stance.bind(&limb.arm)?;
        body.extend(body_boxes(robot, &arm));
        let values = redundancies(arm.ik().redundancy_range(), REDUNDANCIES);
        arms.push(Raised { pivot: setup.pivot(robot, &arm), reach: limb.reach, values, arm });
    }
    Ok(Figure { lift, arms, body })
}

/// Directions in which the robot looks. \[rad\]
fn yaws(figures: &[Figure]) -> Vec<f64> {
    let turns = |raised: &Raised| {
        let limits = &raised.arm.limits()[0];
        let axis = raised.arm.jacobian(&nullsweep_robot::JointVector::ZERO)[(5, 0)].abs();
        axis > 0.99 && (limits.continuous || limits.upper - limits.lower > ALL_ROUND)
    };
    let alone = |figure: &Figure| figure.arms.len() == 1 && figure.arms.iter().all(turns);
    let count = if figures.iter().all(alone) { 1 } else { YAWS };
    (0..count).map(|k| wrap(TAU * f64::from(k) / f64::from(count))).collect()
}

/// Places on the floor, in rows about the middle of what is to be reached.
fn spots(flat: &[Point3<f64>], around: f64) -> Vec<Point3<f64>> {
    let (mut low, mut high) = (flat[0], flat[0]);
    for p in flat {
        (low, high) = (low.inf(p), high.sup(p));
    }
    let middle = nalgebra::center(&low, &high);
    let out = Vector3::new(around, around, 0.0);
    let steps = ((high + out - middle) / STEP).map(|s| s.ceil() as i32);
    let at = |i: i32, j: i32| middle + Vector3::new(STEP * f64::from(i), STEP * f64::from(j), 0.0);
    let rows = -steps.x..=steps.x;
    rows.flat_map(|i| (-steps.y..=steps.y).map(move |j| at(i, j))).collect()
}

/// The pad on a patch, at two headings that are a quarter of a turn apart.
fn contacts(patch: &Patch, tool: &Tool) -> [Isometry3<f64>; 2] {
    [0.0, FRAC_PI_2].map(|heading| {
        let travel = direction(&patch.normal, heading);
        let contact = contact_pose(&patch.centre, &patch.normal, &travel, tool.stand_off);
        contact * tool.contact_in_tip().inverse()
    })
}

fn promised(
    raised: &Raised,
    here: &[u32],
    centres: &[Point3<f64>],
    contacts: &[[Isometry3<f64>; 2]],
    from_floor: &Isometry3<f64>,
) -> Vec<u32> {
    let Raised { arm, pivot, reach, values } = raised;
    let mut solutions = Solutions::new();
    let mut has = |tip: &Isometry3<f64>, value: f64| {
        solutions.clear();
        arm.ik().solve(&(from_floor * tip), value, &mut solutions);
        solutions.iter().any(|s| arm.within_margins(&s.q))
    };
    let robust = ROBUST.min(values.len());
    let mut is_promised = |patch: &u32| {
        let patch = *patch as usize;
        let far = (from_floor * centres[patch] - pivot).norm() > *reach;
        let mut solved = |tip| values.iter().filter(|v| has(tip, **v)).take(robust).count();
        !far && contacts[patch].iter().any(|tip| solved(tip) == robust)
    };
    here.iter().copied().filter(|patch| is_promised(patch)).collect()
}
