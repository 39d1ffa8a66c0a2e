//! The PR2's arms against the published robot and against themselves.

mod common;

use std::fs::File;
use std::io::{BufRead, BufReader};

use common::{data, farthest, random};
use flate2::read::GzDecoder;
use nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, Vector3};
use nullsweep_robot::{
    Arm, ArmSpec, Branch, InverseKinematics, JointVector, RedundantJoint, Robot, Side, Solutions,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn arm(side: Side) -> Arm {
    Robot::pr2().arm(&ArmSpec::pr2(side)).unwrap()
}

#[test]
fn agrees_with_the_published_robot() {
    let Some(file) = data("pr2/pr2.urdf") else { return };
    let published = Robot::from_urdf_file(&file).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for side in [Side::Right, Side::Left] {
        let (ours, theirs) = (arm(side), published.arm(&ArmSpec::pr2(side)).unwrap());
        assert_eq!(ours.joint_names(), theirs.joint_names());
        for (a, b) in ours.limits().iter().zip(theirs.limits()) {
            assert_eq!(a.continuous, b.continuous);
            assert_eq!(a.k_position, b.k_position);
            assert!((a.velocity - b.velocity).abs() < 1e-12);
            if !a.continuous {
                assert!((a.lower - b.lower).abs() < 1e-12 && (a.upper - b.upper).abs() < 1e-12);
            }
        }
        for _ in 0..1000 {
            let torso = [("torso_lift_joint", rng.random_range(0.0..0.33))];
            let (ours, theirs) =
                (ours.with_held(&torso).unwrap(), theirs.with_held(&torso).unwrap());
            let q = random(&ours, &mut rng);
            let (a, b) = (ours.tip_pose(&q), theirs.tip_pose(&q));
            assert!((a.to_homogeneous() - b.to_homogeneous()).amax() < 1e-12);
        }
    }
}

#[derive(serde::Deserialize)]
struct GoldenPose {
    torso_lift: f64,
    pos_xyz: [f64; 3],
    rot_rowmajor_3x3: [[f64; 3]; 3],
    ik: Vec<GoldenRoll>,
}

#[derive(serde::Deserialize)]
struct GoldenRoll {
    upper_arm_roll: f64,
    solutions: Vec<GoldenSolution>,
}

#[derive(serde::Deserialize)]
struct GoldenSolution {
    q: [f64; 7],
}

#[test]
fn finds_all_solutions_of_ikfast_and_no_other() {
    let Some(file) = data("pr2/ikfast_golden.jsonl.gz") else { return };
    let reader = BufReader::new(GzDecoder::new(File::open(file).unwrap()));
    let arm = arm(Side::Right);
    let mut solutions = Solutions::new();
    let (mut calls, mut found, mut worst) = (0, 0, 0.0f64);
    for line in reader.lines() {
        let pose: GoldenPose = serde_json::from_str(&line.unwrap()).unwrap();
        let arm = arm.with_held(&[("torso_lift_joint", pose.torso_lift)]).unwrap();
        let rotation = Matrix3::from_fn(|r, c| pose.rot_rowmajor_3x3[r][c]);
        let rotation = Rotation3::from_matrix_unchecked(rotation);
        // The golden poses are in base_link, 0.051 m above base_footprint.
        let target = Isometry3::from_parts(
            (Vector3::from(pose.pos_xyz) + Vector3::z() * 0.051).into(),
            UnitQuaternion::from_rotation_matrix(&rotation),
        );
        for golden in &pose.ik {
            arm.ik().solve(&target, golden.upper_arm_roll, &mut solutions);
            assert_eq!(solutions.len(), golden.solutions.len(), "missed or extra: {target}");
            calls += 1;
            for theirs in &golden.solutions {
                let nearest = solutions
                    .iter()
                    .map(|ours| farthest(&ours.q[..7], &theirs.q))
                    .fold(f64::INFINITY, f64::min);
                worst = worst.max(nearest);
                found += 1;
            }
        }
    }
    println!("{calls} calls, {found} solutions, worst difference {worst:.1e} rad");
    assert_eq!((calls, found), (4000, 21_456));
    assert!(worst <= 1e-8, "{worst}");
}

/// Every solution reaches the pose, one of them is the configuration that made it, each branch
/// followed alone gives the same solution, and branches are told apart.
fn round_trip(arm: &Arm, ik: &dyn InverseKinematics, count: usize, seed: u64) -> f64 {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut solutions = Solutions::new();
    let given = ik.redundant_joint().unwrap();
    let mut worst: f64 = 0.0;
    for _ in 0..count {
        let q = random(arm, &mut rng);
        let target = arm.tip_pose(&q);
        ik.solve(&target, q[given], &mut solutions);
        let mut nearest = f64::INFINITY;
        for (i, solution) in solutions.iter().enumerate() {
            let reached = arm.tip_pose(&solution.q);
            let shift = (reached.translation.vector - target.translation.vector).norm();
            let turn = reached.rotation.angle_to(&target.rotation);
            assert!(shift < 1e-9 && turn < 1e-7, "{shift} {turn} {q:?}");
            worst = worst.max(shift);
            nearest = nearest.min(farthest(&q, &solution.q));
            assert_eq!(solution.q[7], 0.0);
            assert!(solutions[..i].iter().all(|other| other.branch != solution.branch));
            let alone = ik.solve_on(solution.branch, &target, q[given], &solution.q).unwrap();
            assert!(farthest(&alone.q, &solution.q) < 1e-9, "{alone:?} {solution:?}");
        }
        // Near a fold the configuration is as loose as the root of the rounding.
        assert!(nearest < 1e-5, "{nearest} {q:?} {solutions:?}");
    }
    worst
}

#[test]
fn closed_form_gives_back_the_pose_and_the_configuration() {
    for side in [Side::Right, Side::Left] {
        let arm = arm(side);
        for joint in [RedundantJoint::UpperArmRoll, RedundantJoint::ShoulderPan] {
            let worst = round_trip(&arm, arm.ik_by(joint).unwrap(), 50_000, 2);
            println!("{side:?} {joint:?}: worst position error {worst:.1e} m");
        }
    }
}

#[test]
#[ignore = "a million configurations an arm and solver: under a minute; run with --ignored"]
fn closed_form_gives_back_a_million_configurations() {
    for side in [Side::Right, Side::Left] {
        let arm = arm(side);
        for joint in [RedundantJoint::UpperArmRoll, RedundantJoint::ShoulderPan] {
            let worst = round_trip(&arm, arm.ik_by(joint).unwrap(), 1_000_000, 3);
            println!("{side:?} {joint:?}: worst position error {worst:.1e} m");
        }
    }
}

/// A joint path followed by its tip poses alone stays on its branch and comes out where it went.
#[test]
fn one_branch_follows_a_path_without_a_jump() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let arm = arm(Side::Right);
    let mut solutions = Solutions::new();
    for joint in [RedundantJoint::UpperArmRoll, RedundantJoint::ShoulderPan] {
        let ik = arm.ik_by(joint).unwrap();
        let given = ik.redundant_joint().unwrap();
        let (mut followed, mut ended) = (0, 0);
        for _ in 0..300 {
            let (from, mut to) = (random(&arm, &mut rng), random(&arm, &mut rng));
            to[4] += 7.0; // more than a turn of a continuous joint
            let at = |t: f64| -> JointVector {
                JointVector::from_fn(|i| from[i] + (to[i] - from[i]) * t)
            };
            ik.solve(&arm.tip_pose(&from), from[given], &mut solutions);
            let start = solutions.iter().find(|s| farthest(&s.q, &from) < 1e-6).unwrap();
            let (branch, mut near) = (start.branch, from);
            let steps = 400;
            let mut whole = true;
            for k in 1..=steps {
                let q = at(f64::from(k) / f64::from(steps));
                let Some(next) = ik.solve_on(branch, &arm.tip_pose(&q), q[given], &near) else {
                    whole = false;
                    break;
                };
                let off = next.q.iter().zip(&q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                if off > 1e-5 {
                    // The path went through a fold onto the branch that meets this one there.
                    whole = false;
                    break;
                }
                near = next.q;
            }
            if whole {
                followed += 1;
            } else {
                ended += 1;
            }
        }
        println!("{joint:?}: {followed} paths followed to their end, {ended} crossed a fold");
        assert!(followed > 100);
    }
}

/// Every solution reaches the target, and there is at least one.
fn check_reached(arm: &Arm, ik: &dyn InverseKinematics, q: &JointVector, within: f64) -> Solutions {
    let target = arm.tip_pose(q);
    let mut solutions = Solutions::new();
    ik.solve(&target, q[ik.redundant_joint().unwrap()], &mut solutions);
    assert!(!solutions.is_empty(), "{q:?}");
    for s in &solutions {
        assert!(s.q.iter().all(|v| v.is_finite()), "{s:?}");
        let off = (arm.tip_pose(&s.q).to_homogeneous() - target.to_homogeneous()).amax();
        assert!(off < within, "{off} {q:?} {s:?}");
        let alone = ik.solve_on(s.branch, &target, s.redundancy, q).unwrap();
        let off = (arm.tip_pose(&alone.q).to_homogeneous() - target.to_homogeneous()).amax();
        assert!(off < within, "{off} {q:?} {alone:?}");
    }
    solutions
}

#[test]
fn singular_postures_are_solved() {
    let arm = arm(Side::Right);
    let generic = JointVector::new([-0.5, 0.4, -1.2, -1.3, 0.7, -1.1, 0.4, 0.0]);
    let with = |changes: &[(usize, f64)]| {
        let mut q = generic;
        for &(i, value) in changes {
            q[i] = value;
        }
        q
    };
    for joint in [RedundantJoint::UpperArmRoll, RedundantJoint::ShoulderPan] {
        let ik = arm.ik_by(joint).unwrap();
        // The wrist straight, or folded back: one solution for both wrists, and its own roll kept
        // by the branch that is followed.
        for flex in [0.0, std::f64::consts::PI] {
            let q = with(&[(5, flex)]);
            let solutions = check_reached(&arm, ik, &q, 1e-9);
            let straight = solutions.iter().find(|s| farthest(&s.q[..4], &q[..4]) < 1e-6).unwrap();
            let near =
                ik.solve_on(straight.branch, &arm.tip_pose(&q), straight.redundancy, &q).unwrap();
            assert!(farthest(&near.q, &q) < 1e-6, "{near:?}");
        }
        // Nearly straight.
        for flex in [1e-12, 1e-9, 3e-9, 1e-6, -1e-7] {
            check_reached(&arm, ik, &with(&[(5, flex)]), 1e-8);
        }
        // The elbow straight, and nearly so.
        for elbow in [0.0, -1e-12, -1e-9, -1e-7, -1e-4] {
            check_reached(&arm, ik, &with(&[(3, elbow)]), 1e-7);
        }
        // Elbow and wrist straight.
        check_reached(&arm, ik, &with(&[(3, 0.0), (5, 0.0)]), 1e-7);
        // The roll at 0, where elbow and shoulder are in one plane, and at a quarter turn.
        check_reached(&arm, ik, &with(&[(2, 0.0)]), 1e-9);
        check_reached(&arm, ik, &with(&[(2, -std::f64::consts::FRAC_PI_2)]), 1e-7);
    }
}

#[test]
fn wrist_centre_on_the_pan_axis_keeps_its_pan() {
    let arm = arm(Side::Right);
    // With the roll at 0 the arm folds in its own plane; the elbow that brings the wrist centre over
    // the pan axis.
    let (a, l1, l2, lift) = (0.1, 0.4, 0.321, 1.2f64);
    let out = |elbow: f64| a + l1 * lift.cos() + l2 * (lift + elbow).cos();
    let (mut low, mut high) = (0.5, 1.9);
    assert!(out(low) > 0.0 && out(high) < 0.0);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if out(middle) > 0.0 { low = middle } else { high = middle }
    }
    let q = JointVector::new([-0.4, lift, 0.0, low, 0.3, -0.8, 0.2, 0.0]);
    let target = arm.tip_pose(&q);
    let solutions = check_reached(&arm, arm.ik(), &q, 1e-7);
    let found = solutions
        .iter()
        .filter_map(|s| arm.ik().solve_on(s.branch, &target, 0.0, &q))
        .any(|s| farthest(&s.q, &q) < 1e-6);
    assert!(found, "{solutions:?}");
}

#[test]
fn unreachable_and_broken_targets_have_no_solution() {
    let arm = arm(Side::Right);
    let mut out = Solutions::new();
    let near = arm.home();
    for joint in [RedundantJoint::UpperArmRoll, RedundantJoint::ShoulderPan] {
        let ik = arm.ik_by(joint).unwrap();
        let mut far = arm.tip_pose(&near);
        far.translation.x += 1.0;
        for (target, value) in [
            (far, -1.0),
            (Isometry3::translation(f64::NAN, 0.0, 0.0), -1.0),
            (Isometry3::translation(f64::INFINITY, 0.0, 0.0), -1.0),
            (arm.tip_pose(&near), f64::NAN),
        ] {
            ik.solve(&target, value, &mut out);
            assert!(out.is_empty(), "{out:?}");
            for branch in 0..=u8::MAX {
                assert!(ik.solve_on(Branch(branch), &target, value, &near).is_none());
            }
        }
    }
}
