//! The whole object from several stops: what they promise, how they begin and end, and that jobs of
//! other processes come to the same program.

mod common;

use nullsweep_planner::pipeline::Job;
use nullsweep_planner::plan::{Plan, PlanError, Program};
use nullsweep_planner::progress::Silent;
use nullsweep_planner::stops::{self, Rounds, Setup, Share, State};
use nullsweep_planner::verify::{Given, between, verify};
use nullsweep_planner::workcell::Scene;
use nullsweep_robot::{ArmSpec, Robot, Side};

/// Both arms of a PR2 whose torso is given, so that there is less to look at.
fn setup() -> Setup {
    let arms = vec![ArmSpec::pr2(Side::Right), ArmSpec::pr2(Side::Left)];
    Setup {
        job: Job { ik_samples: 24, refinements: 0, ..Job::new(arms[0].clone()) },
        arms,
        together: false,
        most: Some(2),
        held: vec![("torso_lift_joint".to_owned(), 0.2)],
        lift: None,
        tucked: None,
        height: 0.0,
    }
}

fn arm_of(work: &nullsweep_planner::plan::Work) -> ArmSpec {
    work.arm.parse().expect("an arm")
}

fn check(program: &Program, robot: &Robot, seat: &Scene) {
    assert!((1..=2).contains(&program.stops.len()), "{} stops", program.stops.len());
    let setup = setup();
    let mut swept = vec![false; seat.surface.points.len()];
    for (_, work) in program.works() {
        let (plan, spec) = (&work.plan, arm_of(work));
        let given = Given { robot, arm: &spec, scene: seat, collision: &setup.job.collision };
        let found = verify(plan, given, &|| ()).expect("a plan of this scene");
        assert!(found.violations.is_empty(), "{:?}", found.violations);
        swept.iter_mut().zip(&found.swept).for_each(|(all, now)| *all |= now);
        // It begins and ends where the other arm's plans hold it.
        let others = program.works().filter(|(_, other)| other.arm != work.arm);
        for held in others.flat_map(|(_, other)| &other.plan.held) {
            let Some(joint) = plan.joints.iter().position(|name| *name == held.name) else {
                continue;
            };
            for knot in [plan.knots.first(), plan.knots.last()] {
                let at = knot.expect("knots").q[joint];
                let turns = (at - held.position) / std::f64::consts::TAU;
                assert!((turns - turns.round()).abs() < 1e-6, "{}: {at}", held.name);
            }
        }
    }
    let share = swept.iter().filter(|s| **s).count() as f64 / swept.len() as f64;
    let t = &program.totals;
    println!("{share} of {} swept, {} stops", t.coverage_of_any_stops, program.stops.len());
    assert!((share - t.coverage_all).abs() < 1e-12, "{share} told as {}", t.coverage_all);
    assert!(share >= 0.97 * t.coverage_of_any_stops, "{share} of {}", t.coverage_of_any_stops);
    let left: f64 = t.unswept.iter().map(|left| left.share).sum();
    assert!((left + share - 1.0).abs() < 1e-9, "{left} left, {share} swept");
    assert!(t.choice_gap >= 0.0 && t.choice_gap < 0.05, "{}", t.choice_gap);
}

/// As jobs that each are written down, read and done by themselves.
fn by_jobs(robot: &Robot, setup: &Setup, seat: &Scene) -> Program {
    let through_file = |state: &State| -> State {
        serde_json::from_str(&serde_json::to_string(state).expect("text")).expect("the same")
    };
    let mut state = Rounds::begin(robot, setup, seat, &Silent).expect("reached").state().clone();
    loop {
        let mut rounds =
            Rounds::resume(robot, setup, seat, through_file(&state)).expect("the same scene");
        let Some(stops) = rounds.next(&Silent).expect("stops") else {
            return stops::program(&rounds, &Silent).expect("a program");
        };
        let asked = through_file(rounds.state());
        let shares: Vec<Share> = stops.into_iter().flat_map(|stop| stop.shares).collect();
        // Another process does each, the last one first.
        let mut done: Vec<_> = shares
            .iter()
            .rev()
            .map(|share| {
                let rounds =
                    Rounds::resume(robot, setup, seat, asked.clone()).expect("the same scene");
                let worked = rounds.work(share).expect("a plan, or why not");
                serde_json::from_str(&serde_json::to_string(&worked).expect("text"))
                    .expect("the same")
            })
            .collect();
        done.reverse();
        rounds.add(done);
        state = rounds.state().clone();
    }
}

