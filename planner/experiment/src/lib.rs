//! The paper's experiments (§V): its three methods on its two objects, in its own model and in
//! ours; and how far plans are from the best ones.

mod bounds;
mod figures;
mod methods;
mod paper;
mod report;
mod setting;
mod tables;

pub use bounds::{Bounded, Gap, bounded, bounds_markdown};
pub use figures::{FigureError, write as draw};
pub use methods::{MethodRun, PathFigures, Task, V_MAX, by_cost, plan};
pub use paper::{Published, cannot_hold, cell, samples};
pub use report::{
    Cell, METHODS, Plan, Report, SettingFigures, Straight, Tracked, look_between, run, tracked,
};
pub use setting::{Setting, SettingError};
pub use tables::{csv, markdown};

use serde::{Deserialize, Serialize};

/// The paper's objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Object {
    /// Table I.
    Chair,
    /// Table II.
    BobbyCar,
}

/// The rows of the paper's tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Quantity {
    /// Euclidean distance. \[m\]
    Distance,
    /// Effort. \[rad\]
    Effort,
    /// Task time. \[s\]
    Time,
    /// Calculation time. \[s\]
    Calculation,
    /// Processor time of the calculation, which the paper does not tell. \[s\]
    Processor,
}

#[cfg(test)]
mod tests {
    use nullsweep_planner::pipeline::Job;
    use nullsweep_planner::plan::CostKind;
    use nullsweep_planner::progress::Silent;
    use nullsweep_planner::tour::formulation::FormulationConfig;
    use nullsweep_planner::tour::joint::JointConfig;
    use nullsweep_robot::{ArmSpec, Robot, Side, Tool};
    use nullsweep_surface::{CleanConfig, Placement, scan, simulate};

    use super::*;

    #[test]
    fn every_method_visits_every_reached_patch_once_and_the_joint_one_pays_least() {
        let view = simulate::bobby_car(3);
        let placed = scan::place(&view.scan, &Placement::SensorPose(view.sensor_pose)).0;
        let (scan, _) = scan::clean(&placed, &CleanConfig::default()).expect("a surface");
        let tool = Tool { symmetric: false, ..Tool::default() };
        let job = Job { tool, seed: 3, ..Job::new(ArmSpec::pr2(Side::Right)) };
        let setting = Setting::new(&Robot::pr2(), &scan, &job).expect("within reach");
        let reached: Vec<usize> =
            (0..setting.patches.len()).filter(|&i| setting.reached[i].is_some()).collect();
        assert!(reached.len() > 30, "{}", reached.len());
        let short = Plan {
            object: Some(Object::BobbyCar),
            title: "car".into(),
            samples: vec![1],
            repeats: 1,
            seed: 1,
            formulation: FormulationConfig { trials_per_cluster: 20, ..Default::default() },
            joint: JointConfig { rounds: 2, trials_per_cluster: 20, ..JointConfig::default() },
        };
        let (report, shown) = run(&setting, &short, &Silent).expect("costs are numbers");
        for (method, run) in &shown {
            let mut visited: Vec<usize> = run.path.iter().map(|(stop, _)| stop.patch).collect();
            visited.sort_unstable();
            assert_eq!(visited, reached, "{method:?}");
            assert!(run.path.iter().all(|(_, q)| setting.arm.within_margins(q)), "{method:?}");
            assert!(V_MAX * run.figures.task_time_s <= run.figures.effort_rad, "{method:?}");
        }
        let effort = |m| report.statistic(CostKind::Effort, 1, m, Quantity::Effort).map(|s| s.0);
        let [tsp, curvature, joint] = METHODS.map(effort);
        assert!(joint < curvature && curvature < tsp, "{tsp:?} {curvature:?} {joint:?}");
        let page = markdown(&report);
        assert!(page.contains("206.66 ± 3.52"), "{page}");
        assert_eq!(csv(&report).lines().count(), 1 + report.cells.len());
    }
}
