//! A scan's file, read as each format in turn, and what is made of it.

use std::path::Path;

use nalgebra::Vector3;
use nullsweep_surface::scan::{Format, RawScan, ReadOptions, read_bytes};
use nullsweep_surface::{CleanConfig, PatchConfig, Placement, clean, patches, place};

/// Points of a scan that is cleaned and cut into patches here.
const POINTS: usize = 3000;
const FORMATS: [Format; 10] = [
    Format::Pcd,
    Format::Ply,
    Format::Stl,
    Format::Obj,
    Format::Gltf,
    Format::Las,
    Format::E57,
    Format::Ptx,
    Format::Npy,
    Format::Text,
];

pub(crate) fn run(bytes: &[u8]) -> bool {
    let scans = scans(bytes);
    scans.iter().for_each(ask);
    !scans.is_empty()
}

/// What the file is as each format that takes it.
pub(crate) fn scans(bytes: &[u8]) -> Vec<RawScan> {
    let read = |format| read_bytes(bytes, format, Path::new("scan"), &ReadOptions::default()).ok();
    FORMATS.into_iter().filter_map(read).collect()
}

fn ask(raw: &RawScan) {
    assert!(raw.points.iter().all(|p| p.iter().all(|x| x.is_finite())));
    assert!(raw.normals.as_ref().is_none_or(|n| n.len() == raw.points.len()));
    if raw.points.len() > POINTS {
        return;
    }
    let placement = Placement::Up { up: Vector3::z_axis(), support_height: 0.0 };
    let (placed, _) = place(raw, &placement);
    let Ok((scan, _)) = clean(&placed, &CleanConfig::default()) else { return };
    assert_eq!(scan.points.len(), scan.normals.len());
    assert!(scan.normals.iter().all(|n| (n.norm() - 1.0).abs() < 1e-6));
    for patch in patches::find(&scan, &PatchConfig::default(), 1) {
        assert!(patch.centre.iter().all(|x| x.is_finite()));
    }
}
