//! Lines of a table and the cells in them.

use super::decode::number;

/// What begins a comment.
const MARKS: [&str; 3] = ["#", "//", "%"];

pub(super) fn is_comment(line: &str) -> bool {
    MARKS.iter().any(|mark| line.trim_start().starts_with(mark))
}

/// A line without the mark of a comment.
pub(super) fn without_mark(line: &str) -> &str {
    if is_comment(line) {
        line.trim_start().trim_start_matches(['#', '/', '%']).trim()
    } else {
        line
    }
}

/// What stands between the cells of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Between {
    /// Blanks and tabs, any number of them.
    Blanks,
    /// One character; two of them have an empty cell between them.
    Each(char),
    /// Commas, semicolons and blanks, any number of them.
    Any,
}

/// How cells stand in a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cells {
    between: Between,
    /// Numbers have a comma for a point.
    decimal_comma: bool,
}

impl Cells {
    /// How they stand in these lines.
    pub(super) fn guess(lines: &[&str]) -> Self {
        let with = |between| Self { between, decimal_comma: false };
        let has = |c: char| lines.iter().any(|line| line.contains(c));
        let commas = |cells: Self| Self { decimal_comma: cells.all_have_commas(lines), ..cells };
        if has(';') {
            return commas(with(Between::Each(';')));
        }
        if has(',') {
            let blanks = commas(with(Between::Blanks));
            if blanks.decimal_comma {
                return blanks;
            }
            let comma = with(Between::Each(','));
            let apart = |cell: &str| {
                let numbers = cell.split_ascii_whitespace().map(|part| number(part).is_some());
                numbers.clone().count() < 2 || !numbers.clone().all(|is| is)
            };
            return if comma.all(lines, apart) { comma } else { with(Between::Any) };
        }
        let tabs = with(Between::Each('\t'));
        let width = |line: &&str| line.matches('\t').count();
        let even = lines.windows(2).all(|pair| width(&pair[0]) == width(&pair[1]));
        if has('\t') && even && tabs.all(lines, |cell| !cell.contains(' ')) {
            return tabs;
        }
        with(Between::Blanks)
    }

    /// This way, then the other ways: a comment need not be written as the rows are.
    pub(super) fn others(self) -> impl Iterator<Item = Self> {
        let ways = [Between::Each(','), Between::Each(';'), Between::Each('\t'), Between::Blanks];
        let other = move |between| Self { between, ..self };
        std::iter::once(self).chain(ways.map(other).into_iter().filter(move |o| *o != self))
    }

    /// Whether an empty cell cannot be seen.
    pub(super) fn are_blank(self) -> bool {
        self.between == Between::Blanks
    }

