//! Collision checks of the PR2's right arm among 20,000 scan points, on one core; the exact check by
//! parry's shapes and every point is the baseline.

use std::cell::Cell;
use std::f64::consts::FRAC_PI_2;
use std::sync::LazyLock;

use divan::{Bencher, black_box};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use nullsweep_collision::{Obstacle, Options, ToolContact, World};
use nullsweep_robot::{Arm, ArmSpec, JointVector, Robot, Side, Solutions, Tool};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const POINTS: usize = 20_000;

struct Setting {
    robot: Robot,
    arm: Arm,
    tool: Tool,
    scan: Vec<Point3<f64>>,
    world: World,
    /// Pad on the surface, free: what an accepted plan consists of.
    working: Vec<JointVector>,
    /// Solutions of the inverse kinematics on the surface, free or not: what reach asks about.
    asked: Vec<JointVector>,
    /// Anywhere inside the limits, free or not: what a transfer asks about.
    random: Vec<JointVector>,
}

static SETTING: LazyLock<Setting> = LazyLock::new(|| {
    let robot = Robot::pr2();
    let arm = robot.arm(&ArmSpec::pr2(Side::Right)).expect("the PR2 has a right arm");
    let tool = Tool::default();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let scan: Vec<Point3<f64>> = (0..POINTS)
        .map(|_| {
            let (y, z) = (rng.random_range(-0.7..0.3), rng.random_range(0.4..1.2));
            Point3::new(depth(y) + rng.random_range(-0.002..0.002), y, z)
        })
        .collect();
    let world = build(&robot, &arm, &tool, &scan);

    let (mut working, mut asked, mut random) = (Vec::new(), Vec::new(), Vec::new());
    let (low, high) = arm.ik().redundancy_range().expect("seven joints");
    let mut solutions = Solutions::new();
    while working.len() < 256 {
        let (y, z): (f64, f64) = (rng.random_range(-0.5..0.1), rng.random_range(0.5..1.1));
        // Contact frame: z into the surface, turned about it by any heading.
        let slope = (depth(y + 0.01) - depth(y - 0.01)) / 0.02;
        let facing = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -slope.atan());
        let into = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), FRAC_PI_2);
        let heading =
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), rng.random_range(-3.1..3.1));
        let pad =
            Isometry3::from_parts(Vector3::new(depth(y), y, z).into(), facing * into * heading);
        let target = pad * tool.contact_in_tip().inverse();
        arm.ik().solve(&target, rng.random_range(low..=high), &mut solutions);
        for solution in solutions.iter().filter(|s| arm.within_margins(&s.q)) {
            asked.push(solution.q);
            if world.is_free(&solution.q, ToolContact::Allowed) {
                working.push(solution.q);
            }
        }
    }
    random.resize_with(256, || {
        let mut q = JointVector::default();
        for (value, limits) in q.iter_mut().zip(arm.limits()) {
            *value = rng.random_range(limits.lower.max(-3.1)..limits.upper.min(3.1));
        }
        q
    });
    let share = |all: &[JointVector], contact| {
        let free = all.iter().filter(|q| world.is_free(q, contact)).count();
        format!("{free} of {} free", all.len())
    };
    println!("asked: {}", share(&asked, ToolContact::Allowed));
    println!("random: {}", share(&random, ToolContact::Forbidden));
    Setting { robot, arm, tool, scan, world, working, asked, random }
});

/// Where the surface stands before the robot, at a place to its left. \[m\]
fn depth(y: f64) -> f64 {
    0.7 + 0.05 * (5.0 * y).sin()
}

fn build(robot: &Robot, arm: &Arm, tool: &Tool, scan: &[Point3<f64>]) -> World {
    let floor = Obstacle::floor(Isometry3::identity());
    World::new(robot, arm, tool, scan, &[floor], &Options::default()).expect("a world")
}

/// Calls `run` on one after the other.
fn over<'a, T>(bencher: Bencher<'_, '_>, all: &'a [T], run: impl Fn(&'a T) -> bool + Sync) {
    let next = Cell::new(0);
    bencher.bench_local(|| {
        let i = next.get();
        next.set((i + 1) % all.len());
        run(black_box(&all[i]))
    });
}

#[divan::bench]
fn working_is_free(bencher: Bencher<'_, '_>) {
    let s = &*SETTING;
    over(bencher, &s.working, |q| s.world.is_free(q, ToolContact::Allowed));
}

#[divan::bench]
fn working_exact(bencher: Bencher<'_, '_>) {
    let s = &*SETTING;
    over(bencher, &s.working, |q| s.world.exact().is_free(q, ToolContact::Allowed));
}

#[divan::bench]
fn asked_is_free(bencher: Bencher<'_, '_>) {
    let s = &*SETTING;
    over(bencher, &s.asked, |q| s.world.is_free(q, ToolContact::Allowed));
}

#[divan::bench]
fn random_is_free(bencher: Bencher<'_, '_>) {
    let s = &*SETTING;
    over(bencher, &s.random, |q| s.world.is_free(q, ToolContact::Forbidden));
}

#[divan::bench]
fn random_exact(bencher: Bencher<'_, '_>) {
    let s = &*SETTING;
    over(bencher, &s.random, |q| s.world.exact().is_free(q, ToolContact::Forbidden));
}

/// A turn of the tool on the spot by 0.3 rad.
#[divan::bench]
fn working_motion_free(bencher: Bencher<'_, '_>) {
    let s = &*SETTING;
    over(bencher, &s.working, |q| {
        let mut turned = *q;
        turned[s.arm.dof() - 1] += 0.3;
        s.world.motion_free(q, &turned, ToolContact::Allowed)
    });
}

/// All joints by 0.02 rad: a step of a transfer.
#[divan::bench]
fn random_small_motion_free(bencher: Bencher<'_, '_>) {
    let s = &*SETTING;
    over(bencher, &s.random, |q| {
        let mut near = *q;
        for value in &mut near[..s.arm.dof()] {
            *value += 0.02;
        }
        s.world.motion_free(q, &near, ToolContact::Forbidden)
    });
}

#[divan::bench]
fn build_world(bencher: Bencher<'_, '_>) {
    let s = &*SETTING;
    bencher.bench_local(|| build(&s.robot, &s.arm, &s.tool, black_box(&s.scan)));
}

fn main() {
    divan::main();
}
