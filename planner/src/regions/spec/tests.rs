//! Files of regions, sound and not.

use nullsweep_surface::scan::View;

use super::*;
use crate::regions::Label;

/// A plate of 40 × 40 cm, its left half red.
fn plate(coloured: bool) -> PlacedScan {
    let at = |i: u32| 0.01 * f64::from(i) - 0.195;
    let points: Vec<Point3<f64>> =
        (0..1600).map(|i| Point3::new(at(i % 40), at(i / 40), 0.3)).collect();
    let paint = |p: &Point3<f64>| if p.x < 0.0 { [210, 20, 30] } else { [90, 90, 90] };
    let colours = coloured.then(|| points.iter().map(paint).collect());
    PlacedScan { views: vec![View { points, colours, ..View::default() }] }
}

fn find(text: &str, coloured: bool) -> Result<(Regions, Vec<Label>), String> {
    let scan = plate(coloured);
    let around =
        Around { scan: &scan, scan_to_floor: Isometry3::translation(0.0, 0.0, 0.3), seed: 1 };
    let spec = Spec::parse(text, Path::new("r.toml")).map_err(|e| e.to_string())?;
    let regions = spec.find(&around).map_err(|e| e.to_string())?;
    regions.check(&scan.views[0].points, &[]).map_err(|e| e.to_string())?;
    let labels = regions.labels(&scan.views[0].points);
    Ok((regions, labels))
}

#[test]
fn a_region_is_what_lies_in_all_of_its_shapes_in_its_frame() {
    let text = "frame = 'scan'\n\
        [[region]]\nname = 'red corner'\nkind = 'sweep'\npasses = 3\ntool_speed = 0.2\n\
        colour = { rgb = [200, 30, 30], within = 30 }\n\
        half_space = { point = [0, 0.1, 0], normal = [0, 1, 0] }\n\
        [[region]]\nkind = 'keep_out'\nsphere = { centre = [0.1, 0, 0], radius = 0.05 }\n\
        [[region]]\nname = 'post'\nkind = 'avoid'\nframe = 'scene'\n\
        box = { centre = [1, 0, 0.5], size = [0.1, 0.1, 1] }\n";
    let (regions, labels) = find(text, true).expect("regions");
    let count = |label| labels.iter().filter(|l| **l == label).count();
    assert_eq!(count(Label::Sweep(0)), 20 * 10, "the red half's upper quarter");
    assert!((70..90).contains(&count(Label::KeepOut(1))), "a disc of 5 cm");
    assert_eq!(regions.all()[1].name, "2");
    let sweep = Sweep { passes: 3, tool_speed: Some(0.2), priority: 0 };
    assert_eq!(regions.all()[0].kind, Kind::Sweep(sweep));
    let solids = regions.solids();
    assert!(solids.len() == 1 && solids[0].name == "post" && !solids[0].carries_robot);
    assert_eq!(solids[0].pose.translation.vector, Vector3::new(1.0, 0.0, 0.5));
}

#[test]
fn what_cannot_be_is_told_by_the_regions_name() {
    let sweep = "[[region]]\nname = 'a'\nkind = 'sweep'\n";
    let avoid = "[[region]]\nname = 'a'\nkind = 'avoid'\n";
    let sphere = "sphere = { centre = [0, 0, 0.3], radius = 0.1 }\n";
    for (text, coloured, says) in [
        (String::new(), true, "no [[region]]"),
        (format!("{sweep}ball = 1\n"), true, "unknown field"),
        (sweep.to_owned(), true, "region a: it has no shape"),
        (format!("{sweep}{sphere}passes = 0\n"), true, "passes is 0: 1 to 20"),
        (format!("{sweep}{sphere}tool_speed = -1\n"), true, "tool_speed is -1 m/s"),
        (format!("{avoid}{sphere}passes = 2\n"), true, "are of regions to sweep"),
        (format!("{avoid}object = 1\n"), true, "there is no object 1: the scene has 0"),
        (format!("{avoid}colour = {{ rgb = [200, 30, 30], within = 30 }}\n"), true, "is one box"),
        (format!("{sweep}sphere = {{ centre = [0, 0, 0], radius = 0 }}\n"), true, "radius is 0 m"),
        (
            format!("{sweep}prism = {{ outline = [[0, 0], [1, 0], [2, 0]], z = [0, 1] }}\n"),
            true,
            "three corners or more",
        ),
        (
            format!("{sweep}half_space = {{ point = [0, 0, 0], normal = [0, 0, 0] }}\n"),
            true,
            "zero",
        ),
        (
            format!("{sweep}colour = {{ rgb = [0, 0, 255], within = 10 }}\n"),
            true,
            "the nearest colour is [90, 90, 90], 208 away",
        ),
        (
            format!("{sweep}colour = {{ rgb = [200, 30, 30], within = 30 }}\n"),
            false,
            "no scan has colours",
        ),
        (
            format!("{sweep}sphere = {{ centre = [0, 0, 0.6], radius = 0.1 }}\n"),
            true,
            "holds no point of the surface: the nearest, at",
        ),
    ] {
        let error = find(&text, coloured).err().unwrap_or_else(|| panic!("taken: {text}"));
        assert!(error.contains(says), "{text}: {error}");
    }
}
