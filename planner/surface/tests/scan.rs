//! Scans from files and from the simulated sensor, and the patches made of them.

use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};
use nullsweep_surface::{
    CleanConfig, Grid, PatchConfig, PlacedScan, Placement, ReadOptions, Scan, ScanError, patches,
    scan, scan::Format, scan::ScanWarning, scan::View, simulate, simulate::SimulatedView,
};

/// The test data, or `None` with the reason printed.
fn data(folder: &str) -> Option<PathBuf> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data")).join(folder);
    if !path.is_dir() {
        eprintln!("skipped: the test data {} is not here", path.display());
        return None;
    }
    Some(path)
}

fn cleaned(view: &SimulatedView) -> Scan {
    let (placed, _) = scan::place(&view.scan, &Placement::SensorPose(view.sensor_pose));
    scan::clean(&placed, &CleanConfig::default()).expect("a simulated view is clean").0
}

#[test]
fn every_bad_scan_gets_what_its_index_says() {
    let Some(folder) = data("bad-scans") else { return };
    let index = std::fs::read_to_string(folder.join("index.tsv")).expect("the index reads");
    let mut checked = 0;
    for row in index.lines().skip(1) {
        let columns: Vec<&str> = row.split('\t').collect();
        let (file, expected) = (columns[0], columns[2]);
        let path = folder.join(file);
        let result = scan::read(&path, &ReadOptions::default());
        if let Err(error) = &result {
            let text = error.to_string();
            assert!(text.contains(file), "{file}: the error does not name the file: {text}");
        }
        let count = result.as_ref().map(|raw| raw.points.len());
        let wanted: Option<usize> = expected.split(' ').find_map(|word| word.parse().ok());
        match (file, expected) {
            ("pcd_points_too_few.pcd", _) => {
                let raw = result.expect("the points announced are sound");
                assert!(matches!(raw.warnings[..], [ScanWarning::TrailingData { .. }]));
            }
            ("pcd_big_mm.pcd", _) => {
                let raw = result.expect("the unit is the user's to say");
                let warning = &raw.warnings[..];
                assert!(matches!(warning, [ScanWarning::LooksLikeMillimetres { .. }]));
                let options = ReadOptions { scale: 0.001, ..ReadOptions::default() };
                assert_eq!(scan::read(&path, &options).expect("scaled").warnings, []);
            }
            ("pcd_duplicated_x2.pcd", _) => assert_eq!(count.unwrap(), 2 * 1928),
            ("ply_quad_faces.ply", _) => assert!(count.unwrap() > 100_000, "1 m² sampled"),
            ("pcd_commas.pcd", _) => assert!(result.is_err()),
            (_, e) if e.starts_with("accept") => {
                assert_eq!(count.ok(), wanted.or(Some(1928)), "{file}: {expected}");
            }
            (_, e) if e.starts_with("reject") => {
                assert!(result.is_err(), "{file} was accepted, expected: {expected}");
            }
            _ => panic!("{file}: no rule for {expected:?}"),
        }
        checked += 1;
    }
    assert!(checked >= 35, "only {checked} files in the index");
}

#[test]
fn the_same_points_come_out_of_every_format() {
    let Some(folder) = data("bad-scans") else { return };
    let read = |file: &str| scan::read(&folder.join(file), &ReadOptions::default()).unwrap().points;
    let reference = read("pcd_bom.pcd");
    for file in [
        "pcd_crlf_ascii.pcd",
        "pcd_compressed_valid.pcd",
        "ply_big_endian.ply",
        "ply_other_element_first.ply",
        "ply_crlf.ply",
        "ply_crlf_header_binary.ply",
        "xyz_commas.csv",
    ] {
        let points = read(file);
        assert_eq!(points.len(), reference.len(), "{file}");
        for (a, b) in points.iter().zip(&reference) {
            assert!((a - b).norm() < 1e-5, "{file}: {a} is not {b}");
        }
    }
}

