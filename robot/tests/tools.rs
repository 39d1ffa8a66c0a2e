//! Tools of every shape: their files, and what they work on from a pose.

use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;

use nalgebra::{Point3, Vector3};
use nullsweep_robot::{Footprint, Tool};

/// The tools that the documents have.
const SHAPES: [(&str, &str); 5] = [
    ("flange-sponge.toml", "rectangle"),
    ("finger-pad.toml", "disc"),
    ("roller.toml", "roller"),
    ("spray-nozzle.toml", "nozzle"),
    ("inspection-camera.toml", "camera"),
];

fn text(name: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/tools");
    std::fs::read_to_string(folder.join(name)).expect("a tool of the documents")
}

fn tool(name: &str) -> Tool {
    serde_json::from_value(table(name)).expect("a tool")
}

/// A tool's file as a table, by lines of `key = value`.
fn table(name: &str) -> serde_json::Value {
    let lines = text(name);
    let pairs = lines.lines().filter_map(|line| line.split('#').next()?.split_once('='));
    let value =
        |text: &str| serde_json::from_str::<serde_json::Value>(text.trim()).expect("a value");
    pairs.map(|(key, text)| (key.trim().to_owned(), value(text))).collect()
}

#[test]
fn every_shape_is_read_and_comes_back_as_it_was_written() {
    for (name, shape) in SHAPES {
        let read = tool(name);
        assert_eq!(read.footprint.shape(), shape, "{name}");
        let again = serde_json::to_string(&read).expect("numbers");
        assert_eq!(serde_json::from_str::<Tool>(&again).expect("what was written"), read);
        let is_said = again.contains("\"shape\"");
        assert_eq!(is_said, shape != "rectangle", "a rectangle's file is what it always was");
    }
}

#[test]
fn a_key_that_is_missing_of_another_shape_or_impossible_is_named() {
    let said = |name: &str, key: &str, value: Option<serde_json::Value>| {
        let mut table = table(name);
        let keys = table.as_object_mut().expect("a table");
        match value {
            Some(value) => keys.insert(key.into(), value),
            None => keys.remove(key),
        };
        serde_json::from_value::<Tool>(table).expect_err("no tool").to_string()
    };
    let missing = [
        ("flange-sponge.toml", "width"),
        ("flange-sponge.toml", "symmetric"),
        ("flange-sponge.toml", "across"),
        ("finger-pad.toml", "radius"),
        ("roller.toml", "reach_normal"),
        ("spray-nozzle.toml", "deposit"),
        ("inspection-camera.toml", "field_of_view"),
    ];
    for (name, key) in missing {
        let said = said(name, key, None);
        assert!(said.contains(&format!("tool: {key} is missing")), "{said}");
    }
    let foreign = [
        ("flange-sponge.toml", "radius"),
        ("finger-pad.toml", "length"),
        ("finger-pad.toml", "symmetric"),
        ("roller.toml", "thickness"),
        ("spray-nozzle.toml", "press_max"),
        ("inspection-camera.toml", "cone"),
    ];
    for (name, key) in foreign {
        let said = said(name, key, Some(0.01.into()));
        let is_named = said.contains(&format!("tool: {key} is no key of a"));
        assert!(is_named || key == "symmetric" && said.contains("boolean"), "{said}");
    }
    let impossible: [(&str, &str, serde_json::Value, &str); 10] = [
        ("finger-pad.toml", "radius", 0.0.into(), "length is 0 m"),
        ("roller.toml", "width", 0.06.into(), "width is 0.06 m"),
        ("roller.toml", "slip_max", 2.0.into(), "slip_max is 2 rad"),
        ("roller.toml", "press_max", 0.03.into(), "press_max is 0.03 m"),
        ("spray-nozzle.toml", "cone", 1.5.into(), "cone is 1.5 rad"),
        ("spray-nozzle.toml", "rate", (-1.0).into(), "rate is -1 m³/s"),
        (
            "spray-nozzle.toml",
            "deposit",
            serde_json::json!([9e-5, 1e-5]),
            "deposit is [0.00009, 0.00001] m",
        ),
        ("spray-nozzle.toml", "stand_off", 0.3.into(), "stand_off is 0.3 m"),
        (
            "inspection-camera.toml",
            "distance",
            serde_json::json!([0.4, 0.2]),
            "distance is [0.4, 0.2] m",
        ),
        (
            "inspection-camera.toml",
            "field_of_view",
            serde_json::json!([0.8, 3.0]),
            "field_of_view[1] is 3 rad",
        ),
    ];
    for (name, key, value, words) in impossible {
        let said = said(name, key, Some(value));
        assert!(said.contains(words), "{key}: {said}");
    }
    let unknown = said("finger-pad.toml", "diameter", Some(0.1.into()));
    assert!(unknown.contains("diameter"), "{unknown}");
    let shape = said("finger-pad.toml", "shape", Some("star".into()));
    assert!(shape.contains("star") && shape.contains("nozzle"), "{shape}");
}

