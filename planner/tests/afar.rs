//! Tools that work from afar, and round ones: what they work on along a motion.

use nalgebra::{Isometry3, Point3, UnitQuaternion, UnitVector3, Vector3};
use nullsweep_collision::{MeshPaths, Obstacle, Solids};
use nullsweep_planner::pipeline::idle;
use nullsweep_planner::plan::{Plan, PlanKnot, Profile, Trajectory};
use nullsweep_planner::sweep::{Clock, Missed, Sight, Unswept, coverage, deposits, missed};
use nullsweep_planner::verify::stand_off;
use nullsweep_planner::workcell::{Bed, Scene};
use nullsweep_robot::{
    Arm, ArmSpec, Camera, Footprint, Geometry, JointVector, Nozzle, Robot, Side, Tool,
};
use nullsweep_surface::{Scan, SurfacePoint};

const SPACING: f64 = 0.005;

/// Level squares at some heights: centre, half side; normals up.
fn squares(squares: &[([f64; 3], f64)]) -> Scan {
    let mut points = Vec::new();
    for ([x, y, z], half) in squares {
        let count = (2.0 * half / SPACING) as i32;
        let at = |k: i32| SPACING * f64::from(k) - half;
        let all = (0..=count).flat_map(|i| (0..=count).map(move |k| (i, k)));
        points.extend(all.map(|(i, k)| Point3::new(x + at(i), y + at(k), *z)));
    }
    let normals = vec![UnitVector3::new_normalize(Vector3::z()); points.len()];
    Scan { raw: points.clone(), points, normals, spacing: SPACING }
}

fn camera() -> Tool {
    let camera = Camera { distance: [0.15, 0.5], field_of_view: [1.2, 1.0] };
    let footprint = Footprint::Camera(camera);
    Tool { stand_off: 0.4, reach_normal: 0.25, reach_angle: 1.0, footprint, ..Tool::default() }
}

/// Looking straight down from a height.
fn down(height: f64) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_euler_angles(std::f64::consts::PI, 0.0, 0.0);
    Isometry3::from_parts(Vector3::new(0.0, 0.0, height).into(), turn)
}

/// Whether a camera sees the points of a scan near a place, all of them or none.
fn sees(sight: Sight<'_>, place: [f64; 3], tool: &Tool) -> bool {
    let seen = coverage::swept(sight, &[down(0.4)], tool);
    let near = |p: &Point3<f64>| (p - Point3::from(place)).norm() < 0.012;
    let of: Vec<bool> =
        sight.scan.points.iter().zip(&seen).filter(|(p, _)| near(p)).map(|(_, s)| *s).collect();
    assert!(of.len() > 8 && of.iter().all(|s| *s == of[0]), "{place:?}: {of:?}");
    of[0]
}

#[test]
fn a_camera_sees_what_nothing_hides_within_its_view_and_its_sharpness() {
    let floor = ([0.0, 0.0, 0.0], 0.35);
    let plain = squares(&[floor]);
    let tool = camera();
    let (under, beside) = ([0.05, 0.0, 0.0], [-0.10, 0.0, 0.0]);
    assert!(sees((&plain).into(), under, &tool) && sees((&plain).into(), beside, &tool));
    // Half its view is 0.4 m · tan 0.6 across, along y, and 0.4 m · tan 0.5 along, along x.
    assert!(sees((&plain).into(), [0.0, 0.25, 0.0], &tool));
    assert!(!sees((&plain).into(), [0.25, 0.0, 0.0], &tool));
    // A shelf of the scan's own 10 cm above hides what is under it, and is seen itself.
    let shelf = ([0.04, 0.0, 0.1], 0.05);
    let shelved = squares(&[floor, shelf]);
    assert!(!sees((&shelved).into(), under, &tool) && sees((&shelved).into(), beside, &tool));
    assert!(sees((&shelved).into(), shelf.0, &tool));
    // So does one that is no part of the surface, measured or given as a solid.
    let measured = squares(&[shelf]).points;
    let sight = Sight { beside: &measured, ..Sight::from(&plain) };
    assert!(!sees(sight, under, &tool) && sees(sight, beside, &tool));
    let shape = Geometry::Box { half_extents: Vector3::new(0.05, 0.05, 0.002) }.into();
    let pose = Isometry3::translation(0.04, 0.0, 0.1);
    let solid = Obstacle { name: "shelf".into(), shape, pose, carries_robot: false };
    let solids = Solids::new(&[solid], &MeshPaths::default()).expect("a box");
    let sight = Sight { solids: Some(&solids), ..Sight::from(&plain) };
    assert!(!sees(sight, under, &tool) && sees(sight, beside, &tool));
    // Too far, too near, too aslant.
    let bounded = |distance, reach_angle| {
        let footprint = Footprint::Camera(Camera { distance, field_of_view: [1.2, 1.0] });
        Tool { footprint, reach_angle, ..camera() }
    };
    assert!(!sees((&plain).into(), under, &bounded([0.15, 0.39], 1.0)));
    assert!(!sees((&plain).into(), under, &bounded([0.41, 0.5], 1.0)));
    assert!(!sees((&plain).into(), [0.0, 0.2, 0.0], &bounded([0.15, 0.5], 0.4)));
    assert!(sees((&plain).into(), under, &bounded([0.15, 0.5], 0.4)));
}

