//! Digests of plans, so that a change which is to change no plan is seen to change none.
//!
//! A change that is meant to change plans takes the new digests over, which a failing run prints,
//! and says so in its commit.

mod common;

use std::path::Path;

use nullsweep_collision::Options;
use nullsweep_planner::pipeline::{End, Job, StanceChoice, run};
use nullsweep_planner::plan::{CostKind, Method, Profile};
use nullsweep_planner::poses::Tolerance;
use nullsweep_planner::progress::Silent;
use nullsweep_planner::roadmap::GraphConfig;
use nullsweep_planner::task::{self, TaskConfig};
use nullsweep_planner::workcell::Scene;
use nullsweep_planner::workcell::stance::Stance;
use nullsweep_robot::{ArmSpec, Robot, Side, Tool};
use nullsweep_surface::{
    CleanConfig, CropBox, Placement, place, simulate, simulate::SimulatedView,
};

fn assert_golden(found: &[(String, u64)], golden: &[(&str, u64)]) {
    let found: Vec<(&str, u64)> = found.iter().map(|(name, d)| (name.as_str(), *d)).collect();
    let rows: String =
        found.iter().map(|(name, d)| format!("(\"{name}\", {d:#018x}),\n")).collect();
    assert_eq!(found, golden, "plans have changed:\n{rows}");
}

fn scene(view: &SimulatedView, part: Option<CropBox>) -> Scene {
    let (placed, _) = place(&view.scan, &Placement::SensorPose(view.sensor_pose));
    Scene::seen(&placed, part.as_ref(), &CleanConfig::default()).expect("it is there").0
}

/// A job of few samples for the PR2's right arm.
fn job(base: [f64; 3], torso: f64) -> Job {
    let held = vec![("torso_lift_joint".to_owned(), torso)];
    Job {
        stance: StanceChoice::Given(Stance { base, height: 0.0, held }),
        end: End::Contact,
        ik_samples: 16,
        graph: GraphConfig { edge_samples: 24, ..GraphConfig::default() },
        refinements: 1,
        ..Job::new(ArmSpec::pr2(Side::Right))
    }
}

/// The digests of a job's plans by all methods and profiles.
fn digests(scene: &Scene, job: &Job) -> Vec<(String, u64)> {
    let robot = Robot::pr2();
    let mut found = Vec::new();
    for (name, method) in
        [("tsp", Method::Tsp), ("curvature", Method::Curvature), ("joint", Method::Joint)]
    {
        for (speed, profile) in
            [("velocity", Profile::Velocity), ("acceleration", Profile::Acceleration)]
        {
            let job = Job { method: Some(method), profile, ..job.clone() };
            let outcome = run(&robot, scene, &job, &Silent).expect("a plan");
            assert_eq!(outcome.figures.verification.violations, []);
            found.push((format!("{name} {speed}"), outcome.plan.digest().expect("short enough")));
        }
    }
    found
}

#[test]
fn the_seat_is_planned_as_ever() {
    let seat = scene(&simulate::chair(1), Some(simulate::chair_seat()));
    let found = digests(&seat, &job([-0.708, -0.004, 1.047], 0.2));
    assert_golden(
        &found,
        &[
            ("tsp velocity", 0x1f7684da5d813f81),
            ("tsp acceleration", 0x1cca7899545752ab),
            ("curvature velocity", 0xeb02fc0e6f0c1fbf),
            ("curvature acceleration", 0xa2875ba47c027799),
            ("joint velocity", 0xbc3347081f8d4a2f),
            ("joint acceleration", 0x05c89a1989cccd4e),
        ],
    );
}

#[test]
fn the_chair_is_planned_as_ever() {
    let chair = scene(&simulate::chair(1), None);
    let found = digests(&chair, &job([-0.737, 0.158, 0.851], 0.1));
    assert_golden(
        &found,
        &[
            ("tsp velocity", 0x531c66d8c8692a73),
            ("tsp acceleration", 0x243fe27e92d3caf6),
            ("curvature velocity", 0xc500d90e942bb1e7),
            ("curvature acceleration", 0x2871a17296c80a4f),
            ("joint velocity", 0x7b0439ac88f7e939),
            ("joint acceleration", 0xce1c665e9e9f976a),
        ],
    );
}

