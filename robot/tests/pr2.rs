//! The PR2's arms against the published robot and against themselves.

mod common;

use std::fs::File;
use std::io::{BufRead, BufReader};

use common::{data, farthest, random};
use flate2::read::GzDecoder;
use nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, Vector3};
use nullsweep_robot::{
    Arm, ArmSpec, InverseKinematics, JointVector, RedundantJoint, Robot, Side, Solutions,
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
                std::array::from_fn(|i| from[i] + (to[i] - from[i]) * t)
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
