//! The joints over time.

use plotly::color::Rgba;
use plotly::common::{Anchor, DashType, HoverInfo, Line, Mode};
use plotly::layout::{Axis, HoverMode, Legend, Margin, Shape, ShapeLayer, ShapeLine, ShapeType};
use plotly::{Configuration, Layout, Plot, Scatter};

use crate::data::{JointAxis, Motion, ReportData};
use crate::style::{MEASURED, MOTIONS, escaped};

/// Joints in one figure: as many as a layout has axes.
pub(super) const ROWS: usize = 8;

/// Most samples of one curve shown.
const MAX_SAMPLES: usize = 2_400;

/// One figure for each [`ROWS`] joints, with how many rows it has.
pub(super) fn plots(data: &ReportData) -> Vec<(Plot, usize)> {
    let moves = data.plans.iter().chain(&data.measured).any(|motion| !motion.joints.is_empty());
    if !moves {
        return Vec::new();
    }
    let rows: Vec<usize> = (0..data.joints.len()).collect();
    rows.chunks(ROWS).map(|rows| (plot(data, rows), rows.len())).collect()
}

fn plot(data: &ReportData, rows: &[usize]) -> Plot {
    let mut plot = Plot::new();
    let end = data
        .plans
        .iter()
        .chain(&data.measured)
        .filter_map(|motion| motion.times.last().copied())
        .fold(0.0, f64::max);
    for (row, &joint) in rows.iter().enumerate() {
        for (motion, (color, _)) in data.plans.iter().zip(MOTIONS.iter().cycle()) {
            curve(&mut plot, motion, joint, row, Line::new().width(1.6).color(*color));
        }
        for (motion, color) in data.measured.iter().zip(MEASURED.iter().cycle()) {
            let line = Line::new().width(1.2).dash(DashType::Dot).color(*color);
            curve(&mut plot, motion, joint, row, line);
        }
        limits(&mut plot, &data.joints[joint], row, end);
    }
    let count = rows.len() as f64;
    let mut layout = Layout::new()
        .hover_mode(HoverMode::XUnified)
        .margin(Margin::new().left(70).right(20).top(46).bottom(50))
        .legend(
            Legend::new()
                .x(0.0)
                .y(1.0)
                .y_anchor(Anchor::Bottom)
                .orientation(plotly::common::Orientation::Horizontal),
        )
        .plot_background_color("#f7f8fa")
        .shapes(data.plans.first().map(transfer_bands).unwrap_or_default())
        .x_axis(
            Axis::new()
                .title("time [s]")
                .anchor(axis_name("y", rows.len() - 1))
                .grid_color("#dfe3e8")
                .zero_line(false),
        );
    for (row, &joint) in rows.iter().enumerate() {
        let top = 1.0 - row as f64 / count;
        let bottom = 1.0 - (row as f64 + 0.88) / count;
        let axis = Axis::new()
            .title(short(&data.joints[joint].name))
            .domain(&[bottom.max(0.0), top])
            .grid_color("#dfe3e8")
            .zero_line(false);
        layout = match row {
            0 => layout.y_axis(axis),
            1 => layout.y_axis2(axis),
            2 => layout.y_axis3(axis),
            3 => layout.y_axis4(axis),
            4 => layout.y_axis5(axis),
            5 => layout.y_axis6(axis),
            6 => layout.y_axis7(axis),
            _ => layout.y_axis8(axis),
        };
    }
    plot.set_layout(layout);
    plot.set_configuration(Configuration::new().responsive(true).display_logo(false));
    plot
}

fn curve(plot: &mut Plot, motion: &Motion, joint: usize, row: usize, line: Line) {
    let Some(positions) = motion.joints.get(joint).filter(|p| !p.is_empty()) else { return };
    let kept = extremes(positions, MAX_SAMPLES);
    let times = kept.iter().map(|&i| rounded(motion.times[i])).collect();
    let values = kept.iter().map(|&i| rounded(positions[i])).collect();
    plot.add_trace(
        Scatter::new(times, values)
            .name(escaped(&motion.name))
            .legend_group(escaped(&motion.name))
            .show_legend(row == 0)
            .mode(Mode::Lines)
            .line(line)
            .y_axis(axis_name("y", row)),
    );
}

