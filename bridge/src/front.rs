//! The other way round: a trajectory that some program has for a controller, as a plan for the
//! executor.

use nullsweep_executor::{Guard, PlanKnot, ends, top_acceleration, top_jerk, top_speed};
use nullsweep_ipc_types::{Interpolation, Knot, MAX_KNOTS};
use nullsweep_robot::JointVector;

/// How much slower the way to the first point is made at each try.
const SLOWER: f64 = 1.2;
/// The least time to the first point. \[s\]
const SHORTEST: f64 = 0.02;
/// How much later than it was wished the first point may be reached. \[s\]
const LONGEST: f64 = 60.0;
/// What of each limit the way to the first point uses.
const SHARE: f64 = 0.9;

/// A point of a trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waypoint {
    /// Since its start. \[ns\]
    pub after_ns: u64,
    /// \[rad\] or \[m\]
    pub q: JointVector,
    /// `None`: it is gone to straight. \[rad/s\] or \[m/s\]
    pub v: Option<JointVector>,
}

/// A trajectory as the executor takes it.
#[derive(Clone, Debug, PartialEq)]
pub struct Front {
    /// From time 0 on.
    pub knots: Vec<Knot>,
    /// Cubic where all points have velocities.
    pub interpolation: Interpolation,
    /// By how much the points come later than they were wished. \[ns\]
    pub later_ns: u64,
}

/// Why a trajectory is no plan.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FrontError {
    /// None of its points lies ahead.
    #[error("all of its {points} points are in the past, or it has none")]
    Past {
        /// How many it has.
        points: usize,
    },
    /// Times do not rise.
    #[error("point {point} is not later than the one before it")]
    Order {
        /// Its place, from 0.
        point: usize,
    },
    /// Some points have velocities and some none.
    #[error("point {point} has no velocities and others have")]
    Mixed {
        /// Its place, from 0.
        point: usize,
    },
    /// A value is no number.
    #[error("point {point} has a value that is no number")]
    NotFinite {
        /// Its place, from 0.
        point: usize,
    },
    /// The executor takes no more.
    #[error("{points} points, the executor takes {MAX_KNOTS} knots")]
    Long {
        /// How many it has.
        points: usize,
    },
    /// No time is long enough.
    #[error(
        "its first point ahead is not reached within the arm's limits from where it holds, even \
         {LONGEST} s later"
    )]
    Unreachable,
}

/// The trajectory from where the arm holds, `passed_ns` after it was to begin: points whose time is
/// past are left out, and the first one that is not is gone to from rest, later where the joints'
/// limits need that. Whole turns of continuous joints are no distance.
///
/// # Errors
/// [`FrontError`] where it is none that can be gone along.
pub fn front(
    points: &[Waypoint],
    passed_ns: u64,
    holds: &JointVector,
    guard: &Guard,
) -> Result<Front, FrontError> {
    check(points)?;
    let ahead = points.partition_point(|p| passed_ns > 0 && p.after_ns <= passed_ns);
    let mut rest = &points[ahead..];
    let there = |p: &Waypoint| guard.farthest(holds, &p.q, guard.start_tolerance).is_none();
    // Its first point says where it begins, at time 0, or where it was thought to. Where it is all
    // that there is, it is gone to.
    let first_there = rest.first().is_some_and(|p| p.after_ns == 0 && there(p));
    let starts_there = ahead == 0 && first_there && rest.len() > 1;
    if !starts_there && rest.len() > 1 && rest[0].after_ns == 0 {
        rest = &rest[1..];
    }
    let Some(first) = rest.first() else {
        return Err(FrontError::Past { points: points.len() });
    };
    let curved = first.v.is_some();
    let interpolation = if curved { Interpolation::Cubic } else { Interpolation::Linear };
    let turns = guard.continuous().turns_to(&first.q, holds);
    let knot = |time_ns: u64, q: JointVector, v: JointVector| PlanKnot {
        time: time_ns as f64,
        q,
        v,
        ramp: 0.0,
    };
    let start = knot(0, *holds, JointVector::ZERO);
    let at = |time_ns, p: &Waypoint| knot(time_ns, p.q + turns, p.v.unwrap_or(JointVector::ZERO));
    let wished_ns = first.after_ns - passed_ns;
    // To one that is near enough the executor's own connector leads.
    let lead_ns = if starts_there {
        0
    } else {
        let next = rest.get(1).map(|p| at(p.after_ns - first.after_ns, p));
        let onward = next.map_or(JointVector::ZERO, |next| {
            JointVector::from_fn(|j| ends(&at(0, first), &next, interpolation, j)[0])
        });
        lead(&start, |time_ns| at(time_ns, first), &onward, wished_ns, interpolation, guard)?
    };
    let begin = (!starts_there).then_some(start);
    let rest = rest.iter().map(|p| at(p.after_ns - first.after_ns + lead_ns, p));
    let knots: Vec<Knot> = begin.into_iter().chain(rest).map(|k| wire(&k)).collect();
    if knots.len() > MAX_KNOTS {
        return Err(FrontError::Long { points: knots.len() });
    }
    Ok(Front { knots, interpolation, later_ns: lead_ns.saturating_sub(wished_ns) })
}

