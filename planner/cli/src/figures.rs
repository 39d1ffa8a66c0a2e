//! A plan's figures as people read them.

use comfy_table::Table;
use nullsweep_planner::pipeline::Figures;
use nullsweep_planner::regions::{Kind, RegionFigures};
use nullsweep_planner::sweep::{self, JointPace, MissedPoints, Pace};
use nullsweep_planner::verify::{Against, Verification};
use nullsweep_planner::workcell::stance::told;
use nullsweep_report as report;

use crate::numbers::percent;
use crate::sheet::{folded, sheet};

/// How the pad lies on the surface, and what the arm was held against, for people.
pub(super) fn verified_rows(v: &Verification) -> Vec<[String; 2]> {
    let mm = |metres: f64| metres * 1e3;
    let (p, a) = (&v.press, &v.against);
    let pressed = (mm(p.press_p50_m), mm(p.press_p95_m), mm(p.press_max_m));
    let facing = (p.facing_p95_rad.to_degrees(), p.facing_max_rad.to_degrees());
    let found = violations(v.violations.len(), &a.guessed_links);
    let against = held_against(a);
    let distance = (mm(v.scan_distance_p95_m), mm(v.scan_distance_max_m));
    let rows = [
        ("coverage of reachable points", percent(v.coverage_reachable)),
        ("coverage of all points", percent(v.coverage_all)),
        ("line deviation, max", format!("{:.3} mm", mm(v.line_deviation_max_m))),
        ("distance to the scan, p95, max", format!("{:.2}, {:.2} mm", distance.0, distance.1)),
        (
            "pressed in, p50, p95, max",
            format!("{:.1}, {:.1}, {:.1} mm", pressed.0, pressed.1, pressed.2),
        ),
        ("facing, p95, max", format!("{:.0}, {:.0}°", facing.0, facing.1)),
        ("touching, p50", format!("{:.0} %", 100.0 * p.touching_p50)),
        ("violations", found),
        ("  against", against),
    ];
    let regions = v.regions.iter().map(region_row);
    // Without a surface nothing is known of what is swept, pressed and faced.
    let of_surface =
        |name: &str| !["line deviation, max", "violations", "  against"].contains(&name);
    let known = rows.into_iter().filter(|(name, _)| a.surface_points > 0 || !of_surface(name));
    known.map(|(name, value)| [name.to_owned(), value]).chain(regions).collect()
}

/// What came of a region, for people.
fn region_row(r: &RegionFigures) -> [String; 2] {
    let points = r.points;
    let value = match r.kind {
        Kind::Avoid => "avoided".into(),
        Kind::KeepOut => format!("kept out of: {} of {points} points touched", percent(r.coverage)),
        Kind::Sweep(sweep) => {
            let times = match sweep.passes {
                1 => String::new(),
                passes => format!(" passed over {passes} times or more"),
            };
            let (all, reachable) = (percent(r.coverage), percent(r.coverage_reachable));
            format!("{all} of {points} points, {reachable} of the reachable{times}")
        }
    };
    [format!("region {}", r.name), value]
}

/// The same for a page.
pub(super) fn verified_table(v: &Verification) -> report::Table {
    report::Table {
        title: "Verified now".into(),
        columns: vec!["figure".into(), "value".into()],
        rows: verified_rows(v).into_iter().map(Vec::from).collect(),
    }
}

/// What the arm was held against, for people.
pub(super) fn held_against(a: &Against) -> String {
    let unseen = match a.unseen_points {
        0 => "unseen space free".to_owned(),
        n => format!("{n} of unseen space"),
    };
    let obstacles = if a.obstacles == 1 { "obstacle" } else { "obstacles" };
    let keep_out = match a.keep_out_points {
        0 => String::new(),
        n => format!(", {n} points to keep out of"),
    };
    format!(
        "{} points of the surface, {} others, {} raw, {unseen}, {} {obstacles}{keep_out}{}",
        a.surface_points,
        a.other_points,
        a.raw_points,
        a.obstacles,
        a.but_for()
    )
}

/// How many violations were found, and for how many links that is a guess.
pub(super) fn violations(count: usize, guessed: &[String]) -> String {
    match guessed {
        [] => count.to_string(),
        [first, rest @ ..] => {
            let more =
                if rest.is_empty() { String::new() } else { format!(" and {} more", rest.len()) };
            format!("{count}, by a guess: capsules stand for the meshes of {first}{more}")
        }
    }
}

