//! The scene in space.

use nalgebra::Point3;
use plotly::color::{NamedColor, Rgba};
use plotly::common::{DashType, HoverInfo, Line, Marker, MarkerSymbol, Mode, Visible};
use plotly::layout::{
    AspectMode, Axis, Camera, DragMode3D, ItemSizing, LayoutScene, Legend, Margin,
};
use plotly::{Configuration, Layout, Plot, Scatter3D};

use crate::data::{Motion, PatchMark, ReportData};
use crate::style::{MEASURED, MOTIONS, escaped};

/// Most scan points shown; more neither show more nor load well.
const MAX_POINTS: usize = 15_000;

/// Most points of one path shown.
const MAX_PATH: usize = 8_000;

/// Length of a patch's normal. \[m\]
const NORMAL: f64 = 0.02;

/// How far patches and paths are drawn off the surface, so that the scan does not hide them. \[m\]
const LIFT: f64 = 0.006;

/// Colours that stay apart for the colour-blind (after Okabe & Ito).
const SWEPT: &str = "#7fb8ad";
const UNSWEPT: &str = "#e69f00";
const REACHABLE: &str = "#0072b2";
const UNREACHABLE: &str = "#d1350f";

/// The scan, the patches, the graph and the tool's paths.
pub(super) fn plot(data: &ReportData) -> Plot {
    let mut plot = Plot::new();
    scan(&mut plot, data);
    graph(&mut plot, data);
    patches(&mut plot, &data.patches);
    for (motion, (contact, transfer)) in data.plans.iter().zip(MOTIONS.iter().cycle()) {
        path(&mut plot, &data.patches, motion, contact, Some(transfer));
    }
    for (motion, color) in data.measured.iter().zip(MEASURED.iter().cycle()) {
        path(&mut plot, &data.patches, motion, color, None);
    }
    lay_out(&mut plot);
    plot
}

/// Axes in true proportion, a view from above and the side, the legend.
pub(super) fn lay_out(plot: &mut Plot) {
    let axis = |title: &str| Axis::new().title(title).grid_color("#dfe3e8").zero_line(false);
    let scene = LayoutScene::new()
        .aspect_mode(AspectMode::Data)
        .drag_mode(DragMode3D::Turntable)
        .x_axis(axis("x [m]"))
        .y_axis(axis("y [m]"))
        .z_axis(axis("z [m]"))
        .camera(Camera::new().center((0.0, 0.0, -0.08).into()).eye((-1.5, -0.85, 1.05).into()));
    plot.set_layout(
        Layout::new().scene(scene).margin(Margin::new().left(0).right(0).top(0).bottom(0)).legend(
            Legend::new()
                .item_sizing(ItemSizing::Constant)
                .x(0.01)
                .y(0.99)
                .background_color(Rgba::new(255, 255, 255, 0.8)),
        ),
    );
    plot.set_configuration(Configuration::new().responsive(true).display_logo(false));
}

fn scan(plot: &mut Plot, data: &ReportData) {
    let stride = data.points.len().div_ceil(MAX_POINTS).max(1);
    let mut shown = |name: &str, color: &'static str, want: Option<bool>| {
        let points = (0..data.points.len())
            .step_by(stride)
            .filter(|&i| want.is_none_or(|want| data.swept[i] == want))
            .map(|i| Some(data.points[i]));
        let cloud = Cloud::new(points);
        if !cloud.x.is_empty() {
            plot.add_trace(
                cloud
                    .trace(name, Mode::Markers)
                    .marker(Marker::new().size(2).color(color))
                    .hover_info(HoverInfo::Skip),
            );
        }
    };
    if data.swept.is_empty() {
        shown("scan", SWEPT, None);
    } else {
        shown("scan, swept", SWEPT, Some(true));
        shown("scan, not swept", UNSWEPT, Some(false));
    }
}

fn graph(plot: &mut Plot, data: &ReportData) {
    if data.edges.is_empty() {
        return;
    }
    // Four points show how an edge follows the surface.
    let edges = data.edges.iter().flat_map(|edge| thin(edge, 4).map(Some).chain([None]));
    plot.add_trace(
        Cloud::new(edges)
            .trace(&format!("graph ({} edges)", data.edges.len()), Mode::Lines)
            .line(Line::new().width(1.0).color(Rgba::new(90, 90, 100, 0.45)))
            .hover_info(HoverInfo::Skip)
            .visible(Visible::LegendOnly),
    );
}