#[test]
fn the_car_is_planned_as_ever() {
    let car = scene(&simulate::bobby_car(1), None);
    let found = digests(&car, &job([-0.825, 0.021, 1.047], 0.02));
    assert_golden(
        &found,
        &[
            ("tsp velocity", 0x15fe1a7f0a0d6215),
            ("tsp acceleration", 0x215fffde2fce3f15),
            ("curvature velocity", 0x082fbe542db25a3c),
            ("curvature acceleration", 0x093265939fc918f6),
            ("joint velocity", 0x94c32408d51827b4),
            ("joint acceleration", 0xd6a9949cca7e6a64),
        ],
    );
}

/// A stance is searched for, by another cost, for the other arm.
#[test]
fn a_stance_is_chosen_as_ever() {
    let seat = scene(&simulate::chair(1), Some(simulate::chair_seat()));
    let robot = Robot::pr2();
    let spec = ArmSpec::pr2(Side::Left);
    let arm = robot.arm(&spec).expect("an arm");
    let tool = Tool::default();
    let search = nullsweep_planner::workcell::stance::StanceSearch {
        bearings: 8,
        finalists: 4,
        ..nullsweep_planner::workcell::stance::StanceSearch::of(&robot, &arm, &tool)
    };
    let job = Job {
        arm: spec,
        stance: StanceChoice::Search(search),
        cost: CostKind::Effort,
        refinements: 0,
        ..job([0.0; 3], 0.0)
    };
    let outcome = run(&robot, &seat, &job, &Silent).expect("a plan");
    assert_golden(
        &[("left arm".into(), outcome.plan.digest().expect("short enough"))],
        &[("left arm", 0xf92d806f8b154b55)],
    );
}

#[test]
fn given_poses_are_planned_as_ever() {
    let setup = common::setup(Tolerance([0.02, 0.02, 0.0, 0.0, 0.0, f64::INFINITY]));
    let config = TaskConfig { setup, rounds: 2, trials: 10 };
    let outcome = task::run(
        &Robot::pr2(),
        &common::dome(),
        &Scene::of_obstacles(Vec::new()),
        &config,
        &Silent,
    )
    .expect("a plan");
    assert_golden(
        &[("dome".into(), outcome.plan.digest().expect("short enough"))],
        &[("dome", 0xb013d10b6bea0336)],
    );
}

/// An arm with closed-form inverse kinematics of its own, capsules in place of its meshes.
#[test]
fn another_arm_is_planned_as_ever() {
    let urdf =
        Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/robots/panda.urdf"));
    if !urdf.exists() {
        println!("skipped: {} is not there", urdf.display());
        return;
    }
    let robot = Robot::from_urdf_file(urdf).expect("a robot");
    let tool = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/tools/flange-sponge.toml"));
    let tool = std::fs::read_to_string(tool).expect("a tool");
    let seat = scene(&simulate::chair(1), Some(simulate::chair_seat()));
    let job = Job {
        arm: ArmSpec { base: "panda_link0".into(), tip: "panda_link8".into() },
        tool: toml::from_str(&tool).expect("a tool"),
        stance: StanceChoice::Given(Stance {
            base: [-0.5, 0.0, 0.0],
            height: 0.0,
            held: Vec::new(),
        }),
        collision: Options { fit_capsules: Some(0.05), ..Options::default() },
        refinements: 0,
        ..job([0.0; 3], 0.0)
    };
    let outcome = run(&robot, &seat, &job, &Silent).expect("a plan");
    assert_golden(
        &[("panda".into(), outcome.plan.digest().expect("short enough"))],
        &[("panda", 0xe78328c544996d84)],
    );
}
