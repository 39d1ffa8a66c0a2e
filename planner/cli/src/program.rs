//! What a program holds, for people and for machines.

use nullsweep_planner::plan::{Program, ProgramStop, Totals, Work};
use nullsweep_planner::workcell::stance::told;
use serde::Serialize;

use crate::numbers::percent;
use crate::sheet::sheet;

/// A program without its plans' insides.
#[derive(Debug, Serialize)]
pub(super) struct Summary<'a> {
    robot: &'a str,
    verified: bool,
    #[serde(flatten)]
    totals: &'a Totals,
    stops: Vec<StopSummary<'a>>,
}

#[derive(Debug, Serialize)]
struct StopSummary<'a> {
    base: [f64; 3],
    base_height: f64,
    held: &'a [(String, f64)],
    drive_m: f64,
    works: Vec<WorkSummary<'a>>,
    together: &'a [[usize; 2]],
    duration_s: f64,
}

#[derive(Debug, Serialize)]
struct WorkSummary<'a> {
    arm: &'a str,
    adds: f64,
    kept_off_place: f64,
    knots: usize,
    duration_s: f64,
}

pub(super) fn figures(program: &Program) -> Summary<'_> {
    Summary {
        robot: &program.robot,
        verified: program.check_seal().is_ok(),
        totals: &program.totals,
        stops: program.stops.iter().map(stop_of).collect(),
    }
}

fn summary_of(work: &Work) -> WorkSummary<'_> {
    WorkSummary {
        arm: &work.arm,
        adds: work.adds,
        kept_off_place: work.kept_off_place,
        knots: work.plan.knots.len(),
        duration_s: work.plan.duration(),
    }
}

fn stop_of(stop: &ProgramStop) -> StopSummary<'_> {
    StopSummary {
        base: stop.base,
        base_height: stop.base_height,
        held: &stop.held,
        drive_m: stop.drive_m,
        works: stop.works.iter().map(summary_of).collect(),
        together: &stop.together,
        duration_s: stop.seconds(),
    }
}

/// What [`stop_rows`] tell.
pub(super) const COLUMNS: [&str; 8] =
    ["stop", "base", "held", "drive", "arm", "adds", "off place", "takes"];

/// The plans of all stops, for people.
pub(super) fn stop_rows(program: &Program) -> Vec<Vec<String>> {
    let mut rows = Vec::new();
    for (s, stop) in program.stops.iter().enumerate() {
        for (w, work) in stop.works.iter().enumerate() {
            let once = |text: String| if w == 0 { text } else { String::new() };
            let held: Vec<String> = stop.held.iter().map(|(n, v)| format!("{n} {v}")).collect();
            rows.push(vec![
                once((s + 1).to_string()),
                once(told(&stop.base)),
                once(held.join(", ")),
                once(format!("{:.1} m", stop.drive_m)),
                tip(work).to_owned(),
                percent(work.adds),
                percent(work.kept_off_place),
                takes(stop, w),
            ]);
        }
    }
    rows
}

/// The stops, and what they come to.
pub(super) fn table(program: &Program) -> String {
    let (mut stops, mut totals) = (sheet(COLUMNS), sheet(["figure", "value"]));
    stops.add_rows(stop_rows(program));
    totals.add_rows(totals_rows(&program.totals));
    format!("{stops}\n{totals}")
}

/// What the stops come to together, for people.
pub(super) fn totals_rows(t: &Totals) -> Vec<Vec<String>> {
    let mut rows = Vec::new();
    let mut row = |name: &str, value: String| rows.push(vec![name.to_owned(), value]);
    row("swept of all points", format!("{} of {}", percent(t.coverage_all), t.points));
    row("in reach of any stop that was looked at", percent(t.coverage_of_any_stops));
    row("places on the floor, looked at", format!("{}, {}", t.places, t.looked));
    row("choice of stops at most from the best", percent(t.choice_gap));
    row("task time", format!("{:.1} s", t.task_time_s));
    row("drive", format!("{:.1} m", t.drive_m));
    let (off, turned) = (1e3 * t.off_m, t.off_rad.to_degrees());
    row("off place: still in reach, base off by", format!("{off:.0} mm and {turned:.0}°"));
    if !t.unswept.is_empty() {
        row("not swept, by what is in the way", String::new());
    }
    for left in &t.unswept {
        let share = percent(left.share);
        row(&format!("  {}", left.why), format!("{} patches, {share}", left.patches));
    }
    rows
}

/// How long a plan takes, and which it may be done at once with.
pub(super) fn takes(stop: &ProgramStop, work: usize) -> String {
    let seconds = stop.works[work].plan.duration();
    let beside = stop.beside(work).map(|other| format!(", with {}", tip(&stop.works[other])));
    format!("{seconds:.1} s{}", beside.unwrap_or_default())
}

/// The arm's last link, by which people know it.
pub(super) fn tip(work: &Work) -> &str {
    work.arm.rsplit(',').next().unwrap_or(&work.arm)
}

/// A stop as people are told where it is.
pub(super) fn place(stop: &ProgramStop) -> String {
    let held = stop.held.iter().map(|(name, at)| format!(", {name} at {at}"));
    format!("{}{}", told(&stop.base), held.collect::<String>())
}
