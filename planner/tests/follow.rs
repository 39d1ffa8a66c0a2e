//! Tool paths followed in their order: `planner follow`.

mod common;

use std::path::Path;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use nullsweep_collision::{Obstacle, ObstacleShape, Options, ToolContact, World};
use nullsweep_planner::follow::{self, FollowConfig, FollowError, FollowOutcome};
use nullsweep_planner::plan::{Plan, Profile};
use nullsweep_planner::poses::{self, QuaternionOrder, ReadOptions, Setup, SetupError, Tolerance};
use nullsweep_planner::progress::Silent;
use nullsweep_planner::timing::Speed;
use nullsweep_planner::verify::{Given, verify};
use nullsweep_planner::workcell::Scene;
use nullsweep_robot::{Arm, ArmSpec, Geometry, Robot, Side};

fn config() -> FollowConfig {
    let setup = common::setup(Tolerance([0.0; 6]));
    FollowConfig { setup, step: FollowConfig::STEP }
}

/// Another one, met as [`config`] says but for what is given.
fn with(setup: Setup) -> FollowConfig {
    FollowConfig { setup, ..config() }
}

fn arm() -> Arm {
    Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).unwrap()
}

/// Down onto a table, `x` ahead of the PR2 and `y` to its left.
fn down(x: f64, y: f64) -> Isometry3<f64> {
    let down = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    Isometry3::from_parts(Translation3::new(x, y, 0.75), down)
}

/// A line to and fro: rows of a raster, each a segment.
fn raster(rows: usize) -> Vec<Vec<Isometry3<f64>>> {
    let row = |k: usize| {
        let x = 0.55 + 0.03 * k as f64;
        (0..=12).map(|i| down(x, -0.35 + 0.025 * f64::from(i))).collect()
    };
    (0..rows).map(row).collect()
}

fn nothing() -> Scene {
    Scene::of_obstacles(Vec::new())
}

fn cuboid(at: Vector3<f64>, half: f64) -> Obstacle {
    Obstacle {
        name: "post".into(),
        shape: ObstacleShape::Geometry(Geometry::Box { half_extents: Vector3::repeat(half) }),
        pose: Isometry3::from(at),
        carries_robot: false,
    }
}

fn run(segments: &[Vec<Isometry3<f64>>], scene: &Scene, config: &FollowConfig) -> FollowOutcome {
    let outcome = follow::run(&Robot::pr2(), segments, scene, config, &Silent).expect("a plan");
    assert_eq!(outcome.verification.violations, []);
    outcome
}

/// Where the tool is along a plan: the knot that a piece of motion ends in, and its pose.
fn motion(plan: &Plan) -> Vec<(usize, Isometry3<f64>)> {
    let (arm, contact) = (arm(), plan.tool.contact_in_tip());
    let at = |k: usize| {
        let curve = plan.curve(k);
        let arm = &arm;
        (0..=8).map(move |i| (k, arm.tip_pose(&curve.at(f64::from(i) / 8.0)) * contact))
    };
    (1..plan.knots.len()).flat_map(at).collect()
}

/// From the plan's knots alone: the poses met, in their order, the farthest off one of them, and how far
/// the tool, on the path, is off the straight lines between poses.
fn met_in_order(plan: &Plan, segments: &[Vec<Isometry3<f64>>]) -> (Vec<usize>, f64, f64) {
    let (arm, contact) = (arm(), plan.tool.contact_in_tip());
    let poses = segments.concat();
    let (mut off, mut met) = (0.0f64, Vec::new());
    for knot in &plan.knots {
        let Some(pose) = knot.patch.map(|p| p as usize) else { continue };
        let tool = arm.tip_pose(&knot.q) * contact;
        off = off.max((tool.translation.vector - poses[pose].translation.vector).norm());
        off = off.max(0.1 * tool.rotation.angle_to(&poses[pose].rotation));
        met.push(pose);
    }
    met.dedup();
    assert!(met.windows(2).all(|w| w[0] < w[1]), "in their order: {met:?}");
    let line = |p: &Vector3<f64>| {
        let edges = segments.iter().flat_map(|s| s.windows(2));
        edges.map(|w| from_line(p, &w[0], &w[1])).fold(f64::INFINITY, f64::min)
    };
    let on_path = motion(plan).into_iter().filter(|(k, _)| plan.on_surface(*k));
    let worst = on_path.map(|(_, tool)| line(&tool.translation.vector)).fold(0.0, f64::max);
    (met, off, worst)
}

