//! The check as a whole.

use nalgebra::{Isometry3, Point3};
use nullsweep_collision::{CollisionError, Exact, Options};
use nullsweep_robot::{Arm, ArmError, ArmSpec, Robot};
use nullsweep_surface::{Scan, Surface};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::collisions::{collisions, standing};
use super::keep_out::keep_out;
use super::kinematics::kinematics;
use super::press::{Press, press};
use super::slip::slip;
use super::stand_off::{StandOff, stand_off};
use super::violation::{Violation, ViolationKind};
use crate::plan::{Plan, PlanError, Stretch, Trajectory};
use crate::regions::{Label, Mark, RegionFigures};
use crate::sweep::{Pad, Sight, coverage, pad_motion, passes_over, percentile, solids};
use crate::workcell::Scene;

/// The figures of a verified plan.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Verification {
    /// Everything found wrong, in the order of the knots.
    pub violations: Vec<Violation>,
    /// Joint vectors at which collisions were looked for.
    pub collision_checks: usize,
    /// Farthest that the pad centre leaves the planned line between knots. \[m\]
    pub line_deviation_max_m: f64,
    /// 95th percentile of the pad centre's distance from the scanned surface, less the stand-off of a
    /// tool that works from afar, over the motion on the surface. \[m\]
    pub scan_distance_p95_m: f64,
    /// The largest of those. \[m\]
    pub scan_distance_max_m: f64,
    /// How the pad lies on the surface.
    #[serde(flatten)]
    pub press: Press,
    /// How a tool that works from afar stands before it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stand_off: Option<StandOff>,
    /// What the arm was held against.
    pub against: Against,
    /// Share of all scanned points that are swept, by this plan or by those that led to it.
    pub coverage_all: f64,
    /// Share of the points of reachable patches that are so swept.
    pub coverage_reachable: f64,
    /// What came of each region.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub regions: Vec<RegionFigures>,
    /// For each scanned point whether it is swept.
    #[serde(skip)]
    pub swept: Vec<bool>,
}

/// What the arm was held against: how many of each.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Against {
    /// Points of the surface.
    pub surface_points: usize,
    /// Measured points beside it.
    pub other_points: usize,
    /// Measurements that the surface was made of.
    pub raw_points: usize,
    /// Points on the border of what no view has seen; 0: unseen space counts as free.
    pub unseen_points: usize,
    /// Solid things.
    pub obstacles: usize,
    /// Points that the tool keeps out of.
    #[serde(default)]
    pub keep_out_points: usize,
    /// Links whose meshes are missing: capsules stand for them, a guess, so that what was found
    /// says nothing of the real ones.
    pub guessed_links: Vec<String>,
    /// Links that meet what the robot stands on in every posture, each with what it meets: they are
    /// not held against it.
    pub grounded_links: Vec<[String; 2]>,
}

impl Against {
    /// What was left out, to be put behind the rest; empty if nothing was.
    #[must_use]
    pub fn but_for(&self) -> String {
        let pair = |[link, other]: &[String; 2]| format!(", but not {link} against the {other}");
        self.grounded_links.iter().map(pair).collect()
    }

    fn of(scene: &Scene, exact: &Exact) -> Self {
        Self {
            surface_points: scene.surface.points.len(),
            other_points: scene.surroundings.len(),
            raw_points: scene.raw.len(),
            unseen_points: scene.unseen.len(),
            obstacles: scene.obstacles.len(),
            keep_out_points: scene.keep_out.len(),
            guessed_links: exact.guessed_links().to_vec(),
            grounded_links: exact.grounded_links().into_iter().collect(),
        }
    }
}

/// What a plan is held against: the robot and the scene as they were given, none of what the search
/// made of them.
#[derive(Clone, Copy, Debug)]
pub struct Given<'a> {
    /// The robot.
    pub robot: &'a Robot,
    /// Its arm.
    pub arm: &'a ArmSpec,
    /// What is there, in the floor frame.
    pub scene: &'a Scene,
    /// Collision margins and meshes.
    pub collision: &'a Options,
}

/// Rounding between a point of a plan and the same point of its scene. \[m\]
const SAME_PLACE: f64 = 1e-6;

