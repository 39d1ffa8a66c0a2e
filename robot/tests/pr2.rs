//! The PR2's arms against the published robot and against themselves.

use std::path::PathBuf;

use nullsweep_robot::{Arm, ArmSpec, JointVector, Robot, Side, Solutions};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn data(path: &str) -> Option<PathBuf> {
    let file = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data")).join(path);
    if file.exists() {
        return Some(file);
    }
    println!("skipped: {} is not there", file.display());
    None
}

fn arm(side: Side) -> Arm {
    Robot::pr2().arm(&ArmSpec::pr2(side)).unwrap()
}

/// Uniform in the limits, continuous joints in ±π.
fn random(arm: &Arm, rng: &mut impl Rng) -> JointVector {
    let mut q = [0.0; 8];
    for (q, limits) in q.iter_mut().zip(arm.limits()) {
        *q = if limits.continuous {
            rng.random_range(-std::f64::consts::PI..std::f64::consts::PI)
        } else {
            rng.random_range(limits.lower..limits.upper)
        };
    }
    q
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

#[test]
fn closed_form_gives_back_the_pose_and_the_configuration() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let mut solutions = Solutions::new();
    for side in [Side::Right, Side::Left] {
        let arm = arm(side);
        let mut worst: f64 = 0.0;
        for _ in 0..100_000 {
            let q = random(&arm, &mut rng);
            let target = arm.tip_pose(&q);
            arm.ik().solve(&target, q[2], &mut solutions);
            let mut nearest = f64::INFINITY;
            for solution in &solutions {
                let reached = arm.tip_pose(&solution.q);
                let shift = (reached.translation.vector - target.translation.vector).norm();
                let turn = reached.rotation.angle_to(&target.rotation);
                worst = worst.max(shift);
                assert!(shift < 1e-9 && turn < 1e-7, "{shift} {turn} {q:?}");
                let distance =
                    q.iter().zip(&solution.q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                nearest = nearest.min(distance);
            }
            assert!(nearest < 1e-5, "{nearest} {q:?} {solutions:?}");
        }
        println!("{side:?}: worst position error {worst:.2e} m");
    }
}
