//! Programs of several stops and arms, worked through by `planner publish` with a robot that drives.

use std::path::PathBuf;
use std::thread;
use std::time::Duration;

use nullsweep_ipc_types::ports::Ipc;
use nullsweep_ipc_types::{BaseCommand, BaseJoint, BaseOrder};
use nullsweep_planner::plan::{
    PROGRAM_FORMAT, Plan, PlanKnot, Program, ProgramStop, SurfaceSample, Totals, Work,
};
use nullsweep_robot::{Arm, ArmSpec, JointVector, Robot, Side, Tool};
use nullsweep_tests::crew::{Crew, Found};
use nullsweep_tests::sketch::{Sketch, swung};
use nullsweep_tests::stage::{Part, Process, Stage};
use nullsweep_tests::witness::PATIENCE;

use crate::common::stage;

const TORSO: &str = "torso_lift_joint";
const MOCK: [&str; 4] = ["--timeout", "500", "--stands", "0.5,0.5,0"];
const EXECUTOR: [&str; 8] =
    ["--stale-ms", "500", "--lost-ms", "1500", "--min-rate", "0.01", "--spin-us", "0"];

/// Where the arms of a PR2 are tucked: where its description has each while the other one works.
fn tucked(side: Side) -> (Arm, JointVector) {
    let robot = Robot::pr2();
    let [arm, other] =
        [side, other(side)].map(|side| robot.arm(&ArmSpec::pr2(side)).expect("a PR2"));
    let mut q = JointVector::ZERO;
    for (value, name) in q.iter_mut().zip(arm.joint_names()) {
        let held = other.held_joints().iter().find(|held| held.name == *name);
        *value = held.expect("of the other arm").position;
    }
    (arm, q)
}

fn other(side: Side) -> Side {
    match side {
        Side::Left => Side::Right,
        Side::Right => Side::Left,
    }
}

/// A swing of an arm from where it is tucked and back, of some seconds, with a point of the surface under
/// its pad where it turns back.
fn work(side: Side, base: [f64; 3], torso: f64, speed: f64) -> Work {
    let (arm, tucked) = tucked(side);
    let arm = arm.with_held(&[(TORSO, torso)]).expect("a torso");
    let away = swung(&arm, &tucked, 0.3);
    let sketch = Sketch::through(&arm, &[tucked, away, tucked], speed);
    let knot = |k: usize| PlanKnot {
        time_ns: sketch.knots[k].time_from_start_ns,
        q: sketch.posture(k),
        v: JointVector::default(),
        line: None,
        patch: None,
    };
    let knots = (0..sketch.knots.len()).map(knot).collect();
    let tool = Tool::default();
    let contact = arm.tip_pose(&away) * tool.contact_in_tip();
    let sample = SurfaceSample {
        point: contact.translation.vector.into(),
        normal: (contact * -nalgebra::Vector3::z()).into(),
        reachable: true,
    };
    let plan = Plan::of(&Robot::pr2(), &arm, &tool, knots);
    let plan = Plan { base, surface: vec![sample], ..plan };
    Work { arm: ArmSpec::pr2(side).to_string(), adds: 0.25, kept_off_place: 1.0, plan }
}

/// Two stops: the right arm at the first, both at the second, where the torso is higher.
fn program(stage: &Stage) -> PathBuf {
    let stop = |base: [f64; 3], torso: f64, works: Vec<Work>| ProgramStop {
        base,
        base_height: 0.0,
        held: vec![(TORSO.into(), torso)],
        drive_m: 0.5,
        works,
        together: Vec::new(),
    };
    let [first, second] = [[1.0, 0.5, 0.0], [1.2, 0.5, 0.2]];
    let stops = vec![
        stop(first, 0.1, vec![work(Side::Right, first, 0.1, 0.2)]),
        stop(
            second,
            0.15,
            vec![work(Side::Left, second, 0.15, 0.4), work(Side::Right, second, 0.15, 0.1)],
        ),
    ];
    let robot = Robot::pr2().name().into();
    let totals = Totals { points: 3, coverage_all: 1.0, ..Totals::default() };
    let program = PROGRAM_FORMAT;
    let program = Program { program, robot, near_m: 2.0, stops, totals, seal: None }.sealed();
    let path = stage.file("program.json");
    program.write(&path).expect("a program file");
    path
}

fn ended(mut process: Process) -> (Option<i32>, String) {
    let status = process.wait(2 * PATIENCE).expect("known").expect("it ends");
    (status.code(), format!("{}{}", process.stdout(), process.stderr()))
}