/// Why a plan cannot be checked.
#[derive(Debug, thiserror::Error)]
pub enum VerifyError {
    /// The arm cannot be made, or not with the plan's held joints.
    #[error(transparent)]
    Arm(#[from] ArmError),
    /// The collision check cannot be made.
    #[error(transparent)]
    Collision(#[from] CollisionError),
    /// The plan is of another robot or arm.
    #[error(
        "the plan is for {planned} with fingerprint {plan:016x}, the arm given is {found} with {arm:016x}"
    )]
    OtherArm {
        /// The plan's joints.
        planned: String,
        /// The plan's fingerprint of robot and arm.
        plan: u64,
        /// The arm's joints.
        found: String,
        /// The arm's fingerprint.
        arm: u64,
    },
    /// The plan cannot be sent to any executor, or gone through.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// The plan is of another scan.
    #[error("the plan was made for {planned} scanned points, the scene has {found}")]
    OtherScan {
        /// Points in the plan.
        planned: usize,
        /// Points in the scene.
        found: usize,
    },
    /// The plan was made for regions that are not given, or otherwise.
    #[error(
        "the plan was made for region {name}, {points} points: {}",
        found.map_or("there is no such region".into(), |n| format!("here it holds {n}"))
    )]
    OtherRegions {
        /// The first such region.
        name: String,
        /// Points of the surface that it held.
        points: usize,
        /// How many it holds in the scene; `None`: no region of its name and kind is there.
        found: Option<usize>,
    },
    /// Two plans that are to be gone along at once are not of one place of the robot.
    #[error("of two plans that go on at once each has its own place of {what}")]
    OtherPlace {
        /// What stands elsewhere: the base, or a held joint.
        what: String,
    },
    /// There is no motion.
    #[error("a plan that is to be gone along with another one has no motion")]
    NoMotion,
    /// The plan is of a scan as long, but elsewhere.
    #[error(
        "point {point} of the scan lies {distance_m:.4} m from where the plan has it: the scene is \
         another one, or placed otherwise"
    )]
    MovedScan {
        /// The first such point.
        point: usize,
        /// \[m\]
        distance_m: f64,
    },
}

/// Checks limits, times and collisions of a plan, and measures line, distance and swept coverage,
/// all from its knots. `tick` is called once a segment.
///
/// # Errors
/// The plan is of another robot or scan, or the collision check cannot be built. A plan that breaks
/// a rule is no error.
pub fn verify(
    plan: &Plan,
    given: Given<'_>,
    tick: &(dyn Fn() + Sync),
) -> Result<Verification, VerifyError> {
    let arm = arm_of(plan, given)?;
    plan.message_parts()?;
    let scene = given.scene.transformed(&plan.base_pose().inverse());
    let scan = &scene.surface;
    let is_scanned = !scan.points.is_empty();
    if is_scanned {
        same_scan(plan, scan)?;
    }
    // In the frame in which they are given: a point on a border is on the same side again.
    let labels = given.scene.regions.labels(&given.scene.surface.points);
    same_regions(plan, &scene.regions.marks(&labels))?;
    let mut violations = kinematics(plan, &arm);
    let is_finite = !violations.iter().any(|v| v.kind == ViolationKind::NotFinite);
    let bounded = plan.check_bounds();
    if violations.is_empty() {
        bounded?;
    } else if !is_finite || bounded.is_err() || plan.knots.len() < 2 {
        violations.sort_by_key(|v| v.knot);
        return Ok(Verification { violations, ..Verification::default() });
    }
    let (points, obstacles) = (scene.points(), &scene.obstacles);
    let exact = Exact::new(given.robot, &arm, &plan.tool, points, obstacles, given.collision)?;
    violations.extend(standing(&exact));
    let (collisions, collision_checks) = collisions(plan, &arm, &exact, tick);
    violations.extend(collisions);
    violations.extend(keep_out(plan, &arm, &scene.keep_out));
    violations.extend(slip(plan, &arm));
    let (stand_off, too_far) = stand_off(plan, &arm, scan);
    violations.extend(too_far);
    violations.sort_by_key(|v| v.knot);

    let pads = pad_motion(plan.trajectory(), &arm);
    let line_deviation_max_m = pads.iter().map(|p| p.deviation).fold(0.0, f64::max);
    let distances = if is_scanned { distances(plan, scan, &pads) } else { Vec::new() };
    let poses: Vec<Isometry3<f64>> = pads.iter().map(|p| p.pose).collect();
    let solids = solids(&scene, &plan.tool, given.collision)?;
    let sight = Sight::of(&scene, solids.as_ref());
    let swept = coverage::swept_by(sight, motions(plan), &arm);
    let share = |of: &dyn Fn(usize) -> bool| {
        let total = (0..swept.len()).filter(|&i| of(i)).count();
        let hit = (0..swept.len()).filter(|&i| of(i) && swept[i]).count();
        if total == 0 { 0.0 } else { hit as f64 / total as f64 }
    };
    Ok(Verification {
        violations,
        collision_checks,
        line_deviation_max_m,
        scan_distance_p95_m: percentile(&distances, 0.95),
        press: if plan.tool.touches() {
            press(&scene, &poses, &plan.tool)
        } else {
            Press::default()
        },
        stand_off,
        against: Against::of(&scene, &exact),
        scan_distance_max_m: distances.last().copied().unwrap_or(0.0),
        coverage_all: share(&|_| true),
        coverage_reachable: share(&|i| plan.surface[i].reachable),
        regions: by_region(plan, &arm, &scene, (sight, &labels)),
        swept,
    })
}

