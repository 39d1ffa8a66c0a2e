//! How the pad lies on the surface: how deep it is pressed in, how it faces what it sweeps, and how
//! much of it touches.

use nalgebra::{Isometry3, Point3, Vector3};
use nullsweep_robot::Tool;
use nullsweep_surface::Grid;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::sweep::percentile;
use crate::workcell::Scene;

/// Farthest before it that a point belongs to what the pad lies on. \[m\]
const UNDER: f64 = 0.02;
/// Radius within which the point under the pad's centre is looked for. \[m\]
const CENTRE: f64 = 0.04;

/// How the pad lies on the surface, over the motion on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Press {
    /// The deepest point in the pad's rectangle behind its plane, in the median. \[m\]
    pub press_p50_m: f64,
    /// 95th percentile. \[m\]
    pub press_p95_m: f64,
    /// The largest. \[m\]
    pub press_max_m: f64,
    /// Angle between the pad's axis and the normal of the scan's point nearest to its centre, 95th
    /// percentile. \[rad\]
    pub facing_p95_rad: f64,
    /// The largest. \[rad\]
    pub facing_max_rad: f64,
    /// Share of the surface's points before the pad that it touches, those no farther before its plane
    /// than [`Tool::hover`], in the median.
    pub touching_p50: f64,
}

/// One pad pose.
struct Contact {
    press: f64,
    facing: f64,
    touching: f64,
}

/// How deep the deepest point in the pad's rectangle lies behind its plane, at each of the pad poses
/// (contact frame, in the scene's frame). \[m\]
#[must_use]
pub fn press_depths(scene: &Scene, poses: &[Isometry3<f64>], tool: &Tool) -> Vec<f64> {
    contacts(scene, poses, tool).iter().map(|contact| contact.press).collect()
}

/// Looks at pad poses (contact frame, in the scene's frame).
fn contacts(scene: &Scene, poses: &[Isometry3<f64>], tool: &Tool) -> Vec<Contact> {
    let surface = &scene.surface;
    let points: Vec<Point3<f64>> =
        surface.points.iter().chain(&scene.surroundings).copied().collect();
    let reach = tool.outer_radius();
    let grid = Grid::new(&points, reach);
    let look = |pose: &Isometry3<f64>| {
        let centre = Point3::from(pose.translation.vector);
        let axis = pose.rotation * Vector3::z();
        let (mut deepest, mut under, mut touched) = (0.0_f64, 0usize, 0usize);
        let mut nearest = (CENTRE * CENTRE, None);
        grid.within(&centre, libm::hypot(reach, tool.thickness), |index, point, squared| {
            let normal = surface.normals.get(index as usize);
            if normal.is_some() && squared < nearest.0 {
                nearest = (squared, normal);
            }
            let p = pose.inverse_transform_point(point);
            let inside = tool.is_under(p.x, p.y);
            if inside && (-tool.thickness..=UNDER).contains(&p.z) {
                deepest = deepest.max(-p.z);
                let faces = normal.is_some_and(|n| -n.dot(&axis) >= libm::cos(tool.reach_angle));
                under += usize::from(faces);
                touched += usize::from(faces && p.z <= tool.hover());
            }
        });
        let facing = nearest.1.map_or(0.0, |n| libm::acos((-n.dot(&axis)).clamp(-1.0, 1.0)));
        Contact { press: deepest, facing, touching: touched as f64 / under.max(1) as f64 }
    };
    poses.par_iter().map(look).collect()
}

/// The figures over all of the pad poses.
pub(super) fn press(scene: &Scene, poses: &[Isometry3<f64>], tool: &Tool) -> Press {
    let contacts = contacts(scene, poses, tool);
    let sorted = |of: fn(&Contact) -> f64| {
        let mut values: Vec<f64> = contacts.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        values
    };
    let (press, facing) = (sorted(|c| c.press), sorted(|c| c.facing));
    Press {
        press_p50_m: percentile(&press, 0.5),
        press_p95_m: percentile(&press, 0.95),
        press_max_m: percentile(&press, 1.0),
        facing_p95_rad: percentile(&facing, 0.95),
        facing_max_rad: percentile(&facing, 1.0),
        touching_p50: percentile(&sorted(|c| c.touching), 0.5),
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, UnitVector3};
    use nullsweep_surface::Scan;

    use super::*;

    #[test]
    fn a_ridge_presses_and_a_tilted_pad_faces_aslant() {
        let at = |n: i32| 0.004 * f64::from(n) - 0.2;
        let mut points: Vec<Point3<f64>> =
            (0..10_000).map(|i| Point3::new(at(i % 100), at(i / 100), 0.0)).collect();
        let normals = vec![UnitVector3::new_normalize(Vector3::z()); points.len()];
        points[5050].z = 0.004;
        let raw = points.clone();
        let scene = Scene::on_floor(Scan { points, normals, raw, spacing: 0.004 });
        let tool = Tool::default();
        let down = UnitQuaternion::from_euler_angles(std::f64::consts::PI, 0.0, 0.0);
        let pad = |height: f64, tilt: f64| {
            let turn = UnitQuaternion::from_euler_angles(tilt, 0.0, 0.0) * down;
            Isometry3::from_parts(Vector3::z().scale(height).into(), turn)
        };
        let flat = press(&scene, &[pad(0.0, 0.0)], &tool);
        assert!((flat.press_max_m - 0.004).abs() < 1e-12 && flat.facing_max_rad < 1e-6);
        assert_eq!(flat.touching_p50, 1.0);
        // A sponge that is pressed in stands out before its plane by as much, and no more.
        let near = press(&scene, &[pad(0.003, 0.0)], &tool);
        assert!((near.press_max_m - 0.001).abs() < 1e-12 && near.touching_p50 == 1.0);
        let hovering = press(&scene, &[pad(tool.hover() + 0.001, 0.0)], &tool);
        assert!(hovering.press_max_m == 0.0 && hovering.touching_p50 < 0.01);
        assert!(hovering.touching_p50 > 0.0, "the ridge is touched");
        let tilted = press(&scene, &[pad(0.0, 0.2)], &tool);
        assert!((tilted.facing_max_rad - 0.2).abs() < 1e-9);
        assert!(tilted.press_max_m > 0.005, "{}", tilted.press_max_m);
    }
}
