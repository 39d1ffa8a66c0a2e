//! `planner replan` by what was measured: only what is left is swept.

mod common;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use bytemuck::Zeroable as _;
use nullsweep_ipc_types::PlanId;
use nullsweep_planner::plan::Plan;
use nullsweep_recording::{self as recording, CycleRecord, MAGIC, MeasuredRecord, Tag};
use nullsweep_surface::simulate;

use common::{planned, put_plan};

/// A part of the simulated chair's seat, and where the robot stands before it.
const SMALL: [&str; 9] = [
    "--crop=-0.15,-0.10,0.35,0.10,0.10,0.60",
    "--method",
    "tsp",
    "--ik-samples",
    "12",
    "--refinements",
    "0",
    "--v-max",
    "1.0",
];
const PLACE: [&str; 3] = ["--base=-0.708,-0.004,1.047", "--torso", "0.2"];

fn planner(folder: &Path, args: &[&str]) -> (Option<i32>, String) {
    let done = Command::new(env!("CARGO_BIN_EXE_planner"))
        .current_dir(folder)
        .args(args)
        .args(SMALL)
        .output()
        .expect("the planner starts");
    let said = [done.stdout, done.stderr].concat();
    (done.status.code(), String::from_utf8_lossy(&said).into_owned())
}

fn read(folder: &Path, name: &str) -> Plan {
    let plan = Plan::read(&folder.join(name)).expect("a plan");
    plan.check_seal().expect("it is verified");
    plan
}

/// A figure of a run.
fn figure(folder: &Path, file: &str, name: &str) -> f64 {
    let text = std::fs::read_to_string(folder.join(file)).expect("figures");
    let figures: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    figures[name].as_f64().unwrap_or_else(|| panic!("no {name}"))
}

/// A recording of a plan that was followed to the letter up to some share of its time.
fn flight(folder: &Path, plan: &Plan, share: f64) -> PathBuf {
    let id = PlanId { epoch: 1, number: 7 };
    let mut bytes = MAGIC.to_vec();
    recording::put(&mut bytes, Tag::Guard, &[b"limits"]);
    put_plan(&mut bytes, id, plan);
    let start_ns = 70_000_000_000;
    let mut before = None;
    for cycle in 0..(share * plan.duration() * 200.0) as u64 {
        let time = cycle * 5_000_000;
        let (q, knot) = planned(plan, time);
        let mut record = CycleRecord::zeroed();
        record.now_ns = start_ns + time;
        record.target.sequence = cycle + 1;
        record.target.q = q;
        record.target.plan = id;
        record.target.knot = knot;
        if let Some(q) = before {
            record.has_measured = 1;
            record.measured = MeasuredRecord {
                stamp_ns: record.now_ns - 1000,
                setpoint_sequence: cycle,
                q,
                joint_count: plan.joints.len() as u32,
                ..MeasuredRecord::zeroed()
            };
        }
        before = Some(record.target.q);
        recording::put(&mut bytes, Tag::Cycle, &[bytemuck::bytes_of(&record)]);
    }
    let path = folder.join("flight-0.nswrec");
    std::fs::write(&path, bytes).expect("written");
    path
}

