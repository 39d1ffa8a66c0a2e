//! The tables as Markdown and as CSV.

use std::fmt::Write as _;

use nullsweep_planner::plan::{CostKind, Method};

use crate::report::{METHODS, Report, Tracked};
use crate::{Object, Published, Quantity, cannot_hold, paper};

const COSTS: [CostKind; 2] = [CostKind::Time, CostKind::Effort];
const QUANTITIES: [Quantity; 5] = [
    Quantity::Distance,
    Quantity::Effort,
    Quantity::Time,
    Quantity::Calculation,
    Quantity::Processor,
];

/// All tables of a report, for a page of text.
#[must_use]
pub fn markdown(report: &Report) -> String {
    let mut page = String::new();
    let _ = writeln!(page, "# {}\n", report.title);
    let s = &report.setting;
    let _ = writeln!(
        page,
        "{} points, {} patches, {} of them reached, {} edges, components of {:?} patches; base \
         ({:.3}, {:.3}) m, {:.1}°; seed {}, {} repeats; {}.\n",
        s.points,
        s.patches,
        s.reached,
        s.edges,
        s.components,
        s.base[0],
        s.base[1],
        s.base[2].to_degrees(),
        report.seed,
        report.repeats,
        if report.symmetric {
            "a heading and its opposite are the same contact"
        } else {
            "a heading and its opposite are two contacts, as in the paper"
        },
    );
    for cost in COSTS {
        push_table(&mut page, report, cost);
    }
    push_savings(&mut page, report);
    push_memory(&mut page, report);
    push_tracked(&mut page, report);
    page
}

fn push_table(page: &mut String, report: &Report, cost: CostKind) {
    let goal = match cost {
        CostKind::Time => "task time",
        CostKind::Effort => "effort",
    };
    let paper = report.object.map_or("", |object| match object {
        Object::Chair => " (the paper's Table I in italics)",
        Object::BobbyCar => " (the paper's Table II in italics)",
    });
    let _ = writeln!(page, "## Optimised for {goal}{paper}\n");
    page.push_str("| | TSP | Curvature-GTSP | Joint-GTSP |\n|---|---|---|---|\n");
    let mut marked = false;
    for &samples in &report.samples {
        let plural = if samples == 1 { "sample" } else { "samples" };
        let _ = writeln!(page, "| **{samples} {plural}** | | | |");
        for quantity in QUANTITIES {
            let _ = write!(page, "| {}", label(quantity));
            for method in METHODS {
                let ours = report
                    .statistic(cost, samples, method, quantity)
                    .map_or_else(|| "–".into(), pair);
                let _ = write!(page, " | {ours}");
                if let Some(object) = report.object
                    && paper::samples(object).contains(&samples)
                    && quantity != Quantity::Processor
                {
                    let at = |q| paper::cell(object, cost, samples, method, q);
                    let impossible = at(Quantity::Effort)
                        .zip(at(Quantity::Time))
                        .and_then(|(e, t)| cannot_hold(e, t))
                        .filter(|_| matches!(quantity, Quantity::Effort | Quantity::Time));
                    let theirs = at(quantity).map_or_else(|| "N/A".into(), pair);
                    marked |= impossible.is_some();
                    let mark = if impossible.is_some() { " †" } else { "" };
                    let _ = write!(page, "<br>*{theirs}*{mark}");
                }
            }
            page.push_str(" |\n");
        }
    }
    page.push('\n');
    if marked {
        page.push_str(
            "† cannot hold at v_max = 2 rad/s: the sum of the joints' displacements is at least \
             the largest of them, which is 2 rad/s times the time, but the published effort is \
             smaller than that.\n\n",
        );
    }
}

fn push_savings(page: &mut String, report: &Report) {
    page.push_str("## Against the TSP\n\nChange of the means against the TSP's in the same block");
    page.push_str(if report.object.is_some() { ", the paper's in italics.\n\n" } else { ".\n\n" });
    page.push_str(
        "| optimised | samples | Curvature: effort | Curvature: time | Joint: effort | Joint: time \
         |\n|---|---|---|---|---|---|\n",
    );
    for cost in COSTS {
        for &samples in &report.samples {
            let _ = write!(page, "| {cost:?} | {samples}");
            for method in [Method::Curvature, Method::Joint] {
                for quantity in [Quantity::Effort, Quantity::Time] {
                    let mean = |m| report.statistic(cost, samples, m, quantity).map(|s| s.0);
                    let ours = change(mean(Method::Tsp), mean(method));
                    let _ = write!(page, " | {ours}");
                    if let Some(object) = report.object {
                        let at = |m| paper::cell(object, cost, samples, m, quantity).map(|p| p.0);
                        let _ = write!(page, " *{}*", change(at(Method::Tsp), at(method)));
                    }
                }
            }
            page.push_str(" |\n");
        }
    }
    page.push('\n');
}

fn push_memory(page: &mut String, report: &Report) {
    let joint = report.cells.iter().filter(|c| c.method == Method::Joint);
    let Some(largest) = joint.flat_map(|c| &c.runs).max_by_key(|run| run.bytes) else { return };
    let _ = write!(
        page,
        "The largest Joint-GTSP chose among {} samples and took {:.1} MB for samples, labels and \
         stored costs",
        largest.samples,
        largest.bytes as f64 * 1e-6
    );
    if let Some(peak) = report.peak_memory_bytes {
        let _ =
            write!(page, "; the whole process never held more than {:.0} MB", peak as f64 * 1e-6);
    }
    page.push_str(".\n\n");
}

