//! A way along the surface between two patches.

use nullsweep_surface::{Patch, SurfacePoint};
use serde::{Deserialize, Serialize};

use crate::workcell::{Bed, heading_of};

/// How the graph is built.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GraphConfig {
    /// Nearest neighbours of each patch that are tried (paper §V: 8).
    pub neighbours: usize,
    /// Longest edge. \[m\] (paper §V: 10 cm)
    pub radius: f64,
    /// Step of the surface line between two patches. \[m\]
    pub line_step: f64,
    /// Redundancy values that are tried before an edge is given up.
    pub edge_samples: usize,
}

impl Default for GraphConfig {
    fn default() -> Self {
        Self { neighbours: 8, radius: 0.10, line_step: 0.006, edge_samples: 100 }
    }
}

/// A way along the surface between two patches that the arm can follow.
#[derive(Clone, Debug)]
pub struct Edge {
    /// The patch where it starts.
    pub a: usize,
    /// The patch where it ends.
    pub b: usize,
    /// The surface line from `a`'s centre to `b`'s, both included, at least two points.
    pub line: Vec<SurfacePoint>,
    /// Heading at `a` of a tool that travels from `a` to `b`. \[rad\]
    pub heading_a: f64,
    /// Heading at `b` of a tool that travels from `a` to `b`. \[rad\]
    pub heading_b: f64,
    /// Turn of the pad from the direction of travel at which the edge can be followed: 0 where
    /// that goes. \[rad\]
    pub turn: f64,
}

impl Edge {
    /// The edge along the surface line between two patches, whether or not the arm can follow it;
    /// `None` where there is no line. `wave` is the shortest wave
    /// of the normal along it: as long as the pad is wide. \[m\]
    #[must_use]
    pub fn between(
        bed: &Bed,
        patches: &[Patch],
        a: usize,
        b: usize,
        config: &GraphConfig,
        wave: f64,
    ) -> Option<Self> {
        let end = |i: usize| SurfacePoint { point: patches[i].centre, normal: patches[i].normal };
        let line = bed.line(&end(a), &end(b), config.line_step, wave)?;
        let last = line.len() - 1;
        Some(Self {
            a,
            b,
            heading_a: heading_of(&line[0].normal, &(line[1].point - line[0].point)),
            heading_b: heading_of(&line[last].normal, &(line[last].point - line[last - 1].point)),
            line,
            turn: 0.0,
        })
    }

    /// The patch at the other end.
    #[must_use]
    pub fn other(&self, patch: usize) -> usize {
        if patch == self.a { self.b } else { self.a }
    }

    /// The pad's heading at one end when it leaves along the edge, its turn included. \[rad\]
    #[must_use]
    pub fn leaving(&self, patch: usize) -> f64 {
        let back = std::f64::consts::PI;
        self.turn + if patch == self.a { self.heading_a } else { self.heading_b + back }
    }
}
