//! Arms that are not the PR2's sweep the seat of the simulated chair.

mod common;

use std::path::{Path, PathBuf};

use nullsweep_collision::Options;
use nullsweep_planner::pipeline::{Job, Outcome, StanceChoice, run};
use nullsweep_planner::progress::Silent;
use nullsweep_planner::workcell::stance::{Stance, StanceSearch};
use nullsweep_robot::{ArmSpec, Robot, Tool};

/// An arm in the manner of industrial ones: shoulder and elbow parallel, a spherical wrist, the
/// flange's x axis ahead.
fn industrial() -> (Robot, ArmSpec) {
    let joints = [
        ("0 0 0.30", "0 0 1", (-2.9, 2.9)),
        ("0.06 0 0.10", "0 1 0", (-1.6, 2.2)),
        ("0 0 0.46", "0 1 0", (-2.4, 2.4)),
        ("0.10 0 0.04", "1 0 0", (-3.1, 3.1)),
        ("0.40 0 0", "0 1 0", (-2.1, 2.1)),
        ("0 0 0", "1 0 0", (-6.2, 6.2)),
    ];
    // Of each link: where, how it is turned, radius and length.
    let shapes = [
        ("0 0 0.12", "0 0 0", 0.09, 0.24),
        ("0 0 0.02", "0 0 0", 0.07, 0.12),
        ("0 0 0.23", "0 0 0", 0.05, 0.34),
        ("0.02 0 0.02", "0 0 0", 0.05, 0.10),
        ("0.20 0 0", "0 1.5707963 0", 0.045, 0.28),
        ("0 0 0", "1.5707963 0 0", 0.04, 0.09),
        ("0.07 0 0", "0 1.5707963 0", 0.035, 0.06),
    ];
    let mut text = String::from("<robot name='six'>");
    for (i, (xyz, rpy, radius, length)) in shapes.iter().enumerate() {
        text += &format!(
            "<link name='l{i}'><collision><origin xyz='{xyz}' rpy='{rpy}'/><geometry>\
             <cylinder radius='{radius}' length='{length}'/></geometry></collision></link>"
        );
    }
    for (i, (xyz, axis, (lower, upper))) in joints.iter().enumerate() {
        text += &format!(
            "<joint name='j{i}' type='revolute'><parent link='l{i}'/><child link='l{}'/>\
             <origin xyz='{xyz}'/><axis xyz='{axis}'/>\
             <limit lower='{lower}' upper='{upper}' effort='1' velocity='2.5'/></joint>",
            i + 1
        );
    }
    text += "<link name='flange'/><joint name='fixed' type='fixed'><parent link='l6'/>\
             <child link='flange'/><origin xyz='0.10 0 0'/></joint></robot>";
    let spec = ArmSpec { base: "l0".into(), tip: "flange".into() };
    (Robot::from_urdf_str(&text).unwrap(), spec)
}

/// An arm of the shared data; `None`, saying so, where that is absent.
fn shared(file: &str, base: &str, tip: &str) -> Option<(Robot, ArmSpec)> {
    let data = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data"));
    let path = data.join(file);
    if !path.exists() {
        println!("skipped: {} is not there", path.display());
        return None;
    }
    let spec = ArmSpec { base: base.into(), tip: tip.into() };
    Some((Robot::from_urdf_file(&path).unwrap(), spec))
}

/// The sponge on a flange whose z axis points ahead.
fn on_flange() -> Tool {
    let file = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/tools/flange-sponge.toml"));
    toml::from_str(&std::fs::read_to_string(file).unwrap()).unwrap()
}

/// Plans from a stance, or from the best of a few.
fn plan(robot: &Robot, spec: &ArmSpec, tool: Tool, base: Option<[f64; 3]>) -> Outcome {
    let seat = common::seat();
    let stance = match base {
        Some(base) => StanceChoice::Given(Stance { base, height: 0.0, held: Vec::new() }),
        None => {
            let arm = robot.arm(spec).unwrap();
            let search = StanceSearch::of(robot, &arm, &tool);
            StanceChoice::Search(StanceSearch { bearings: 12, finalists: 6, ..search })
        }
    };
    let job = Job {
        tool,
        stance,
        ik_samples: 24,
        refinements: 0,
        collision: Options { fit_capsules: Some(0.05), ..Options::default() },
        ..Job::new(spec.clone())
    };
    run(robot, &seat, &job, &Silent).expect("the seat can be planned")
}

/// No rule is broken, and most of what is reached is swept.
fn check(outcome: &Outcome, reachable: usize, swept: f64) {
    let figures = &outcome.figures;
    let v = &figures.verification;
    println!(
        "{} of {} patches, {:.3} of their points, {} violations",
        figures.reachable,
        figures.patches,
        v.coverage_reachable,
        v.violations.len()
    );
    assert!(v.violations.is_empty(), "{:?}", v.violations);
    assert!(figures.reachable >= reachable, "{} of {}", figures.reachable, figures.patches);
    assert!(v.coverage_reachable > swept, "{}", v.coverage_reachable);
    assert!(v.line_deviation_max_m < 2e-4 && v.scan_distance_p95_m < 0.006);
}

#[test]
fn an_industrial_arm_finds_a_stance_and_a_start_and_sweeps_the_seat() {
    let (robot, spec) = industrial();
    let outcome = plan(&robot, &spec, Tool::default(), None);
    check(&outcome, 40, 0.9);
    // It starts where it may be.
    assert!(outcome.arm.within_margins(&outcome.plan.knots[0].q));
}

#[test]
fn a_panda_sweeps_the_seat_from_where_it_is_put() {
    let Some((robot, spec)) = shared("robots/panda.urdf", "panda_link0", "panda_link8") else {
        return;
    };
    check(&plan(&robot, &spec, on_flange(), Some([-0.5, 0.0, 0.0])), 70, 0.95);
}

#[test]
fn an_iiwa_sweeps_the_seat_from_where_it_is_put() {
    let Some((robot, spec)) = shared("robots/iiwa.urdf", "iiwa_link_0", "iiwa_link_ee") else {
        return;
    };
    check(&plan(&robot, &spec, on_flange(), Some([-0.5, 0.0, 0.0])), 70, 0.95);
}

/// Its home collides, two of its joints turn farther than once, and its URDF is a calibrated one.
#[test]
fn a_ur5_finds_a_stance_and_a_start_and_sweeps_the_seat() {
    let Some((robot, spec)) = shared("coverage-tasks/ur5.urdf", "base_link", "tool_tip") else {
        return;
    };
    check(&plan(&robot, &spec, on_flange(), None), 50, 0.9);
}
