//! `planner replan` of what a plan did not do, by what was measured: a recording of its run, or a second
//! scan. Nothing is sent; the new plan is a file as any other.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use clap::Args;
use nullsweep_planner::pipeline::{After, Job};
use nullsweep_planner::plan::{Plan, PlanKnot, Profile};
use nullsweep_planner::progress::Progress;
use nullsweep_planner::workcell::Scene;
use nullsweep_recording::Recording;
use nullsweep_robot::{Arm, JointVector};
use nullsweep_surface::change::{Change, changes};
use nullsweep_surface::{Placement, ReadOptions, scan};

use crate::bars::Bars;
use crate::exit::Usage;
use crate::floor::Placed;
use crate::numbers::{percent, positive};
use crate::picture::Flight;
use crate::plan::{PlanArgs, finish};
use crate::site::SiteArgs;
use crate::views;

/// What says how much of a plan is done.
#[derive(Debug, Args)]
pub(super) struct DoneArgs {
    /// A flight recording of the plan's run: what the tool measurably came over counts as swept, the rest
    /// is planned anew, from where the arm was at its end. Nothing is sent.
    #[arg(long, value_name = "RECORDING", conflicts_with_all = ["lead", "from", "wait"])]
    measured: Option<PathBuf>,
    /// A scan of the surface after the plan ran, in the frame of the first scan: where its colour or
    /// height has changed the plan is done, the rest is planned anew. Nothing is sent.
    #[arg(long = "scan", value_name = "AFTER", conflicts_with_all = ["measured", "lead", "from", "wait"])]
    second: Option<PathBuf>,
    /// With --scan: the least change of colour that counts as done, by the distance of red, green and blue
    /// of 0 to 255 each; without it, and without --done-height, 40.
    #[arg(long, value_name = "D", value_parser = positive, requires = "second")]
    done_colour: Option<f64>,
    /// With --scan: the least change of height, up or down, that counts as done. [m]
    #[arg(long, value_name = "M", value_parser = positive, requires = "second")]
    done_height: Option<f64>,
}

/// Joints move at most this far between two measured positions that are kept. \[rad\] or \[m\]
const STEP: f64 = 0.01;
/// Change of colour that counts as done where nothing is said.
const COLOUR: f64 = 40.0;

impl DoneArgs {
    pub(super) fn is_asked(&self) -> bool {
        self.measured.is_some() || self.second.is_some()
    }

    /// Makes the plan for what is left of another, and gives the exit code.
    pub(super) fn run(&self, ran: &Plan, site: &SiteArgs, args: &PlanArgs) -> anyhow::Result<u8> {
        args.writable()?;
        let bars = Bars::new();
        let robot = args.robot.robot()?;
        args.robot.tell(&robot, &bars)?;
        let held: Vec<_> = ran.held.iter().map(|h| (h.name.as_str(), h.position)).collect();
        let arm = robot.arm(&args.robot.spec())?.with_held(&held)?;
        let (scene, placed) = args.seen(&bars)?;
        let (after, spared) = match &self.measured {
            Some(file) => (measured(file, ran, &arm, &bars)?, Vec::new()),
            None => {
                // The scan says what the plan did, not what it came over.
                let held = ran.knots.last().map(|knot| knot.q);
                bars.note("the new plan starts where the plan before it has left the arm");
                let after = After { plan: ran.clone(), knot: 0, held, again: true };
                let as_placed = args.scene.placed().as_placed;
                (after, self.changed((&scene, &placed), as_placed, &bars)?)
            }
        };
        let job = args.job(&robot, site.site(), Some(after), &bars)?;
        let made = args.planned(robot, scene, Job { spared, ..job }, &bars)?;
        finish(args, &made)
    }

