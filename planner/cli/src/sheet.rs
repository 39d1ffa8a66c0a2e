//! Tables for people: as wide as the terminal is, or 80 columns.

use std::io::IsTerminal;

use comfy_table::presets::UTF8_FULL_CONDENSED;
use comfy_table::{ContentArrangement, Row, Table};

/// The width where there is no terminal.
const WIDTH: u16 = 80;

/// An empty table with these columns.
pub(super) fn sheet(header: impl Into<Row>) -> Table {
    let mut table = Table::new();
    table
        .load_style(UTF8_FULL_CONDENSED)
        .set_content_arrangement(ContentArrangement::Dynamic)
        .set_header(header);
    if !std::io::stdout().is_terminal() {
        table.set_width(WIDTH);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_cells_are_folded() {
        let mut table = sheet(["figure", "value"]);
        table.set_width(40).add_row(["against", &"many points of unseen space ".repeat(6)]);
        let text = table.to_string();
        assert!(text.lines().all(|line| line.chars().count() <= 40), "{text}");
        assert!(text.contains("against") && text.matches("unseen").count() == 6, "{text}");
    }
}
