//! The last gate: a sound plan, spoilt in one way at a time, is refused for just that.

mod case;
mod collisions;
#[path = "../common/mod.rs"]
mod common;
mod keep_out;
mod pad;
mod stage;
mod tool;

use case::Case;
use nullsweep_ipc_types::Knot;
use nullsweep_planner::plan::{Continues, Plan, PlanError, PlanKnot, Profile};
use nullsweep_planner::verify::{VerifyError, ViolationKind};
use nullsweep_robot::JointVector;
use stage::{detour, joint, judge, look, on_the_line, posture, retimed, spoilt, stage, stretched};

/// Ways to break each rule. A new kind does not compile without its own.
fn cases(kind: ViolationKind) -> Vec<Case> {
    match kind {
        ViolationKind::TimeOrder => times(),
        ViolationKind::NotFinite => numbers(),
        ViolationKind::Velocity => speeds(),
        ViolationKind::Acceleration => accelerations(),
        ViolationKind::Jerk => jerks(),
        ViolationKind::SoftLimit => limits(),
        ViolationKind::Collision => collisions::cases(),
        ViolationKind::KeepOut => keep_out::cases(),
        ViolationKind::StandOff => tool::cases_of_stand_off(),
        ViolationKind::Slip => tool::cases_of_slip(),
    }
}

/// The kinds one after another. A new kind does not compile without its place.
fn after(kind: ViolationKind) -> Option<ViolationKind> {
    Some(match kind {
        ViolationKind::TimeOrder => ViolationKind::NotFinite,
        ViolationKind::NotFinite => ViolationKind::Velocity,
        ViolationKind::Velocity => ViolationKind::Acceleration,
        ViolationKind::Acceleration => ViolationKind::Jerk,
        ViolationKind::Jerk => ViolationKind::SoftLimit,
        ViolationKind::SoftLimit => ViolationKind::Collision,
        ViolationKind::Collision => ViolationKind::KeepOut,
        ViolationKind::KeepOut => ViolationKind::StandOff,
        ViolationKind::StandOff => ViolationKind::Slip,
        ViolationKind::Slip => return None,
    })
}

/// Every case of a kind is refused for it, at its knot and for nothing else.
fn check(kind: ViolationKind) {
    let cases = cases(kind);
    assert!(cases.len() > 1);
    for case in cases {
        let found = judge(&case.plan, case.scene.as_ref().unwrap_or(&stage().scene)).violations;
        let (own, other): (Vec<_>, Vec<_>) = found.iter().partition(|v| v.kind == kind);
        let what = case.what;
        assert!(found.is_sorted_by_key(|v| v.knot), "{what}: not in order");
        assert!(!own.is_empty(), "{what}: accepted, or for another reason: {other:?}");
        assert_eq!(own[0].knot, case.knot, "{what}: {:?}", own[0]);
        let named = own.iter().any(|v| v.knot == case.knot && v.detail.contains(&case.says));
        assert!(named, "{what}: `{}` is not said: {own:?}", case.says);
        let strange = other.iter().find(|v| !case.also.contains(&v.kind));
        assert!(strange.is_none(), "{what}: {strange:?}");
    }
}

#[test]
fn the_unspoilt_plans_are_accepted() {
    let s = stage();
    let whole = judge(&s.whole, &s.scene);
    assert_eq!(whole, s.said, "not the pipeline's figures");
    for (plan, found) in [
        (&s.whole, whole),
        (&s.bang, judge(&s.bang, &s.scene)),
        (&s.smooth, judge(&s.smooth, &s.scene)),
    ] {
        assert_eq!(found.violations, []);
        assert!(plan.knots.len() > 100 && found.collision_checks >= plan.knots.len() - 1);
    }
}

#[test]
fn every_kind_of_violation_is_refused() {
    // Each kind beside the others: a look at a plan takes one core.
    std::thread::scope(|scope| {
        let mut kind = Some(ViolationKind::TimeOrder);
        while let Some(this) = kind {
            scope.spawn(move || check(this));
            kind = after(this);
        }
    });
}

