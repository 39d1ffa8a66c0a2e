//! Writer of GTSPLIB instances and tours, for users who have LKH or GLKH.

use std::io::{self, Write};

use crate::closed::Closed;
use crate::instance::Instance;
use crate::tour::Tour;

/// What the numbers in a written file stand for.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Exported {
    /// Weights in the file are costs × scale, rounded.
    pub scale: f64,
    /// Weight of a forbidden jump, and of arcs inside a cluster.
    pub forbidden: i64,
    /// Node number of the added start, where the path is open from start costs; its closing arcs
    /// are free.
    pub start: Option<usize>,
}

/// Largest weight written: LKH keeps sums of weights in 32 bits by default.
const LARGEST: f64 = 1e7;

/// Writes the instance as an AGTSP with a full matrix of integers. Nodes are numbered from 1 in
/// cluster order; an open path becomes a closed tour with free arcs back to its start. A jump costs
/// its price.
///
/// # Errors
/// Those of `out`.
pub fn export(instance: &Instance, name: &str, out: &mut dyn Write) -> io::Result<Exported> {
    let closed = Closed::new(instance);
    let n = closed.nodes.len();
    let (mut largest, mut whole) = (f64::MIN_POSITIVE, true);
    for w in (0..n * n).filter_map(|k| closed.weight(k / n, k % n)) {
        largest = largest.max(w.abs());
        whole &= w.fract() == 0.0;
    }
    let scale = if whole && largest <= LARGEST { 1.0 } else { LARGEST / largest };
    let forbidden = (largest * scale * 2.0).round().max(1.0) as i64;
    writeln!(out, "NAME : {name}\nTYPE : AGTSP")?;
    writeln!(out, "COMMENT : weights = costs x {scale:e}, no arc = {forbidden}")?;
    writeln!(out, "DIMENSION : {n}\nGTSP_SETS : {}", closed.clusters)?;
    writeln!(out, "EDGE_WEIGHT_TYPE : EXPLICIT\nEDGE_WEIGHT_FORMAT : FULL_MATRIX")?;
    writeln!(out, "EDGE_WEIGHT_SECTION")?;
    let mut row = String::new();
    for u in 0..n {
        row.clear();
        for v in 0..n {
            let w = closed.weight(u, v).map_or(forbidden, |w| (w * scale).round() as i64);
            row.push_str(&w.to_string());
            row.push(' ');
        }
        writeln!(out, "{}", row.trim_end())?;
    }
    writeln!(out, "GTSP_SET_SECTION")?;
    for set in 0..closed.clusters {
        write!(out, "{}", set + 1)?;
        for number in (0..n).filter(|&k| closed.nodes[k].0 == set) {
            write!(out, " {}", number + 1)?;
        }
        writeln!(out, " -1")?;
    }
    writeln!(out, "EOF")?;
    Ok(Exported { scale, forbidden, start: closed.start.map(|k| k + 1) })
}

impl Exported {
    /// The instance's tour from the node numbers of a tour of the written file; `None` where a
    /// number does not exist or the start is missing.
    pub fn tour(&self, instance: &Instance, numbers: &[usize]) -> Option<Tour> {
        let indices: Option<Vec<usize>> = numbers.iter().map(|k| k.checked_sub(1)).collect();
        Closed::new(instance).tour(&indices?)
    }
}

/// Writes node numbers as a TSPLIB tour of this name and value.
///
/// # Errors
/// Those of `out`.
pub fn write_tour(
    name: &str,
    numbers: &[usize],
    value: f64,
    out: &mut dyn Write,
) -> io::Result<()> {
    writeln!(out, "NAME : {name}\nCOMMENT : Length = {value}\nTYPE : TOUR")?;
    writeln!(out, "DIMENSION : {}\nTOUR_SECTION", numbers.len())?;
    for number in numbers {
        writeln!(out, "{number}")?;
    }
    writeln!(out, "-1\nEOF")
}
