//! What the plans of these tests are made of and judged by.

use std::sync::OnceLock;

use nalgebra::{Isometry3, Matrix6, Vector3, Vector6};
use nullsweep_collision::{Obstacle, Options, World};
use nullsweep_planner::cost::velocities;
use nullsweep_planner::pipeline::{Job, StanceChoice, run};
use nullsweep_planner::plan::{Plan, PlanKnot};
use nullsweep_planner::progress::Silent;
use nullsweep_planner::timing::{Limits, accelerate, bang_bang};
use nullsweep_planner::verify::{Given, Verification, VerifyError, verify};
use nullsweep_planner::workcell::{Scene, Stance, Workcell};
use nullsweep_robot::{Arm, ArmSpec, Geometry, JointVector, Robot, Side, Tool};

/// A real plan for the chair's seat and all that it was made for.
pub(crate) struct Stage {
    /// In its stance.
    pub(crate) arm: Arm,
    /// In the floor frame.
    pub(crate) scene: Scene,
    /// The plan as it was made, with bang-bang velocity, and what the pipeline said of it.
    pub(crate) whole: Plan,
    pub(crate) said: Verification,
    /// Its first knots, so that a look at them is quick.
    pub(crate) bang: Plan,
    /// The same with limited acceleration.
    pub(crate) smooth: Plan,
}

pub(crate) fn stage() -> &'static Stage {
    static STAGE: OnceLock<Stage> = OnceLock::new();
    STAGE.get_or_init(|| {
        let mut scene = crate::common::seat();
        // The spoilt postures were made for a place that the simulated camera has not seen.
        scene.unseen.clear();
        let held = vec![("torso_lift_joint".to_owned(), 0.1)];
        let stance = Stance { base: [-0.04, 0.574, 5.607], height: 0.0, held };
        let to_root = stance.pose().inverse();
        let job = Job {
            stance: StanceChoice::Given(stance),
            ik_samples: 12,
            refinements: 0,
            ..Job::new(ArmSpec::pr2(Side::Right))
        };
        let robot = Robot::pr2();
        let made = run(&robot, &scene, &job, &Silent).expect("a plan");
        let there = scene.transformed(&to_root);
        let (points, obstacles) = (there.points(), &there.obstacles);
        let world =
            World::new(&robot, &made.arm, &job.tool, points, obstacles, &job.collision).unwrap();
        let cell = Workcell { arm: &made.arm, tool: &job.tool, world: &world };
        let mut bang = made.plan.clone();
        bang.knots.truncate(200);
        // What the pipeline does for the same job with the other profile.
        let smooth = accelerate(&bang, cell, &Limits::of(&made.arm, None), &[]);
        Stage {
            scene,
            whole: made.plan,
            said: made.figures.verification,
            bang,
            smooth,
            arm: made.arm,
        }
    })
}

/// The stage's scene with a box in it, placed in the root frame.
pub(crate) fn scene_with(name: &str, half_extents: Vector3<f64>, centre: Vector3<f64>) -> Scene {
    let s = stage();
    let shape = Geometry::Box { half_extents }.into();
    let pose = s.bang.base_pose() * Isometry3::translation(centre.x, centre.y, centre.z);
    let more = Obstacle { name: name.into(), shape, pose, carries_robot: false };
    let mut scene = s.scene.clone();
    scene.obstacles.push(more);
    scene
}

pub(crate) fn judge(plan: &Plan, scene: &Scene) -> Verification {
    look(plan, scene).expect("it can be checked")
}

pub(crate) fn look(plan: &Plan, scene: &Scene) -> Result<Verification, VerifyError> {
    let (robot, arm) = (&Robot::pr2(), &ArmSpec::pr2(Side::Right));
    let given = Given { robot, arm, scene, collision: &Options::default() };
    verify(plan, given, &|| ())
}

pub(crate) fn spoilt(plan: &Plan, spoil: impl FnOnce(&mut [PlanKnot])) -> Plan {
    let mut plan = plan.clone();
    spoil(&mut plan.knots);
    plan
}

