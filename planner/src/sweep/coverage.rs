//! What the pad has swept: coverage measured on the motion itself, not promised by its graph.

use nalgebra::Isometry3;
use nullsweep_robot::{Arm, Tool};
use nullsweep_surface::{Grid, Scan};

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
pub(super) fn visit_swept(
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