fn patches(plot: &mut Plot, patches: &[PatchMark]) {
    let mut shown = |name: &str, color: &'static str, symbol: MarkerSymbol, reachable: bool| {
        let these: Vec<(usize, &PatchMark)> = patches
            .iter()
            .enumerate()
            .filter(|(_, patch)| patch.unreachable.is_none() == reachable)
            .collect();
        if these.is_empty() {
            return;
        }
        let text = these
            .iter()
            .map(|(i, patch)| match &patch.unreachable {
                None => format!("patch {i}"),
                Some(reason) => format!("patch {i}: {}", escaped(reason)),
            })
            .collect();
        plot.add_trace(
            Cloud::new(these.iter().map(|(_, patch)| Some(lifted(patch))))
                .trace(&format!("{name} ({})", these.len()), Mode::Markers)
                .legend_group(name)
                .marker(Marker::new().size(4).symbol(symbol).color(color))
                .hover_text_array(text)
                .hover_info(HoverInfo::Text),
        );
        let normals = these.iter().flat_map(|(_, patch)| {
            [Some(lifted(patch)), Some(patch.centre + patch.normal.scale(NORMAL)), None]
        });
        plot.add_trace(
            Cloud::new(normals)
                .trace("normals", Mode::Lines)
                .legend_group(name)
                .show_legend(false)
                .line(Line::new().width(2.0).color(color))
                .hover_info(HoverInfo::Skip),
        );
    };
    shown("patches", REACHABLE, MarkerSymbol::Circle, true);
    shown("not reachable", UNREACHABLE, MarkerSymbol::Square, false);
}

fn lifted(patch: &PatchMark) -> Point3<f64> {
    patch.centre + patch.normal.scale(LIFT)
}

/// A motion's path: contact solid, transfers (if they have a colour) dotted, its start marked.
fn path(
    plot: &mut Plot,
    patches: &[PatchMark],
    motion: &Motion,
    color: &'static str,
    transfer_color: Option<&'static str>,
) {
    if motion.tool.is_empty() {
        return;
    }
    let stride = motion.tool.len().div_ceil(MAX_PATH).max(1);
    let kept: Vec<usize> = (0..motion.tool.len())
        .filter(|&i| {
            i % stride == 0
                || i + 1 == motion.tool.len()
                || touches(motion, i) != touches(motion, i + 1)
        })
        .collect();
    let at = |i: usize| {
        let apart = |patch: &PatchMark| (patch.centre - motion.tool[i]).norm_squared();
        let nearest = patches.iter().min_by(|a, b| apart(a).total_cmp(&apart(b)));
        nearest.map_or(motion.tool[i], |patch| motion.tool[i] + patch.normal.scale(LIFT))
    };
    // A piece of the path is contact if both its ends are; each run is closed by a gap.
    let run = |wanted: bool| {
        let mut points = Vec::new();
        for pair in kept.windows(2) {
            let contact = touches(motion, pair[0]) && touches(motion, pair[1]);
            if contact == wanted {
                if points.last().is_none_or(Option::is_none) {
                    points.push(Some(at(pair[0])));
                }
                points.push(Some(at(pair[1])));
            } else {
                points.push(None);
            }
        }
        points.dedup();
        Cloud::new(points)
    };
    let (contact, transfer) = match transfer_color {
        Some(_) => (run(true), run(false)),
        None => (Cloud::new(kept.iter().map(|&i| Some(at(i)))), Cloud::new([])),
    };
    plot.add_trace(
        contact
            .trace(&motion.name, Mode::Lines)
            .line(Line::new().width(if transfer_color.is_some() { 6.0 } else { 2.0 }).color(color))
            .hover_info(HoverInfo::Name),
    );
    if let Some(color) = transfer_color
        && !transfer.x.is_empty()
    {
        plot.add_trace(
            transfer
                .trace(&format!("{}, transfers", motion.name), Mode::Lines)
                .line(Line::new().width(4.0).dash(DashType::Dot).color(color))
                .hover_info(HoverInfo::Name),
        );
    }
    plot.add_trace(
        Cloud::new([Some(at(0))])
            .trace(&format!("{}, start", motion.name), Mode::Markers)
            .marker(
                Marker::new()
                    .size(7)
                    .symbol(MarkerSymbol::Diamond)
                    .color(color)
                    .line(Line::new().width(1.0).color(NamedColor::White)),
            )
            .show_legend(false)
            .hover_info(HoverInfo::Name),
    );
}

/// Whether the pad is on the surface at a sample.
fn touches(motion: &Motion, sample: usize) -> bool {
    motion.contact.is_empty() || motion.contact.get(sample).copied().unwrap_or(true)
}

/// At most `most` of the points, the first and last among them.
fn thin(points: &[Point3<f64>], most: usize) -> impl Iterator<Item = Point3<f64>> {
    let shown = points.len().min(most);
    (0..shown).map(move |k| points[k * (points.len() - 1) / (shown - 1).max(1)])
}

/// Coordinates apart, as the plots want them, to a tenth of a millimetre; a gap is a null.
pub(super) struct Cloud {
    x: Vec<Option<f64>>,
    y: Vec<Option<f64>>,
    z: Vec<Option<f64>>,
}

impl Cloud {
    pub(super) fn new(points: impl IntoIterator<Item = Option<Point3<f64>>>) -> Self {
        let mut cloud = Self { x: Vec::new(), y: Vec::new(), z: Vec::new() };
        let round = |value: f64| (value * 1e4).round() / 1e4;
        for point in points {
            cloud.x.push(point.map(|p| round(p.x)));
            cloud.y.push(point.map(|p| round(p.y)));
            cloud.z.push(point.map(|p| round(p.z)));
        }
        cloud
    }

    pub(super) fn trace(
        self,
        name: &str,
        mode: Mode,
    ) -> Box<Scatter3D<Option<f64>, Option<f64>, Option<f64>>> {
        Scatter3D::new(self.x, self.y, self.z).name(escaped(name)).mode(mode)
    }
}
