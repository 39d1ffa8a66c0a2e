//! Where the robot stands before the object, and how its held joints are set.

use nalgebra::{Isometry3, Point3, Rotation2, Vector2, Vector3};
use nullsweep_robot::{
    Arm, ArmError, CollisionShape, Geometry, JointVector, Robot, Solutions, Tool, wrap,
};
use nullsweep_surface::Patch;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::contact::{contact_pose, direction};
use super::sample::redundancies;
use super::scene::Scene;

/// The pose of the robot's root frame on the floor and the positions of joints outside the arm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stance {
    /// x, y \[m\] and yaw \[rad\] of the root frame in the floor frame.
    pub base: [f64; 3],
    /// How high above the floor the root frame is: a stand's height. \[m\]
    #[serde(default)]
    pub height: f64,
    /// Held joints by name, for instance the torso's height. \[rad\] or \[m\]
    pub held: Vec<(String, f64)>,
}

impl Stance {
    /// The root frame's pose in the floor frame.
    #[must_use]
    pub fn pose(&self) -> Isometry3<f64> {
        let [x, y, yaw] = self.base;
        Isometry3::new(Vector3::new(x, y, self.height), Vector3::z() * yaw)
    }

    /// The arm with this stance's held joints.
    ///
    /// # Errors
    /// Names a held joint that the robot does not have.
    pub fn bind(&self, arm: &Arm) -> Result<Arm, ArmError> {
        let held: Vec<(&str, f64)> = self.held.iter().map(|(n, v)| (n.as_str(), *v)).collect();
        arm.with_held(&held)
    }
}

/// A place on the floor for people: metres, and a yaw in degrees within ±180.
#[must_use]
pub fn told(&[x, y, yaw]: &[f64; 3]) -> String {
    format!("{x:.3} m, {y:.3} m, {:.1}°", wrap(yaw).to_degrees())
}

/// What the search for a stance tries.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StanceSearch {
    /// The place of the robot, in its root frame, whose distance is meant: 0, 0 or where the arm's
    /// first axis is. \[m\]
    pub pivot: [f64; 2],
    /// Its distances from the object's centre on the floor. \[m\]
    pub distances: Vec<f64>,
    /// Directions around the object, evenly over a full turn.
    pub bearings: usize,
    /// Yaw angles, 0 = the robot's x axis through the object's centre. \[rad\]
    pub yaws: Vec<f64>,
    /// The joint that lifts the arm, if the robot has it, and the positions to try. \[m\]
    pub lift: Option<(String, Vec<f64>)>,
    /// Held joints that are given. \[rad\] or \[m\]
    pub held: Vec<(String, f64)>,
    /// Most patches that a candidate is judged by.
    pub patches: usize,
    /// Candidates that are kept for an exact look, best first.
    pub finalists: usize,
}

impl Default for StanceSearch {
    /// For the PR2: 0.35–1.15 m away, four heights of its torso.
    fn default() -> Self {
        Self {
            pivot: [0.0; 2],
            distances: (0..11).map(|i| 0.35 + 0.08 * f64::from(i)).collect(),
            bearings: 32,
            yaws: [-60.0, -40.0, -20.0, 0.0, 20.0, 40.0, 60.0].map(f64::to_radians).to_vec(),
            lift: Some(("torso_lift_joint".into(), vec![0.02, 0.1, 0.2, 0.3])),
            held: Vec::new(),
            patches: 60,
            finalists: 24,
        }
    }
}

/// Configurations by which an arm's reach is measured.
const REACH_SAMPLES: usize = 2000;
/// Distances from the object's centre that are tried, as shares of the reach.
const NEAREST: f64 = 0.3;
const FARTHEST: f64 = 1.1;
const DISTANCES: u32 = 11;
/// A first joint about the vertical with such a range makes up for any yaw. \[rad\]
const ALL_ROUND: f64 = 5.0;

