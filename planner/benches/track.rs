//! Following one edge of 5.6 cm with collision checks, on one core: the PR2's right arm on a curved
//! surface of 20,000 scan points.

use std::cell::Cell;
use std::sync::LazyLock;

use divan::{Bencher, black_box};
use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};
use nullsweep_collision::{Obstacle, Options, World};
use nullsweep_planner::roadmap::{Edge, ToolPath};
use nullsweep_planner::workcell::{Bed, Sample, Workcell, contact_pose, direction, heading_of};
use nullsweep_robot::{Arm, ArmSpec, Robot, Side, Tool};
use nullsweep_surface::{Scan, Surface, SurfacePoint};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const POINTS: usize = 20_000;
/// Length of an edge. \[m\]
const LENGTH: f64 = 0.056;
/// Edges that the arm can follow from end to end without collision.
const EDGES: usize = 128;

struct Case {
    edge: Edge,
    path: ToolPath,
    from: Sample,
    to: Sample,
}

struct Setting {
    arm: Arm,
    tool: Tool,
    world: World,
    bed: Bed,
    cases: Vec<Case>,
}

impl Setting {
    fn cell(&self) -> Workcell<'_> {
        Workcell { arm: &self.arm, tool: &self.tool, world: &self.world }
    }
}

/// Where the surface stands before the robot, at a place to its left. \[m\]
fn depth(y: f64) -> f64 {
    0.7 + 0.05 * (5.0 * y).sin()
}

fn point(y: f64, z: f64) -> SurfacePoint {
    let slope = 0.25 * (5.0 * y).cos();
    let normal = UnitVector3::new_normalize(Vector3::new(-1.0, slope, 0.0));
    SurfacePoint { point: Point3::new(depth(y), y, z), normal }
}

static SETTING: LazyLock<Setting> = LazyLock::new(|| {
    let robot = Robot::pr2();
    let arm = robot.arm(&ArmSpec::pr2(Side::Right)).expect("the PR2 has a right arm");
    let tool = Tool::default();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let on_surface: Vec<SurfacePoint> = (0..POINTS)
        .map(|_| {
            let mut at = point(rng.random_range(-0.7..0.3), rng.random_range(0.4..1.2));
            at.point.x += rng.random_range(-0.002..0.002);
            at
        })
        .collect();
    let points: Vec<Point3<f64>> = on_surface.iter().map(|p| p.point).collect();
    let normals = on_surface.iter().map(|p| p.normal).collect();
    let floor = Obstacle::floor(Isometry3::identity());
    let world =
        World::new(&robot, &arm, &tool, &points, &[floor], &Options::default()).expect("a world");
    let scan = Scan { raw: points.clone(), points, normals, spacing: 0.006 };
    let mut setting =
        Setting { arm, tool, world, bed: Bed::soft(Surface::new(&scan)), cases: Vec::new() };
    while setting.cases.len() < EDGES {
        let (y, z) = (rng.random_range(-0.5..0.1), rng.random_range(0.5..1.1));
        let way: f64 = rng.random_range(-3.1..3.1);
        let roll = {
            let (low, high) = setting.arm.ik().redundancy_range().expect("seven joints");
            rng.random_range(low..=high)
        };
        let (a, b) = (point(y, z), point(y + LENGTH * way.cos(), z + LENGTH * way.sin()));
        let case = case(&setting, &a, &b, roll, rng.random_range(-0.5..0.5));
        setting.cases.extend(case);
    }
    let knots: usize = setting
        .cases
        .iter()
        .map(|c| setting.cell().follow(&c.path, &c.from, &c.to).map_or(0, |t| t.joints.len()))
        .sum();
    println!("{EDGES} edges of {LENGTH} m, {:.1} knots each", knots as f64 / EDGES as f64);
    setting
});

/// An edge from `a` to `b` if the arm can follow it at this roll, the pad turning by `turn`.
fn case(
    setting: &Setting,
    a: &SurfacePoint,
    b: &SurfacePoint,
    roll: f64,
    turn: f64,
) -> Option<Case> {
    let cell = setting.cell();
    let line = setting.bed.line(a, b, 0.006, 0.07)?;
    let last = line.len() - 1;
    let edge = Edge {
        a: 0,
        b: 1,
        heading_a: heading_of(&line[0].normal, &(line[1].point - line[0].point)),
        heading_b: heading_of(&line[last].normal, &(line[last].point - line[last - 1].point)),
        line,
        turn: 0.0,
    };
    let path = ToolPath::along(&edge, false, edge.heading_a, edge.heading_b + turn, 0.0);
    let sample = |at: &SurfacePoint, heading: f64| {
        let mut found = Vec::new();
        let travel = direction(&at.normal, heading);
        cell.samples(
            &contact_pose(&at.point, &at.normal, &travel, 0.0),
            heading,
            &[roll],
            &mut found,
        );
        found
    };
    let (from, to) = (sample(a, edge.heading_a), sample(b, edge.heading_b + turn));
    for f in &from {
        for t in &to {
            if cell.follow(&path, f, t).is_ok() {
                return Some(Case { edge, path, from: *f, to: *t });
            }
        }
    }
    None
}

/// Calls `run` on one edge after the other.
fn over(bencher: Bencher<'_, '_>, run: impl Fn(&'static Setting, &'static Case) -> bool) {
    let setting = &*SETTING;
    let next = Cell::new(0);
    bencher.bench_local(|| {
        let i = next.get();
        next.set((i + 1) % setting.cases.len());
        run(setting, black_box(&setting.cases[i]))
    });
}

/// The inverse kinematics along the edge, limits, and the proof that nothing collides at its joint
/// vectors or between them.
#[divan::bench]
fn follow(bencher: Bencher<'_, '_>) {
    over(bencher, |s, c| s.cell().follow(&c.path, &c.from, &c.to).is_ok());
}

/// The search for another way between the same ends, as if that one had failed.
#[divan::bench]
fn detour(bencher: Bencher<'_, '_>) {
    over(bencher, |s, c| s.cell().detour(&c.path, &[c.from], &[c.to]).is_some());
}

/// The tool's path from the edge's line.
#[divan::bench]
fn tool_path(bencher: Bencher<'_, '_>) {
    over(bencher, |_, c| {
        let (from, to) = (c.from.heading, c.to.heading);
        black_box(ToolPath::along(&c.edge, false, from, to, 0.0));
        true
    });
}

/// The line on the surface under the chord.
#[divan::bench]
fn surface_line(bencher: Bencher<'_, '_>) {
    over(bencher, |s, c| {
        let last = c.edge.line.len() - 1;
        s.bed.line(&c.edge.line[0], &c.edge.line[last], 0.006, 0.07).is_some()
    });
}

fn main() {
    divan::main();
}
