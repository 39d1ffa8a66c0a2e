//! Closed forms of arms that are not the PR2's, against forward kinematics and the numeric solver.

mod common;

use common::{data, farthest, random};
use nullsweep_robot::{Arm, ArmSpec, JointVector, Robot, Solutions};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// An arm whose joints turn about z of frames that are each moved and turned from the one before, and
/// may be anywhere in these ranges: its hard limits are 0.01 rad farther out.
fn serial(frames: &[[f64; 6]], ranges: &[(f64, f64)]) -> Arm {
    let mut text = String::from("<robot name='test'><link name='l0'/>");
    for (i, ([x, y, z, roll, pitch, yaw], (lower, upper))) in frames.iter().zip(ranges).enumerate()
    {
        let (lower, upper) = (lower - 0.01, upper + 0.01);
        text += &format!(
            "<link name='l{next}'/><joint name='j{next}' type='revolute'><parent link='l{i}'/>\
             <child link='l{next}'/><origin xyz='{x} {y} {z}' rpy='{roll} {pitch} {yaw}'/>\
             <axis xyz='0 0 1'/>\
             <limit lower='{lower}' upper='{upper}' effort='1' velocity='1'/></joint>",
            next = i + 1
        );
    }
    let last = frames.len();
    text += &format!(
        "<link name='tip'/><joint name='flange' type='fixed'><parent link='l{last}'/>\
         <child link='tip'/><origin xyz='0.02 0.05 0.15' rpy='0.3 0.2 0.1'/></joint></robot>"
    );
    let spec = ArmSpec { base: "l0".into(), tip: "tip".into() };
    Robot::from_urdf_str(&text).unwrap().arm(&spec).unwrap()
}

const HALF: f64 = std::f64::consts::FRAC_PI_2;

/// In the manner of a UR10: wide joints, the second to fourth axes parallel.
fn parallel() -> Arm {
    let frames = [
        [0.1, 0.2, 0.13, 0.1, 0.2, 0.3],
        [0.0, 0.22, 0.0, HALF, 0.0, 0.4],
        [0.61, 0.0, -0.17, 0.0, 0.0, 0.5],
        [0.57, 0.0, 0.0, 0.0, 0.0, -0.6],
        [0.0, 0.0, 0.12, -HALF, 0.0, 0.2],
        [0.0, 0.0, 0.11, HALF, 0.0, 0.0],
    ];
    serial(&frames, &[(-6.2, 6.2); 6])
}

/// The same as a calibration finds it: no two axes quite parallel, none quite meeting.
fn calibrated() -> Arm {
    let frames = [
        [0.1, 0.2, 0.13, 0.1, 0.2, 0.3],
        [0.0005, 0.22, 0.0, HALF + 0.001, 0.0, 0.4],
        [0.61, 0.001, -0.17, 0.001, -0.0005, 0.5],
        [0.57, 0.0, 0.0, -0.0007, 0.0004, -0.6],
        [0.0003, 0.0, 0.12, 0.001 - HALF, 0.0005, 0.2],
        [0.0, 0.0005, 0.11, HALF, 0.001, 0.0],
    ];
    serial(&frames, &[(-3.1, 3.1); 6])
}

/// In the manner of most industrial arms: shoulder and elbow parallel, an offset before and after
/// them, a spherical wrist.
fn industrial() -> Arm {
    let frames = [
        [0.0, 0.0, 0.4, 0.0, 0.0, 0.0],
        [0.15, 0.0, 0.05, -HALF, 0.0, 0.0],
        [0.0, -0.6, 0.0, 0.0, 0.0, 0.3],
        [0.1, 0.0, 0.0, -HALF, 0.0, 0.0],
        [0.0, 0.0, 0.62, HALF, 0.0, 0.0],
        [0.0, 0.0, 0.0, -HALF, 0.0, 0.0],
    ];
    let ranges = [(-3.0, 3.0), (-2.0, 1.2), (-3.4, 1.1), (-3.2, 3.2), (-2.0, 2.0), (-6.2, 6.2)];
    serial(&frames, &ranges)
}