fn arm() -> Arm {
    Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).expect("the PR2's arm")
}

fn nozzle() -> Nozzle {
    Nozzle { distance: [0.1, 0.2], cone: 0.3, rate: 1e-6, deposit: [2e-5, 5e-5] }
}

/// What lies before the nozzle of the arm at home: a level square across its axis, as far as it
/// stands off.
fn sprayed(arm: &Arm, tool: &Tool) -> Scan {
    let before = tool.on(arm).pose(&arm.home()) * down(0.0);
    squares(&[([0.0, 0.0, -tool.stand_off], 0.06)]).transformed(&before)
}

/// The arm at home for so long. \[s\]
fn hold(arm: &Arm, seconds: f64) -> Vec<PlanKnot> {
    let knot = |time_ns: u64| PlanKnot {
        time_ns,
        q: arm.home(),
        v: JointVector::ZERO,
        line: Some([0.0; 3]),
        patch: None,
    };
    vec![knot(0), knot((1e9 * seconds) as u64)]
}

#[test]
fn a_nozzle_has_done_where_enough_lies_and_not_too_much() {
    let arm = arm();
    let tool = Tool {
        stand_off: 0.15,
        reach_normal: 0.05,
        reach_angle: 1.0,
        footprint: Footprint::Nozzle(nozzle()),
        ..Tool::default()
    };
    let scan = sprayed(&arm, &tool);
    let middle = tool.on(&arm).pose(&arm.home()) * Point3::new(0.0, 0.0, 0.15);
    let nearest = |a: &usize, b: &usize| {
        let far = |i: &usize| (scan.points[*i] - middle).norm();
        far(a).total_cmp(&far(b))
    };
    let centre = (0..scan.points.len()).min_by(nearest).expect("a square");
    let of = |seconds: f64, times: usize| {
        let knots = hold(&arm, seconds);
        let motion = Trajectory { tool: &tool, profile: Profile::Velocity, knots: &knots };
        let laid = deposits((&scan).into(), motion, &arm, Clock::Timed);
        let swept = coverage::swept_by(&scan, vec![motion; times], &arm);
        let all = vec![true; swept.len()];
        let left = Unswept { reachable: &all, swept: &swept, no_motion: &[] };
        (laid[centre], swept[centre], missed(&scan, left, [motion], &arm))
    };
    // On the axis the flow per area is 2 q ∕ π R².
    let radius = 0.15 * 0.3_f64.tan();
    let expected = 2.0 * 1e-6 / (std::f64::consts::PI * radius * radius);
    let (laid, swept, _) = of(0.1, 1);
    assert!((laid / (0.1 * expected) - 1.0).abs() < 0.02, "{laid}");
    let second = 3e-5 / expected;
    assert!(swept == (0.1 * expected >= 2e-5));
    assert!(of(second, 1).1, "3e-5 m lie there");
    assert!(!of(0.5 * second, 1).1, "too little");
    assert!(of(0.5 * second, 2).1, "twice half of it is enough");
    let (_, swept, why) = of(2.0 * second, 1);
    assert!(!swept, "too much");
    assert!(why.iter().any(|row| row.why == Missed::Deposit && row.points > 10), "{why:?}");
    // Nothing is laid on beside its cone, and a motion that is not timed is taken at a speed.
    let knots = hold(&arm, 1.0);
    let motion = Trajectory { tool: &tool, profile: Profile::Velocity, knots: &knots };
    let laid = deposits((&scan).into(), motion, &arm, Clock::Timed);
    let outside = |i: &usize| (scan.points[*i] - middle).norm() > 1.01 * radius;
    assert!((0..laid.len()).filter(outside).count() > 50);
    assert!((0..laid.len()).filter(outside).all(|i| laid[i] == 0.0));
    let still = deposits((&scan).into(), motion, &arm, Clock::Speed(0.1));
    assert!(still.iter().all(|laid| *laid == 0.0), "it goes nowhere");
}

