//! A plan runs again: the arm is brought back to its start, and home, free of collision.

use std::ffi::OsString;

use nullsweep_ipc_types::Mode;
use nullsweep_planner::plan::Plan;
use nullsweep_tests::stage::{Part, Stage};
use nullsweep_tests::witness::PATIENCE;

use crate::common::{right_arm, stage, verdict};
use crate::rig;

/// A small part of the simulated chair's seat.
const SCENE: [&str; 3] = ["--demo", "chair-seat", "--crop=-0.02,-0.05,0.35,0.10,0.06,0.60"];

/// Runs the planner to its end; its exit code and all that it said.
fn planner(stage: &Stage, args: &[&str]) -> (Option<i32>, String) {
    let args = args.iter().map(OsString::from).chain(stage.place());
    let mut process = stage.start(Part::Planner, "planner", args).expect("the planner starts");
    let status = process.wait(4 * PATIENCE).expect("known").expect("it ends");
    (status.code(), format!("{}{}", process.stdout(), process.stderr()))
}

#[test]
fn a_plan_runs_twice_and_the_arm_comes_home() {
    let stage = stage();
    let path = stage.file("plan.json");
    let file = path.to_str().expect("UTF-8");
    let place = ["--base=-0.708,-0.004,1.047", "--torso", "0.2", "--ik-samples", "12"];
    let speed = ["--refinements", "0", "--v-max", "1.0", "--out", file];
    let (code, said) = planner(&stage, &[&["plan"], &SCENE[..], &place, &speed].concat());
    assert_eq!(code, Some(0), "{said}");
    let plan = Plan::read(&path).expect("a plan");
    assert!(plan.knots.last().expect("knots").line.is_none(), "it ends off the surface");

    let mut system = rig::start(&stage, &["--torso", "0.2"]);
    let (code, said) = planner(&stage, &["publish", file, "--wait"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("sweeps") && said.contains("finished"), "{said}");

    // The arm is at the plan's end: what is too far away is told by its name, and what to do.
    let (code, said) = planner(&stage, &["publish", file, "--wait"]);
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("the arm is not where the plan starts: r_"), "{said}");
    assert!(said.contains(&format!("planner goto --plan {file}")), "{said}");

    // Nothing is guessed of what is around it.
    let (code, said) = planner(&stage, &["publish", file, "--goto"]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("what is around the arm?"), "{said}");

    let again = ["--goto", "--wait", "--v-max", "1.0"];
    let (code, said) = planner(&stage, &[&["publish", file], &SCENE[..], &again].concat());
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(said.matches("finished").count(), 2, "{said}");

    let home = ["goto", "home", "--plan", file, "--v-max", "1.0"];
    let (code, said) = planner(&stage, &[&home, &SCENE[..]].concat());
    assert_eq!(code, Some(0), "{said}");
    let held = system.witness.mode(Mode::Hold).expect("it holds");
    for (j, home) in right_arm().home().iter().enumerate().take(7) {
        let apart = nullsweep_robot::wrap(held.commanded[j] - home);
        assert!(apart.abs() < 1e-9, "joint {j}: {apart}");
    }
    let (code, said) = planner(&stage, &[&home, &SCENE[..]].concat());
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("the arm is there already"), "{said}");

    let found = verdict(&stage, &mut system.endpoint);
    assert_eq!(found["violations"], 0, "{found:#}");
}
