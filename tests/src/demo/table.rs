//! The demo's one table.

use comfy_table::{CellAlignment, Table, presets};

use super::outcome::{Outcome, Planned};
use crate::tracking::Tracking;

/// The table, the checks and where the report is.
pub(super) fn text(outcome: &Outcome) -> String {
    let [first, second] = &outcome.plans;
    let mut table = Table::new();
    table.load_style(presets::UTF8_BORDERS_ONLY);
    table.set_header(["", "first plan", "second plan"]);
    let mut row = |what: &str, cell: &dyn Fn(&Planned) -> String| {
        table.add_row([what.to_owned(), cell(first), cell(second)]);
    };
    row("method, cost", &|p| format!("{}, {}", p.method, p.cost));
    row("patches, reachable", &|p| format!("{}, {}", p.figures.patches, p.figures.reachable));
    row("knots", &|p| p.figures.knots.to_string());
    row("task time", &|p| format!("{:.1} s", p.figures.task_time_s));
    row("effort", &|p| format!("{:.1} rad", p.figures.effort_rad));
    row("motions through free space", &|p| p.figures.jumps.to_string());
    row("off the planned line", &|p| format!("{:.2} mm", p.figures.line_deviation_max_m * 1e3));
    row("planned coverage, reachable", &|p| percent(p.figures.coverage_reachable));
    row("planned coverage, all", &|p| percent(p.figures.coverage_all));
    row("time to plan", &|p| format!("{:.1} s", p.figures.calc_time_total_s));
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }

    let mut run = Table::new();
    run.load_style(presets::UTF8_BORDERS_ONLY);
    run.set_header(["the run", ""]);
    let mut row = |what: &str, value: String| {
        run.add_row([what.to_owned(), value]);
    };
    let swap = &outcome.swap;
    row("swap", format!("in knot {} at {:.1} s", swap.knot, swap.at_s));
    if let (Some(step), Some(velocity)) = (swap.step_ratio, swap.velocity_step) {
        let step = 100.0 * step;
        row(
            "in the cycle of the swap",
            format!("step {step:.0} % of v·T, velocity by {velocity:.3} rad/s"),
        );
    }
    if let Some([setpoints, violations]) = outcome.judged {
        row("setpoints at the endpoint", setpoints.to_string());
        row("violations at the endpoint", violations.to_string());
    }
    let Tracking { p50, p95, max } = outcome.tracking;
    row("tracking error", format!("p50 {p50:.4}, p95 {p95:.4}, max {max:.4} rad"));
    row("measured coverage, reachable", percent(outcome.measured.reachable));
    row("measured coverage, all", percent(outcome.measured.all));
    let [n, p50, _, p99, p999, _, max] = outcome.lateness.cells();
    row(
        "executor's wake-up lateness",
        format!("p50 {p50}, p99 {p99}, p99.9 {p999}, max {max} µs of {n} cycles"),
    );
    row("missed cycles", outcome.missed_cycles.to_string());
    row("in all", format!("{:.1} s", outcome.seconds));

    let mut text = format!("{table}\n{run}");
    for check in &outcome.checks {
        let mark = if check.ok { "ok  " } else { "FAIL" };
        text.push_str(&format!("\n{mark} {}: {}", check.what, check.found));
    }
    text.push_str(&format!("\nreport: {}", outcome.report.display()));
    if let Some(picture) = &outcome.picture {
        text.push_str(&format!("\npicture: {}", picture.display()));
    }
    text
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}