fn times() -> Vec<Case> {
    let s = stage();
    let k = s.bang.knots.len() / 2;
    let says = |plan: &Plan, k: usize| format!("time {} ns", plan.knots[k].time_ns);
    let case = |what, plan: Plan, k| {
        let says = says(&plan, k);
        Case::new(what, plan, k, says)
    };
    let back = spoilt(&s.bang, |knots| knots[k].time_ns = knots[k - 1].time_ns - 1);
    let equal = spoilt(&s.bang, |knots| knots[k].time_ns = knots[k - 1].time_ns);
    let late = |plan: &Plan| {
        spoilt(plan, |knots| knots.iter_mut().for_each(|k| k.time_ns += 1_500_000_000))
    };
    let shortened = |count: usize| {
        let mut plan = s.bang.clone();
        plan.knots.truncate(count);
        plan
    };
    let endless =
        |plan: &Plan| spoilt(plan, |knots| knots.last_mut().expect("knots").time_ns = u64::MAX);
    vec![
        case("an end in 584 years", endless(&s.bang), s.bang.knots.len() - 1),
        case(
            "an end in 584 years, accelerations limited",
            endless(&s.smooth),
            s.smooth.knots.len() - 1,
        ),
        Case::new("no knot", shortened(0), 0, "0 knots"),
        Case::new("one knot", shortened(1), 0, "1 knots"),
        case("a time before the last one", back, k),
        case("the same time twice", equal, k),
        case("a start after 0", late(&s.bang), 0),
        case("a start after 0, accelerations limited", late(&s.smooth), 0),
    ]
}

fn numbers() -> Vec<Case> {
    let s = stage();
    let case = |what, plan: &Plan, spoil: fn(&mut PlanKnot), says: &str| {
        let k = plan.knots.len() / 3;
        Case::new(what, spoilt(plan, |knots| spoil(&mut knots[k])), k, says)
    };
    // An infinite place is also an infinite way off.
    let endless = |case| Case {
        also: &[ViolationKind::Velocity, ViolationKind::Acceleration, ViolationKind::SoftLimit],
        ..case
    };
    vec![
        case("q is NaN", &s.bang, |k| k.q[3] = f64::NAN, "NaN"),
        case("q is NaN, accelerations limited", &s.smooth, |k| k.q[0] = f64::NAN, "NaN"),
        endless(case("q is infinite", &s.bang, |k| k.q[2] = f64::INFINITY, "inf")),
        endless(case("q is infinite, too", &s.smooth, |k| k.q[2] = f64::NEG_INFINITY, "-inf")),
        case("an unused lane is NaN", &s.bang, |k| k.q[7] = f64::NAN, "NaN"),
        case("v is NaN", &s.smooth, |k| k.v[1] = f64::NAN, "NaN"),
        endless(case("v is infinite", &s.smooth, |k| k.v[6] = f64::NEG_INFINITY, "-inf")),
        case("v that is not used is infinite", &s.bang, |k| k.v[0] = f64::INFINITY, "inf"),
    ]
}

/// The joint that uses most of its velocity on the way to a knot.
fn fastest(plan: &Plan, k: usize) -> usize {
    let (arm, curve) = (&stage().arm, plan.curve(k));
    let share = |j: &usize| curve.top_speed(*j) / arm.limits()[*j].velocity;
    (0..arm.dof()).max_by(|a, b| share(a).total_cmp(&share(b))).expect("joints")
}

/// From the start posture one joint alone, in free space: its times, positions and velocities.
fn alone(name: &str, motion: &[(u64, f64, f64)]) -> Plan {
    let (plan, j) = (&stage().smooth, joint(name));
    let start = PlanKnot { line: None, patch: None, ..plan.knots[0] };
    let knots = motion.iter().map(|&(time_ns, q, v)| {
        let mut knot = start;
        knot.time_ns = time_ns;
        knot.q[j] = q;
        knot.v[j] = v;
        knot
    });
    Plan { knots: knots.collect(), ..plan.clone() }
}