/// The figures as name and value, for people.
fn rows(f: &Figures) -> Vec<[String; 2]> {
    let v = &f.verification;
    let mut rows = Vec::new();
    let mut row = |name: &str, value: String| rows.push([name.to_owned(), value]);
    row("points", f.points.to_string());
    row("patches, reachable", format!("{}, {}", f.patches, f.reachable));
    if f.places > 0 {
        row("places on strips", f.places.to_string());
    }
    row("fill-in patches, strokes", format!("{}, {}", f.fill_in_patches, f.strokes));
    row("edges, components", format!("{} of {}, {}", f.edges, f.edge_candidates, f.components));
    row("base x, y, yaw", told(&f.base));
    if f.base_height_m != 0.0 {
        row("base above the floor", format!("{:.3} m", f.base_height_m));
    }
    for (name, position) in &f.held {
        row(name, format!("{position:.3}"));
    }
    row("effort", format!("{:.2} rad", f.effort_rad));
    row("task time", format!("{:.2} s", f.task_time_s));
    row("distance on the surface", format!("{:.2} m", f.distance_m));
    row("distance in transfers", format!("{:.2} m", f.transfer_m));
    rows.extend(pace_rows(&f.pace));
    if let Some(held) = &f.tool_speed {
        rows.extend(held_rows(held));
    }
    let mut row = |name: &str, value: String| rows.push([name.to_owned(), value]);
    let passes = format!("{:.0}, {:.0}", f.passes.passes_p50, f.passes.passes_p95);
    row("passes over a point, p50, p95", passes);
    let histogram = f.passes.passes_histogram.map(|points| points.to_string());
    row("points by passes, 0, 1 … 8 or more", histogram.join(", "));
    for round in &f.rounds {
        let regions = match &round.regions[..] {
            [] => "all".into(),
            some => some.join(", "),
        };
        row(
            &format!("round: {regions}, pass {}", round.pass),
            format!("{:.2} s", round.task_time_s),
        );
        if let Some(held) = &round.tool_speed {
            let share = percent(held.share);
            row("  tool speed held", format!("{} m/s over {share} of the length", held.speed));
        }
    }
    row("jumps", f.jumps.to_string());
    row("dropped patches", f.dropped_patches.to_string());
    row("knots", f.knots.to_string());
    rows.extend(verified_rows(v));
    if !f.left_out.is_empty() {
        rows.push(["not swept, by what is in the way".to_owned(), String::new()]);
        rows.extend(f.left_out.iter().map(|left| [format!("  {}", left.cause), left.to_string()]));
    }
    rows.extend(missed_rows(&f.missed));
    let mut row = |name: &str, value: String| rows.push([name.to_owned(), value]);
    row("calculation", format!("{:.2} s", f.calc_time_total_s));
    for (stage, seconds) in &f.calc_time_s {
        row(&format!("  {stage}"), format!("{seconds:.2} s"));
    }
    rows
}

/// How what a tool that works from afar has worked on is counted from a plan: other things that may stand
/// before it are not in the plan.
pub(super) const OWN_SURFACE: &str = "by what its own surface hides alone";

/// How fast a plan goes along its path, for people.
pub(super) fn pace_rows(p: &Pace) -> Vec<[String; 2]> {
    let (p5, p50, p95) = (p.tool_speed_p5, p.tool_speed_p50, p.tool_speed_p95);
    let largest = |of: fn(&JointPace) -> f64| p.joints.iter().map(of).fold(0.0, f64::max);
    let shares: Vec<String> =
        p.joints.iter().map(|j| format!("{:.0}", 100.0 * j.effort_share)).collect();
    [
        ("time on the surface", format!("{:.2} s", p.contact_s)),
        ("tool speed, p5, p50, p95", format!("{p5:.3}, {p50:.3}, {p95:.3} m/s")),
        ("dips below", format!("{:.2} m/s: {}", p.dip_speed, p.dips)),
        ("acceleration, max", format!("{:.1} rad/s²", largest(|j| j.acceleration))),
        ("jerk, max", format!("{:.0} rad/s³", largest(|j| j.jerk))),
        ("effort by joint, base to tip", format!("{} %", shares.join(", "))),
    ]
    .map(|(name, value)| [name.to_owned(), value])
    .into()
}

/// Why reachable points are not swept, for people.
pub(super) fn missed_rows(missed: &[MissedPoints]) -> Vec<[String; 2]> {
    let heading = (!missed.is_empty())
        .then(|| ["reachable, but not swept, by the pad's way".to_owned(), String::new()]);
    let rows = missed.iter().map(|row| {
        let points = if row.points == 1 { "point" } else { "points" };
        let value = format!("{} {points}, {} of reachable", row.points, percent(row.share));
        [format!("  {}", row.why), value]
    });
    heading.into_iter().chain(rows).collect()
}

/// How well a tool speed is held, for people.
fn held_rows(held: &sweep::Held) -> Vec<[String; 2]> {
    let mut rows = vec![[
        format!("tool speed of {} m/s held", held.speed),
        format!("{} of the length", percent(held.share)),
    ]];
    rows.extend(held.slower.iter().map(|s| {
        let [x, y, z] = s.at;
        let place = format!("{x:.3}, {y:.3}, {z:.3}");
        let what = format!(
            "at {:.2} s, {place} m: down to {:.3} m/s over {:.0} mm, by {}",
            s.time_s,
            s.speed,
            1e3 * s.length_m,
            s.joint
        );
        ["  slower".to_owned(), what]
    }));
    rows
}

pub(super) fn table(figures: &Figures) -> Table {
    let mut table = sheet(["figure", "value"]);
    table.add_rows(rows(figures).into_iter().map(|[name, value]| [folded(&name), value]));
    table
}

pub(super) fn figures_table(figures: &Figures) -> report::Table {
    report::Table {
        title: "Figures".into(),
        columns: vec!["figure".into(), "value".into()],
        rows: rows(figures).into_iter().map(Vec::from).collect(),
    }
}
