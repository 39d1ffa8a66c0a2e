//! How far plans are from the best ones.

use std::fmt::Write as _;

use nullsweep_planner::bounds::{Ascent, Least, Pieces, Stops, coverable, least, pieces};
use nullsweep_planner::cost::{self, Cost, Effort, TaskTime};
use nullsweep_planner::pipeline::{Job, Outcome, PipelineError, run};
use nullsweep_planner::plan::{CostKind, Method};
use nullsweep_planner::progress::Progress;
use nullsweep_planner::sweep::MissedPoints;
use nullsweep_planner::workcell::{Bed, Scene, Workcell};
use nullsweep_robot::{JointVector, Robot};
use serde::{Deserialize, Serialize};

/// What a plan costs beside what no plan through its stops costs less than.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Gap {
    /// The plan, from its start through all its stops, at bang-bang velocity and before it was made
    /// fair.
    pub plan: f64,
    /// Of that the motions along the surface.
    pub surface: f64,
    /// What straight motions between the plan's own stops would cost, whatever they meet.
    pub stops: f64,
    /// The bound.
    #[serde(flatten)]
    pub least: Least,
}

impl Gap {
    /// How much more the plan costs than the bound, as a share of the bound.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.plan / self.least.bound - 1.0
    }
}

/// A plan of an object and its bounds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bounded {
    /// The object.
    pub object: String,
    /// How the order was found.
    pub method: Method,
    /// What was minimised.
    pub optimised: CostKind,
    /// Seed.
    pub seed: u64,
    /// Scanned points.
    pub points: usize,
    /// Patches.
    pub patches: usize,
    /// Patches that the arm reaches.
    pub reachable: usize,
    /// Places that the plan stops at.
    pub stops: usize,
    /// Joint vectors among which it could choose there.
    pub samples: usize,
    /// Sum of all joint displacements \[rad\]; nothing where no bound was found.
    pub effort: Option<Gap>,
    /// Time at bang-bang velocity \[s\]; nothing where no bound was found.
    pub time: Option<Gap>,
    /// Pieces on the surface.
    pub pieces: Pieces,
    /// Share of all points that the plan sweeps.
    pub swept_all: f64,
    /// Share of all points that some sampled posture's pad covers, or the plan.
    pub coverable_all: f64,
    /// Share of the reachable patches' points that the plan sweeps.
    pub swept_reachable: f64,
    /// Share of the reachable patches' points that some sampled posture's pad covers, or the plan.
    pub coverable_reachable: f64,
    /// Reachable points that are not swept, by why.
    pub missed: Vec<MissedPoints>,
    /// Rules that the plan breaks.
    pub violations: usize,
    /// What the plan took. \[s\]
    pub planned_s: f64,
    /// What the bounds took. \[s\]
    pub bounds_s: f64,
}

/// Plans a job for a scene in the floor frame, and bounds it.
///
/// # Errors
/// Where there is no plan.
pub fn bounded(
    robot: &Robot,
    scene: &Scene,
    (object, job): (&str, &Job),
    ascent: &Ascent,
    progress: &dyn Progress,
) -> Result<Bounded, PipelineError> {
    let outcome = run(robot, scene, job, progress)?;
    let began = std::time::Instant::now();
    progress.stage("bounds", None);
    let stops = Stops::of(&outcome, job);
    let time = TaskTime::new(&cost::velocities(&outcome.arm, job.v_max));
    let effort = gap(&Effort, &outcome, &stops, ascent);
    let time = gap(&time, &outcome, &stops, ascent);
    let jumps = outcome.visits.iter().filter(|visit| visit.leg.is_jump()).count();
    let pieces = pieces(&stops, &outcome.graph, jumps);
    let here = scene.transformed(&outcome.plan.base_pose().inverse());
    let bed = Bed::new(&here, &job.tool);
    let cell = Workcell { arm: &outcome.arm, tool: &job.tool, world: &outcome.world };
    let f = &outcome.figures;
    let known = (&f.verification.swept[..], job.ik_samples);
    let covered = coverable(cell, &outcome.scan, &bed, known, progress);
    let reachable: Vec<bool> = outcome.plan.surface.iter().map(|s| s.reachable).collect();
    let share = |which: &dyn Fn(usize) -> bool| {
        let of: Vec<usize> = (0..covered.len()).filter(|&i| which(i)).collect();
        of.iter().filter(|&&i| covered[i]).count() as f64 / of.len().max(1) as f64
    };
    Ok(Bounded {
        object: object.to_owned(),
        method: outcome.plan.method,
        optimised: job.cost,
        seed: job.seed,
        points: f.points,
        patches: f.patches,
        reachable: f.reachable,
        stops: stops.samples.len(),
        samples: stops.samples.iter().map(Vec::len).sum(),
        effort,
        time,
        pieces,
        swept_all: f.verification.coverage_all,
        coverable_all: share(&|_| true),
        swept_reachable: f.verification.coverage_reachable,
        coverable_reachable: share(&|i| reachable[i]),
        missed: f.missed.clone(),
        violations: f.verification.violations.len(),
        planned_s: f.calc_time_total_s,
        bounds_s: began.elapsed().as_secs_f64(),
    })
}

