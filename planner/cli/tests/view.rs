//! `planner view`: what its pages hold.

mod common;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use bytemuck::Zeroable as _;
use nalgebra::{Isometry3, Matrix4, Point3, UnitQuaternion, UnitVector3, Vector3};
use nullsweep_ipc_types::PlanId;
use nullsweep_planner::plan::{Continues, Plan, PlanKnot, Profile};
use nullsweep_recording::{self as recording, CycleRecord, MAGIC, MeasuredRecord, Tag};
use nullsweep_robot::{Arm, ArmSpec, JointVector, Robot, Side, Tool};
use serde_json::Value;

use common::{planned, put_plan};

fn planner(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_planner")).args(args).output().unwrap()
}

/// A plan of an arm that waves all its joints, each at its own pace.
fn plan(side: Side, profile: Profile) -> (Plan, Arm) {
    let robot = Robot::pr2();
    let arm = robot.arm(&ArmSpec::pr2(side)).unwrap();
    let arm = arm.with_held(&[("torso_lift_joint", 0.25)]).unwrap();
    let at = |t: f64| {
        let (mut q, mut v) = (arm.home(), JointVector::ZERO);
        for j in 0..arm.dof() {
            let pace = 0.5 + 0.2 * j as f64;
            q[j] += 0.2 * (pace * t).sin();
            v[j] = 0.2 * pace * (pace * t).cos();
        }
        (q, v)
    };
    let knots = (0..40u64).map(|k| {
        let (q, v) = at(0.3 * k as f64);
        let v = if profile == Profile::Acceleration { v } else { JointVector::ZERO };
        PlanKnot { time_ns: k * 300_000_000, q, v, line: None, patch: None }
    });
    let plan = Plan::of(&robot, &arm, &Tool::default(), knots.collect());
    (Plan { profile, ..plan }, arm)
}

fn page(folder: &Path, name: &str, args: &[&str]) -> (String, Value) {
    let out = folder.join(name);
    let mut all = vec!["view", "--no-open", "--out", out.to_str().unwrap()];
    all.extend(args);
    let done = planner(&all);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let text = std::fs::read_to_string(&out).unwrap();
    let from = text.split_once("id=\"data\">").unwrap().1;
    let json = serde_json::from_str(from.split_once("</script>").unwrap().0).unwrap();
    (text, json)
}

fn write(folder: &Path, name: &str, plan: &Plan) -> PathBuf {
    let path = folder.join(name);
    plan.write(&path).unwrap();
    path
}

