//! Numeric inverse kinematics on arms that are not the PR2's.

mod common;

use std::time::Instant;

use common::{data, farthest, random};
use nalgebra::Vector3;
use nullsweep_robot::{Arm, ArmSpec, JointVector, Robot, Side, Solutions};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn arm(file: &str, base: &str, tip: &str) -> Option<Arm> {
    let robot = Robot::from_urdf_file(&data(file)?).unwrap();
    Some(robot.arm(&ArmSpec { base: base.into(), tip: tip.into() }).unwrap())
}

fn arms() -> Vec<(&'static str, Arm)> {
    let found = [
        ("ur5", arm("coverage-tasks/ur5.urdf", "base_link", "tool_tip")),
        ("panda", arm("coverage-tasks/panda.urdf", "panda_link0", "panda_hand")),
        ("iiwa", arm("robots/iiwa.urdf", "iiwa_link_0", "iiwa_link_ee")),
    ];
    found.into_iter().filter_map(|(name, arm)| Some((name, arm?))).collect()
}

#[test]
fn solutions_reach_the_target_inside_the_limits_and_the_posture_is_found() {
    for (name, arm) in arms() {
        let ik = arm.numeric_ik();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let (mut out, mut again) = (Solutions::new(), Solutions::new());
        let (count, mut found, mut total, mut ambiguous) = (300, 0, 0, 0);
        let clock = Instant::now();
        for _ in 0..count {
            let q = random(&arm, &mut rng);
            let target = arm.tip_pose(&q);
            let redundancy = ik.redundant_joint().map_or(0.0, |joint| q[joint]);
            ik.solve(&target, redundancy, &mut out);
            for (i, solution) in out.iter().enumerate() {
                let reached = arm.tip_pose(&solution.q);
                let shift = (reached.translation.vector - target.translation.vector).norm();
                assert!(shift < 1e-9 && reached.rotation.angle_to(&target.rotation) < 1e-7);
                assert!(arm.within_margins(&solution.q), "{name} {solution:?}");
                assert!(out[..i].iter().all(|s| s.branch != solution.branch));
                ambiguous += usize::from(solution.branch.0 >> 5 != 0);
            }
            found += usize::from(out.iter().any(|s| farthest(&s.q, &q) < 1e-4));
            total += out.len();
        }
        println!(
            "{name}: found {found} of {count}, {:.2} solutions a target, {ambiguous} share their \
             signs, {:.0} µs a call",
            total as f64 / count as f64,
            clock.elapsed().as_secs_f64() * 1e6 / count as f64
        );
        // The same call gives the same bits.
        let target = arm.tip_pose(&arm.home());
        ik.solve(&target, 0.1, &mut out);
        ik.solve(&target, 0.1, &mut again);
        assert_eq!(out, again);
        assert!(found * 100 >= count * 98, "{name}: {found} of {count}");
    }
}

#[test]
fn a_branch_is_followed_along_a_path() {
    for (name, arm) in arms() {
        let ik = arm.numeric_ik();
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let (mut whole, mut steps) = (0, 0);
        let (count, parts) = (100, 50);
        let clock = Instant::now();
        let mut out = Solutions::new();
        for _ in 0..count {
            let from = random(&arm, &mut rng);
            let mut to = from;
            for (q, &(lower, upper)) in to.iter_mut().zip(arm.margined_limits()) {
                *q = (*q + rng.random_range(-0.4..0.4)).clamp(lower, upper);
            }
            let redundant = ik.redundant_joint();
            let value = |q: &JointVector| redundant.map_or(0.0, |joint| q[joint]);
            ik.solve(&arm.tip_pose(&from), value(&from), &mut out);
            let Some(start) = out.iter().find(|s| farthest(&s.q, &from) < 1e-4) else { continue };
            let (branch, mut near) = (start.branch, start.q);
            let mut reached = true;
            for k in 1..=parts {
                let t = f64::from(k) / f64::from(parts);
                let q: JointVector = JointVector::from_fn(|i| from[i] + (to[i] - from[i]) * t);
                steps += 1;
                let Some(next) = ik.solve_on(branch, &arm.tip_pose(&q), value(&q), &near) else {
                    reached = false;
                    break;
                };
                assert_eq!(next.branch, branch);
                if farthest(&next.q, &q) > 1e-4 {
                    reached = false;
                    break;
                }
                near = next.q;
            }
            whole += usize::from(reached);
        }
        println!(
            "{name}: {whole} of {count} paths followed, {:.2} µs a step",
            clock.elapsed().as_secs_f64() * 1e6 / f64::from(steps)
        );
        assert!(whole >= 50, "{name}: {whole}");
    }
}

