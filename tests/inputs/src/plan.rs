//! A plan's file: whatever the command line does with one that it reads.

use std::io;
use std::path::Path;
use std::sync::OnceLock;

use nalgebra::{Point3, Vector3};
use nullsweep_collision::{Obstacle, Options};
use nullsweep_planner::plan::export::{Format, write};
use nullsweep_planner::plan::{Plan, PlanKnot, Profile, Stretch, SurfaceSample};
use nullsweep_planner::timing::{Limits, Rest};
use nullsweep_planner::verify::{Given, verify};
use nullsweep_planner::workcell::Scene;
use nullsweep_robot::{JointVector, Tool};
use nullsweep_surface::Scan;

use crate::arm::{arm, spec};

/// Joints of a plan that is verified here move no farther. \[rad\]
const SHORT: f64 = 300.0;

pub(crate) fn run(bytes: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(bytes) else { return false };
    let Ok(plan) = Plan::parse(text, Path::new("plan.json")) else { return false };
    let again = serde_json::to_string(&plan).expect("a plan can be written");
    assert_eq!(Plan::parse(&again, Path::new("again.json")).expect("what was written"), plan);
    for format in [Format::RosYaml, Format::Ros2Yaml, Format::Csv, Format::Json] {
        write(&plan, format, &mut io::sink()).expect("a sink takes all");
    }
    let sealed = plan.message_parts().is_ok();
    let (robot, arm) = arm();
    for knot in [0, plan.knots.len() / 2, plan.knots.len()] {
        if let Some(rest) = Rest::after(&plan, knot, &Limits::of(arm, None)) {
            assert!(rest.knots.windows(2).all(|w| w[0].time_ns < w[1].time_ns), "{rest:?}");
        }
    }
    let moved = |path: &Stretch| -> f64 {
        (1..path.knots.len()).map(|k| path.trajectory().curve(k).reach()).sum()
    };
    // What is long is only slow.
    if plan.check_bounds().is_ok()
        && plan.followed(plan.knots.len()).iter().map(moved).sum::<f64>() > SHORT
    {
        return sealed;
    }
    let given = Given { robot, arm: &spec(), scene: scene(), collision: &Options::default() };
    verify(&plan, given, &|| ()).is_ok()
}

/// A shelf before the arm.
fn scene() -> &'static Scene {
    static SCENE: OnceLock<Scene> = OnceLock::new();
    SCENE.get_or_init(|| {
        let points: Vec<Point3<f64>> = (0..5)
            .flat_map(|x| {
                (0..4)
                    .map(move |y| Point3::new(0.72 + 0.02 * f64::from(x), 0.02 * f64::from(y), 0.9))
            })
            .collect();
        let normals = vec![Vector3::z_axis(); points.len()];
        let surface = Scan { raw: points.clone(), points, normals, spacing: 0.02 };
        Scene { obstacles: Vec::<Obstacle>::new(), ..Scene::on_floor(surface) }
    })
}

/// One straight plan with a past, one curved plan.
pub(crate) fn made() -> Vec<Vec<u8>> {
    let (robot, arm) = arm();
    let knot = |k: u32, v: f64| PlanKnot {
        time_ns: u64::from(k) * 500_000_000,
        q: JointVector::new([
            0.1 * f64::from(k),
            0.05 * f64::from(k),
            -0.2,
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
        ]),
        v: JointVector::new([v, 0.5 * v, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        line: (k > 0).then(|| [0.75, 0.01 * f64::from(k), 0.9]),
        patch: (k == 2).then_some(0),
    };
    let straight = Plan {
        surface: scene()
            .surface
            .points
            .iter()
            .map(|p| SurfaceSample { point: (*p).into(), normal: [0.0, 0.0, 1.0], reachable: true })
            .collect(),
        patches: vec![[0.75, 0.0, 0.9]],
        ..Plan::of(robot, arm, &Tool::default(), (0..4).map(|k| knot(k, 0.0)).collect())
    };
    let curved = Plan {
        profile: Profile::Acceleration,
        past: straight.followed(2),
        knots: vec![knot(0, 0.0), knot(1, 0.2), knot(2, 0.0)],
        ..straight.clone()
    };
    [straight, curved].map(|plan| serde_json::to_vec(&plan).expect("numbers")).into()
}
