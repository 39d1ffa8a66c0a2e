//! What stands in a room.

use std::cmp::Reverse;
use std::collections::{BTreeMap, HashSet};

use nalgebra::{Point3, Vector3};

use super::flat::Noise;
use super::outline;
use super::plane::{Plane, PlaneKind};
use crate::grid::Grid;
use crate::scan::{CropBox, PlacedScan, View};

/// An object: points that hang together and stand on floor or table.
#[derive(Clone, Debug, PartialEq)]
pub struct Segment {
    /// For each view of the scan, the indices of the object's points there, ascending.
    pub members: Vec<Vec<u32>>,
    /// How many that are.
    pub points: usize,
    /// Least and greatest corner. \[m\]
    pub bounds: CropBox,
    /// Their mean. \[m\]
    pub centre: Point3<f64>,
    /// Index of the plane that it stands on.
    pub stands_on: usize,
}

/// Points closer than about this hang together. \[m\]
const CELL: f64 = 0.03;
/// Fewest points of an object.
const POINTS: usize = 150;
/// How far above a plane the lowest point of what stands on it may be: the feet of things are hidden,
/// or go with the plane. \[m\]
const FOOT: f64 = 0.12;
/// How far above a plane the lowest seen part of what stands on it may be, the rest hidden. \[m\]
const HIDDEN: f64 = 0.5;
/// How far the foot of an object may reach beyond what stands on it. \[m\]
const ASIDE: f64 = 0.08;
/// Points this many tolerances off a plane are still of it: what is left would tie together all that
/// stands on it.
const BAND: f64 = 1.5;

/// What a mesh knows beside its points is of the thing that its nearest point is of, which is about
/// this near … \[m\]
const NEXT_TO: f64 = 0.02;
/// … and is looked for as far as this. \[m\]
const BESIDE: f64 = 1.0;

impl Segment {
    /// The object's own views, and those of all else.
    #[must_use]
    pub fn split(&self, scan: &PlacedScan) -> (PlacedScan, PlacedScan) {
        let part = |keep: bool| {
            let view = |(view, members): (&View, &Vec<u32>)| {
                let mut member = vec![false; view.points.len()];
                members.iter().for_each(|&i| member[i as usize] = true);
                let kept: Vec<usize> = (0..member.len()).filter(|&i| member[i] == keep).collect();
                let ours = |places: &[Point3<f64>]| -> Vec<Point3<f64>> {
                    if places.is_empty() {
                        return Vec::new();
                    }
                    let all = Grid::new(&view.points, NEXT_TO);
                    let is_ours = |p: &&Point3<f64>| {
                        let nearest = all.nearest(p, BESIDE, |_| true);
                        nearest.is_some_and(|(i, _)| member[i as usize]) == keep
                    };
                    places.iter().filter(is_ours).copied().collect()
                };
                View {
                    points: kept.iter().map(|&i| view.points[i]).collect(),
                    normals: view.normals.as_ref().map(|n| kept.iter().map(|&i| n[i]).collect()),
                    colours: view.colours.as_ref().map(|c| kept.iter().map(|&i| c[i]).collect()),
                    faces: ours(&view.faces),
                    inside: ours(&view.inside),
                    sensor: view.sensor,
                }
            };
            PlacedScan { views: scan.views.iter().zip(&self.members).map(view).collect() }
        };
        (part(true), part(false))
    }
}

/// The objects among what is on no plane, that with the most points first.
pub(super) fn find(scan: &PlacedScan, planes: &[Plane], noise: &Noise) -> Vec<Segment> {
    let floor = planes.iter().find(|plane| plane.kind == PlaneKind::Floor);
    let free = |p: &Point3<f64>| {
        let tolerance = BAND * noise.at(p);
        let under = |floor: &Plane| (p - floor.point).dot(&floor.normal) < tolerance;
        !floor.is_some_and(under) && !planes.iter().any(|plane| plane.holds(p, tolerance))
    };
    let key = |p: &Point3<f64>| [0, 1, 2].map(|axis| (p[axis] / CELL).floor() as i64);
    let mut cells: BTreeMap<[i64; 3], Vec<(usize, u32)>> = BTreeMap::new();
    for (v, view) in scan.views.iter().enumerate() {
        for (i, p) in view.points.iter().enumerate().filter(|(_, p)| free(p)) {
            cells.entry(key(p)).or_default().push((v, i as u32));
        }
    }
    // A single pixel bridges nothing.
    cells.retain(|_, members| members.len() > 1);
    let mut seen: HashSet<[i64; 3]> = HashSet::new();
    let mut clusters = Vec::new();
    for &start in cells.keys() {
        if !seen.insert(start) {
            continue;
        }
        let mut keys = vec![start];
        let mut next = 0;
        while let Some(&[x, y, z]) = keys.get(next) {
            next += 1;
            for i in 0..27 {
                let at = |value: i64, step: i64| value.saturating_add(step - 1);
                let near = [at(x, i % 3), at(y, i / 3 % 3), at(z, i / 9)];
                if cells.contains_key(&near) && seen.insert(near) {
                    keys.push(near);
                }
            }
        }
        let points: Vec<_> = keys.iter().flat_map(|key| cells[key].iter().copied()).collect();
        if points.len() >= POINTS {
            clusters.push(Cluster::of(points, scan));
        }
    }
    let mut segments: Vec<Segment> =
        joined(clusters, scan, planes).iter().filter_map(|c| c.segment(scan, planes)).collect();
    segments.sort_by_key(|segment| Reverse(segment.points));
    segments
}

