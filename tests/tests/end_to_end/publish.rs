//! Plan files that `planner publish` sends, as a user does it by hand.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use nullsweep_ipc_types::EventKind;
use nullsweep_ipc_types::ports::Ipc;
use nullsweep_planner::plan::{
    Continues, CostKind, FORMAT, Held, Method, Plan, PlanKnot, Profile, SurfaceSample,
};
use nullsweep_robot::{Arm, JointVector, Tool};
use nullsweep_tests::sketch::{Sketch, swung};
use nullsweep_tests::stage::{Part, Process, Stage};
use nullsweep_tests::system::System;
use nullsweep_tests::witness::PATIENCE;

use crate::common::{right_arm, stage, verdict};
use crate::rig;

/// A plan file of a joint motion, with one point under the pad where it begins and one far away.
fn plan(arm: &Arm, sketch: &Sketch) -> Plan {
    let tool = Tool::default();
    let contact = arm.tip_pose(&sketch.posture(0)) * tool.contact_in_tip();
    let sample = |along: f64, reachable| SurfaceSample {
        point: (contact * nalgebra::Point3::new(along, 0.0, 0.0)).into(),
        normal: (contact * -nalgebra::Vector3::z()).into(),
        reachable,
    };
    let knot = |k: usize| PlanKnot {
        time_ns: sketch.knots[k].time_from_start_ns,
        q: sketch.posture(k),
        v: JointVector::default(),
        line: None,
        patch: None,
    };
    Plan {
        format: FORMAT,
        robot: "pr2".into(),
        fingerprint: arm.fingerprint(),
        joints: arm.joint_names().to_vec(),
        held: Held::all_of(arm),
        tool,
        base: [0.0; 3],
        base_height: 0.0,
        method: Method::Tsp,
        cost: CostKind::Time,
        profile: Profile::Velocity,
        jerk: None,
        seed: 1,
        knots: (0..sketch.knots.len()).map(knot).collect(),
        patches: Vec::new(),
        surface: vec![sample(0.0, true), sample(5.0, false)],
        regions: Vec::new(),
        continues: None,
        past: Vec::new(),
        left: Vec::new(),
        seal: None,
    }
}

fn write(stage: &Stage, name: &str, plan: &Plan) -> PathBuf {
    let path = stage.file(name);
    plan.clone().sealed().write(&path).expect("a plan file");
    path
}

fn publish(stage: &Stage, plan: &Path, more: &[&str]) -> Process {
    let mut args: Vec<OsString> = vec!["publish".into(), plan.into()];
    args.extend(stage.place());
    args.extend(more.iter().map(OsString::from));
    stage.start(Part::Planner, "publish", args).expect("the planner starts")
}

fn ended(mut process: Process) -> (Option<i32>, String) {
    let status = process.wait(PATIENCE).expect("known").expect("it ends");
    (status.code(), format!("{}{}", process.stdout(), process.stderr()))
}

/// Mock and executor, the mock standing where the plan begins.
fn start(stage: &Stage, plan: &Path) -> System {
    rig::start(stage, &["--plan", plan.to_str().expect("UTF-8")])
}

#[test]
fn a_plan_file_is_published_swept_and_continued() {
    let stage = stage();
    // The torso stands where the plan was made for, not where it rests.
    let arm = right_arm().with_held(&[("torso_lift_joint", 0.25)]).expect("a torso");
    let from = swung(&arm, &arm.home(), 0.1);
    let sketch = Sketch::through(&arm, &[from, arm.home(), from, arm.home()], 0.05);
    let first = plan(&arm, &sketch);
    let path = write(&stage, "first.json", &first);
    let System { endpoint: mut mock, mut witness, executor: _executor, .. } = start(&stage, &path);

    let (code, said) = ended(publish(&stage, &path, &[]));
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("accepted"), "{said}");
    let old = witness.see("motion", |t| t.plan.is_some()).expect("it moves");

    let at = old.knot as usize + 30;
    let goal: JointVector = swung(&arm, &arm.home(), 0.2);
    let next = Sketch::through(&arm, &[sketch.posture(at), goal], 0.1);
    let mut second = plan(&arm, &next);
    second.continues =
        Some(Continues { digest: first.digest().expect("short enough"), knot: at as u32 });
    let (code, said) = ended(publish(&stage, &write(&stage, "second.json", &second), &["--wait"]));
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("finished"), "{said}");
    let end = witness.end(old.plan).expect("an end");
    assert_eq!(end.kind, EventKind::Superseded.wire());

    let found = verdict(&stage, &mut mock);
    assert_eq!(found["violations"], 0, "{found:#}");
    assert_eq!(found["swept"]["points"], 2, "{found:#}");
    assert_eq!(found["swept"]["reachable"], 1.0, "{found:#}");
    assert_eq!(found["swept"]["all"], 0.5, "{found:#}");
}