fn check(points: &[Waypoint]) -> Result<(), FrontError> {
    for (point, p) in points.iter().enumerate() {
        let velocities = p.v.unwrap_or(JointVector::ZERO);
        if !p.q.iter().chain(&velocities).all(|x| x.is_finite()) {
            return Err(FrontError::NotFinite { point });
        }
        if point > 0 && p.after_ns <= points[point - 1].after_ns {
            return Err(FrontError::Order { point });
        }
        if p.v.is_none() && points.iter().any(|p| p.v.is_some()) {
            return Err(FrontError::Mixed { point });
        }
    }
    Ok(())
}

/// The time to the first point from rest, at least as long as wished, within each joint's limits; it
/// goes on from there with the acceleration `onward`. \[ns\]
fn lead(
    start: &PlanKnot,
    first: impl Fn(u64) -> PlanKnot,
    onward: &JointVector,
    wished_ns: u64,
    kind: Interpolation,
    guard: &Guard,
) -> Result<u64, FrontError> {
    let wished = (wished_ns as f64 * 1e-9).max(SHORTEST);
    let mut seconds = wished;
    while seconds <= wished + LONGEST {
        let end = first((seconds * 1e9) as u64);
        let fits = guard.used().iter().enumerate().all(|(j, bound)| {
            let limits = &bound.limits;
            top_speed(start, &end, kind, j) <= SHARE * limits.velocity
                && top_acceleration(start, &end, kind, j) <= SHARE * limits.acceleration
                && is_smooth(start, &end, onward[j], kind, j, guard)
        });
        if fits {
            return Ok((seconds * 1e9) as u64);
        }
        seconds *= SLOWER;
    }
    Err(FrontError::Unreachable)
}

/// Whether a joint's jerk limit, where it has one, lets it begin so from rest and go on so.
fn is_smooth(
    start: &PlanKnot,
    end: &PlanKnot,
    onward: f64,
    kind: Interpolation,
    j: usize,
    guard: &Guard,
) -> bool {
    let Some(jerk) = guard.joints[j].limits.jerk else { return true };
    let ([begins, comes], own) = (ends(start, end, kind, j), top_jerk(start, end, kind, j));
    // In one cycle the step and the jerk beside it are seen.
    let beside = own * guard.period();
    own <= SHARE * jerk
        && begins.abs() + beside <= SHARE * guard.sudden(j)
        && (onward - comes).abs() + beside <= SHARE * guard.sudden(j)
}

