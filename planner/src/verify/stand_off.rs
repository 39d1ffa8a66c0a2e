//! Whether a tool that works from afar keeps its distance and faces the surface.

use nalgebra::{Isometry3, Point3, Vector3};
use nullsweep_robot::{Arm, Tool};
use nullsweep_surface::{Grid, Scan};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::violation::{Violation, ViolationKind};
use crate::plan::Plan;
use crate::workcell::FACED;

/// Joints move at most this far between two looks. \[rad\] or \[m\]
const STEP: f64 = 0.01;
/// Farthest from the tool's axis that a point is met by it. \[m\]
const BESIDE: f64 = 0.01;
/// How much farther from the place that the tool is led over than its bounds let it be the surface is
/// looked for. \[m\]
const BEYOND: f64 = 0.02;

/// How a tool that works from afar stands before the surface, over the motion along it: by the scan's
/// point nearest to the place `stand_off` ahead of it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StandOff {
    /// The least distance along the tool's axis. \[m\]
    pub distance_min_m: f64,
    /// The greatest. \[m\]
    pub distance_max_m: f64,
    /// The greatest angle between the axis and the normal there, of the points as near as that one but
    /// for the scan's spacing the least. \[rad\]
    pub incidence_max_rad: f64,
}

/// One look.
#[derive(Clone, Copy)]
struct Look {
    distance: f64,
    incidence: f64,
}

/// The figures, and the first place of each segment where a bound is broken; nothing of a tool that
/// touches.
pub fn stand_off(plan: &Plan, arm: &Arm, scan: &Scan) -> (Option<StandOff>, Vec<Violation>) {
    let tool = &plan.tool;
    if tool.touches() || scan.points.is_empty() {
        return (None, Vec::new());
    }
    let [near, far] = tool.distance();
    let reach = (tool.stand_off - near).max(far - tool.stand_off) + BEYOND;
    let grid = Grid::new(&scan.points, reach);
    let pad = tool.on(arm);
    let of_segment = |k: usize| -> Vec<Look> {
        let curve = plan.curve(k);
        let steps = curve.steps(STEP).max(1);
        let at = |step: usize| pad.pose(&curve.at(step as f64 / steps as f64));
        (0..=steps).filter_map(|step| look(&at(step), tool, scan, (&grid, reach))).collect()
    };
    let segments: Vec<usize> = (1..plan.knots.len()).filter(|&k| plan.on_surface(k)).collect();
    let looks: Vec<(usize, Vec<Look>)> =
        segments.into_par_iter().map(|k| (k, of_segment(k))).collect();
    let broken = |(k, looks): &(usize, Vec<Look>)| {
        let detail = looks.iter().find_map(|look| broken(look, tool))?;
        Some(Violation { knot: *k, kind: ViolationKind::StandOff, detail })
    };
    let violations = looks.iter().filter_map(broken).collect();
    let all = || looks.iter().flat_map(|(_, looks)| looks);
    let figures = StandOff {
        distance_min_m: all().map(|look| look.distance).fold(f64::INFINITY, f64::min),
        distance_max_m: all().map(|look| look.distance).fold(0.0, f64::max),
        incidence_max_rad: all().map(|look| look.incidence).fold(0.0, f64::max),
    };
    (all().next().map(|_| figures), violations)
}

/// What is before the tool; `None` where no surface is. Past a border or over a hole, where nothing is
/// near the place that it is led over, what its axis meets first counts, and has no angle.
fn look(
    pose: &Isometry3<f64>,
    tool: &Tool,
    scan: &Scan,
    (grid, reach): (&Grid, f64),
) -> Option<Look> {
    let target = pose * Point3::new(0.0, 0.0, tool.stand_off);
    let axis = pose.rotation * Vector3::z();
    if let Some((nearest, squared)) = grid.nearest(&target, FACED, |_| true) {
        let distance = (scan.points[nearest as usize].coords - pose.translation.vector).dot(&axis);
        let mut facing = -1.0_f64;
        grid.within(&target, squared.sqrt() + scan.spacing, |index, _, _| {
            facing = facing.max(-scan.normals[index as usize].dot(&axis));
        });
        return Some(Look { distance, incidence: libm::acos(facing.clamp(-1.0, 1.0)) });
    }
    let mut first = f64::INFINITY;
    grid.within(&target, reach, |_, point, squared| {
        let ahead = (point - target).dot(&axis);
        if squared - ahead * ahead <= BESIDE * BESIDE {
            first = first.min(tool.stand_off + ahead);
        }
    });
    first.is_finite().then_some(Look { distance: first, incidence: 0.0 })
}

