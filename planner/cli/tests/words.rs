//! What the command line says, and when: usage before work, no cause twice, nothing about a closed pipe.

use std::path::Path;
use std::process::{Command, Output, Stdio};

use nullsweep_planner::plan::{Continues, Plan, PlanKnot};
use nullsweep_robot::{ArmSpec, Camera, Footprint, JointVector, Robot, Side, Tool};

fn planner(folder: &Path, args: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_planner"));
    command.args(args.split(' ')).current_dir(folder).stdin(Stdio::null());
    command
}

fn run(folder: &Path, args: &str) -> (Option<i32>, String, String) {
    let Output { status, stdout, stderr } = planner(folder, args).output().expect("it starts");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("text");
    (status.code(), text(stdout), text(stderr))
}

/// A plan file of many knots.
fn long_plan(path: &Path) {
    let robot = Robot::pr2();
    let arm = robot.arm(&ArmSpec::pr2(Side::Right)).expect("an arm");
    let knot = |k: u64| PlanKnot {
        time_ns: k * 1_000_000,
        q: arm.home(),
        v: JointVector::ZERO,
        line: None,
        patch: None,
    };
    let plan = Plan::of(&robot, &arm, &Tool::default(), (0..5000).map(knot).collect());
    plan.write(path).expect("written");
}

#[test]
fn what_a_camera_has_seen_is_told_to_be_counted_without_what_hides_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("plan.json");
    let told = || {
        let (code, said, complained) = run(folder.path(), "inspect plan.json");
        assert_eq!(code, Some(0), "{complained}");
        let (_, json, _) = run(folder.path(), "inspect plan.json --json -");
        let words = said.split_whitespace().collect::<Vec<_>>().join(" ");
        (words.contains("by what its own surface"), json.contains("hidden_by_own_surface_alone"))
    };
    long_plan(&path);
    assert_eq!(told(), (false, false));
    let plan = Plan::read(&path).expect("a plan");
    let camera = Camera { distance: [0.2, 0.4], field_of_view: [0.8, 0.6] };
    let footprint = Footprint::Camera(camera);
    let tool = Tool { stand_off: 0.3, footprint, ..Tool::default() };
    Plan { tool, ..plan }.write(&path).expect("written");
    assert_eq!(told(), (true, true));
}

#[test]
fn a_posture_with_too_few_joints_is_wrong_usage() {
    let folder = tempfile::tempdir().expect("a folder");
    for flag in ["--start", "--end"] {
        let (code, _, said) = run(folder.path(), &format!("plan --demo chair-seat {flag} 0.1,0.2"));
        assert_eq!(code, Some(2), "{said}");
        assert!(said.contains(flag) && said.contains("2 joints, but the arm has 7: r_"), "{said}");
    }
    let (code, _, said) = run(folder.path(), "plan --demo chair-seat --start nowhere");
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("no posture `nowhere`"), "{said}");
}

/// A plan that goes on from a knot of another one joins that one in motion: no arm is brought to rest at
/// its start and the plan refused then.
#[test]
fn the_arm_is_not_brought_to_a_plan_that_it_cannot_begin() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("plan.json");
    long_plan(&path);
    let mut plan = Plan::read(&path).expect("a plan");
    plan.continues = Some(Continues { digest: 7, knot: 3 });
    plan.sealed().write(&path).expect("written");
    let (code, _, said) = run(folder.path(), "publish plan.json --goto --empty --yes");
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("leave out --goto, or give --join stop"), "{said}");
}

#[test]
fn an_output_that_cannot_be_written_is_told_before_the_work() {
    let folder = tempfile::tempdir().expect("a folder");
    for flag in ["--out", "--json", "--report"] {
        let (code, out, said) =
            run(folder.path(), &format!("plan missing.pcd {flag} no/such/folder/x"));
        assert_eq!((code, out.as_str()), (Some(1), ""), "{said}");
        assert!(said.contains("cannot write no/such/folder/x"), "{flag}: {said}");
        assert_eq!(said.matches("No such file").count(), 1, "{said}");
    }
    for command in [
        "scene missing.pcd --out",
        "scene missing.pcd --report",
        "verify missing.json --out",
        "verify missing.json --json",
        "task missing.csv --out",
        "task missing.csv --json",
        "view missing.json --no-open --out",
        "view missing.json --no-open --mcap",
    ] {
        let (code, _, said) = run(folder.path(), &format!("{command} no/such/folder/x"));
        assert_eq!(code, Some(1), "{said}");
        assert!(said.contains("cannot write no/such/folder/x"), "{command}: {said}");
    }
}

