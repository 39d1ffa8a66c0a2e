//! What stands in a scanned room, and one object of it as the surface to sweep.

use std::str::FromStr;

use anyhow::{Context, bail, ensure};
use nalgebra::{Point3, Translation3, Vector3};
use nullsweep_collision::Obstacle;
use nullsweep_planner::progress::Progress;
use nullsweep_planner::workcell::Scene;
use nullsweep_robot::Geometry;
use nullsweep_surface::room::{Plane, PlaneKind, Room, Segment};
use nullsweep_surface::{CleanConfig, PlacedScan, scan};

use crate::bars::Bars;
use crate::floor::Placed;
use crate::numbers::Numbers;
use crate::table::TABLE_TOP;

/// A level plane this near to height 0 is the floor that every scene has. [m]
const FLOOR: f64 = 0.08;

/// Seed by which planes and objects are found where nothing else says it: `planner plan` is to number
/// them as `planner scene` has.
pub(super) const SEED: u64 = 1;

/// Farthest that an object may be from a point that is to name it. [m]
const BESIDE: f64 = 0.05;

/// Which object of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ObjectChoice {
    /// The one with the most points.
    Largest,
    /// Of those on tables.
    LargestOnTable,
    /// By its number, from 1 on.
    Number(usize),
    /// The one at this point of the floor frame. [m]
    At(Point3<f64>),
}

impl FromStr for ObjectChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.parse() {
            Ok(0) => Err("objects are numbered from 1 on".into()),
            Ok(number) => Ok(Self::Number(number)),
            Err(_) if text == "largest" => Ok(Self::Largest),
            Err(_) if text == "largest-on-table" => Ok(Self::LargestOnTable),
            Err(_) => match Numbers::<3>::from_str(text) {
                Ok(Numbers(point)) => Ok(Self::At(point.into())),
                Err(_) => {
                    Err("a number, a point X,Y,Z, `largest` or `largest-on-table` is wanted".into())
                }
            },
        }
    }
}

/// The chosen object as the surface to sweep; all else that was scanned is in the way, floor, tables
/// and walls as far as they were seen. Second, the flying pixels.
pub(super) fn object(
    placed: &Placed,
    choice: ObjectChoice,
    bars: &Bars,
) -> anyhow::Result<(Scene, Vec<Point3<f64>>)> {
    let scan = &placed.scan;
    let room = Room::find(scan, placed.seed.unwrap_or(SEED));
    let count = room.segments.len();
    if let Some(why) = without_objects(&room) {
        bail!("{why}");
    }
    let index = chosen(scan, &room, choice)?;
    let segment = &room.segments[index];
    let corner = |p: &Point3<f64>| format!("{:.2}, {:.2}, {:.2}", p.x, p.y, p.z);
    let planes = match room.planes.len() {
        1 => "1 plane is an obstacle as far as it was seen".into(),
        count => format!("{count} planes are obstacles as far as they were seen"),
    };
    bars.note(&format!(
        "object {} of {count}: {} points from {} to {} m, on the {}; {planes}",
        index + 1,
        segment.points,
        corner(&segment.bounds.min),
        corner(&segment.bounds.max),
        name(room.planes[segment.stands_on].kind),
    ));
    let (surface, _) = scan::clean(&segment.split(scan).0, &CleanConfig::default())?;
    let (mut scene, flying) = Scene::around(surface, scan);
    scene.surroundings.retain(|point| !room.is_on_plane(point));
    scene.obstacles.extend(room.planes.iter().filter_map(obstacle));
    Ok((scene, flying))
}

/// What to say of a scene in which nothing stands on a plane.
pub(super) fn without_objects(room: &Room) -> Option<String> {
    let found = match room.planes.len() {
        _ if !room.segments.is_empty() => return None,
        0 => {
            "no plane was found that an object could stand on, as in a scan that shows the object \
              alone"
                .into()
        }
        1 => "no object stands on the one plane of the scene".into(),
        count => format!("no object stands on the {count} planes of the scene"),
    };
    Some(format!(
        "{found}: leave out --object, which sweeps all that was scanned, or cut out with --crop what is \
         to be swept"
    ))
}

/// The index of the object that is chosen.
fn chosen(scan: &PlacedScan, room: &Room, choice: ObjectChoice) -> anyhow::Result<usize> {
    let (segments, count) = (&room.segments, room.segments.len());
    match choice {
        ObjectChoice::Largest => Ok(0),
        ObjectChoice::LargestOnTable => {
            let on_table = |s: &Segment| room.planes[s.stands_on].kind == PlaneKind::Table;
            segments.iter().position(on_table).context("no object stands on a table")
        }
        ObjectChoice::Number(number) => {
            ensure!(number <= count, "there is no object {number}: `planner scene` shows {count}");
            Ok(number - 1)
        }
        ObjectChoice::At(point) => {
            let distance = |segment: &Segment| {
                let views = scan.views.iter().zip(&segment.members);
                let points = views.flat_map(|(v, m)| m.iter().map(|&i| v.points[i as usize]));
                points.map(|p| nalgebra::distance(&p, &point)).fold(f64::INFINITY, f64::min)
            };
            let near = segments.iter().map(distance).enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
            let (index, apart) = near.context("no object is there")?;
            ensure!(
                apart <= BESIDE,
                "no object is at {point:.3}: the nearest, object {}, is {apart:.2} m away",
                index + 1
            );
            Ok(index)
        }
    }
}

/// What a plane is called.
pub(super) fn name(kind: PlaneKind) -> &'static str {
    match kind {
        PlaneKind::Floor => "floor",
        PlaneKind::Table => "table",
        PlaneKind::Wall => "wall",
    }
}

/// A plate as large as a plane was seen, on the plane's far side; none for the floor itself.
fn obstacle(plane: &Plane) -> Option<Obstacle> {
    if plane.kind == PlaneKind::Floor && plane.point.z.abs() < FLOOR {
        return None;
    }
    let rectangle = plane.rectangle();
    let half = 0.5 * TABLE_TOP;
    let [x, y] = rectangle.half;
    Some(Obstacle {
        name: name(plane.kind).into(),
        shape: Geometry::Box { half_extents: Vector3::new(x, y, half) }.into(),
        pose: rectangle.pose * Translation3::new(0.0, 0.0, -half),
        carries_robot: false,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plate_reaches_as_far_as_the_plane_was_seen_and_not_above_it() {
        let corner = |x: f64, y: f64| Point3::new(x, y, 0.7);
        let plane = Plane {
            point: corner(0.1, 0.0),
            normal: Vector3::z_axis(),
            outline: vec![corner(0.0, -1.0), corner(0.5, -1.0), corner(0.5, 1.0), corner(0.0, 1.0)],
            area: 1.0,
            kind: PlaneKind::Table,
        };
        let plate = obstacle(&plane).expect("a table is an obstacle");
        let nullsweep_collision::ObstacleShape::Geometry(Geometry::Box { half_extents }) =
            plate.shape
        else {
            panic!("a plate is a box");
        };
        let middle = plate.pose * Point3::origin();
        assert!((middle - Point3::new(0.25, 0.0, 0.7 - 0.5 * TABLE_TOP)).norm() < 1e-9);
        let reach = plate.pose.rotation * half_extents;
        assert!((reach.abs() - Vector3::new(0.25, 1.0, 0.5 * TABLE_TOP)).norm() < 1e-9);
        let floor = Plane { kind: PlaneKind::Floor, point: Point3::origin(), ..plane };
        assert!(obstacle(&floor).is_none(), "every scene has a floor by itself");
    }
}
