//! The page of a room: its planes and objects in one picture.

use std::path::Path;

use nalgebra::Point3;
use plotly::Plot;
use plotly::common::{HoverInfo, Line, Marker, Mode};

use crate::data::{ReportError, Table};
use crate::page;
use crate::scene::{self, Cloud};

/// A room to be shown. All points in one frame, z up. \[m\]
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RoomData {
    /// Heading of the page.
    pub title: String,
    /// A line under it.
    pub subtitle: String,
    /// Tables, in order.
    pub tables: Vec<Table>,
    /// Clouds of points by name, each in a colour of its own but the last, which is grey.
    pub clouds: Vec<(String, Vec<Point3<f64>>)>,
    /// Closed lines by name.
    pub outlines: Vec<(String, Vec<Point3<f64>>)>,
}

/// Most points shown of one cloud.
const MAX_POINTS: usize = 6_000;

/// Colours that stay apart for the colour-blind (after Okabe & Ito).
const COLOURS: [&str; 7] =
    ["#e69f00", "#0072b2", "#009e73", "#cc79a7", "#d55e00", "#56b4e9", "#8a7a00"];
const GREY: &str = "#b8bfc8";
const OUTLINE: &str = "#1c2430";

/// Writes the page to a file. It opens without a network.
///
/// # Errors
/// [`ReportError::Io`] if the file cannot be written.
pub fn write_room(path: &Path, data: &RoomData) -> Result<(), ReportError> {
    let mut text = page::head(&data.title, &data.subtitle, &data.tables);
    text.push_str(
        "<h2>Planes and objects</h2>\n<p class=\"note\">Drag to turn, scroll to zoom; a click on \
         the legend hides or shows.</p>\n",
    );
    page::push_plot(&mut text, &plot(data), "room", "height: 78vh; min-height: 480px");
    text.push_str("</body>\n</html>\n");
    std::fs::write(path, text).map_err(|source| ReportError::Io { path: path.into(), source })
}

fn plot(data: &RoomData) -> Plot {
    let mut plot = Plot::new();
    let last = data.clouds.len().saturating_sub(1);
    for (i, (name, points)) in data.clouds.iter().enumerate() {
        let stride = points.len().div_ceil(MAX_POINTS).max(1);
        let color = if i == last { GREY } else { COLOURS[i % COLOURS.len()] };
        plot.add_trace(
            Cloud::new(points.iter().step_by(stride).map(|p| Some(*p)))
                .trace(name, Mode::Markers)
                .marker(Marker::new().size(2).color(color))
                .hover_info(HoverInfo::Name),
        );
    }
    for (name, corners) in &data.outlines {
        let closed = corners.iter().chain(corners.first()).map(|p| Some(*p));
        plot.add_trace(
            Cloud::new(closed)
                .trace(name, Mode::Lines)
                .line(Line::new().width(3.0).color(OUTLINE))
                .hover_info(HoverInfo::Name),
        );
    }
    scene::lay_out(&mut plot);
    plot
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cloud_and_outline_is_on_the_page() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("room.html");
        let at = |x: f64| Point3::new(x, 0.0, 0.0);
        let data = RoomData {
            title: "A <room>".into(),
            clouds: vec![("object 1".into(), vec![at(0.5)]), ("rest".into(), vec![at(2.25)])],
            outlines: vec![("floor".into(), vec![at(0.0), at(7.125)])],
            ..RoomData::default()
        };
        write_room(&path, &data).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        for part in ["A &lt;room&gt;", "object 1", "2.25", "floor", "7.125"] {
            assert!(text.contains(part), "{part} is not on the page");
        }
        // Plotly's own script, which is in the page, has addresses in its strings.
        for outside in ["<script src=", "<script async src=", "<link rel"] {
            assert!(!text.contains(outside), "the page needs a network: {outside}");
        }
    }
}