impl StanceSearch {
    /// For an arm: as far from the object as it reaches, about its first axis. The PR2's where
    /// there is its torso.
    #[must_use]
    pub fn of(robot: &Robot, arm: &Arm, tool: &Tool) -> Self {
        let search = Self::default();
        let lifts = |(name, _): &(String, _)| arm.held_joints().iter().any(|h| h.name == *name);
        if search.lift.as_ref().is_some_and(lifts) {
            return search;
        }
        let mut poses = vec![Isometry3::identity(); robot.links().len()];
        arm.link_poses(&JointVector::ZERO, &mut poses);
        let pivot = poses[arm.moving_links()[0]].translation.vector;
        let pad = tool.on(arm);
        let reach = (0..REACH_SAMPLES)
            .map(|k| (pad.centre(&arm.spread(k)).coords - pivot).norm())
            .fold(0.0, f64::max);
        let share =
            |i: u32| NEAREST + (FARTHEST - NEAREST) * f64::from(i) / f64::from(DISTANCES - 1);
        let turns_all_round = arm.jacobian(&JointVector::ZERO)[(5, 0)].abs() > 0.99
            && arm.limits()[0].upper - arm.limits()[0].lower > ALL_ROUND;
        Self {
            pivot: [pivot.x, pivot.y],
            distances: (0..DISTANCES).map(|i| reach * share(i)).collect(),
            yaws: if turns_all_round { vec![0.0] } else { search.yaws },
            lift: None,
            ..search
        }
    }
}

/// A stance with the share of the patches' points that have inverse kinematics solutions inside
/// the margined limits, collisions not yet looked at. A patch counts in full if it has solutions
/// at three redundancy values: one alone hardly ever leads on to the next patch.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The stance.
    pub stance: Stance,
    /// 0…1.
    pub share: f64,
}

/// Redundancy values that a patch is tried with.
const REDUNDANCIES: usize = 12;
/// How many of them must have a solution for a patch to count in full.
const ROBUST: usize = 3;
/// Cubes of which one point shows where the standing body may not be. \[m\]
pub(crate) const OUTLINE: f64 = 0.04;
/// Space that the standing body keeps from what is there. \[m\]
const BODY_SPACE: f64 = 0.03;
/// Half of the width of a body that is only known by its meshes. \[m\]
const BODY_WIDTH: f64 = 0.08;

/// Stances on a ring of candidates around the object, best first, at most
/// `search.finalists`; empty where none reaches anything. Scene and patches in the floor frame.
///
/// # Errors
/// Passes on a held joint's name that the robot does not have.
pub fn candidates(
    robot: &Robot,
    arm: &Arm,
    tool: &Tool,
    scene: &Scene,
    patches: &[Patch],
    search: &StanceSearch,
) -> Result<Vec<Candidate>, ArmError> {
    let centre = centroid(&scene.surface.points);
    let mut stances = Vec::new();
    let lift =
        search.lift.as_ref().filter(|(name, _)| arm.held_joints().iter().any(|h| &h.name == name));
    let heights: Vec<Vec<(String, f64)>> = match lift {
        Some((name, values)) => values
            .iter()
            .map(|&v| search.held.iter().cloned().chain([(name.clone(), v)]).collect())
            .collect(),
        None => vec![search.held.clone()],
    };
    for held in heights {
        let bound = Stance { base: [0.0; 3], height: 0.0, held: held.clone() }.bind(arm)?;
        let body = body_boxes(robot, &bound);
        for &distance in &search.distances {
            for b in 0..search.bearings {
                let bearing = std::f64::consts::TAU * b as f64 / search.bearings as f64;
                for &yaw in &search.yaws {
                    let turn = bearing + std::f64::consts::PI + yaw;
                    let pivot = Rotation2::new(turn) * Vector2::from(search.pivot);
                    let base = [
                        centre.x + distance * libm::cos(bearing) - pivot.x,
                        centre.y + distance * libm::sin(bearing) - pivot.y,
                        wrap(turn),
                    ];
                    stances.push((
                        Stance { base, height: 0.0, held: held.clone() },
                        bound.clone(),
                        body.clone(),
                    ));
                }
            }
        }
    }
    let judged = spread(patches, search.patches);
    let total: usize = judged.iter().map(|p| p.points.len()).sum();
    let sparse = scene.outline(OUTLINE);
    let values = redundancies(arm.ik().redundancy_range(), REDUNDANCIES);
    let mut found: Vec<Candidate> = stances
        .par_iter()
        .filter_map(|(stance, arm, body)| {
            let from_floor = stance.pose().inverse();
            if in_the_way(stance, body, &sparse) {
                return None;
            }
            let reached: usize = judged
                .iter()
                .map(|patch| patch.points.len() * solved(arm, tool, patch, &from_floor, &values))
                .sum();
            let share = reached as f64 / (ROBUST * total) as f64;
            (reached > 0).then(|| Candidate { stance: stance.clone(), share })
        })
        .collect();
    // The sort is stable and the candidates stand in a fixed order: ties are deterministic.
    found.sort_by(|a, b| b.share.total_cmp(&a.share));
    found.truncate(search.finalists);
    Ok(found)
}

