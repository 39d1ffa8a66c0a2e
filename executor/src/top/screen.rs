//! The board on a terminal.

use std::time::Instant;

use nullsweep_ipc_types::{Fault, HISTOGRAM_BUCKETS, Mode, Telemetry, bucket_upper_ns};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Cell, Paragraph, Row, Sparkline, Table};

use super::board::{Board, Joint};
use crate::executor::quantile_ns;

/// Cells of the bar that shows where a joint is between its limits.
const BAR: usize = 21;
/// A following error above this is told in red: half of what makes a fault at stand-still.
/// \[rad\] or \[m\]
const MUCH: f64 = 0.05;
/// What the keys do.
const KEYS: &str =
    " p pause  r resume  s stop  d stop, motors off  + faster  - slower  x reset  q quit ";

/// Draws everything. Where the terminal is small, the log goes first.
pub(super) fn draw(frame: &mut Frame<'_>, board: &Board, now: Instant) {
    let telemetry = board.telemetry(now);
    let joints = telemetry.map_or_else(Vec::new, |t| board.joints(t));
    let [head, middle, times, log, foot] = Layout::vertical([
        Constraint::Length(4),
        Constraint::Length(joints.len() as u16 + 3),
        Constraint::Length(7),
        Constraint::Min(0),
        Constraint::Length(1),
    ])
    .areas(frame.area());
    draw_head(frame, head, board, telemetry);
    if let Some(telemetry) = telemetry {
        draw_joints(frame, middle, &joints, telemetry);
        let [late, compute] =
            Layout::horizontal([Constraint::Percentage(50), Constraint::Percentage(50)])
                .areas(times);
        draw_histogram(frame, late, "wake-up lateness", &telemetry.lateness);
        draw_histogram(frame, compute, "compute a cycle", &telemetry.compute);
    }
    draw_log(frame, log, board);
    frame.render_widget(Paragraph::new(KEYS).style(Modifier::REVERSED), foot);
}

fn draw_head(frame: &mut Frame<'_>, area: Rect, board: &Board, telemetry: Option<&Telemetry>) {
    let block = Block::bordered().title(format!(" executor of robot {} ", board.robot));
    let lines = match telemetry {
        None => {
            let why = board.trouble.as_deref().unwrap_or("no telemetry comes");
            vec![Line::styled(format!("waiting for an executor: {why}"), Color::Yellow)]
        }
        Some(t) => vec![state(t, &board.answer), motion(t, board.length(t.plan))],
    };
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

/// Mode, fault and how the last command was taken.
fn state<'a>(t: &Telemetry, answer: &'a str) -> Line<'a> {
    let mode = Mode::from_wire(t.mode);
    let colour = match mode {
        Some(Mode::Fault) => Color::Red,
        Some(Mode::Executing | Mode::Hold) => Color::Green,
        _ => Color::Yellow,
    };
    let bold = Style::from(colour).add_modifier(Modifier::BOLD);
    let mut spans = vec![Span::styled(mode.map_or("unknown mode", Mode::text), bold)];
    if t.fault != Fault::None.wire() {
        let fault = Fault::from_wire(t.fault).map_or("unknown fault", Fault::text);
        spans.push(Span::styled(format!("  {fault}"), Color::Red));
    }
    if t.unverified != 0 {
        spans.push(Span::styled("  the plan is NOT VERIFIED", Color::Red));
    }
    if !answer.is_empty() {
        spans.push(Span::raw(format!("   [{answer}]")));
    }
    Line::from(spans)
}

/// The plan of that length \[s\], where it is and how fast.
fn motion(t: &Telemetry, length: Option<f64>) -> Line<'static> {
    let plan = if t.plan.is_some() {
        let seconds = t.plan_time_ns as f64 * 1e-9;
        let whole = length.map_or_else(String::new, |length| {
            let done = 100.0 * (seconds / length).min(1.0);
            let left = (length - seconds).max(0.0) / t.speed_scale;
            // At a stand-still there is no end to see.
            let left = if left.is_finite() { format!(", {left:.1} s left") } else { String::new() };
            format!(" of {length:.2} s ({done:.0} %{left})")
        });
        format!("plan {}  knot {}  {seconds:.2} s{whole}", t.plan, t.knot)
    } else if t.stopped != 0 {
        format!("no plan; the last one was left in knot {}", t.knot)
    } else {
        "no plan".into()
    };
    // Without a plan nothing goes at any speed.
    let speed = match t.plan.is_some() {
        true => format!("  speed {:.0} %", t.speed_scale * 100.0),
        false => String::new(),
    };
    let (cycle, missed) = (t.cycle, t.missed_cycles);
    Line::raw(format!("{plan}{speed}  cycle {cycle}, {missed} missed"))
}

