//! The slow check: parry's shapes, every pair and every raw point, poses from the robot crate.
//!
//! It shares with the fast check the input (shapes, points, margins and the list of pairs to check)
//! and nothing else, so that either can be tested against the other.

use nalgebra::{Isometry3, Point3};
use nullsweep_robot::{Arm, JointVector, Robot, Tool};
use parry3d_f64::bounding_volume::BoundingVolume;
use parry3d_f64::math::{Pose, Rot3, Vec3};
use parry3d_f64::query;
use parry3d_f64::shape::{Shape, SharedShape};

use crate::parts::{Part, PartShape};
use crate::world::World;
use crate::{Hit, Margins, ToolContact, With};

/// The robot's parts as parry shapes.
#[derive(Clone)]
pub(crate) struct Shapes {
    parts: Vec<ExactPart>,
    links: usize,
}

#[derive(Clone)]
struct ExactPart {
    link: Option<usize>,
    /// In the frame of the link or the tip.
    origin: Isometry3<f64>,
    shape: SharedShape,
}

/// What the exact check needs besides the arm and the shapes.
pub(crate) struct Scene {
    pub(crate) shapes: Shapes,
    pub(crate) parts: Vec<Part>,
    pub(crate) points: Vec<Point3<f64>>,
    pub(crate) obstacles: Vec<SceneObstacle>,
    /// Pairs of parts to check.
    pub(crate) pairs: Vec<(usize, usize)>,
    pub(crate) tool: Tool,
    pub(crate) margins: Margins,
    /// For each part: does it move with the arm?
    pub(crate) moves: Vec<bool>,
    /// For each part: is it rigid to the tip?
    pub(crate) at_tip: Vec<bool>,
}

pub(crate) struct SceneObstacle {
    pub(crate) name: String,
    pub(crate) shape: SharedShape,
    pub(crate) pose: Isometry3<f64>,
    pub(crate) carries_robot: bool,
}

/// The exact check of a [`World`].
#[derive(Clone, Copy)]
pub struct Exact<'a> {
    world: &'a World,
}

impl Shapes {
    pub(crate) fn new(robot: &Robot, parts: &[Part]) -> Self {
        let parts = parts
            .iter()
            .map(|part| {
                let (shape, turn) = to_parry(&part.shape);
                ExactPart { link: part.link, origin: part.origin * turn, shape }
            })
            .collect();
        Self { parts, links: robot.links().len() }
    }

    /// The pose of every part in the root frame.
    pub(crate) fn poses(&self, arm: &Arm, q: &JointVector) -> Vec<Pose> {
        let mut links = vec![Isometry3::identity(); self.links];
        arm.link_poses(q, &mut links);
        let tip = arm.tip_pose(q);
        self.parts
            .iter()
            .map(|part| pose(&(part.link.map_or(tip, |link| links[link]) * part.origin)))
            .collect()
    }

    /// Distance between two parts, 0 if they overlap. \[m\]
    pub(crate) fn distance(&self, poses: &[Pose], a: usize, b: usize) -> f64 {
        distance(&poses[a], &*self.parts[a].shape, &poses[b], &*self.parts[b].shape)
    }
}

impl<'a> Exact<'a> {
    pub(crate) fn new(world: &'a World) -> Self {
        Self { world }
    }

    /// Whether everything keeps its margin. A configuration with NaN or ∞ is not free.
    #[must_use]
    pub fn is_free(&self, q: &JointVector, contact: ToolContact) -> bool {
        q.iter().all(|x| x.is_finite()) && self.first_hit(q, contact).is_none()
    }

    /// The first pair found too near, moving parts only.
    #[must_use]
    pub fn first_hit(&self, q: &JointVector, contact: ToolContact) -> Option<Hit> {
        let scene = self.scene();
        let poses = scene.shapes.poses(&self.world.arm, q);
        let margin = scene.margins.self_clearance;
        for &(a, b) in &scene.pairs {
            let distance = scene.shapes.distance(&poses, a, b);
            if breaks(distance, margin) {
                let with = With::Link(scene.parts[b].name.clone());
                return Some(Hit { link: scene.parts[a].name.clone(), with, distance, margin });
            }
        }
        let moving: Vec<usize> = (0..poses.len()).filter(|&i| scene.moves[i]).collect();
        self.obstacle_hit(&poses, &moving, true)
            .or_else(|| self.point_hit(q, &poses, &moving, contact))
    }

    /// The first part that does not move with the arm and is too near to the environment.
    pub(crate) fn stance_hit(&self) -> Option<Hit> {
        let scene = self.scene();
        let q = self.world.arm.home();
        let poses = scene.shapes.poses(&self.world.arm, &q);
        let fixed: Vec<usize> = (0..poses.len()).filter(|&i| !scene.moves[i]).collect();
        self.obstacle_hit(&poses, &fixed, false)
            .or_else(|| self.point_hit(&q, &poses, &fixed, ToolContact::Forbidden))
    }