/// A plan's cost beside its bound.
fn gap<C: Cost>(cost: &C, outcome: &Outcome, stops: &Stops, ascent: &Ascent) -> Option<Gap> {
    let (continuous, dof) = (outcome.arm.continuous(), outcome.arm.dof());
    let least = least(cost, continuous, dof, stops, ascent)?;
    let (mut plan, mut surface, mut straight) = (0.0, 0.0, 0.0);
    let mut before: &JointVector = &outcome.start;
    for visit in &outcome.visits {
        let leg = cost::of_path(cost, &visit.leg.joints);
        plan += leg;
        surface += if visit.leg.is_jump() { 0.0 } else { leg };
        straight += cost.of(&continuous.displacement(before, &visit.sample.q));
        before = &visit.sample.q;
    }
    Some(Gap { plan, surface, stops: straight, least })
}

/// The tables as Markdown.
#[must_use]
pub fn bounds_markdown(rows: &[Bounded]) -> String {
    let mut page = String::new();
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let name = |row: &Bounded| {
        let (method, cost) = (word(row.method), word(row.optimised));
        format!("{} | {method}, {cost}, {}", row.object, row.seed)
    };
    let mut costs = |title: &str, unit: &str, of: &dyn Fn(&Bounded) -> Option<Gap>| {
        let _ = writeln!(page, "### {title}\n");
        let _ = writeln!(
            page,
            "| object | method, cost, seed | stops | postures | plan [{unit}] | on the surface | \
             its stops, straight | best known, straight | no plan below | gap |"
        );
        let _ = writeln!(page, "|---|---|---|---|---|---|---|---|---|---|");
        for row in rows {
            let _ = write!(page, "| {} | {} | {} |", name(row), row.stops, row.samples);
            let _ = match of(row) {
                Some(gap) => writeln!(
                    page,
                    " {:.1} | {:.1} | {:.1} | {:.1} | {:.1} | {} |",
                    gap.plan,
                    gap.surface,
                    gap.stops,
                    gap.least.straight,
                    gap.least.bound,
                    percent(gap.share())
                ),
                None => writeln!(page, " – | – | – | – | – | – |"),
            };
        }
        let _ = writeln!(page);
    };
    costs("Effort", "rad", &|row| row.effort);
    costs("Time", "s", &|row| row.time);
    let _ = writeln!(page, "### Pieces and coverage\n");
    let _ = writeln!(
        page,
        "| object | method, cost, seed | patches, reachable | pieces | at least | covers with | \
         swept, all | coverable, all | swept, reachable | coverable, reachable |"
    );
    let _ = writeln!(page, "|---|---|---|---|---|---|---|---|---|---|");
    for row in rows {
        let Pieces { made, least, cover } = row.pieces;
        let _ = writeln!(
            page,
            "| {} | {}, {} | {made} | {least} | {cover} | {} | {} | {} | {} |",
            name(row),
            row.patches,
            row.reachable,
            percent(row.swept_all),
            percent(row.coverable_all),
            percent(row.swept_reachable),
            percent(row.coverable_reachable)
        );
    }
    let _ = writeln!(page, "\n### Reachable points that are not swept\n");
    let _ = writeln!(page, "| object | method, cost, seed | why | points | of reachable |");
    let _ = writeln!(page, "|---|---|---|---|---|");
    for row in rows {
        for missed in &row.missed {
            let (points, share) = (missed.points, percent(missed.share));
            let _ = writeln!(page, "| {} | {} | {points} | {share} |", name(row), missed.why);
        }
    }
    page
}

/// The word by which a choice is told in files.
fn word(choice: impl Serialize) -> String {
    let value = serde_json::to_value(choice).unwrap_or_default();
    value.as_str().unwrap_or_default().to_owned()
}