fn floats(value: &Value) -> Vec<f64> {
    let bytes = STANDARD.decode(value.as_str().unwrap()).unwrap();
    bytes.chunks_exact(4).map(|b| f64::from(f32::from_le_bytes(b.try_into().unwrap()))).collect()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

/// The pad's centre by what the page holds alone, as its script has it.
fn pad(data: &Value, q: &[f64]) -> Point3<f64> {
    let mut poses: Vec<Isometry3<f64>> = Vec::new();
    for body in data["bodies"].as_array().unwrap() {
        let joint = body["joint"].as_u64().unwrap() as usize;
        let value = body["factor"].as_f64().unwrap() * q[joint] + body["offset"].as_f64().unwrap();
        let axis = UnitVector3::new_normalize(Vector3::from_vec(numbers(&body["axis"])));
        assert!(!body["slides"].as_bool().unwrap(), "the PR2's arms turn");
        let rest: Isometry3<f64> =
            nalgebra::try_convert(Matrix4::from_vec(numbers(&body["rest"]))).unwrap();
        let local = rest
            * Isometry3::from_parts(
                Vector3::zeros().into(),
                UnitQuaternion::from_axis_angle(&axis, value),
            );
        let parent = body["parent"].as_u64().map(|p| poses[p as usize]);
        poses.push(parent.map_or(local, |parent| parent * local));
    }
    let body = data["pad"]["body"].as_u64().unwrap() as usize;
    poses[body] * Point3::from(Vector3::from_vec(numbers(&data["pad"]["centre"])))
}

#[test]
fn a_page_moves_the_pad_as_the_arm_moves_it() {
    let folder = tempfile::tempdir().unwrap();
    for (side, arm_flag) in [(Side::Left, "left"), (Side::Right, "right")] {
        for profile in [Profile::Velocity, Profile::Acceleration] {
            let (plan, arm) = plan(side, profile);
            let file = write(folder.path(), "plan.json", &plan);
            let args = [file.to_str().unwrap(), "--arm", arm_flag];
            let (text, data) = page(folder.path(), "plan.html", &args);
            assert!(text.len() < 1_000_000, "{} bytes", text.len());
            for needle in ["http", "src=", "@import", "url("] {
                assert!(!text.contains(needle), "the page loads {needle}");
            }
            let motion = &data["plans"][0];
            let (times, q) = (floats(&motion["times"]), floats(&motion["q"]));
            assert_eq!(times.len(), plan.knots.len());
            assert_eq!(motion["v"].is_null(), profile == Profile::Velocity);
            let on_arm = plan.tool.on(&arm);
            for (k, knot) in plan.knots.iter().enumerate() {
                let found = pad(&data, &q[k * arm.dof()..(k + 1) * arm.dof()]);
                let error = (found - on_arm.centre(&knot.q)).norm();
                assert!(error < 1e-5, "knot {k}: the page has the pad {error} m off");
            }
            // What the page compares its own motion with is on the executor's curve.
            let probes = motion["probes"].as_array().unwrap();
            assert!(probes.len() >= 30);
            for probe in probes {
                let time = probe["time"].as_f64().unwrap();
                let k = times.iter().position(|t| *t > time).unwrap();
                let curve = plan.curve(k);
                let share = (time - 0.3 * (k - 1) as f64) / 0.3;
                let planned = on_arm.centre(&curve.at(share));
                let found = Point3::from(Vector3::from_vec(numbers(&probe["pad"])));
                assert!((found - planned).norm() < 1e-9);
            }
        }
    }
}

#[test]
fn a_plan_takes_over_from_another_in_its_knot() {
    let folder = tempfile::tempdir().unwrap();
    let (first, _) = plan(Side::Right, Profile::Velocity);
    let mut second = first.clone();
    second.knots = first.knots[10..].to_vec();
    let from = second.knots[0].time_ns;
    second.knots.iter_mut().for_each(|knot| knot.time_ns -= from);
    second.continues = Some(Continues { digest: first.digest().unwrap(), knot: 10 });
    let files = [("a.json", &first), ("b.json", &second)]
        .map(|(name, plan)| write(folder.path(), name, plan));
    let [a, b] = [0, 1].map(|i| files[i].to_str().unwrap());
    let starts = |data: &Value| -> Vec<f64> {
        let plans = data["plans"].as_array().unwrap();
        plans.iter().map(|m| m["starts_at"].as_f64().unwrap()).collect()
    };
    let (text, data) = page(folder.path(), "swap.html", &[a, b]);
    assert_eq!(starts(&data), [0.0, 3.0]);
    assert!(text.contains("2 plans, the last takes over at 3.0 s"));
    // One that does not go on from it comes after its end.
    second.continues = None;
    let c = write(folder.path(), "c.json", &second);
    let (_, data) = page(folder.path(), "after.html", &[a, c.to_str().unwrap()]);
    assert_eq!(starts(&data), [0.0, first.duration()]);
    // One that was stopped is left in the last knot that was passed.
    second.past = first.followed(20);
    let d = write(folder.path(), "d.json", &second);
    let (_, data) = page(folder.path(), "stopped.html", &[a, d.to_str().unwrap()]);
    let times = floats(&data["plans"][0]["times"]);
    assert_eq!((starts(&data)[1], times.len()), (6.0, 21));
    assert!((times[20] - 6.0).abs() < 1e-6);
}

#[test]
fn what_is_not_known_is_told_beside_the_figures() {
    let folder = tempfile::tempdir().unwrap();
    let (plan, _) = plan(Side::Right, Profile::Velocity);
    let file = write(folder.path(), "plan.json", &plan);
    let (text, _) = page(folder.path(), "raw.html", &[file.to_str().unwrap()]);
    assert!(text.contains("Unverified: "), "a plan that was never verified");
    let file = write(folder.path(), "sealed.json", &plan.sealed());
    let (text, _) = page(folder.path(), "sealed.html", &[file.to_str().unwrap()]);
    assert!(!text.contains("Unverified: ") && text.contains("The scene is not given"));
}

#[test]
fn a_plan_of_another_arm_is_refused_with_what_to_say() {
    let folder = tempfile::tempdir().unwrap();
    let (plan, _) = plan(Side::Left, Profile::Velocity);
    let file = write(folder.path(), "left.json", &plan);
    let out = folder.path().join("left.html");
    let done =
        planner(&["view", file.to_str().unwrap(), "--no-open", "--out", out.to_str().unwrap()]);
    let told = String::from_utf8_lossy(&done.stderr).into_owned();
    assert_eq!(done.status.code(), Some(1), "{told}");
    assert!(told.contains("l_shoulder_pan_joint") && told.contains("--arm"), "{told}");
    assert!(!out.exists());
}

#[test]
fn a_scan_shows_its_planes_and_objects() {
    let folder = tempfile::tempdir().unwrap();
    let scan = folder.path().join("scan.xyz");
    let mut text = String::new();
    for i in 0..60 {
        for j in 0..60 {
            let (x, y) = (0.01 * f64::from(i), 0.01 * f64::from(j));
            let box_ = (20..35).contains(&i) && (20..35).contains(&j);
            text += &format!("{x} {y} {}\n", if box_ { 0.12 } else { 0.0 });
        }
    }
    std::fs::write(&scan, text).unwrap();
    let (text, data) = page(folder.path(), "scene.html", &[scan.to_str().unwrap()]);
    assert!(text.contains("What is there"));
    let clouds = data["clouds"].as_array().unwrap();
    let points: usize = clouds
        .iter()
        .map(|c| STANDARD.decode(c["shares"].as_str().unwrap()).unwrap().len() / 6)
        .sum();
    assert_eq!(points, 3600, "every point is in one cloud");
    let groups = data["places"].as_array().unwrap();
    assert!(groups.iter().any(|g| !g["items"].as_array().unwrap().is_empty()));
}

/// A recording of a plan that runs at 100 Hz after a second in which the arm only holds: the endpoint
/// answers a cycle later, and for half a second one joint is farther off than the others ever are.
fn flight(folder: &Path, plan: &Plan, arm: &Arm) -> PathBuf {
    let id = PlanId { epoch: 5, number: 1 };
    let mut bytes = MAGIC.to_vec();
    put_plan(&mut bytes, id, plan);
    let mut before = None;
    for cycle in 1..=1271u64 {
        let time = cycle.saturating_sub(100) * 10_000_000;
        let (q, knot) = planned(plan, time);
        let mut record = CycleRecord::zeroed();
        record.now_ns = 70_000_000_000 + cycle * 10_000_000;
        record.target.sequence = cycle;
        record.target.q = q;
        // An executor goes through a plan by the turns that are nearest to where the arm was.
        assert!(arm.continuous().is(6));
        record.target.q[6] += std::f64::consts::TAU;
        if cycle >= 100 {
            record.target.plan = id;
            record.target.knot = knot;
        }
        if let Some(answers) = before {
            let mut q: JointVector = answers;
            q[3] += if (500..550).contains(&cycle) { 0.02 } else { -0.001 };
            if cycle == 520 {
                q[3] += 0.0025;
            }
            // An endpoint that wraps what turns without end.
            if arm.continuous().is(4) {
                q[4] -= std::f64::consts::TAU;
            }
            record.has_measured = 1;
            record.measured = MeasuredRecord {
                stamp_ns: record.now_ns - 1000,
                setpoint_sequence: cycle - 1,
                q,
                joint_count: arm.dof() as u32,
                status: 1,
            };
        }
        before = Some(record.target.q);
        recording::put(&mut bytes, Tag::Cycle, &[bytemuck::bytes_of(&record)]);
    }
    let path = folder.join("flight-0.nswrec");
    std::fs::write(&path, bytes).unwrap();
    path
}

#[test]
fn a_recording_is_shown_beside_its_plan_with_its_largest_deviation() {
    let folder = tempfile::tempdir().unwrap();
    let (plan, arm) = plan(Side::Right, Profile::Acceleration);
    let file = write(folder.path(), "plan.json", &plan);
    let recording = flight(folder.path(), &plan, &arm);
    let log = folder.path().join("seen.mcap");
    let args = [&file, &recording].map(|path| path.to_str().unwrap());
    let args = [&args[..], &["--mcap", log.to_str().unwrap()]].concat();
    let (text, data) = page(folder.path(), "seen.html", &args);
    // 520 cycles of 10 ms, the plan's time 0 in the 100th, and the state is 1 µs older.
    assert!(text.contains("0.0225 rad"), "the largest deviation");
    let name = &arm.joint_names()[3];
    assert!(text.contains(&format!("of {name} from its setpoint, at 4.2 s")));
    let motion = &data["measured"][0];
    assert_eq!(motion["starts_at"], 0.0);
    let (times, q) = (floats(&motion["times"]), floats(&motion["q"]));
    assert!(times.len() > 500 && times.len() < 700, "{}", times.len());
    assert!((times.last().unwrap() - 11.7).abs() < 0.02, "{:?}", times.last());
    for (i, time) in times.iter().enumerate().skip(1) {
        // The setpoint that was answered is a cycle before the stamp's.
        let planned = time - 0.01 + 1e-6;
        let k = ((planned / 0.3) as usize + 1).min(39);
        let curve = plan.curve(k).at(((planned - 0.3 * (k - 1) as f64) / 0.3).min(1.0));
        for j in 0..arm.dof() {
            let apart = q[i * arm.dof() + j] - curve[j];
            let most = if j == 3 { 0.0226 } else { 1e-5 };
            assert!(apart.abs() < most, "joint {j} at {time} s: {apart}");
        }
    }
    let deviation = motion["series"][0].clone();
    assert_eq!(deviation["name"], "deviation, pad");
    let told = floats(&deviation["values"]).into_iter().fold(0.0, f64::max);
    assert!(told > 1.0 && text.contains(&format!("of the pad {told:.1} mm")), "{told}");
    let bytes = std::fs::read(&log).unwrap();
    let messages = mcap::MessageStream::new(&bytes).unwrap();
    let seen = messages.filter(|m| m.as_ref().unwrap().channel.topic == "/measured/joint_states");
    assert!(seen.count() > 500);
}

/// One plan was stopped in its sixth second; what it had left ran nine seconds later.
#[test]
fn a_recording_says_when_each_plan_ran() {
    let folder = tempfile::tempdir().unwrap();
    let (first, arm) = plan(Side::Right, Profile::Acceleration);
    let mut second = first.clone();
    second.knots = first.knots[20..].to_vec();
    let from = second.knots[0].time_ns;
    second.knots.iter_mut().for_each(|knot| knot.time_ns -= from);
    second.past = first.followed(20);
    let ids = [1, 2].map(|number| PlanId { epoch: 5, number });
    let mut bytes = MAGIC.to_vec();
    put_plan(&mut bytes, ids[0], &first);
    put_plan(&mut bytes, ids[1], &second);
    for cycle in 1..=1800u64 {
        let mut record = CycleRecord::zeroed();
        record.now_ns = 70_000_000_000 + cycle * 10_000_000;
        record.target.sequence = cycle;
        let ((q, knot), id) = match cycle {
            1..=600 => (planned(&first, cycle * 10_000_000), ids[0]),
            601..=1499 => ((first.knots[20].q, 0), PlanId::NONE),
            _ => (planned(&second, (cycle - 1500) * 10_000_000), ids[1]),
        };
        (record.target.q, record.target.knot, record.target.plan) = (q, knot, id);
        record.has_measured = 1;
        record.measured = MeasuredRecord {
            stamp_ns: record.now_ns - 1000,
            setpoint_sequence: cycle - 1,
            q,
            joint_count: arm.dof() as u32,
            status: 1,
        };
        recording::put(&mut bytes, Tag::Cycle, &[bytemuck::bytes_of(&record)]);
    }
    let recording = folder.path().join("flight-0.nswrec");
    std::fs::write(&recording, bytes).unwrap();
    let files = [("a.json", &first), ("b.json", &second)]
        .map(|(name, plan)| write(folder.path(), name, plan));
    let [a, b] = [0, 1].map(|i| files[i].to_str().unwrap());
    let (_, data) = page(folder.path(), "seen.html", &[a, b, recording.to_str().unwrap()]);
    let start = data["plans"][1]["starts_at"].as_f64().unwrap();
    assert!((start - 15.0).abs() < 0.02, "{start}");
    assert_eq!(data["measured"][0]["starts_at"], 0.0);
    let end = floats(&data["plans"][0]["times"]).into_iter().next_back().unwrap();
    assert!((end - 6.0).abs() < 1e-6, "{end}: it was left in its knot 20");
}

#[test]
fn a_recording_alone_shows_what_was_commanded_and_measured() {
    let folder = tempfile::tempdir().unwrap();
    let (plan, arm) = plan(Side::Right, Profile::Velocity);
    let recording = flight(folder.path(), &plan, &arm);
    let (text, data) = page(folder.path(), "alone.html", &[recording.to_str().unwrap()]);
    assert!(text.contains("flight recording") && text.contains("0.0225 rad"));
    assert!(text.contains("1 plan ran"));
    let [commanded, measured] = ["plans", "measured"].map(|list| floats(&data[list][0]["times"]));
    assert!(commanded.len() > 500 && measured.len() > 500);
    assert!((commanded.last().unwrap() - 11.71).abs() < 0.01, "{:?}", commanded.last());
}

#[test]
fn a_recording_that_does_not_fit_is_refused_with_what_to_say() {
    let folder = tempfile::tempdir().unwrap();
    let (plan, arm) = plan(Side::Right, Profile::Velocity);
    let recording = flight(folder.path(), &plan, &arm);
    let mut other = plan.clone();
    other.knots[7].time_ns += 1;
    let other = write(folder.path(), "other.json", &other);
    let told = |files: &[&Path], code: i32| {
        let out = folder.path().join("no.html");
        let files = files.iter().map(|file| file.to_str().unwrap());
        let flags = ["view", "--no-open", "--out", out.to_str().unwrap()];
        let done = planner(&flags.into_iter().chain(files).collect::<Vec<_>>());
        assert_eq!(done.status.code(), Some(code));
        assert!(!out.exists());
        String::from_utf8_lossy(&done.stderr).into_owned()
    };
    let said = told(&[&other, &recording], 1);
    assert!(said.contains("none of the plans given ran in the recording; 1 other did"), "{said}");
    let said = told(&[&recording, &recording], 2);
    assert!(said.contains("name the plan that ran too"), "{said}");
    let mut bytes = std::fs::read(&recording).unwrap();
    bytes[6] = b'5';
    let old = folder.path().join("old.nswrec");
    std::fs::write(&old, bytes).unwrap();
    let said = told(&[&old], 1);
    assert!(said.contains("old.nswrec: not a flight recording of this version"), "{said}");
}

#[test]
fn a_log_holds_the_joints_transforms_and_shapes_as_ros_messages() {
    let folder = tempfile::tempdir().unwrap();
    let (plan, arm) = plan(Side::Right, Profile::Acceleration);
    let file = write(folder.path(), "plan.json", &plan);
    let log = folder.path().join("plan.mcap");
    let args = [file.to_str().unwrap(), "--mcap", log.to_str().unwrap()];
    page(folder.path(), "plan.html", &args);
    let bytes = std::fs::read(&log).unwrap();
    let messages: Vec<mcap::Message<'_>> =
        mcap::MessageStream::new(&bytes).unwrap().collect::<Result<_, _>>().unwrap();
    let on = |topic: &str| messages.iter().filter(|m| m.channel.topic == topic).collect::<Vec<_>>();
    for (topic, kind, count) in [
        ("/joint_states", "sensor_msgs/msg/JointState", 586),
        ("/tf", "tf2_msgs/msg/TFMessage", 586),
        ("/robot", "visualization_msgs/msg/MarkerArray", 1),
        ("/path", "nav_msgs/msg/Path", 1),
    ] {
        let found = on(topic);
        assert_eq!(found.len(), count, "{topic}");
        let schema = found[0].channel.schema.as_ref().unwrap();
        assert_eq!((schema.name.as_str(), schema.encoding.as_str()), (kind, "ros2msg"));
        assert_eq!(found[0].channel.message_encoding, "cdr");
    }
    let contains = |data: &[u8], what: &[u8]| data.windows(what.len()).any(|w| w == what);
    let last = on("/joint_states")[585];
    assert_eq!(last.log_time, 11_700_000_000);
    for (j, name) in arm.joint_names().iter().enumerate() {
        assert!(contains(&last.data, name.as_bytes()));
        let end = plan.knots[39].q[j].to_le_bytes();
        assert!(contains(&last.data, &end), "{name} is not where the plan ends");
    }
    // Half a second in, between two knots: on the cubic.
    let between = plan.curve(2).at(2.0 / 3.0);
    let at = |value: f64| {
        let data = &on("/joint_states")[25].data;
        (0..data.len() - 7)
            .map(|i| f64::from_le_bytes(data[i..i + 8].try_into().unwrap()))
            .any(|found| (found - value).abs() < 1e-9)
    };
    assert!((0..arm.dof()).all(|j| at(between[j])));
}
