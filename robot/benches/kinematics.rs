//! Kinematics on one core: `cargo bench -p nullsweep-robot`. The crate `k` and the own numeric solver
//! on the same targets are the baselines of the closed form.

use divan::{Bencher, black_box};
use k::InverseKinematicsSolver;
use nullsweep_robot::{Arm, ArmSpec, JointVector, Robot, Side, Solutions};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn main() {
    divan::main();
}

/// As many different configurations as make a branch predictor work.
const COUNT: usize = 1024;

fn pr2() -> Arm {
    Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).expect("the PR2 has a right arm")
}

fn configurations(arm: &Arm) -> Vec<JointVector> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut one = || {
        let mut q = JointVector::ZERO;
        for (q, l) in q.iter_mut().zip(arm.limits()) {
            *q = rng.random_range(l.lower.max(-3.0)..l.upper.min(3.0));
        }
        q
    };
    (0..COUNT).map(|_| one()).collect()
}

#[divan::bench(sample_size = 1000)]
fn pr2_forward(bencher: Bencher<'_, '_>) {
    let arm = pr2();
    let qs = configurations(&arm);
    let mut i = 0;
    bencher.bench_local(|| {
        i = (i + 1) % COUNT;
        arm.tip_pose(black_box(&qs[i]))
    });
}

#[divan::bench(sample_size = 1000)]
fn pr2_jacobian(bencher: Bencher<'_, '_>) {
    let arm = pr2();
    let qs = configurations(&arm);
    let mut i = 0;
    bencher.bench_local(|| {
        i = (i + 1) % COUNT;
        arm.jacobian(black_box(&qs[i]))
    });
}

#[divan::bench(sample_size = 1000)]
fn pr2_link_poses(bencher: Bencher<'_, '_>) {
    let arm = pr2();
    let qs = configurations(&arm);
    let mut out = vec![nalgebra::Isometry3::identity(); arm.robot().links().len()];
    let mut i = 0;
    bencher.bench_local(|| {
        i = (i + 1) % COUNT;
        arm.link_poses(black_box(&qs[i]), &mut out);
    });
}

#[divan::bench(sample_size = 1000)]
fn pr2_inverse_all_for_one_roll(bencher: Bencher<'_, '_>) {
    let arm = pr2();
    let qs = configurations(&arm);
    let targets: Vec<_> = qs.iter().map(|q| (arm.tip_pose(q), q[2])).collect();
    let mut out = Solutions::new();
    let mut i = 0;
    bencher.bench_local(|| {
        i = (i + 1) % COUNT;
        let (target, roll) = black_box(&targets[i]);
        arm.ik().solve(target, *roll, &mut out);
        out.len()
    });
}

#[divan::bench(sample_size = 1000)]
fn pr2_inverse_on_one_branch(bencher: Bencher<'_, '_>) {
    let arm = pr2();
    let qs = configurations(&arm);
    let mut out = Solutions::new();
    let cases: Vec<_> = qs
        .iter()
        .map(|q| {
            let target = arm.tip_pose(q);
            arm.ik().solve(&target, q[2], &mut out);
            (target, *q, out[0].branch)
        })
        .collect();
    let mut i = 0;
    bencher.bench_local(|| {
        i = (i + 1) % COUNT;
        let (target, q, branch) = black_box(&cases[i]);
        arm.ik().solve_on(*branch, target, q[2], q)
    });
}

/// The right arm as the crate `k` has it, from the same URDF.
fn k_arm() -> k::SerialChain<f64> {
    let urdf = concat!(env!("CARGO_MANIFEST_DIR"), "/pr2.urdf");
    let robot = k::Chain::<f64>::from_urdf_file(urdf).expect("k reads the PR2");
    let node = |name: &str| robot.find(name).expect("a joint of the PR2").clone();
    k::SerialChain::from_end_to_root(&node("r_gripper_tool_joint"), &node("r_shoulder_pan_joint"))
}

/// Baseline of [`pr2_forward`].
#[divan::bench(sample_size = 100)]
fn k_forward(bencher: Bencher<'_, '_>) {
    let (arm, k) = (pr2(), k_arm());
    let qs = configurations(&arm);
    let mut i = 0;
    bencher.bench_local(|| {
        i = (i + 1) % COUNT;
        k.set_joint_positions_unchecked(black_box(&qs[i][..7]));
        k.end_transform()
    });
}

/// Baseline of [`pr2_inverse_all_for_one_roll`]: one solution within 1 mm and 5 mrad from a start
/// that is a tenth of a radian off in each joint, its roll free.
#[divan::bench(sample_size = 10)]
fn k_inverse_one_near_the_start(bencher: Bencher<'_, '_>) {
    let (arm, k) = (pr2(), k_arm());
    let solver = k::JacobianIkSolver::default();
    let cases: Vec<_> = configurations(&arm)
        .into_iter()
        .map(|q| {
            k.set_joint_positions_unchecked(&q[..7]);
            (k.end_transform(), q.map(|v| v + 0.1))
        })
        .collect();
    let mut i = 0;
    let (mut solved, mut asked) = (0, 0);
    bencher.bench_local(|| {
        i = (i + 1) % COUNT;
        let (target, start) = black_box(&cases[i]);
        k.set_joint_positions_clamped(&start[..7]);
        asked += 1;
        solved += usize::from(solver.solve(&k, target).is_ok());
    });
    println!("k solved {solved} of {asked}");
}

/// The same targets as [`pr2_inverse_all_for_one_roll`], by the solver for arms of any shape.
#[divan::bench(sample_size = 10)]
fn pr2_inverse_numeric_cold(bencher: Bencher<'_, '_>) {
    let arm = pr2();
    let numeric = arm.numeric_ik();
    let qs = configurations(&arm);
    let targets: Vec<_> = qs.iter().map(|q| (arm.tip_pose(q), q[2])).collect();
    let mut out = Solutions::new();
    let mut i = 0;
    bencher.bench_local(|| {
        i = (i + 1) % COUNT;
        let (target, roll) = black_box(&targets[i]);
        numeric.solve(target, *roll, &mut out);
        out.len()
    });
}

/// One step along a path, a hundredth of a radian a joint, from the solution before.
#[divan::bench(sample_size = 1000)]
fn pr2_inverse_numeric_warm(bencher: Bencher<'_, '_>) {
    let arm = pr2();
    let numeric = arm.numeric_ik();
    let mut out = Solutions::new();
    let cases: Vec<_> = configurations(&arm)
        .iter()
        .filter(|q| arm.within_margins(q))
        .filter_map(|q| {
            let mut near = *q;
            near.iter_mut().take(arm.dof()).for_each(|v| *v += 0.01);
            numeric.solve(&arm.tip_pose(q), q[2], &mut out);
            let close = |s: &&nullsweep_robot::Solution| (s.q[0] - q[0]).abs() < 1e-4;
            let branch = out.iter().find(close)?.branch;
            Some((arm.tip_pose(q), *q, near, branch))
        })
        .collect();
    let mut i = 0;
    bencher.bench_local(|| {
        i = (i + 1) % cases.len();
        let (target, q, near, branch) = black_box(&cases[i]);
        numeric.solve_on(*branch, target, q[2], near)
    });
}