#[test]
fn a_pcd_reads_as_another_reader_reads_it() {
    let Some(folder) = data("scans") else { return };
    for file in ["kinect_pot.pcd", "kinect_chair_scene_640x480.pcd"] {
        let path = folder.join(file);
        let ours = scan::read(&path, &ReadOptions::default()).expect("a sound file");
        let reader = pcd_rs::DynReader::open(&path).expect("a sound file");
        let mut theirs = Vec::new();
        for record in reader {
            let xyz = record.expect("a sound record").to_xyz::<f32>().expect("x, y, z first");
            if xyz.iter().all(|c| c.is_finite()) {
                theirs.push(xyz.map(f64::from));
            }
        }
        assert_eq!(ours.points.len(), theirs.len(), "{file}");
        assert!(ours.points.iter().zip(&theirs).all(|(a, b)| a.coords == Vector3::from(*b)));
    }
}

#[test]
fn a_kinect_chair_becomes_a_scan_that_looks_at_its_sensor() {
    let Some(folder) = data("scans") else { return };
    let raw = scan::read(&folder.join("kinect_chair.pcd"), &ReadOptions::default()).unwrap();
    let placement = Placement::UpAndHeight {
        up: UnitVector3::new_normalize(Vector3::new(-0.0063, -0.9985, -0.0537)),
        sensor_height: 0.829,
        support_height: 0.0,
    };
    let (placed, pose) = scan::place(&raw, &placement);
    let (scan, report) = scan::clean(&placed, &CleanConfig::default()).unwrap();
    let sensor = pose.translation.vector;
    let facing = |i: usize| scan.normals[i].dot(&(sensor - scan.points[i].coords)) > 0.0;
    let share =
        (0..scan.points.len()).filter(|&i| facing(i)).count() as f64 / scan.points.len() as f64;
    assert!(share > 0.98, "only {share:.3} of the normals look at the sensor");
    let heights = scan.points.iter().map(|p| p.z);
    let (lowest, highest) = heights.fold((f64::MAX, f64::MIN), |(l, h), z| (l.min(z), h.max(z)));
    assert!(lowest > -0.02 && (0.7..1.0).contains(&highest), "{lowest:.3} to {highest:.3} m");
    assert!(report.noise < 0.006, "smoothing moved the points by {:.4} m", report.noise);
}

#[test]
fn a_mesh_without_a_sensor_has_outward_normals() {
    let Some(folder) = data("scans") else { return };
    let raw = scan::read(&folder.join("lidar_car_x0.15.pcd"), &ReadOptions::default()).unwrap();
    let placement = Placement::Up { up: Vector3::z_axis(), support_height: 0.45 };
    let (placed, _) = scan::place(&raw, &placement);
    let (scan, _) = scan::clean(&placed, &CleanConfig::default()).unwrap();
    // What lies level in the upper half of a car is roof, bonnet or boot, and looks up.
    let level: Vec<f64> = (0..scan.points.len())
        .filter(|&i| scan.points[i].z > 0.60 && scan.normals[i].z.abs() > 0.7)
        .map(|i| scan.normals[i].z)
        .collect();
    let share = level.iter().filter(|&&z| z > 0.0).count() as f64 / level.len() as f64;
    assert!(level.len() > 100 && share > 0.95, "{share:.2} of {} look up", level.len());
    // No camera made it, so nothing flies: what is too thin for a surface is known too.
    let known = Grid::new(&scan.points, 0.015);
    let lost =
        placed.views[0].points.iter().filter(|p| known.nearest(p, 0.015, |_| true).is_none());
    assert_eq!(lost.count(), 0);
}

/// A plate of half a metre and what else a scanner saw in its hall, without a sensor.
fn hall(beside: impl IntoIterator<Item = Point3<f64>>) -> PlacedScan {
    let at = |i: i32| 0.01 * f64::from(i);
    let plate = (0..2500).map(|i| Point3::new(at(i % 50), at(i / 50), 1.0));
    let points = plate.chain(beside).collect();
    PlacedScan { views: vec![View { points, ..View::default() }] }
}