#[test]
fn a_cell_keeps_the_root_path_that_it_was_made_for() {
    let folder = tempfile::tempdir().expect("a folder");
    let (code, _, said) = run(folder.path(), "cell init --robot-name a --ipc-root worlds/a");
    assert_eq!(code, Some(0), "{said}");
    let cell = std::fs::read_to_string(folder.path().join("cell.toml")).expect("a cell");
    let root = folder.path().canonicalize().expect("there").join("worlds/a");
    assert!(cell.contains(&format!("\nipc_root = {root:?}\n")), "{cell}");
}

/// What is placed is kept clear of also where nothing was scanned: its file is read.
#[test]
fn a_way_through_nothing_scanned_heeds_what_is_placed() {
    let folder = tempfile::tempdir().expect("a folder");
    let (code, _, said) = run(
        folder.path(),
        "goto home --empty --obstacles missing.toml --ipc-root world --timeout 1",
    );
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("missing.toml"), "{said}");
}

#[test]
fn a_file_to_be_viewed_that_is_not_there_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("flight-0.nswrec"), "").expect("written");
    let (code, _, said) = run(folder.path(), "view flight-0.nswrec chair.jsn --no-open");
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("chair.jsn: there is no such file"), "{said}");
}

#[test]
fn a_note_is_told_once() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("cell.toml"), "[scene]\nsupport_height = 0.7\n")
        .expect("written");
    let (code, _, said) = run(folder.path(), "cell check");
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(said.matches("home is taken to be").count(), 1, "{said}");
}

/// How a way is planned says nothing where none is asked for; what a cell says does not count as said.
#[test]
fn flags_of_the_way_to_the_start_need_goto() {
    let folder = tempfile::tempdir().expect("a folder");
    long_plan(&folder.path().join("plan.json"));
    for flag in ["--empty", "--v-max 0.2", "--profile jerk", "--seed 3", "--up 0,0,1"] {
        let (code, _, said) = run(folder.path(), &format!("publish plan.json {flag}"));
        assert_eq!(code, Some(2), "{flag}: {said}");
        assert!(said.contains("--goto"), "{flag}: {said}");
    }
    let cell = "[limits]\nv_max = 0.2\n[scene]\nup = [0, 0, 1]\n";
    std::fs::write(folder.path().join("cell.toml"), cell).expect("written");
    let (code, _, said) = run(folder.path(), "publish plan.json");
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("verif"), "the plan is looked at: {said}");
}

/// A scan of an object alone has nothing to choose from, and it is said what to do instead.
#[test]
fn a_scene_without_objects_is_told_in_words() {
    let folder = tempfile::tempdir().expect("a folder");
    // A ball: no plane.
    let points: String = (0..4000)
        .map(|i| {
            let (z, turn) = (f64::from(i) / 2000.0 - 1.0, 2.4 * f64::from(i));
            let r = (1.0 - z * z).sqrt();
            format!("{} {} {}\n", 0.1 * r * turn.cos(), 0.1 * r * turn.sin(), 0.3 + 0.1 * z)
        })
        .collect();
    std::fs::write(folder.path().join("scan.xyz"), points).expect("written");
    let (code, told, said) = run(folder.path(), "scene scan.xyz --up 0,0,1 --sensor-height 1");
    assert_eq!(code, Some(0), "{said}");
    assert!(told.starts_with("no plane was found"), "{told}");
    assert!(told.contains("leave out --object") && !told.contains("points or m"), "{told}");
    let (code, _, said) =
        run(folder.path(), "plan scan.xyz --up 0,0,1 --sensor-height 1 --object largest");
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("leave out --object") && !said.contains("planner scene"), "{said}");
}

