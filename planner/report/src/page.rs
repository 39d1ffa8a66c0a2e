//! The page around the plots.

use std::fmt::Write as _;
use std::path::Path;

use plotly::Plot;

use crate::data::{ReportData, ReportError, Table};
use crate::style::escaped;
use crate::{joints, scene};

/// Height of one joint's curve. \[px\]
const ROW_HEIGHT: usize = 150;

const STYLE: &str = "
:root { color-scheme: light; }
body { font: 15px/1.5 system-ui, 'DejaVu Sans', sans-serif; color: #1c2430; background: #fff;
       margin: 0 auto; padding: 1.2rem 1.6rem 3rem; max-width: 1500px; }
h1 { font-size: 1.6rem; margin: 0; }
h2 { font-size: 1.15rem; margin: 2rem 0 .4rem; }
p.subtitle, p.note { color: #5b6675; margin: .2rem 0 .6rem; }
.tables { display: flex; flex-wrap: wrap; gap: 1rem 2.5rem; align-items: flex-start; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
caption { text-align: left; font-weight: 600; padding: .3rem 0; }
th, td { text-align: right; padding: .16rem .7rem; border-bottom: 1px solid #e4e8ed; }
th:first-child, td:first-child { text-align: left; padding-left: 0; }
thead th { border-bottom: 2px solid #b8c0cb; }
.plot { border: 1px solid #e4e8ed; border-radius: 6px; overflow: hidden; }
";

/// Writes the report to a file.
///
/// # Errors
/// [`ReportError`] if the data do not fit together or the file cannot be written.
pub fn write(path: &Path, data: &ReportData) -> Result<(), ReportError> {
    let page = render(data)?;
    std::fs::write(path, page).map_err(|source| ReportError::Io { path: path.into(), source })
}

/// The report as one HTML page, the plotting library included.
///
/// # Errors
/// [`ReportError::Length`] if lists that run parallel do not.
pub fn render(data: &ReportData) -> Result<String, ReportError> {
    data.check()?;
    let mut page = head(&data.title, &data.subtitle, &data.tables);
    page.push_str(
        "<h2>Surface and tool path</h2>\n<p class=\"note\">Drag to turn, scroll to zoom; a click \
         on the legend hides or shows (the graph is hidden at first). Thick lines are contact, \
         dotted ones transfers through the air, diamonds the starts. Red squares are patches that \
         cannot be reached; point at one for the reason. Marks and paths are drawn 6 mm off the \
         surface, or the scan would hide them.</p>\n",
    );
    push_plot(&mut page, &scene::plot(data), "scene", "height: 78vh; min-height: 480px");

    for (index, (plot, rows)) in joints::plots(data).iter().enumerate() {
        if index == 0 {
            page.push_str(
                "<h2>Joints over time</h2>\n<p class=\"note\">Dashed red: soft limits. Grey \
                 bands: transfers of the first plan.</p>\n",
            );
        }
        let height = format!("height: {}px", rows * ROW_HEIGHT + 90);
        push_plot(&mut page, plot, &format!("joints{index}"), &height);
    }
    page.push_str("</body>\n</html>\n");
    Ok(page)
}

/// How every page begins, with the plotting library, its heading and tables.
pub(super) fn head(title: &str, subtitle: &str, tables: &[Table]) -> String {
    let mut page = String::with_capacity(8 << 20);
    let title = escaped(title);
    page.push_str("<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n");
    page.push_str("<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n");
    let _ = writeln!(page, "<title>{title}</title>\n<style>{STYLE}</style>");
    page.push_str(&library());
    let _ = writeln!(page, "</head>\n<body>\n<h1>{title}</h1>");
    let _ = writeln!(page, "<p class=\"subtitle\">{}</p>", escaped(subtitle));
    page.push_str("<div class=\"tables\">\n");
    for table in tables {
        push_table(&mut page, table);
    }
    page.push_str("</div>\n");
    page
}

/// The plotting library alone: its sources come with a formula typesetter of 2 MB behind it, which
/// no label here needs.
fn library() -> String {
    const END: &str = "</script>";
    let mut sources = Plot::offline_js_sources();
    if let Some(at) = sources.find(END) {
        sources.truncate(at + END.len());
    }
    sources.push('\n');
    sources
}

pub(super) fn push_plot(page: &mut String, plot: &Plot, id: &str, style: &str) {
    let _ = writeln!(page, "<div class=\"plot\" style=\"{style}\">");
    page.push_str(&plot.to_inline_html(Some(id)));
    page.push_str("\n</div>\n");
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
