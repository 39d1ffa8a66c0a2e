//! Tables for people: as wide as the terminal is, or 80 columns.

use std::io::IsTerminal;

use comfy_table::presets::UTF8_FULL_CONDENSED;
use comfy_table::{ContentArrangement, Row, Table};

/// The width where there is no terminal.
const WIDTH: u16 = 80;

/// Columns that the name of a row takes before it is folded here.
const NAME: usize = 34;

/// A row's name, folded so that what goes on stands as deep as what it goes on with.
pub(super) fn folded(name: &str) -> String {
    let rest = name.trim_start();
    let indent = &name[..name.len() - rest.len()];
    let mut lines = vec![String::from(indent)];
    for word in rest.split(' ') {
        let last = lines.len() - 1;
        let line = &mut lines[last];
        if line.len() == indent.len() {
            line.push_str(word);
        } else if line.chars().count() + 1 + word.chars().count() <= NAME {
            line.push(' ');
            line.push_str(word);
        } else {
            lines.push(format!("{indent}{word}"));
        }
    }
    lines.join("\n")
}

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
    fn a_long_name_keeps_its_indent() {
        assert_eq!(folded("points"), "points");
        let long = "  r_upper_arm_roll_link meets the table of the scene";
        assert_eq!(folded(long), "  r_upper_arm_roll_link meets the\n  table of the scene");
        let mut table = sheet(["figure", "value"]);
        table.set_width(80).add_row([&folded(long), &"many points ".repeat(9)]);
        let text = table.to_string();
        assert!(text.contains("│   table of the scene"), "{text}");
    }

    #[test]
    fn long_cells_are_folded() {
        let mut table = sheet(["figure", "value"]);
        table.set_width(40).add_row(["against", &"many points of unseen space ".repeat(6)]);
        let text = table.to_string();
        assert!(text.lines().all(|line| line.chars().count() <= 40), "{text}");
        assert!(text.contains("against") && text.matches("unseen").count() == 6, "{text}");
    }
}