/// Points that hang together.
struct Cluster {
    /// View and index there.
    points: Vec<(usize, u32)>,
    min: Vector3<f64>,
    max: Vector3<f64>,
    centre: Point3<f64>,
    /// Height of its lowest hundredth. \[m\]
    foot: f64,
}

impl Cluster {
    fn of(points: Vec<(usize, u32)>, scan: &PlacedScan) -> Self {
        let infinite = Vector3::repeat(f64::INFINITY);
        let (mut min, mut max, mut sum) = (infinite, -infinite, Vector3::zeros());
        let mut heights = Vec::with_capacity(points.len());
        for &(v, i) in &points {
            let p = scan.views[v].points[i as usize].coords;
            (min, max) = (min.inf(&p), max.sup(&p));
            sum += p;
            heights.push(p.z);
        }
        heights.sort_unstable_by(f64::total_cmp);
        let foot = heights[points.len() / 100];
        Self { centre: Point3::from(sum / points.len() as f64), points, min, max, foot }
    }

    /// The plane under it, and how far.
    fn support(&self, planes: &[Plane]) -> Option<(usize, f64)> {
        let carries = |plane: &Plane| match plane.kind {
            PlaneKind::Floor => true,
            PlaneKind::Table => {
                outline::contains(&plane.outline, &plane.normal, &self.centre, 0.02)
            }
            PlaneKind::Wall => false,
        };
        let under = planes.iter().enumerate().filter(|(_, plane)| carries(plane));
        under
            .map(|(i, plane)| (i, self.foot - plane.point.z))
            .filter(|(_, gap)| *gap > -FOOT)
            .min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Whether another one lies below it, inside its own width: a foot whose column is hidden.
    fn is_over(&self, other: &Self) -> bool {
        let inside = |axis: usize| {
            self.min[axis] - ASIDE < other.centre[axis]
                && other.centre[axis] < self.max[axis] + ASIDE
        };
        let wide = |c: &Self| (c.max.xy() - c.min.xy()).norm();
        other.max.z < self.foot + ASIDE
            && inside(0)
            && inside(1)
            && wide(other) < 1.5 * wide(self)
            && other.points.len() < self.points.len()
    }

    /// The object, if it stands on something.
    fn segment(&self, scan: &PlacedScan, planes: &[Plane]) -> Option<Segment> {
        let (stands_on, _) = self.support(planes).filter(|(_, gap)| *gap < HIDDEN)?;
        let mut members = vec![Vec::new(); scan.views.len()];
        for &(v, i) in &self.points {
            members[v].push(i);
        }
        members.iter_mut().for_each(|of| of.sort_unstable());
        let bounds = CropBox { min: self.min.into(), max: self.max.into() };
        Some(Segment { members, points: self.points.len(), bounds, centre: self.centre, stands_on })
    }
}

/// Clusters that hang in the air with what is below them.
fn joined(mut clusters: Vec<Cluster>, scan: &PlacedScan, planes: &[Plane]) -> Vec<Cluster> {
    clusters.sort_by_key(|cluster| Reverse(cluster.points.len()));
    let mut whole: Vec<Cluster> = Vec::new();
    while !clusters.is_empty() {
        let mut cluster = clusters.remove(0);
        let gap = cluster.support(planes).map(|(_, gap)| gap);
        if gap.is_some_and(|gap| (FOOT..HIDDEN).contains(&gap)) {
            let (below, rest): (Vec<_>, Vec<_>) =
                clusters.into_iter().partition(|other| cluster.is_over(other));
            clusters = rest;
            if !below.is_empty() {
                let mut points = cluster.points;
                points.extend(below.into_iter().flat_map(|other| other.points));
                cluster = Cluster::of(points, scan);
            }
        }
        whole.push(cluster);
    }
    whole
}
