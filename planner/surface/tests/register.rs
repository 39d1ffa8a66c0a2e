//! Registration of two views that a real camera took of one chair.

use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use nullsweep_surface::register::register;
use nullsweep_surface::scan::{self, View};
use nullsweep_surface::{Placement, ReadOptions, place};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// How far a start is off. \[m\], \[rad\]
const OFF: (f64, f64) = (0.05, 0.0873);

/// The second view's frame in the first one's, as the recording's own trajectory has it.
fn stated() -> Isometry3<f64> {
    let turn = Matrix3::new(
        0.999_902, -0.013_990, 0.000_718, 0.013_991, 0.999_901, -0.001_363, -0.000_698, 0.001_373,
        0.999_999,
    );
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&turn));
    Isometry3::from_parts(Translation3::new(-0.162_681, -0.002_036, 0.025_323), turn)
}

fn unit(random: &mut ChaCha8Rng) -> Vector3<f64> {
    loop {
        let v = Vector3::<f64>::from_fn(|_, _| random.random_range(-1.0..1.0));
        if (0.1..1.0).contains(&v.norm()) {
            return v.normalize();
        }
    }
}

#[test]
fn fifty_starts_end_in_the_same_place() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/scans"));
    if !folder.is_dir() {
        eprintln!("skipped: the test data {} is not here", folder.display());
        return;
    }
    let view = |file: &str, pose: Isometry3<f64>| -> View {
        let raw = scan::read(&folder.join(file), &ReadOptions::default()).expect("a scan");
        let sensor = Some(Point3::from(pose.translation.vector));
        let (placed, _) = place(&raw, &Placement::Frame { pose, sensor });
        placed.views.into_iter().next().expect("a view")
    };
    let first = view("kinect_chair_view0004.pcd", Isometry3::identity());
    let second = view("kinect_chair.pcd", stated());
    let middle = second.points.iter().map(|p| p.coords).sum::<Vector3<f64>>();
    let middle = Point3::from(middle / second.points.len() as f64);
    let there = Translation3::from(middle.coords);
    let mut random = ChaCha8Rng::seed_from_u64(50);
    let mut found: Vec<Isometry3<f64>> = Vec::new();
    for _ in 0..50 {
        let turn = UnitQuaternion::from_scaled_axis(unit(&mut random) * OFF.1);
        let shift = Translation3::from(unit(&mut random) * OFF.0);
        let off = shift * there * turn * there.inverse();
        let moved = View {
            points: second.points.iter().map(|p| off * p).collect(),
            sensor: second.sensor.map(|p| off * p),
            ..View::default()
        };
        let laid = register(std::slice::from_ref(&first), &moved).expect("it is trusted");
        found.push(laid.correction * off);
    }
    let apart = |a: &Isometry3<f64>, b: &Isometry3<f64>| {
        let turned = (a.rotation.inverse() * b.rotation).angle().to_degrees();
        ((a * middle - b * middle).norm() * 1e3, turned)
    };
    let most = |to: &Isometry3<f64>| {
        found
            .iter()
            .map(|f| apart(f, to))
            .fold((0.0, 0.0), |most: (f64, f64), next| (most.0.max(next.0), most.1.max(next.1)))
    };
    let (spread, off) = (most(&found[0]), most(&Isometry3::identity()));
    println!("apart {spread:.3?}, from the trajectory {off:.3?} mm and degrees");
    assert!(spread.0 < 0.3 && spread.1 < 0.1, "{spread:?}");
    // That trajectory is an estimate too, of all of the room: it leaves 0.5° between the two views' floors.
    assert!(off.0 < 3.0 && off.1 < 0.65, "{off:?}");
}
