//! Which points a tool works on from each of its poses.

use nalgebra::{Isometry3, Point3, Vector3};
use nullsweep_robot::{Footprint, Tool};
use nullsweep_surface::{Grid, Scan};

use super::sight::Sight;
use super::view::View;

/// Shares of its track that a tool that looks from afar moves on between two looks, and the turn.
/// \[rad\]
const LOOKS: (f64, f64) = (0.05, 0.05);

/// The poses from which a camera sees what it sees along a motion; of other tools all.
pub(super) fn enough(poses: &[Isometry3<f64>], tool: &Tool) -> Vec<Isometry3<f64>> {
    if !matches!(tool.footprint, Footprint::Camera(_)) {
        return poses.to_vec();
    }
    let [across, along] = tool.track();
    let far = LOOKS.0 * across.min(along);
    let mut kept: Vec<Isometry3<f64>> = Vec::new();
    for (i, pose) in poses.iter().enumerate() {
        let is_new = kept.last().is_none_or(|last| {
            let moved = (pose.translation.vector - last.translation.vector).norm();
            moved >= far || pose.rotation.angle_to(&last.rotation) >= LOOKS.1
        });
        if is_new || i + 1 == poses.len() {
            kept.push(*pose);
        }
    }
    kept
}

/// Calls `visit` with the index of each pose and of each point that the tool works on there, pose
/// after pose.
pub(crate) fn visit_swept<'a>(
    sight: impl Into<Sight<'a>>,
    contact_poses: &[Isometry3<f64>],
    tool: &Tool,
    visit: impl FnMut(usize, usize),
) {
    let sight = sight.into();
    if tool.touches() {
        visit_touched(sight.scan, contact_poses, tool, visit);
    } else {
        visit_seen(sight, contact_poses, tool, visit);
    }
}

fn visit_touched(
    scan: &Scan,
    contact_poses: &[Isometry3<f64>],
    tool: &Tool,
    mut visit: impl FnMut(usize, usize),
) {
    let reach = libm::hypot(tool.outer_radius(), tool.reach_normal);
    let grid = Grid::new(&scan.points, 0.5 * reach);
    let aligned = libm::cos(tool.reach_angle);
    for (at, pose) in contact_poses.iter().enumerate() {
        let [x, y, z] = [0, 1, 2].map(|axis| pose.rotation * Vector3::ith_axis(axis));
        let centre = Point3::from(pose.translation.vector + z.scale(tool.stand_off));
        grid.within(&centre, reach, |index, point, _| {
            let offset = point - centre;
            let touches = tool.works_on(offset.dot(&x), offset.dot(&y), offset.dot(&z))
                && -scan.normals[index as usize].dot(&z) >= aligned;
            if touches {
                visit(at, index as usize);
            }
        });
    }
}

/// By rays: a point is worked on where nothing stands between it and the tool, and the ray meets it
/// within `reach_angle` of its normal.
fn visit_seen(
    sight: Sight<'_>,
    contact_poses: &[Isometry3<f64>],
    tool: &Tool,
    mut visit: impl FnMut(usize, usize),
) {
    let Sight { scan, beside, solids } = sight;
    let all: Vec<Point3<f64>> = scan.points.iter().chain(beside).copied().collect();
    let ([_, far], slopes) = (tool.distance(), tool.slopes());
    let reach = libm::hypot(0.5 * far, far * libm::hypot(slopes[0], slopes[1]));
    let grid = Grid::new(&all, 0.25 * reach);
    let aligned = libm::cos(tool.reach_angle);
    let mut found: Vec<(usize, Point3<f64>)> = Vec::new();
    for (at, pose) in contact_poses.iter().enumerate() {
        let back = pose.inverse();
        let mouth = Point3::from(pose.translation.vector);
        let mut view = View::new(slopes, tool.stand_off, scan.spacing);
        found.clear();
        grid.within(&(pose * Point3::new(0.0, 0.0, 0.5 * far)), reach, |index, point, _| {
            let place = back * point;
            view.stop(&place);
            let Some(normal) = scan.normals.get(index as usize) else { return };
            let ray = point - mouth;
            let faces = -normal.dot(&ray) >= aligned * ray.norm();
            if faces && tool.works_on(place.x, place.y, place.z - tool.stand_off) {
                found.push((index as usize, place));
            }
        });
        for (index, place) in &found {
            let hidden =
                || solids.is_some_and(|s| s.hide(&mouth, &scan.points[*index], 2.0 * scan.spacing));
            if view.shows(place) && !hidden() {
                visit(at, *index);
            }
        }
    }
}
