//! The collision shapes of a robot: from its URDF, mesh files, fitted capsules and the tool.

use std::collections::BTreeSet;
use std::f64::consts::PI;

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use nullsweep_robot::{Arm, Robot, Tool, ToolBody};
use parry3d_f64::shape::SharedShape;

use crate::error::CollisionError;
use crate::options::{Attached, Options};
use crate::solid::{Prepared, Solid};

/// One convex shape fixed to a link.
#[derive(Clone)]
pub(crate) struct Part {
    /// Index of the link that carries it; none: the arm's tip frame.
    pub(crate) link: Option<usize>,
    /// The name that it is known by: its link's, or that of the tool or an attached object.
    pub(crate) name: String,
    pub(crate) solid: Solid,
    /// The same for parry.
    pub(crate) shape: SharedShape,
    /// The solid's pose in the link's (or the tip's) frame. \[m\]
    pub(crate) origin: Isometry3<f64>,
    /// The tool's pad, which may touch the scan.
    pub(crate) is_pad: bool,
    /// Made up for a shape that is missing.
    pub(crate) is_guessed: bool,
}

/// Shortest distance between two joints that gets a capsule instead of a ball. \[m\]
const SHORT: f64 = 1e-3;

impl Part {
    /// Of a link, or of the tip frame; not the pad.
    fn new(link: Option<usize>, name: &str, solid: Solid, origin: Isometry3<f64>) -> Self {
        let shape = solid.to_parry();
        Self { link, name: name.to_owned(), solid, shape, origin, is_pad: false, is_guessed: false }
    }
}

/// What a robot, its tool and attached objects are made of.
pub(crate) struct Parts {
    /// In link order.
    pub(crate) parts: Vec<Part>,
    /// Links whose shapes are fitted capsules: guesses.
    pub(crate) guessed: Vec<String>,
    /// What was made up, left out or looked for, in words.
    pub(crate) notes: Vec<String>,
}

/// All parts of robot, tool and attached objects.
pub(crate) fn collect(
    robot: &Robot,
    arm: &Arm,
    tool: &Tool,
    options: &Options,
) -> Result<Parts, CollisionError> {
    let (mut parts, mut notes, mut places) = (Vec::new(), Vec::new(), BTreeSet::new());
    let mut guessed = Vec::new();
    let moving = arm.moving_links();
    for (index, link) in robot.links().iter().enumerate() {
        if link.empty_shapes > 0 {
            notes.push(format!(
                "{}: {} collision shape(s) of size 0 skipped",
                link.name, link.empty_shapes
            ));
        }
        let mut missing = None;
        let mut found = Vec::new();
        for shape in &link.collisions {
            match Solid::prepare(&shape.geometry, shape.origin, &options.meshes) {
                Ok(Prepared { solids, pose, told }) => {
                    let part = |solid| Part::new(Some(index), &link.name, solid, pose);
                    found.extend(solids.into_iter().map(part));
                    places.extend(told);
                }
                Err(error) => missing = Some(error),
            }
        }
        match (missing, options.fit_capsules) {
            (None, Some(radius)) if link.collisions.is_empty() && moving.contains(&index) => {
                // A link between two joints with no shape at all would be invisible.
                let fitted = fit(robot, index, radius, false);
                if !fitted.is_empty() {
                    notes.push(format!(
                        "{}: no collision shape; {} capsule(s) of radius {radius} m fitted, a guess",
                        link.name,
                        fitted.len()
                    ));
                    guessed.push(link.name.clone());
                    parts.extend(fitted);
                }
            }
            (None, _) => parts.extend(found),
            (Some(error), Some(radius)) => {
                let fitted = fit(robot, index, radius, true);
                notes.push(format!(
                    "{}: {error}; {} capsule(s) of radius {radius} m fitted instead, a guess",
                    link.name,
                    fitted.len()
                ));
                guessed.push(link.name.clone());
                parts.extend(fitted);
            }
            (Some(error), None) => {
                return Err(CollisionError::Mesh { link: link.name.clone(), error });
            }
        }
    }
    for Attached { name, link, shape } in &options.attached {
        let index = robot.links().iter().position(|l| l.name == *link).ok_or_else(|| {
            CollisionError::UnknownLink { link: link.clone(), named_by: format!("object {name}") }
        })?;
        let Prepared { solids, pose, told } =
            Solid::prepare(&shape.geometry, shape.origin, &options.meshes)
                .map_err(|error| CollisionError::Mesh { link: name.clone(), error })?;
        parts.extend(solids.into_iter().map(|solid| Part::new(Some(index), name, solid, pose)));
        places.extend(told);
    }
    parts.push(pad(tool));
    notes.extend(places);
    Ok(Parts { parts, guessed, notes })
}

/// The tool's body.
fn pad(tool: &Tool) -> Part {
    let (solid, back, turn) = match tool.body() {
        ToolBody::Box { half } => (Solid::Box { half: half.into() }, half[2], None),
        ToolBody::Disc { radius, half } => {
            (Solid::Cylinder { half, radius }, half, Some(Vector3::x_axis()))
        }
        ToolBody::Roller { radius, half } => (Solid::Cylinder { half, radius }, radius, None),
    };
    let place = tool.contact_in_tip() * Isometry3::translation(0.0, 0.0, -back);
    // A cylinder's own axis is y.
    let origin = turn.map_or(place, |axis| {
        place * UnitQuaternion::from_axis_angle(&axis, std::f64::consts::FRAC_PI_2)
    });
    Part { is_pad: true, ..Part::new(None, &tool.name, solid, origin) }
}

/// Capsules from a link's origin to the joints of its children; a ball at the origin where
/// `always` and there is no child at a distance.
fn fit(robot: &Robot, link: usize, radius: f64, always: bool) -> Vec<Part> {
    let part = |origin, solid| {
        let part = Part::new(Some(link), &robot.links()[link].name, solid, origin);
        Part { is_guessed: true, ..part }
    };
    let mut parts: Vec<Part> = robot
        .joints()
        .iter()
        .filter(|joint| joint.parent == link)
        .map(|joint| joint.origin.translation.vector)
        .filter(|to| to.norm() > SHORT)
        .map(|to| {
            let turn = UnitQuaternion::rotation_between(&Vector3::z(), &to)
                .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), PI));
            let origin = Isometry3::from_parts((0.5 * to).into(), turn);
            part(origin, Solid::Capsule { half: 0.5 * to.norm(), radius })
        })
        .collect();
    if parts.is_empty() && always {
        parts.push(part(Isometry3::identity(), Solid::Ball { radius }));
    }
    parts
}