fn publish(crew: &Crew, stage: &Stage, name: &str, more: &[&str]) -> Process {
    crew.publish(stage, name, more).expect("it starts")
}

fn nothing_wrong(found: &Found) {
    assert_eq!(found.violations, 0, "{found:#?}");
    assert!(found.arms.iter().all(|arm| arm.verdict.setpoints > 0), "{found:#?}");
}

#[test]
fn who_dies_on_the_way_is_resumed_and_nothing_is_swept_twice() {
    let stage = stage();
    let path = program(&stage);
    let mut crew = Crew::start(&stage, &path, &MOCK, &EXECUTOR).expect("a robot");
    // Killed in the first plan: the executor goes on with it.
    let mut first = publish(&crew, &stage, "first", &[]);
    crew.begun(1, &mut first, PATIENCE).expect("begun");
    first.kill().expect("it can be killed");
    let (code, said) = ended(publish(&crew, &stage, "again", &[]));
    assert!(code == Some(1) && said.contains("--resume goes on with it"), "{said}");
    let report = stage.file("steps.json");
    let resumed =
        publish(&crew, &stage, "resumed", &["--resume", "--json", report.to_str().expect("UTF-8")]);
    let (code, said) = ended(resumed);
    assert_eq!(code, Some(0), "{said}");
    let steps = std::fs::read_to_string(report).expect("a report");
    assert!(steps.contains("\"found-finished\""), "{said}{steps}");
    assert_eq!((crew.count("\"begun\""), crew.count("\"finished\"")), (3, 3), "{said}");
    assert_eq!(crew.count("\"arrived\""), 2);
    // All is done, so nothing is to do; asked anew it is begun anew.
    let (code, said) = ended(publish(&crew, &stage, "done", &["--resume"]));
    assert!(code == Some(0) && said.contains("all 3 plans of the program are done"), "{said}");

    let found = crew.end(&stage).expect("a verdict");
    nothing_wrong(&found);
    assert_eq!((found.drives, found.swept.points, found.swept.swept), (2, 3, 3), "{found:#?}");
}

#[test]
fn a_plan_that_lost_its_executor_is_not_gone_on_with_blindly() {
    let stage = stage();
    let path = program(&stage);
    let mut crew = Crew::start(&stage, &path, &MOCK, &EXECUTOR).expect("a robot");
    let mut first = publish(&crew, &stage, "first", &[]);
    crew.begun(3, &mut first, PATIENCE).expect("begun");
    thread::sleep(Duration::from_millis(1500));
    let right = crew.seats.iter().position(|seat| seat.arm.contains(",r_")).expect("a right arm");
    crew.replace(&stage, right, &EXECUTOR).expect("another one");
    let (code, said) = ended(first);
    assert_eq!(code, Some(4), "{said}");
    assert!(
        said.contains("stop 2, plan 2 (r_gripper_tool_frame): ") && said.contains("executor"),
        "{said}"
    );
    assert!(said.contains("--resume SCAN…` goes on"), "{said}");
    assert_eq!(crew.count("\"left\""), 1);

    // Nobody says what is around the arm that was left.
    let (code, said) = ended(publish(&crew, &stage, "blind", &["--resume"]));
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("was left on its way, and what is around it is not known"), "{said}");
    assert_eq!(crew.count("\"finished\""), 2);
    nothing_wrong(&crew.end(&stage).expect("a verdict"));
}

#[test]
fn a_base_that_stands_off_is_told_and_its_plans_are_not_sent() {
    let stage = stage();
    let path = program(&stage);
    let mock = [&MOCK[..], &["--base-off", "0.02,0,0"]].concat();
    let mut crew = Crew::start(&stage, &path, &mock, &EXECUTOR).expect("a robot");
    let (code, said) = ended(publish(&crew, &stage, "off", &[]));
    assert_eq!(code, Some(1), "{said}");
    assert!(
        said.contains("lies up to 20.0 mm from where the plans have it: at most 5.0 mm"),
        "{said}"
    );
    assert_eq!(crew.count("\"begun\""), 0);
    let more = ["--resume", "--base-off", "0.03"];
    let (code, said) = ended(publish(&crew, &stage, "allowed", &more));
    assert_eq!(code, Some(0), "{said}");
    nothing_wrong(&crew.end(&stage).expect("a verdict"));
}

