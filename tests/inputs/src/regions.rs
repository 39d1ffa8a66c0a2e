//! A file of regions.

use std::path::Path;

use nalgebra::{Isometry3, Point3};
use nullsweep_planner::regions::{Around, Spec};
use nullsweep_surface::PlacedScan;
use nullsweep_surface::scan::View;

pub(crate) fn run(bytes: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(bytes) else { return false };
    let Ok(spec) = Spec::parse(text, Path::new("regions.toml")) else { return false };
    let grid = |i: u32| f64::from(i) * 0.05 - 0.5;
    let points: Vec<Point3<f64>> =
        (0..400).map(|i| Point3::new(grid(i % 20), grid(i / 20), 0.0)).collect();
    let colours = Some((0..400).map(|i| [(i % 256) as u8, 0, 0]).collect());
    let view = View { points: points.clone(), colours, ..View::default() };
    let scan = PlacedScan { views: vec![view] };
    let around =
        Around { scan: &scan, scan_to_floor: Isometry3::translation(0.1, 0.0, 0.0), seed: 1 };
    let Ok(regions) = spec.find(&around) else { return false };
    let labels = regions.labels(&points);
    assert_eq!(labels.len(), points.len());
    let rounds = regions.rounds();
    assert!(!rounds.is_empty() && rounds.iter().all(|round| round.pass >= 1));
    for region in regions.all() {
        for volume in &region.volumes {
            assert!(points.iter().all(|p| !volume.contains(p) || volume.distance(p) < 0.02));
        }
    }
    for solid in regions.solids() {
        assert!(solid.pose.translation.vector.iter().all(|x| x.is_finite()), "{solid:?}");
    }
    let _ = regions.check(&points, &[]);
    true
}

pub(crate) fn made() -> Vec<Vec<u8>> {
    let text = "frame = \"scan\"\n\
        [[region]]\nname = \"a\"\nkind = \"sweep\"\npasses = 2\ntool_speed = 0.1\npriority = -1\n\
        box = { centre = [0.1, 0, 0], size = [0.4, 0.4, 0.2], rpy = [0, 0, 0.3] }\n\
        half_space = { point = [0, 0, -0.01], normal = [0, 0, 1] }\n\
        [[region]]\nkind = \"keep_out\"\nframe = \"scene\"\nsphere = { centre = [0, 0.3, 0], radius = 0.1 }\n\
        [[region]]\nkind = \"avoid\"\n\
        prism = { outline = [[0, 0], [0.3, 0], [0.3, 0.3], [0.1, 0.1]], z = [0, 0.5], origin = [0, 0, 0.1] }\n\
        [[region]]\nkind = \"sweep\"\ncolour = { rgb = [30, 0, 0], within = 20 }\n";
    vec![text.as_bytes().to_vec()]
}
