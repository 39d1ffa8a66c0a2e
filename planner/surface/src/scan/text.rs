//! Tables of points as plain text: a point a line, its numbers apart by blanks, tabs, commas or
//! semicolons.

use nalgebra::{Point3, Vector3};

use super::colour::of_columns;
use super::columns::Columns;
use super::decode::decode;
use super::error::{Malformed, Place, malformed};
use super::parsed::Parsed;
use super::rows::{Cells, is_comment, without_mark};
use super::warning::{Rest, ScanWarning};

/// Rows that are looked at to learn how the table is made.
const SAMPLE: usize = 100;

/// The columns' names, in a line before the rows or in a comment there, decide which columns are
/// x, y, z and the normal. Without names the first three are x, y, z, and of six columns the last
/// three the normal, if they are unit vectors or zero; that is told. A row without a number for x,
/// y or z is a point with a NaN. A line with one whole number before the rows is their number.
pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, Malformed> {
    let mut parsed = Parsed::default();
    let content = decode(bytes, &mut parsed.warnings)?;
    let Some(table) = Table::learn(&content, &mut parsed.warnings)? else { return Ok(parsed) };
    let (mut cells, mut colours) = (Vec::new(), Vec::new());
    for (index, line) in content.lines().enumerate().skip(table.from) {
        if line.trim().is_empty() || is_comment(line) || Some(line) == table.heading {
            continue;
        }
        table.cells.split(line, &mut cells);
        if table.announced.is_some() && is_count(&cells) {
            continue;
        }
        table.row(&cells, Place::Line(index + 1), &mut parsed, &mut colours)?;
    }
    parsed.colours = of_columns(&colours);
    if let Some(announced) = table.announced.filter(|&n| n != parsed.points.len()) {
        let found = parsed.points.len();
        parsed.warnings.push(ScanWarning::CountDiffers { announced, found });
    }
    if !table.named {
        table.judge_unnamed(&mut parsed);
    }
    Ok(parsed)
}

/// How a table is made.
struct Table<'a> {
    cells: Cells,
    columns: Columns,
    /// Whether names told the columns.
    named: bool,
    /// The line with the names, where it is no comment; files put together have it again.
    heading: Option<&'a str>,
    /// Index of the first line that is a row.
    from: usize,
    /// Cells in the first row.
    width: usize,
    /// How many rows a count line announces.
    announced: Option<usize>,
}

impl<'a> Table<'a> {
    /// Learns from what stands before the rows, and from the first of them; `None` without a row.
    fn learn(content: &'a str, warnings: &mut Vec<ScanWarning>) -> Result<Option<Self>, Malformed> {
        let mut lines = content.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
        let mut before: Vec<(usize, &str)> = Vec::new();
        let mut announced = None;
        let first = loop {
            let Some((index, line)) = lines.next() else {
                return match before.iter().rfind(|(_, line)| !is_comment(line)) {
                    Some((index, line)) => no_rows(*index, line),
                    None => Ok(None),
                };
            };
            if is_comment(line) || Cells::guess(&[line]).is_heading(line) {
                before.push((index, line));
            } else if let Some(count) = count_of(line) {
                announced = Some(count);
            } else {
                break (index, line);
            }
        };
        let rows: Vec<&str> = std::iter::once(first.1)
            .chain(lines.map(|(_, line)| line).filter(|line| !is_comment(line)))
            .filter(|line| announced.is_none() || count_of(line).is_none())
            .take(SAMPLE)
            .collect();
        let cells = Cells::guess(&rows);
        let mut split = Vec::new();
        cells.split(rows[0], &mut split);
        let mut table = Self {
            width: split.len(),
            cells,
            columns: Columns::in_order(0, false),
            named: false,
            heading: None,
            from: first.0,
            announced,
        };
        let named = |table: &mut Self, warnings: &mut Vec<ScanWarning>| {
            for &(index, line) in before.iter().rev() {
                if table.names(line, &rows, Place::Line(index + 1), warnings)? {
                    return Ok(Some(index));
                }
            }
            Ok(None)
        };
        let names = named(&mut table, warnings)?;
        for &(index, line) in
            before.iter().filter(|(i, line)| Some(*i) != names && !is_comment(line))
        {
            if names.is_none() && table.names_all_columns(line) {
                return no_names(index, line);
            }
            warnings.push(ScanWarning::LineSkipped { place: Place::Line(index + 1) });
        }
        if names.is_none() {
            table.unnamed(&rows, first.0, warnings)?;
        }
        Ok(Some(table))
    }

