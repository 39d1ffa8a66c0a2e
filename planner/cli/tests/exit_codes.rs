//! The exit codes of the command line, and that a plan which breaks a rule is not written.

use std::path::Path;
use std::process::{Command, Output};

use nullsweep_planner::plan::{Plan, PlanKnot, Profile};
use nullsweep_robot::{Arm, ArmSpec, JointVector, Robot, Side, Tool};

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
    let moving = 1..plan.knots.len() - 1;
    let fastest = |a: &usize, b: &usize| haste(&arm, &plan, *a).total_cmp(&haste(&arm, &plan, *b));
    let knot = moving.max_by(fastest).expect("knots");
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

#[test]
fn a_number_that_makes_no_sense_is_wrong_usage() {
    let folder = tempfile::tempdir().expect("a folder");
    for args in [
        "plan --demo chair-seat --v-max 0",
        "plan --demo chair-seat --v-max=-1",
        "plan --demo chair-seat --v-max NaN",
        "plan --demo chair-seat --v-max inf",
        "plan --demo chair-seat --v-max 1e-300",
        "plan --demo chair-seat --torso NaN",
        "plan --demo chair-seat --start 0,nan,0",
        "plan --demo chair-seat --held torso_lift_joint=inf",
        "plan --demo chair-seat --base 0,0,inf",
        "plan --demo chair-seat --patch-radius 0",
        "plan --demo chair-seat --radius=-1",
        "plan --demo chair-seat --beta NaN",
        "plan scan.pcd --scale 0",
        "plan scan.pcd --support-height NaN",
        "task poses.csv --v-max 0",
        "publish plan.json --timeout NaN",
        "publish plan.json --timeout=-1",
        "replan --running plan.json --demo chair-seat --lead 1e300",
    ] {
        let (code, said) = planner(folder.path(), args);
        assert_eq!(code, Some(2), "{args}: {said}");
        let flag = args.split([' ', '=']).rev().nth(1).expect("a flag");
        assert!(said.contains(flag), "{args}: {said}");
    }
}

/// Files that are no plan or no tool are told as that, at once, whoever reads them.
#[test]
fn a_plan_or_a_tool_that_cannot_be_fails_with_its_field() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| {
        std::fs::write(folder.path().join(name), text).expect("written");
    };
    let robot = Robot::pr2();
    let arm = robot.arm(&ArmSpec::pr2(Side::Right)).expect("an arm");
    let mut plan = Plan::of(&robot, &arm, &Tool::default(), vec![knot(0), knot(1_000_000)]);
    plan.joints = (0..9).map(|j| format!("joint_{j}")).collect();
    write("nine.json", &serde_json::to_string(&plan).expect("numbers"));
    plan.joints = Vec::new();
    write("none.json", &serde_json::to_string(&plan).expect("numbers"));
    plan.joints = arm.joint_names().to_vec();
    plan.knots.swap(0, 1);
    plan.profile = Profile::Acceleration;
    write("falling.json", &serde_json::to_string(&plan).expect("numbers"));
    let tool = toml::to_string(&Tool::default()).expect("a table");
    write("thin.toml", &tool.replace("thickness = 0.03", "thickness = -0.03"));
    write("wide.toml", &tool.replace("width = 0.07", "width = nan"));
    write("turned.toml", &tool.replace("across = [0.0, 1.0, 0.0]", "across = [2.0, 0.0, 0.0]"));
    write("poses.csv", "0.5,0,0.5,0,0,0,1");
    let on = "plan --demo chair-seat --profile acceleration --continue";
    for (args, says) in [
        ("inspect nine.json".to_owned(), "9 joints: 1 to 8 are wanted"),
        ("export nine.json --format csv".to_owned(), "9 joints: 1 to 8 are wanted"),
        ("inspect none.json".to_owned(), "0 joints"),
        (format!("{on} falling.json@0"), "knot 1: time 0 ns does not come after 1000000 ns"),
        ("task poses.csv --tool thin.toml".to_owned(), "thickness is -0.03 m"),
        ("plan --demo chair-seat --tool wide.toml".to_owned(), "width is NaN m"),
        ("task poses.csv --tool turned.toml".to_owned(), "are parallel"),
    ] {
        let (code, said) = planner(folder.path(), &args);
        assert_eq!(code, Some(1), "{args}: {said}");
        assert!(said.contains(says), "{args}: {said}");
    }
}

fn knot(time_ns: u64) -> PlanKnot {
    let (q, v) = (JointVector::ZERO, JointVector::ZERO);
    PlanKnot { time_ns, q, v, line: None, patch: None }
}
