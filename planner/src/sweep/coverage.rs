//! What the pad has swept: coverage measured on the motion itself, not promised by its graph.

use nalgebra::Isometry3;
use nullsweep_robot::{Arm, Tool};
use nullsweep_surface::{Grid, Patch, Scan};

use super::pads::contact_motion;
use crate::plan::Trajectory;

/// For each point of the scan whether the pad sweeps it at some pose, by the rule that [`Tool`]
/// states.
///
/// `contact_poses` are the contact frame along the dense motion, in the scan's frame; a third of
/// the pad's width between them is close enough.
#[must_use]
pub fn swept(scan: &Scan, contact_poses: &[Isometry3<f64>], tool: &Tool) -> Vec<bool> {
    let mut swept = vec![false; scan.points.len()];
    visit_swept(scan, contact_poses, tool, |_, point| swept[point] = true);
    swept
}

/// Calls `visit` with the index of each pose and of each point that the pad sweeps there, pose
/// after pose.
pub(crate) fn visit_swept(
    scan: &Scan,
    contact_poses: &[Isometry3<f64>],
    tool: &Tool,
    mut visit: impl FnMut(usize, usize),
) {
    let half_diagonal = 0.5 * tool.width.hypot(tool.length);
    let reach = half_diagonal.hypot(tool.reach_normal);
    let grid = Grid::new(&scan.points, 0.5 * reach);
    let aligned = tool.reach_angle.cos();
    for (at, pose) in contact_poses.iter().enumerate() {
        let [x, y, z] = [0, 1, 2].map(|axis| pose.rotation * nalgebra::Vector3::ith_axis(axis));
        let centre = nalgebra::Point3::from(pose.translation.vector + z.scale(tool.stand_off));
        grid.within(&centre, reach, |index, point, _| {
            let offset = point - centre;
            let touches = offset.dot(&x).abs() <= 0.5 * tool.width
                && offset.dot(&y).abs() <= 0.5 * tool.length
                && offset.dot(&z).abs() <= tool.reach_normal
                && -scan.normals[index as usize].dot(&z) >= aligned;
            if touches {
                visit(at, index as usize);
            }
        });
    }
}

/// Whether a pad that is led over the middle of a patch sweeps a point of the scan there, whatever its
/// heading.
#[must_use]
pub fn sweeps(scan: &Scan, point: u32, patch: &Patch, tool: &Tool) -> bool {
    let (point, normal) = (scan.points[point as usize], scan.normals[point as usize]);
    let offset = point - patch.centre;
    let height = offset.dot(&patch.normal);
    let beside = (offset.norm_squared() - height * height).max(0.0).sqrt();
    beside <= 0.5 * tool.width.min(tool.length)
        && height.abs() <= tool.reach_normal
        && normal.dot(&patch.normal) >= tool.reach_angle.cos()
}

/// For each point of the scan whether the pad has passed over it in one of the motions, see
/// [`swept`].
#[must_use]
pub fn swept_by<'a>(
    scan: &Scan,
    motions: impl IntoIterator<Item = Trajectory<'a>>,
    arm: &Arm,
) -> Vec<bool> {
    let mut all = vec![false; scan.points.len()];
    for motion in motions {
        let now = swept(scan, &contact_motion(motion, arm), motion.tool);
        all.iter_mut().zip(now).for_each(|(all, now)| *all |= now);
    }
    all
}

/// The share of swept points, 0 to 1; 0 without points.
#[must_use]
pub fn share(swept: &[bool]) -> f64 {
    swept.iter().filter(|s| **s).count() as f64 / swept.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, UnitVector3, Vector3};

    use super::*;
    use crate::workcell::{contact_pose, direction};

    #[test]
    fn what_counts_as_swept_at_any_heading_is_swept_at_any() {
        // Waves of 6 mm, a point every 4 mm.
        let at = |n: i32| 0.004 * f64::from(n) - 0.2;
        let height = |x: f64| 0.006 * (x / 0.02).sin();
        let points: Vec<Point3<f64>> = (0..10_000)
            .map(|i| Point3::new(at(i % 100), at(i / 100), height(at(i % 100))))
            .collect();
        let slope = |p: &Point3<f64>| Vector3::new(-0.3 * (p.x / 0.02).cos(), 0.0, 1.0);
        let normals = points.iter().map(|p| UnitVector3::new_normalize(slope(p))).collect();
        let scan = Scan { raw: points.clone(), points, normals, spacing: 0.004 };
        let tool = Tool::default();
        for tilt in [0.0, 0.2] {
            let normal = UnitVector3::new_normalize(Vector3::new(0.0, tilt, 1.0));
            let centre = Point3::new(0.01, 0.02, 0.003);
            let patch = Patch { centre, normal, points: Vec::new(), rmse: 0.0 };
            let sure: Vec<u32> = (0..scan.points.len() as u32)
                .filter(|&i| sweeps(&scan, i, &patch, &tool))
                .collect();
            assert!(sure.len() > 50, "{} points", sure.len());
            for k in 0..12 {
                let travel = direction(&normal, 0.5 * f64::from(k));
                let pose = contact_pose(&centre, &normal, &travel, tool.stand_off);
                let swept = swept(&scan, &[pose], &tool);
                assert!(sure.iter().all(|&i| swept[i as usize]), "heading {k}");
            }
        }
    }
}
