//! What a nozzle lays onto the surface, by distance, angle and speed.

use nalgebra::Isometry3;
use nullsweep_robot::{Arm, Footprint};

use super::sight::Sight;
use super::visit::visit_swept;
use crate::plan::Trajectory;

/// Joints move at most this far between two looks. \[rad\] or \[m\]
const STEP: f64 = 0.02;

/// How long the nozzle stays where it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Clock {
    /// As the motion is timed.
    Timed,
    /// As if it went at one speed, \[m/s\]: before a plan is timed.
    Speed(f64),
}

/// How thick what a nozzle sprays lies on each point after a motion: it is open wherever the motion is
/// on the surface; 0 everywhere of another tool. \[m\]
#[must_use]
pub fn deposits(sight: Sight<'_>, motion: Trajectory<'_>, arm: &Arm, clock: Clock) -> Vec<f64> {
    let mut laid = vec![0.0; sight.scan.points.len()];
    let Footprint::Nozzle(nozzle) = motion.tool.footprint else { return laid };
    let (poses, stays) = stays(motion, arm, clock);
    let back: Vec<Isometry3<f64>> = poses.iter().map(Isometry3::inverse).collect();
    visit_swept(sight, &poses, motion.tool, |at, point| {
        let place = back[at] * sight.scan.points[point];
        let normal = back[at] * sight.scan.normals[point].into_inner();
        laid[point] += stays[at] * nozzle.deposit_rate(&place, &normal);
    });
    laid
}

/// Contact poses along a motion on the surface, and how long each stands for. \[s\]
fn stays(motion: Trajectory<'_>, arm: &Arm, clock: Clock) -> (Vec<Isometry3<f64>>, Vec<f64>) {
    let tool = motion.tool.on(arm);
    let (mut poses, mut times) = (Vec::new(), Vec::new());
    for k in (1..motion.knots.len()).filter(|&k| motion.on_surface(k)) {
        let curve = motion.curve(k);
        let steps = curve.steps(STEP).max(1);
        let at = |share: f64| tool.pose(&curve.at(share));
        for step in 0..steps {
            let [from, middle, to] =
                [0.0, 0.5, 1.0].map(|share| at((step as f64 + share) / steps as f64));
            let way = || (to.translation.vector - from.translation.vector).norm();
            times.push(match clock {
                Clock::Timed => curve.seconds() / steps as f64,
                Clock::Speed(speed) => way() / speed,
            });
            poses.push(middle);
        }
    }
    (poses, times)
}
