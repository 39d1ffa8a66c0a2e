//! A collision mesh that a URDF names, under each ending that its name may have, and a check with it.

use std::path::Path;

use nalgebra::{Isometry3, Vector3};
use nullsweep_collision::{Attached, Exact, Options, ToolContact};
use nullsweep_robot::{CollisionShape, Geometry, Tool};

use crate::arm::arm;
use crate::file;

/// The endings that robot descriptions use.
const ENDINGS: [&str; 3] = ["stl", "obj", "dae"];

pub(crate) fn run(bytes: &[u8]) -> bool {
    ENDINGS.into_iter().filter(|ending| file::with_ending(bytes, ending, check)).count() > 0
}

/// Whether the arm can be checked with a thing of that shape in its hand.
fn check(path: &Path) -> bool {
    let (robot, arm) = arm();
    let geometry = Geometry::Mesh { uri: path.display().to_string(), scale: Vector3::repeat(0.5) };
    let shape = CollisionShape { origin: Isometry3::identity(), geometry };
    let held = Attached { name: "mesh".into(), link: "tip".into(), shape };
    let options = Options { attached: vec![held], ..Options::default() };
    let Ok(check) = Exact::new(robot, arm, &Tool::default(), &[], &[], &options) else {
        return false;
    };
    let hit = check.first_hit(&arm.home(), ToolContact::Forbidden);
    assert!(hit.is_none_or(|hit| hit.distance <= hit.margin), "a hit that is none");
    true
}
