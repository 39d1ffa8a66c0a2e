//! The pad's way along an edge.

use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};
use nullsweep_robot::{Tool, wrap};
use nullsweep_surface::SurfacePoint;

use super::edge::Edge;
use crate::workcell::{contact_pose, direction};

/// The pad's way from one patch to the next: along the surface line, its normal blended, its
/// heading turning evenly from the one patch's to the other's, relative to the line.
#[derive(Clone, Debug)]
pub struct ToolPath {
    stations: Vec<Station>,
    stand_off: f64,
}

/// A point of the surface line.
#[derive(Clone, Copy, Debug)]
struct Station {
    point: Point3<f64>,
    normal: UnitVector3<f64>,
    travel: Vector3<f64>,
    /// Share of the path's length up to here, 0…1.
    share: f64,
    /// Of the pad from the line. \[rad\]
    turn: f64,
}

impl ToolPath {
    /// The path along an edge of the graph, from patch `a` to `b` or, `reversed`, back. The
    /// headings are those of the samples at its start and end.
    ///
    /// Shape: edge lines have at least two points.
    #[must_use]
    pub fn along(edge: &Edge, reversed: bool, from: f64, to: f64, stand_off: f64) -> Self {
        let mut line: Vec<SurfacePoint> = edge.line.clone();
        if reversed {
            line.reverse();
        }
        let length: f64 = line.windows(2).map(|w| (w[1].point - w[0].point).norm()).sum();
        let mut stations = Vec::with_capacity(line.len());
        let mut share = 0.0;
        for (i, here) in line.iter().enumerate() {
            let before = line[i.saturating_sub(1)].point;
            let after = line[(i + 1).min(line.len() - 1)].point;
            let chord = after - before;
            let n = here.normal.into_inner();
            let travel = (chord - n * chord.dot(&n)).normalize();
            if i > 0 {
                share += (here.point - before).norm() / length;
            }
            stations.push(Station {
                point: here.point,
                normal: here.normal,
                travel,
                share,
                turn: 0.0,
            });
        }
        let (first, last) = (stations[0], stations[stations.len() - 1]);
        let start = turn(&first, from);
        let end = turn(&last, to);
        let swing = wrap(end - start);
        for s in &mut stations {
            let angle = start + swing * s.share;
            s.turn = angle;
            s.travel = s.travel * libm::cos(angle) + s.normal.cross(&s.travel) * libm::sin(angle);
        }
        Self { stations, stand_off }
    }

    /// Whether a tool may travel along it all the way, turned from it as it is.
    pub(super) fn is_for(&self, tool: &Tool) -> bool {
        self.stations.iter().all(|station| tool.may_travel(station.turn))
    }

    /// How many points the surface line has, at least two.
    pub(super) fn stations(&self) -> usize {
        self.stations.len()
    }

    /// The contact pose at a station.
    pub(super) fn pose(&self, station: usize) -> Isometry3<f64> {
        let Station { point, normal, travel, .. } = &self.stations[station];
        contact_pose(point, normal, travel, self.stand_off)
    }

    /// The contact pose `share` of the way from station `i` to the next.
    pub(super) fn between(&self, i: usize, share: f64) -> Isometry3<f64> {
        let [a, b] = [&self.stations[i], &self.stations[i + 1]];
        let mix = |x: Vector3<f64>, y: Vector3<f64>| x * (1.0 - share) + y * share;
        let normal = UnitVector3::new_normalize(mix(a.normal.into_inner(), b.normal.into_inner()));
        let point = Point3::from(mix(a.point.coords, b.point.coords));
        contact_pose(&point, &normal, &mix(a.travel, b.travel), self.stand_off)
    }

    /// Share of the whole path up to a station.
    pub(super) fn share(&self, station: usize) -> f64 {
        self.stations[station].share
    }
}

/// The angle from a station's line direction to a heading, about the normal. \[rad\]
fn turn(station: &Station, heading: f64) -> f64 {
    let d = direction(&station.normal, heading);
    let t = station.travel;
    libm::atan2(station.normal.cross(&t).dot(&d), t.dot(&d))
}