#[test]
fn without_a_driver_a_person_says_that_the_base_has_arrived() {
    let stage = stage();
    let path = program(&stage);
    let mut crew = Crew::start(&stage, &path, &MOCK, &EXECUTOR).expect("a robot");
    // Under another name nothing drives: what a person does is done here by the mock's own service.
    let person = Ipc::open("walker", Some(&stage.root())).expect("services");
    let mut publisher = crew.publish_as(&stage, "walker", "person", &[]).expect("it starts");
    let driver = Ipc::open(stage.robot(), Some(&stage.root())).expect("services");
    let driver = driver.base_client().expect("a place");
    for (stop, base) in [[1.0, 0.5, 0.0], [1.2, 0.5, 0.2]].into_iter().enumerate() {
        let waits = format!("stop {} of 2: the base to", stop + 1);
        wait(&mut publisher, |said| said.contains(&waits));
        let mut drive = BaseCommand { goal: 1, pose: base, ..BaseCommand::of(BaseOrder::Drive) };
        drive.joints[0] = BaseJoint::new(TORSO, [0.1, 0.15][stop]).expect("a short name");
        drive.joint_count = 1;
        driver.call(drive, PATIENCE).expect("taken");
        thread::sleep(Duration::from_secs(3));
        let mut args = vec!["ctl".into(), "arrived".into()];
        args.extend(["--robot-name".into(), "walker".into()]);
        args.extend(["--ipc-root".into(), stage.root().into_os_string()]);
        let said = stage.start(Part::Executor, "arrived", args).expect("it starts");
        let (code, said) = ended(said);
        assert!(code == Some(0) && said.contains("arrived: accepted"), "{said}");
    }
    let (code, said) = ended(publisher);
    assert_eq!(code, Some(0), "{said}");
    assert!(
        said.contains("`executor ctl arrived`") && said.contains("nobody has measured"),
        "{said}"
    );
    // Once nobody waits, that is told.
    let none = person.base_client().expect("a place");
    let none = none.call(BaseCommand::of(BaseOrder::Arrived), PATIENCE).expect_err("nobody waits");
    assert!(none.to_string().contains("no program waits for it"), "{none}");
    nothing_wrong(&crew.end(&stage).expect("a verdict"));
}

/// Waits until a process has said something.
fn wait(process: &mut Process, has: impl Fn(&str) -> bool) {
    let end = std::time::Instant::now() + 2 * PATIENCE;
    while !has(&process.stdout()) {
        let status = process.status().expect("known");
        assert_eq!(status, None, "{}{}", process.stdout(), process.stderr());
        assert!(std::time::Instant::now() < end, "{}", process.stdout());
        thread::sleep(Duration::from_millis(20));
    }
}

/// A part of the simulated chair's seat.
const PART: [&str; 4] = ["--demo", "chair-seat", "--crop", "-0.30,-0.15,0.40,-0.1,0.15,0.50"];

#[test]
fn what_was_left_of_a_plan_is_planned_anew_and_swept() {
    let stage = stage();
    let path = stage.file("seat.json");
    let out = path.to_str().expect("UTF-8");
    let quick = ["--torso", "0.2", "--ik-samples", "8", "--refinements", "0", "--stops", "2"];
    let more = ["--profile", "acceleration", "--out", out];
    let plan = [&["plan"], &PART[..], &quick, &more].concat();
    let mut planner = stage.start(Part::Planner, "planner", plan).expect("it starts");
    let status = planner.wait(10 * PATIENCE).expect("known").expect("it ends");
    assert!(status.success(), "{}", planner.stderr());
    let program = Program::read(&path).expect("readable").expect("a program");
    let longest = program.stops[0].works[0].plan.duration();

    let mut crew = Crew::start(&stage, &path, &MOCK, &EXECUTOR).expect("a robot");
    let mut first = publish(&crew, &stage, "first", &[]);
    crew.begun(1, &mut first, PATIENCE).expect("begun");
    thread::sleep(Duration::from_secs_f64(0.5 * longest));
    let arm = &program.stops[0].works[0].arm;
    let seat = crew.seats.iter().position(|seat| seat.arm == *arm).expect("its executor");
    crew.replace(&stage, seat, &EXECUTOR).expect("another one");
    assert_eq!(ended(first).0, Some(4));
    let report = stage.file("steps.json");
    let json = report.to_str().expect("UTF-8");
    let resume = [&PART[..], &["--resume", "--json", json]].concat();
    let (code, said) = ended(publish(&crew, &stage, "resumed", &resume));
    assert_eq!(code, Some(0), "{said}");
    let steps = std::fs::read_to_string(report).expect("a report");
    assert!(steps.contains("\"rest-finished\""), "{said}{steps}");

    let found = crew.end(&stage).expect("a verdict");
    nothing_wrong(&found);
    let swept = found.swept.swept as f64 / program.totals.points as f64;
    let planned = program.totals.coverage_all;
    assert!((swept - planned).abs() < 0.01, "{swept} for {planned}");
}