/// At how many redundancy values the patch has a solution inside the margined limits, at the
/// better of two headings, counted up to [`ROBUST`].
fn solved(
    arm: &Arm,
    tool: &Tool,
    patch: &Patch,
    from_floor: &Isometry3<f64>,
    values: &[f64],
) -> usize {
    let mut solutions = Solutions::new();
    let at = |heading: f64| {
        let travel = direction(&patch.normal, heading);
        let contact = contact_pose(&patch.centre, &patch.normal, &travel, tool.stand_off);
        let tip = from_floor * contact * tool.contact_in_tip().inverse();
        values
            .iter()
            .filter(|&&value| {
                arm.ik().solve(&tip, value, &mut solutions);
                solutions.iter().any(|s| arm.within_margins(&s.q))
            })
            .take(ROBUST)
            .count()
    };
    [0.0, std::f64::consts::FRAC_PI_2].map(at).into_iter().max().unwrap_or(0)
}

/// At most `count` patches, evenly picked.
fn spread(patches: &[Patch], count: usize) -> Vec<&Patch> {
    let step = patches.len().div_ceil(count.max(1)).max(1);
    patches.iter().step_by(step).collect()
}

fn centroid(points: &[Point3<f64>]) -> Point3<f64> {
    let sum: Vector3<f64> = points.iter().map(|p| p.coords).sum();
    Point3::from(sum / points.len().max(1) as f64)
}

/// Axis-aligned boxes in the root frame around the shapes that do not move with the arm, and those of
/// its first link, which turns in place.
pub(crate) fn body_boxes(robot: &Robot, arm: &Arm) -> Vec<(Point3<f64>, Point3<f64>)> {
    let mut poses = vec![Isometry3::identity(); robot.links().len()];
    arm.link_poses(&arm.home(), &mut poses);
    let mut boxes = Vec::new();
    for (i, link) in robot.links().iter().enumerate() {
        if arm.moving_links().iter().skip(1).any(|moving| *moving == i) {
            continue;
        }
        boxes.extend(link.collisions.iter().filter_map(|shape| extent(&poses[i], shape)));
    }
    if boxes.is_empty() {
        // Meshes alone: something stands from the root to the first joint.
        let joint = poses[arm.moving_links()[0]].translation.vector;
        let around = Vector3::new(BODY_WIDTH, BODY_WIDTH, 0.0);
        let (low, high) = (Vector3::zeros().inf(&joint), Vector3::zeros().sup(&joint));
        boxes.push((Point3::from(low - around), Point3::from(high + around)));
    }
    boxes
}

/// The box around one primitive; `None` for a mesh, which the exact look at the finalists sees.
fn extent(link: &Isometry3<f64>, shape: &CollisionShape) -> Option<(Point3<f64>, Point3<f64>)> {
    let half = match &shape.geometry {
        Geometry::Box { half_extents } => *half_extents,
        Geometry::Cylinder { radius, half_length } => Vector3::new(*radius, *radius, *half_length),
        Geometry::Capsule { radius, half_length } => {
            Vector3::new(*radius, *radius, half_length + radius)
        }
        Geometry::Sphere { radius } => Vector3::repeat(*radius),
        Geometry::Mesh { .. } => return None,
    };
    let pose = link * shape.origin;
    let rotation = pose.rotation.to_rotation_matrix();
    let reach = rotation.matrix().abs() * half + Vector3::repeat(BODY_SPACE);
    let middle = Point3::from(pose.translation.vector);
    Some((middle - reach, middle + reach))
}