/// The same where all poses are met.
fn judged(plan: &Plan, segments: &[Vec<Isometry3<f64>>]) -> (f64, f64) {
    let (met, off, line) = met_in_order(plan, segments);
    assert_eq!(met.len(), segments.concat().len(), "{met:?}");
    (off, line)
}

fn from_line(p: &Vector3<f64>, a: &Isometry3<f64>, b: &Isometry3<f64>) -> f64 {
    let (a, b) = (a.translation.vector, b.translation.vector);
    let along = b - a;
    let share = ((p - a).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
    (p - a - along * share).norm()
}

#[test]
fn a_path_is_followed_in_its_order_and_straight() {
    let segments = raster(3);
    let outcome = run(&segments, &nothing(), &config());
    let (off, line) = judged(&outcome.plan, &segments);
    assert!(off < 1e-6, "{off} m from a pose");
    assert!(line < 5e-4, "{line} m from the path");
    let figures = &outcome.figures;
    assert_eq!((figures.met, figures.reconfigurations, figures.transfers), (39, 0, 2));
    // Between the rows the tool is lifted.
    let lifted = outcome.plan.knots.iter().filter(|k| k.line.is_none()).count();
    assert!(lifted >= 4, "{lifted} knots off the path");
    let highest = motion(&outcome.plan).iter().map(|(_, t)| t.translation.z).fold(0.0, f64::max);
    assert!(highest > 0.77, "{highest} m");
    // Movement after it was smoothed is not above what the samples had, lifts apart.
    assert!(figures.movement_rad < figures.sampled_rad, "{figures:?}");
}

#[test]
fn the_least_movement_is_found_among_the_null_space_motions() {
    let segments = raster(1);
    let outcome = run(&segments, &nothing(), &config());
    // Whoever holds the upper-arm roll, at any value, and follows by the closed form moves more.
    let arm = arm();
    let contact = config().setup.tool.contact_in_tip().inverse();
    let mut best = f64::INFINITY;
    for roll in -40..=10 {
        let mut solutions = nullsweep_robot::Solutions::new();
        arm.ik().solve(&(segments[0][0] * contact), 0.1 * f64::from(roll), &mut solutions);
        for start in solutions.iter().filter(|s| arm.within_margins(&s.q)) {
            let (mut at, mut moved) = (*start, 0.0);
            let whole = segments[0][1..].iter().all(|pose| {
                let next = arm.ik().solve_on(at.branch, &(pose * contact), at.redundancy, &at.q);
                next.is_some_and(|next| {
                    moved += at.q.distance(&next.q);
                    at = next;
                    arm.within_margins(&next.q)
                })
            });
            if whole {
                best = best.min(moved);
            }
        }
    }
    assert!(best.is_finite());
    let moved = outcome.figures.movement_rad;
    assert!(moved < best, "{moved} rad, {best} with the roll held");
}

#[test]
fn what_is_in_the_way_is_gone_round_with_the_path_kept() {
    let segments = raster(2);
    let free = run(&segments, &nothing(), &config());
    let robot = Robot::pr2();
    let elbow = robot.links().iter().position(|link| link.name == "r_elbow_flex_link").unwrap();
    let mut links = vec![Isometry3::identity(); robot.links().len()];
    arm().link_poses(&free.plan.knots[free.plan.knots.len() / 2].q, &mut links);
    let scene = Scene::of_obstacles(vec![cuboid(links[elbow].translation.vector, 0.02)]);
    let (arm, collision) = (ArmSpec::pr2(Side::Right), Options::default());
    let given = Given { robot: &robot, arm: &arm, scene: &scene, collision: &collision };
    let broken = verify(&free.plan, given, &|| ()).unwrap().violations.len();
    assert!(broken > 0, "the post stands where the elbow went");
    let outcome = run(&segments, &scene, &config());
    assert_eq!(verify(&outcome.plan, given, &|| ()).unwrap().violations, []);
    let (met, off, line) = met_in_order(&outcome.plan, &segments);
    assert!(off < 1e-6 && line < 5e-4, "{off} {line}");
    assert!(met.len() > 8, "{met:?}");
    // What is left out no joint vector meets, by the closed form alone.
    let world = World::new(
        &robot,
        &self::arm(),
        &config().setup.tool,
        scene.points(),
        &scene.obstacles,
        &collision,
    )
    .unwrap();
    for (pose, at) in segments.concat().iter().enumerate() {
        assert!(met.contains(&pose) || !is_met(at, &world), "pose {pose} is left out");
    }
}

/// Whether any joint vector meets a pose free of collision.
fn is_met(pose: &Isometry3<f64>, world: &World) -> bool {
    let arm = arm();
    let tip = pose * config().setup.tool.contact_in_tip().inverse();
    let mut solutions = nullsweep_robot::Solutions::new();
    (-40..=10).any(|roll| {
        arm.ik().solve(&tip, 0.1 * f64::from(roll), &mut solutions);
        let free = |q| arm.within_margins(q) && world.is_free(q, ToolContact::Allowed);
        solutions.iter().any(|s| free(&s.q))
    })
}

#[test]
fn what_cannot_be_met_is_left_out_and_told_and_the_rest_is_followed() {
    // The row goes through a post, another one is out of reach.
    let mut segments = raster(2);
    segments.push(vec![down(3.0, 0.0), down(3.0, 0.1)]);
    let at = segments[0][6].translation.vector;
    let scene = Scene::of_obstacles(vec![cuboid(at - Vector3::z() * 0.03, 0.025)]);
    let notes = common::Notes::default();
    let outcome = follow::run(&Robot::pr2(), &segments, &scene, &config(), &notes).unwrap();
    assert_eq!(outcome.verification.violations, []);
    let notes = notes.0.into_inner().unwrap();
    let told = |what: &str| notes.iter().any(|note| note.contains(what));
    assert!(told("post") && told("no joint vector inside the arm's limits meets it"), "{notes:?}");
    let met: Vec<usize> =
        outcome.plan.knots.iter().filter_map(|k| k.patch.map(|p| p as usize)).collect();
    assert!(met.windows(2).all(|w| w[0] < w[1]), "{met:?}");
    assert!(met.contains(&0) && met.contains(&12) && met.contains(&25), "{met:?}");
    assert!(!met.contains(&6) && !met.contains(&26), "{met:?}");
    assert_eq!(outcome.figures.met, met.len());
    // Over the post the arm leaves the path: that is no following.
    assert!(outcome.figures.reconfigurations >= 1, "{:?}", outcome.figures);
    let far = [vec![down(3.0, 0.0)]];
    let result = follow::run(&Robot::pr2(), &far, &nothing(), &config(), &Silent);
    assert!(matches!(result, Err(FollowError::NothingMet { poses: 1, .. })), "{result:?}");
}

#[test]
fn a_path_begins_where_the_arm_is_and_keeps_accelerations_and_the_tool_speed() {
    let start = arm().home();
    let speed = Speed { profile: Profile::Acceleration, tool: Some(0.05), ..Speed::default() };
    let config = with(Setup { start: Some(start), speed, ..config().setup });
    let segments = raster(2);
    let outcome = run(&segments, &nothing(), &config);
    let plan = &outcome.plan;
    assert_eq!((plan.knots[0].q, plan.knots[0].line), (start, None));
    assert_eq!(plan.profile, Profile::Acceleration);
    assert!(outcome.figures.position_error_max_m < 1.6e-4, "{:?}", outcome.figures);
    let (_, line) = judged(plan, &segments);
    assert!(line < 5e-4, "{line} m from the path");
    // Two rows of 0.3 m at 0.05 m/s take 12 s at least.
    assert!(plan.duration() > 12.0, "{} s", plan.duration());
    // A start beyond a limit is told.
    let mut beyond = start;
    beyond[3] = 0.2;
    let beyond = with(Setup { start: Some(beyond), ..config.setup });
    let result = follow::run(&Robot::pr2(), &segments, &nothing(), &beyond, &Silent);
    assert!(
        matches!(&result, Err(FollowError::Setup(SetupError::Start { why })) if why.contains("r_elbow_flex_joint")),
        "{result:?}"
    );
}

#[test]
fn a_seed_gives_the_same_plan_whatever_the_number_of_threads() {
    let segments = raster(2);
    let pool = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
    let of = |n| pool(n).install(|| run(&segments, &nothing(), &config()).plan);
    assert_eq!(of(1), of(3));
}

#[test]
fn tolerance_saves_movement_and_is_kept() {
    let segments = raster(1);
    let exact = run(&segments, &nothing(), &config()).figures.movement_rad;
    let cone = Tolerance([0.0, 0.0, 0.0, 0.2, 0.2, f64::INFINITY]);
    let loose = with(Setup { tolerance: cone, ..config().setup });
    let outcome = run(&segments, &nothing(), &loose);
    assert!(outcome.figures.movement_rad < 0.9 * exact, "{:?}", outcome.figures);
    let (arm, contact) = (arm(), outcome.plan.tool.contact_in_tip());
    for knot in outcome.plan.knots.iter().filter(|k| k.patch.is_some()) {
        let tool = arm.tip_pose(&knot.q) * contact;
        let tilt = (tool.rotation * Vector3::z()).angle(&-Vector3::z());
        assert!(tilt < 0.2 + 1e-6, "{tilt}");
        let near =
            segments[0].iter().map(|p| (p.translation.vector - tool.translation.vector).norm());
        assert!(near.fold(f64::INFINITY, f64::min) < 1e-6);
    }
}

/// A published path: its file, the robot's file with base and tip, where the path is, boxes in the way as
/// centre and size, and the most reconfigurations.
struct Published {
    path: &'static str,
    robot: [&'static str; 3],
    offset: Isometry3<f64>,
    boxes: &'static [([f64; 3], [f64; 3])],
    most: usize,
}

fn published() -> [Published; 6] {
    let panda = ["coverage-tasks/panda.urdf", "world", "panda_hand"];
    let fetch = ["robots/fetch.urdf", "base_link", "gripper_link"];
    let fetch_arm = ["robots/fetch.urdf", "torso_lift_link", "gripper_link"];
    let turned = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), std::f64::consts::FRAC_PI_2);
    // Fetch's are given from its torso, which stands at its lowest.
    let torso = |x, y, z| Isometry3::translation(x - 0.086875, y, z + 0.37743);
    [
        Published {
            path: "square.csv",
            robot: panda,
            offset: Isometry3::from_parts(Translation3::new(0.75, 0.0, 0.5), turned),
            boxes: &[],
            most: 0,
        },
        Published {
            path: "1cube.csv",
            robot: panda,
            offset: Isometry3::translation(0.0, 0.5421984559194368, 0.7885155964931997),
            boxes: &[([0.0, 0.2, 0.7], [0.25; 3])],
            most: 0,
        },
        Published {
            path: "flappy_bird.csv",
            robot: panda,
            offset: Isometry3::translation(0.0, 0.54, 0.79),
            boxes: &[([0.0, 0.25, 1.0], [0.05, 0.15, 0.3]), ([0.0, 0.25, 0.5], [0.05, 0.15, 0.3])],
            // The capsules are fatter than the links: with the real ones it takes none.
            most: 1,
        },
        Published {
            path: "circle.csv",
            robot: fetch_arm,
            offset: torso(0.9, 0.25, 0.46),
            boxes: &[
                ([0.4, 0.4, 0.825], [0.3, 0.05, 0.8]),
                ([0.4, -0.4, 0.825], [0.3, 0.05, 0.8]),
                ([0.4, 0.0, 1.225], [0.3, 0.85, 0.05]),
                ([0.4, 0.0, 0.425], [0.3, 0.85, 0.05]),
            ],
            most: 0,
        },
        Published {
            path: "hello.csv",
            robot: fetch_arm,
            offset: torso(0.8, 0.45, 0.25),
            boxes: &[],
            most: 0,
        },
        Published {
            path: "square.csv",
            robot: fetch,
            offset: torso(1.1, 0.0, 0.66),
            boxes: &[([0.75, 0.0, 0.36], [0.7, 1.4, 0.72])],
            most: 0,
        },
    ]
}