/// Whoever typed `nullsweep` is told of commands of `nullsweep`.
#[test]
fn behind_a_front_it_speaks_of_the_front() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("plan.json"), "no plan").expect("written");
    for (front, own, advice) in [
        ("", "planner: ", "help: `planner plan`"),
        ("nullsweep", "nullsweep: ", "help: `nullsweep plan`"),
    ] {
        let mut inspect = planner(folder.path(), "inspect plan.json");
        let output = inspect.env(nullsweep_cell::FRONT, front).output().expect("it starts");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(said.starts_with(own) && said.contains(advice), "{said}");
    }
}

#[test]
fn a_scene_file_is_taken_beside_a_cell_that_says_which_way_is_up() {
    let folder = tempfile::tempdir().expect("a folder");
    let points: String = (0..3600)
        .map(|i| format!("{} {} 0\n", 0.01 * f64::from(i / 60), 0.01 * f64::from(i % 60)))
        .collect();
    std::fs::write(folder.path().join("scan.xyz"), points).expect("written");
    let (code, _, said) = run(folder.path(), "scene scan.xyz --out scene.toml");
    assert_eq!(code, Some(0), "{said}");
    std::fs::write(folder.path().join("cell.toml"), "[scene]\nup = [0, 0, 1]\n").expect("written");
    let (code, _, said) = run(folder.path(), "view scene.toml --no-open --out view.html");
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("scene.toml says how its scans stand: --up and --scale"), "{said}");
    let pose = "view scene.toml --no-open --sensor-pose 0,0,1,0,0,0,1";
    let (code, _, said) = run(folder.path(), pose);
    assert_eq!(code, Some(2), "{said}");
}

#[test]
fn a_full_disk_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    long_plan(&folder.path().join("plan.json"));
    let told = |said: &str| {
        assert_eq!(said.matches("No space left").count(), 1, "{said}");
        assert!(said.starts_with("planner: ") && !said.contains("panicked"), "{said}");
    };
    for command in
        ["inspect plan.json", "inspect plan.json --json -", "view plan.json --no-open --out v.html"]
    {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").expect("Linux has it");
        let done = planner(folder.path(), command).stdout(full).output().expect("it starts");
        assert_eq!(done.status.code(), Some(1), "{command}");
        let said = String::from_utf8(done.stderr).expect("text");
        told(&said);
        assert!(said.contains("standard output"), "{said}");
    }
    for command in [
        "inspect plan.json --json /dev/full",
        "export plan.json --format csv --out /dev/full",
        "view plan.json --no-open --out /dev/full",
        "view plan.json --no-open --out v.html --mcap /dev/full",
    ] {
        let (code, _, said) = run(folder.path(), command);
        assert_eq!(code, Some(1), "{said}");
        told(&said);
        assert!(said.contains("/dev/full"), "{said}");
    }
}

#[test]
fn no_cause_is_told_twice() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("no.json"), "no plan").expect("written");
    for (args, cause) in [
        ("inspect missing.json", "No such file"),
        ("inspect no.json", "expected"),
        ("plan --demo chair-seat --urdf missing.urdf", "No such file"),
        ("plan --demo chair-seat --tool missing.toml", "No such file"),
    ] {
        let (code, _, said) = run(folder.path(), args);
        assert_eq!(code, Some(1), "{said}");
        assert_eq!(said.matches(cause).count(), 1, "{args}: {said}");
    }
}

#[test]
fn tables_fit_80_columns() {
    let folder = tempfile::tempdir().expect("a folder");
    long_plan(&folder.path().join("plan.json"));
    let (code, out, said) = run(folder.path(), "inspect plan.json");
    assert_eq!(code, Some(0), "{said}");
    assert!(out.lines().count() > 10 && out.contains('°'), "{out}");
    assert!(out.lines().all(|line| line.chars().count() <= 80), "{out}");
}