/// A joint without limits turns a while at `share` of its velocity, reached gently.
fn turning(share: f64) -> Plan {
    let name = "r_wrist_roll_joint";
    let v = share * stage().arm.limits()[joint(name)].velocity;
    let [a, b] = [0.5 * v, 0.5 * v + 0.3 * v];
    let (ramp, cruise) = (1_000_000_000, 300_000_000);
    let end = 2 * ramp + cruise;
    alone(name, &[(0, 0.0, 0.0), (ramp, a, v), (ramp + cruise, b, v), (end, a + b, 0.0)])
}

fn speeds() -> Vec<Case> {
    let s = stage();
    let name = |j: usize| format!("{}: ", s.arm.joint_names()[j]);
    let k = on_the_line(&s.bang);
    let halved = stretched(&s.bang, k, 0.5);
    let hurried = stretched(&s.bang, k, 1.0 - 1e-5);
    let speed = |k: &usize| s.smooth.curve(*k).top_speed(fastest(&s.smooth, *k));
    let quick = (1..s.smooth.knots.len()).max_by(|a, b| speed(a).total_cmp(&speed(b))).unwrap();
    let j = fastest(&s.smooth, quick);
    let scaled = spoilt(&s.smooth, |knots| knots[quick].v.iter_mut().for_each(|v| *v *= 3.0));
    vec![
        Case::new("half the time", halved, k, name(fastest(&s.bang, k))),
        Case::new("a hundred-thousandth less time", hurried, k, name(fastest(&s.bang, k))),
        Case {
            also: &[ViolationKind::Acceleration, ViolationKind::SoftLimit],
            ..Case::new("three times the velocity in a knot", scaled, quick, name(j))
        },
        Case::new("gently too fast", turning(1.01), 1, "r_wrist_roll_joint: "),
    ]
}

#[test]
fn a_joint_just_within_its_velocity_is_accepted() {
    assert_eq!(judge(&turning(0.999), &stage().scene).violations, []);
}

fn accelerations() -> Vec<Case> {
    let s = stage();
    let (k, last) = (on_the_line(&s.smooth), s.smooth.knots.len() - 1);
    let j = joint("r_elbow_flex_joint");
    let step = spoilt(&s.smooth, |knots| knots[k].v[j] += 0.1);
    let jolt = spoilt(&s.smooth, |knots| knots[k].q[j] += 1e-3);
    let ends = spoilt(&s.smooth, |knots| knots[last].v[j] = 1e-12);
    let starts = spoilt(&s.smooth, |knots| knots[0].v[j] = -1e-12);
    let mut cut = s.smooth.clone();
    cut.knots.truncate(k + 1);
    let mislabelled = Plan { profile: Profile::Acceleration, ..s.bang.clone() };
    vec![
        Case::new("a step of the velocity in a knot", step, k, "r_elbow_flex_joint: "),
        Case::new("a millimetre's jolt", jolt, k, "r_elbow_flex_joint: "),
        Case::new("not at rest at the end", ends, last, "not at rest"),
        Case::new("not at rest at the start", starts, 0, "not at rest"),
        Case::new("cut short in motion", cut, k, "not at rest"),
        Case {
            also: &[ViolationKind::Velocity, ViolationKind::SoftLimit],
            ..Case::new("bang-bang, taken for smooth", mislabelled, 1, " of ")
        },
    ]
}

fn jerks() -> Vec<Case> {
    let s = stage();
    let within = |jerk: JointVector| Plan { jerk: Some(jerk), ..s.smooth.clone() };
    let mut one = JointVector::new([1e9; 8]);
    let j = (0..7)
        .max_by(|a, b| s.smooth.knots[1].v[*a].abs().total_cmp(&s.smooth.knots[1].v[*b].abs()));
    let j = j.expect("seven joints");
    one[j] = 1.0;
    let of_one = format!("{}: jerk", s.smooth.joints[j]);
    vec![
        Case::new("all joints jerk", within(JointVector::new([1.0; 8])), 1, "jerk"),
        Case::new("one joint jerks", within(one), 1, &of_one[..of_one.len() - 6]),
    ]
}