/// Which bound a look breaks; numbers that are none break it.
fn broken(look: &Look, tool: &Tool) -> Option<String> {
    let [near, far] = tool.distance();
    let Look { distance, incidence } = *look;
    if !(near..=far).contains(&distance) {
        return Some(format!(
            "{} is {distance:.3} m from the surface along its axis: {near} to {far} m are its own",
            tool.name
        ));
    }
    let is_within = incidence <= tool.reach_angle;
    (!is_within).then(|| {
        format!(
            "{} meets the surface at {incidence:.2} rad from its normal, at most {} is its reach_angle",
            tool.name, tool.reach_angle
        )
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitVector3;
    use nullsweep_robot::{ArmSpec, Camera, Footprint, Robot, Side};

    use super::*;
    use crate::plan::PlanKnot;

    /// A camera of the PR2's arm at home, held before a level square that far away and so much aslant.
    fn looked(distance: f64, tilt: f64) -> (Option<StandOff>, Vec<Violation>) {
        let robot = Robot::pr2();
        let arm = robot.arm(&ArmSpec::pr2(Side::Right)).expect("the PR2's arm");
        let camera = Camera { distance: [0.25, 0.35], field_of_view: [0.8, 0.6] };
        let tool = Tool {
            stand_off: 0.3,
            reach_angle: 0.5,
            footprint: Footprint::Camera(camera),
            ..Tool::default()
        };
        let knot =
            |time_ns: u64| PlanKnot { time_ns, line: Some([0.0; 3]), ..PlanKnot::free(arm.home()) };
        let plan = Plan::of(&robot, &arm, &tool, vec![knot(0), knot(1_000_000_000)]);
        let pose = tool.on(&arm).pose(&arm.home());
        let normal = pose * Vector3::new(libm::sin(tilt), 0.0, -libm::cos(tilt));
        let at = |i: i32| 0.005 * f64::from(i) - 0.05;
        let points: Vec<Point3<f64>> =
            (0..441).map(|k| pose * Point3::new(at(k % 21), at(k / 21), distance)).collect();
        let normals = vec![UnitVector3::new_normalize(normal); points.len()];
        let scan = Scan { raw: points.clone(), points, normals, spacing: 0.005 };
        stand_off(&plan, &arm, &scan)
    }

    #[test]
    fn too_near_too_far_and_too_aslant_are_violations() {
        let (figures, violations) = looked(0.3, 0.3);
        let figures = figures.expect("a surface before it");
        assert!(violations.is_empty(), "{violations:?}");
        assert!((figures.distance_min_m - 0.3).abs() < 1e-9);
        assert!((figures.incidence_max_rad - 0.3).abs() < 1e-6);
        for (distance, tilt, says) in [
            (0.335, 0.0, None),
            (0.245, 0.0, None),
            (0.265, 0.0, None),
            (0.36, 0.0, None),
            (0.3, 0.55, Some("0.55 rad from its normal")),
        ] {
            let (_, violations) = looked(distance, tilt);
            let is_wrong = !(0.25..=0.35).contains(&distance) || says.is_some();
            assert_eq!(violations.len(), usize::from(is_wrong), "{distance}, {tilt}");
            for violation in violations {
                assert_eq!((violation.knot, violation.kind), (1, ViolationKind::StandOff));
                let says = says.map_or(format!("{distance:.3} m from the surface"), str::to_owned);
                assert!(violation.detail.contains(&says), "{}", violation.detail);
            }
        }
        let (_, violations) = looked(0.339, 0.0);
        assert!(violations.is_empty());
        // Nothing near what it is led over: no surface to be at a distance from.
        assert_eq!(looked(0.5, 0.0), (None, Vec::new()));
    }
}