fn limits(plot: &mut Plot, joint: &JointAxis, row: usize, end: f64) {
    let Some((lower, upper)) = joint.limits else { return };
    // One curve with a gap, so that the legend shows the limits once.
    let times = vec![Some(0.0), Some(end), None, Some(0.0), Some(end)];
    let values = vec![Some(lower), Some(lower), None, Some(upper), Some(upper)];
    plot.add_trace(
        Scatter::new(times, values)
            .name("soft limits")
            .legend_group("soft limits")
            .show_legend(row == 0)
            .mode(Mode::Lines)
            .line(Line::new().width(1.2).dash(DashType::Dash).color("#d1350f"))
            .hover_info(HoverInfo::Skip)
            .y_axis(axis_name("y", row)),
    );
}

/// Grey bands behind the transfers of a motion.
fn transfer_bands(motion: &Motion) -> Vec<Shape> {
    let mut bands = Vec::new();
    let mut i = 0;
    while i < motion.contact.len() {
        if motion.contact[i] {
            i += 1;
            continue;
        }
        let from = motion.times[i.saturating_sub(1)];
        while i < motion.contact.len() && !motion.contact[i] {
            i += 1;
        }
        let to = motion.times[i.min(motion.times.len() - 1)];
        bands.push(
            Shape::new()
                .shape_type(ShapeType::Rect)
                .x_ref("x")
                .y_ref("paper")
                .x0(rounded(from))
                .x1(rounded(to))
                .y0(0)
                .y1(1)
                .layer(ShapeLayer::Below)
                .fill_color(Rgba::new(120, 125, 140, 0.18))
                .line(ShapeLine::new().width(0.0)),
        );
    }
    bands
}

/// Indices that show a curve: all of a short one, else of each stretch the first, least and
/// greatest value, so that no peak gets lost.
fn extremes(values: &[f64], most: usize) -> Vec<usize> {
    if values.len() <= most {
        return (0..values.len()).collect();
    }
    let stretch = values.len().div_ceil(most / 3);
    let mut kept = Vec::with_capacity(most + 1);
    for start in (0..values.len()).step_by(stretch) {
        let range = start..values.len().min(start + stretch);
        let by = |a: &usize, b: &usize| values[*a].total_cmp(&values[*b]);
        let mut three = vec![
            start,
            range.clone().min_by(by).unwrap_or(start),
            range.max_by(by).unwrap_or(start),
        ];
        three.sort_unstable();
        three.dedup();
        kept.extend(three);
    }
    if kept.last() != Some(&(values.len() - 1)) {
        kept.push(values.len() - 1);
    }
    kept
}

/// `y`, `y2`, `y3` …
fn axis_name(letter: &str, index: usize) -> String {
    if index == 0 { letter.to_owned() } else { format!("{letter}{}", index + 1) }
}

/// A joint's name in the room of an axis title.
fn short(name: &str) -> String {
    let name = name.strip_suffix("_joint").unwrap_or(name);
    format!("{}<br>[rad]", escaped(&name.replace('_', " ")))
}

fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_peaks_and_ends() {
        let mut values: Vec<f64> = (0..10_000).map(|i| (f64::from(i) * 0.001).sin()).collect();
        values[4321] = 7.0;
        values[8765] = -7.0;
        let kept = extremes(&values, 600);
        assert!(kept.len() <= 602);
        assert!(kept.windows(2).all(|pair| pair[0] < pair[1]));
        for index in [0, 4321, 8765, 9999] {
            assert!(kept.contains(&index), "{index} got lost");
        }
    }
}
