//! Points that lie far from all others: a fly before the lens, a reflection, a broken number.

use std::collections::{BTreeMap, HashMap};

use nalgebra::{Point3, UnitQuaternion};

use super::cloud::MIN_POINTS;

/// Points looked at to learn how large the scan is.
const SAMPLE: usize = 100_000;

/// Strays found in a scan.
pub(super) struct Strays {
    /// Whether each point is one.
    pub(super) flags: Vec<bool>,
    pub(super) count: usize,
    /// The one that lies farthest from the middle. \[m\]
    pub(super) farthest: Point3<f64>,
    /// How far that is. \[m\]
    pub(super) distance: f64,
}

/// Groups of points that are too few for a surface, fewer than a hundredth of all, and apart from
/// all others by more than an eighth of the scan's size. Sound scans have none.
pub(super) fn find(points: &[Point3<f64>]) -> Option<Strays> {
    let (middle, size) = middle_and_size(points)?;
    let side = size / 8.0;
    let mut cells: BTreeMap<[i64; 3], usize> = BTreeMap::new();
    for (key, count) in counts(points.iter().copied(), side) {
        cells.insert(key, count);
    }
    let mut stray: HashMap<[i64; 3], bool> = HashMap::new();
    let mut group = Vec::new();
    for &start in cells.keys() {
        if stray.contains_key(&start) {
            continue;
        }
        group.clear();
        group.push(start);
        stray.insert(start, false);
        let mut next = 0;
        while let Some(&key) = group.get(next) {
            next += 1;
            for near in around(key) {
                if cells.contains_key(&near) && !stray.contains_key(&near) {
                    stray.insert(near, false);
                    group.push(near);
                }
            }
        }
        let count: usize = group.iter().map(|key| cells[key]).sum();
        if count < MIN_POINTS && count * 100 < points.len() {
            stray.extend(group.iter().map(|&key| (key, true)));
        }
    }
    if !stray.values().any(|&is| is) {
        return None;
    }
    let flags: Vec<bool> = points.iter().map(|p| stray[&cell(p, side)]).collect();
    let count = flags.iter().filter(|&&is| is).count();
    // Where a tenth is apart, the scan is made so.
    if count * 10 > points.len() {
        return None;
    }
    let distance = |p: &Point3<f64>| (p - middle).norm();
    let strays = points.iter().zip(&flags).filter(|(_, is)| **is).map(|(p, _)| *p);
    let farthest = strays.max_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    Some(Strays { flags, count, farthest, distance: distance(&farthest) })
}

/// The height over the rotated frame's origin of the lowest point that has others around it, and
/// how many lie below. One point under an object does not lift it. \[m\]
pub(super) fn support(points: &[Point3<f64>], upright: &UnitQuaternion<f64>) -> (f64, usize) {
    let height = |p: &Point3<f64>| (upright * p).z;
    let lowest = points.iter().map(height).fold(f64::INFINITY, f64::min);
    let Some((_, size)) = middle_and_size(points) else { return (lowest, 0) };
    let count = points.len();
    let side = (size / 50.0).max(1.5 * size / (count as f64).sqrt());
    let cells: HashMap<[i64; 3], usize> = counts(points.iter().copied(), side);
    let enough = (count / 1000).clamp(4, MIN_POINTS);
    let alone = |p: &Point3<f64>| {
        let near = around(cell(p, side)).filter_map(|key| cells.get(&key)).sum::<usize>();
        near < enough
    };
    // The hundredth of all that lies lowest; if none of it has company, nothing is stray.
    let mut order: Vec<u32> = (0..count as u32).collect();
    let by_height =
        |&a: &u32, &b: &u32| height(&points[a as usize]).total_cmp(&height(&points[b as usize]));
    let tried = count.div_ceil(100);
    if tried < count {
        order.select_nth_unstable_by(tried, by_height);
        order.truncate(tried);
    }
    order.sort_unstable_by(by_height);
    match order.iter().position(|&i| !alone(&points[i as usize])) {
        Some(below) => (height(&points[order[below] as usize]), below),
        None => (lowest, 0),
    }
}

/// The median of the points, axis by axis, and the diagonal of the box that leaves a fiftieth of
/// them out to each side; `None` where that has no size. \[m\]
fn middle_and_size(points: &[Point3<f64>]) -> Option<(Point3<f64>, f64)> {
    let mut middle = Point3::origin();
    let mut squared = 0.0;
    for axis in 0..3 {
        let stride = points.len().div_ceil(SAMPLE).max(1);
        let mut values: Vec<f64> = points.iter().step_by(stride).map(|p| p[axis]).collect();
        values.sort_unstable_by(f64::total_cmp);
        let last = values.len().checked_sub(1)?;
        middle[axis] = values[last / 2];
        squared += (values[last - last / 50] - values[last / 50]).powi(2);
    }
    let size = squared.sqrt();
    (size > 0.0 && size.is_finite()).then_some((middle, size))
}

fn cell(point: &Point3<f64>, side: f64) -> [i64; 3] {
    [0, 1, 2].map(|axis| (point[axis] / side).floor() as i64)
}

fn counts(points: impl Iterator<Item = Point3<f64>>, side: f64) -> HashMap<[i64; 3], usize> {
    let mut cells = HashMap::new();
    for point in points {
        *cells.entry(cell(&point, side)).or_insert(0) += 1;
    }
    cells
}

/// A cell and its 26 neighbours; at the end of all numbers fewer.
fn around([x, y, z]: [i64; 3]) -> impl Iterator<Item = [i64; 3]> {
    (0..27).map(move |i| {
        let at = |value: i64, step: i64| value.saturating_add(step - 1);
        [at(x, i % 3), at(y, i / 3 % 3), at(z, i / 9)]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plate of 0.5 × 0.5 m at a height, a point every centimetre.
    fn plate(z: f64) -> Vec<Point3<f64>> {
        let at = |i: i32| 0.01 * f64::from(i);
        (0..2500).map(|i| Point3::new(at(i % 50), at(i / 50), z)).collect()
    }

    #[test]
    fn a_point_far_from_all_others_is_found_wherever_it_is() {
        assert!(find(&plate(1.0)).is_none());
        for far in [[0.2, 0.2, -2.0], [1e6, 0.0, 0.0], [0.0, -1e300, 0.0], [0.2, 0.2, 1.4]] {
            let mut points = plate(1.0);
            points.insert(700, Point3::from(far));
            let strays = find(&points).unwrap_or_else(|| panic!("{far:?}"));
            assert_eq!((strays.count, strays.farthest), (1, Point3::from(far)));
            assert!(strays.flags[700]);
        }
        // What could be a surface of its own is none.
        let mut two = plate(1.0);
        two.extend(plate(5.0).iter().take(40));
        assert!(find(&two).is_none());
    }

    #[test]
    fn a_point_below_does_not_carry_the_object() {
        let level = UnitQuaternion::identity();
        assert_eq!(support(&plate(0.3), &level), (0.3, 0));
        let mut points = plate(0.3);
        points.extend([0.25, 0.2, -4.0].map(|z| Point3::new(0.2, 0.2, z)));
        let (height, below) = support(&points, &level);
        assert_eq!((height, below), (0.3, 3));
        let few: Vec<_> = [0.4, 0.1].map(|z| Point3::new(z, 0.0, z)).to_vec();
        assert_eq!(support(&few, &level), (0.1, 0));
    }
}