/// In the manner of a Panda: a spherical shoulder, an elbow with offsets, a last joint off the
/// wrist; meets its limits like one.
fn offset_elbow() -> Arm {
    let frames = [
        [0.0, 0.0, 0.333, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, -HALF, 0.0, 0.0],
        [0.0, -0.316, 0.0, HALF, 0.0, 0.0],
        [0.0825, 0.0, 0.0, HALF, 0.0, 0.0],
        [-0.0825, 0.384, 0.0, -HALF, 0.0, 0.0],
        [0.0, 0.0, 0.0, HALF, 0.0, 0.0],
        [0.088, 0.0, 0.0, HALF, 0.0, 0.0],
    ];
    let wide = (-2.9, 2.9);
    serial(&frames, &[wide, (-1.76, 1.76), wide, (-3.07, 0.07), wide, (-0.02, 3.75), wide])
}

/// In the manner of an iiwa: spherical shoulder, elbow, spherical wrist.
fn spherical() -> Arm {
    let mut frames = [[0.0; 6]; 7];
    for (i, frame) in frames.iter_mut().enumerate() {
        frame[3] = if i % 2 == 1 { HALF } else { -HALF };
    }
    frames[0] = [0.0, 0.0, 0.34, 0.0, 0.0, 0.0];
    frames[2][1] = -0.4;
    (frames[2][1], frames[4][1]) = (0.4, 0.4);
    serial(&frames, &[(-2.9, 2.9); 7])
}

/// An arm of each kind, with the joint that is its redundancy.
fn made() -> Vec<(&'static str, Arm, Option<usize>)> {
    vec![
        ("parallel axes", parallel(), None),
        ("calibrated", calibrated(), None),
        ("industrial", industrial(), None),
        ("offset elbow", offset_elbow(), Some(6)),
        ("spherical", spherical(), Some(2)),
    ]
}

/// Arms of the shared data: the UR5 is a calibrated one.
fn real() -> Vec<(&'static str, Arm, Option<usize>)> {
    let arm = |file: &str, base: &str, tip: &str| {
        let robot = Robot::from_urdf_file(&data(file)?).unwrap();
        Some(robot.arm(&ArmSpec { base: base.into(), tip: tip.into() }).unwrap())
    };
    let found = [
        ("ur5", arm("coverage-tasks/ur5.urdf", "base_link", "tool_tip"), None),
        ("panda", arm("robots/panda.urdf", "panda_link0", "panda_link8"), Some(6)),
        ("iiwa", arm("robots/iiwa.urdf", "iiwa_link_0", "iiwa_link_ee"), Some(2)),
    ];
    found.into_iter().filter_map(|(name, arm, held)| Some((name, arm?, held))).collect()
}

fn value(arm: &Arm, q: &JointVector) -> f64 {
    arm.ik().redundant_joint().map_or(0.0, |joint| q[joint])
}

/// The least that the tip moves when the free joints move by 1 in all: 0 in a singularity.
fn least_motion(arm: &Arm, q: &JointVector) -> f64 {
    let mut jacobian = arm.jacobian(q);
    if let Some(held) = arm.ik().redundant_joint() {
        jacobian.column_mut(held).fill(0.0);
    }
    jacobian.singular_values().min()
}

/// Solves for the poses of random configurations: each solution's pose is checked, and the
/// configuration itself must be among them, but for those of a calibrated arm beside a singularity.
/// The largest error.
fn round_trips(name: &str, arm: &Arm, count: usize, seed: u64) -> f64 {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut out = Solutions::new();
    let (mut lost, mut worst) = (0, 0.0f64);
    for _ in 0..count {
        let q = random(arm, &mut rng);
        let target = arm.tip_pose(&q);
        arm.ik().solve(&target, value(arm, &q), &mut out);
        for solution in &out {
            let reached = arm.tip_pose(&solution.q);
            let shift = (reached.translation.vector - target.translation.vector).norm();
            let turn = (reached.rotation * target.rotation.inverse()).scaled_axis().norm();
            worst = worst.max(shift).max(turn);
            assert!(arm.within_margins(&solution.q), "{solution:?}");
        }
        // The wrist nearly straight, a pose says little of its two rolls.
        if !out.iter().any(|s| farthest(&s.q, &q) < 1e-3) {
            lost += 1;
            let least = least_motion(arm, &q);
            let most = match name {
                "ur5" => 5e-3,
                "calibrated" => 0.1,
                _ => 0.0,
            };
            assert!(least < most, "{name} {q:?}, {least}");
        }
    }
    println!("{name}: {lost} of {count} lost, error at most {worst:.1e}");
    worst
}