#[test]
fn a_closed_pipe_ends_it_without_a_word() {
    let folder = tempfile::tempdir().expect("a folder");
    long_plan(&folder.path().join("plan.json"));
    for args in ["export plan.json --format csv", "inspect plan.json --json -"] {
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        let output = planner(folder.path(), args).stdout(writer).output().expect("it starts");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!((output.status.code(), &*said), (Some(141), ""), "{args}");
    }
}

/// A copy of the sample's folder.
fn sample() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/sample");
    std::fs::create_dir(folder.path().join("paths")).expect("made");
    for name in ["arm.urdf", "cell.toml", "sponge.toml", "paths/rows.csv"] {
        std::fs::copy(from.join(name), folder.path().join(name)).expect(name);
    }
    folder
}

/// Three rows over a table, and a crate in the middle of them: whatever the arm meets by itself is met,
/// past the crate, and the page says of the rest what the terminal says.
#[test]
fn a_path_is_followed_on_both_sides_of_what_stands_on_it() {
    let folder = sample();
    let crate_ =
        "[[box]]\nname = \"crate\"\ncentre = [0.46, 0.0, 0.10]\nsize = [0.05, 0.10, 0.20]\n";
    std::fs::write(folder.path().join("crate.toml"), crate_).expect("written");
    let line = "follow paths/rows.csv --obstacles crate.toml --out f.json --json f.figures.json \
                --report f.html";
    let (code, _, said) = run(folder.path(), line);
    assert_eq!(code, Some(0), "{said}");
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).expect(name);
    let figures: serde_json::Value = serde_json::from_str(&read("f.figures.json")).expect("JSON");
    let plan = Plan::read(&folder.path().join("f.json")).expect("a plan");
    let met = figures["met"].as_u64().expect("a count") as usize;
    let left: usize = plan.left.iter().map(|left| left.points.len()).sum();
    assert_eq!(met + left, 15);
    assert!(met >= 12, "{met} of 15: {said}");
    assert!(plan.left[0].cause.contains("from obstacle crate"), "{:?}", plan.left);
    let page = read("f.html");
    for left in &plan.left {
        assert!(said.contains(&left.cause) && page.contains(&left.cause), "{}", left.cause);
    }
    assert!(page.contains(&format!("{met} of 15")) && page.contains("through 15 given poses"));
    assert!(!page.contains("scanned points") && !page.contains("Tsp minimising"));
}

#[test]
fn a_plan_that_is_given_as_a_path_is_told_as_that() {
    let folder = tempfile::tempdir().expect("a folder");
    long_plan(&folder.path().join("plan.json"));
    let (code, _, said) = run(folder.path(), "follow plan.json");
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("plan.json: it is a plan") && said.contains("planner publish"), "{said}");
    std::fs::write(folder.path().join("scan.npy"), [0x93, b'N', 0xff, 0xfe]).expect("written");
    for line in ["inspect scan.npy", "plan --demo chair-seat --tool scan.npy"] {
        let (code, _, said) = run(folder.path(), line);
        assert_ne!(code, Some(0), "{said}");
        assert!(said.contains("scan.npy") && said.contains("text"), "{said}");
        assert!(!said.contains("UTF-8"), "{said}");
    }
}

#[test]
fn a_cell_whose_endpoint_is_no_program_does_not_pass() {
    let folder = sample();
    let path = folder.path().join("cell.toml");
    let cell = std::fs::read_to_string(&path).expect("read");
    for (program, sound) in [("no-such-endpoint", false), ("sh", true), ("./arm.urdf", true)] {
        std::fs::write(&path, cell.replace("mock-hardware", program)).expect("written");
        let (code, out, said) = run(folder.path(), "cell check");
        assert_eq!(code, Some(i32::from(!sound)), "{out}{said}");
        assert_eq!(out.contains("there is no program `no-such-endpoint`"), !sound, "{out}");
    }
    std::fs::write(&path, cell.replace("[0.0, -0.5633, -0.8262]", "[0, 0, 0]")).expect("written");
    let (code, _, said) = run(folder.path(), "cell check");
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("cell.toml: [scene] up: [0.0, 0.0, 0.0] is no direction"), "{said}");
}