#[test]
fn a_disc_touches_its_circle_and_no_corner() {
    let scan = squares(&[([0.0, 0.0, 0.0], 0.1)]);
    let disc = Tool { length: 0.08, width: 0.08, footprint: Footprint::Disc, ..Tool::default() };
    let touched = coverage::swept(&scan, &[down(-0.004)], &disc);
    for (p, touched) in scan.points.iter().zip(touched) {
        let far = p.x.hypot(p.y);
        assert!((far - 0.04).abs() < 1e-9 || touched == (far < 0.04), "{p}");
    }
}

/// Whether a nozzle is led along a straight way over a level square of 40 × 40 cm, from one place of its
/// middle line to another: along x and above it. \[m\]
fn is_led(distance: [f64; 2], [from, to]: [[f64; 2]; 2]) -> bool {
    let scene = Scene::on_floor(squares(&[([0.0, 0.0, 0.0], 0.2)]));
    let footprint = Footprint::Nozzle(Nozzle { distance, ..nozzle() });
    let bed = Bed::new(&scene, &Tool { stand_off: 0.15, footprint, ..Tool::default() });
    let normal = UnitVector3::new_normalize(Vector3::z());
    let at = |[x, z]: [f64; 2]| SurfacePoint { point: Point3::new(x, 0.0, z), normal };
    bed.line(&at(from), &at(to), 0.006, 0.07).is_some()
}

#[test]
fn a_nozzle_is_led_where_the_surface_is_within_its_bounds() {
    let wide = [0.10, 0.20];
    assert!(is_led(wide, [[-0.1, 0.0], [0.1, 0.024]]));
    assert!(!is_led(wide, [[-0.1, 0.0], [0.1, 0.027]]), "what is 3 cm off is not what it works on");
    // Narrow bounds leave less, before the surface and behind it.
    assert!(is_led([0.138, 0.162], [[-0.1, -0.004], [0.1, 0.004]]));
    assert!(!is_led([0.138, 0.2], [[-0.1, 0.0], [0.1, -0.009]]));
    assert!(!is_led([0.1, 0.162], [[-0.1, 0.0], [0.1, 0.009]]));
}

#[test]
fn a_piece_that_is_too_far_costs_itself_alone() {
    let robot = Robot::pr2();
    let arm = arm();
    let camera = Camera { distance: [0.25, 0.35], field_of_view: [0.8, 0.6] };
    let footprint = Footprint::Camera(camera);
    let tool = Tool { stand_off: 0.3, reach_angle: 0.5, footprint, ..Tool::default() };
    let pad = tool.on(&arm);
    // The arm turns about its first axis, the camera over one square after the other.
    let knots: Vec<PlanKnot> = (0..9)
        .map(|k: u64| {
            let mut q = arm.home();
            q[0] += 0.1 * k as f64;
            let line = Some(pad.centre(&q).into());
            PlanKnot { time_ns: 1_000_000_000 * k, q, v: JointVector::ZERO, line, patch: None }
        })
        .collect();
    let mut scan =
        Scan { raw: Vec::new(), points: Vec::new(), normals: Vec::new(), spacing: SPACING };
    for (k, knot) in knots.iter().enumerate() {
        let ahead = if [3, 4, 7].contains(&k) { 0.36 } else { 0.3 };
        let before = pad.pose(&knot.q) * down(0.0);
        let square = squares(&[([0.0, 0.0, -ahead], 0.01)]).transformed(&before);
        scan.points.extend(square.points);
        scan.normals.extend(square.normals);
    }
    scan.raw.clone_from(&scan.points);
    let mut plan = Plan::of(&robot, &arm, &tool, knots.clone());
    let broken = |plan: &Plan| stand_off(plan, &arm, &scan).1.len();
    assert_eq!(broken(&plan), 5, "the segments to and from what is too far");
    assert_eq!(idle(&mut plan, &arm, &scan), 2);
    assert_eq!(broken(&plan), 0);
    let works: Vec<usize> = (1..knots.len()).filter(|k| plan.on_surface(*k)).collect();
    assert_eq!(works, [1, 2]);
    let same = plan.knots.iter().zip(&knots).all(|(a, b)| a.q == b.q && a.time_ns == b.time_ns);
    assert!(same, "the arm goes as it was planned");
}
