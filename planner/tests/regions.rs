//! Regions of a scene, from their file to the verified plan.

mod common;

use std::path::Path;
use std::sync::OnceLock;

use nalgebra::Isometry3;
use nullsweep_collision::Options;
use nullsweep_planner::pipeline::{Job, Outcome, StanceChoice, run};
use nullsweep_planner::plan::{Plan, PlanKnot, Profile, Trajectory};
use nullsweep_planner::regions::{Around, Label, Regions, Spec};
use nullsweep_planner::sweep::{DIP, Pace};
use nullsweep_planner::verify::{Given, Verification, VerifyError, ViolationKind, verify};
use nullsweep_planner::workcell::{Scene, Stance};
use nullsweep_robot::{ArmSpec, Robot, Side};
use nullsweep_surface::PlacedScan;

/// A half of the chair's seat twice, a corner of it first and slowly, a clamp between, and a column that
/// nothing comes into.
const FILE: &str = "
[[region]]
name = 'half'
kind = 'sweep'
passes = 2
box = { centre = [-0.05, 0.15, 0.45], size = [0.5, 0.3, 0.2] }

[[region]]
name = 'corner'
kind = 'sweep'
priority = 1
tool_speed = 0.05
prism = { outline = [[-0.3, -0.3], [0.0, -0.3], [-0.3, 0.0]], z = [0.3, 0.6] }

[[region]]
name = 'clamp'
kind = 'keep_out'
sphere = { centre = [-0.05, 0.1, 0.45], radius = 0.045 }

[[region]]
name = 'column'
kind = 'avoid'
prism = { outline = [[0.1, -0.3], [0.2, -0.3], [0.2, -0.2]], z = [0.4, 1.5] }
";

fn regions(text: &str) -> Regions {
    let around =
        Around { scan: &PlacedScan::default(), scan_to_floor: Isometry3::identity(), seed: 1 };
    let spec = Spec::parse(text, Path::new("regions.toml")).expect("a file of regions");
    spec.find(&around).expect("they are found")
}

fn scene(text: &str) -> Scene {
    common::seat().with_regions(regions(text)).expect("they match")
}

fn job() -> Job {
    let held = vec![("torso_lift_joint".to_owned(), 0.2)];
    Job {
        stance: StanceChoice::Given(Stance { base: [-0.708, -0.004, 1.047], height: 0.0, held }),
        ik_samples: 12,
        refinements: 1,
        profile: Profile::Acceleration,
        smooth: true,
        ..Job::new(ArmSpec::pr2(Side::Right))
    }
}

fn planned() -> &'static (Scene, Outcome) {
    static MADE: OnceLock<(Scene, Outcome)> = OnceLock::new();
    MADE.get_or_init(|| {
        let scene = scene(FILE);
        let outcome = run(&Robot::pr2(), &scene, &job(), &common::Notes::default());
        (scene, outcome.expect("a plan"))
    })
}

fn look(plan: &Plan, scene: &Scene) -> Result<Verification, VerifyError> {
    let (robot, arm) = (&Robot::pr2(), &ArmSpec::pr2(Side::Right));
    verify(plan, Given { robot, arm, scene, collision: &Options::default() }, &|| ())
}

#[test]
fn each_region_is_swept_as_often_as_is_asked_for_and_the_rest_is_left_in_peace() {
    let (scene, outcome) = planned();
    let found = &outcome.figures.verification;
    assert!(found.violations.is_empty(), "{:?}", found.violations);
    let [half, corner, clamp, column] = &found.regions[..] else { panic!("{:?}", found.regions) };
    println!("{half:?}\n{corner:?}\n{clamp:?}\n{column:?}");
    assert!(half.coverage_reachable > 0.9, "twice: {half:?}");
    assert!(corner.coverage_reachable > 0.9, "{corner:?}");
    assert!(clamp.points > 20 && clamp.coverage == 0.0, "{clamp:?}");
    assert_eq!(found.against.keep_out_points, scene.keep_out.len());
    // What is in no region is swept only where the pad reaches beyond one.
    let labels = scene.regions.labels(&scene.surface.points);
    let beside: Vec<bool> =
        labels.iter().zip(&found.swept).filter(|(l, _)| **l == Label::None).map(|p| *p.1).collect();
    let share = beside.iter().filter(|s| **s).count() as f64 / beside.len() as f64;
    assert!(beside.len() > 500 && share < 0.6, "{share} of {}", beside.len());
    let left: Vec<&str> = outcome.plan.left.iter().map(|left| left.cause.as_str()).collect();
    assert!(left.contains(&"in no region that is to be swept"), "{left:?}");
    assert!(left.contains(&"the tool keeps out of it"), "{left:?}");
}