#[test]
fn what_is_far_from_the_scan_is_in_the_way_and_not_to_be_swept() {
    let far: Vec<Point3<f64>> =
        (0..400).map(|i| Point3::new(40.0, f64::from(i % 20), 0.2 * f64::from(i / 20))).collect();
    let near = Point3::new(0.25, 0.25, 1.4);
    let placed = hall(far.iter().copied().chain([near]));
    let (scan, report) = scan::clean(&placed, &CleanConfig::default()).unwrap();
    let alone: Vec<&Point3<f64>> = scan.points.iter().filter(|p| p.z != 1.0).collect();
    assert!(alone.contains(&&near));
    assert!(scan.points.iter().all(|p| p.x < 1.0));
    assert_eq!(report.single, 1);
    assert_eq!(
        report.kept - report.single + report.merged + report.outliers + report.loose,
        report.points,
        "{report:?}"
    );
    let rest = scan::measured(&placed, &scan).rest;
    assert_eq!(rest, far);
}

#[test]
fn single_points_do_not_go_beyond_the_most_that_there_may_be() {
    let spray = (0..1000).map(|i| {
        let at = |k: i32| 0.05 * f64::from(k);
        Point3::new(at(i % 10), at(i / 10 % 10), 1.2 + 0.05 * f64::from(i / 100))
    });
    let placed = hall(spray);
    let config = CleanConfig { max_points: 2700, ..CleanConfig::default() };
    let (scan, report) = scan::clean(&placed, &config).unwrap();
    assert!(scan.points.len() <= 2700, "{report:?}");
    assert_eq!(report.kept, scan.points.len());
    let measured = scan::measured(&placed, &scan);
    assert_eq!(measured.raw.len() + measured.rest.len(), placed.len());
}

/// A file whose points are in their place already, with the sensor elsewhere than at its origin.
#[test]
fn a_scanner_stands_where_its_file_says() {
    let head = "50\n50\n5 6 7\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n5 6 7 1\n";
    let row =
        |i: i32| format!("{} {} -2 0.5\n", 0.01 * f64::from(i % 50), 0.01 * f64::from(i / 50));
    let one = head.to_owned() + &(0..2500).map(row).collect::<String>();
    let read = |text: &str, scale: f64| {
        let options = ReadOptions { scale, ..ReadOptions::default() };
        scan::read_bytes(text.as_bytes(), Format::Ptx, Path::new("a.ptx"), &options).unwrap()
    };
    let raw = read(&one, 0.5);
    assert_eq!((raw.sensor, raw.viewpoint), (Some(Point3::new(2.5, 3.0, 3.5)), None));
    let raw = read(&one, 1.0);
    // It looks down on what lies 2 m below it, in the file at z = 5.
    let up = Vector3::z_axis();
    let placement = Placement::UpAndHeight { up, sensor_height: 2.0, support_height: 0.5 };
    let (placed, pose) = scan::place(&raw, &placement);
    let view = &placed.views[0];
    assert!(view.points.iter().all(|p| (p.z - 0.5).abs() < 1e-9));
    let sensor = view.sensor.unwrap();
    assert!((sensor - pose * Point3::new(5.0, 6.0, 7.0)).norm() < 1e-12);
    let (scan, _) = scan::clean(&placed, &CleanConfig::default()).unwrap();
    assert!(scan.normals.iter().all(|n| n.z > 0.9));
    // What the library is told of the file's frame is not said twice.
    let (placed, _) = scan::place(&raw, &Placement::Viewpoint);
    assert_eq!(placed.views[0].points, raw.points);
    assert_eq!(placed.views[0].sensor, raw.sensor);
    let turned = Isometry3::rotation(Vector3::new(0.0, 0.0, 1.0));
    let (placed, _) = scan::place(&raw, &Placement::SensorPose(turned));
    assert_eq!(placed.views[0].sensor, raw.sensor.map(|at| turned * at));
    // Of two scans nobody knows which point was seen from where.
    let both = read(&(one.clone() + &one), 1.0);
    assert_eq!(both.sensor, None);
    for placement in [placement, Placement::Viewpoint, Placement::SensorPose(turned)] {
        assert_eq!(scan::place(&both, &placement).0.views[0].sensor, None);
    }
}

