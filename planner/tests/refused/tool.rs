//! Ways to lead a tool as it does not work.

use nullsweep_planner::plan::Plan;
use nullsweep_planner::verify::ViolationKind;
use nullsweep_robot::{Camera, Footprint, Roller, Tool};

use crate::case::Case;
use crate::stage::{pad_centre, stage};

/// The pad's plan with another tool, whose body is in the surface where the pad lies on it.
fn with(plan: &Plan, change: impl FnOnce(&mut Tool)) -> Plan {
    let mut plan = plan.clone();
    change(&mut plan.tool);
    plan
}

fn first_on_surface(plan: &Plan) -> usize {
    (1..plan.knots.len()).find(|&k| plan.on_surface(k)).expect("it wipes")
}

pub(crate) fn cases_of_stand_off() -> Vec<Case> {
    let s = stage();
    // The pad's plane is 4 mm in the surface.
    let case = |what, plan: &Plan, back: f64, reach_angle, says: &str| {
        let plan = with(plan, |tool| {
            let camera = Camera { distance: [0.005, 0.05], field_of_view: [0.8, 0.6] };
            tool.footprint = Footprint::Camera(camera);
            tool.centre[0] -= back;
            (tool.stand_off, tool.reach_angle) = (0.016, reach_angle);
        });
        let knot = first_on_surface(&plan);
        Case { also: &[ViolationKind::Collision], ..Case::new(what, plan, knot, says) }
    };
    vec![
        case("a camera too near", &s.bang, 0.005, 0.5, "0.005 to 0.05 m are its own"),
        case("one that looks aslant", &s.smooth, 0.02, 0.0, "at most 0 is its reach_angle"),
    ]
}

/// The first knot by which the pad has gone 5 mm from where it was set down.
fn gone(plan: &Plan) -> usize {
    let first = first_on_surface(plan);
    let from = pad_centre(&plan.curve(first).at(0.0));
    let far = |k: &usize| {
        let curve = plan.curve(*k);
        (0..=200).any(|i| (pad_centre(&curve.at(f64::from(i) / 200.0)) - from).norm() >= 0.005)
    };
    (first..plan.knots.len()).find(far).expect("it goes farther")
}

pub(crate) fn cases_of_slip() -> Vec<Case> {
    let s = stage();
    let case = |what, plan: &Plan, across, symmetric, says: &str| {
        let plan = with(plan, |tool| {
            tool.footprint = Footprint::Roller(Roller { radius: 0.02, slip_max: 0.05 });
            tool.width = 0.03;
            (tool.across, tool.symmetric) = (across, symmetric);
        });
        let knot = gone(&plan);
        Case { also: &[ViolationKind::Collision], ..Case::new(what, plan, knot, says) }
    };
    let rolls = "a roller rolls within 0.05 rad";
    vec![
        case("a roller that goes sideways", &s.bang, [0.0, 0.0, 1.0], true, rolls),
        case("one that may not go back", &s.smooth, [0.0, -1.0, 0.0], false, rolls),
    ]
}
