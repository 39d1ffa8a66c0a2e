//! What both checks are built from: the robot's parts, the pairs of them to check, the scan's points
//! and the obstacles.

use std::collections::BTreeSet;

use nalgebra::Isometry3;
use nullsweep_robot::{Arm, Robot, Tool};
use parry3d_f64::shape::SharedShape;

use crate::bodies::{Bodies, MAX_BODIES};
use crate::error::CollisionError;
use crate::mesh::MeshPaths;
use crate::obstacle::Obstacle;
use crate::options::Options;
use crate::pairs::{self, Pairs, sample};
use crate::parts::{self, Part, Parts};
use crate::points::{Points, Sorted};
use crate::rules::Margins;
use crate::shapes::{distance, pose, poses};
use crate::solid::Solid;

/// A robot with its tool, scan and obstacles, all shapes prepared; in the root frame.
pub(crate) struct Scene {
    /// How many links the robot has.
    pub(crate) links: usize,
    pub(crate) parts: Vec<Part>,
    /// For each part: does it move with the arm?
    pub(crate) moves: Vec<bool>,
    /// For each part: is it rigid to the tip?
    pub(crate) at_tip: Vec<bool>,
    pub(crate) pairs: Pairs,
    pub(crate) points: Sorted,
    pub(crate) obstacles: Vec<PreparedObstacle>,
    pub(crate) tool: Tool,
    pub(crate) margins: Margins,
    /// Parts, by their index, that meet an obstacle that carries the robot in every posture: they
    /// are not checked against it.
    pub(crate) grounded: BTreeSet<(usize, usize)>,
    /// Links whose shapes are guesses.
    pub(crate) guessed: Vec<String>,
    /// What was made up, left out or looked for, in words.
    pub(crate) notes: Vec<String>,
}

/// An obstacle, or a convex piece of one, whose shape is read and ready.
#[derive(Clone)]
pub(crate) struct PreparedObstacle {
    pub(crate) name: String,
    pub(crate) solid: Solid,
    /// The same for parry.
    pub(crate) shape: SharedShape,
    pub(crate) pose: Isometry3<f64>,
    pub(crate) carries_robot: bool,
}

impl Scene {
    /// Reads and sorts everything; also the driven bodies that the parts hang on.
    pub(crate) fn prepare(
        robot: &Robot,
        arm: &Arm,
        tool: &Tool,
        points: &Points<'_>,
        obstacles: &[Obstacle],
        options: &Options,
    ) -> Result<(Self, Bodies), CollisionError> {
        check_input(points, &options.margins)?;
        tool.check()?;
        let bodies = Bodies::new(robot, arm)
            .map_err(|count| CollisionError::TooManyBodies { count, most: MAX_BODIES })?;
        let Parts { parts, guessed, mut notes } = parts::collect(robot, arm, tool, options)?;
        let pairs = pairs::find(robot, arm, &bodies, &parts, options)?;
        let obstacles = obstacles
            .iter()
            .map(|obstacle| PreparedObstacle::all(obstacle, &options.meshes))
            .collect::<Result<Vec<_>, _>>()?
            .concat();
        let body_of = |part: &Part| bodies.carrier(part.link).0;
        let moves: Vec<bool> = parts.iter().map(|part| body_of(part).is_some()).collect();
        let grounded =
            grounded(robot, arm, &parts, &moves, &obstacles, options.margins.environment);
        for name in grounded.iter().map(|&(part, _)| &parts[part].name).collect::<BTreeSet<_>>() {
            notes.push(format!(
                "{name} meets what the robot stands on in every posture, and is not checked against \
                 it: is the base as high as the real one?"
            ));
        }
        let scene = Self {
            links: robot.links().len(),
            moves,
            at_tip: parts.iter().map(|part| body_of(part) == Some(bodies.tip_body)).collect(),
            parts,
            pairs,
            points: points.sorted(),
            obstacles,
            tool: tool.clone(),
            margins: options.margins,
            grounded,
            guessed,
            notes,
        };
        Ok((scene, bodies))
    }
}

/// Which moving parts come too near to which obstacles that carry the robot at home and in all
/// sampled configurations.
fn grounded(
    robot: &Robot,
    arm: &Arm,
    parts: &[Part],
    moves: &[bool],
    obstacles: &[PreparedObstacle],
    margin: f64,
) -> BTreeSet<(usize, usize)> {
    let carries = |i: &usize| obstacles[*i].carries_robot;
    let mut found: BTreeSet<(usize, usize)> = (0..parts.len())
        .filter(|&part| moves[part] && !parts[part].is_pad)
        .flat_map(|part| (0..obstacles.len()).filter(carries).map(move |i| (part, i)))
        .collect();
    // Home comes first, where hardly any part is that low.
    for q in sample(arm) {
        if found.is_empty() {
            break;
        }
        let at = poses(parts, robot.links().len(), arm, &q);
        found.retain(|&(part, i)| {
            let obstacle = &obstacles[i];
            distance(&at[part], &*parts[part].shape, &pose(&obstacle.pose), &*obstacle.shape)
                < margin
        });
    }
    found
}

impl PreparedObstacle {
    /// One for each convex piece of it.
    fn all(obstacle: &Obstacle, meshes: &MeshPaths) -> Result<Vec<Self>, CollisionError> {
        let Obstacle { name, carries_robot, .. } = obstacle;
        let (solids, pose) = obstacle.solids(meshes)?;
        let prepared = |solid: Solid| {
            let (name, carries_robot) = (name.clone(), *carries_robot);
            Self { name, shape: solid.to_parry(), solid, pose, carries_robot }
        };
        Ok(solids.into_iter().map(prepared).collect())
    }
}

fn check_input(points: &Points<'_>, margins: &Margins) -> Result<(), CollisionError> {
    for (name, value) in [
        ("self_clearance", margins.self_clearance),
        ("environment", margins.environment),
        ("contact_growth", margins.contact_growth),
        ("contact_front", margins.contact_front),
        ("contact_clearance", margins.contact_clearance),
    ] {
        if !(value >= 0.0 && value.is_finite()) {
            return Err(CollisionError::Margin { name, value });
        }
    }
    let all = points.all().chain(points.keep_out);
    match all.into_iter().position(|p| !p.iter().all(|x| x.is_finite())) {
        Some(index) => Err(CollisionError::NotFinite { index }),
        None => Ok(()),
    }
}