/// The PR2's torso and arm together: eight joints, one more than the closed form knows.
#[test]
fn eight_joints_are_solved() {
    let spec = ArmSpec { base: "base_link".into(), tip: "r_gripper_tool_frame".into() };
    let arm = Robot::pr2().arm(&spec).unwrap();
    assert_eq!(arm.dof(), 8);
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut out = Solutions::new();
    let mut solved = 0;
    for _ in 0..100 {
        let q = random(&arm, &mut rng);
        let target = arm.tip_pose(&q);
        arm.ik().solve(&target, q[arm.ik().redundant_joint().unwrap()], &mut out);
        solved += usize::from(!out.is_empty());
        for solution in &out {
            let reached = arm.tip_pose(&solution.q);
            assert!((reached.translation.vector - target.translation.vector).norm() < 1e-9);
            assert!(arm.within_margins(&solution.q));
        }
    }
    assert!(solved >= 95, "{solved}");
}

/// Five joints meet position and approach direction; the turn about it is free.
#[test]
fn five_joints_meet_position_and_direction() {
    let spec = ArmSpec { base: "r_upper_arm_link".into(), tip: "r_gripper_tool_frame".into() };
    let four = Robot::pr2().arm(&spec).unwrap();
    assert_eq!(four.dof(), 4);
    let spec = ArmSpec { base: "r_shoulder_lift_link".into(), ..spec };
    let arm = Robot::pr2().arm(&spec).unwrap();
    assert_eq!((arm.dof(), arm.ik().redundancy_range()), (5, None));
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut out = Solutions::new();
    let mut solved = 0;
    for _ in 0..100 {
        let q = random(&arm, &mut rng);
        let mut target = arm.tip_pose(&q);
        let turn = rng.random_range(-3.0..3.0);
        target.rotation *= nalgebra::UnitQuaternion::from_axis_angle(&Vector3::x_axis(), turn);
        arm.ik().solve(&target, 0.0, &mut out);
        solved += usize::from(!out.is_empty());
        for solution in &out {
            let reached = arm.tip_pose(&solution.q);
            assert!((reached.translation.vector - target.translation.vector).norm() < 1e-9);
            let (a, b) = (reached.rotation * Vector3::x(), target.rotation * Vector3::x());
            assert!((a - b).norm() < 1e-9);
        }
    }
    assert!(solved >= 95, "{solved}");
}

#[test]
fn jacobian_is_the_derivative_of_the_pose() {
    let mut all: Vec<(&str, Arm)> = arms();
    all.push(("pr2", Robot::pr2().arm(&ArmSpec::pr2(Side::Left)).unwrap()));
    let torso = ArmSpec { base: "base_link".into(), tip: "l_gripper_tool_frame".into() };
    all.push(("pr2 with torso", Robot::pr2().arm(&torso).unwrap()));
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    for (name, arm) in all {
        for _ in 0..200 {
            let q = random(&arm, &mut rng);
            let jacobian = arm.jacobian(&q);
            for i in 0..arm.dof() {
                let h = 1e-6;
                let (mut before, mut after) = (q, q);
                before[i] -= h;
                after[i] += h;
                let (a, b) = (arm.tip_pose(&before), arm.tip_pose(&after));
                let linear = (b.translation.vector - a.translation.vector) / (2.0 * h);
                let angular = (b.rotation * a.rotation.inverse()).scaled_axis() / (2.0 * h);
                let column = jacobian.column(i);
                assert!((column.fixed_rows::<3>(0) - linear).amax() < 1e-8, "{name} joint {i}");
                assert!((column.fixed_rows::<3>(3) - angular).amax() < 1e-8, "{name} joint {i}");
            }
            for i in arm.dof()..8 {
                assert_eq!(jacobian.column(i).amax(), 0.0);
            }
        }
    }
}

/// Two derivations, one answer: what the numeric solver finds for the PR2 is what the closed form
/// says, and it finds nearly all of it.
#[test]
fn numeric_and_closed_form_agree_on_the_pr2() {
    for side in [Side::Right, Side::Left] {
        let arm = Robot::pr2().arm(&ArmSpec::pr2(side)).unwrap();
        let numeric = arm.numeric_ik();
        assert_eq!(numeric.redundant_joint(), arm.ik().redundant_joint());
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let (mut closed, mut found) = (Solutions::new(), Solutions::new());
        let (mut both, mut all) = (0, 0);
        for _ in 0..200 {
            let q = random(&arm, &mut rng);
            let target = arm.tip_pose(&q);
            arm.ik().solve(&target, q[2], &mut closed);
            numeric.solve(&target, q[2], &mut found);
            for solution in &found {
                assert!(closed.iter().any(|s| farthest(&s.q, &solution.q) < 1e-4), "{solution:?}");
            }
            for solution in closed.iter().filter(|s| arm.within_margins(&s.q)) {
                all += 1;
                both += usize::from(found.iter().any(|s| farthest(&s.q, &solution.q) < 1e-4));
            }
        }
        println!("{side:?}: {both} of {all} solutions inside the margins found numerically");
        assert!(both * 100 >= all * 97, "{both} of {all}");
    }
}
