//! The distributions as one picture: how many samples are later than a time, both logarithmic, so
//! that the tails are seen.

use nullsweep_ipc_types::{HISTOGRAM_BUCKETS, bucket_upper_ns};
use plotly::common::{Line, LineShape, Mode};
use plotly::layout::{Axis, AxisType};
use plotly::{Layout, Plot, Scatter};

use super::stats::Times;

/// A curve: times in µs and the share of samples that are later.
pub(super) type Curve = Vec<(f64, f64)>;

/// The curve of recorded times.
pub(super) fn of_times(times: &Times) -> Curve {
    curve(times.counts())
}

/// The curve of one of the executor's own histograms.
pub(super) fn of_histogram(buckets: &[u32; HISTOGRAM_BUCKETS]) -> Curve {
    curve((0..HISTOGRAM_BUCKETS).map(|b| (bucket_upper_ns(b), u64::from(buckets[b]))))
}

/// A page that needs no network, with one curve for each name.
pub(super) fn page(title: &str, curves: Vec<(&'static str, Curve)>) -> String {
    let mut plot = Plot::new();
    for (name, curve) in curves {
        let (x, y): (Vec<f64>, Vec<f64>) = curve.into_iter().unzip();
        plot.add_trace(
            Scatter::new(x, y).name(name).mode(Mode::Lines).line(Line::new().shape(LineShape::Hv)),
        );
    }
    let axis = |title: &str| Axis::new().title(title.to_owned()).type_(AxisType::Log);
    plot.set_layout(
        Layout::new()
            .title(title.to_owned())
            .x_axis(axis("µs"))
            .y_axis(axis("share of samples that are later")),
    );
    format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{title}</title>\n\
         {}</head><body style=\"height: 95vh\">\n{}</body></html>\n",
        library(),
        plot.to_inline_html(Some("latencies"))
    )
}

/// The plotting library itself, without the typesetter of formulas that comes behind it.
fn library() -> String {
    const END: &str = "</script>";
    let mut sources = Plot::offline_js_sources();
    if let Some(at) = sources.find(END) {
        sources.truncate(at + END.len());
    }
    sources
}

/// From values in rising order with their counts.
fn curve(counts: impl Iterator<Item = (u64, u64)>) -> Curve {
    let counts: Vec<_> = counts.filter(|(_, count)| *count > 0).collect();
    let total: u64 = counts.iter().map(|(_, count)| count).sum();
    let mut left = total;
    let mut curve = Vec::with_capacity(counts.len());
    for (ns, count) in counts {
        // A logarithmic axis knows no 0.
        let us = (ns as f64 * 1e-3).max(1e-2);
        curve.push((us, left as f64 / total as f64));
        left -= count;
    }
    curve
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_falls_from_one() {
        let mut times = Times::default();
        for ns in [1_000, 1_000, 10_000, 100_000] {
            times.record(ns);
        }
        let curve = of_times(&times);
        let shares: Vec<_> = curve.iter().map(|(_, share)| *share).collect();
        assert_eq!(shares, [1.0, 0.5, 0.25]);
        assert!((curve[2].0 - 100.0).abs() < 0.1);
        let page = page("t", vec![("a", curve)]);
        assert!(page.contains("<html") && !page.contains("<script src"));
    }
}
