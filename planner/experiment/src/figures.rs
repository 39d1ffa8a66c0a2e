//! The paper's figures 2, 4, 6 and 7, as SVG.

use std::path::{Path, PathBuf};

use nalgebra::{Point3, Rotation3, Vector3};
use nullsweep_planner::plan::Method;
use nullsweep_planner::tour::formulation;
use nullsweep_planner::workcell::direction;
use plotters::backend::SVGBackend;
use plotters::coord::Shift;
use plotters::drawing::{DrawingArea, IntoDrawingArea};
use plotters::element::{Circle, PathElement, Rectangle, Text};
use plotters::style::{Color, IntoFont, RGBColor, ShapeStyle, WHITE};

use crate::methods::MethodRun;
use crate::setting::Setting;

/// Why a figure could not be drawn.
#[derive(Debug, thiserror::Error)]
#[error("{}: the figure cannot be drawn: {reason}", path.display())]
pub struct FigureError {
    /// The file.
    path: PathBuf,
    /// What the plotting library said.
    reason: String,
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), String>;

const PANEL: u32 = 420;
const CAPTION: u32 = 30;
/// Scanned points shown at most.
const POINTS: usize = 1200;

const INK: RGBColor = RGBColor(38, 50, 66);
const FAINT: RGBColor = RGBColor(176, 186, 198);
const RED: RGBColor = RGBColor(204, 51, 51);
const COLORS: [RGBColor; 4] = [
    RGBColor(120, 130, 142),
    RGBColor(226, 138, 36),
    RGBColor(28, 110, 180),
    RGBColor(46, 140, 90),
];

/// Writes all figures into a directory; returns their paths.
///
/// # Errors
/// When a file cannot be written.
pub fn write(
    directory: &Path,
    name: &str,
    setting: &Setting,
    runs: &[(Method, MethodRun)],
) -> Result<Vec<PathBuf>, FigureError> {
    let view = View::new(setting);
    let mut written = Vec::new();
    let mut figure = |what: &str, size: (u32, u32), draw: &dyn Fn(&Area<'_>) -> Drawn| {
        let path = directory.join(format!("{name}-{what}.svg"));
        let result = {
            let area = SVGBackend::new(&path, size).into_drawing_area();
            let background = area.fill(&WHITE).map_err(said);
            background.and_then(|()| draw(&area)).and_then(|()| area.present().map_err(said))
        };
        match result {
            Ok(()) => {
                written.push(path);
                Ok(())
            }
            Err(reason) => Err(FigureError { path, reason }),
        }
    };
    figure("process", (2 * PANEL, 2 * (PANEL + CAPTION)), &|area| {
        process(area, setting, runs, &view)
    })?;
    figure("joints", (2 * PANEL, PANEL), &|area| joints(area, setting, runs))?;
    let panels = runs.len().max(1) as u32;
    figure("paths", (panels * PANEL, PANEL + CAPTION), &|area| paths(area, setting, runs, &view))?;
    Ok(written)
}

/// Figure 2: the object, its patches with normals, the graph and a solution.
fn process(area: &Area<'_>, setting: &Setting, runs: &[(Method, MethodRun)], view: &View) -> Drawn {
    let panels = area.split_evenly((2, 2));
    let stride = setting.scan.points.len().div_ceil(POINTS).max(1);
    caption(&panels[0], "(a) scanned points")?;
    for point in setting.scan.points.iter().step_by(stride) {
        dot(&panels[0], view.at(point), 1, INK)?;
    }
    caption(&panels[1], "(b) patches and normals; red: not reached")?;
    for (patch, reached) in setting.patches.iter().zip(&setting.reached) {
        let color = if reached.is_some() { COLORS[2] } else { RED };
        dot(&panels[1], view.at(&patch.centre), 3, color)?;
        let tip = patch.centre + patch.normal.into_inner() * 0.04;
        line(&panels[1], vec![view.at(&patch.centre), view.at(&tip)], INK, 1)?;
    }
    caption(&panels[2], "(c) Euclidean graph")?;
    graph(&panels[2], setting, view, INK)?;
    caption(&panels[3], "(d) Joint-GTSP's solution")?;
    graph(&panels[3], setting, view, FAINT)?;
    match runs.iter().find(|(method, _)| *method == Method::Joint) {
        Some((_, run)) => path(&panels[3], setting, run, view, COLORS[2]),
        None => Ok(()),
    }
}