fn wire(knot: &PlanKnot) -> Knot {
    let mut out = <Knot as bytemuck::Zeroable>::zeroed();
    out.time_from_start_ns = knot.time as u64;
    out.positions[..knot.q.len()].copy_from_slice(&knot.q[..]);
    out.velocities[..knot.v.len()].copy_from_slice(&knot.v[..]);
    out.patch = Knot::NO_PATCH;
    out.contact = nullsweep_ipc_types::Contact::Transfer.wire();
    out
}

#[cfg(test)]
mod tests {
    use nullsweep_robot::{ArmSpec, Robot, Side};

    use super::*;

    const MS: u64 = 1_000_000;

    fn guard() -> Guard {
        Guard::new(Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).expect("an arm").limits())
    }

    fn joint(j: usize, x: f64) -> JointVector {
        JointVector::from_fn(|k| if k == j { x } else { 0.0 })
    }

    fn point(ms: u64, q: f64, v: f64) -> Waypoint {
        Waypoint { after_ns: ms * MS, q: joint(0, q), v: Some(joint(0, v)) }
    }

    #[test]
    fn what_begins_where_the_arm_is_stays_as_it_is() {
        let points = [point(0, 0.0, 0.0), point(500, 0.05, 0.1), point(1000, 0.1, 0.0)];
        let found = front(&points, 0, &joint(0, 0.001), &guard()).expect("a plan");
        assert_eq!((found.knots.len(), found.later_ns), (3, 0));
        for (knot, p) in found.knots.iter().zip(&points) {
            assert_eq!(knot.time_from_start_ns, p.after_ns);
            assert_eq!((knot.positions[0], knot.velocities[0]), (p.q[0], p.v.expect("some")[0]));
        }
    }

    /// A program that plans from where the arm is measured may be behind it.
    #[test]
    fn what_begins_elsewhere_is_gone_to_from_where_the_arm_holds() {
        let points = [point(0, 0.05, 0.0), point(1000, 0.1, 0.0)];
        let found = front(&points, 0, &JointVector::ZERO, &guard()).expect("a plan");
        assert_eq!((found.knots.len(), found.later_ns), (2, 0));
        assert_eq!((found.knots[0].positions[0], found.knots[1].positions[0]), (0.0, 0.1));
        // Where it is all that there is, it is gone to as fast as that may be.
        let found = front(&points[..1], 0, &JointVector::ZERO, &guard()).expect("a plan");
        assert!(found.knots.len() == 2 && found.knots[1].positions[0] == 0.05, "{found:?}");
        assert!((0.1..1.0).contains(&(found.later_ns as f64 * 1e-9)), "{found:?}");
    }

    #[test]
    fn points_in_the_past_are_left_out_and_the_next_is_gone_to_from_rest() {
        let points =
            [point(0, 0.0, 0.0), point(500, 0.2, 0.5), point(900, 0.4, 0.5), point(2000, 0.6, 0.0)];
        let found = front(&points, 600 * MS, &joint(0, 0.2), &guard()).expect("a plan");
        // 0.2 rad in the 0.3 s that are left, to 0.5 rad/s, is more than 4 rad/s² allow.
        assert!(found.later_ns > 0 && found.knots.len() == 3, "{found:?}");
        assert_eq!((found.knots[0].positions[0], found.knots[0].velocities[0]), (0.2, 0.0));
        assert_eq!(found.knots[1].time_from_start_ns, 300 * MS + found.later_ns);
        let apart = found.knots[2].time_from_start_ns - found.knots[1].time_from_start_ns;
        assert_eq!(apart, 1100 * MS);
        assert_eq!(
            front(&points, 2000 * MS, &joint(0, 0.2), &guard()),
            Err(FrontError::Past { points: 4 })
        );
    }

    #[test]
    fn whole_turns_are_no_way_to_go() {
        let turn = core::f64::consts::TAU;
        let at = |ms, q| Waypoint { after_ns: ms * MS, q: joint(6, q), v: None };
        let found = front(&[at(1000, 0.1), at(2000, 0.2)], 0, &joint(6, 2.0 * turn), &guard());
        let found = found.expect("a plan");
        assert_eq!(found.interpolation, Interpolation::Linear);
        assert!((found.knots[1].positions[6] - 2.0 * turn - 0.1).abs() < 1e-12, "{found:?}");
        assert!((found.knots[2].positions[6] - 2.0 * turn - 0.2).abs() < 1e-12, "{found:?}");
    }

    /// A slow motion to one point, as a teach pendant has it.
    #[test]
    fn one_point_may_be_far_in_time_or_where_the_arm_is() {
        let found = front(&[point(90_000, 0.5, 0.0)], 0, &JointVector::ZERO, &guard());
        let found = found.expect("a plan");
        assert_eq!((found.knots[1].time_from_start_ns, found.later_ns), (90_000 * MS, 0));
        let found = front(&[point(0, 0.001, 0.0)], 0, &JointVector::ZERO, &guard());
        let found = found.expect("a plan");
        assert_eq!(found.knots.len(), 2);
        assert_eq!((found.knots[0].positions[0], found.knots[1].positions[0]), (0.0, 0.001));
    }

    /// With a jerk limit a cubic from rest begins with a step of the acceleration, which the executor
    /// bounds: so slowly that it is none.
    #[test]
    fn the_way_to_the_first_point_keeps_a_jerk_limit() {
        let mut guard = guard();
        guard.joints[0].limits.jerk = Some(500.0);
        let found = front(&[point(100, 0.1, 0.0)], 0, &JointVector::ZERO, &guard);
        let knots = found.expect("a plan").knots;
        let held = nullsweep_executor::Held {
            positions: [0.0; nullsweep_ipc_types::MAX_HELD_JOINTS],
            count: 0,
        };
        let rules = nullsweep_executor::Rules {
            guard,
            fingerprint: 1,
            held_continuous: Vec::new(),
            held_tolerance: Guard::HELD_TOLERANCE,
            since_ns: 1,
        };
        let mut header = nullsweep_ipc_types::PlanHeader {
            id: nullsweep_ipc_types::PlanId { epoch: 2, number: 1 },
            fingerprint: 1,
            joint_count: 7,
            knot_count: 2,
            interpolation: Interpolation::Cubic.wire(),
            ..Default::default()
        };
        // Joint 3's and 5's soft limits leave out 0.
        let home = JointVector::from_fn(|j| if j == 3 || j == 5 { -1.0 } else { 0.0 });
        let mut knots = knots;
        for knot in &mut knots {
            (knot.positions[3], knot.positions[5]) = (home[3], home[5]);
        }
        header.checksum = nullsweep_ipc_types::checksum(nullsweep_ipc_types::PlanMessage {
            header: &header,
            knots: &knots,
        });
        let admitted = nullsweep_executor::admit(&header, &knots, Some(&held), &rules, 3);
        let plan = admitted.expect("admitted");
        nullsweep_executor::starts_at(&plan, &home, &rules.guard).expect("starts");
    }

    #[test]
    fn what_cannot_be_gone_along_says_why() {
        let (guard, home) = (guard(), JointVector::ZERO);
        let judge = |points: &[Waypoint]| front(points, 0, &home, &guard).unwrap_err();
        assert_eq!(judge(&[]), FrontError::Past { points: 0 });
        assert_eq!(
            judge(&[point(5, 0.0, 0.0), point(5, 0.1, 0.0)]),
            FrontError::Order { point: 1 }
        );
        let bare = Waypoint { v: None, ..point(9, 0.1, 0.0) };
        assert_eq!(judge(&[point(5, 0.0, 0.0), bare]), FrontError::Mixed { point: 1 });
        assert_eq!(judge(&[point(5, f64::NAN, 0.0)]), FrontError::NotFinite { point: 0 });
        assert_eq!(judge(&[point(5, 900.0, 0.0)]), FrontError::Unreachable);
        let many: Vec<_> = (0..20_000).map(|k| point(k, 0.0, 0.0)).collect();
        assert_eq!(judge(&many), FrontError::Long { points: 20_000 });
    }
}
