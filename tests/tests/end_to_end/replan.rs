//! `planner replan` while the arm sweeps: in passing, and by a stop where it came too late.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use nullsweep_ipc_types::{CommandKind, EventKind, Mode, PlanEvent, Reason, Telemetry, Verdict};
use nullsweep_planner::plan::{Plan, PlanKnot, Stretch};
use nullsweep_planner::sweep::coverage::swept_by;
use nullsweep_tests::stage::{Part, Stage};
use nullsweep_tests::system::System;
use nullsweep_tests::witness::PATIENCE;

use crate::common::{right_arm, stage, verdict};
use crate::rig;

/// A part of the simulated chair's seat: about 20 s of sweeping.
const SCENE: [&str; 12] = [
    "--demo",
    "chair-seat",
    "--crop=-0.15,-0.10,0.35,0.10,0.10,0.60",
    "--method",
    "tsp",
    "--ik-samples",
    "12",
    "--refinements",
    "0",
    "--v-max",
    "1.0",
    "--out",
];

/// Runs the planner to its end; its exit code and all that it said.
fn planner(stage: &Stage, name: &str, args: &[OsString]) -> (Option<i32>, String) {
    let mut process = stage.start(Part::Planner, name, args).expect("the planner starts");
    let status = process.wait(4 * PATIENCE).expect("known").expect("it ends");
    (status.code(), format!("{}{}", process.stdout(), process.stderr()))
}

fn args(command: &str, out: &Path, more: &[&str]) -> Vec<OsString> {
    let scene = SCENE.iter().map(OsString::from).chain([out.into()]);
    std::iter::once(command.into()).chain(scene).chain(more.iter().map(OsString::from)).collect()
}

/// A system that sweeps by a first plan, and that plan's file.
fn sweeping(stage: &Stage) -> (System, PathBuf) {
    let path = stage.file("first.json");
    let place = ["--cost", "effort", "--base=-0.708,-0.004,1.047", "--torso", "0.2"];
    let (code, said) = planner(stage, "plan", &args("plan", &path, &place));
    assert_eq!(code, Some(0), "{said}");
    let mut system = rig::start(stage, &["--plan", path.to_str().expect("UTF-8")]);
    let mut publish: Vec<OsString> = vec!["publish".into(), path.clone().into()];
    publish.extend(stage.place());
    let (code, said) = planner(stage, "publish", &publish);
    assert_eq!(code, Some(0), "{said}");
    system.witness.see("motion", |t| t.plan.is_some() && t.knot > 0).expect("it moves");
    (system, path)
}

fn replan(stage: &Stage, running: &Path, out: &Path, lead: &str) -> (Option<i32>, String) {
    let running = running.to_str().expect("UTF-8");
    let mut all = args("replan", out, &["--running", running, "--cost", "time", "--lead", lead]);
    all.extend(stage.place());
    planner(stage, "replan", &all)
}

/// The end of the first plan, and the start of the second.
fn ends(system: &mut System) -> (PlanEvent, PlanEvent) {
    let first = system.witness.events().first().expect("events").plan;
    let old = system.witness.end(first).expect("an end");
    let started = EventKind::Started.wire();
    let new = system
        .witness
        .until("the second plan's start".into(), |w| {
            w.events().iter().find(|e| e.plan != first && e.kind == started).copied()
        })
        .expect("it starts");
    (old, new)
}

/// The patches that these knots reach.
fn visited(knots: &[PlanKnot]) -> Vec<u32> {
    knots.iter().filter_map(|k| k.patch).collect()
}

