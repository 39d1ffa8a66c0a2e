//! What every test here needs.

use nullsweep_robot::{Arm, ArmSpec, Robot, Side};
use nullsweep_tests::stage::{Process, Stage};
use nullsweep_tests::system;
use serde_json::Value;

/// A stage whose processes are the demo program.
pub(crate) fn stage() -> Stage {
    Stage::new(env!("CARGO_BIN_EXE_demo"), "pr2").expect("a folder for the test")
}

/// The arm that all tests move.
pub(crate) fn right_arm() -> Arm {
    Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).expect("the PR2 has a right arm")
}

/// Ends the mock and reads its verdict.
pub(crate) fn verdict(stage: &Stage, mock: &mut Process) -> Value {
    system::verdict(stage, mock).unwrap_or_else(|e| panic!("{e:#}"))
}