#[test]
fn stops_sweep_what_is_in_reach_and_jobs_come_to_the_same_program() {
    let (robot, seat, setup) = (Robot::pr2(), common::seat(), setup());
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let one = pool.install(|| stops::run(&robot, &setup, &seat, &Silent)).expect("a program");
    check(&one, &robot, &seat);
    let many = by_jobs(&robot, &setup, &seat);
    assert!(one == many, "jobs came to another program");

    // As it comes back from its file; and a change is told.
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("program.json");
    one.write(&path).expect("written");
    let read = Program::read(&path).expect("a file").expect("a program");
    assert!(read == one && read.check_seal().is_ok());
    assert!(matches!(Plan::read(&path), Err(PlanError::IsProgram { .. })));
    let mut moved = read.clone();
    moved.stops[0].drive_m += 1.0;
    assert!(matches!(moved.check_seal(), Err(PlanError::Changed)));
    let mut other = read;
    other.stops[0].base[0] += 0.01;
    other.write(&path).expect("written");
    let refused = Program::read(&path).expect_err("plans of another place");
    assert!(matches!(refused, PlanError::OtherStop { stop: 1, work: 1 }), "{refused}");
}

#[test]
fn a_place_where_nothing_is_in_reach_is_told_with_what_was_looked_at() {
    let (robot, setup) = (Robot::pr2(), setup());
    let mut high = common::seat();
    high.surface.points.iter_mut().for_each(|p| p.z += 4.0);
    let error = stops::run(&robot, &setup, &high, &Silent).expect_err("4 m above the floor");
    assert!(error.to_string().contains("looked at"), "{error}");
}

#[test]
fn two_arms_at_once_take_little_more_than_half_the_time() {
    let (robot, seat) = (Robot::pr2(), common::seat());
    let setup = Setup { together: true, most: Some(1), ..setup() };
    let program = stops::run(&robot, &setup, &seat, &Silent).expect("a program");
    let stop = &program.stops[0];
    let [one, other] = *stop.together.first().expect("both arms work at once");
    let works = [&stop.works[one], &stop.works[other]];
    let (specs, collision) = (works.map(arm_of), &setup.job.collision);
    let given =
        [0, 1].map(|arm| Given { robot: &robot, arm: &specs[arm], scene: &seat, collision });
    let (violations, _) =
        between([&works[0].plan, &works[1].plan], given).expect("plans of one place");
    assert!(violations.is_empty(), "{violations:?}");
    for (work, given) in works.iter().zip(given) {
        let found = verify(&work.plan, given, &|| ()).expect("a plan of this scene");
        assert!(found.violations.is_empty(), "{:?}", found.violations);
    }
    let t = &program.totals;
    let sum: f64 = stop.works.iter().map(|work| work.plan.duration()).sum();
    println!("{:.2} s of {sum:.2} s, {:.3} swept", t.task_time_s, t.coverage_all);
    assert!(t.task_time_s < 0.65 * sum, "{} s of {sum} s", t.task_time_s);
    assert!(t.coverage_all > 0.8, "{}", t.coverage_all);

    // What is done at once is sealed too, and must be two plans of two arms.
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("program.json");
    let mut apart = program.clone();
    apart.stops[0].together.clear();
    assert!(program.check_seal().is_ok());
    assert!(matches!(apart.check_seal(), Err(PlanError::Changed)));
    for pairs in [vec![[0, 0]], vec![[0, 7]], vec![[0, 1], [1, 0]]] {
        let mut wrong = program.clone();
        wrong.stops[0].together = pairs;
        wrong.write(&path).expect("written");
        let refused = Program::read(&path).expect_err("no pairs");
        assert!(matches!(refused, PlanError::NoPair { stop: 1 }), "{refused}");
    }
}
