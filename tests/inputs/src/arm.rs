//! A small arm: three joints, one of them without end, and shapes that can collide.

use std::sync::OnceLock;

use nullsweep_robot::{Arm, ArmSpec, Robot};

const URDF: &str = include_str!("../corpus/urdf/sound-three.urdf");

/// The robot, and its arm.
pub(crate) fn arm() -> &'static (Robot, Arm) {
    static ARM: OnceLock<(Robot, Arm)> = OnceLock::new();
    ARM.get_or_init(|| {
        let robot = Robot::from_urdf_str(URDF).expect("a sound URDF");
        let arm = robot.arm(&spec()).expect("its arm");
        (robot, arm)
    })
}

/// Its base and tip.
pub(crate) fn spec() -> ArmSpec {
    ArmSpec { base: "base".into(), tip: "tip".into() }
}
