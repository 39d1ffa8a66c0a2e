//! Following an edge with one branch, and the detours where the even change of the redundancy
//! parameter is blocked: a wavy wall, small boxes hung about the arm at random.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};
use nullsweep_collision::{Obstacle, Options, ToolContact, World};
use nullsweep_planner::roadmap::{Edge, ToolPath, Track, TrackFailure};
use nullsweep_planner::workcell::{Sample, Workcell, contact_pose, direction, heading_of};
use nullsweep_robot::{
    Arm, ArmSpec, Geometry, JointVector, RedundantJoint, Robot, Side, Solutions, Tool,
};
use nullsweep_surface::SurfacePoint;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Length of an edge and distance of its stations. \[m\]
const LENGTH: f64 = 0.1;
const STEP: f64 = 0.006;

/// Of the tracks that go evenly so many are checked: exact checks are slow.
const CHECKED: usize = 40;

struct Setting {
    arm: Arm,
    tool: Tool,
    world: World,
    /// Where the wall stands before the arm. \[m\]
    depth: f64,
}

impl Setting {
    fn cell(&self) -> Workcell<'_> {
        Workcell { arm: &self.arm, tool: &self.tool, world: &self.world }
    }

    fn on_wall(&self, y: f64, z: f64) -> SurfacePoint {
        let slope = 0.25 * (5.0 * y).cos();
        let normal = UnitVector3::new_normalize(Vector3::new(-1.0, slope, 0.0));
        SurfacePoint { point: Point3::new(self.depth + 0.05 * (5.0 * y).sin(), y, z), normal }
    }

    /// The line along the wall from a place in a direction, and the samples at both ends at one
    /// redundancy value each.
    fn edge(&self, (y, z): (f64, f64), way: f64, values: [f64; 2]) -> (ToolPath, [Vec<Sample>; 2]) {
        let count = (LENGTH / STEP).ceil() as usize;
        let line: Vec<SurfacePoint> = (0..=count)
            .map(|k| {
                let gone = LENGTH * k as f64 / count as f64;
                self.on_wall(y + gone * way.cos(), z + gone * way.sin())
            })
            .collect();
        let heading = |at: usize, next: usize| {
            heading_of(&line[at].normal, &(line[next].point - line[next - 1].point))
        };
        let headings = [heading(0, 1), heading(count, count)];
        let ends = [0, 1].map(|i| {
            let at = line[i * count];
            let travel = direction(&at.normal, headings[i]);
            let pose = contact_pose(&at.point, &at.normal, &travel, self.tool.stand_off);
            let mut samples = Vec::new();
            self.cell().samples(&pose, headings[i], &[values[i]], &mut samples);
            samples
        });
        let [heading_a, heading_b] = headings;
        let edge = Edge { a: 0, b: 1, line, heading_a, heading_b, turn: 0.0 };
        (ToolPath::along(&edge, false, heading_a, heading_b, self.tool.stand_off), ends)
    }
}

fn setting(robot: &Robot, spec: &ArmSpec, tool: Tool, depth: f64, height: f64) -> Setting {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let arm = robot.arm(spec).expect("the arm");
    let wall: Vec<Point3<f64>> = (0..2000)
        .map(|_| {
            let y: f64 = rng.random_range(-0.6..0.4);
            let z = height + rng.random_range(-0.4..0.4);
            Point3::new(depth + 0.05 * (5.0 * y).sin() + rng.random_range(-0.002..0.002), y, z)
        })
        .collect();
    let boxes: Vec<Obstacle> = (0..30)
        .map(|n| Obstacle {
            name: format!("box {n}"),
            shape: Geometry::Box { half_extents: Vector3::repeat(0.01) }.into(),
            pose: Isometry3::translation(
                depth - rng.random_range(0.15..0.5),
                rng.random_range(-0.8..0.5),
                height + rng.random_range(-0.4..0.4),
            ),
            carries_robot: false,
        })
        .collect();
    let options = Options { fit_capsules: Some(0.04), ..Options::default() };
    let world = World::new(robot, &arm, &tool, &wall, &boxes, &options).expect("a world");
    Setting { arm, tool, world, depth }
}

fn pr2() -> Setting {
    setting(&Robot::pr2(), &ArmSpec::pr2(Side::Right), Tool::default(), 0.7, 0.8)
}

/// An arm of links in line whose joints turn about z and y in turn, and its tool along z.
fn straight_arm(joints: usize) -> Setting {
    let mut xml = String::from("<robot name='straight'><link name='l0'/>");
    for n in 0..joints {
        let (axis, most) = if n % 2 == 0 { ("0 0 1", 2.9) } else { ("0 1 0", 2.1) };
        let length = if n % 2 == 1 { 0.2 } else { 0.15 };
        write!(
            xml,
            "<link name='l{}'/><joint name='j{n}' type='revolute'><parent link='l{n}'/><child \
             link='l{}'/><origin xyz='0 0 {length}'/><axis xyz='{axis}'/><limit lower='-{most}' \
             upper='{most}' velocity='1' effort='1'/></joint>",
            n + 1,
            n + 1,
        )
        .expect("written");
    }
    let robot = Robot::from_urdf_str(&(xml + "</robot>")).expect("a robot");
    let tool = Tool { centre: [0.0, 0.0, 0.15], approach: [0.0, 0.0, 1.0], ..Tool::default() };
    let spec = ArmSpec { base: "l0".into(), tip: format!("l{joints}") };
    setting(&robot, &spec, tool, 0.55, 0.5)
}

fn turn_apart(a: f64, b: f64) -> f64 {
    (a - b - ((a - b) / TAU).round() * TAU).abs()
}