/// Figure 4: displacement of each joint along the whole path.
fn joints(area: &Area<'_>, setting: &Setting, runs: &[(Method, MethodRun)]) -> Drawn {
    let dof = setting.arm.dof();
    let continuous = setting.arm.continuous();
    let moved: Vec<Vec<f64>> = runs
        .iter()
        .map(|(_, run)| {
            let mut sums = vec![0.0; dof];
            for pair in run.path.windows(2) {
                let d = continuous.displacement(&pair[0].1, &pair[1].1);
                sums.iter_mut().zip(&d).for_each(|(sum, d)| *sum += d);
            }
            sums
        })
        .collect();
    let most = moved.iter().flatten().copied().fold(1e-9, f64::max);
    let (width, height) = (2 * PANEL as i32, PANEL as i32);
    let (left, base, top) = (60, height - 50, 60);
    let scale = f64::from(base - top) / most;
    let step = nice(most / 5.0);
    for k in 0..=(most / step) as usize {
        let value = k as f64 * step;
        let y = base - (value * scale) as i32;
        line(area, vec![(left, y), (width - 20, y)], FAINT, 1)?;
        text(area, &format!("{value:.0}"), (left - 34, y - 7), 14)?;
    }
    text(area, "displacement over the whole path [rad]", (left, 14), 15)?;
    let group = (width - 20 - left) / dof as i32;
    let bar = group / (runs.len() as i32 + 1);
    for j in 0..dof {
        let x = left + j as i32 * group + bar / 2;
        for (m, ((method, _), sums)) in runs.iter().zip(&moved).enumerate() {
            let from = x + m as i32 * bar;
            let corners = [(from, base - (sums[j] * scale) as i32), (from + bar - 2, base)];
            area.draw(&Rectangle::new(corners, color(*method).filled())).map_err(said)?;
        }
        text(area, &format!("q{}", j + 1), (x + group / 4, base + 8), 15)?;
    }
    for (m, (method, _)) in runs.iter().enumerate() {
        let at = (left + 330 + 150 * m as i32, 14);
        let swatch = Rectangle::new([at, (at.0 + 12, at.1 + 12)], color(*method).filled());
        area.draw(&swatch).map_err(said)?;
        text(area, label(*method), (at.0 + 18, at.1), 15)?;
    }
    Ok(())
}

/// Figures 6 and 7: the paths of the methods side by side.
fn paths(area: &Area<'_>, setting: &Setting, runs: &[(Method, MethodRun)], view: &View) -> Drawn {
    for (panel, (method, run)) in area.split_evenly((1, runs.len().max(1))).iter().zip(runs) {
        caption(panel, label(*method))?;
        for patch in &setting.patches {
            dot(panel, view.at(&patch.centre), 2, FAINT)?;
        }
        path(panel, setting, run, view, color(*method))?;
        // The pad's long side at each pose: its heading.
        for (stop, _) in &run.path {
            let contact = formulation::pose(&setting.patches, &setting.tool, stop);
            let normal = &setting.patches[stop.patch].normal;
            let across = normal.cross(&direction(normal, stop.heading)) * 0.015;
            let centre = Point3::from(contact.translation.vector);
            line(panel, vec![view.at(&(centre - across)), view.at(&(centre + across))], INK, 1)?;
        }
    }
    Ok(())
}

fn graph(panel: &Area<'_>, setting: &Setting, view: &View, color: RGBColor) -> Drawn {
    for edge in &setting.graph.edges {
        let ends = [edge.a, edge.b].map(|p| view.at(&setting.patches[p].centre));
        line(panel, ends.to_vec(), color, 1)?;
    }
    for (patch, reached) in setting.patches.iter().zip(&setting.reached) {
        let color = if reached.is_some() { INK } else { RED };
        dot(panel, view.at(&patch.centre), 2, color)?;
    }
    Ok(())
}

