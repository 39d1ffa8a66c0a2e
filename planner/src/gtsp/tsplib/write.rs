//! Writer of GTSPLIB instances and tours, for users who have LKH or GLKH.

use std::io::{self, Write};

use super::super::instance::{Ends, Instance};
use super::super::tour::Tour;

/// What the numbers in a written file stand for.
#[derive(Clone, Debug, PartialEq)]
pub struct Exported {
    /// Weights in the file are costs × scale, rounded.
    pub scale: f64,
    /// Weight of a jump where jumps are forbidden, and of arcs inside a cluster.
    pub forbidden: i64,
    /// Node number of the added start, where the path is open from start costs; its closing arcs
    /// are free.
    pub start: Option<usize>,
}

/// Largest weight written: LKH keeps sums of weights in 32 bits by default.
const LARGEST: f64 = 1e7;

/// Writes the instance as an AGTSP with a full matrix of integers. Nodes are numbered from 1 in
/// cluster order; an open path becomes a closed tour with free arcs back to its start.
pub fn export(instance: &Instance, name: &str, out: &mut dyn Write) -> io::Result<Exported> {
    let n = instance.nodes();
    let outer = matches!(instance.ends(), Ends::OpenFromCosts(_));
    let nodes: Vec<(usize, usize)> = (0..instance.clusters())
        .flat_map(|c| (0..instance.sizes()[c]).map(move |k| (c, k)))
        .chain(outer.then_some((usize::MAX, 0)))
        .collect();
    let weight = |u: usize, v: usize| -> Option<f64> {
        let ((a, i), (b, j)) = (nodes[u], nodes[v]);
        if a == b {
            return None;
        }
        let price = |p: f64| p.is_finite().then_some(p);
        match instance.ends() {
            Ends::OpenFromCosts(_) if b == usize::MAX => Some(0.0),
            Ends::OpenFromCosts(start) if a == usize::MAX => {
                if start[v].is_finite() {
                    Some(start[v])
                } else {
                    price(instance.start_jump_price())
                }
            }
            &Ends::OpenFromCluster(first) if b == first => Some(0.0),
            _ => instance.arc(a, i, b, j).or_else(|| price(instance.jump_price(a, b))),
        }
    };
    let (mut largest, mut whole) = (0.0_f64, true);
    for u in 0..nodes.len() {
        for v in 0..nodes.len() {
            if let Some(w) = weight(u, v) {
                largest = largest.max(w.abs());
                whole &= w.fract() == 0.0;
            }
        }
    }
    let scale = if whole && largest <= LARGEST { 1.0 } else { LARGEST / largest };
    let forbidden = (largest * scale * 2.0).round().max(1.0) as i64;
    writeln!(out, "NAME : {name}\nTYPE : AGTSP")?;
    writeln!(out, "COMMENT : weights = costs x {scale:e}, no arc = {forbidden}")?;
    writeln!(out, "DIMENSION : {}", nodes.len())?;
    writeln!(out, "GTSP_SETS : {}", instance.clusters() + usize::from(outer))?;
    writeln!(out, "EDGE_WEIGHT_TYPE : EXPLICIT\nEDGE_WEIGHT_FORMAT : FULL_MATRIX")?;
    writeln!(out, "EDGE_WEIGHT_SECTION")?;
    let mut row = String::new();
    for u in 0..nodes.len() {
        row.clear();
        for v in 0..nodes.len() {
            let w = weight(u, v).map_or(forbidden, |w| (w * scale).round() as i64);
            row.push_str(&w.to_string());
            row.push(' ');
        }
        writeln!(out, "{}", row.trim_end())?;
    }
    writeln!(out, "GTSP_SET_SECTION")?;
    let mut number = 0;
    let sizes = instance.sizes().iter().copied().chain(outer.then_some(1));
    for (set, size) in sizes.enumerate() {
        write!(out, "{}", set + 1)?;
        for _ in 0..size {
            number += 1;
            write!(out, " {number}")?;
        }
        writeln!(out, " -1")?;
    }
    writeln!(out, "EOF")?;
    Ok(Exported { scale, forbidden, start: outer.then_some(n + 1) })
}

impl Exported {
    /// The instance's tour from the node numbers of a tour of the written file; `None` where a
    /// number does not exist.
    pub fn tour(&self, instance: &Instance, numbers: &[usize]) -> Option<Tour> {
        let first = match *instance.ends() {
            Ends::Closed => 0,
            Ends::OpenFromCosts(_) => numbers.iter().position(|&k| Some(k) == self.start)? + 1,
            Ends::OpenFromCluster(start) => {
                let low = instance.node_index(start, 0) + 1;
                numbers.iter().position(|&k| (low..low + instance.sizes()[start]).contains(&k))?
            }
        };
        let mut tour = Tour { clusters: Vec::new(), nodes: Vec::new() };
        for k in 0..numbers.len() {
            let number = numbers[(first + k) % numbers.len()];
            if Some(number) == self.start {
                continue;
            }
            let node = number.checked_sub(1)?;
            let cluster =
                (0..instance.clusters()).rev().find(|&c| instance.node_index(c, 0) <= node)?;
            let within = node - instance.node_index(cluster, 0);
            if within >= instance.sizes()[cluster] {
                return None;
            }
            tour.clusters.push(cluster);
            tour.nodes.push(within);
        }
        Some(tour)
    }
}

/// Writes node numbers as a TSPLIB tour.
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