fn push_tracked(page: &mut String, report: &Report) {
    if let Some(straight) = &report.straight {
        let _ = writeln!(
            page,
            "## What the straight model leaves out\n\nThe Joint-GTSP's path with the most samples, \
             optimised for task time, driven as straight joint motions: the pad leaves the \
             surface by {:.1} mm at the median, {:.1} mm at the 95th percentile and {:.0} mm at \
             most; {} of {} motions collide, {} of {} poses do.\n",
            straight.off_surface_m[0] * 1e3,
            straight.off_surface_m[1] * 1e3,
            straight.off_surface_m[2] * 1e3,
            straight.colliding_motions,
            straight.motions,
            straight.colliding_poses,
            straight.poses,
        );
    }
    if report.tracked.is_empty() {
        return;
    }
    page.push_str(
        "## Tracked edges: plans that a robot can run\n\nThe tool stays on the scanned surface, \
         every motion is free of collision, leaving the surface is a jump that costs its motion; \
         v_max = 2 rad/s, 100 samples.\n\n| optimised | method | patches reached | effort [rad] | \
         task time [s] | distance [m] | jumps | left out | swept, reachable | swept, all | off the \
         line, max [mm] | pad to scan, p95 [mm] | violations | calculation [s] \
         |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for cost in COSTS {
        for method in METHODS {
            let rows: Vec<&Tracked> = report
                .tracked
                .iter()
                .filter(|t| t.optimised == cost && t.method == method)
                .collect();
            if rows.is_empty() {
                continue;
            }
            let mean = |of: &dyn Fn(&Tracked) -> f64| paper::statistic(rows.iter().map(|r| of(r)));
            let _ = writeln!(
                page,
                "| {cost:?} | {method:?} | {:.0} | {} | {} | {} | {} | {} | {} | {} | {:.2} | {} | \
                 {:.0} | {} |",
                mean(&|r| r.reachable as f64).0,
                pair(mean(&|r| r.effort_rad)),
                pair(mean(&|r| r.task_time_s)),
                pair(mean(&|r| r.distance_m)),
                pair(mean(&|r| r.jumps as f64)),
                pair(mean(&|r| r.dropped as f64)),
                share(mean(&|r| r.coverage_reachable)),
                share(mean(&|r| r.coverage_all)),
                rows.iter().map(|r| r.line_deviation_max_m).fold(0.0, f64::max) * 1e3,
                pair(mean(&|r| r.scan_distance_p95_m * 1e3)),
                rows.iter().map(|r| r.violations).sum::<usize>() as f64,
                pair(mean(&|r| r.calculation_s)),
            );
        }
    }
    page.push('\n');
}

/// One line for every run, in both models.
#[must_use]
pub fn csv(report: &Report) -> String {
    let mut text = String::from(
        "model,optimised,samples,method,repeat,distance_m,effort_rad,task_time_s,calculation_s,\
         processor_s,jumps,coverage_reachable,coverage_all,line_deviation_max_m,scan_distance_p95_m,violations\n",
    );
    for cell in &report.cells {
        for (repeat, f) in cell.runs.iter().enumerate() {
            let _ = writeln!(
                text,
                "straight,{:?},{},{:?},{repeat},{},{},{},{},{},{},,,,,",
                cell.optimised,
                cell.samples,
                cell.method,
                f.distance_m,
                f.effort_rad,
                f.task_time_s,
                f.calculation_s,
                f.processor_s,
                f.jumps
            );
        }
    }
    for t in &report.tracked {
        let _ = writeln!(
            text,
            "tracked,{:?},{},{:?},{},{},{},{},{},,{},{},{},{},{},{}",
            t.optimised,
            t.samples,
            t.method,
            t.repeat,
            t.distance_m,
            t.effort_rad,
            t.task_time_s,
            t.calculation_s,
            t.jumps,
            t.coverage_reachable,
            t.coverage_all,
            t.line_deviation_max_m,
            t.scan_distance_p95_m,
            t.violations
        );
    }
    text
}

fn pair((mean, deviation): Published) -> String {
    format!("{mean:.2} ± {deviation:.2}")
}

fn share((mean, deviation): Published) -> String {
    format!("{:.1} ± {:.1} %", mean * 100.0, deviation * 100.0)
}

fn change(from: Option<f64>, to: Option<f64>) -> String {
    match from.zip(to) {
        Some((from, to)) => format!("{:+.1} %", (to / from - 1.0) * 100.0),
        None => "N/A".into(),
    }
}

fn label(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Distance => "Dist. [m]",
        Quantity::Effort => "Effort [rad]",
        Quantity::Time => "Task time [s]",
        Quantity::Calculation => "Calc. time [s]",
        Quantity::Processor => "Processor time [s]",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_deviation_of_a_sample() {
        let (mean, deviation) =
            paper::statistic([2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0].into_iter());
        assert_eq!(mean, 5.0);
        assert!((deviation - (32.0f64 / 7.0).sqrt()).abs() < 1e-12);
        assert_eq!(paper::statistic([3.0].into_iter()), (3.0, 0.0));
    }
}