#[test]
fn a_mesh_has_no_sensor() {
    let mesh = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\nv 5 5 5\n";
    let options = ReadOptions::default();
    let read =
        |bytes: &[u8]| scan::read_bytes(bytes, Format::Obj, Path::new("a.obj"), &options).unwrap();
    let raw = read(mesh);
    assert_eq!(raw.sensor, None);
    assert!(raw.warnings.contains(&ScanWarning::NoFace { points: 1 }));
    let cloud: String = (0..100).map(|i| format!("v {i} 0 {}\n", i % 10)).collect();
    assert_eq!(read(cloud.as_bytes()).sensor, Some(Point3::origin()));
}

#[test]
fn simulated_objects_have_the_patch_counts_of_the_paper() {
    for seed in 1..=3 {
        let chair = cleaned(&simulate::chair(seed));
        let count = patches::find(&chair, &PatchConfig::default(), seed).len();
        assert!((170..=210).contains(&count), "chair, seed {seed}: {count} patches");
        let car = cleaned(&simulate::bobby_car(seed));
        let count = patches::find(&car, &PatchConfig::default(), seed).len();
        assert!((110..=130).contains(&count), "bobby car, seed {seed}: {count} patches");
    }
}

#[test]
fn a_seed_gives_the_same_scan_and_patches() {
    let view = simulate::bobby_car(7);
    assert_eq!(view, simulate::bobby_car(7));
    assert_ne!(view.scan.points, simulate::bobby_car(8).scan.points);
    let scan = cleaned(&view);
    // Another number of threads must not change a bit.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread");
    assert_eq!(scan, pool.install(|| cleaned(&view)));
    let config = PatchConfig::default();
    assert_eq!(patches::find(&scan, &config, 3), patches::find(&scan, &config, 3));
    assert_ne!(patches::find(&scan, &config, 3), patches::find(&scan, &config, 4));
}

#[test]
fn patches_are_planar_disjoint_and_face_the_scans_side() {
    let scan = cleaned(&simulate::bobby_car(2));
    let config = PatchConfig::default();
    let mut taken = vec![false; scan.points.len()];
    for patch in patches::find(&scan, &config, 2) {
        let mut heights = Vec::new();
        for &index in &patch.points {
            let point = scan.points[index as usize];
            assert!(!std::mem::replace(&mut taken[index as usize], true), "a point of two patches");
            assert!((point - patch.centre).norm() < 2.0 * config.epsilon);
            heights.push((point - patch.centre).dot(&patch.normal));
            assert!(scan.normals[index as usize].dot(&patch.normal) > 0.0);
        }
        assert!(heights.contains(&0.0), "the centre is a point of the patch");
        let count = heights.len() as f64;
        let mean = heights.iter().sum::<f64>() / count;
        let rmse = (heights.iter().map(|h| (h - mean).powi(2)).sum::<f64>() / count).sqrt();
        assert!((rmse - patch.rmse).abs() < 1e-9, "stored {} recomputed {rmse}", patch.rmse);
        assert!(rmse <= config.max_rmse);
    }
    let share = taken.iter().filter(|t| **t).count() as f64 / taken.len() as f64;
    assert!(share > 0.97, "{share:.3} of the points are in patches");
}

#[test]
fn a_flat_cloud_of_one_line_is_no_surface() {
    let rows: String = (0..500).map(|i| format!("{} 0 0\n", 0.001 * f64::from(i))).collect();
    let raw = scan::read_bytes(
        rows.as_bytes(),
        Format::Text,
        Path::new("line.xyz"),
        &ReadOptions::default(),
    )
    .expect("the file is sound");
    let (placed, _) = scan::place(&raw, &Placement::Viewpoint);
    let result = scan::clean(&placed, &CleanConfig::default());
    assert!(matches!(result, Err(ScanError::NoSurface { .. })));
}