#[test]
fn a_plan_that_goes_on_from_another_one_may_start_in_motion() {
    let s = stage();
    let j = joint("r_elbow_flex_joint");
    let mut plan = spoilt(&s.smooth, |knots| knots[0].v[j] = -1e-12);
    plan.continues = Some(Continues { digest: 1, knot: 1 });
    assert_eq!(judge(&plan, &s.scene).violations, []);
}

/// A start with the wrist so far beyond its upper end.
fn from_the_edge(beyond: f64) -> Plan {
    let upper = stage().arm.limits()[joint("r_wrist_flex_joint")].upper;
    let edge = posture(&[("r_wrist_flex_joint", upper + beyond)]);
    let mut plan = detour(&stage().bang, &[edge]);
    plan.knots.remove(0);
    retimed(plan)
}

/// The same, its first motion slow.
fn slow(beyond: f64) -> Plan {
    stretched(&from_the_edge(beyond), 1, 20.0)
}

/// What was followed before is not refused for its limits, but it has to end.
#[test]
fn a_past_without_an_end_is_refused() {
    let s = stage();
    let mut plan = Plan { past: s.bang.followed(s.bang.knots.len()), ..s.bang.clone() };
    assert_eq!(judge(&plan, &s.scene).violations, []);
    plan.past[0].knots[on_the_line(&s.bang)].q[joint("r_wrist_roll_joint")] = 1e12;
    let found = look(&plan, &s.scene).map(|v| v.violations);
    assert!(matches!(found, Err(VerifyError::Plan(PlanError::TooFar { .. }))), "{found:?}");
}

/// The elbow swings past its upper end between two knots where it has room to brake.
fn bow() -> Plan {
    let name = "r_elbow_flex_joint";
    let (length, v) = (200_000_000, 0.3);
    let edge = stage().arm.limits()[joint(name)].braking(v).1 - 0.2 * v * length as f64 * 1e-9;
    let (near, rest) = (1_000_000_000, edge - 0.5 * v);
    let far = near + length;
    alone(name, &[(0, rest, 0.0), (near, edge, v), (far, edge, -v), (far + near, rest, 0.0)])
}

fn limits() -> Vec<Case> {
    let s = stage();
    let beyond = |name: &str, upper: bool| {
        let limits = &s.arm.limits()[joint(name)];
        let at = if upper { limits.upper + 1e-3 } else { limits.lower - 1e-3 };
        detour(&s.bang, &[posture(&[(name, at)])])
    };
    let case =
        |what, name: &str, upper| Case::new(what, beyond(name, upper), 1, format!("{name}: "));
    let roll = "r_wrist_roll_joint";
    let turned = |time_ns, to| alone(roll, &[(0, 0.0, 0.0), (time_ns, to, 0.0)]);
    vec![
        Case::new("160 turns and more", turned(3_000_000_000_000, -1001.0), 1, format!("{roll}: ")),
        Case {
            also: &[ViolationKind::Velocity],
            ..Case::new("1e12 rad", turned(Knot::LATEST_NS, 1e12), 1, format!("{roll}: "))
        },
        case("the wrist past its upper end", "r_wrist_flex_joint", true),
        case("the shoulder past its lower end", "r_shoulder_lift_joint", false),
        Case::new("too fast so near to an end", from_the_edge(-0.01), 1, "r_wrist_flex_joint: "),
        Case::new("a start past an end", slow(1e-3), 0, "r_wrist_flex_joint: "),
        Case::new("past an end between knots", bow(), 2, "r_elbow_flex_joint: "),
    ]
}

#[test]
fn a_joint_near_its_end_may_move_slowly() {
    assert_eq!(judge(&slow(-0.01), &stage().scene).violations, []);
}
