//! The robot's shapes, and what stands around it.

use nalgebra::Point3;
use nullsweep_collision::{Figure, ObstacleShape, Options};
use nullsweep_planner::workcell::Scene;
use nullsweep_report::{Body, Look, PadCentre, Shape};
use nullsweep_robot::{Arm, Robot, Tool};

/// How far the drawn piece of the floor reaches beyond what is there. \[m\]
const AROUND: f64 = 0.4;

/// A robot with its tool.
#[derive(Clone, Copy)]
pub(crate) struct Posed<'a> {
    pub(crate) robot: &'a Robot,
    /// The arm, its other joints where they are held.
    pub(crate) arm: &'a Arm,
    pub(crate) tool: &'a Tool,
    pub(crate) collision: &'a Options,
}

/// The robot as it is checked.
pub(super) struct Shown {
    pub(super) bodies: Vec<Body>,
    pub(super) shapes: Vec<Shape>,
    pub(super) pad: PadCentre,
}

/// Robot, tool, obstacles and floor in the root frame.
pub(super) fn shapes(figure: Posed<'_>, here: Option<&Scene>) -> anyhow::Result<Shown> {
    let Posed { robot, arm, tool, collision } = figure;
    let figure = Figure::new(robot, arm, tool, collision)?;
    let (body, tip) = figure.tip;
    let centre = Point3::from((tip * tool.contact_in_tip()).translation.vector);
    let mut shapes: Vec<Shape> = figure
        .shapes
        .into_iter()
        .map(|shape| Shape {
            name: shape.name,
            look: match (shape.is_pad, shape.is_guessed) {
                (true, _) => Look::Pad,
                (_, true) => Look::Guessed,
                _ => Look::Robot,
            },
            body: shape.body,
            vertices: shape.mesh.vertices,
            triangles: shape.mesh.triangles,
        })
        .collect();
    for obstacle in here.into_iter().flat_map(|scene| &scene.obstacles) {
        let mesh = obstacle.triangles(&collision.meshes)?;
        let is_floor = matches!(obstacle.shape, ObstacleShape::Floor);
        let mesh = if is_floor {
            (floor(here, obstacle), FLOOR.to_vec())
        } else {
            (mesh.vertices, mesh.triangles)
        };
        shapes.push(Shape {
            name: obstacle.name.clone(),
            look: if is_floor { Look::Ground } else { Look::Obstacle },
            body: None,
            vertices: mesh.0,
            triangles: mesh.1,
        });
    }
    let bodies = figure.bodies.into_iter().map(|body| Body {
        parent: body.parent,
        rest: body.rest,
        axis: body.axis,
        slides: body.slides,
        joint: body.joint,
        factor: body.factor,
        offset: body.offset,
    });
    Ok(Shown { bodies: bodies.collect(), shapes, pad: PadCentre { body, centre } })
}

const FLOOR: [[u32; 3]; 2] = [[0, 1, 2], [0, 2, 3]];

/// Four corners of the floor, under all that is there.
fn floor(here: Option<&Scene>, floor: &nullsweep_collision::Obstacle) -> Vec<Point3<f64>> {
    let own = [Point3::new(-0.6, -0.6, 0.0), Point3::new(0.6, 0.6, 0.0)];
    let points = here.into_iter().flat_map(|scene| &scene.surface.points);
    let on_floor = points.chain(&own).map(|p| floor.pose.inverse_transform_point(p));
    let (low, high) = on_floor.fold((own[0], own[1]), |(low, high), p| (low.inf(&p), high.sup(&p)));
    [
        (low.x, low.y, -1., -1.),
        (high.x, low.y, 1., -1.),
        (high.x, high.y, 1., 1.),
        (low.x, high.y, -1., 1.),
    ]
    .map(|(x, y, outwards, up)| {
        floor.pose * Point3::new(x + AROUND * outwards, y + AROUND * up, -0.002)
    })
    .into()
}
