//! What the tool has swept: coverage measured on the motion itself, not promised by its graph.

use nalgebra::Isometry3;
use nullsweep_robot::{Arm, Footprint, Tool};
use nullsweep_surface::{Patch, Scan};

use super::deposit::{Clock, deposits};
use super::pads::contact_motion;
use super::sight::Sight;
use super::visit::{enough, visit_swept};
use crate::plan::Trajectory;

/// For each point of the scan whether the tool works on it at some pose, by the rule that [`Tool`]
/// states: a pad touches it, a camera sees it, a nozzle sprays it, how much being another question
/// ([`swept_by`]).
///
/// `contact_poses` are the contact frame along the dense motion, in the scan's frame; a third of
/// the pad's width between them is close enough.
#[must_use]
pub fn swept<'a>(
    sight: impl Into<Sight<'a>>,
    contact_poses: &[Isometry3<f64>],
    tool: &Tool,
) -> Vec<bool> {
    let sight = sight.into();
    let mut swept = vec![false; sight.scan.points.len()];
    visit_swept(sight, &enough(contact_poses, tool), tool, |_, point| swept[point] = true);
    swept
}

/// Whether a tool that is led over the middle of a patch works on a point of the scan there, whatever
/// its heading.
#[must_use]
pub fn sweeps(scan: &Scan, point: u32, patch: &Patch, tool: &Tool) -> bool {
    let (point, normal) = (scan.points[point as usize], scan.normals[point as usize]);
    let offset = point - patch.centre;
    let height = offset.dot(&patch.normal);
    let beside = (offset.norm_squared() - height * height).max(0.0).sqrt();
    beside <= tool.inner_radius()
        && height.abs() <= tool.reach_normal
        && normal.dot(&patch.normal) >= libm::cos(tool.reach_angle)
}

/// For each point of the scan whether the tool has worked on it in one of the motions, see [`swept`];
/// of a nozzle, whether they have laid enough onto it and not too much.
#[must_use]
pub fn swept_by<'a>(
    sight: impl Into<Sight<'a>>,
    motions: impl IntoIterator<Item = Trajectory<'a>>,
    arm: &Arm,
) -> Vec<bool> {
    worked(sight.into(), motions, arm, Clock::Timed)
}

/// For each point of the scan whether nothing is to be done on it after a motion that is not timed yet,
/// of a nozzle as if it went at a speed \[m/s\]: where too much was laid more would not help.
pub(crate) fn done_by(
    sight: Sight<'_>,
    motion: Trajectory<'_>,
    arm: &Arm,
    speed: f64,
) -> Vec<bool> {
    worked(sight, [motion], arm, Clock::Speed(speed))
}

/// Deposits of nozzles are summed up over all motions. Of a motion that is not timed too much is no
/// matter.
fn worked<'a>(
    sight: Sight<'_>,
    motions: impl IntoIterator<Item = Trajectory<'a>>,
    arm: &Arm,
    clock: Clock,
) -> Vec<bool> {
    let mut all = vec![false; sight.scan.points.len()];
    let mut sprayed: Option<([f64; 2], Vec<f64>)> = None;
    for motion in motions {
        if let Footprint::Nozzle(nozzle) = motion.tool.footprint {
            let now = deposits(sight, motion, arm, clock);
            let (bounds, laid) = sprayed.get_or_insert((nozzle.deposit, vec![0.0; all.len()]));
            *bounds = nozzle.deposit;
            laid.iter_mut().zip(now).for_each(|(laid, now)| *laid += now);
            continue;
        }
        let now = swept(sight, &contact_motion(motion, arm), motion.tool);
        all.iter_mut().zip(now).for_each(|(all, now)| *all |= now);
    }
    if let Some(([least, most], laid)) = sprayed {
        let is_within = |laid: f64| laid >= least && (clock != Clock::Timed || laid <= most);
        all.iter_mut().zip(laid).for_each(|(all, laid)| *all |= is_within(laid));
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
        let height = |x: f64| 0.006 * libm::sin(x / 0.02);
        let points: Vec<Point3<f64>> = (0..10_000)
            .map(|i| Point3::new(at(i % 100), at(i / 100), height(at(i % 100))))
            .collect();
        let slope = |p: &Point3<f64>| Vector3::new(-0.3 * libm::cos(p.x / 0.02), 0.0, 1.0);
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