    /// Takes the columns' names from a line, if they are there.
    fn names(
        &mut self,
        line: &'a str,
        rows: &[&str],
        place: Place,
        warnings: &mut Vec<ScanWarning>,
    ) -> Result<bool, Malformed> {
        let comment = is_comment(line);
        // "X [m] Y [m]" are two names.
        let text = without_mark(line).replace(" [", "[").replace(" (", "(");
        let text = text.split_once(": ").map_or(text.as_str(), |(_, after)| after);
        for cells in self.cells.others() {
            let mut names = Vec::new();
            cells.split(text, &mut names);
            let mut told = Vec::new();
            let Some(columns) = Columns::named(&names, &mut told) else { continue };
            let one_short = names.len() + 1 == self.width;
            // Prose may name x, y and z too, but not once for each column.
            if comment && names.len() != self.width && !one_short {
                continue;
            }
            warnings.extend(told);
            self.columns = columns;
            self.named = true;
            self.heading = (!comment).then_some(line);
            if one_short && self.cells.counts_up(rows) {
                self.columns = columns.shifted();
                warnings.push(ScanWarning::IndexColumn);
            } else if one_short && self.cells.ascends(rows) {
                let cause = format!(
                    "{} names over {} columns, the first of which ascends: is it x or an index?",
                    names.len(),
                    self.width
                );
                return malformed(place, cause);
            } else if names.len() != self.width {
                let (names, columns) = (names.len(), self.width);
                warnings.push(ScanWarning::OtherNames { names, columns });
            }
            return Ok(true);
        }
        Ok(false)
    }

    /// Whether a line has a word for each column, so that it is no title.
    fn names_all_columns(&self, line: &str) -> bool {
        let mut names = Vec::new();
        self.cells.split(line, &mut names);
        names.len() == self.width
    }

    /// Takes the columns in their order.
    fn unnamed(
        &mut self,
        rows: &[&str],
        line: usize,
        warnings: &mut Vec<ScanWarning>,
    ) -> Result<(), Malformed> {
        let mut first = self.cells.leading_empty(rows);
        if self.width > first + 3 && self.cells.counts_up(rows) {
            warnings.push(ScanWarning::IndexColumn);
            first = 1;
        }
        if self.width < first + 3 {
            let cause = format!("{} columns where x, y, z are needed", self.width);
            return malformed(Place::Line(line + 1), cause);
        }
        self.columns = Columns::in_order(first, self.width == first + 6);
        Ok(())
    }

    /// Adds a row's point.
    fn row(
        &self,
        cells: &[&str],
        place: Place,
        parsed: &mut Parsed,
        colours: &mut Vec<[f64; 3]>,
    ) -> Result<(), Malformed> {
        let Columns { position, factors, normal, colour } = self.columns;
        let last = position[0].max(position[1]).max(position[2]);
        // Between blanks an empty cell cannot be seen, so all behind it may have moved up.
        let needed = if self.cells.are_blank() { self.width.max(last + 1) } else { last + 1 };
        if cells.len() < needed {
            let cause = format!("{} numbers where {needed} are needed", cells.len());
            return malformed(place, cause);
        }
        let value = |column: usize| match cells.get(column) {
            None => Ok(f64::NAN),
            Some(cell) => self
                .cells
                .number(cell)
                .ok_or_else(|| Malformed { place, cause: format!("{cell:?} is not a number") }),
        };
        let [x, y, z] = position;
        let [fx, fy, fz] = factors;
        parsed.points.push(Point3::new(value(x)? * fx, value(y)? * fy, value(z)? * fz));
        if let Some([x, y, z]) = normal {
            parsed.normals.push(Vector3::new(value(x)?, value(y)?, value(z)?));
        }
        if let Some(rgb) = colour {
            // What is no number there does not spoil the point.
            colours.push(rgb.map(|column| value(column).unwrap_or(f64::NAN)));
        }
        Ok(())
    }

    /// Says what columns without names were taken for; what is no direction is no normal.
    fn judge_unnamed(&self, parsed: &mut Parsed) {
        let first = self.columns.position[0];
        let columns = self.width - first;
        if columns == 3 {
            return;
        }
        let rest = if self.columns.normal.is_none() {
            Rest::Ignored
        } else if are_directions(&parsed.normals) {
            Rest::Normals
        } else {
            let rgb = std::mem::take(&mut parsed.normals);
            parsed.colours = of_columns(&rgb.into_iter().map(Into::into).collect::<Vec<_>>());
            Rest::Colour
        };
        parsed.warnings.push(ScanWarning::Unnamed { first: first + 1, rest });
    }
}

/// Whether all vectors are of unit length, to the two decimals that some programs write, or none.
fn are_directions(vectors: &[Vector3<f64>]) -> bool {
    let none = |v: &Vector3<f64>| v.iter().all(|c| *c == 0.0 || c.is_nan());
    vectors.iter().all(|v| none(v) || (v.norm() - 1.0).abs() < 0.02) && !vectors.iter().all(none)
}

fn is_count(cells: &[&str]) -> bool {
    matches!(cells, [one] if one.parse::<usize>().is_ok())
}

/// The one whole number of a line.
fn count_of(line: &str) -> Option<usize> {
    line.trim().parse().ok()
}

fn no_rows<T>(index: usize, line: &str) -> Result<T, Malformed> {
    let last: String = line.trim().chars().take(80).collect();
    malformed(Place::Line(index + 1), format!("no row of numbers follows {last:?}"))
}

fn no_names<T>(index: usize, line: &str) -> Result<T, Malformed> {
    let names: String = line.trim().chars().take(80).collect();
    malformed(
        Place::Line(index + 1),
        format!("no columns x, y, z are named in {names:?}: name them so in this line"),
    )
}