#[test]
fn the_rounds_go_by_priority_and_keep_their_tool_speed() {
    let (_, outcome) = planned();
    let rounds = &outcome.figures.rounds;
    let told: Vec<(&str, u32)> =
        rounds.iter().map(|round| (round.regions[0].as_str(), round.pass)).collect();
    assert_eq!(told, [("corner", 1), ("half", 1), ("half", 2)]);
    let held = rounds[0].tool_speed.as_ref().expect("its own speed");
    assert!(held.speed == 0.05 && held.share > 0.6, "{held:?}");
    let end_ns = (rounds[0].task_time_s * 1e9) as u64;
    let (slow, fast): (Vec<PlanKnot>, Vec<PlanKnot>) =
        outcome.plan.knots.iter().partition(|knot| knot.time_ns <= end_ns);
    let tool_speed = |knots: &[PlanKnot]| {
        let path = Trajectory { knots, ..outcome.plan.trajectory() };
        Pace::of(path, false, &outcome.arm, DIP).tool_speed_p95
    };
    assert!(tool_speed(&slow) < 0.052, "{}", tool_speed(&slow));
    let since: Vec<PlanKnot> =
        fast.iter().map(|k| PlanKnot { time_ns: k.time_ns - fast[0].time_ns, ..*k }).collect();
    assert!(tool_speed(&since) > 0.1, "{}", tool_speed(&since));
    assert!(rounds[1].tool_speed.is_none());
    let all: f64 = rounds.iter().map(|round| round.task_time_s).sum();
    assert!((all - outcome.figures.task_time_s).abs() < 1e-6);
    let twice = outcome.figures.passes.passes_histogram[2..].iter().sum::<usize>();
    assert!(twice >= (0.8 * outcome.figures.verification.regions[0].points as f64) as usize);
}

#[test]
fn the_same_regions_give_the_same_plan_from_its_file_too() {
    let (scene, outcome) = planned();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let again = pool.install(|| run(&Robot::pr2(), scene, &job(), &common::Notes::default()));
    assert_eq!(again.expect("a plan").plan, outcome.plan);
    let text = serde_json::to_string(&outcome.plan).expect("text");
    let read = Plan::parse(&text, Path::new("plan.json")).expect("a plan");
    assert_eq!(read, outcome.plan);
    let found = look(&read, scene).expect("it can be checked");
    assert_eq!(found, outcome.figures.verification);
}

#[test]
fn a_plan_is_not_checked_without_the_regions_that_it_was_made_for() {
    let (_, outcome) = planned();
    let error = look(&outcome.plan, &common::seat()).expect_err("they are not there").to_string();
    assert!(error.contains("made for region half") && error.contains("no such region"), "{error}");
    let larger = scene(&FILE.replace("radius = 0.045", "radius = 0.08"));
    let error = look(&outcome.plan, &larger).expect_err("one is larger").to_string();
    assert!(error.contains("made for region half") && error.contains("here it holds"), "{error}");
}

#[test]
fn a_plan_that_goes_over_what_is_to_be_kept_out_of_is_refused() {
    let (_, outcome) = planned();
    let clamped = scene(
        "[[region]]\nkind = 'keep_out'\nname = 'clamp'\n\
         sphere = { centre = [-0.05, 0.2, 0.45], radius = 0.03 }",
    );
    let plan = Plan { regions: Vec::new(), ..outcome.plan.clone() };
    let found = look(&plan, &clamped).expect("it can be checked").violations;
    let kinds: Vec<ViolationKind> = found.iter().map(|v| v.kind).collect();
    assert!(kinds.contains(&ViolationKind::KeepOut) && kinds.contains(&ViolationKind::Collision));
    assert!(kinds.iter().all(|k| matches!(k, ViolationKind::KeepOut | ViolationKind::Collision)));
}