#[test]
fn a_plan_file_for_another_torso_height_is_rejected_with_its_reason() {
    let stage = stage();
    let arm = right_arm();
    let sketch = Sketch::swings(&arm, &arm.home(), 1, 0.1, 0.1);
    let path = write(&stage, "plan.json", &plan(&arm, &sketch));
    let System { endpoint: mut mock, executor: _executor, .. } = start(&stage, &path);
    let other = arm.with_held(&[("torso_lift_joint", 0.3)]).expect("a torso");
    let other = write(&stage, "other.json", &plan(&other, &sketch));
    let (code, said) = ended(publish(&stage, &other, &[]));
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("held joint"), "{said}");
    let found = verdict(&stage, &mut mock);
    assert_eq!(found["violations"], 0, "{found:#}");
}

#[test]
fn a_plan_file_without_an_executor_says_so() {
    let stage = stage();
    let arm = right_arm();
    let sketch = Sketch::swings(&arm, &arm.home(), 1, 0.1, 0.1);
    let path = write(&stage, "plan.json", &plan(&arm, &sketch));
    let (code, said) = ended(publish(&stage, &path, &[]));
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("no executor is running"), "{said}");
}

/// What a process that died while it started leaves: iceoryx2 itself waits for it without end.
#[test]
fn a_file_that_a_crash_left_empty_is_told_and_not_waited_for() {
    let stage = stage();
    let arm = right_arm();
    let sketch = Sketch::swings(&arm, &arm.home(), 1, 0.1, 0.1);
    let path = write(&stage, "plan.json", &plan(&arm, &sketch));
    let prefix = Ipc::open(stage.robot(), Some(&stage.root())).expect("a door").prefix().to_owned();
    let empty = PathBuf::from(format!("/dev/shm/{prefix}left_behind"));
    std::fs::write(&empty, "").expect("a file");
    let start = Instant::now();
    let (code, said) = ended(publish(&stage, &path, &[]));
    std::fs::remove_file(&empty).expect("it is there");
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains(&format!("{}, which belongs to", empty.display())), "{said}");
    assert!(said.contains("remove it and try again"), "{said}");
    assert!(start.elapsed() < Duration::from_secs(20), "{:?}", start.elapsed());
}

#[test]
fn an_executor_that_dies_is_told_to_who_waits_for_the_plans_end() {
    let stage = stage();
    let arm = right_arm();
    let sketch = Sketch::swings(&arm, &arm.home(), 20, 0.1, 0.05);
    let path = write(&stage, "plan.json", &plan(&arm, &sketch));
    let mut system = start(&stage, &path);
    let mut waiting = publish(&stage, &path, &["--wait"]);
    system.witness.see("motion", |t| t.plan.is_some() && t.knot > 0).expect("it moves");
    assert_eq!(waiting.status().expect("known"), None);
    system.executor.kill().expect("it can be killed");
    let death = Instant::now();
    let status = waiting.wait(PATIENCE).expect("known").expect("it ends");
    let after = death.elapsed();
    let said = format!("{}{}", waiting.stdout(), waiting.stderr());
    assert_eq!(status.code(), Some(4), "{said}");
    assert!(after < Duration::from_secs(2), "{after:?}: {said}");
    assert!(said.contains("the executor's process has ended; it was last seen in mode exec"));
    assert!(said.contains("at knot") && said.contains("help: see the executor's last lines"));
}
