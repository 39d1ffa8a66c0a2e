//! Reader of GTSPLIB and TSPLIB files.

use std::path::Path;
use std::sync::Arc;

use super::error::TsplibError;
use super::weights::{WeightFormat, WeightType};
use crate::instance::{CostFn, Costs, Ends, Instance, Jump, OnDemand};
use crate::tour::Tour;

/// Largest number of nodes whose explicit matrix is read: 3.6 GB as f64 would be too much to
/// promise.
const MOST_NODES: usize = 20_000;

/// An instance with the names that its file uses.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct GtspFile {
    /// `NAME`.
    pub name: String,
    /// The clusters in the order of their numbers, closed, jumps forbidden.
    pub instance: Instance,
    /// Node number in the file (from 1) of every node of every cluster.
    pub node_numbers: Vec<Vec<usize>>,
}

/// Reads a `.gtsp` (or `.tsp`, `.atsp`: every node a cluster) file.
///
/// # Errors
/// Where the file cannot be read, and as [`parse_gtsp`].
pub fn read_gtsp(path: impl AsRef<Path>) -> Result<GtspFile, TsplibError> {
    let path = path.as_ref();
    let bytes = std::fs::read(path)
        .map_err(|source| TsplibError::Io { path: path.to_owned(), reason: source.to_string() })?;
    parse_gtsp(&bytes)
}

/// Parses the bytes of such a file.
///
/// # Errors
/// With the line of what is malformed, missing or not supported.
pub fn parse_gtsp(bytes: &[u8]) -> Result<GtspFile, TsplibError> {
    let mut parser = Parser { words: Words { rest: bytes, line: 1 }, header: Header::default() };
    parser.run()?;
    parser.header.finish(parser.words.line)
}

/// Reads the tour section of a tour file: node numbers as the file has them, from 1.
///
/// # Errors
/// Where there is no tour section, or a word in it is no number.
pub fn parse_tour_numbers(bytes: &[u8]) -> Result<Vec<usize>, TsplibError> {
    let mut words = Words { rest: bytes, line: 1 };
    while let Some(line) = words.take_line() {
        if line.trim().trim_end_matches(':').trim() == "TOUR_SECTION" {
            let mut numbers = Vec::new();
            loop {
                match words.word() {
                    None => return Ok(numbers),
                    Some(b"-1" | b"EOF") => return Ok(numbers),
                    Some(word) => numbers.push(count(word, words.line, "a node number")?),
                }
            }
        }
    }
    Err(TsplibError::Missing { line: words.line, what: "TOUR_SECTION" })
}

impl GtspFile {
    /// The tour of a tour file of this instance, whose numbers are the chosen nodes in order.
    ///
    /// # Errors
    /// Where the file is malformed or its tour does not fit the instance.
    pub fn parse_tour(&self, bytes: &[u8]) -> Result<Tour, TsplibError> {
        let mut place = vec![None; self.instance.nodes() + 1];
        for (cluster, numbers) in self.node_numbers.iter().enumerate() {
            for (node, &number) in numbers.iter().enumerate() {
                place[number] = Some((cluster, node));
            }
        }
        let numbers = parse_tour_numbers(bytes)?;
        let mut tour = Tour { clusters: Vec::new(), nodes: Vec::new() };
        for number in numbers {
            let (cluster, node) =
                place.get(number).copied().flatten().ok_or(TsplibError::TourNode { number })?;
            tour.clusters.push(cluster);
            tour.nodes.push(node);
        }
        tour.check(&self.instance).map_err(TsplibError::Tour)?;
        Ok(tour)
    }

    /// The tour's node numbers in the file.
    ///
    /// # Panics
    /// Where the tour names a node that the instance does not have.
    pub fn tour_numbers(&self, tour: &Tour) -> Vec<usize> {
        tour.clusters.iter().zip(&tour.nodes).map(|(&c, &k)| self.node_numbers[c][k]).collect()
    }
}

/// Words of the file and the line they stand on.
struct Words<'a> {
    rest: &'a [u8],
    line: usize,
}

