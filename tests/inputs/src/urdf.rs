//! A URDF, and every arm that it could have.

use nullsweep_robot::{Arm, ArmSpec, Robot, Solutions};

/// Arms that are made of one robot.
const ARMS: usize = 4;

pub(crate) fn run(bytes: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(bytes) else { return false };
    let Ok(robot) = Robot::from_urdf_str(text) else { return false };
    let base = robot.links()[robot.root()].name.clone();
    let parents: Vec<usize> = robot.joints().iter().map(|joint| joint.parent).collect();
    let leaves = (0..robot.links().len()).filter(|link| !parents.contains(link)).take(ARMS);
    let specs =
        leaves.map(|tip| ArmSpec { base: base.clone(), tip: robot.links()[tip].name.clone() });
    let arms: Vec<Arm> = specs.filter_map(|spec| robot.arm(&spec).ok()).collect();
    arms.iter().for_each(ask);
    !arms.is_empty()
}

/// What planner and executor ask of an arm.
fn ask(arm: &Arm) {
    let home = arm.home();
    for q in [home, arm.spread(1), arm.spread(7)] {
        assert!(q.iter().all(|x| x.is_finite()), "a posture is no number: {q:?}");
        let (tip, _) = arm.tip_pose_and_jacobian(&q);
        assert_eq!(tip, arm.tip_pose(&q));
        let mut found = Solutions::new();
        arm.ik().solve(&tip, q[0], &mut found);
    }
    for j in 0..arm.dof() {
        let (low, high) = arm.margined_limits()[j];
        assert!(low <= high, "margins cross at {}", arm.joint_names()[j]);
        let (low, high) = arm.braking_limits(j, arm.limits()[j].velocity);
        assert!(!low.is_nan() && !high.is_nan());
    }
    let again = arm.robot().arm(arm.spec()).expect("it was made before");
    assert_eq!(again.fingerprint(), arm.fingerprint());
}
