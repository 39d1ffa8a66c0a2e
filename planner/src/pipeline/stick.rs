//! Whether a longer tool would come to what a plan leaves out.

use std::f64::consts::PI;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use nullsweep_collision::Attached;
use nullsweep_robot::{CollisionShape, Geometry};
use nullsweep_surface::Patch;

use super::elsewhere::{Floor, meets};
use super::error::PipelineError;
use super::job::Job;
use super::left_out::LeftOut;
use super::longer::Longer;
use super::setting::Setting;
use crate::workcell::reach;
use crate::workcell::stance::Stance;

/// How much longer tools are tried. \[m\]
const LONGER: [f64; 2] = [0.05, 0.10];
/// Radius of the stick that holds a longer tool. \[m\]
const STICK: f64 = 0.01;

/// Says in the rows of what the arm meets something at how much of it the same tool on a stick reaches
/// from the same stance, of the lengths that are tried the one that reaches most: looked at as the
/// patches themselves are, the stick among what may collide.
pub(super) fn longer(
    mut rows: Vec<LeftOut>,
    stance: &Stance,
    floor: &Floor<'_>,
) -> Result<Vec<LeftOut>, PipelineError> {
    let Floor { robot, arm, scene, patches, job } = *floor;
    let blocked: Vec<usize> =
        rows.iter().filter(|row| meets(&row.cause)).flat_map(|row| row.of.clone()).collect();
    if blocked.is_empty() {
        return Ok(rows);
    }
    let mut best: Option<(f64, Vec<usize>)> = None;
    for by in LONGER {
        let job = on_a_stick(job, by);
        let setting = Setting::new(robot, arm, scene, patches, &job, stance.clone())?;
        let looked: Vec<Patch> = blocked.iter().map(|&p| setting.patches[p].clone()).collect();
        let reached = reach(setting.cell(&job), &looked, job.ik_samples, &|| ());
        let free: Vec<usize> =
            blocked.iter().zip(reached).filter(|(_, r)| r.is_some()).map(|(p, _)| *p).collect();
        if free.len() > best.as_ref().map_or(0, |(_, free)| free.len()) {
            best = Some((by, free));
        }
    }
    let Some((by, free)) = best else { return Ok(rows) };
    for row in rows.iter_mut().filter(|row| meets(&row.cause)) {
        let patches = row.of.iter().filter(|patch| free.contains(patch)).count();
        row.longer = (patches > 0).then_some(Longer { by, patches });
    }
    Ok(rows)
}

/// The job with its tool so much farther out along its approach, on a stick.
fn on_a_stick(job: &Job, by: f64) -> Job {
    let mut job = job.clone();
    let contact = job.tool.contact_in_tip();
    let ahead = contact.rotation * Vector3::z();
    let back = contact.translation.vector - ahead * job.tool.thickness;
    let moved = Vector3::from(job.tool.centre) + ahead * by;
    job.tool.centre = moved.into();
    // From the back of the tool as it was to its back as it is.
    let middle = Translation3::from(back + ahead * (0.5 * by));
    let turn = UnitQuaternion::rotation_between(&Vector3::z(), &ahead)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), PI));
    let geometry = Geometry::Cylinder { radius: STICK, half_length: 0.5 * by };
    let shape = CollisionShape { origin: Isometry3::from_parts(middle, turn), geometry };
    let link = job.arm.tip.clone();
    job.collision.attached.push(Attached { name: "stick".into(), link, shape });
    job
}

#[cfg(test)]
mod tests {
    use nullsweep_robot::{ArmSpec, Side};

    use super::*;

    #[test]
    fn a_longer_tool_is_the_same_farther_out_with_a_stick_between() {
        let job = Job::new(ArmSpec::pr2(Side::Right));
        let long = on_a_stick(&job, 0.05);
        let off = Vector3::from(long.tool.centre) - Vector3::new(0.08, 0.0, 0.0);
        assert!(off.norm() < 1e-12, "{off:?}");
        let [Attached { link, shape, .. }] = &long.collision.attached[..] else {
            panic!("one stick");
        };
        assert_eq!(*link, job.arm.tip);
        // From the sponge's back, which was at the tip, 5 cm along x.
        let ends = [-0.025, 0.025].map(|z| (shape.origin * nalgebra::Point3::new(0.0, 0.0, z)).x);
        assert!(ends[0].abs() < 1e-12 && (ends[1] - 0.05).abs() < 1e-12, "{ends:?}");
        let words = Longer { by: 0.05, patches: 40 }.to_string();
        assert_eq!(words, "a tool 5 cm longer would reach 40 patches more");
    }
}