impl<'a> Words<'a> {
    fn skip_blanks(&mut self) {
        let blanks = self.rest.iter().take_while(|b| b.is_ascii_whitespace()).count();
        self.line += self.rest[..blanks].iter().filter(|&&b| b == b'\n').count();
        self.rest = &self.rest[blanks..];
    }

    fn word(&mut self) -> Option<&'a [u8]> {
        self.skip_blanks();
        if self.rest.is_empty() {
            return None;
        }
        let length = self.rest.iter().position(u8::is_ascii_whitespace).unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(length);
        self.rest = rest;
        Some(word)
    }

    /// The next line that is not empty; its number is then `line`.
    fn take_line(&mut self) -> Option<String> {
        self.skip_blanks();
        if self.rest.is_empty() {
            return None;
        }
        let length = self.rest.iter().position(|&b| b == b'\n').unwrap_or(self.rest.len());
        let (line, rest) = self.rest.split_at(length);
        self.rest = rest;
        Some(String::from_utf8_lossy(line).trim().to_owned())
    }
}

enum Matrix {
    Whole(Vec<i32>),
    Real(Vec<f64>),
}

#[derive(Default)]
struct Header {
    name: String,
    kind: String,
    nodes: Option<usize>,
    sets: Option<usize>,
    weight: Option<WeightType>,
    format: Option<WeightFormat>,
    points: Option<Vec<[f64; 3]>>,
    matrix: Option<Matrix>,
    members: Option<Vec<Vec<usize>>>,
}

struct Parser<'a> {
    words: Words<'a>,
    header: Header,
}

impl<'a> Parser<'a> {
    fn run(&mut self) -> Result<(), TsplibError> {
        while let Some(text) = self.words.take_line() {
            let line = self.words.line;
            // Some published files leave the colon out ("TYPE  AGTSP").
            let split = text.find(|c: char| c == ':' || c.is_whitespace()).unwrap_or(text.len());
            let key = text[..split].to_ascii_uppercase();
            let value = text[split..].trim_start_matches(|c: char| c == ':' || c.is_whitespace());
            match key.as_str() {
                "NAME" => value.clone_into(&mut self.header.name),
                "TYPE" => self.kind(value, line)?,
                "DIMENSION" => {
                    self.header.nodes = Some(count(value.as_bytes(), line, "DIMENSION")?)
                }
                "GTSP_SETS" => self.header.sets = Some(count(value.as_bytes(), line, "GTSP_SETS")?),
                "EDGE_WEIGHT_TYPE" => {
                    let known = WeightType::from_name(value);
                    self.header.weight = Some(known.ok_or_else(|| unknown(line, &key, value))?);
                }
                "EDGE_WEIGHT_FORMAT" => {
                    // FUNCTION goes with coordinates and says nothing more.
                    if value != "FUNCTION" {
                        let known = WeightFormat::from_name(value);
                        self.header.format = Some(known.ok_or_else(|| unknown(line, &key, value))?);
                    }
                }
                "NODE_COORD_SECTION" => self.coordinates()?,
                "EDGE_WEIGHT_SECTION" => self.matrix()?,
                "GTSP_SET_SECTION" => self.sets()?,
                "DISPLAY_DATA_SECTION" => self.display()?,
                "COMMENT" | "NODE_COORD_TYPE" | "DISPLAY_DATA_TYPE" | "CAPACITY" => {}
                "EOF" => return Ok(()),
                _ => return Err(TsplibError::UnknownKey { line, key }),
            }
        }
        Ok(())
    }

    fn kind(&mut self, value: &str, line: usize) -> Result<(), TsplibError> {
        let kind = value.split_whitespace().next().unwrap_or("").to_ascii_uppercase();
        if !matches!(kind.as_str(), "GTSP" | "AGTSP" | "TSP" | "ATSP") {
            return Err(unknown(line, "TYPE", value));
        }
        self.header.kind = kind;
        Ok(())
    }

    fn nodes(&self) -> Result<usize, TsplibError> {
        match self.header.nodes {
            Some(n) if n > 0 => Ok(n),
            _ => Err(TsplibError::Missing {
                line: self.words.line,
                what: "DIMENSION before the data",
            }),
        }
    }

