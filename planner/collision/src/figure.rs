//! What the robot looks like to the collision checks: its shapes as triangles, and the bodies that
//! carry them, for pictures.

use nalgebra::{Isometry3, Point3, Rotation3, UnitQuaternion, UnitVector3};
use nullsweep_robot::{Arm, Robot, Tool};
use parry3d_f64::math::Vec3;

use crate::bodies::{Bodies, MAX_BODIES};
use crate::error::CollisionError;
use crate::frame::Frame;
use crate::mesh::MeshPaths;
use crate::obstacle::{Obstacle, ObstacleShape};
use crate::options::Options;
use crate::parts::{self, Part, Parts};
use crate::solid::Solid;

/// A robot with its tool as it is checked, in the root frame at the arm's held joints.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// What the arm's joints move, parents first.
    pub bodies: Vec<FigureBody>,
    /// The shapes in link order; the tool's pad last.
    pub shapes: Vec<FigureShape>,
    /// The body that carries the tip, and the tip frame in there. \[m\]
    pub tip: (usize, Isometry3<f64>),
    /// What was made up, in words.
    pub notes: Vec<String>,
}

/// What moves together with one driven joint: of the arm, or one that mimics one.
#[derive(Clone, Debug, PartialEq)]
pub struct FigureBody {
    /// The body that it hangs on; `None`: it is fixed to the robot's root.
    pub parent: Option<usize>,
    /// The joint's frame in the parent's (or the root's) at value 0. \[m\]
    pub rest: Isometry3<f64>,
    /// The joint's axis in its frame.
    pub axis: UnitVector3<f64>,
    /// Slides along the axis instead of turning about it.
    pub slides: bool,
    /// Index into the joint vector.
    pub joint: usize,
    /// The joint's value is `factor` · q\[joint\] + `offset`.
    pub factor: f64,
    /// \[rad\] or \[m\]
    pub offset: f64,
}

/// One shape.
#[derive(Clone, Debug, PartialEq)]
pub struct FigureShape {
    /// Its link's name, or that of the tool or an attached object.
    pub name: String,
    /// The body that carries it; `None`: it does not move with the arm.
    pub body: Option<usize>,
    /// It is the tool's pad.
    pub is_pad: bool,
    /// It was made up for a shape that is missing.
    pub is_guessed: bool,
    /// Its surface in the body's frame, or the root frame.
    pub mesh: Triangles,
}

/// A surface of triangles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Triangles {
    /// Corners. \[m\]
    pub vertices: Vec<Point3<f64>>,
    /// The corners of each triangle, anticlockwise from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Triangles {
    /// Two surfaces as one.
    fn and(mut self, other: Self) -> Self {
        let first = self.vertices.len() as u32;
        self.vertices.extend(other.vertices);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|corner| corner + first)));
        self
    }
}

/// Into how many pieces a circle is cut.
const PIECES: u32 = 28;

impl Figure {
    /// The robot with an arm, its held joints where the arm holds them, and a tool.
    ///
    /// # Errors
    /// As for the checks: a mesh cannot be used, or the arm drives too many joints.
    pub fn new(
        robot: &Robot,
        arm: &Arm,
        tool: &Tool,
        options: &Options,
    ) -> Result<Self, CollisionError> {
        let found = Bodies::new(robot, arm)
            .map_err(|count| CollisionError::TooManyBodies { count, most: MAX_BODIES })?;
        let Parts { parts, notes, .. } = parts::collect(robot, arm, tool, options)?;
        let shape = |part: &Part| {
            let (body, carrier) = found.carrier(part.link);
            FigureShape {
                name: part.name.clone(),
                body,
                is_pad: part.is_pad,
                is_guessed: part.is_guessed,
                mesh: triangles(&part.solid, &(pose(&carrier) * part.origin)),
            }
        };
        let bodies = found.bodies.iter().map(|body| FigureBody {
            parent: body.parent,
            rest: pose(&body.rest),
            axis: UnitVector3::new_normalize(body.axis),
            slides: body.prismatic,
            joint: body.joint,
            factor: body.multiplier,
            offset: body.value(0.0),
        });
        Ok(Self {
            bodies: bodies.collect(),
            shapes: parts.iter().map(shape).collect(),
            tip: (found.tip_body, pose(&found.tip)),
            notes,
        })
    }
}

impl Obstacle {
    /// Its surface where it stands; empty for a floor, which has no end.
    ///
    /// # Errors
    /// Its mesh cannot be used.
    pub fn triangles(&self, meshes: &MeshPaths) -> Result<Triangles, CollisionError> {
        if matches!(self.shape, ObstacleShape::Floor) {
            return Ok(Triangles::default());
        }
        let (solids, pose) = self.solids(meshes)?;
        let pieces = solids.iter().map(|solid| triangles(solid, &pose));
        Ok(pieces.fold(Triangles::default(), Triangles::and))
    }
}