#[test]
fn what_a_tool_works_on_has_its_shape() {
    let disc = tool("finger-pad.toml");
    assert!(disc.is_under(0.014, 0.0) && disc.is_under(0.0, -0.014));
    assert!(!disc.is_under(0.012, 0.012), "a corner of its square");
    let roller = tool("roller.toml");
    assert!(roller.is_under(0.009, 0.07) && !roller.is_under(0.011, 0.0));
    let camera = tool("inspection-camera.toml");
    // Wider across than along, and wider farther away.
    assert!(camera.works_on(0.0, 0.12, 0.0) && !camera.works_on(0.12, 0.0, 0.0));
    assert!(camera.works_on(0.12, 0.0, 0.10) && !camera.works_on(0.0, 0.0, 0.13));
    assert!(!camera.works_on(0.0, 0.0, -0.11), "nearer than it sees sharply");
    let [across, along] = camera.track();
    assert!((across - 0.6 * 0.4f64.tan()).abs() < 1e-12 && across > along);
}

#[test]
fn a_heading_is_free_bound_or_as_good_as_its_opposite() {
    let [pad, disc, roller] = ["flange-sponge.toml", "finger-pad.toml", "roller.toml"].map(tool);
    let turn = nalgebra::UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 3.0);
    assert!((pad.turn_between(&turn) - (PI - 3.0)).abs() < 1e-9);
    assert!(disc.turn_between(&turn) < 1e-9);
    let bound = Tool { symmetric: false, ..pad.clone() };
    assert!((bound.turn_between(&turn) - 3.0).abs() < 1e-9);
    for angle in [0.0, 0.04, -0.04, PI, PI + 0.04, -PI - 0.04] {
        assert!(roller.may_travel(angle), "{angle}");
    }
    for angle in [0.1, FRAC_PI_2, PI - 0.1, -2.0] {
        assert!(!roller.may_travel(angle) && pad.may_travel(angle) && disc.may_travel(angle));
    }
}

#[test]
fn a_nozzle_lays_down_all_that_it_sprays() {
    let Footprint::Nozzle(nozzle) = tool("spray-nozzle.toml").footprint else {
        panic!("a nozzle");
    };
    // Over a level plane and over one that leans: the same flow.
    for lean in [0.0, 0.4_f64] {
        let normal = Vector3::new(-lean.sin(), 0.0, -lean.cos());
        let (step, mut flow) = (0.0005, 0.0);
        for i in -400..400 {
            for k in -400..400 {
                let (u, v) = (step * f64::from(i), step * f64::from(k));
                // u runs down the leaning plane.
                let place = Point3::new(u * lean.cos(), v, 0.15 - u * lean.sin());
                flow += nozzle.deposit_rate(&place, &normal) * step * step;
            }
        }
        assert!((flow / nozzle.rate - 1.0).abs() < 0.01, "{lean}: {flow}");
    }
    let ahead = Point3::new(0.0, 0.0, 0.15);
    let at = |place: &Point3<f64>| nozzle.deposit_rate(place, &-Vector3::z());
    assert!((at(&ahead) / at(&(2.0 * ahead.coords).into()) - 4.0).abs() < 1e-9);
    assert_eq!(nozzle.deposit_rate(&ahead, &Vector3::z()), 0.0, "its back");
}
