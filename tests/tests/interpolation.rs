//! Planner and executor move the arm between two knots by code of their own. Here both follow the
//! same random plans: what the planner has verified is what the executor commands.

use nullsweep_executor::{JointVector, PlanKnot, reach, sample, top_acceleration, top_speed};
use nullsweep_ipc_types::Interpolation;
use nullsweep_planner::plan::{self, CostKind, FORMAT, Method, Plan, Profile};
use nullsweep_robot::{MAX_DOF, Tool};
use proptest::prelude::*;

/// What positions may differ by; the most that was seen is 5.3e-15. \[rad\]
const POSITION: f64 = 2e-14;
/// What accelerations may differ by, as a share of the terms that they are the difference of; both
/// gates allow 1e-6 of the limit.
const ACCELERATION: f64 = 1e-14;
/// What velocities may differ by, as a share of the segment's greatest speed; seen: 2.6e-15.
const VELOCITY: f64 = 1e-14;

/// A joint's position \[rad\] and velocity \[rad/s\], its lanes differing.
fn joints() -> impl Strategy<Value = (JointVector, JointVector)> {
    let q = prop::array::uniform8(-4.0..4.0f64);
    // Also at rest, as plans begin and end.
    let v = prop_oneof![4 => prop::array::uniform8(-4.0..4.0f64), 1 => Just([0.0; MAX_DOF])];
    (q.prop_map(JointVector::new), v.prop_map(JointVector::new))
}

/// A plan through these joint vectors; before each but the first one, so many nanoseconds.
fn plan(profile: Profile, knots: &[((JointVector, JointVector), u64)]) -> Plan {
    let mut now = 0;
    let knots = knots.iter().enumerate().map(|(k, &((q, v), length))| {
        now += if k == 0 { 0 } else { length };
        let v = if profile == Profile::Velocity { JointVector::ZERO } else { v };
        plan::PlanKnot { time_ns: now, q, v, line: None, patch: None }
    });
    Plan {
        format: FORMAT,
        robot: "r".into(),
        fingerprint: 1,
        joints: (0..MAX_DOF).map(|j| format!("joint {j}")).collect(),
        held: Vec::new(),
        tool: Tool::default(),
        base: [0.0; 3],
        base_height: 0.0,
        method: Method::Tsp,
        cost: CostKind::Time,
        profile,
        jerk: None,
        seed: 1,
        knots: knots.collect(),
        patches: Vec::new(),
        surface: Vec::new(),
        regions: Vec::new(),
        continues: None,
        past: Vec::new(),
        left: Vec::new(),
        seal: None,
    }
}

/// What the executor makes of the plan's message.
fn received(plan: &Plan) -> (Interpolation, Vec<PlanKnot>) {
    let (header, knots) = plan.message_parts().expect("short enough");
    let kind = Interpolation::from_wire(header.interpolation).expect("a kind");
    let lanes = |wire: &[f64]| JointVector::from_fn(|j| wire[j]);
    let knots = knots.iter().map(|k| PlanKnot {
        time: k.time_from_start_ns as f64,
        q: lanes(&k.positions),
        v: lanes(&k.velocities),
        ramp: 1.0,
    });
    (kind, knots.collect())
}

fn apart(a: &JointVector, b: &JointVector) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn bits(q: &JointVector) -> [u64; MAX_DOF] {
    q.map(f64::to_bits)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn planner_and_executor_agree_between_knots_and_to_the_bit_in_them(
        cubic in any::<bool>(),
        knots in prop::collection::vec((joints(), 1_000_000..=2_000_000_000u64), 2..12),
        moments in prop::collection::vec(0.0..1.0f64, 8),
    ) {
        let profile = if cubic { Profile::Acceleration } else { Profile::Velocity };
        let plan = plan(profile, &knots);
        let (kind, knots) = received(&plan);
        prop_assert_eq!(kind == Interpolation::Cubic, cubic);
        for k in 1..knots.len() {
            let (curve, a, b) = (plan.curve(k), &knots[k - 1], &knots[k]);
            let top = (0..MAX_DOF).map(|j| curve.top_speed(j)).fold(0.0, f64::max);
            for (knot, share) in [(a, 0.0), (b, 1.0)] {
                let (theirs, own) = (sample(a, b, kind, knot.time), curve.at(share));
                prop_assert_eq!(bits(&own), bits(&theirs.q));
                prop_assert_eq!(bits(&own), bits(&knot.q));
                prop_assert!(apart(&curve.velocity(share), &theirs.v) <= VELOCITY * top);
            }
            let start = plan.knots[k - 1].time_ns;
            let length = plan.knots[k].time_ns - start;
            // Whole nanoseconds, the first and the last one within the segment among them.
            let inner = moments.iter().map(|u| (u * length as f64) as u64);
            for since in inner.chain([1, length - 1]) {
                let theirs = sample(a, b, kind, (start + since) as f64);
                // As `verify` finds the share.
                let share = since as f64 * 1e-9 / curve.seconds();
                let q = curve.at(share);
                let off = apart(&q, &theirs.q);
                prop_assert!(off <= POSITION, "{off:e} rad apart {since} ns after knot {}", k - 1);
                let off = apart(&curve.velocity(share), &theirs.v);
                prop_assert!(off <= VELOCITY * top, "{off:e} rad/s apart in segment {k}");
            }
        }
    }

    /// What the planner's check and the executor's guard judge a segment by.
    #[test]
    fn planner_and_executor_agree_on_a_segments_speed_acceleration_and_range(
        cubic in any::<bool>(),
        ends in prop::array::uniform2(joints()),
        length in 1_000_000..=2_000_000_000u64,
    ) {
        let profile = if cubic { Profile::Acceleration } else { Profile::Velocity };
        let plan = plan(profile, &ends.map(|end| (end, length)));
        let (kind, knots) = received(&plan);
        let curve = plan.curve(1);
        for j in 0..MAX_DOF {
            let (own, theirs) = (curve.top_speed(j), top_speed(&knots[0], &knots[1], kind, j));
            prop_assert!((own - theirs).abs() <= VELOCITY * own, "{own} and {theirs}");
            let (own, theirs) =
                (curve.top_acceleration(j), top_acceleration(&knots[0], &knots[1], kind, j));
            let (a, b, seconds) = (&knots[0], &knots[1], curve.seconds());
            let terms = ((b.q[j] - a.q[j]).abs() / seconds + a.v[j].abs() + b.v[j].abs()) / seconds;
            prop_assert!((own - theirs).abs() <= 20.0 * ACCELERATION * terms, "{own} and {theirs}");
            let (own, theirs) = (curve.range(j), reach(&knots[0], &knots[1], kind, j));
            let off = (own.0 - theirs.0).abs().max((own.1 - theirs.1).abs());
            prop_assert!(off <= POSITION, "{own:?} and {theirs:?}");
        }
    }
}