/// Whether a scan, in the root frame, is the one that a plan was made for.
///
/// # Errors
/// [`VerifyError::OtherScan`] or [`VerifyError::MovedScan`].
pub fn same_scan(plan: &Plan, scan: &Scan) -> Result<(), VerifyError> {
    let (planned, found) = (plan.surface.len(), scan.points.len());
    if planned != found {
        return Err(VerifyError::OtherScan { planned, found });
    }
    for (point, (sample, scanned)) in plan.surface.iter().zip(&scan.points).enumerate() {
        let distance_m = (Point3::from(sample.point) - scanned).norm();
        if distance_m > SAME_PLACE || distance_m.is_nan() {
            return Err(VerifyError::MovedScan { point, distance_m });
        }
    }
    Ok(())
}

/// Whether the regions that a plan was made for are there.
fn same_regions(plan: &Plan, found: &[Mark]) -> Result<(), VerifyError> {
    for Mark { name, kind, points } in &plan.regions {
        let found = found.iter().find(|f| f.name == *name && f.kind == *kind);
        let found = found.map(|f| f.points);
        if found != Some(*points) {
            return Err(VerifyError::OtherRegions { name: name.clone(), points: *points, found });
        }
    }
    Ok(())
}

/// All that was followed, and the plan's own motion.
fn motions(plan: &Plan) -> impl Iterator<Item = Trajectory<'_>> {
    plan.past.iter().map(Stretch::trajectory).chain([plan.trajectory()])
}

/// What came of each region: of this plan, and of those that led to it.
fn by_region(
    plan: &Plan,
    arm: &Arm,
    scene: &Scene,
    (sight, labels): (Sight<'_>, &[Label]),
) -> Vec<RegionFigures> {
    if scene.regions.is_empty() || labels.is_empty() {
        return Vec::new();
    }
    let passes = passes_over(sight, motions(plan), arm);
    let reachable: Vec<bool> = plan.surface.iter().map(|sample| sample.reachable).collect();
    RegionFigures::all(&scene.regions, labels, &passes, &reachable)
}

/// The arm as the plan has it: its held joints where the plan holds them.
pub(super) fn arm_of(plan: &Plan, given: Given<'_>) -> Result<Arm, VerifyError> {
    let held: Vec<(&str, f64)> = plan.held.iter().map(|h| (h.name.as_str(), h.position)).collect();
    let arm = given.robot.arm(given.arm)?.with_held(&held)?;
    if plan.joints != arm.joint_names() || plan.fingerprint != arm.fingerprint() {
        let (planned, found) = (plan.joints.join(", "), arm.joint_names().join(", "));
        let (plan, arm) = (plan.fingerprint, arm.fingerprint());
        return Err(VerifyError::OtherArm { planned, plan, found, arm });
    }
    Ok(arm)
}

/// Of the pad's centre from the scanned surface, less the stand-off where it has one, ascending. \[m\]
fn distances(plan: &Plan, scan: &Scan, pads: &[Pad]) -> Vec<f64> {
    let surface = Surface::new(scan);
    let mut distances: Vec<f64> = pads
        .par_iter()
        .map(|p| {
            if !plan.tool.touches() {
                return surface.distance(&(p.pose * Point3::new(0.0, 0.0, plan.tool.stand_off)));
            }
            let centre = Point3::from(p.pose.translation.vector);
            (surface.distance(&centre) - plan.tool.stand_off.max(0.0)).abs()
        })
        .collect();
    distances.sort_by(f64::total_cmp);
    distances
}

#[cfg(test)]
mod tests {
    use super::*;
    use nullsweep_robot::Tool;

    #[test]
    fn what_the_arm_was_not_held_against_is_named() {
        let robot = Robot::from_urdf_str(
            "<robot name='low'><link name='base'/>\
             <link name='turret'><collision><geometry><cylinder radius='0.1' length='0.1'/></geometry>\
             </collision></link><link name='boom'/>\
             <joint name='turn' type='revolute'><parent link='base'/><child link='turret'/>\
             <axis xyz='0 0 1'/><limit lower='-3' upper='3' velocity='1' effort='1'/></joint>\
             <joint name='lift' type='revolute'><parent link='turret'/><child link='boom'/>\
             <origin xyz='0 0 0.4'/><axis xyz='0 -1 0'/>\
             <limit lower='-0.5' upper='0.5' velocity='1' effort='1'/></joint></robot>",
        )
        .unwrap();
        let arm = robot.arm(&ArmSpec { base: "base".into(), tip: "boom".into() }).unwrap();
        let (tool, options) = (Tool::default(), Options::default());
        let of = |scene: &Scene| {
            let (points, obstacles) = (scene.points(), &scene.obstacles);
            let exact = Exact::new(&robot, &arm, &tool, points, obstacles, &options).unwrap();
            Against::of(scene, &exact)
        };
        let floor = of(&Scene::empty());
        assert_eq!(floor.grounded_links, [["turret".to_owned(), "floor".to_owned()]]);
        assert_eq!(floor.but_for(), ", but not turret against the floor");
        let nothing = of(&Scene::of_obstacles(Vec::new()));
        assert_eq!((nothing.grounded_links.len(), nothing.but_for()), (0, String::new()));
    }
}