/// The tour; jumps are thin.
fn path(
    panel: &Area<'_>,
    setting: &Setting,
    run: &MethodRun,
    view: &View,
    color: RGBColor,
) -> Drawn {
    for pair in run.path.windows(2) {
        let [a, b] = [pair[0].0.patch, pair[1].0.patch];
        let ends = [a, b].map(|p| view.at(&setting.patches[p].centre));
        match setting.graph.between(a, b) {
            Some(_) => line(panel, ends.to_vec(), color, 3)?,
            None => line(panel, ends.to_vec(), RED, 1)?,
        }
    }
    if let Some((first, _)) = run.path.first() {
        dot(panel, view.at(&setting.patches[first.patch].centre), 6, color)?;
    }
    Ok(())
}

/// Looks at the object from above the robot, in parallel projection.
struct View {
    turn: Rotation3<f64>,
    middle: [f64; 2],
    scale: f64,
}

impl View {
    fn new(setting: &Setting) -> Self {
        let points = &setting.scan.points;
        let sum = points.iter().fold(Vector3::zeros(), |sum, p| sum + p.coords);
        let centre = sum / points.len().max(1) as f64;
        // From aside, so that an upright back and a level seat both show.
        let from = Vector3::new(-centre.x, -centre.y, 0.0).normalize();
        let aside = Vector3::z().cross(&from);
        let eye = from + aside * 0.5 + Vector3::z();
        let turn = Rotation3::face_towards(&-eye, &Vector3::z()).inverse();
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for point in points {
            let p = turn * point;
            for (axis, value) in [-p.x, -p.y].into_iter().enumerate() {
                low[axis] = low[axis].min(value);
                high[axis] = high[axis].max(value);
            }
        }
        let extent = (high[0] - low[0]).max(high[1] - low[1]).max(1e-6);
        Self {
            turn,
            middle: [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])],
            scale: f64::from(PANEL - 50) / extent,
        }
    }

    /// Pixel of a panel.
    fn at(&self, point: &Point3<f64>) -> (i32, i32) {
        let p = self.turn * point;
        let middle = f64::from(PANEL) * 0.5;
        let x = middle + (-p.x - self.middle[0]) * self.scale;
        let y = middle + (-p.y - self.middle[1]) * self.scale;
        (x.round() as i32, y.round() as i32 + CAPTION as i32)
    }
}

fn dot(area: &Area<'_>, at: (i32, i32), radius: i32, color: RGBColor) -> Drawn {
    area.draw(&Circle::new(at, radius, color.filled())).map_err(said)
}

fn line(area: &Area<'_>, points: Vec<(i32, i32)>, color: RGBColor, width: u32) -> Drawn {
    let style = ShapeStyle { color: color.to_rgba(), filled: false, stroke_width: width };
    area.draw(&PathElement::new(points, style)).map_err(said)
}

fn text(area: &Area<'_>, words: &str, at: (i32, i32), size: u32) -> Drawn {
    let font = ("sans-serif", size).into_font().color(&INK);
    area.draw(&Text::new(words.to_owned(), at, font)).map_err(said)
}

fn caption(panel: &Area<'_>, words: &str) -> Drawn {
    text(panel, words, (14, 10), 16)
}

fn color(method: Method) -> RGBColor {
    match method {
        Method::Tsp => COLORS[0],
        Method::Curvature => COLORS[1],
        Method::Joint => COLORS[2],
        Method::Raster => COLORS[3],
    }
}

fn label(method: Method) -> &'static str {
    match method {
        Method::Tsp => "TSP",
        Method::Curvature => "Curvature-GTSP",
        Method::Joint => "Joint-GTSP",
        Method::Raster => "raster",
    }
}

/// The least of 1, 2, 5 · 10^k that is not below a value.
fn nice(value: f64) -> f64 {
    let power = libm::pow(10f64, libm::log10(value).floor());
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * power).find(|&v| v >= value).unwrap_or(value)
}

fn said(error: impl std::fmt::Display) -> String {
    error.to_string()
}
