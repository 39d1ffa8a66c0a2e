//! What the demo found, and what of it must be so.

use std::fs;
use std::path::PathBuf;

use nullsweep_planner::plan::Profile;
use serde::{Deserialize, Serialize};

use super::args::Hardware;
use super::hardware::Counters;
use crate::latency::Percentiles;
use crate::measured::Swept;
use crate::tracking::Tracking;

/// How much less than planned the measured coverage may be: the arm follows with an error of a
/// few millimetres.
const COVERAGE_SLACK: f64 = 0.02;
/// How far the arm may be from its setpoint, in 95 of 100 moments. \[rad\]
const TRACKING_P95: f64 = 0.02;
/// How much a joint's velocity may change in the cycle of the swap where accelerations are
/// limited: more than any joint's limit makes of a millisecond. \[rad/s\]
const SWAP_VELOCITY_STEP: f64 = 0.02;

/// The figures of one plan that the table shows; the planner writes more.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub struct PlanFigures {
    /// Scanned points.
    pub points: usize,
    /// Patches.
    pub patches: usize,
    /// Patches that the arm reaches.
    pub reachable: usize,
    /// Sum of all joint displacements. \[rad\]
    pub effort_rad: f64,
    /// \[s\]
    pub task_time_s: f64,
    /// Seconds that planning took.
    pub calc_time_total_s: f64,
    /// Knots.
    pub knots: usize,
    /// Motions through free space.
    pub jumps: usize,
    /// Share of all scanned points, with what was swept before.
    pub coverage_all: f64,
    /// Share of the points of reachable patches, with what was swept before.
    pub coverage_reachable: f64,
    /// \[m\]
    pub line_deviation_max_m: f64,
}

/// A plan as it was asked for and came out.
#[derive(Clone, Debug, Serialize)]
pub struct Planned {
    /// How the order was found.
    pub method: &'static str,
    /// What was minimised.
    pub cost: &'static str,
    /// Its figures.
    pub figures: PlanFigures,
}

/// Where and how the second plan took over.
#[derive(Clone, Debug, Serialize)]
pub struct Swap {
    /// The first plan's knot.
    pub knot: usize,
    /// Its time in the first plan. \[s\]
    pub at_s: f64,
    /// The first plan's knot when the second one was accepted.
    pub accepted_at_knot: u32,
    /// The largest step of a joint in the cycle of the swap, as a share of v·T, where it is judged.
    pub step_ratio: Option<f64>,
    /// The largest change of a joint's velocity there. \[rad/s\]
    pub velocity_step: Option<f64>,
}

/// What is asked of a run, and whether it came true.
#[derive(Clone, Debug, Serialize)]
pub struct Check {
    /// What.
    pub what: &'static str,
    /// Whether.
    pub ok: bool,
    /// The figures behind it.
    pub found: String,
}

/// Everything that the demo tells.
#[derive(Clone, Debug, Serialize)]
pub struct Outcome {
    /// What stood in for the robot.
    pub hardware: Hardware,
    /// How fast the plans went along their paths.
    pub profile: Profile,
    /// Both plans.
    pub plans: [Planned; 2],
    /// The swap.
    pub swap: Swap,
    /// Setpoints that the mock judged, and violations among them.
    pub judged: Option<[u64; 2]>,
    /// What the endpoint itself did.
    pub endpoint: Counters,
    /// How the arm followed.
    pub tracking: Tracking,
    /// What the measured positions have swept.
    pub measured: Swept,
    /// Wake-up lateness of the executor.
    pub lateness: Percentiles,
    /// Deadlines that it missed.
    pub missed_cycles: u64,
    /// The report's path.
    pub report: PathBuf,
    /// The picture's path.
    pub picture: Option<PathBuf>,
    /// How long all of it took. \[s\]
    pub seconds: f64,
    /// What must be so.
    pub checks: Vec<Check>,
}

/// What must be so.
pub(super) fn checks(outcome: &Outcome, swapped: bool) -> Vec<Check> {
    let Outcome { swap, endpoint, tracking, measured, .. } = outcome;
    let planned = outcome.plans[1].figures.coverage_reachable;
    let mut checks = vec![Check {
        what: "the second plan took over mid-motion and ran to its end",
        ok: swapped && (swap.accepted_at_knot as usize) < swap.knot,
        found: format!("accepted in knot {}, joined in knot {}", swap.accepted_at_knot, swap.knot),
    }];
    if let Some([setpoints, violations]) = outcome.judged {
        checks.push(Check {
            what: "the endpoint saw no violation",
            ok: violations == 0 && setpoints > 0 && swap.step_ratio.is_some(),
            found: format!("{violations} of {setpoints}"),
        });
    }
    if let (Some(step), Profile::Acceleration) = (swap.velocity_step, outcome.profile) {
        checks.push(Check {
            what: "no jump of the velocity at the swap",
            ok: step <= SWAP_VELOCITY_STEP,
            found: format!("{step:.4} rad/s"),
        });
    }
    checks.push(Check {
        what: "the endpoint refused no setpoint",
        ok: endpoint.refused == 0,
        found: format!("{} refused", endpoint.refused),
    });
    // Bang-bang velocity makes any arm with a mass lag; the figure is told, no more.
    if outcome.profile == Profile::Acceleration {
        checks.push(Check {
            what: "the arm follows",
            ok: tracking.p95 <= TRACKING_P95,
            found: format!("p95 {:.4} rad", tracking.p95),
        });
    }
    checks.push(Check {
        what: "what was measured covers what was planned",
        ok: measured.reachable >= planned - COVERAGE_SLACK,
        found: format!("{:.1} % for {:.1} %", 100.0 * measured.reachable, 100.0 * planned),
    });
    for (what, path) in [
        ("the report is there", Some(&outcome.report)),
        ("the picture is there", outcome.picture.as_ref()),
    ] {
        checks.extend(path.map(|path| Check {
            what,
            ok: fs::metadata(path).is_ok_and(|m| m.len() > 0),
            found: path.display().to_string(),
        }));
    }
    checks
}
