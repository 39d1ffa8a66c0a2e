//! The finished plan, checked again by code that shares nothing with the search: a plan that
//! fails is never published.

use nalgebra::{Isometry3, Point3};
use nullsweep_collision::World;
use nullsweep_robot::Arm;
use nullsweep_surface::scan::Scan;
use nullsweep_surface::sheet::Surface;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::collisions::collisions;
use super::kinematics::kinematics;
use super::violation::{Violation, ViolationKind};
use crate::plan::Plan;
use crate::sweep::{coverage, pad_motion};

/// The figures of a verified plan.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Verification {
    /// Everything found wrong, in the order of the knots.
    pub violations: Vec<Violation>,
    /// Joint vectors at which collisions were looked for.
    pub collision_checks: usize,
    /// Farthest that the pad centre leaves the planned line between knots. \[m\]
    pub line_deviation_max_m: f64,
    /// 95th percentile of the pad centre's distance from the scanned surface, less the
    /// stand-off, over the motion on the surface. \[m\]
    pub scan_distance_p95_m: f64,
    /// The largest of those. \[m\]
    pub scan_distance_max_m: f64,
    /// Share of all scanned points that are swept.
    pub coverage_all: f64,
    /// Share of the points of reachable patches that are swept.
    pub coverage_reachable: f64,
    /// For each scanned point whether it is swept.
    #[serde(skip)]
    pub swept: Vec<bool>,
}

/// Checks limits, times and collisions, and measures line, distance and swept coverage. `arm`
/// and `scan` in the plan's stance: the root frame; `already` marks points that were swept before
/// the plan begins. `tick` is called once a segment.
#[must_use]
pub fn verify(
    plan: &Plan,
    arm: &Arm,
    world: &World,
    scan: &Scan,
    surface: &Surface,
    already: &[bool],
    tick: &(dyn Fn() + Sync),
) -> Verification {
    let mut violations = kinematics(plan, arm);
    let finite = !violations.iter().any(|v| v.kind == ViolationKind::NotFinite);
    if !finite {
        return Verification { violations, ..Verification::default() };
    }
    let (collisions, collision_checks) = collisions(plan, arm, world, tick);
    violations.extend(collisions);
    violations.sort_by_key(|v| v.knot);

    let pads = pad_motion(plan, arm);
    let line_deviation_max_m = pads.iter().map(|p| p.deviation).fold(0.0, f64::max);
    let mut distances: Vec<f64> = pads
        .par_iter()
        .map(|p| {
            let centre = Point3::from(p.pose.translation.vector);
            (surface.distance(&centre) - plan.tool.stand_off).abs()
        })
        .collect();
    distances.sort_by(f64::total_cmp);
    let poses: Vec<Isometry3<f64>> = pads.iter().map(|p| p.pose).collect();
    let mut swept = coverage::swept(scan, &poses, &plan.tool);
    for (now, before) in swept.iter_mut().zip(already) {
        *now |= before;
    }
    let share = |of: &dyn Fn(usize) -> bool| {
        let total = (0..swept.len()).filter(|&i| of(i)).count();
        let hit = (0..swept.len()).filter(|&i| of(i) && swept[i]).count();
        if total == 0 { 0.0 } else { hit as f64 / total as f64 }
    };
    Verification {
        violations,
        collision_checks,
        line_deviation_max_m,
        scan_distance_p95_m: percentile(&distances, 0.95),
        scan_distance_max_m: distances.last().copied().unwrap_or(0.0),
        coverage_all: share(&|_| true),
        coverage_reachable: share(&|i| plan.surface[i].reachable),
        swept,
    }
}

fn percentile(sorted: &[f64], share: f64) -> f64 {
    let last = sorted.len().saturating_sub(1);
    sorted.get((share * last as f64).round() as usize).copied().unwrap_or(0.0)
}