#[test]
fn a_region_keeps_its_density_in_a_large_scene() {
    let view = simulate::chair(4);
    let (placed, _) = scan::place(&view.scan, &Placement::SensorPose(view.sensor_pose));
    let seat = simulate::chair_seat();
    let config = CleanConfig { max_points: 20_000, ..CleanConfig::default() };
    let (surface, report) = scan::clean_region(&placed, &seat, &config).unwrap();
    assert!(report.voxel < 0.006, "voxel {}", report.voxel);
    assert!(surface.points.iter().all(|p| seat.contains(p)));
    assert!(surface.points.len() > 5_000);
    // The level plate is level up to its borders: they were smoothed with what lies beyond.
    let tilted = surface.normals.iter().filter(|n| n.z < 0.9).count();
    assert!(tilted < surface.points.len() / 5, "{tilted} normals lean");
    // No measurement is lost: the surface stands for it, or it is in the way, or it flies alone.
    let around = scan::measured(&placed, &surface);
    let all = around.raw.len() + around.rest.len() + around.flying.len();
    assert_eq!(all, placed.len());
    assert!(around.rest.len() > 10_000 && around.flying.len() < 100, "{}", around.rest.len());

    let nowhere = "5,5,5,6,6,6".parse().unwrap();
    let error = scan::clean_region(&placed, &nowhere, &config).unwrap_err();
    assert!(matches!(error, ScanError::EmptyCrop { .. }), "{error}");
}

mod hostile_bytes {
    use proptest::prelude::*;

    use super::*;

    const HEADER: &str = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n\
                          WIDTH 20\nHEIGHT 1\nPOINTS 20\nDATA ";
    const PLY: &str = "ply\nformat binary_little_endian 1.0\nelement vertex 20\nproperty float x\n\
                       property float y\nproperty float z\nelement face 2\n\
                       property list uchar int vertex_indices\nend_header\n";

    proptest! {
        #[test]
        fn never_panic(
            format in prop::sample::select(vec![
                Format::Pcd, Format::Ply, Format::Stl, Format::Obj, Format::Text,
            ]),
            head in prop::sample::select(vec![
                String::new(), format!("{HEADER}ascii\n"), format!("{HEADER}binary\n"),
                format!("{HEADER}binary_compressed\n"), PLY.to_owned(), "solid\n".to_owned(),
            ]),
            cut in 0usize..400,
            flips in prop::collection::vec((0usize..300, any::<u8>()), 0..4),
            body in prop::collection::vec(any::<u8>(), 0..600),
        ) {
            let mut bytes = head.into_bytes();
            for (at, value) in flips {
                if let Some(byte) = bytes.get_mut(at) {
                    *byte = value;
                }
            }
            bytes.extend(body);
            bytes.truncate(bytes.len().saturating_sub(cut));
            let result = scan::read_bytes(&bytes, format, Path::new("x"), &ReadOptions::default());
            if let Ok(raw) = result {
                prop_assert!(raw.points.iter().all(|p| p.coords.iter().all(|c| c.is_finite())));
            }
        }
    }
}

#[test]
fn a_mesh_stands_in_the_same_place_whatever_points_a_seed_lays_on_it() {
    // A tetrahedron of half a metre, its corners on the floor but one.
    let obj = b"v 0 0 0\nv 0.5 0 0\nv 0 0.4 0\nv 0 0 0.3\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
    let placed = [1, 2].map(|seed| {
        let options = ReadOptions { seed, mesh_spacing: 0.004, ..ReadOptions::default() };
        let raw = scan::read_bytes(obj, Format::Obj, Path::new("wedge.obj"), &options).unwrap();
        let up = Placement::Up { up: Vector3::z_axis(), support_height: 0.7 };
        scan::place(&raw, &up).1
    });
    assert_eq!(placed[0], placed[1]);
    // The mean of the corners over the origin, the lowest of them on the support.
    let shift = placed[0].translation.vector;
    assert!((shift - Vector3::new(-0.125, -0.1, 0.7)).norm() < 1e-12, "{shift}");
}