/// Paths published with CppFlow, five of them first with TORM: every pose exact, no joint further than 7°
/// or 2 cm from pose to pose.
#[test]
fn published_paths_are_followed_without_a_jump() {
    let data = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data"));
    if !data.is_dir() {
        eprintln!("skipped: {} is not there", data.display());
        return;
    }
    for Published { path, robot: [urdf, base, tip], offset, boxes, most } in published() {
        let name = format!("{path} by {base} to {tip}");
        let robot = Robot::from_urdf_file(&data.join(urdf)).unwrap();
        let one = |(centre, size): &([f64; 3], [f64; 3])| {
            let half_extents = Vector3::from(*size) * 0.5;
            let shape = ObstacleShape::Geometry(Geometry::Box { half_extents });
            Obstacle { shape, ..cuboid(Vector3::from(*centre), 0.0) }
        };
        let scene = Scene::of_obstacles(boxes.iter().map(one).collect());
        let options = ReadOptions { order: Some(QuaternionOrder::Wxyz), offset };
        let segments = poses::read(&data.join("toolpaths").join(path), &options).unwrap().segments;
        let config = with(Setup {
            arm: ArmSpec { base: base.into(), tip: tip.into() },
            tool: poses::tip_tool(),
            collision: Options { fit_capsules: Some(0.05), ..Options::default() },
            ..config().setup
        });
        let outcome = follow::run(&robot, &segments, &scene, &config, &Silent).expect(&name);
        assert_eq!(outcome.verification.violations, [], "{name}");
        let figures = &outcome.figures;
        println!(
            "{name}: {} reconfigurations, {:.3} rad, steps {:.2}°, {:.1} mm, off the line {:.3} mm, \
             {:.2} s",
            figures.reconfigurations,
            figures.movement_rad,
            figures.step_max_rad.to_degrees(),
            1e3 * figures.step_max_m,
            1e3 * figures.edge_deviation_max_m,
            figures.calc_time_s
        );
        assert_eq!(figures.met, figures.poses, "{name}");
        assert!(figures.reconfigurations <= most, "{name}: {figures:?}");
        assert!(figures.position_error_max_m < 1e-4, "{name}: {figures:?}");
        assert!(figures.angle_error_max_rad < 1e-3, "{name}: {figures:?}");
        assert!(figures.step_max_rad < 7f64.to_radians(), "{name}: {figures:?}");
        assert!(figures.step_max_m < 0.02, "{name}: {figures:?}");
        assert!(figures.edge_deviation_max_m < 5e-4, "{name}: {figures:?}");
    }
}

