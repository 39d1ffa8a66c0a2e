//! Why a point that the arm reaches is not swept, as the plan's motion shows it.

use nullsweep_robot::{Arm, Footprint};
use nullsweep_surface::{Grid, Scan};
use serde::{Deserialize, Serialize};

use super::pads::contact_motion;
use crate::plan::Trajectory;

/// Why a point is not swept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Missed {
    /// The nozzle sprays it, but too little or too much comes to lie on it.
    Deposit,
    /// It is before the camera, but something stands between.
    Hidden,
    /// The pad passes over it, but its normal is farther off the pad's than the tool works.
    Aslant,
    /// The pad passes over it, but it lies too high or too deep.
    OffPlane,
    /// The pad is set down on it and lifted off at once: it does not move there.
    Touched,
    /// No motion to its patch was found.
    NoMotion,
    /// The pad does not come over it.
    Beside,
}

impl Missed {
    /// All of them, in the order in which they are told.
    pub const ALL: [Self; 7] = [
        Self::Deposit,
        Self::Hidden,
        Self::Aslant,
        Self::OffPlane,
        Self::Touched,
        Self::NoMotion,
        Self::Beside,
    ];
}

impl std::fmt::Display for Missed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Deposit => "sprayed, but too little or too much",
            Self::Hidden => "before the camera, but hidden",
            Self::Aslant => "passed over, but too aslant",
            Self::OffPlane => "passed over, but too high or too deep",
            Self::Touched => "under a mere touch",
            Self::NoMotion => "no motion to its patch",
            Self::Beside => "under no stroke",
        })
    }
}

/// Reachable points that are not swept for one reason.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MissedPoints {
    /// The reason.
    pub why: Missed,
    /// How many.
    pub points: usize,
    /// Their share of all reachable points.
    pub share: f64,
}

/// Farthest before or behind the plane of what the pad works on that a point counts as passed over.
/// \[m\]
const OVER: f64 = 0.02;

/// What is known of the points of a scan.
#[derive(Clone, Copy)]
pub struct Unswept<'a> {
    /// Which are to be swept.
    pub reachable: &'a [bool],
    /// Which are.
    pub swept: &'a [bool],
    /// Those of patches that no motion leads to.
    pub no_motion: &'a [u32],
}

/// The reachable points that some motions of the pad do not sweep, by the first of [`Missed::ALL`]
/// that is so; reasons without points are left out.
#[must_use]
pub fn missed<'a>(
    scan: &Scan,
    left: Unswept<'_>,
    motions: impl IntoIterator<Item = Trajectory<'a>>,
    arm: &Arm,
) -> Vec<MissedPoints> {
    let is_open = |i: usize| left.reachable[i] && !left.swept[i];
    let mut why: Vec<Missed> = vec![Missed::Beside; scan.points.len()];
    left.no_motion.iter().for_each(|&i| why[i as usize] = Missed::NoMotion);
    for motion in motions {
        let tool = motion.tool;
        let reach = libm::hypot(tool.outer_radius(), OVER.max(tool.reach_normal));
        let grid = Grid::new(&scan.points, 0.5 * reach);
        let strokes = contact_motion(motion, arm).into_iter().map(|pose| (pose, false));
        let mounted = tool.on(arm);
        let touches = touches(motion).map(|knot| (mounted.pose(&motion.knots[knot].q), true));
        for (pose, is_touch) in strokes.chain(touches) {
            let [x, y, z] = [0, 1, 2].map(|i| pose.rotation * nalgebra::Vector3::ith_axis(i));
            let centre = nalgebra::Point3::from(pose.translation.vector + z.scale(tool.stand_off));
            grid.within(&centre, reach, |index, point, _| {
                let (i, offset) = (index as usize, point - centre);
                let is_under = tool.is_under(offset.dot(&x), offset.dot(&y))
                    && offset.dot(&z).abs() <= OVER.max(tool.reach_normal);
                if !is_under || !is_open(i) {
                    return;
                }
                let near = offset.dot(&z).abs() <= tool.reach_normal;
                let facing = -scan.normals[i].dot(&z) >= libm::cos(tool.reach_angle);
                let now = match (near, facing, tool.footprint) {
                    (true, true, _) if is_touch => Missed::Touched,
                    (true, true, Footprint::Nozzle(_)) => Missed::Deposit,
                    (true, true, Footprint::Camera(_)) => Missed::Hidden,
                    (true, false, _) => Missed::Aslant,
                    _ => Missed::OffPlane,
                };
                why[i] = why[i].min(now);
            });
        }
    }
    let whole = left.reachable.iter().filter(|r| **r).count().max(1) as f64;
    let of = |cause: Missed| (0..why.len()).filter(|&i| is_open(i) && why[i] == cause).count();
    let rows = Missed::ALL.map(|why| (why, of(why)));
    let some = rows.into_iter().filter(|(_, points)| *points > 0);
    some.map(|(why, points)| MissedPoints { why, points, share: points as f64 / whole }).collect()
}

