//! What is left, by cause and by place.

use std::collections::HashMap;

use nalgebra::{Point3, UnitVector3, Vector3};

use crate::data::{Place, PlaceGroup};

/// Side of the cells by which points of one place hang together. \[m\]
const CELL: f64 = 0.03;
/// Most places told of one cause; the rest is told in one line.
const MOST: usize = 12;
/// Share of all points from which on a place is told by itself. \[%\]
const WORTH: f64 = 0.1;

/// A point that is left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeftPoint {
    /// Where. \[m\]
    pub at: Point3<f64>,
    /// The surface's normal there.
    pub normal: UnitVector3<f64>,
    /// Why: an index into the causes.
    pub cause: usize,
}

/// The points that are left as a list: the cause with most of them first, and of each the largest
/// place first. `all` is how many points there are, swept and left, `things` what they are: points, poses.
#[must_use]
pub fn places(
    causes: &[String],
    left: &[LeftPoint],
    (all, things): (usize, &str),
) -> Vec<PlaceGroup> {
    let mut groups: Vec<(usize, PlaceGroup)> = Vec::new();
    for (cause, name) in causes.iter().enumerate() {
        let points: Vec<&LeftPoint> = left.iter().filter(|p| p.cause == cause).collect();
        if points.is_empty() {
            continue;
        }
        let mut clusters = clusters(&points);
        clusters.sort_by_key(|cluster| std::cmp::Reverse(cluster.len()));
        let share = |n: usize| 100.0 * n as f64 / all.max(1) as f64;
        let worth = clusters.iter().take(MOST).filter(|c| share(c.len()) >= WORTH).count();
        let (told, rest) = clusters.split_at(worth);
        let mut items: Vec<Place> =
            told.iter().map(|cluster| place(cluster, share(cluster.len()))).collect();
        if !rest.is_empty() {
            let all: Vec<&LeftPoint> = rest.iter().flatten().copied().collect();
            let label = format!(
                "{} in {} smaller {}",
                percent(share(all.len())),
                rest.len(),
                if rest.len() == 1 { "place" } else { "places" }
            );
            items.push(Place { label, normal: None, ..place(&all, 0.0) });
        }
        let detail = format!("{} of all {things}", percent(share(points.len())));
        groups.push((points.len(), PlaceGroup { name: name.clone(), detail, items }));
    }
    groups.sort_by_key(|(points, _)| std::cmp::Reverse(*points));
    groups.into_iter().map(|(_, group)| group).collect()
}

/// Points whose cells touch, also over corners, are of one place.
fn clusters<'a>(points: &[&'a LeftPoint]) -> Vec<Vec<&'a LeftPoint>> {
    let cell = |p: &LeftPoint| [0, 1, 2].map(|i| (p.at[i] / CELL).floor() as i64);
    let mut cells: HashMap<[i64; 3], Vec<&'a LeftPoint>> = HashMap::new();
    let mut order = Vec::new();
    for point in points {
        let key = cell(point);
        let list = cells.entry(key).or_default();
        if list.is_empty() {
            order.push(key);
        }
        list.push(point);
    }
    let mut clusters = Vec::new();
    for start in order {
        let Some(first) = cells.remove(&start) else { continue };
        let (mut cluster, mut open) = (first, vec![start]);
        while let Some([x, y, z]) = open.pop() {
            for n in 0..27 {
                let key = [x + n % 3 - 1, y + n / 3 % 3 - 1, z + n / 9 - 1];
                if let Some(found) = cells.remove(&key) {
                    cluster.extend(found);
                    open.push(key);
                }
            }
        }
        clusters.push(cluster);
    }
    clusters
}

fn percent(share: f64) -> String {
    if share < 0.05 { "under 0.1 %".into() } else { format!("{share:.1} %") }
}

fn place(points: &[&LeftPoint], share: f64) -> Place {
    let n = points.len().max(1) as f64;
    let at = Point3::from(points.iter().map(|p| p.at.coords).sum::<Vector3<f64>>() / n);
    let radius = points.iter().map(|p| (p.at - at).norm()).fold(0.02, f64::max);
    let normal: Vector3<f64> = points.iter().map(|p| p.normal.into_inner()).sum();
    let label = format!("{} at {:.2}, {:.2}, {:.2} m", percent(share), at.x, at.y, at.z);
    Place { label, at, radius, normal: UnitVector3::try_new(normal, 1e-6) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(from: f64, count: usize, cause: usize) -> impl Iterator<Item = LeftPoint> {
        (0..count).map(move |i| LeftPoint {
            at: Point3::new(from + 0.01 * i as f64, 0.0, 0.5),
            normal: Vector3::z_axis(),
            cause,
        })
    }

    #[test]
    fn places_are_apart_by_cause_and_by_distance_largest_first() {
        let causes = ["out of reach".to_owned(), "missed".to_owned(), "never".to_owned()];
        let left: Vec<LeftPoint> =
            row(0.0, 5, 1).chain(row(1.0, 20, 1)).chain(row(0.0, 4, 0)).collect();
        let groups = places(&causes, &left, (58, "points"));
        let names: Vec<&str> = groups.iter().map(|g| g.name.as_str()).collect();
        assert_eq!(names, ["missed", "out of reach"], "a cause of nothing is not told");
        assert_eq!(groups[0].items.len(), 2);
        let large = &groups[0].items[0];
        assert!((large.at - Point3::new(1.095, 0.0, 0.5)).norm() < 1e-9, "{large:?}");
        assert!(large.label.starts_with("34.5 %") && large.radius > 0.09, "{large:?}");
        assert_eq!(groups[0].detail, "43.1 % of all points");
    }

    #[test]
    fn many_places_end_in_one_line_for_the_rest() {
        let left: Vec<LeftPoint> = (0..40).flat_map(|i| row(f64::from(i), 2, 0)).collect();
        let groups = places(&["missed".to_owned()], &left, (100, "points"));
        assert_eq!(groups[0].items.len(), MOST + 1);
        let rest = &groups[0].items[MOST];
        assert!(rest.label.starts_with("56.0 % in 28 smaller places"), "{}", rest.label);
        // A place of next to nothing is not told by itself.
        let speck: Vec<LeftPoint> = row(0.0, 2, 0).chain(row(5.0, 40, 0)).collect();
        let groups = places(&["missed".to_owned()], &speck, (10_000, "points"));
        let labels: Vec<&str> = groups[0].items.iter().map(|item| item.label.as_str()).collect();
        assert_eq!(labels.len(), 2);
        assert_eq!(labels[1], "under 0.1 % in 1 smaller place");
    }
}
