//! The exit codes of the command line, and that a plan which breaks a rule is not written.

use std::path::Path;
use std::process::{Command, Output};

use nullsweep_planner::plan::Plan;
use nullsweep_robot::{Arm, ArmSpec, Robot, Side};

fn planner(folder: &Path, args: &str) -> (Option<i32>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_planner"));
    let Output { status, stderr, .. } =
        command.args(args.split(' ')).current_dir(folder).output().expect("it starts");
    (status.code(), String::from_utf8_lossy(&stderr).into_owned())
}

const SEAT: &str = "plan --demo chair-seat --profile acceleration --ik-samples 12 --refinements 0";

/// The joint nearest to its velocity in a knot, as a share of it.
fn haste(arm: &Arm, plan: &Plan, knot: usize) -> f64 {
    let shares = arm.limits().iter().zip(&plan.knots[knot].v).map(|(l, v)| v.abs() / l.velocity);
    shares.fold(0.0, f64::max)
}

/// As if it had been made for an arm that is twice as fast.
fn hurried(mut plan: Plan) -> Plan {
    for knot in &mut plan.knots {
        knot.time_ns /= 2;
        knot.v.iter_mut().for_each(|v| *v *= 2.0);
    }
    plan
}

#[test]
fn a_sound_plan_is_written_and_one_that_goes_on_from_a_broken_one_is_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str| folder.path().join(name);
    let place = "--base -0.708,-0.004,1.047 --torso 0.2";
    let (code, said) = planner(folder.path(), &format!("{SEAT} {place} --out sound.json"));
    assert_eq!(code, Some(0), "{said}");
    let plan = Plan::read(&file("sound.json")).expect("a plan file");

    // The arm is to take over where that plan is faster than it may be: it follows it to where it
    // can brake.
    let arm = Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).expect("an arm");
    let middle = plan.knots.len() / 2..plan.knots.len() * 3 / 4;
    let fastest = |a: &usize, b: &usize| haste(&arm, &plan, *a).total_cmp(&haste(&arm, &plan, *b));
    let knot = middle.max_by(fastest).expect("knots");
    assert!(haste(&arm, &plan, knot) > 0.6);
    hurried(plan).write(&file("hurried.json")).expect("written");
    std::fs::write(file("kept.json"), "what was there before").expect("written");
    for out in ["new.json", "kept.json"] {
        let go_on = format!("{SEAT} --continue hurried.json@{knot} --out {out}");
        let (code, said) = planner(folder.path(), &go_on);
        assert_eq!(code, Some(3), "{said}");
        assert!(said.contains("violation at knot 1: Velocity: r_"), "{said}");
        assert!(said.contains("rules and was not written"), "{said}");
    }
    assert!(!file("new.json").exists());
    assert_eq!(std::fs::read(file("kept.json")).expect("a file"), b"what was there before");
}

#[test]
fn a_scan_that_cannot_be_read_fails() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("broken.pcd"), "no points").expect("written");
    for scan in ["missing.pcd", "broken.pcd"] {
        let (code, said) = planner(folder.path(), &format!("plan {scan} --out plan.json"));
        assert_eq!(code, Some(1), "{said}");
        assert!(said.contains("planner: ") && said.contains(scan), "{said}");
        assert!(!folder.path().join("plan.json").exists());
    }
}

#[test]
fn an_unknown_flag_is_wrong_usage() {
    let folder = tempfile::tempdir().expect("a folder");
    for args in ["plan --demo chair-seat --hurry", "plan --ik-samples 0", "plan", "sweep"] {
        let (code, said) = planner(folder.path(), args);
        assert_eq!(code, Some(2), "{args}: {said}");
        assert!(said.contains("--help"), "{args}: {said}");
        assert!(!folder.path().join("plan.json").exists());
    }
}
