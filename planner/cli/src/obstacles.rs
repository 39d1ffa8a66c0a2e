//! Solid things that are placed and not measured, from a file.

use std::path::Path;

use anyhow::{Context, ensure};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use nullsweep_collision::Obstacle;
use nullsweep_robot::Geometry;
use serde::Deserialize;

/// An obstacle file: all in the floor frame, in metres and radians.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default, rename = "box")]
    boxes: Vec<Cuboid>,
    #[serde(default, rename = "cylinder")]
    cylinders: Vec<Cylinder>,
    #[serde(default, rename = "sphere")]
    spheres: Vec<Sphere>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Cuboid {
    name: Option<String>,
    centre: [f64; 3],
    #[serde(default)]
    rpy: [f64; 3],
    size: [f64; 3],
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Cylinder {
    name: Option<String>,
    centre: [f64; 3],
    #[serde(default)]
    rpy: [f64; 3],
    radius: f64,
    height: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Sphere {
    name: Option<String>,
    centre: [f64; 3],
    radius: f64,
}

/// The solid things of a file, in the floor frame.
pub(super) fn read(path: &Path) -> anyhow::Result<Vec<Obstacle>> {
    let text =
        std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    parse(&text).with_context(|| path.display().to_string())
}

fn parse(text: &str) -> anyhow::Result<Vec<Obstacle>> {
    let file: File = toml::from_str(text).context(
        "not an obstacle file: [[box]] with centre, size and rpy, [[cylinder]] with centre, radius, \
         height and rpy, [[sphere]] with centre and radius are wanted",
    )?;
    let mut all = Vec::new();
    for b in file.boxes {
        let half_extents = Vector3::from(b.size) * 0.5;
        all.push((
            b.name,
            "box",
            (b.centre, b.rpy),
            Geometry::Box { half_extents },
            b.size.to_vec(),
        ));
    }
    for c in file.cylinders {
        let shape = Geometry::Cylinder { radius: c.radius, half_length: 0.5 * c.height };
        all.push((c.name, "cylinder", (c.centre, c.rpy), shape, vec![c.radius, c.height]));
    }
    for s in file.spheres {
        let shape = Geometry::Sphere { radius: s.radius };
        all.push((s.name, "sphere", (s.centre, [0.0; 3]), shape, vec![s.radius]));
    }
    ensure!(!all.is_empty(), "no [[box]], [[cylinder]] or [[sphere]] in it");
    let mut obstacles = Vec::with_capacity(all.len());
    for (k, (name, kind, (centre, rpy), shape, sizes)) in all.into_iter().enumerate() {
        let name = name.unwrap_or_else(|| format!("{kind} {}", k + 1));
        let finite = centre.iter().chain(&rpy).all(|v| v.is_finite());
        ensure!(finite, "{name}: its place is not finite");
        ensure!(
            sizes.iter().all(|size| size.is_finite() && *size > 0.0),
            "{name}: its sizes must be above 0"
        );
        let rotation = UnitQuaternion::from_euler_angles(rpy[0], rpy[1], rpy[2]);
        let pose = Isometry3::from_parts(Translation3::from(centre), rotation);
        obstacles.push(Obstacle { name, shape: shape.into(), pose, carries_robot: false });
    }
    Ok(obstacles)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_what_is_placed_and_says_what_is_wrong() {
        let text = "[[box]]\nname = 'shelf'\ncentre = [0.4, 0, 0.8]\nsize = [0.3, 0.05, 0.8]\n\
                    rpy = [0, 0, 1.5707963267948966]\n[[sphere]]\ncentre = [1, 0, 0]\nradius = 0.1\n";
        let all = parse(text).expect("obstacles");
        assert_eq!((all[0].name.as_str(), all[1].name.as_str()), ("shelf", "sphere 2"));
        let corner = all[0].pose * nalgebra::Point3::new(0.15, 0.0, 0.0);
        assert!((corner - nalgebra::Point3::new(0.4, 0.15, 0.8)).norm() < 1e-12);
        for (text, what) in [
            ("", "no [[box]]"),
            ("[[box]]\ncentre = [0, 0, 0]\nsize = [1, 0, 1]\n", "box 1: its sizes"),
            ("[[ball]]\n", "not an obstacle file"),
        ] {
            let error = parse(text).expect_err(text).to_string();
            assert!(error.contains(what), "{error}");
        }
    }
}
