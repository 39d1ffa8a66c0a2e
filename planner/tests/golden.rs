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
            ("tsp velocity", 0x2720e0ab75b8fe42),
            ("tsp acceleration", 0x5af7493a2a0297f7),
            ("curvature velocity", 0x5f54575235f74808),
            ("curvature acceleration", 0x3951837c361a67e0),
            ("joint velocity", 0x5ba2b8517e80b1f5),
            ("joint acceleration", 0x689f3569409f09ff),
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
            ("tsp velocity", 0xe71be47c1b0cfcb8),
            ("tsp acceleration", 0x97b2d08ae42e7e38),
            ("curvature velocity", 0x58a07b6c2ff4d860),
            ("curvature acceleration", 0x688054a472ee3ca8),
            ("joint velocity", 0xf1da166ae78926c4),
            ("joint acceleration", 0xec3b503291fc2f45),
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
            ("tsp velocity", 0xe8489270c7c2a582),
            ("tsp acceleration", 0x36c4a8edbc1627e8),
            ("curvature velocity", 0x3447afce188c3dfb),
            ("curvature acceleration", 0x88c46f39bdd9e23f),
            ("joint velocity", 0x014980b2831f8184),
            ("joint acceleration", 0x47e6277cd0a4b237),
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
        &[("left arm", 0x8a2241ab0152abc1)],
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
        &[("dome", 0x0937040514bb5687)],
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
        &[("panda", 0x87ee71a4f203f59d)],
    );
}
