//! What a program looks like: the robot at each stop, what is swept and what is left, in the floor frame.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion};
use nullsweep_collision::Options;
use nullsweep_planner::plan::{Program, ProgramStop, Work};
use nullsweep_planner::sweep::coverage;
use nullsweep_planner::workcell::Scene;
use nullsweep_planner::workcell::stance::told;
use nullsweep_report::{
    Body, Cloud, Headline, LineSet, Paint, Place, PlaceGroup, ReportData, Shape, Table, Tone,
};
use nullsweep_robot::{Arm, ArmSpec, JointVector, Robot};

use super::robot::{Posed, shapes};
use crate::exit::Usage;
use crate::numbers::percent;
use crate::program::{stop_rows, totals_rows};

/// How far from its base a stop is flown to. \[m\]
const AROUND: f64 = 0.9;
/// Points that are less apart are the same. \[m\]
const SAME: f64 = 1e-4;

/// The page of a program.
pub(crate) fn of_program(
    program: &Program,
    robot: &Robot,
    collision: &Options,
    scene: Option<&Scene>,
) -> anyhow::Result<ReportData> {
    let mut points: BTreeMap<[i64; 3], (Point3<f64>, bool)> = BTreeMap::new();
    let mut shown = Vec::new();
    for (s, stop) in program.stops.iter().enumerate() {
        for (w, work) in stop.works.iter().enumerate() {
            let arm = arm_of(robot, work)?;
            mark(&mut points, work, &arm);
            if w == 0 {
                // Floor and table once.
                let seen = scene.filter(|_| s == 0);
                shown.extend(standing(robot, &arm, stop, work, (collision, seen), s)?);
            }
        }
    }
    let cloud = |name: &str, paint, wanted: bool| Cloud {
        name: name.into(),
        paint,
        points: points.values().filter(|(_, swept)| *swept == wanted).map(|(p, _)| *p).collect(),
        shown: true,
    };
    let mut clouds = vec![cloud("swept", Paint::Swept, true), cloud("left", Paint::Left, false)];
    if let Some(scene) = scene.filter(|scene| !scene.surroundings.is_empty()) {
        let points = scene.surroundings.clone();
        clouds.push(Cloud { name: "around".into(), paint: Paint::Around, points, shown: true });
    }
    let at = |stop: &ProgramStop| Point3::from(stop.pose().translation.vector);
    let place = |(s, stop): (usize, &ProgramStop)| Place {
        label: format!("stop {}: {}", s + 1, told(&stop.base)),
        at: at(stop) + 0.5 * AROUND * nalgebra::Vector3::z(),
        radius: AROUND,
        normal: None,
    };
    let table = |title: &str, columns: &[&str], rows: Vec<Vec<String>>| Table {
        title: title.into(),
        columns: columns.iter().map(|&c| c.into()).collect(),
        rows,
    };
    Ok(ReportData {
        title: "Nullsweep program".into(),
        subtitle: format!("{}, {} stops", program.robot, program.stops.len()),
        headline: headline(program),
        tables: vec![
            table("Stops", &crate::program::COLUMNS, stop_rows(program)),
            table("Figures", &["figure", "value"], totals_rows(&program.totals)),
        ],
        places: vec![PlaceGroup {
            name: "Stops".into(),
            items: program.stops.iter().enumerate().map(place).collect(),
            ..PlaceGroup::default()
        }],
        clouds,
        spacing: scene.map_or(0.0, |scene| scene.surface.spacing),
        lines: vec![LineSet {
            name: "order of the stops".into(),
            lines: vec![program.stops.iter().map(at).collect()],
            shown: true,
        }],
        shapes: shown,
        ..ReportData::default()
    })
}

fn headline(program: &Program) -> Vec<Headline> {
    let t = &program.totals;
    let figure = |label: &str, value: String, detail: String| Headline {
        label: label.into(),
        value,
        detail,
        tone: Tone::Plain,
    };
    let plans = program.works().count();
    vec![
        figure("swept", percent(t.coverage_all), format!("of {} points", t.points)),
        figure("any stops", percent(t.coverage_of_any_stops), "in reach of some place".into()),
        figure("stops", program.stops.len().to_string(), format!("{plans} plans")),
        figure("task time", format!("{:.1} s", t.task_time_s), "without the drives".into()),
        figure("drive", format!("{:.1} m", t.drive_m), "between the stops".into()),
    ]
}

/// The arm of a plan, its held joints where the plan holds them.
fn arm_of(robot: &Robot, work: &Work) -> anyhow::Result<Arm> {
    let spec: ArmSpec = work.arm.parse().map_err(Usage)?;
    let held: Vec<_> = work.plan.held.iter().map(|h| (h.name.as_str(), h.position)).collect();
    Ok(robot.arm(&spec)?.with_held(&held)?)
}

/// Marks the points that a plan knows, in the floor frame, and those that it sweeps.
fn mark(points: &mut BTreeMap<[i64; 3], (Point3<f64>, bool)>, work: &Work, arm: &Arm) {
    let scan = work.plan.scan();
    let swept = coverage::swept_by(&scan, [work.plan.trajectory()], arm);
    let pose = work.plan.base_pose();
    for (point, swept) in scan.points.iter().zip(swept) {
        let point = pose * point;
        let key = [0, 1, 2].map(|i| (point[i] / SAME).round() as i64);
        points.entry(key).or_insert((point, false)).1 |= swept;
    }
}

/// The robot at a stop as it begins its first plan, in the floor frame.
fn standing(
    robot: &Robot,
    arm: &Arm,
    stop: &ProgramStop,
    work: &Work,
    (collision, scene): (&Options, Option<&Scene>),
    number: usize,
) -> anyhow::Result<Vec<Shape>> {
    let pose = stop.pose();
    let here = scene.map(|scene| scene.transformed(&pose.inverse()));
    let figure = shapes(Posed { robot, arm, tool: &work.plan.tool, collision }, here.as_ref())?;
    let q = work.plan.knots.first().map_or(JointVector::ZERO, |knot| knot.q);
    let bodies = placed(&figure.bodies, &q);
    let moved = |shape: Shape| {
        let at = pose * shape.body.map_or_else(Isometry3::identity, |body| bodies[body]);
        let vertices = shape.vertices.iter().map(|v| at * v).collect();
        Shape {
            name: format!("stop {}: {}", number + 1, shape.name),
            body: None,
            vertices,
            ..shape
        }
    };
    Ok(figure.shapes.into_iter().map(moved).collect())
}

/// Where the bodies are at a joint vector, parents first.
fn placed(bodies: &[Body], q: &JointVector) -> Vec<Isometry3<f64>> {
    let mut poses: Vec<Isometry3<f64>> = Vec::with_capacity(bodies.len());
    for body in bodies {
        let value = body.factor * q[body.joint] + body.offset;
        let motion = if body.slides {
            Isometry3::from(Translation3::from(body.axis.into_inner() * value))
        } else {
            Isometry3::from_parts(
                Translation3::identity(),
                UnitQuaternion::from_axis_angle(&body.axis, value),
            )
        };
        let parent = body.parent.map_or_else(Isometry3::identity, |parent| poses[parent]);
        poses.push(parent * body.rest * motion);
    }
    poses
}