    fn coordinates(&mut self) -> Result<(), TsplibError> {
        let n = self.nodes()?;
        let weight = self.header.weight.ok_or(TsplibError::Missing {
            line: self.words.line,
            what: "EDGE_WEIGHT_TYPE before NODE_COORD_SECTION",
        })?;
        let mut points = vec![None; n.min(self.words.rest.len())];
        if points.len() < n {
            return Err(TsplibError::Short { line: self.words.line, what: "NODE_COORD_SECTION" });
        }
        for _ in 0..n {
            let id = self.needed("NODE_COORD_SECTION")?;
            let node = self.node(id, n)?;
            let mut point = [0.0; 3];
            for x in point.iter_mut().take(weight.dimensions().max(2)) {
                let word = self.needed("NODE_COORD_SECTION")?;
                *x = number(word, self.words.line)?;
                if !x.is_finite() {
                    return Err(bad_number(word, self.words.line));
                }
            }
            if points[node].replace(point).is_some() {
                return Err(TsplibError::Twice { line: self.words.line, node: node + 1 });
            }
        }
        self.header.points = Some(points.into_iter().flatten().collect());
        Ok(())
    }

    fn matrix(&mut self) -> Result<(), TsplibError> {
        let n = self.nodes()?;
        if n > MOST_NODES {
            return Err(TsplibError::TooLarge {
                line: self.words.line,
                nodes: n,
                most: MOST_NODES,
            });
        }
        let format = self.header.format.ok_or(TsplibError::Missing {
            line: self.words.line,
            what: "EDGE_WEIGHT_FORMAT before EDGE_WEIGHT_SECTION",
        })?;
        let entries = format.entries(n);
        // Two bytes an entry at least: a false DIMENSION cannot make us reserve memory.
        if entries > self.words.rest.len() / 2 + 1 {
            return Err(TsplibError::Short { line: self.words.line, what: "EDGE_WEIGHT_SECTION" });
        }
        let mut whole: Vec<i32> = Vec::with_capacity(entries);
        let mut real: Option<Vec<f64>> = None;
        for _ in 0..entries {
            let word = self.needed("EDGE_WEIGHT_SECTION")?;
            match (&mut real, small_integer(word)) {
                (None, Some(value)) => whole.push(value),
                (reals, _) => {
                    let value = number(word, self.words.line)?;
                    reals
                        .get_or_insert_with(|| whole.drain(..).map(f64::from).collect())
                        .push(value);
                }
            }
        }
        self.header.matrix = Some(match real {
            None => Matrix::Whole(format.expand(n, whole)),
            Some(real) => Matrix::Real(format.expand(n, real)),
        });
        Ok(())
    }

    fn sets(&mut self) -> Result<(), TsplibError> {
        let n = self.nodes()?;
        let m = self.header.sets.filter(|&m| m > 0 && m <= n).ok_or(TsplibError::Missing {
            line: self.words.line,
            what: "GTSP_SETS between 1 and DIMENSION before GTSP_SET_SECTION",
        })?;
        let mut members = vec![Vec::new(); m];
        let mut taken = vec![false; n];
        for _ in 0..m {
            let word = self.needed("GTSP_SET_SECTION")?;
            let line = self.words.line;
            let set = count(word, line, "a set number")?;
            if set == 0 || set > m {
                return Err(TsplibError::SetNumber { line, set, sets: m });
            }
            if !members[set - 1].is_empty() {
                return Err(TsplibError::SetTwice { line, set });
            }
            loop {
                let word = self.needed("GTSP_SET_SECTION")?;
                if word == b"-1" {
                    break;
                }
                let node = self.node(word, n)?;
                if std::mem::replace(&mut taken[node], true) {
                    return Err(TsplibError::Twice { line: self.words.line, node: node + 1 });
                }
                members[set - 1].push(node);
            }
            if members[set - 1].is_empty() {
                return Err(TsplibError::EmptySet { line: self.words.line, set });
            }
        }
        if let Some(node) = taken.iter().position(|t| !t) {
            return Err(TsplibError::NoSet { line: self.words.line, node: node + 1 });
        }
        self.header.members = Some(members);
        Ok(())
    }