    fn scene(&self) -> &'a Scene {
        &self.world.scene
    }

    fn obstacle_hit(&self, poses: &[Pose], parts: &[usize], with_floor: bool) -> Option<Hit> {
        let scene = self.scene();
        let margin = scene.margins.environment;
        for obstacle in scene.obstacles.iter().filter(|o| with_floor || !o.carries_robot) {
            let at = pose(&obstacle.pose);
            for &i in parts {
                let shape = &*scene.shapes.parts[i].shape;
                let distance = distance(&poses[i], shape, &at, &*obstacle.shape);
                if breaks(distance, margin) {
                    let link = scene.parts[i].name.clone();
                    let with = With::Obstacle(obstacle.name.clone());
                    return Some(Hit { link, with, distance, margin });
                }
            }
        }
        None
    }

    fn point_hit(
        &self,
        q: &JointVector,
        poses: &[Pose],
        parts: &[usize],
        contact: ToolContact,
    ) -> Option<Hit> {
        let scene = self.scene();
        let (tool, margins) = (&scene.tool, &scene.margins);
        let to_contact = (self.world.arm.tip_pose(q) * tool.contact_in_tip()).inverse();
        let in_prism = |p: &Point3<f64>| {
            let p = to_contact * p;
            p.x.abs() <= 0.5 * tool.width + margins.contact_growth
                && p.y.abs() <= 0.5 * tool.length + margins.contact_growth
                && (-tool.thickness..=margins.contact_front).contains(&p.z)
        };
        for &i in parts {
            let may_touch = contact == ToolContact::Allowed && scene.at_tip[i];
            let is_pad = scene.parts[i].is_pad;
            let outside = match (may_touch, is_pad) {
                (true, true) => margins.environment.min(margins.contact_growth),
                (true, false) => margins.environment.min(margins.contact_clearance),
                (false, _) => margins.environment,
            };
            let shape = &*scene.shapes.parts[i].shape;
            // Points outside the shape's bounds, grown by the margin, are farther than it.
            let bounds = shape.compute_aabb(&poses[i]).loosened(outside);
            for p in &scene.points {
                if !bounds.contains_local_point(Vec3::new(p.x, p.y, p.z)) {
                    continue;
                }
                let distance = signed_distance(shape, &poses[i], p);
                let margin = match may_touch && distance < outside && in_prism(p) {
                    true if is_pad => continue,
                    true => -margins.contact_depth,
                    false => outside,
                };
                if breaks(distance, margin) {
                    let link = scene.parts[i].name.clone();
                    return Some(Hit { link, with: With::ScanPoint(*p), distance, margin });
                }
            }
        }
        None
    }
}

fn to_parry(shape: &PartShape) -> (SharedShape, Isometry3<f64>) {
    let straight = Isometry3::identity();
    match shape {
        PartShape::Box { half } => (SharedShape::cuboid(half.x, half.y, half.z), straight),
        PartShape::Sphere { radius } => (SharedShape::ball(*radius), straight),
        PartShape::Capsule { radius, half } => (SharedShape::capsule_z(*half, *radius), straight),
        PartShape::Cylinder { radius, half } => {
            // parry's cylinder stands along y.
            let turn = Isometry3::rotation(nalgebra::Vector3::x() * std::f64::consts::FRAC_PI_2);
            (SharedShape::cylinder(*half, *radius), turn)
        }
        PartShape::Hull(points) => {
            let points: Vec<Vec3> = points.iter().map(|p| Vec3::new(p.x, p.y, p.z)).collect();
            let hull = SharedShape::convex_hull(&points).expect("checked when it was read");
            (hull, straight)
        }
    }
}

fn pose(pose: &Isometry3<f64>) -> Pose {
    let (t, r) = (pose.translation.vector, pose.rotation);
    Pose::from_parts(Vec3::new(t.x, t.y, t.z), Rot3::from_xyzw(r.i, r.j, r.k, r.w))
}

/// NaN breaks every margin.
fn breaks(distance: f64, margin: f64) -> bool {
    distance < margin || distance.is_nan()
}

fn distance(at_a: &Pose, a: &dyn Shape, at_b: &Pose, b: &dyn Shape) -> f64 {
    // Every shape here is supported; a pair that were not would count as touching.
    query::distance(at_a, a, at_b, b).map_or(0.0, |found| found.distance)
}

fn signed_distance(shape: &dyn Shape, at: &Pose, p: &Point3<f64>) -> f64 {
    let projection = shape.project_point(at, Vec3::new(p.x, p.y, p.z), false);
    let distance = (projection.point - Vec3::new(p.x, p.y, p.z)).length();
    if projection.is_inside { -distance } else { distance }
}