fn draw_joints(frame: &mut Frame<'_>, area: Rect, joints: &[Joint], t: &Telemetry) {
    let rows = joints.iter().enumerate().map(|(j, joint)| {
        let (commanded, measured) = (t.commanded[j], t.measured[j]);
        let error = measured - commanded;
        let (low, high) = joint.limits;
        // Written so that a NaN is red too.
        let style = if error.abs() <= MUCH { Style::new() } else { Color::Red.into() };
        let limit = |x: f64| if x.is_finite() { format!("{x:.3}") } else { "–".into() };
        Row::new([
            Cell::new(joint.name.clone()),
            Cell::new(format!("{commanded:9.4} {}", joint.unit)),
            Cell::new(format!("{measured:9.4} {}", joint.unit)),
            Cell::new(format!("{error:+9.4}")).style(style),
            Cell::new(limit(low)),
            Cell::new(bar(measured, joint.limits)),
            Cell::new(limit(high)),
        ])
    });
    let widths = [
        Constraint::Min(12),
        Constraint::Length(13),
        Constraint::Length(13),
        Constraint::Length(9),
        Constraint::Length(7),
        Constraint::Length(BAR as u16),
        Constraint::Length(7),
    ];
    let head = ["joint", "commanded", "measured", "error", "lower", "", "upper"];
    let table = Table::new(rows, widths)
        .header(Row::new(head).style(Modifier::BOLD))
        .block(Block::bordered().title(" joints "));
    frame.render_widget(table, area);
}

/// Where a value is between its limits.
pub(super) fn bar(value: f64, (low, high): (f64, f64)) -> String {
    let share = (value - low) / (high - low);
    // Neither for joints without limits nor for what is no number.
    if !(0.0..=1.0).contains(&share) {
        let sign = if value < low {
            '<'
        } else if value > high {
            '>'
        } else {
            ' '
        };
        return sign.to_string().repeat(BAR);
    }
    let at = (share * (BAR - 1) as f64).round() as usize;
    (0..BAR).map(|cell| if cell == at { '█' } else { '·' }).collect()
}

fn draw_histogram(
    frame: &mut Frame<'_>,
    area: Rect,
    title: &str,
    histogram: &[u32; HISTOGRAM_BUCKETS],
) {
    let block = Block::bordered().title(format!(" {title}: {} ", quantiles(histogram)));
    // Each count by its digits: the rare ones are what matters.
    let heights = histogram.map(|n| (f64::from(n) + 1.0).log2().ceil() as u64);
    let last = bucket_upper_ns(HISTOGRAM_BUCKETS - 2) / 1_000_000;
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let [bars, scale] = Layout::vertical([Constraint::Min(1), Constraint::Length(1)]).areas(inner);
    frame.render_widget(Sparkline::default().data(&heights[..]), bars);
    frame.render_widget(Paragraph::new(format!("0.26 µs … {last} ms, logarithmic")), scale);
}

fn quantiles(histogram: &[u32; HISTOGRAM_BUCKETS]) -> String {
    let below = |share| match quantile_ns(histogram, share) {
        Some(bound) => format!("<{:.1}", bound as f64 * 1e-3),
        None => "beyond".into(),
    };
    format!("p50 {} p99 {} p99.9 {} µs", below(0.5), below(0.99), below(0.999))
}

fn draw_log(frame: &mut Frame<'_>, area: Rect, board: &Board) {
    let room = area.height.saturating_sub(2) as usize;
    let mut lines: Vec<Line<'_>> = board.log().rev().take(room).map(Line::raw).collect();
    lines.reverse();
    let block = Block::bordered().title(" what happened ");
    frame.render_widget(Paragraph::new(lines).block(block), area);
}