    fn display(&mut self) -> Result<(), TsplibError> {
        for _ in 0..3 * self.nodes()? {
            self.needed("DISPLAY_DATA_SECTION")?;
        }
        Ok(())
    }

    fn needed(&mut self, what: &'static str) -> Result<&'a [u8], TsplibError> {
        match self.words.word() {
            Some(word) if word != b"EOF" => Ok(word),
            _ => Err(TsplibError::Short { line: self.words.line, what }),
        }
    }

    fn node(&self, word: &[u8], n: usize) -> Result<usize, TsplibError> {
        let line = self.words.line;
        let number = count(word, line, "a node number")?;
        if number == 0 || number > n {
            return Err(TsplibError::NodeNumber { line, number, nodes: n });
        }
        Ok(number - 1)
    }
}

impl Header {
    fn finish(self, line: usize) -> Result<GtspFile, TsplibError> {
        let missing = |what| TsplibError::Missing { line, what };
        let n = self.nodes.ok_or(missing("DIMENSION"))?;
        let weight = self.weight.ok_or(missing("EDGE_WEIGHT_TYPE"))?;
        let members = match self.members {
            Some(members) => members,
            None if self.kind == "TSP" || self.kind == "ATSP" => (0..n).map(|v| vec![v]).collect(),
            None => return Err(missing("GTSP_SET_SECTION")),
        };
        let numbers = Arc::new(members);
        let of = Arc::clone(&numbers);
        let cost: CostFn = if weight == WeightType::Explicit {
            match self.matrix.ok_or(missing("EDGE_WEIGHT_SECTION"))? {
                Matrix::Whole(w) => {
                    Arc::new(move |a, i, b, j| f64::from(w[of[a][i] * n + of[b][j]]))
                }
                Matrix::Real(w) => Arc::new(move |a, i, b, j| w[of[a][i] * n + of[b][j]]),
            }
        } else {
            let points = self.points.ok_or(missing("NODE_COORD_SECTION"))?;
            Arc::new(move |a, i, b, j| weight.distance(points[of[a][i]], points[of[b][j]]))
        };
        let sizes: Vec<usize> = numbers.iter().map(Vec::len).collect();
        let costs = Costs::OnDemand(OnDemand { neighbours: None, cost });
        let instance = Instance::new(&sizes, costs, Jump::Forbidden, Ends::Closed)
            .map_err(TsplibError::Instance)?;
        let node_numbers = numbers.iter().map(|set| set.iter().map(|v| v + 1).collect()).collect();
        Ok(GtspFile { name: self.name, instance, node_numbers })
    }
}

fn unknown(line: usize, key: &str, value: &str) -> TsplibError {
    TsplibError::UnknownValue { line, key: key.to_owned(), value: value.to_owned() }
}

fn bad_number(word: &[u8], line: usize) -> TsplibError {
    TsplibError::Number { line, found: String::from_utf8_lossy(word).into_owned() }
}

fn count(word: &[u8], line: usize, what: &'static str) -> Result<usize, TsplibError> {
    let parsed = std::str::from_utf8(word).ok().and_then(|w| w.trim().parse().ok());
    parsed.ok_or_else(|| TsplibError::Count {
        line,
        what,
        found: String::from_utf8_lossy(word).into_owned(),
    })
}

/// A finite number or +inf, which is "no arc".
fn number(word: &[u8], line: usize) -> Result<f64, TsplibError> {
    let parsed = std::str::from_utf8(word).ok().and_then(|w| w.parse::<f64>().ok());
    match parsed {
        Some(x) if !x.is_nan() && x != f64::NEG_INFINITY => Ok(x),
        _ => Err(bad_number(word, line)),
    }
}

/// The fast path for what nearly all files consist of.
fn small_integer(word: &[u8]) -> Option<i32> {
    let (negative, digits) = match word {
        [b'-', digits @ ..] => (true, digits),
        digits => (false, digits),
    };
    if digits.is_empty() || digits.len() > 9 {
        return None;
    }
    let mut value = 0_i32;
    for d in digits {
        if !d.is_ascii_digit() {
            return None;
        }
        value = value * 10 + i32::from(d - b'0');
    }
    Some(if negative { -value } else { value })
}