    /// Which points of the surface a second scan shows to be done.
    fn changed(
        &self,
        (scene, before): (&Scene, &Placed),
        as_placed: bool,
        bars: &Bars,
    ) -> anyhow::Result<Vec<bool>> {
        let Some(path) = &self.second else { bail!("a scan is wanted") };
        let Some(first) = before.sources.first() else {
            return Err(
                Usage("--scan is compared with scans: give those of the plan".into()).into()
            );
        };
        let options = ReadOptions { scale: first.scale, ..ReadOptions::default() };
        let raw = scan::read(path, &options)?;
        let sensor = raw.sensor.and(before.scan.views.first().and_then(|view| view.sensor));
        let mut after = scan::place(&raw, &Placement::Frame { pose: first.pose, sensor }).0;
        if !as_placed {
            views::lay(&before.scan, &mut after, path, bars)?;
        }
        let found = changes(&scene.surface, &before.scan, &after);
        let is_done = self.rule(&found, path, bars)?;
        let done: Vec<bool> = found.iter().map(is_done).collect();
        let share = |of: &dyn Fn(usize) -> bool| {
            let hit = (0..found.len()).filter(|&i| of(i)).count();
            percent(hit as f64 / found.len().max(1) as f64)
        };
        bars.note(&format!(
            "{}: {} of the points are done, {} are not shown by it and count as not done",
            path.display(),
            share(&|i| done[i]),
            share(&|i| found[i] == Change::default())
        ));
        Ok(done)
    }

    /// What counts as done, which is told.
    fn rule(
        &self,
        found: &[Change],
        path: &Path,
        bars: &Bars,
    ) -> anyhow::Result<impl Fn(&Change) -> bool + use<>> {
        let has_colour = found.iter().any(|change| change.colour.is_some());
        let colour = match (self.done_colour, self.done_height) {
            (None, None) => Some(COLOUR),
            (colour, _) => colour,
        };
        ensure!(
            colour.is_none() || has_colour,
            Usage(format!(
                "{} and the scans of the plan do not both have colours: --done-height M says by which \
                 change of height a point is done",
                path.display()
            ))
        );
        let height = self.done_height;
        let told = [
            colour.map(|d| format!("its colour has changed by {d} of 441 or more")),
            height.map(|m| format!("its height has changed by {:.1} mm or more", 1e3 * m)),
        ];
        let told: Vec<String> = told.into_iter().flatten().collect();
        bars.note(&format!("a point is done where {}", told.join(", or ")));
        Ok(move |change: &Change| {
            let by = |found: Option<f64>, least: Option<f64>| {
                found.zip(least).is_some_and(|(found, least)| found.abs() >= least)
            };
            by(change.colour, colour) || by(change.height, height)
        })
    }
}

/// What is left when a recording of a plan's run ended.
fn measured(file: &Path, ran: &Plan, arm: &Arm, bars: &Bars) -> anyhow::Result<After> {
    let recording = Recording::read(file)?;
    let flight = Flight::of(&recording, arm, &ran.tool, std::slice::from_ref(ran))
        .with_context(|| file.display().to_string())?;
    let pad = ran.tool.on(arm);
    let mut knots: Vec<PlanKnot> = Vec::new();
    let last = flight.swept.len().saturating_sub(1);
    for (k, q) in flight.swept.iter().enumerate() {
        let far = |before: &PlanKnot| (0..arm.dof()).any(|j| (q[j] - before.q[j]).abs() > STEP);
        if k == last || knots.last().is_none_or(far) {
            let line = Some(pad.centre(q).into());
            knots.push(PlanKnot {
                time_ns: k as u64,
                q: *q,
                v: JointVector::ZERO,
                line,
                patch: None,
            });
        }
    }
    let Some(held) = knots.last().map(|knot| knot.q) else {
        bail!("{}: nothing was measured while the plan ran", file.display());
    };
    bars.note(&format!(
        "{}: {} measured positions say what was swept; the new plan starts where the arm was last",
        file.display(),
        flight.swept.len()
    ));
    // The tool is where it was measured, wherever that was: what it came near to is swept.
    let plan = Plan { knots, profile: Profile::Velocity, ..ran.clone() };
    let knot = plan.knots.len() - 1;
    Ok(After { plan, knot, held: Some(held), again: false })
}
