//! The collision shapes of a robot: from its URDF, mesh files, fitted capsules and the tool.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use nullsweep_robot::{Arm, Geometry, Robot, Tool};

use crate::mesh::{MeshError, MeshPaths, read_stl};
use crate::solid::{Hull, Solid};
use crate::{Attached, CollisionError, Options};

/// One convex shape fixed to a link.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    /// Index of the link that carries it; none: the arm's tip frame.
    pub(crate) link: Option<usize>,
    /// The name that it is known by: its link's, or that of the tool or an attached object.
    pub(crate) name: String,
    /// Pose in the link's (or the tip's) frame.
    pub(crate) origin: Isometry3<f64>,
    pub(crate) shape: PartShape,
    /// The tool's pad, which may touch the scan.
    pub(crate) is_pad: bool,
}

/// The shape of a part about its origin; axes along z. \[m\]
#[derive(Clone, Debug)]
pub(crate) enum PartShape {
    Box {
        half: Vector3<f64>,
    },
    Cylinder {
        radius: f64,
        half: f64,
    },
    Sphere {
        radius: f64,
    },
    Capsule {
        radius: f64,
        half: f64,
    },
    /// The convex hull of these points.
    Hull(Vec<Point3<f64>>),
}

/// Shortest distance between two joints that gets a capsule instead of a ball. \[m\]
const SHORT: f64 = 1e-3;

impl Part {
    /// The solid and its pose in the link's frame.
    pub(crate) fn solid(&self) -> Option<(Solid, Isometry3<f64>)> {
        let solid = match &self.shape {
            PartShape::Box { half } => Solid::Box { half: *half },
            PartShape::Sphere { radius } => Solid::Ball { radius: *radius },
            PartShape::Capsule { radius, half } => Solid::Capsule { half: *half, radius: *radius },
            PartShape::Cylinder { radius, half } => {
                let quarter = UnitQuaternion::from_axis_angle(
                    &Vector3::x_axis(),
                    std::f64::consts::FRAC_PI_2,
                );
                let solid = Solid::Cylinder { half: *half, radius: *radius };
                return Some((solid, self.origin * quarter));
            }
            PartShape::Hull(points) => Solid::Hull(Box::new(Hull::new(points)?)),
        };
        Some((solid, self.origin))
    }
}

/// All parts of robot, tool and attached objects, in link order; and what was made up, in words.
pub(crate) fn collect(
    robot: &Robot,
    arm: &Arm,
    tool: &Tool,
    options: &Options,
) -> Result<(Vec<Part>, Vec<String>), CollisionError> {
    let (mut parts, mut notes) = (Vec::new(), Vec::new());
    let moving = arm.moving_links();
    for (index, link) in robot.links().iter().enumerate() {
        let mut missing = None;
        let mut found = Vec::new();
        for shape in &link.collisions {
            match resolve(&shape.geometry, &options.meshes) {
                Ok(geometry) => found.push(Part {
                    link: Some(index),
                    name: link.name.clone(),
                    origin: shape.origin,
                    shape: geometry,
                    is_pad: false,
                }),
                Err(error) => missing = Some(error),
            }
        }
        match (missing, options.fit_capsules) {
            (None, Some(radius)) if link.collisions.is_empty() && moving.contains(&index) => {
                // A link between two joints with no shape at all would be invisible.
                let fitted = fit(robot, index, radius, false);
                if !fitted.is_empty() {
                    notes.push(format!(
                        "{}: no collision shape; {} capsule(s) of radius {radius} m fitted",
                        link.name,
                        fitted.len()
                    ));
                    parts.extend(fitted);
                }
            }
            (None, _) => parts.extend(found),
            (Some(error), Some(radius)) => {
                let fitted = fit(robot, index, radius, true);
                notes.push(format!(
                    "{}: {error}; {} capsule(s) of radius {radius} m fitted instead",
                    link.name,
                    fitted.len()
                ));
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
        let geometry = resolve(&shape.geometry, &options.meshes)
            .map_err(|error| CollisionError::Mesh { link: name.clone(), error })?;
        parts.push(Part {
            link: Some(index),
            name: name.clone(),
            origin: shape.origin,
            shape: geometry,
            is_pad: false,
        });
    }
    let half = 0.5 * Vector3::new(tool.width, tool.length, tool.thickness);
    parts.push(Part {
        link: None,
        name: tool.name.clone(),
        origin: tool.contact_in_tip() * Isometry3::translation(0.0, 0.0, -half.z),
        shape: PartShape::Box { half },
        is_pad: true,
    });
    Ok((parts, notes))
}

/// A URDF geometry with its mesh, if it is one, read from its file.
pub(crate) fn resolve(geometry: &Geometry, meshes: &MeshPaths) -> Result<PartShape, MeshError> {
    Ok(match geometry {
        Geometry::Box { half_extents } => PartShape::Box { half: *half_extents },
        Geometry::Cylinder { radius, half_length } => {
            PartShape::Cylinder { radius: *radius, half: *half_length }
        }
        Geometry::Sphere { radius } => PartShape::Sphere { radius: *radius },
        Geometry::Capsule { radius, half_length } => {
            PartShape::Capsule { radius: *radius, half: *half_length }
        }
        Geometry::Mesh { uri, scale } => {
            let path = meshes.resolve(uri)?;
            let points = read_stl(&path, scale)?;
            if Hull::new(&points).is_none() {
                return Err(MeshError::Flat { path, vertices: points.len() });
            }
            PartShape::Hull(points)
        }
    })
}

/// Capsules from a link's origin to the joints of its children; a ball at the origin where
/// `always` and there is no child at a distance.
fn fit(robot: &Robot, link: usize, radius: f64, always: bool) -> Vec<Part> {
    let part = |origin, shape| Part {
        link: Some(link),
        name: robot.links()[link].name.clone(),
        origin,
        shape,
        is_pad: false,
    };
    let mut parts: Vec<Part> = robot
        .joints()
        .iter()
        .filter(|joint| joint.parent == link)
        .map(|joint| joint.origin.translation.vector)
        .filter(|to| to.norm() > SHORT)
        .map(|to| {
            let turn = UnitQuaternion::rotation_between(&Vector3::z(), &to).unwrap_or_else(|| {
                UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)
            });
            let origin = Isometry3::from_parts((0.5 * to).into(), turn);
            part(origin, PartShape::Capsule { radius, half: 0.5 * to.norm() })
        })
        .collect();
    if parts.is_empty() && always {
        parts.push(part(Isometry3::identity(), PartShape::Sphere { radius }));
    }
    parts
}
