//! The figures that matter most, and what they rest on.

use nullsweep_planner::plan::Plan;
use nullsweep_planner::sweep::coverage;
use nullsweep_planner::verify::Verification;
use nullsweep_planner::workcell::Scene;
use nullsweep_report::{Headline, Look, Motion, Tone};
use nullsweep_robot::Arm;

use super::flight::Flight;
use super::motion::REACH;
use super::points::{Points, shares, surface};
use super::robot::Shown;
use super::sitter::Sitter;

/// Share of the reachable points that is well swept.
const WELL: f64 = 0.95;

/// The headline, and a sentence for all that was guessed or taken for granted.
pub(super) fn headline(
    sitter: &Sitter<'_>,
    here: Option<&Scene>,
    points: &Points,
    motions: &[Motion],
    robot: &Shown,
) -> (Vec<Headline>, Vec<String>) {
    let plan = &sitter.plans[sitter.plans.len() - 1];
    let mut headline = Vec::new();
    let mut tell = |label: &str, value: String, detail: String, tone: Tone| {
        headline.push(Headline { label: label.into(), value, detail, tone });
    };
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let [of_reachable, of_all] = if plan.is_of_poses() { [None; 2] } else { points.shares };
    if plan.is_of_poses() {
        let (met, all) = (points.all - points.left, points.all);
        let tone = if met == all { Tone::Good } else { Tone::Warn };
        let detail = match points.left {
            0 => "of the given poses".into(),
            left => format!("of the given poses; {left} left, by cause in the list"),
        };
        tell("Poses met", format!("{met} of {all}"), detail, tone);
    }
    if let Some(share) = of_reachable {
        let tone = if share >= WELL { Tone::Good } else { Tone::Warn };
        tell(
            "Swept of reachable",
            percent(share),
            "of what the arm reaches from here".into(),
            tone,
        );
    }
    if let Some(share) = of_all {
        let left = points.left as f64 / points.all as f64;
        let places: usize = points.places.iter().map(|group| group.items.len()).sum();
        let detail = format!("of {} scanned points", points.all);
        tell("Swept of all", percent(share), detail, Tone::Plain);
        let tone = if points.left == 0 { Tone::Good } else { Tone::Plain };
        tell(
            "Left",
            percent(left),
            format!("in {}, by cause in the list", count(places, "place")),
            tone,
        );
    }
    let end = motions.last().map_or(0.0, |m| m.starts_at + m.times.last().copied().unwrap_or(0.0));
    let detail = match motions.len() {
        1 => count(plan.knots.len(), "knot"),
        n => format!("{n} plans, the last takes over at {:.1} s", motions[n - 1].starts_at),
    };
    tell("Time", format!("{end:.1} s"), detail, Tone::Plain);
    for flight in sitter.flights {
        let begins = motions.get(flight.first).map_or(0.0, |m| m.starts_at);
        if let Some((value, detail)) = deviation(flight, sitter.arm, begins) {
            tell("Largest deviation", value, detail, Tone::Plain);
        }
        let swept = measured_shares(plan, sitter.arm, flight);
        if let ([Some(of_reachable), Some(of_all)], false) = (swept, plan.is_of_poses()) {
            let detail = format!("of reachable, as measured; {} of all", percent(of_all));
            tell("Swept in fact", percent(of_reachable), detail, Tone::Plain);
        }
    }
    let (value, detail, tone) = violations(plan, sitter.verification);
    tell("Violations", value, detail, tone);
    let least = motions
        .iter()
        .flat_map(|m| m.series.iter().filter(|s| s.name == "clearance, arm"))
        .flat_map(|s| s.values.iter().copied())
        .fold(f64::INFINITY, f64::min);
    if least.is_finite() {
        let detail = "of the arm without its hand, at the looked-at times".into();
        let over = if least < 1e3 * REACH { "" } else { "over " };
        tell("Least clearance", format!("{over}{least:.0} mm"), detail, Tone::Plain);
    }
    (headline, notes(plan, here, robot, sitter.verification))
}

/// How far a measured joint was from its setpoint, and where; `begins`: the flight's start on the page's
/// clock. \[s\]
pub(super) fn deviation(flight: &Flight, arm: &Arm, begins: f64) -> Option<(String, String)> {
    let (j, by, at) = flight.joint?;
    let unit = if arm.is_revolute(j) { "rad" } else { "m" };
    let name = &arm.joint_names()[j];
    let mut detail = format!("of {name} from its setpoint, at {:.1} s", begins + at);
    if let Some((by, at)) = flight.pad {
        detail += &format!("; of the pad {:.1} mm, at {:.1} s", 1e3 * by, begins + at);
    }
    Some((format!("{by:.4} {unit}"), detail))
}

/// Shares of the points that the measured arm swept: of those that are reachable, of all.
fn measured_shares(plan: &Plan, arm: &Arm, flight: &Flight) -> [Option<f64>; 2] {
    let pad = plan.tool.on(arm);
    let poses: Vec<_> = flight.swept.iter().map(|q| pad.pose(q)).collect();
    shares(plan, &coverage::swept(&surface(plan), &poses, &plan.tool))
}

/// How many there are of what, in one word or two.
fn count(number: usize, what: &str) -> String {
    format!("{number} {what}{}", if number == 1 { "" } else { "s" })
}

fn violations(plan: &Plan, verification: Option<&Verification>) -> (String, String, Tone) {
    let Some(found) = verification else {
        return match plan.check_seal() {
            Ok(()) => {
                ("0".into(), "when it was verified; the scene is not given here".into(), Tone::Good)
            }
            Err(_) => ("–".into(), "not verified".into(), Tone::Warn),
        };
    };
    let against = &found.against;
    let measured = against.surface_points + against.other_points + against.raw_points;
    let unseen = if against.unseen_points > 0 { ", unseen space" } else { "" };
    let (obstacles, but_for) = (count(against.obstacles, "obstacle"), against.but_for());
    let detail = format!("against {measured} points{unseen}, {obstacles}{but_for}");
    let tone = if found.violations.is_empty() { Tone::Good } else { Tone::Bad };
    (found.violations.len().to_string(), detail, tone)
}

fn notes(
    plan: &Plan,
    here: Option<&Scene>,
    robot: &Shown,
    verification: Option<&Verification>,
) -> Vec<String> {
    let mut notes = Vec::new();
    let mut guessed: Vec<&str> = robot
        .shapes
        .iter()
        .filter(|shape| shape.look == Look::Guessed)
        .map(|shape| shape.name.as_str())
        .collect();
    guessed.dedup();
    if !guessed.is_empty() {
        notes.push(format!(
            "Guessed shapes: capsules stand for {}. That nothing touches says nothing of the real \
             links.",
            guessed.join(", ")
        ));
    }
    if let Some(scene) = here
        && scene.unseen.is_empty()
        && !scene.surface.points.is_empty()
    {
        notes.push(
            "Unseen space counts as free: what hides behind the scanned points was not kept clear of."
                .into(),
        );
    }
    match (verification, plan.check_seal()) {
        (None, Err(why)) => notes.push(format!("Unverified: {why}.")),
        (None, Ok(())) if here.is_none() => notes
            .push("The scene is not given: obstacles, clearance and press are not shown.".into()),
        (Some(found), _) => notes.extend(
            found
                .violations
                .iter()
                .take(5)
                .map(|v| format!("Violation at knot {}: {:?}: {}", v.knot, v.kind, v.detail)),
        ),
        _ => {}
    }
    notes
}
