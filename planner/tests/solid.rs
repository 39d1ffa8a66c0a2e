//! What a closed mesh encloses is in the way.

use std::path::Path;

use nalgebra::Isometry3;
use nullsweep_collision::{Exact, Options, ToolContact, World};
use nullsweep_planner::workcell::Scene;
use nullsweep_robot::{ArmSpec, Robot, Side, Tool};
use nullsweep_surface::scan::{Format, read_bytes};
use nullsweep_surface::{CleanConfig, Placement, ReadOptions, place};

/// A box of 3 m, from half a metre below the floor on, in the words of an OBJ file.
fn block(lid: bool) -> String {
    let corner = |i: usize| {
        let at = |axis: usize| 3.0 * (i >> axis & 1) as f64;
        format!("v {} {} {}\n", at(0) - 1.5, at(1) - 1.5, at(2) - 0.5)
    };
    let sides = ["1 3 4 2", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6"];
    let top = lid.then_some("5 6 8 7");
    let face = |quad: &str| format!("f {quad}\n");
    (0..8).map(corner).chain(sides.into_iter().chain(top).map(face)).collect()
}

#[test]
fn no_part_of_a_robot_is_inside_a_closed_mesh() {
    let (robot, tool, options) = (Robot::pr2(), Tool::default(), Options::default());
    let arm = robot.arm(&ArmSpec::pr2(Side::Right)).expect("an arm");
    for lid in [true, false] {
        let options_of_mesh = ReadOptions { mesh_spacing: 0.03, ..ReadOptions::default() };
        let text = block(lid);
        let raw = read_bytes(text.as_bytes(), Format::Obj, Path::new("block"), &options_of_mesh);
        let pose = Isometry3::identity();
        let (placed, _) = place(&raw.expect("a mesh"), &Placement::Frame { pose, sensor: None });
        let (scene, _) = Scene::seen(&placed, None, &CleanConfig::default()).expect("a surface");
        let exact =
            Exact::new(&robot, &arm, &tool, scene.points(), &[], &options).expect("a check");
        let world = World::new(&robot, &arm, &tool, scene.points(), &[], &options).expect("one");
        let home = arm.home();
        // The skin is far from every part of it.
        let free = [
            exact.stance_hit().is_none(),
            world.stance_hit().is_none(),
            exact.is_free(&home, ToolContact::Forbidden),
            world.is_free(&home, ToolContact::Allowed),
        ];
        assert_eq!(free, [!lid; 4], "closed: {lid}");
    }
}

/// The points that are drawn on a mesh hold none of its corners, where a tool would hit it first.
#[test]
fn the_corners_of_a_mesh_are_in_the_way() {
    // A spike of 0.2 m on a foot of 0.3 m, 5 mm wide.
    let text = "v 0 0 0\nv 0.3 0 0\nv 0.3 0.3 0\nv 0 0.3 0\n\
                v 0.1 0.1 0\nv 0.105 0.1 0\nv 0.1 0.1 0.2\nf 1 2 3 4\nf 5 6 7\n";
    let options = ReadOptions::default();
    let raw = read_bytes(text.as_bytes(), Format::Obj, Path::new("spike"), &options);
    let pose = Isometry3::identity();
    let (placed, _) = place(&raw.expect("a mesh"), &Placement::Frame { pose, sensor: None });
    let (scene, _) = Scene::seen(&placed, None, &CleanConfig::default()).expect("a surface");
    for tip in [[0.1, 0.1, 0.2], [0.3, 0.3, 0.0]].map(nalgebra::Point3::from) {
        let known = scene.raw.iter().chain(&scene.surroundings);
        let near = known.map(|p| (p - tip).norm()).fold(f64::INFINITY, f64::min);
        assert!(near < 1e-9, "{tip}: {near} m");
    }
}