/// The knots in which the pad is on the surface, but not on the way there or from there.
fn touches(path: Trajectory<'_>) -> impl Iterator<Item = usize> + use<'_> {
    let count = path.knots.len();
    (0..count).filter(move |&k| {
        let moves = path.on_surface(k) && k > 0 || k + 1 < count && path.on_surface(k + 1);
        path.line(k).is_some() && !moves
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, UnitVector3, Vector3};
    use nullsweep_robot::{ArmSpec, JointVector, Robot, Side, Tool};

    use super::*;
    use crate::plan::{PlanKnot, Profile};

    #[test]
    fn each_reachable_point_that_is_left_has_the_reason_that_the_motion_shows() {
        let arm = Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).expect("the PR2's arm");
        let tool = Tool::default();
        let home = arm.home();
        let pose = tool.on(&arm).pose(&home);
        // In the contact frame, z into the surface, seen from what the pad works on.
        let at = |x: f64, y: f64, z: f64| pose * Point3::new(x, y, z + tool.stand_off);
        let facing = |tilt: f64| {
            UnitVector3::new_normalize(pose * Vector3::new(libm::sin(tilt), 0.0, -libm::cos(tilt)))
        };
        let rows = [
            (at(0.0, 0.0, 0.0), 0.0),
            (at(0.0, 0.01, 0.0), 0.8),
            (at(0.01, 0.0, 0.015), 0.0),
            (at(0.0, 0.3, 0.0), 0.0),
            (at(0.0, 0.4, 0.0), 0.0),
            (at(0.0, 0.5, 0.0), 0.0),
        ];
        let points: Vec<Point3<f64>> = rows.iter().map(|row| row.0).collect();
        let normals = rows.iter().map(|row| facing(row.1)).collect();
        let scan = Scan { raw: points.clone(), points, normals, spacing: 0.01 };
        let reachable = [true, true, true, true, true, false];
        let left = Unswept { reachable: &reachable, swept: &[false; 6], no_motion: &[4] };
        let knot = |line: bool, time_ns: u64| PlanKnot {
            time_ns,
            line: line.then_some([0.0; 3]),
            q: home + JointVector::from_fn(|j| if j == 0 { 1e-9 * time_ns as f64 } else { 0.0 }),
            ..PlanKnot::free(home)
        };
        let reasons = |knots: &[PlanKnot]| {
            let motion = Trajectory { tool: &tool, profile: Profile::Velocity, knots };
            let found = missed(&scan, left, [motion], &arm);
            let shares: f64 = found.iter().map(|row| row.share).sum();
            assert!(
                (shares - found.iter().map(|r| r.points).sum::<usize>() as f64 / 5.0).abs() < 1e-12
            );
            found.into_iter().map(|row| (row.why, row.points)).collect::<Vec<_>>()
        };
        use Missed::{Aslant, Beside, NoMotion, OffPlane, Touched};
        let touch = [knot(false, 0), knot(true, 1), knot(false, 2)];
        let one_each = [(Aslant, 1), (OffPlane, 1), (Touched, 1), (NoMotion, 1), (Beside, 1)];
        assert_eq!(reasons(&touch), one_each);
        // Nowhere on the surface.
        let beside = [knot(false, 0), knot(false, 1)];
        assert_eq!(reasons(&beside), [(NoMotion, 1), (Beside, 4)]);
    }
}
