//! The slow check: parry's shapes, every pair and every point, poses from the robot crate.

use std::collections::BTreeSet;

use nalgebra::Point3;
use nullsweep_robot::{Arm, JointVector, Robot, Tool};
use parry3d_f64::bounding_volume::{Aabb, BoundingVolume};
use parry3d_f64::math::{Pose, Vec3};
use parry3d_f64::shape::Shape;

use crate::error::CollisionError;
use crate::obstacle::Obstacle;
use crate::options::Options;
use crate::points::Points;
use crate::rules::{Hit, ToolContact, With};
use crate::scene::Scene;
use crate::shapes::{distance, pose, poses};
use crate::tree::Tree;

/// The exact check: every pair and every point by parry's queries, at poses from the robot
/// crate's kinematics. Slow: for the verification.
///
/// It stands alone, so that it and the fast check ([`World`](crate::World)) can be tested against
/// each other. What they share is made before either: the prepared shapes, which of them move and
/// which are rigid to each other, the list of pairs to check, the margins and the contact rule. Bounds,
/// sphere trees, the distance grid and the poses by which the fast check goes have no part in it (it
/// finds points by a tree of its own), and it leaves no pair out because of a proof.
pub struct Exact {
    arm: Arm,
    scene: Scene,
    tree: Tree,
    /// Of the points that not even the pad may touch.
    keep_out: Tree,
}

/// More than rounding may take away from the distance of bounds. \[m\]
const ROUNDING: f64 = 1e-9;