/// Whether one of the points is where the standing body would be.
pub(crate) fn in_the_way(
    stance: &Stance,
    body: &[(Point3<f64>, Point3<f64>)],
    points: &[Point3<f64>],
) -> bool {
    // No turn takes the body out of this circle.
    let corner = |(low, high): &(Point3<f64>, Point3<f64>)| {
        let [x, y] = [0, 1].map(|i| low[i].abs().max(high[i].abs()));
        x * x + y * y
    };
    let reach = body.iter().map(corner).fold(0.0, f64::max);
    let from_floor = stance.pose().inverse();
    let [x, y, _] = stance.base;
    let near = |p: &&Point3<f64>| (p.x - x).powi(2) + (p.y - y).powi(2) <= reach;
    points.iter().filter(near).any(|p| hits(body, &(from_floor * p)))
}

fn hits(boxes: &[(Point3<f64>, Point3<f64>)], p: &Point3<f64>) -> bool {
    boxes.iter().any(|(low, high)| (0..3).all(|i| (low[i]..=high[i]).contains(&p[i])))
}

#[cfg(test)]
mod tests {
    use nullsweep_robot::{ArmSpec, Side};

    use super::*;

    #[test]
    fn the_body_is_all_that_stands_still_and_the_first_link_that_turns_in_place() {
        let robot = Robot::pr2();
        let arm = robot.arm(&ArmSpec::pr2(Side::Right)).unwrap();
        let body = body_boxes(&robot, &arm);
        let mut poses = vec![Isometry3::identity(); robot.links().len()];
        arm.link_poses(&arm.home(), &mut poses);
        // The middle of every shape of a link.
        let middles = |link: usize| {
            let shapes = robot.links()[link].collisions.iter();
            shapes.map(|shape| poses[link] * shape.origin * Point3::origin()).collect::<Vec<_>>()
        };
        let first = arm.moving_links()[0];
        assert!(!middles(first).is_empty());
        assert!(middles(first).iter().all(|p| hits(&body, p)), "the first link has no place");
        let shaped = |link: &&usize| !middles(**link).is_empty();
        let last = *arm.moving_links().iter().rev().find(shaped).expect("a hand");
        assert_ne!(last, first);
        assert!(middles(last).iter().all(|p| !hits(&body, p)), "the hand is no body");

        // A point in the first link is in the way of that stance, wherever it stands and turns.
        for turn in 0..12 {
            let yaw = 0.55 * f64::from(turn);
            let stance = Stance { base: [1.3, -0.4, yaw], height: 0.1, held: Vec::new() };
            let there: Vec<Point3<f64>> =
                middles(first).iter().map(|p| stance.pose() * p).collect();
            assert!(in_the_way(&stance, &body, &there));
            let above: Vec<_> = there.iter().map(|p| p + Vector3::z() * 3.0).collect();
            assert!(!in_the_way(&stance, &body, &above));
        }
        // Whether points are in the way is told as if all of them were looked at.
        let mut found = 0;
        for n in 0..4000 {
            let f = |a: f64| (f64::from(n) * a).fract();
            let p =
                Point3::new(3.0 * f(0.819_173) - 1.5, 3.0 * f(0.671_043) - 1.5, 2.0 * f(0.5497));
            let stance = Stance { base: [0.2, 0.1, 6.0 * f(0.73)], height: 0.0, held: Vec::new() };
            let wanted = hits(&body, &(stance.pose().inverse() * p));
            assert_eq!(in_the_way(&stance, &body, &[p]), wanted, "{p}");
            found += usize::from(wanted);
        }
        assert!(found > 100, "{found}");
    }
}