#[test]
fn a_sweep_goes_on_under_another_cost_without_a_stop() {
    let stage = stage();
    let (mut system, first) = sweeping(&stage);
    let second = stage.file("second.json");
    let (code, said) = replan(&stage, &first, &second, "12");
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("without a stop"), "the machine is too slow for this test: {said}");

    let (old, new) = ends(&mut system);
    assert_eq!(old.kind, EventKind::Superseded.wire());
    let (first, second) = (Plan::read(&first).expect("read"), Plan::read(&second).expect("read"));
    let knot = second.continues.as_ref().expect("it continues the first one").knot as usize;
    assert_eq!(second.knots[0].q, first.knots[knot].q);
    let left = visited(&second.knots).len();
    assert!(left < visited(&first.knots).len(), "only what is left is swept");

    system.executor.terminate(PATIENCE).expect("it ends");
    let found = verdict(&stage, &mut system.endpoint);
    assert_eq!(found["violations"], 0, "{found:#}");
    let runs = found["verdict"]["plans"].as_array().expect("plans");
    let join = runs.iter().find(|r| r["plan"] == new.plan.to_string()).expect("it ran");
    assert!(join["join_step_ratio"].as_f64() > Some(0.0), "the arm was moving: {join}");
}

#[test]
fn a_plan_that_comes_too_late_goes_on_from_where_the_arm_was_stopped() {
    let stage = stage();
    let (mut system, first) = sweeping(&stage);
    let second = stage.file("second.json");
    // Some patches are swept by then.
    let knots = Plan::read(&first).expect("read").knots;
    let patches = (0..knots.len()).filter(|k| knots[*k].patch.is_some());
    let some = patches.skip(5).min().expect("patches") as u32;
    system.witness.see("some patches", |t| t.knot >= some).expect("it moves");
    // The next knot has passed before anything can be planned.
    let (code, said) = replan(&stage, &first, &second, "0");
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("the arm holds past knot"), "{said}");
    let (old, new) = ends(&mut system);
    assert_eq!((old.kind, old.reason), (EventKind::Aborted.wire(), Reason::Stopped.wire()));
    let (first, plan) = (Plan::read(&first).expect("read"), Plan::read(&second).expect("read"));
    assert!(plan.continues.is_none());

    // Replanned again, halfway and slowly enough that it is not at its end before that is done.
    let half = plan.knots.len() as u32 / 2;
    let there = |t: &Telemetry| t.plan == new.plan && t.knot >= half;
    system.witness.see("the second plan's middle", there).expect("it moves");
    let answer = system.witness.command(CommandKind::Speed, 0.2).expect("an answer");
    assert_eq!(answer.verdict, Verdict::Accepted.wire());
    let third = stage.file("third.json");
    let (code, said) = replan(&stage, &second, &third, "0");
    assert_eq!(code, Some(0), "{said}");
    let third = Plan::read(&third).expect("read");
    let followed: Vec<_> = third.past.iter().map(|stretch| &stretch.knots).collect();
    let [before, between] = followed[..] else { panic!("{} plans led to it", followed.len()) };
    assert_eq!(before[..], first.knots[..before.len()]);
    assert_eq!(between[..], plan.knots[..between.len()]);
    // The last patch that was reached may be half swept.
    let again = visited(&third.knots);
    for knots in [before, between] {
        let swept = visited(knots);
        let swept = &swept[..swept.len().saturating_sub(1)];
        assert!(swept.len() > 1, "too little was swept to tell: {swept:?}");
        assert!(swept.iter().all(|p| !again.contains(p)), "{swept:?} and again {again:?}");
    }
    system.executor.terminate(PATIENCE).expect("it ends");
    let found = verdict(&stage, &mut system.endpoint);
    assert_eq!(found["violations"], 0, "{found:#}");
}