/// The plan through the same joint vectors as fast as the limits allow.
pub(crate) fn retimed(mut plan: Plan) -> Plan {
    let path: Vec<JointVector> = plan.knots.iter().map(|k| k.q).collect();
    let times = bang_bang(&path, &velocities(&stage().arm, None));
    plan.knots.iter_mut().zip(times).for_each(|(knot, time)| knot.time_ns = time);
    plan
}

/// The segment before knot `k` takes so many times as long, all later ones as long as before.
pub(crate) fn stretched(plan: &Plan, k: usize, factor: f64) -> Plan {
    spoilt(plan, |knots| {
        let length = knots[k].time_ns - knots[k - 1].time_ns;
        let late = (length as f64 * factor) as u64;
        knots[k..].iter_mut().for_each(|knot| knot.time_ns = knot.time_ns - length + late);
    })
}

/// The plan with a way from its start to these joint vectors and back.
pub(crate) fn detour(plan: &Plan, over: &[JointVector]) -> Plan {
    let mut plan = plan.clone();
    let start = PlanKnot { line: None, patch: None, ..plan.knots[0] };
    let at = |&q: &JointVector| {
        let mut knot = start;
        knot.q = q;
        knot
    };
    let way: Vec<_> = over.iter().map(at).chain([start]).collect();
    plan.knots.splice(1..1, way);
    retimed(plan)
}

pub(crate) fn joint(name: &str) -> usize {
    stage().arm.joint_names().iter().position(|n| n == name).expect("a joint of the arm")
}

/// The start posture, some joints elsewhere.
pub(crate) fn posture(joints: &[(&str, f64)]) -> JointVector {
    let mut q = stage().bang.knots[0].q;
    joints.iter().for_each(|(name, at)| q[joint(name)] = *at);
    q
}

pub(crate) fn pad(q: &JointVector) -> Isometry3<f64> {
    stage().arm.tip_pose(q) * Tool::default().contact_in_tip()
}

pub(crate) fn pad_centre(q: &JointVector) -> Vector3<f64> {
    pad(q).translation.vector
}

/// The joint vector near `q` that holds the tool the same way, but so far away.
pub(crate) fn moved(mut q: JointVector, by: Vector3<f64>) -> JointVector {
    let arm = &stage().arm;
    let start = arm.tip_pose(&q);
    for _ in 0..50 {
        let (tip, jacobian) = arm.tip_pose_and_jacobian(&q);
        let way = start.translation.vector + by - tip.translation.vector;
        let turn = (start.rotation * tip.rotation.inverse()).scaled_axis();
        let error = Vector6::new(way.x, way.y, way.z, turn.x, turn.y, turn.z);
        let square = jacobian * jacobian.transpose() + Matrix6::identity() * 1e-6;
        let step = jacobian.transpose() * square.lu().solve(&error).expect("regular");
        q.iter_mut().zip(&step).for_each(|(q, step)| *q += step);
    }
    let off = (arm.tip_pose(&q).translation.vector - start.translation.vector - by).norm();
    assert!(off < 1e-5, "the tool cannot go there: {off} m");
    q
}

/// A knot in the middle of a plan, on a straight part of its line.
pub(crate) fn on_the_line(plan: &Plan) -> usize {
    let straight = |k: &usize| {
        let line = |k| plan.line(k).map(|p| p.coords);
        let (Some(a), Some(b), Some(c)) = (line(k - 2), line(*k), line(k + 2)) else {
            return false;
        };
        let (before, after) = (b - a, c - b);
        before.norm() > 2e-3 && after.norm() > 2e-3 && before.angle(&after) < 0.02
    };
    (plan.knots.len() / 2..plan.knots.len() - 2).find(straight).expect("a straight part")
}

/// Where a link's frame is.
pub(crate) fn link(name: &str, q: &JointVector) -> Vector3<f64> {
    let robot = Robot::pr2();
    let index = robot.links().iter().position(|link| link.name == name).expect("a link");
    let mut poses = vec![Isometry3::identity(); robot.links().len()];
    stage().arm.link_poses(q, &mut poses);
    poses[index].translation.vector
}