#[test]
fn what_was_measurably_swept_is_not_swept_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let demo = ["--demo", "chair-seat"];
    let first = [&["plan", "--out", "a.json", "--json", "a.figures"], &demo[..], &PLACE].concat();
    let (code, said) = planner(folder, &first);
    assert_eq!(code, Some(0), "{said}");
    let plan = read(folder, "a.json");
    flight(folder, &plan, 0.5);
    let again =
        ["replan", "--running", "a.json", "--measured", "flight-0.nswrec", "--out", "b.json"];
    let again = [&again[..], &["--json", "b.figures"], &demo].concat();
    let (code, said) = planner(folder, &again);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("measured positions say what was swept"), "{said}");
    let rest = read(folder, "b.json");
    // It starts where the arm was last, from what it came over.
    assert_eq!(rest.past.len(), 1);
    assert_eq!(rest.past[0].knots.last().expect("knots").q, rest.knots[0].q);
    assert!(rest.continues.is_none());
    let of = |file: &str| ["task_time_s", "coverage_reachable"].map(|f| figure(folder, file, f));
    let ([whole, all], [left, both]) = (of("a.figures"), of("b.figures"));
    assert!(left < 0.8 * whole, "{left} s of {whole} s");
    assert!(both > all - 0.01, "{both} of {all}");
    // Without the past it is no plan of everything.
    let alone = Plan { past: Vec::new(), ..rest };
    alone.write(&folder.join("c.json")).expect("written");
    let check = [&["verify", "c.json", "--json", "c.figures"], &demo[..], &SMALL[..1]].concat();
    let done = Command::new(env!("CARGO_BIN_EXE_planner")).current_dir(folder).args(check).output();
    assert!(done.expect("it starts").status.success());
    let alone = figure(folder, "c.figures", "coverage_reachable");
    assert!(alone < both - 0.15, "{alone} of {both}");

    let (code, said) = planner(folder, &[&again[..], &["--lead", "3"]].concat());
    assert_eq!(code, Some(2), "{said}");
    std::fs::write(folder.join("flight-0.nswrec"), b"NSWREC6\n").expect("written");
    let (code, said) = planner(folder, &again);
    assert!(code == Some(1) && said.contains("no plan ran in the recording"), "{said}");
}

/// Points of the simulated chair in its camera's frame; `paint` gives the colour of a place of the floor
/// frame.
fn scan(path: &Path, paint: Option<&dyn Fn(f64) -> [u8; 3]>) -> String {
    let view = simulate::chair(1);
    let mut text = String::from("# x y z");
    text.push_str(if paint.is_some() { " r g b\n" } else { "\n" });
    for p in &view.scan.points {
        write!(text, "{:.5} {:.5} {:.5}", p.x, p.y, p.z).expect("text");
        if let Some(paint) = paint {
            let [r, g, b] = paint((view.sensor_pose * p).y);
            write!(text, " {r} {g} {b}").expect("text");
        }
        text.push('\n');
    }
    std::fs::write(path, text).expect("written");
    let (t, r) = (view.sensor_pose.translation.vector, view.sensor_pose.rotation.coords);
    format!("--sensor-pose={},{},{},{},{},{},{}", t.x, t.y, t.z, r.x, r.y, r.z, r.w)
}

#[test]
fn what_a_second_scan_shows_to_be_done_is_not_done_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let grey = |_: f64| [120, 120, 120];
    let half = |y: f64| if y > 0.0 { [200, 120, 60] } else { [120, 125, 118] };
    let pose = scan(&folder.join("before.xyz"), Some(&grey));
    scan(&folder.join("after.xyz"), Some(&half));
    scan(&folder.join("plain.xyz"), None);
    let of = ["before.xyz", &pose];
    let first = [&["plan", "--out", "a.json", "--json", "a.figures"], &of[..], &PLACE].concat();
    let (code, said) = planner(folder, &first);
    assert_eq!(code, Some(0), "{said}");
    let again =
        ["replan", "--running", "a.json", "--out", "b.json", "--json", "b.figures", "--scan"];
    let again = |after: &[&str]| planner(folder, &[&again[..], after, &of].concat());
    let (code, said) = again(&["after.xyz"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("its colour has changed by 40 of 441 or more"), "{said}");
    assert!(said.contains("of the points are done"), "{said}");
    let [whole, left] = ["a.figures", "b.figures"].map(|file| figure(folder, file, "task_time_s"));
    assert!(left < 0.8 * whole, "{left} s of {whole} s");
    // The pad goes over the half that was not painted.
    let rest = read(folder, "b.json");
    let base = rest.base_pose();
    let line = rest.knots.iter().filter_map(|knot| knot.line);
    let places: Vec<f64> = line.map(|p| (base * nalgebra::Point3::from(p)).y).collect();
    assert!(places.iter().all(|y| *y < 0.04), "{:?}", places.iter().copied().fold(0.0, f64::max));

    let (code, said) = again(&["plain.xyz"]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("--done-height"), "{said}");
    let (code, said) = again(&["plain.xyz", "--done-height", "0.02"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("its height has changed by 20.0 mm or more"), "{said}");
    let same = figure(folder, "b.figures", "task_time_s");
    assert!(same > 0.9 * whole, "nothing is done: {same} s of {whole} s");
}
