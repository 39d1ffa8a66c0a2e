//! What a run looks like: the report's data.

use nullsweep_planner::pipeline::Outcome;
use nullsweep_planner::plan::Plan;
use nullsweep_report::{JointAxis, Motion, PatchMark, ReportData, Table};
use nullsweep_robot::Arm;

/// The report of one run.
pub(super) fn picture(outcome: &Outcome, figures: Table) -> ReportData {
    let plan = &outcome.plan;
    let visited: Vec<Option<u32>> = plan.knots.iter().map(|k| k.patch).collect();
    ReportData {
        title: "Nullsweep coverage plan".into(),
        subtitle: format!(
            "{}, {} … {}, {:?} minimising {:?}, seed {}",
            plan.robot,
            plan.joints.first().map_or("", String::as_str),
            plan.joints.last().map_or("", String::as_str),
            plan.method,
            plan.cost,
            plan.seed
        ),
        tables: vec![figures],
        points: outcome.scan.points.clone(),
        swept: outcome.figures.verification.swept.clone(),
        patches: outcome
            .patches
            .iter()
            .enumerate()
            .map(|(i, patch)| PatchMark {
                centre: patch.centre,
                normal: patch.normal,
                unreachable: match (outcome.reached[i], visited.contains(&Some(i as u32))) {
                    (_, true) => None,
                    (false, _) => Some("no inverse kinematics solution free of collision".into()),
                    (true, false) => Some("reachable, but not visited by this plan".into()),
                },
            })
            .collect(),
        edges: outcome
            .graph
            .edges
            .iter()
            .map(|e| e.line.iter().map(|s| s.point).collect())
            .collect(),
        joints: joint_axes(&outcome.arm),
        plans: vec![motion("plan", plan, &outcome.arm)],
        measured: Vec::new(),
    }
}

/// The arm's joints with their soft limits.
#[must_use]
pub fn joint_axes(arm: &Arm) -> Vec<JointAxis> {
    arm.joint_names()
        .iter()
        .zip(arm.limits())
        .map(|(name, limits)| JointAxis {
            name: name.clone(),
            limits: (!limits.continuous).then_some((limits.lower, limits.upper)),
        })
        .collect()
}

/// A plan as the report shows a motion, from time 0 on.
#[must_use]
pub fn motion(name: &str, plan: &Plan, arm: &Arm) -> Motion {
    let pad = plan.tool.on(arm);
    Motion {
        name: name.into(),
        times: plan.knots.iter().map(|k| k.time_ns as f64 * 1e-9).collect(),
        joints: (0..arm.dof()).map(|j| plan.knots.iter().map(|k| k.q[j]).collect()).collect(),
        tool: plan.knots.iter().map(|k| pad.centre(&k.q)).collect(),
        contact: (0..plan.knots.len()).map(|k| plan.on_surface(k)).collect(),
    }
}