/// An operator stops a sweep in mid-motion: whatever is asked then says how to go on, and the rest is swept.
#[test]
fn a_stopped_sweep_goes_on_from_where_the_arm_stands() {
    let stage = stage();
    let path = stage.file("first.json");
    let file = path.to_str().expect("UTF-8");
    let place = ["--cost", "effort", "--base=-0.708,-0.004,1.047", "--torso", "0.2"];
    let (code, said) = planner(&stage, "plan", &args("plan", &path, &place));
    assert_eq!(code, Some(0), "{said}");
    let mut system = rig::start(&stage, &["--plan", file]);
    let publish = |more: &[&str]| -> Vec<OsString> {
        let all = ["publish", file].into_iter().chain(more.iter().copied()).map(OsString::from);
        all.chain(stage.place()).collect()
    };
    let sending = publish(&["--wait"]);
    let mut sent = stage.start(Part::Planner, "sent", sending).expect("the planner starts");
    let first = Plan::read(&path).expect("read");
    let patches = (0..first.knots.len()).filter(|k| first.knots[*k].patch.is_some());
    let some = patches.skip(5).min().expect("patches") as u32;
    system.witness.see("some patches", |t| t.knot >= some).expect("it moves");
    let answer = system.witness.command(CommandKind::Stop, 0.0).expect("an answer");
    assert_eq!(answer.verdict, Verdict::Accepted.wire());

    // Whoever waits for the plan's end is told, and so is whoever publishes it once more.
    let leads = format!("planner replan --running {file} SCAN…");
    let status = sent.wait(4 * PATIENCE).expect("known").expect("it ends");
    let said = format!("{}{}", sent.stdout(), sent.stderr());
    assert_eq!(status.code(), Some(1), "{said}");
    assert!(said.contains("stopped by command, knot ") && said.contains(&leads), "{said}");
    let held = system.witness.mode(Mode::Hold).expect("it holds");
    assert!(held.stopped != 0 && held.knot >= some, "knot {} of {some}", held.knot);
    let (code, said) = planner(&stage, "publish", &publish(&[]));
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains(&leads), "{said}");
    let asked = system.witness.command(CommandKind::Status, 0.0).expect("an answer");
    assert_eq!((asked.stopped, asked.knot), (1, held.knot));

    let second = stage.file("second.json");
    let more = ["--running", file, "--cost", "time", "--wait"];
    let mut going = args("replan", &second, &more);
    going.extend(stage.place());
    let (code, said) = planner(&stage, "replan", &going);
    assert_eq!(code, Some(0), "{said}");
    let past = format!("the arm holds past knot {}, planning from there", held.knot);
    assert!(said.contains(&past) && said.contains("finished"), "{said}");
    let plan = Plan::read(&second).expect("read");
    assert_eq!(plan.past[0].knots[..], first.knots[..=held.knot as usize]);
    assert_eq!(plan.knots[0].q[..7], held.commanded[..7]);
    let followed = plan.followed(plan.knots.len());
    let stands: Vec<_> = plan.held.iter().map(|h| (h.name.as_str(), h.position)).collect();
    let arm = right_arm().with_held(&stands).expect("its joints");
    let swept = swept_by(&plan.scan(), followed.iter().map(Stretch::trajectory), &arm);
    let reachable = plan.surface.iter().filter(|s| s.reachable).count();
    let hit = swept.iter().zip(&plan.surface).filter(|(swept, s)| **swept && s.reachable).count();
    assert!(hit as f64 > 0.95 * reachable as f64, "{hit} of {reachable}");
    system.executor.terminate(PATIENCE).expect("it ends");
    let found = verdict(&stage, &mut system.endpoint);
    assert_eq!(found["violations"], 0, "{found:#}");
}

#[test]
fn without_a_running_plan_there_is_nothing_to_replan() {
    let stage = stage();
    let path = stage.file("first.json");
    let place = ["--base=-0.708,-0.004,1.047", "--torso", "0.2"];
    let (code, said) = planner(&stage, "plan", &args("plan", &path, &place));
    assert_eq!(code, Some(0), "{said}");
    let _system = rig::start(&stage, &["--plan", path.to_str().expect("UTF-8")]);
    let (code, said) = replan(&stage, &path, &stage.file("second.json"), "5");
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("executes no plan"), "{said}");
}

/// A plan that ends before another one could be made has not swept everything by then.
#[test]
fn a_plan_that_ends_too_soon_is_told_as_that() {
    let stage = stage();
    let (mut system, first) = sweeping(&stage);
    let (code, said) = replan(&stage, &first, &stage.file("second.json"), "100");
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("the running plan ends in"), "{said}");
    assert!(said.contains("help: a shorter --lead"), "{said}");
    let old = system.witness.events().first().expect("events").plan;
    system.witness.see("the plan goes on", |t| t.plan == old).expect("it runs");
}
