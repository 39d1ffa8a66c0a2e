//! What stands in a room.

use std::collections::{BTreeMap, HashMap};

use nalgebra::{Point3, Vector3};

use super::flat::Noise;
use super::{Plane, PlaneKind};
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

impl Segment {
    /// The object's own views, and those of all else.
    #[must_use]
    pub fn split(&self, scan: &PlacedScan) -> (PlacedScan, PlacedScan) {
        let part = |keep: bool| {
            let view = |(view, members): (&View, &Vec<u32>)| {
                let mut member = vec![false; view.points.len()];
                members.iter().for_each(|&i| member[i as usize] = true);
                let kept: Vec<usize> = (0..member.len()).filter(|&i| member[i] == keep).collect();
                View {
                    points: kept.iter().map(|&i| view.points[i]).collect(),
                    normals: view.normals.as_ref().map(|n| kept.iter().map(|&i| n[i]).collect()),
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
        let tolerance = noise.at(p);
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
    let mut part: HashMap<[i64; 3], usize> = HashMap::new();
    let mut segments = Vec::new();
    for &start in cells.keys() {
        if part.contains_key(&start) {
            continue;
        }
        part.insert(start, segments.len());
        let mut cluster = vec![start];
        let mut next = 0;
        while let Some(&[x, y, z]) = cluster.get(next) {
            next += 1;
            for i in 0..27 {
                let near = [x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1];
                if cells.contains_key(&near) && !part.contains_key(&near) {
                    part.insert(near, segments.len());
                    cluster.push(near);
                }
            }
        }
        let members = cluster.iter().flat_map(|key| cells[key].iter().copied());
        segments.extend(segment(scan, planes, members.collect()));
    }
    segments.sort_by_key(|segment| std::cmp::Reverse(segment.points));
    segments
}

/// The object of some points, if they are enough and stand on something.
fn segment(scan: &PlacedScan, planes: &[Plane], points: Vec<(usize, u32)>) -> Option<Segment> {
    if points.len() < POINTS {
        return None;
    }
    let mut members = vec![Vec::new(); scan.views.len()];
    let infinite = Vector3::repeat(f64::INFINITY);
    let (mut min, mut max, mut sum) = (infinite, -infinite, Vector3::zeros());
    let count = points.len();
    let mut heights = Vec::with_capacity(count);
    for (v, i) in points {
        let p = scan.views[v].points[i as usize].coords;
        (min, max) = (min.inf(&p), max.sup(&p));
        sum += p;
        heights.push(p.z);
        members[v].push(i);
    }
    members.iter_mut().for_each(|of| of.sort_unstable());
    let centre = Point3::from(sum / count as f64);
    heights.sort_by(f64::total_cmp);
    let foot = heights[count / 100];
    let carries = |plane: &Plane| {
        let on_top = match plane.kind {
            PlaneKind::Floor => true,
            PlaneKind::Table => {
                let outline = &plane.outline;
                super::outline::contains(outline, &plane.normal, &centre, 0.02)
            }
            PlaneKind::Wall => false,
        };
        on_top && (foot - plane.point.z).abs() < FOOT
    };
    let stands_on = planes.iter().position(carries)?;
    let bounds = CropBox { min: min.into(), max: max.into() };
    Some(Segment { members, points: count, bounds, centre, stands_on })
}
