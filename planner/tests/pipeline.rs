//! The whole way from a simulated scan to a plan file.

mod common;

use nullsweep_planner::pipeline::{After, Job, Outcome, StanceChoice, run};
use nullsweep_planner::plan::{CostKind, Method, Plan, PlanError, Profile};
use nullsweep_planner::progress::Silent;
use nullsweep_planner::sweep::{contact_motion, coverage};
use nullsweep_planner::workcell::Scene;
use nullsweep_planner::workcell::stance::Stance;
use nullsweep_robot::{Arm, ArmSpec, Robot, Side};

fn job(method: Method, cost: CostKind) -> Job {
    let held = vec![("torso_lift_joint".to_owned(), 0.2)];
    Job {
        stance: StanceChoice::Given(Stance { base: [-0.708, -0.004, 1.047], height: 0.0, held }),
        method: Some(method),
        cost,
        ik_samples: 30,
        refinements: 1,
        ..Job::new(ArmSpec::pr2(Side::Right))
    }
}

fn plan_on(threads: usize, seat: &Scene, job: &Job) -> Outcome {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    pool.install(|| run(&Robot::pr2(), seat, job, &Silent)).expect("the seat can be planned")
}

fn check(outcome: &Outcome) {
    let f = &outcome.figures;
    let added = &outcome.patches[f.patches..];
    let strokes = added.iter().filter(|patch| patch.points.is_empty()).count();
    println!("{} patches, {strokes} of them strokes, were added", added.len());
    let others = added.len() - strokes - f.places;
    assert_eq!((f.fill_in_patches, f.strokes), (others, strokes));
    let v = &outcome.figures.verification;
    assert!(v.violations.is_empty(), "{:?}", v.violations);
    assert!(v.coverage_reachable > 0.95, "reachable points: {}", v.coverage_reachable);
    assert!(v.line_deviation_max_m < 2e-4, "line: {}", v.line_deviation_max_m);
    assert!(v.scan_distance_p95_m < 0.006, "scan: {}", v.scan_distance_p95_m);
    let left: f64 = outcome.figures.left_out.iter().map(|left| left.share).sum();
    assert!((left + v.coverage_all - 1.0).abs() < 1e-9, "{left} + {}", v.coverage_all);
}

#[test]
fn the_same_seed_gives_the_same_plan_whatever_the_number_of_threads() {
    let seat = common::seat();
    let job = job(Method::Curvature, CostKind::Time);
    let (one, two) = (plan_on(1, &seat, &job), plan_on(2, &seat, &job));
    check(&one);
    assert_eq!(one.plan.digest().expect("short enough"), two.plan.digest().expect("short enough"));
    assert_eq!(one.plan, two.plan);
}

#[test]
fn a_raster_goes_in_strips_and_is_the_same_whatever_the_number_of_threads() {
    let seat = common::seat();
    let job =
        Job { profile: Profile::Acceleration, smooth: true, ..job(Method::Raster, CostKind::Time) };
    let (one, two) = (plan_on(1, &seat, &job), plan_on(2, &seat, &job));
    check(&one);
    assert_eq!(one.plan.method, Method::Raster);
    assert!(one.figures.places > 20, "{:?}", one.figures.places);
    assert!(one.figures.verification.coverage_reachable > 0.98);
    assert_eq!(one.plan, two.plan);
}

