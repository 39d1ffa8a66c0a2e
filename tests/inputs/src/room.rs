//! A scene that was scanned: its gravity, its planes and what stands on them.

use std::fmt::Write;

use nalgebra::{Point3, Vector3};
use nullsweep_surface::room::{Room, level};
use nullsweep_surface::scan::RawScan;
use nullsweep_surface::{Placement, place};

use crate::scan::scans;

/// Points of a scene that is looked at here.
const POINTS: usize = 6000;

pub(crate) fn run(bytes: &[u8]) -> bool {
    let scenes = scans(bytes).into_iter().filter(|raw| raw.points.len() <= POINTS);
    scenes.filter(ask).count() > 0
}

/// Whether it has a plane.
fn ask(raw: &RawScan) -> bool {
    if let Ok(level) = level(raw, None, 1) {
        assert!((level.up.norm() - 1.0).abs() < 1e-9);
    }
    let up = Placement::Up { up: Vector3::z_axis(), support_height: 0.0 };
    let (scan, _) = place(raw, &up);
    let room = Room::find(&scan, 1);
    for plane in &room.planes {
        assert!(plane.area.is_finite() && (plane.normal.norm() - 1.0).abs() < 1e-9);
        let half = plane.rectangle().half;
        assert!(half.iter().all(|x| x.is_finite() && *x >= 0.0), "{half:?}");
    }
    for segment in &room.segments {
        assert_eq!(segment.points, segment.members.iter().map(Vec::len).sum::<usize>());
        assert!(segment.stands_on < room.planes.len());
        for (view, members) in scan.views.iter().zip(&segment.members) {
            assert!(members.iter().all(|&i| (i as usize) < view.points.len()));
        }
    }
    !room.planes.is_empty()
}

pub(crate) fn made() -> Vec<Vec<u8>> {
    // A floor and a box on it, as dense as normals need.
    let square = |count: u32, side: f64| {
        (0..count * count).map(move |k| [side * f64::from(k % count), side * f64::from(k / count)])
    };
    let floor = square(64, 0.02).map(|[x, y]| Point3::new(x, y, 0.0));
    let top = square(20, 0.015).map(|[x, y]| Point3::new(0.5 + x, 0.6 + y, 0.3));
    let side = square(20, 0.015).map(|[x, z]| Point3::new(0.5 + x, 0.6, z));
    vec![table(floor.chain(top).chain(side))]
}

/// Points as a text file.
pub(crate) fn table(points: impl Iterator<Item = Point3<f64>>) -> Vec<u8> {
    let mut text = String::new();
    for p in points {
        let _ = writeln!(text, "{:.4} {:.4} {:.4}", p.x, p.y, p.z);
    }
    text.into_bytes()
}
