//! Floor, tables, walls and objects of a room, from points alone.

use std::path::Path;

use nalgebra::{Isometry3, Point3, Rotation3, UnitVector3, Vector3};
use nullsweep_surface::room::{LevelError, PlaneKind, Room, lean, level};
use nullsweep_surface::scan;
use nullsweep_surface::{PlacedScan, Placement, RawScan, ReadOptions};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A rectangle: a corner and its two sides. \[m\]
type Sheet = ([f64; 3], [f64; 3], [f64; 3]);

/// A wall 2.5 m ahead, a table of 0.8 × 0.7 m and 0.7 m height, on it a box of 0.2 m, beside it on the
/// floor one of 0.3 m: the sides that a camera at x = −1.5 sees.
const ROOM: [Sheet; 9] = [
    ([-0.8, -1.5, 0.0], [1.8, 0.0, 0.0], [0.0, 3.0, 0.0]),
    ([1.0, -1.5, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 2.0]),
    ([-0.1, -0.4, 0.7], [0.7, 0.0, 0.0], [0.0, 0.8, 0.0]),
    ([0.2, -0.1, 0.72], [0.0, 0.2, 0.0], [0.0, 0.0, 0.2]),
    ([0.2, -0.1, 0.92], [0.2, 0.0, 0.0], [0.0, 0.2, 0.0]),
    ([0.2, 0.1, 0.72], [0.2, 0.0, 0.0], [0.0, 0.0, 0.2]),
    ([-0.3, 0.8, 0.0], [0.0, 0.3, 0.0], [0.0, 0.0, 0.3]),
    ([-0.3, 0.8, 0.3], [0.3, 0.0, 0.0], [0.0, 0.3, 0.0]),
    ([-0.3, 0.8, 0.0], [0.3, 0.0, 0.0], [0.0, 0.0, 0.3]),
];

/// The room's points in its own frame, with a noise of 3 mm.
fn points(seed: u64) -> Vec<Point3<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut points = Vec::new();
    for (corner, u, v) in
        ROOM.map(|(c, u, v)| (Point3::from(c), Vector3::from(u), Vector3::from(v)))
    {
        let count = (u.norm() * v.norm() / 0.008f64.powi(2)) as usize;
        for _ in 0..count {
            let mut random = || rng.random::<f64>();
            let at = corner + u * random() + v * random();
            let noise = Vector3::new(random(), random(), random()) - Vector3::repeat(0.5);
            points.push(at + noise * 0.006);
        }
    }
    points
}

/// What a camera 1.3 m up and 20° down sees of it, in its optical frame.
fn seen(seed: u64) -> (RawScan, UnitVector3<f64>) {
    let tilt = 20f64.to_radians();
    let forward = Vector3::new(tilt.cos(), 0.0, -tilt.sin());
    let right = -Vector3::y();
    let rows = [right.transpose(), forward.cross(&right).transpose(), forward.transpose()];
    let turn = Rotation3::from_matrix_unchecked(nalgebra::Matrix3::from_rows(&rows));
    let eye = Point3::new(-1.5, 0.0, 1.3);
    let points = points(seed)
        .into_iter()
        .map(|p| Point3::from(turn * (p - eye)))
        .filter(|p| p.z > 0.2 && p.x.abs() < p.z && p.y.abs() < p.z)
        .collect();
    let raw = RawScan { points, ..RawScan::default() };
    (raw, UnitVector3::new_normalize(turn * Vector3::z()))
}

#[test]
fn a_direction_that_no_plane_is_level_by_is_doubted() {
    let (raw, up) = seen(1);
    assert_eq!(lean(&raw, &up, 1), None);
    let little = Rotation3::from_axis_angle(&Vector3::x_axis(), 0.1) * up;
    assert_eq!(lean(&raw, &little, 1), None, "as exact as a hand-held level");
    // About the axis that the camera looks along, so that the wall does not become level.
    let wrong = Rotation3::from_axis_angle(&Vector3::z_axis(), 0.6) * up;
    let found = lean(&raw, &wrong, 1).expect("none is level by it");
    assert!((found.angle - wrong.angle(&up)).abs() < 0.01, "{found:?}");
    assert!(found.up.angle(&up) < 0.01 && found.area > 0.3, "{found:?}");
    // A single thing without a plane tells nothing.
    let points = raw.points.iter().take(40).copied().collect();
    assert_eq!(lean(&RawScan { points, ..RawScan::default() }, &wrong, 1), None);
}

#[test]
fn a_camera_finds_which_way_is_up_and_how_high_it_is() {
    for seed in 1..4 {
        let (raw, up) = seen(seed);
        let found = level(&raw, None, seed).unwrap();
        assert!(found.up.angle(&up) < 0.005, "{:.4} rad off", found.up.angle(&up));
        assert!((found.height - 1.3).abs() < 0.01, "{found:?}");
        assert!(found.camera);
        assert_eq!(level(&raw, None, seed), Ok(found));
    }
    let (raw, up) = seen(1);
    // The same points, where their file says that no camera or a scanner elsewhere has seen them.
    let unseen = level(&RawScan { sensor: None, ..raw.clone() }, None, 1).unwrap();
    assert!(!unseen.camera && unseen.up.angle(&up) < 0.005);
    let elsewhere = RawScan { sensor: Some(Point3::new(5.0, 6.0, 7.0)), ..raw.clone() };
    assert!(!level(&elsewhere, Some(up), 1).unwrap().camera);
    let told = level(&raw, Some(up), 1).unwrap();
    assert!((told.height - 1.3).abs() < 0.01);
    // One that is a little wrong is taken at its word, and the plane's middle stays the support.
    let aside = nalgebra::UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 0.1) * up;
    let told = level(&raw, Some(aside), 1).unwrap();
    assert_eq!(told.up, aside);
    let placement =
        Placement::UpAndHeight { up: aside, sensor_height: told.height, support_height: 0.0 };
    let (scan, _) = scan::place(&raw, &placement);
    let near = |p: &&Point3<f64>| p.z.abs() < 0.02;
    assert!(scan.views[0].points.iter().filter(near).count() > 100, "nothing is at the floor");
    let sideways = UnitVector3::new_normalize(Vector3::new(0.8, 0.0, 0.6));
    assert!(matches!(level(&raw, Some(sideways), 1), Err(LevelError::NoPlane { .. })));
}