/// The hand turns once round along a line, further than its last joint goes.
#[test]
fn a_turn_beyond_a_joints_range_is_one_reconfiguration() {
    let data = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data"));
    if !data.is_dir() {
        eprintln!("skipped: {} is not there", data.display());
        return;
    }
    let robot = Robot::from_urdf_file(&data.join("coverage-tasks/panda.urdf")).unwrap();
    let path = data.join("reports/line_with_turn.csv");
    let segments = poses::read(&path, &ReadOptions::default()).unwrap().segments;
    let config = with(Setup {
        arm: ArmSpec { base: "world".into(), tip: "panda_hand".into() },
        tool: poses::tip_tool(),
        collision: Options { fit_capsules: Some(0.05), ..Options::default() },
        ..config().setup
    });
    let outcome = follow::run(&robot, &segments, &nothing(), &config, &Silent).unwrap();
    assert_eq!(outcome.verification.violations, []);
    assert!(outcome.figures.met >= 199, "{:?}", outcome.figures);
    // Where it changes its posture, it comes back to the place that it left.
    let knots = &outcome.plan.knots;
    let places: Vec<Point3<f64>> = knots.iter().filter_map(|k| k.line.map(Into::into)).collect();
    assert!(places.windows(2).all(|w| (w[0] - w[1]).norm() < 0.012));
    assert!(outcome.figures.reconfigurations >= 1, "{:?}", outcome.figures);
    assert_eq!(outcome.figures.transfers, outcome.figures.reconfigurations);
}
