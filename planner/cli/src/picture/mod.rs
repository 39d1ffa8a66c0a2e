//! What a plan looks like: the data of its page.

mod flight;
mod headline;
mod motion;
mod points;
mod program;
mod recorded;
mod robot;
mod sitter;

use anyhow::ensure;
use nullsweep_planner::plan::Plan;
use nullsweep_report::{JointAxis, Motion, ReportData};
use nullsweep_robot::Arm;

use headline::headline;
use motion::motions;
use points::Points;

pub(super) use flight::Flight;
pub(super) use program::of_program;
pub(super) use recorded::recorded;
pub(super) use robot::Posed;
pub(super) use sitter::Sitter;

/// The page of some plans.
pub(super) fn picture(sitter: Sitter<'_>) -> anyhow::Result<ReportData> {
    let Some(plan) = sitter.plans.last() else { return Ok(ReportData::default()) };
    for other in sitter.plans {
        ensure!(
            other.base_pose() == plan.base_pose()
                && other.joints == plan.joints
                && other.held == plan.held,
            "the plans are not of one stance: the robot stands at {:?} in one, at {:?} in another, \
             or other joints are moved or held",
            other.base,
            plan.base
        );
    }
    let here = sitter.scene.map(|scene| scene.transformed(&plan.base_pose().inverse()));
    let points = Points::of(plan, sitter.arm, here.as_ref(), sitter.verification);
    let (tool, collision) = (&plan.tool, sitter.collision);
    let posed = Posed { robot: sitter.robot, arm: sitter.arm, tool, collision };
    let robot = robot::shapes(posed, here.as_ref())?;
    let plans = motions(&sitter, here.as_ref())?;
    let measured: Vec<Motion> = sitter.flights.iter().map(|f| f.after(&plans)).collect();
    let (headline, notes) = headline(&sitter, here.as_ref(), &points, &plans, &robot);
    Ok(ReportData {
        title: "Nullsweep coverage plan".into(),
        subtitle: subtitle(plan),
        headline,
        notes,
        tables: sitter.tables,
        places: points.places,
        clouds: points.clouds,
        spacing: here.as_ref().map_or(0.0, |scene| scene.surface.spacing),
        lines: sitter.lines,
        shapes: robot.shapes,
        bodies: robot.bodies,
        pad: Some(robot.pad),
        joints: joint_axes(sitter.arm),
        plans,
        measured,
    })
}

/// Which arm, and what it was planned by.
fn subtitle(plan: &Plan) -> String {
    let joint = |name: Option<&String>| name.map_or(String::new(), String::clone);
    let (first, last) = (joint(plan.joints.first()), joint(plan.joints.last()));
    let by = match plan.is_of_poses() {
        true => format!("through {} given poses", plan.patches.len()),
        false => format!("{:?} minimising {:?}", plan.method, plan.cost),
    };
    format!("{}, {first} … {last}, {by}, seed {}", plan.robot, plan.seed)
}

/// The arm's joints with their soft limits.
fn joint_axes(arm: &Arm) -> Vec<JointAxis> {
    let axis = |(j, name): (usize, &String)| {
        let limits = &arm.limits()[j];
        JointAxis {
            name: name.clone(),
            unit: if arm.is_revolute(j) { "rad" } else { "m" },
            limits: (!limits.continuous).then_some((limits.lower, limits.upper)),
        }
    };
    arm.joint_names().iter().enumerate().map(axis).collect()
}