/// Everything that is promised of a track.
fn check(s: &Setting, track: &Track, from: &Sample, to: &Sample) {
    let Track { joints, line } = track;
    assert_eq!(joints.len(), line.len());
    assert_eq!(joints[0], from.q);
    let last = joints[joints.len() - 1];
    assert!(last.iter().zip(&to.q).all(|(a, b)| turn_apart(*a, *b) < 1e-6), "{last:?} {to:?}");

    let redundant = s.arm.ik().redundant_joint().expect("a redundant arm");
    let mut solutions = Solutions::new();
    for (q, point) in joints.iter().zip(line) {
        assert!(s.arm.within_margins(q), "{q:?}");
        let tip = s.arm.tip_pose(q);
        let pad = tip * s.tool.contact_in_tip();
        assert!((pad.translation.vector - point.coords).norm() < 1e-8);
        // Another way to the same branch: all solutions there, and which of them this is.
        if s.arm.ik_by(RedundantJoint::UpperArmRoll).is_some() {
            s.arm.ik().solve(&tip, q[redundant], &mut solutions);
            let same = |a: &JointVector| (0..7).all(|j| turn_apart(a[j], q[j]) < 1e-6);
            let found = solutions.iter().find(|found| same(&found.q)).expect("a solution");
            assert_eq!(found.branch, from.branch);
        }
    }
    let exact = s.world.exact();
    for k in 1..joints.len() {
        let (a, b) = (&joints[k - 1], &joints[k]);
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 0.8), "{a:?} {b:?}");
        let along = line[k] - line[k - 1];
        for step in 0..=8 {
            let t = f64::from(step) / 8.0;
            let q: JointVector = JointVector::from_fn(|j| a[j] + t * (b[j] - a[j]));
            if let Some(hit) = exact.first_hit(&q, ToolContact::Allowed) {
                panic!("between joint vectors {} and {k}: {hit}", k - 1);
            }
            let pad =
                Point3::from((s.arm.tip_pose(&q) * s.tool.contact_in_tip()).translation.vector);
            let share = (pad - line[k - 1]).dot(&along) / along.norm_squared().max(1e-18);
            let off = (pad - (line[k - 1] + along * share.clamp(0.0, 1.0))).norm();
            assert!(off <= 1.0e-4, "{off} m off the line between {} and {k}", k - 1);
        }
    }
}

/// How many edges go evenly, and by how the even change fails, how many of them by a detour:
/// (fold or limit, collision).
fn try_edges(s: &Setting, tries: usize, y: (f64, f64), z: (f64, f64)) -> (usize, [usize; 2]) {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let (low, high) = s.arm.ik().redundancy_range().expect("a redundant arm");
    let (mut even, mut around) = (0, [0, 0]);
    for _ in 0..tries {
        let at = (rng.random_range(y.0..y.1), rng.random_range(z.0..z.1));
        let way = rng.random_range(-3.1..3.1);
        let first: f64 = rng.random_range(low..high);
        let second = (first + rng.random_range(-1.0..1.0)).clamp(low, high);
        let (path, [from, to]) = s.edge(at, way, [first, second]);
        let pairs = from.iter().flat_map(|f| to.iter().map(move |t| (f, t)));
        for (f, t) in pairs.filter(|(f, t)| f.branch == t.branch) {
            let failed = match s.cell().follow(&path, f, t) {
                Ok(track) => {
                    even += 1;
                    if even <= CHECKED {
                        check(s, &track, f, t);
                    }
                    continue;
                }
                Err(blocked) => blocked.why,
            };
            let Some(track) = s.cell().detour(&path, &[*f], &[*t]) else { continue };
            let again = s.cell().detour(&path, &[*f], &[*t]).expect("as before");
            assert_eq!(track.joints, again.joints);
            check(s, &track, f, t);
            around[usize::from(failed == TrackFailure::Collision)] += 1;
        }
    }
    (even, around)
}

#[test]
fn tracks_and_detours_keep_limits_line_branch_and_margins() {
    let (even, [limits, collisions]) = try_edges(&pr2(), 8000, (-0.5, 0.1), (0.5, 1.1));
    println!("PR2: {even} evenly; detours: {limits} around limits, {collisions} around things");
    assert!(even > 100, "{even} evenly");
    assert!(limits >= 3 && collisions >= 3, "{limits} around limits, {collisions} around things");
}

#[test]
fn an_arm_without_closed_form_finds_detours_too() {
    let arm = straight_arm(7);
    let (even, [limits, collisions]) = try_edges(&arm, 250, (-0.3, 0.3), (0.3, 0.7));
    println!(
        "7 joints: {even} evenly; detours: {limits} around limits, {collisions} around things"
    );
    assert!(even > 10, "{even} evenly");
    assert!(limits + collisions >= 1, "{limits} around limits, {collisions} around things");
}

#[test]
fn an_arm_without_redundancy_has_no_detours() {
    let s = straight_arm(6);
    assert_eq!(s.arm.ik().redundancy_range(), None);
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut followed = 0;
    for _ in 0..200 {
        let at = (rng.random_range(-0.3..0.3), rng.random_range(0.3..0.7));
        let (path, [from, to]) = s.edge(at, rng.random_range(-3.1..3.1), [0.0; 2]);
        assert!(s.cell().detour(&path, &from, &to).is_none());
        let pairs = from.iter().flat_map(|f| to.iter().map(move |t| (f, t)));
        followed += pairs.filter(|(f, t)| s.cell().follow(&path, f, t).is_ok()).count();
    }
    assert!(followed > 0, "no edge at all can be followed");
}
