//! What is said of how good a plan could be, held against all that could be done on a small surface.

mod common;

use nalgebra::Point3;
use nullsweep_planner::bounds::{Ascent, Stops, coverable, least, pieces};
use nullsweep_planner::cost::{self, Cost, Effort, TaskTime};
use nullsweep_planner::pipeline::{Job, Outcome, StanceChoice, run};
use nullsweep_planner::progress::Silent;
use nullsweep_planner::sweep::coverage;
use nullsweep_planner::workcell::{Bed, Scene, Stance, Workcell};
use nullsweep_robot::{ArmSpec, Robot, Side};
use nullsweep_surface::{CleanConfig, CropBox, Placement, place, simulate};

/// A corner of the simulated chair's seat, all else in the way.
fn corner() -> Scene {
    let view = simulate::chair(1);
    let (placed, _) = place(&view.scan, &Placement::SensorPose(view.sensor_pose));
    let seat = simulate::chair_seat();
    let to = Point3::new(seat.min.x + 0.20, seat.min.y + 0.16, seat.max.z);
    let corner = CropBox { min: seat.min, max: to };
    Scene::seen(&placed, Some(&corner), &CleanConfig::default()).expect("the corner is there").0
}

/// The least that any order and any choice of samples costs: the cheapest way through each set of
/// places to each sample of one of them, set after set.
fn by_trial<C: Cost>(cost: &C, outcome: &Outcome, stops: &Stops) -> f64 {
    let continuous = outcome.arm.continuous();
    let places = stops.samples.len();
    let all: Vec<_> =
        (0..places).flat_map(|p| stops.samples[p].iter().map(move |s| (p, s.q))).collect();
    let mut ways = vec![vec![f64::INFINITY; all.len()]; 1 << places];
    for (k, (place, q)) in all.iter().enumerate() {
        ways[1 << place][k] = cost.of(&continuous.displacement(&stops.start, q));
    }
    for set in 1..1usize << places {
        for (from, (_, here)) in all.iter().enumerate() {
            let so_far = ways[set][from];
            if so_far.is_infinite() {
                continue;
            }
            for (to, (place, there)) in
                all.iter().enumerate().filter(|(_, (p, _))| set >> p & 1 == 0)
            {
                let way = so_far + cost.of(&continuous.displacement(here, there));
                let known = &mut ways[set | 1 << place][to];
                *known = known.min(way);
            }
        }
    }
    ways[(1 << places) - 1].iter().copied().fold(f64::INFINITY, f64::min)
}

fn check<C: Cost>(cost: &C, outcome: &Outcome, stops: &Stops) {
    let (continuous, dof) = (outcome.arm.continuous(), outcome.arm.dof());
    let found = least(cost, continuous, dof, stops, &Ascent::default()).expect("there is a way");
    let best = by_trial(cost, outcome, stops);
    assert!(found.bound <= best + 1e-9, "{found:?}, but {best} is possible");
    assert!(found.bound > 0.85 * best, "{found:?} of {best}");
    assert!(found.straight >= best - 1e-4, "{found:?}, the best is {best}");
    let path: Vec<_> = outcome.plan.knots.iter().map(|knot| knot.q).collect();
    let plan = cost::of_path(cost, &path);
    assert!(plan >= best, "the plan costs {plan}, less than is possible: {best}");
}

#[test]
fn no_way_through_a_small_plans_stops_passes_its_bounds() {
    let scene = corner();
    let held = vec![("torso_lift_joint".to_owned(), 0.2)];
    let job = Job {
        stance: StanceChoice::Given(Stance { base: [-0.708, -0.004, 1.047], height: 0.0, held }),
        ik_samples: 4,
        refinements: 0,
        ..Job::new(ArmSpec::pr2(Side::Right))
    };
    let outcome = run(&Robot::pr2(), &scene, &job, &Silent).expect("the corner can be planned");
    let stops = Stops::of(&outcome, &job);
    let (places, samples) =
        (stops.samples.len(), stops.samples.iter().map(Vec::len).sum::<usize>());
    println!("{places} places, {samples} samples");
    assert!((3..=9).contains(&places), "{places} places");
    check(&Effort, &outcome, &stops);
    check(&TaskTime::new(&cost::velocities(&outcome.arm, None)), &outcome, &stops);

    let jumps = outcome.visits.iter().filter(|visit| visit.leg.is_jump()).count();
    let found = pieces(&stops, &outcome.graph, jumps);
    assert!((1..=jumps).contains(&found.least), "{found:?}");

    let cell = Workcell { arm: &outcome.arm, tool: &job.tool, world: &outcome.world };
    let bed = Bed::new(&scene.transformed(&outcome.plan.base_pose().inverse()), &job.tool);
    let nothing = vec![false; outcome.scan.points.len()];
    let swept = &outcome.figures.verification.swept;
    let anew = coverable(cell, &outcome.scan, &bed, (&nothing, job.ik_samples), &Silent);
    let beside = coverable(cell, &outcome.scan, &bed, (swept, job.ik_samples), &Silent);
    for i in 0..swept.len() {
        assert_eq!(beside[i], anew[i] || swept[i], "point {i}");
    }
    assert!(coverage::share(&anew) > 0.9 * coverage::share(swept), "{}", coverage::share(&anew));
    let threads = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let alone = threads
        .install(|| coverable(cell, &outcome.scan, &bed, (&nothing, job.ik_samples), &Silent));
    assert_eq!(alone, anew);
}

#[test]
fn what_a_plan_leaves_has_reasons_that_add_up() {
    let held = vec![("torso_lift_joint".to_owned(), 0.2)];
    let job = Job {
        stance: StanceChoice::Given(Stance { base: [-0.708, -0.004, 1.047], height: 0.0, held }),
        ik_samples: 30,
        refinements: 0,
        ..Job::new(ArmSpec::pr2(Side::Right))
    };
    let outcome =
        run(&Robot::pr2(), &common::seat(), &job, &Silent).expect("the seat can be planned");
    let f = &outcome.figures;
    let told: usize = f.missed.iter().map(|row| row.points).sum();
    let reachable = outcome.plan.surface.iter().filter(|sample| sample.reachable).count();
    let left = (1.0 - f.verification.coverage_reachable) * reachable as f64;
    assert!((told as f64 - left).abs() < 0.5, "{told} told, {left} left: {:?}", f.missed);
    let share: f64 = f.missed.iter().map(|row| row.share).sum();
    assert!((share + f.verification.coverage_reachable - 1.0).abs() < 1e-9);
}
