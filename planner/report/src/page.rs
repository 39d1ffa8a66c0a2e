//! The page around the data.

use std::fmt::Write as _;
use std::path::Path;

use crate::data::{Headline, ReportData, ReportError, Table, Tone};
use crate::wire;

const STYLE: &str = include_str!("../assets/page.css");
/// In this order: each file uses only what stands before it.
const SCRIPTS: [&str; 3] = [
    include_str!("../assets/curves.js"),
    include_str!("../assets/space.js"),
    include_str!("../assets/page.js"),
];

const PLAYER: &str = r#"<div class="player">
<button id="play" title="Space">▶ Play</button>
<button id="back" title="stop before: ←" aria-label="to the stop before">|◀</button>
<button id="ahead" title="next stop: →" aria-label="to the next stop">▶|</button>
<input id="time" type="range" min="0" value="0" aria-label="time">
<select id="speed" aria-label="speed"><option value="0.1">× 0.1</option><option value="0.25">× 0.25</option><option value="0.5">× 0.5</option><option value="1" selected>× 1</option><option value="2">× 2</option><option value="5">× 5</option><option value="10">× 10</option></select>
<label>knot <input id="knot" type="number" min="0" aria-label="go to knot"></label>
<select id="colour" aria-label="colour of the path"><option value="time">path by time</option><option value="press">path by press</option></select>
<output id="now"></output>
</div>
"#;

const CURVES: &str = r#"<section class="card curves">
<div class="tabs" id="tabs"><button data-tab="positions">Joints</button><button data-tab="velocities">Velocities</button><button data-tab="distances">Clearance and press</button></div>
<div class="plot" id="plot"><canvas></canvas><canvas></canvas></div>
</section>
"#;

const KEYS: &str = r#"<p class="keys"><kbd>Space</kbd> play · <kbd>←</kbd> <kbd>→</kbd> stop before, next · <kbd>,</kbd> <kbd>.</kbd> knot · <kbd>&lt;</kbd> <kbd>&gt;</kbd> speed · <kbd>n</kbd> <kbd>p</kbd> next, previous place of the list · <kbd>f</kbd> see all · <kbd>Shift</kbd> with arrows turn · <kbd>+</kbd> <kbd>-</kbd> zoom · <kbd>t</kbd> dark or light. Drag turns, right button or two fingers shift, wheel or pinch zooms.</p>
"#;

/// Writes the report to a file.
///
/// # Errors
/// [`ReportError`] if the data do not fit together or the file cannot be written.
pub fn write(path: &Path, data: &ReportData) -> Result<(), ReportError> {
    let page = render(data)?;
    std::fs::write(path, page).map_err(|source| ReportError::Io { path: path.into(), source })
}

/// The report as one HTML page that needs nothing else.
///
/// # Errors
/// [`ReportError::Length`] if lists that run parallel do not, [`ReportError::Index`] if something
/// hangs on what is not there.
pub fn render(data: &ReportData) -> Result<String, ReportError> {
    data.check()?;
    let mut page = String::with_capacity(1 << 20);
    let title = escaped(&data.title);
    page.push_str("<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n");
    page.push_str("<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n");
    page.push_str("<link rel=\"icon\" href=\"data:,\">\n");
    let _ = writeln!(page, "<title>{title}</title>\n<style>{STYLE}</style>\n</head>\n<body>");
    let _ = writeln!(page, "<header><h1>{title}</h1><p>{}</p>", escaped(&data.subtitle));
    page.push_str("<button id=\"theme\" title=\"t\">Dark</button></header>\n<main>\n");
    push_headline(&mut page, &data.headline);
    page.push_str("<ul class=\"notes\" id=\"notes\">");
    for note in &data.notes {
        let _ = write!(page, "<li>{}</li>", escaped(note));
    }
    page.push_str("</ul>\n");

    let alone = if data.places.is_empty() { " alone" } else { "" };
    let _ = writeln!(page, "<div class=\"stage{alone}\">\n<section class=\"card\">");
    page.push_str("<div class=\"view\"><canvas id=\"space\" tabindex=\"0\" aria-label=\"scene in 3D\"></canvas><div class=\"layers\" id=\"layers\"></div><div class=\"scale\" id=\"scale\"></div><div class=\"trouble\" id=\"trouble\" hidden></div></div>\n");
    if !data.plans.is_empty() {
        page.push_str(PLAYER);
    }
    page.push_str("</section>\n");
    if !data.places.is_empty() {
        let heading = if data.plans.is_empty() {
            "What is there"
        } else {
            "What is left <small>x, y, z from the robot's root</small>"
        };
        let _ = writeln!(
            page,
            "<section class=\"card places\" id=\"places\"><h2>{heading}</h2></section>"
        );
    }
    page.push_str("</div>\n");
    page.push_str(KEYS);
    if !data.plans.is_empty() {
        page.push_str(CURVES);
    }
    if !data.tables.is_empty() {
        page.push_str(
            "<details class=\"card\"><summary>All figures</summary><div class=\"tables\">\n",
        );
        data.tables.iter().for_each(|table| push_table(&mut page, table));
        page.push_str("</div></details>\n");
    }
    page.push_str("</main>\n");
    // No text of the data may end the element that holds them.
    let json = wire::value(data).to_string().replace('<', "\\u003c");
    let _ = writeln!(page, "<script type=\"application/json\" id=\"data\">{json}</script>");
    page.push_str("<script>\n'use strict';\n");
    SCRIPTS.iter().for_each(|script| page.push_str(script));
    page.push_str("</script>\n</body>\n</html>\n");
    Ok(page)
}

fn push_headline(page: &mut String, headline: &[Headline]) {
    page.push_str("<ul class=\"figures\">\n");
    for Headline { label, value, detail, tone } in headline {
        let class = match tone {
            Tone::Plain => "plain",
            Tone::Good => "good",
            Tone::Warn => "warn",
            Tone::Bad => "bad",
        };
        let (label, value, detail) = (escaped(label), escaped(value), escaped(detail));
        let _ = writeln!(
            page,
            "<li class=\"{class}\"><span>{label}</span><b>{value}</b><span>{detail}</span></li>"
        );
    }
    page.push_str("</ul>\n");
}

fn push_table(page: &mut String, table: &Table) {
    let _ = writeln!(page, "<table>\n<caption>{}</caption>", escaped(&table.title));
    let row = |cells: &[String], tag: &str| {
        let cells: String =
            cells.iter().map(|cell| format!("<{tag}>{}</{tag}>", escaped(cell))).collect();
        format!("<tr>{cells}</tr>\n")
    };
    if !table.columns.is_empty() {
        let _ = writeln!(page, "<thead>{}</thead>", row(&table.columns, "th"));
    }
    page.push_str("<tbody>\n");
    for cells in &table.rows {
        page.push_str(&row(cells, "td"));
    }
    page.push_str("</tbody>\n</table>\n");
}

/// Text as it may stand in HTML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