fn pose(frame: &Frame) -> Isometry3<f64> {
    let rotation = Rotation3::from_matrix_unchecked(frame.rotation);
    Isometry3::from_parts(frame.translation.into(), UnitQuaternion::from_rotation_matrix(&rotation))
}

fn triangles(solid: &Solid, at: &Isometry3<f64>) -> Triangles {
    let shape = solid.to_parry();
    let half = PIECES / 2;
    let (vertices, triangles) = if let Some(ball) = shape.as_ball() {
        ball.to_trimesh(PIECES, half)
    } else if let Some(capsule) = shape.as_capsule() {
        capsule.to_trimesh(PIECES, half)
    } else if let Some(cylinder) = shape.as_cylinder() {
        cylinder.to_trimesh(PIECES)
    } else if let Some(cuboid) = shape.as_cuboid() {
        cuboid.to_trimesh()
    } else if let Some(hull) = shape.as_convex_polyhedron() {
        hull.to_trimesh()
    } else {
        (Vec::new(), Vec::new())
    };
    let placed = |v: Vec3| at * Point3::new(v.x, v.y, v.z);
    Triangles { vertices: vertices.into_iter().map(placed).collect(), triangles }
}

#[cfg(test)]
mod tests {
    use nullsweep_robot::{ArmSpec, JointVector, Side};

    use super::*;

    /// The body's poses by the figure alone.
    fn poses(figure: &Figure, q: &JointVector) -> Vec<Isometry3<f64>> {
        let mut poses: Vec<Isometry3<f64>> = Vec::new();
        for body in &figure.bodies {
            let value = body.factor * q[body.joint] + body.offset;
            let (turn, slide) = if body.slides { (0.0, value) } else { (value, 0.0) };
            let motion = Isometry3::from_parts(
                body.axis.scale(slide).into(),
                UnitQuaternion::from_axis_angle(&body.axis, turn),
            );
            let local = body.rest * motion;
            poses.push(body.parent.map_or(local, |parent| poses[parent] * local));
        }
        poses
    }

    #[test]
    fn the_figure_moves_as_the_robot_does() {
        let robot = Robot::pr2();
        for side in [Side::Left, Side::Right] {
            let arm = robot.arm(&ArmSpec::pr2(side)).unwrap();
            let arm = arm.with_held(&[("torso_lift_joint", 0.2)]).unwrap();
            let tool = Tool::default();
            let figure = Figure::new(&robot, &arm, &tool, &Options::default()).unwrap();
            let mut q = arm.home();
            for j in 0..arm.dof() {
                q[j] += 0.1 * (j as f64 - 3.0);
            }
            let mut links = vec![Isometry3::identity(); robot.links().len()];
            arm.link_poses(&q, &mut links);
            let poses = poses(&figure, &q);
            let (body, tip) = figure.tip;
            let found = poses[body] * tip;
            assert!((found.inverse() * arm.tip_pose(&q)).translation.vector.norm() < 1e-9);
            // Each shape's middle is where its link carries it, seen from the same link elsewhere.
            let rest = arm.home();
            let mut before = links.clone();
            arm.link_poses(&rest, &mut before);
            let at_rest = self::poses(&figure, &rest);
            for shape in figure.shapes.iter().filter(|s| !s.is_pad) {
                let link = robot.links().iter().position(|l| l.name == shape.name).unwrap();
                let at = |poses: &[Isometry3<f64>]| {
                    shape.body.map_or(Isometry3::identity(), |b| poses[b])
                };
                for v in &shape.mesh.vertices {
                    let inside = before[link].inverse() * (at(&at_rest) * v);
                    let error = (links[link] * inside - at(&poses) * v).norm();
                    assert!(error < 1e-9, "{}: {error}", shape.name);
                }
            }
            assert!(figure.shapes.iter().filter(|s| s.body.is_some()).count() >= 7);
            let pad = figure.shapes.last().unwrap();
            let front = tool.on(&arm).centre(&q);
            let nearest = pad.mesh.vertices.iter().map(|v| (poses[body] * v - front).norm());
            let corner = 0.5 * libm::hypot(tool.width, tool.length);
            let nearest = nearest.fold(f64::INFINITY, f64::min);
            assert!(pad.is_pad && (nearest - corner).abs() < 1e-9, "{nearest}");
        }
    }

    #[test]
    fn surfaces_are_closed_and_face_outwards() {
        let robot = Robot::pr2();
        let arm = robot.arm(&ArmSpec::pr2(Side::Right)).unwrap();
        let figure = Figure::new(&robot, &arm, &Tool::default(), &Options::default()).unwrap();
        for FigureShape { name, mesh, .. } in &figure.shapes {
            let middle = mesh.vertices.iter().map(|v| v.coords).sum::<nalgebra::Vector3<f64>>()
                / mesh.vertices.len() as f64;
            for t in &mesh.triangles {
                let [a, b, c] = t.map(|i| mesh.vertices[i as usize].coords);
                let volume = (a - middle).dot(&(b - middle).cross(&(c - middle)));
                assert!(volume > -1e-12, "{name}: a face looks inwards");
            }
        }
    }
}
