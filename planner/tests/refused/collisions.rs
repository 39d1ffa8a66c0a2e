//! Ways to collide.

use nalgebra::{Isometry3, Point3, Vector3};
use nullsweep_collision::Obstacle;
use nullsweep_planner::plan::Plan;
use nullsweep_planner::workcell::Scene;
use nullsweep_robot::JointVector;

use crate::case::Case;
use crate::stage::{
    detour, judge, link, moved, on_the_line, pad, pad_centre, posture, retimed, scene_with, spoilt,
    stage,
};

/// The longest segment without contact.
fn longest_transfer(plan: &Plan) -> usize {
    let way = |k: &usize| (pad_centre(&plan.knots[*k].q) - pad_centre(&plan.knots[k - 1].q)).norm();
    let free = (1..plan.knots.len()).filter(|k| plan.line(*k).or(plan.line(k - 1)).is_none());
    free.max_by(|a, b| way(a).total_cmp(&way(b))).expect("a transfer")
}

/// A plan that calls a stretch of its sweep a transfer, and the first knot of it that is too far
/// from both ends to be a lift.
fn dragged(plan: &Plan) -> (Plan, usize) {
    let centre = |k: usize| pad_centre(&plan.knots[k].q);
    let from = on_the_line(plan);
    let first = (from + 1..).find(|&k| (centre(k) - centre(from)).norm() > 0.052).expect("a sweep");
    let far = |k: &usize| (centre(*k) - centre(first)).norm() > 0.06;
    let to = (first..plan.knots.len()).find(far).expect("a sweep");
    assert!((from..=to).all(|k| plan.line(k).is_some()));
    let plan = spoilt(plan, |knots| knots[from + 1..to].iter_mut().for_each(|k| k.line = None));
    (plan, first)
}

/// The start posture, the arm raised above the chair.
fn raised() -> JointVector {
    posture(&[("r_shoulder_lift_joint", -0.3)])
}

/// The same turned to the robot's right, away from the chair.
fn aside(joints: &[(&str, f64)]) -> JointVector {
    let turned = [("r_shoulder_pan_joint", -1.6), ("r_shoulder_lift_joint", -0.3)];
    posture(&[&turned, joints].concat())
}

/// The plan with a way from its start to a posture at the robot's right, in knot 3, and back.
fn over_there(joints: &[(&str, f64)]) -> Plan {
    detour(&stage().bang, &[raised(), aside(&[]), aside(joints), aside(&[]), raised()])
}

/// What is left of a plan from a knot on.
fn from_knot(plan: &Plan, knot: usize) -> Plan {
    let mut plan = plan.clone();
    plan.knots.drain(..knot);
    let start = plan.knots[0].time_ns;
    plan.knots.iter_mut().for_each(|k| k.time_ns -= start);
    plan
}

/// A table right under the elbow of the arm that is held aside.
fn table() -> Scene {
    let below = link("r_elbow_flex_link", &aside(&[])) - Vector3::z() * 0.18;
    scene_with("table", Vector3::new(0.06, 0.06, 0.01), below)
}

/// The hand right over the floor beside the robot.
fn low() -> Plan {
    over_there(&[
        ("r_shoulder_lift_joint", 1.0),
        ("r_upper_arm_roll_joint", -3.1),
        ("r_elbow_flex_joint", -0.6),
        ("r_wrist_flex_joint", -0.3),
    ])
}

#[test]
fn what_only_comes_near_is_accepted() {
    let s = stage();
    // The way there and back to the start; what sweeps the seat may be in the table.
    let way = |mut plan: Plan| {
        plan.knots.truncate(7);
        plan
    };
    assert_eq!(judge(&way(over_there(&[])), &table()).violations, []);
    assert_eq!(judge(&way(low()), &s.scene).violations, []);
}

pub(crate) fn cases() -> Vec<Case> {
    let s = stage();
    let k = on_the_line(&s.bang);
    let into = pad(&s.bang.knots[k].q).rotation * Vector3::z() * 0.03;
    let pressed = spoilt(&s.bang, |knots| knots[k].q = moved(knots[k].q, into));
    // The sponge gives way by 10 mm and no more; the fingers are 1 mm farther back.
    let deep = pad(&s.bang.knots[k].q).rotation * Vector3::z() * 0.0115;
    let deep = spoilt(&s.bang, |knots| knots[k].q = moved(knots[k].q, deep));
    let jump = longest_transfer(&s.bang);
    let middle = s.bang.curve(jump).at(0.5);
    let post = scene_with("post", Vector3::repeat(0.01), pad_centre(&middle));
    let mut hidden = s.scene.clone();
    hidden.unseen = vec![s.bang.base_pose() * Point3::from(pad_centre(&middle))];
    let (dragged, from) = dragged(&s.bang);
    let elbow = over_there(&[("r_shoulder_lift_joint", 0.3)]);
    // Across the chest, the hand into the other shoulder.
    let across = posture(&[
        ("r_shoulder_pan_joint", 0.5),
        ("r_upper_arm_roll_joint", -1.8),
        ("r_elbow_flex_joint", -1.8),
        ("r_forearm_roll_joint", 0.0),
        ("r_wrist_flex_joint", -1.0),
    ]);
    let across = detour(&s.bang, &[raised(), across]);
    let folded = over_there(&[("r_elbow_flex_joint", -2.0)]);
    let mut higher = s.scene.clone();
    higher.obstacles[0] = Obstacle::floor(Isometry3::translation(0.0, 0.0, 0.1));
    // Only the first knot is where the arm may not be: what ends there was never looked at.
    let starts_folded = from_knot(&folded, 3);
    let in_the_torso = scene_with("pillar", Vector3::repeat(0.02), Vector3::new(-0.05, 0.0, 0.5));
    let case = Case::new;
    vec![
        case("the hand in the seat", retimed(pressed), k, "scan point"),
        case("the sponge pressed too deep", retimed(deep), k, "scan point"),
        Case { scene: Some(table()), ..case("the elbow in a table", elbow, 3, "obstacle table") },
        Case { scene: Some(higher), ..case("a floor 10 cm higher", low(), 3, "obstacle floor") },
        case("the hand in the body", across, 2, "l_shoulder_pan_link"),
        case("the arm folded", folded, 3, "r_forearm_link"),
        case("the sponge dragged along", dragged, from, "scan point"),
        Case {
            scene: Some(in_the_torso),
            ..case("a pillar where the robot stands", s.bang.clone(), 0, "obstacle pillar")
        },
        case("it begins in itself", starts_folded, 0, "r_forearm_link"),
        Case {
            scene: Some(post),
            ..case("a post in the way", s.bang.clone(), jump, "obstacle post")
        },
        Case {
            scene: Some(hidden),
            ..case("the hand where nobody has looked", s.bang.clone(), jump, "unseen space")
        },
    ]
}
