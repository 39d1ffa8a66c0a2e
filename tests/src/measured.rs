//! What an arm has swept, from the positions that were measured on it.

use nalgebra::Isometry3;
use nullsweep_planner::plan::Plan;
use nullsweep_planner::sweep::coverage;
use nullsweep_robot::{Arm, JointVector};
use serde::{Deserialize, Serialize};

/// Shares of the surface that were swept.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Swept {
    /// Of all scanned points, 0…1.
    pub all: f64,
    /// Of the points of reachable patches, 0…1.
    pub reachable: f64,
    /// How many scanned points there are.
    pub points: usize,
}

/// What the plan's tool has swept of its surface with the arm in these postures, one after
/// another. Between two of them the pad must move less than a third of its width.
#[must_use]
pub fn swept(plan: &Plan, arm: &Arm, postures: impl Iterator<Item = JointVector>) -> Swept {
    let tool = plan.tool.on(arm);
    let poses: Vec<Isometry3<f64>> = postures.map(|q| tool.pose(&q)).collect();
    let hit = coverage::swept(&plan.scan(), &poses, &plan.tool);
    let share = |of: &dyn Fn(usize) -> bool| {
        let total = (0..hit.len()).filter(|&i| of(i)).count();
        let swept = (0..hit.len()).filter(|&i| of(i) && hit[i]).count();
        if total == 0 { 0.0 } else { swept as f64 / total as f64 }
    };
    Swept {
        all: share(&|_| true),
        reachable: share(&|i| plan.surface[i].reachable),
        points: hit.len(),
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Vector3};
    use nullsweep_planner::plan::{CostKind, FORMAT, Method, Profile, SurfaceSample};
    use nullsweep_robot::{ArmSpec, Robot, Side, Tool};

    use super::*;

    /// A plan whose surface is these points of the contact frame at home.
    fn plan(arm: &Arm, points: &[([f64; 3], bool)]) -> Plan {
        let tool = Tool::default();
        let contact = tool.on(arm).pose(&arm.home());
        let surface = points
            .iter()
            .map(|(p, reachable)| SurfaceSample {
                point: (contact * Point3::from(*p)).into(),
                normal: (contact * -Vector3::z()).into(),
                reachable: *reachable,
            })
            .collect();
        Plan {
            format: FORMAT,
            robot: "pr2".into(),
            fingerprint: arm.fingerprint(),
            joints: arm.joint_names().to_vec(),
            held: Vec::new(),
            tool,
            base: [0.0; 3],
            base_height: 0.0,
            method: Method::Tsp,
            cost: CostKind::Time,
            profile: Profile::Velocity,
            jerk: None,
            seed: 1,
            knots: Vec::new(),
            patches: Vec::new(),
            surface,
            regions: Vec::new(),
            continues: None,
            past: Vec::new(),
            left: Vec::new(),
            seal: None,
        }
    }

    #[test]
    fn the_pad_sweeps_what_lies_under_it() {
        let arm = Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).expect("the PR2 has a right arm");
        let plan = plan(
            &arm,
            &[
                ([0.0, 0.0, 0.0], true),
                ([0.03, 0.045, 0.003], true),
                ([0.06, 0.0, 0.0], true),
                ([0.0, 0.0, 0.02], false),
            ],
        );
        let found = swept(&plan, &arm, std::iter::once(arm.home()));
        assert_eq!(found, Swept { all: 0.5, reachable: 2.0 / 3.0, points: 4 });
        assert_eq!(swept(&plan, &arm, std::iter::empty()).all, 0.0);
    }
}