/// The room as it is placed by what was found in it.
fn placed(seed: u64) -> PlacedScan {
    let (raw, _) = seen(seed);
    let found = level(&raw, None, seed).unwrap();
    let placement =
        Placement::UpAndHeight { up: found.up, sensor_height: found.height, support_height: 0.0 };
    scan::place(&raw, &placement).0
}

#[test]
fn planes_and_objects_are_what_stands_there() {
    let scan = placed(2);
    let room = Room::find(&scan, 1);
    let kinds: Vec<PlaneKind> = room.planes.iter().map(|plane| plane.kind).collect();
    let count = |kind| kinds.iter().filter(|k| **k == kind).count();
    assert_eq!(count(PlaneKind::Floor), 1, "{kinds:?}");
    assert_eq!(count(PlaneKind::Table), 1, "{kinds:?}");
    assert_eq!(count(PlaneKind::Wall), 1, "{kinds:?}");
    let table = room.planes.iter().find(|plane| plane.kind == PlaneKind::Table).unwrap();
    assert!((table.point.z - 0.7).abs() < 0.01, "{:?}", table.point);
    let mut half = table.rectangle().half;
    half.sort_by(f64::total_cmp);
    assert!((half[0] - 0.35).abs() < 0.04 && (half[1] - 0.4).abs() < 0.04, "{half:?}");

    assert_eq!(room.segments.len(), 2, "{:?}", room.segments.iter().map(|s| s.points));
    let [large, small] = &room.segments[..] else { unreachable!("two objects") };
    assert_eq!(room.planes[large.stands_on].kind, PlaneKind::Floor);
    assert_eq!(room.planes[small.stands_on].kind, PlaneKind::Table);
    let side =
        |s: &nullsweep_surface::room::Segment, axis: usize| s.bounds.max[axis] - s.bounds.min[axis];
    assert!((side(large, 1) - 0.3).abs() < 0.03 && (side(small, 1) - 0.2).abs() < 0.03);
    let (own, rest) = small.split(&scan);
    assert_eq!(own.len(), small.points);
    assert_eq!(own.len() + rest.len(), scan.len());
    // What a mesh knows beside its points goes with the thing that it is of.
    let mut mesh = scan.clone();
    mesh.views[0].faces = mesh.views[0].points.iter().map(|p| p + Vector3::z() * 1e-4).collect();
    mesh.views[0].inside = large.split(&scan).0.views[0].points.clone();
    let (own, rest) = small.split(&mesh);
    let counts = |part: &PlacedScan| [part.views[0].faces.len(), part.views[0].inside.len()];
    assert_eq!(counts(&own), [small.points, 0]);
    assert_eq!(counts(&rest), [scan.len() - small.points, large.points]);
    assert_eq!(Room::find(&scan, 1), room, "the same seed finds the same room");
}

#[test]
fn the_chair_of_a_whole_scene_is_the_cropped_one() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/scans"));
    if !folder.is_dir() {
        eprintln!("skipped: the test data {} is not here", folder.display());
        return;
    }
    let read = |file: &str| scan::read(&folder.join(file), &ReadOptions::default()).unwrap();
    let raw = read("kinect_chair_scene_640x480.pcd");
    let found = level(&raw, None, 1).unwrap();
    let up = UnitVector3::new_normalize(Vector3::new(-0.0063, -0.9985, -0.0537));
    assert!(found.up.angle(&up) < 0.02, "{:.3} rad off", found.up.angle(&up));
    assert!((found.height - 0.829).abs() < 0.03, "{:.3} m high", found.height);
    let placement =
        Placement::UpAndHeight { up: found.up, sensor_height: found.height, support_height: 0.0 };
    let (scan, pose): (PlacedScan, Isometry3<f64>) = scan::place(&raw, &placement);
    let room = Room::find(&scan, 1);
    let key = |p: &Point3<f64>| [0, 1, 2].map(|axis| (p[axis] * 2000.0).round() as i64);
    let back = pose.inverse();
    let chair: std::collections::HashSet<_> =
        read("kinect_chair.pcd").points.iter().map(key).collect();
    let shares: Vec<f64> = room
        .segments
        .iter()
        .map(|segment| {
            let (own, _) = segment.split(&scan);
            let own = own.views[0].points.iter().map(|p| key(&(back * p)));
            let common = own.filter(|k| chair.contains(k)).count() as f64;
            common / (segment.points.max(chair.len())) as f64
        })
        .collect();
    assert!(shares.iter().any(|share| *share > 0.9), "{shares:?}");
}

#[test]
fn numbers_beyond_all_rooms_make_no_object() {
    // Their cells are the first and the last of all.
    let corner = |i: usize| if i.is_multiple_of(2) { 1e300 } else { -1e300 };
    let points: Vec<_> = (0..400).map(|i| Point3::new(corner(i), 1e300, -1e300)).collect();
    let view = scan::View { points, ..scan::View::default() };
    let room = Room::find(&PlacedScan { views: vec![view] }, 1);
    assert!(room.planes.is_empty(), "{:?}", room.planes);
}