impl Exact {
    /// Prepares the check of an arm with a tool among points and obstacles, both in the robot's root
    /// frame.
    ///
    /// # Errors
    /// When a mesh or the SRDF cannot be used, a link is unknown, a margin or a scan point is not a
    /// proper number, or the arm drives too many joints; see [`CollisionError`].
    pub fn new<'a>(
        robot: &Robot,
        arm: &Arm,
        tool: &Tool,
        points: impl Into<Points<'a>>,
        obstacles: &[Obstacle],
        options: &Options,
    ) -> Result<Self, CollisionError> {
        let (scene, _) = Scene::prepare(robot, arm, tool, &points.into(), obstacles, options)?;
        Ok(Self::over(arm.clone(), scene))
    }

    /// The check in a scene that is prepared.
    pub(crate) fn over(arm: Arm, scene: Scene) -> Self {
        let [tree, keep_out] =
            [&scene.points.points, &scene.points.keep_out].map(|points| Tree::new(points));
        Self { arm, scene, tree, keep_out }
    }

    pub(crate) fn scene(&self) -> &Scene {
        &self.scene
    }

    pub(crate) fn arm(&self) -> &Arm {
        &self.arm
    }

    pub(crate) fn tree(&self) -> &Tree {
        &self.tree
    }

    /// The links whose shapes are fitted capsules: what is found of them is a guess.
    #[must_use]
    pub fn guessed_links(&self) -> &[String] {
        &self.scene.guessed
    }

    /// The links that meet what carries the robot in every posture, each with what it meets: they are
    /// not held against it.
    #[must_use]
    pub fn grounded_links(&self) -> BTreeSet<[String; 2]> {
        let Scene { grounded, parts, obstacles, .. } = &self.scene;
        let names =
            |&(part, i): &(usize, usize)| [parts[part].name.clone(), obstacles[i].name.clone()];
        grounded.iter().map(names).collect()
    }

    /// Whether everything keeps its margin at the joint vector `q`. \[rad\] or \[m\] One with NaN or ∞
    /// is not free.
    #[must_use]
    pub fn is_free(&self, q: &JointVector, contact: ToolContact) -> bool {
        q.iter().all(|x| x.is_finite()) && self.first_hit(q, contact).is_none()
    }

    /// The first pair found too near at the joint vector `q` \[rad\] or \[m\], moving parts only.
    #[must_use]
    pub fn first_hit(&self, q: &JointVector, contact: ToolContact) -> Option<Hit> {
        self.hits(q, contact, 1).pop()
    }

    /// The first pairs found too near, at most so many; of a part and the points only the first of them.
    #[must_use]
    pub fn hits(&self, q: &JointVector, contact: ToolContact, most: usize) -> Vec<Hit> {
        let scene = &self.scene;
        let poses = poses(&scene.parts, scene.links, &self.arm, q);
        let bounds = self.bounds(&poses);
        let moving: Vec<usize> = (0..poses.len()).filter(|&i| scene.moves[i]).collect();
        let pairs = self.pair_hits(&poses, &bounds);
        let obstacles = self.obstacle_hits(&poses, &bounds, &moving, true);
        let points = self.point_hits(q, &poses, &bounds, &moving, contact);
        let may_touch = contact == ToolContact::Allowed;
        let keep_out = may_touch.then(|| self.keep_out_hits(&poses, &bounds)).into_iter().flatten();
        pairs.chain(obstacles).chain(keep_out).chain(points).take(most).collect()
    }

    /// The pad too near to a point that not even it may touch.
    fn keep_out_hits(&self, poses: &[Pose], bounds: &[Aabb]) -> impl Iterator<Item = Hit> {
        let scene = &self.scene;
        let margin = scene.margins.of_keep_out(&scene.tool);
        let pads = (0..poses.len()).filter(|&i| scene.parts[i].is_pad);
        pads.filter_map(move |i| {
            let shape = &*scene.parts[i].shape;
            let around = bounds[i].loosened(margin);
            let corner = |v: Vec3| Point3::new(v.x, v.y, v.z);
            self.keep_out.find(&corner(around.mins), &corner(around.maxs), |index| {
                let point = scene.points.keep_out[index];
                let distance = signed_distance(shape, &poses[i], &point);
                let (link, with) = (scene.parts[i].name.clone(), With::KeepOut(point));
                breaks(distance, margin).then_some(Hit { link, with, distance, margin })
            })
        })
    }

    fn pair_hits(&self, poses: &[Pose], bounds: &[Aabb]) -> impl Iterator<Item = Hit> {
        let scene = &self.scene;
        let margin = scene.margins.self_clearance;
        scene.pairs.checked.iter().filter_map(move |&(a, b)| {
            if are_apart(&bounds[a], &bounds[b], margin) {
                return None;
            }
            let (first, second) = (&scene.parts[a], &scene.parts[b]);
            let distance = distance(&poses[a], &*first.shape, &poses[b], &*second.shape);
            let with = || With::Link(second.name.clone());
            breaks(distance, margin).then(|| Hit {
                link: first.name.clone(),
                with: with(),
                distance,
                margin,
            })
        })
    }

    /// The axis-aligned bounds of each part.
    pub(crate) fn bounds(&self, poses: &[Pose]) -> Vec<Aabb> {
        let parts = self.scene.parts.iter().zip(poses);
        parts.map(|(part, pose)| part.shape.compute_aabb(pose)).collect()
    }

    /// The first part that does not move with the arm (base, torso, other arm) and is too near to
    /// a point or to an obstacle that does not carry the robot.
    #[must_use]
    pub fn stance_hit(&self) -> Option<Hit> {
        let scene = &self.scene;
        let q = self.arm.home();
        let poses = poses(&scene.parts, scene.links, &self.arm, &q);
        let bounds = self.bounds(&poses);
        let fixed: Vec<usize> = (0..poses.len()).filter(|&i| !scene.moves[i]).collect();
        let points = self.point_hits(&q, &poses, &bounds, &fixed, ToolContact::Forbidden);
        self.obstacle_hits(&poses, &bounds, &fixed, false).chain(points).next()
    }

    fn obstacle_hits(
        &self,
        poses: &[Pose],
        bounds: &[Aabb],
        parts: &[usize],
        with_floor: bool,
    ) -> impl Iterator<Item = Hit> {
        let scene = &self.scene;
        let margin = scene.margins.environment;
        let obstacles = scene.obstacles.iter().enumerate();
        let looked = obstacles.filter(move |(_, obstacle)| with_floor || !obstacle.carries_robot);
        looked.flat_map(move |(index, obstacle)| {
            let at = pose(&obstacle.pose);
            let around = obstacle.shape.compute_aabb(&at);
            let free = move |&&i: &&usize| !scene.grounded.contains(&(i, index));
            parts.iter().filter(free).filter_map(move |&i| {
                if are_apart(&bounds[i], &around, margin) {
                    return None;
                }
                let shape = &*scene.parts[i].shape;
                let distance = distance(&poses[i], shape, &at, &*obstacle.shape);
                breaks(distance, margin).then(|| {
                    let link = scene.parts[i].name.clone();
                    let with = With::Obstacle(obstacle.name.clone());
                    Hit { link, with, distance, margin }
                })
            })
        })
    }

    fn point_hits(
        &self,
        q: &JointVector,
        poses: &[Pose],
        bounds: &[Aabb],
        parts: &[usize],
        contact: ToolContact,
    ) -> impl Iterator<Item = Hit> {
        let scene = &self.scene;
        let (tool, margins) = (&scene.tool, &scene.margins);
        let to_contact = (self.arm.tip_pose(q) * tool.contact_in_tip()).inverse();
        let [half_x, half_y] = tool.half_sides();
        let in_prism = move |p: &Point3<f64>| {
            let p = to_contact * p;
            p.x.abs() <= half_x + margins.contact_growth
                && p.y.abs() <= half_y + margins.contact_growth
                && (-tool.press_max..=margins.contact_front).contains(&p.z)
        };
        parts.iter().filter_map(move |&i| {
            let is_in_use = contact == ToolContact::Allowed && tool.touches();
            let may_touch = is_in_use && scene.at_tip[i];
            let is_pressed = may_touch && scene.parts[i].is_pad;
            let margin = match (may_touch, is_pressed) {
                (true, true) => margins.environment.min(margins.contact_growth),
                (true, false) => margins.environment.min(margins.contact_clearance),
                (false, _) => margins.environment,
            };
            let shape = &*scene.parts[i].shape;
            // Points outside the shape's bounds, grown by the margin, are farther than it.
            let bounds = bounds[i].loosened(margin);
            let corner = |v: Vec3| Point3::new(v.x, v.y, v.z);
            let hit = self.tree.find(&corner(bounds.mins), &corner(bounds.maxs), |index| {
                let p = &scene.points.points[index];
                let distance = signed_distance(shape, &poses[i], p);
                let gives_way = is_pressed && (!scene.points.is_firm(index) || in_prism(p));
                (breaks(distance, margin) && !gives_way).then_some((index, distance))
            });
            hit.map(|(index, distance)| {
                let link = scene.parts[i].name.clone();
                Hit { link, with: scene.points.name(index), distance, margin }
            })
        })
    }
}

impl std::fmt::Debug for Exact {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Exact")
            .field("parts", &self.scene.parts.len())
            .field("pairs", &self.scene.pairs.checked.len())
            .field("obstacles", &self.scene.obstacles.len())
            .field("points", &self.scene.points.points.len())
            .finish_non_exhaustive()
    }
}

/// Whether bounds alone show that two shapes keep a margin. \[m\]
pub(crate) fn are_apart(a: &Aabb, b: &Aabb, margin: f64) -> bool {
    let need = margin + ROUNDING;
    let (over, under) = (a.mins - b.maxs, b.mins - a.maxs);
    over.max_element().max(under.max_element()) > need
}

/// NaN breaks every margin.
pub(crate) fn breaks(distance: f64, margin: f64) -> bool {
    distance < margin || distance.is_nan()
}

/// Distance from a shape to a point of the root frame, negative inside. \[m\]
pub(crate) fn signed_distance(shape: &dyn Shape, at: &Pose, p: &Point3<f64>) -> f64 {
    let projection = shape.project_point(at, Vec3::new(p.x, p.y, p.z), false);
    let distance = (projection.point - Vec3::new(p.x, p.y, p.z)).length();
    if projection.is_inside { -distance } else { distance }
}