#[test]
fn a_plan_goes_on_from_a_knot_and_survives_its_file() {
    let seat = common::seat();
    let first = plan_on(2, &seat, &job(Method::Tsp, CostKind::Effort));
    check(&first);

    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("plan.json");
    first.plan.write(&path).expect("written");
    let plan = Plan::read(&path).expect("read");
    assert_eq!(plan, first.plan);

    let knot = plan.knots.len() / 3;
    let (start, digest) = (plan.knots[knot].q, plan.digest().expect("short enough"));
    let after = Some(After { plan, knot, held: None, again: false });
    let second = plan_on(2, &seat, &Job { after, ..job(Method::Curvature, CostKind::Effort) });
    check(&second);
    assert_eq!(second.plan.knots[0].q, start);
    assert_eq!(
        second.plan.continues.as_ref().map(|c| (c.digest, c.knot)),
        Some((digest, knot as u32))
    );
    assert!(second.plan.knots.len() < first.plan.knots.len(), "only what is left is swept");

    // The third one leaves out what both have swept.
    let knot = second.plan.knots.len() / 3;
    let after = Some(After { plan: second.plan.clone(), knot, held: None, again: false });
    let third = plan_on(2, &seat, &Job { after, ..job(Method::Tsp, CostKind::Effort) });
    check(&third);
    assert_eq!(third.plan.past.len(), 2);
    let visited = |outcome: &Outcome| -> Vec<usize> {
        outcome.plan.knots.iter().filter_map(|k| k.patch).map(|p| p as usize).collect()
    };
    for (plan, until) in [(&first.plan, first.plan.knots.len() / 3), (&second.plan, knot)] {
        let mut followed = plan.clone();
        followed.knots.truncate(until + 1);
        let poses = contact_motion(followed.trajectory(), &third.arm);
        let swept = coverage::swept(&third.scan, &poses, &followed.tool);
        for patch in visited(&third) {
            let points = &third.patches[patch].points;
            let again = points.iter().filter(|&&i| swept[i as usize]).count();
            assert!((again as f64) < 0.9 * points.len() as f64, "patch {patch} was swept before");
        }
    }
    assert!(visited(&third).len() < visited(&second).len());

    std::fs::write(&path, "{\"format\": 1}").expect("written");
    assert!(matches!(Plan::read(&path), Err(PlanError::Parse { .. })));
}

/// The positions that a controller gets every millisecond, and the limits that their differences
/// break, as a share of them.
fn worst_sample(plan: &Plan, arm: &Arm) -> (f64, f64) {
    let period = 1e-3;
    let mut k = 1;
    let end_ns = plan.knots[plan.knots.len() - 1].time_ns;
    let samples: Vec<_> = (0..=end_ns)
        .step_by(1_000_000)
        .map(|t| {
            while plan.knots[k].time_ns < t {
                k += 1;
            }
            let curve = plan.curve(k);
            curve.at((t - plan.knots[k - 1].time_ns) as f64 * 1e-9 / curve.seconds())
        })
        .collect();
    let mut worst = (0.0f64, 0.0f64);
    for w in samples.windows(3) {
        for (j, limits) in arm.limits().iter().enumerate() {
            let velocity = (w[2][j] - w[1][j]) / period;
            let acceleration = (w[2][j] - 2.0 * w[1][j] + w[0][j]) / (period * period);
            worst.0 = worst.0.max(velocity.abs() / limits.velocity);
            worst.1 = worst.1.max(acceleration.abs() / limits.acceleration);
        }
    }
    worst
}

#[test]
fn limited_acceleration_keeps_line_limits_and_joins_in_motion() {
    let seat = common::seat();
    let job = Job {
        profile: Profile::Acceleration,
        ik_samples: 10,
        refinements: 0,
        ..job(Method::Tsp, CostKind::Time)
    };
    let first = plan_on(2, &seat, &job);
    check(&first);
    let (velocity, acceleration) = worst_sample(&first.plan, &first.arm);
    assert!(velocity <= 1.0 + 1e-6 && acceleration <= 1.0 + 1e-6, "{velocity} {acceleration}");
    assert!(velocity.max(acceleration) > 0.98, "nothing is used: {velocity} {acceleration}");

    // In a knot at full motion: the new plan begins with the same velocity, to the bit.
    let knots = &first.plan.knots;
    let speed = |k: usize| knots[k].v.iter().map(|v| v.abs()).fold(0.0, f64::max);
    let middle = knots.len() / 3..knots.len() / 2;
    let knot = middle.max_by(|a, b| speed(*a).total_cmp(&speed(*b))).expect("knots");
    let (q, v) = (knots[knot].q, knots[knot].v);
    let after = Some(After { plan: first.plan, knot, held: None, again: false });
    let second = plan_on(2, &seat, &Job { after, ..job });
    check(&second);
    assert_eq!((second.plan.knots[0].q, second.plan.knots[0].v), (q, v));
    assert!(v.iter().any(|v| *v != 0.0));
    let (velocity, acceleration) = worst_sample(&second.plan, &second.arm);
    assert!(velocity <= 1.0 + 1e-6 && acceleration <= 1.0 + 1e-6, "{velocity} {acceleration}");
}