    /// The cells of a line, without blanks and quotes around them.
    pub(super) fn split<'a>(self, line: &'a str, cells: &mut Vec<&'a str>) {
        cells.clear();
        match self.between {
            Between::Blanks => cells.extend(line.split_ascii_whitespace().map(unquoted)),
            Between::Any => {
                let parts = line.split([',', ';', ' ', '\t', '\r']);
                cells.extend(parts.map(unquoted).filter(|cell| !cell.is_empty()));
            }
            Between::Each(mark) => {
                let mut quoted = false;
                cells.extend(
                    line.split(|c| {
                        quoted ^= c == '"';
                        c == mark && !quoted
                    })
                    .map(unquoted),
                );
            }
        }
    }

    /// The number in a cell; NaN where it says that there is none, `None` where it holds no number.
    pub(super) fn number(self, cell: &str) -> Option<f64> {
        if self.decimal_comma { number(&cell.replace(',', ".")) } else { number(cell) }
    }

    /// Whether a line has words but no number.
    pub(super) fn is_heading(self, line: &str) -> bool {
        let mut cells = Vec::new();
        self.split(line, &mut cells);
        let mut numbers = cells.iter().map(|cell| self.number(cell));
        numbers.all(|n| n.is_none_or(f64::is_nan)) && cells.iter().any(|c| self.number(c).is_none())
    }

    /// Whether the first cells of the lines count up one by one, or are no numbers.
    pub(super) fn counts_up(self, lines: &[&str]) -> bool {
        let first: Vec<Option<f64>> = lines.iter().map(|line| self.first(line)).collect();
        let whole = |n: &Option<f64>| n.is_some_and(|n| n.fract() == 0.0);
        let next = |pair: &[Option<f64>]| pair[0].zip(pair[1]).is_some_and(|(a, b)| b == a + 1.0);
        let counts = first.len() > 2 && first.iter().all(whole) && first.windows(2).all(next);
        counts || first.iter().all(Option::is_none)
    }

    /// Whether the first cells of the lines ascend all along.
    pub(super) fn ascends(self, lines: &[&str]) -> bool {
        let first: Vec<Option<f64>> = lines.iter().map(|line| self.first(line)).collect();
        let up = |pair: &[Option<f64>]| pair[0].zip(pair[1]).is_some_and(|(a, b)| b > a);
        first.len() > 2 && first.windows(2).all(up)
    }

    fn first(self, line: &str) -> Option<f64> {
        let mut cells = Vec::new();
        self.split(line, &mut cells);
        cells.first().and_then(|cell| self.number(cell))
    }

    /// How many cells at the beginning are empty in all lines.
    pub(super) fn leading_empty(self, lines: &[&str]) -> usize {
        let empty = |line: &str| {
            let mut cells = Vec::new();
            self.split(line, &mut cells);
            cells.iter().take_while(|cell| cell.is_empty()).count()
        };
        lines.iter().map(|line| empty(line)).min().unwrap_or(0)
    }

    fn all(self, lines: &[&str], holds: impl Fn(&str) -> bool) -> bool {
        let mut cells = Vec::new();
        lines.iter().all(|line| {
            self.split(line, &mut cells);
            cells.iter().all(|cell| holds(cell))
        })
    }

    /// Whether some numbers are written with a comma, all others without comma and point, and three
    /// cells are there.
    fn all_have_commas(self, lines: &[&str]) -> bool {
        let mut cells = Vec::new();
        let mut some = false;
        let all = lines.iter().all(|line| {
            self.split(line, &mut cells);
            some |= cells.iter().any(|cell| cell.contains(','));
            cells.len() >= 3
                && cells.iter().all(|cell| {
                    cell.matches(',').count() <= 1
                        && !cell.starts_with(',')
                        && !cell.ends_with(',')
                        && (!cell.contains(',') || !cell.contains('.'))
                        && number(&cell.replace(',', ".")).is_some()
                })
        });
        all && some
    }
}

fn unquoted(cell: &str) -> &str {
    cell.trim().trim_matches(['"', '\'']).trim()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn split<'a>(lines: &[&'a str]) -> Vec<&'a str> {
        let mut cells = Vec::new();
        Cells::guess(lines).split(lines[0], &mut cells);
        cells
    }

    #[test]
    fn cells_are_told_apart_as_the_lines_are_written() {
        assert_eq!(split(&["1 2\t 3 "]), ["1", "2", "3"]);
        assert_eq!(split(&["1, 2,,3\r"]), ["1", "2", "", "3"]);
        assert_eq!(split(&["1,5;2;;3,25"]), ["1,5", "2", "", "3,25"]);
        assert_eq!(split(&["1\t\t3", "1\t2\t3"]), ["1", "", "3"]);
        assert_eq!(split(&["\"a,b\",1,2,3"]), ["a,b", "1", "2", "3"]);
        assert_eq!(split(&["1,5 2,5 -3,5"]), ["1,5", "2,5", "-3,5"]);
        assert_eq!(split(&["1, 2 3"]), ["1", "2", "3"]);
        assert_eq!(Cells::guess(&["1,5;2;3"]).number("1,5"), Some(1.5));
        assert_eq!(Cells::guess(&["1.5;2;3"]).number("1,5"), None);
    }
}