#[test]
fn kinds_are_recognised_and_configurations_come_back() {
    for (name, arm, held) in made().into_iter().chain(real()) {
        assert_eq!(arm.ik().redundant_joint(), held, "{name}");
        let worst = round_trips(name, &arm, 20_000, 1);
        assert!(worst < 2e-10, "{name}: {worst}");
    }
}

#[test]
#[ignore = "a long run; `cargo test --release -p nullsweep-robot --test analytic -- --ignored`"]
fn a_million_configurations_come_back() {
    for (name, arm, _) in made().into_iter().chain(real()) {
        let worst = round_trips(name, &arm, 1_000_000, 2);
        assert!(worst < 2e-10, "{name}: {worst}");
    }
}

/// The numeric solver knows nothing of shapes: whatever it finds, the closed form must find.
#[test]
fn nothing_is_missed_that_the_numeric_solver_finds() {
    for (name, arm, _) in made().into_iter().chain(real()) {
        let numeric = arm.numeric_ik();
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let (mut closed, mut found) = (Solutions::new(), Solutions::new());
        let (mut by_numeric, mut by_closed, mut missed) = (0, 0, 0);
        for _ in 0..200 {
            let q = random(&arm, &mut rng);
            let target = arm.tip_pose(&q);
            numeric.solve(&target, numeric.redundant_joint().map_or(0.0, |j| q[j]), &mut found);
            by_numeric += found.len();
            let mut all = 0;
            for solution in &found {
                arm.ik().solve(&target, value(&arm, &solution.q), &mut closed);
                all = closed.len();
                let nearest = closed
                    .iter()
                    .map(|s| farthest(&s.q, &solution.q))
                    .fold(f64::INFINITY, f64::min);
                if nearest > 1e-4 {
                    missed += 1;
                    println!("{name}: {solution:?} is missed by {nearest}");
                }
            }
            by_closed += all;
        }
        println!(
            "{name}: {by_numeric} solutions by the numeric solver, {by_closed} in closed form"
        );
        assert_eq!(missed, 0, "{name}");
    }
}

#[test]
fn a_branch_is_followed_and_keeps_its_name() {
    for (name, arm, _) in made().into_iter().chain(real()) {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let mut out = Solutions::new();
        let (count, parts) = (200, 50);
        let mut whole = 0;
        for _ in 0..count {
            let (from, toward) = (random(&arm, &mut rng), random(&arm, &mut rng));
            let at = |t: f64| -> JointVector {
                JointVector::from_fn(|i| from[i] + 0.05 * t * (toward[i] - from[i]))
            };
            arm.ik().solve(&arm.tip_pose(&from), value(&arm, &from), &mut out);
            let start = out.iter().find(|s| farthest(&s.q, &from) < 1e-4);
            let Some(start) = start else { continue };
            let (branch, mut near) = (start.branch, from);
            let followed = (1..=parts).all(|k| {
                let q = at(f64::from(k) / f64::from(parts));
                let next = arm.ik().solve_on(branch, &arm.tip_pose(&q), value(&arm, &q), &near);
                next.is_some_and(|next| {
                    assert_eq!(next.branch, branch);
                    near = next.q;
                    q.iter().zip(&near).all(|(a, b)| (a - b).abs() < 1e-4)
                })
            });
            whole += u32::from(followed);
            // A branch that is followed to its end is the one that is found there.
            if followed {
                arm.ik().solve(&arm.tip_pose(&near), value(&arm, &near), &mut out);
                assert!(out.iter().any(|s| s.branch == branch && farthest(&s.q, &near) < 1e-4));
            }
        }
        println!("{name}: {whole} of {count} paths followed");
        // The others cross a singularity.
        assert!(whole * 10 >= count * 6, "{name}: {whole}");
    }
}
