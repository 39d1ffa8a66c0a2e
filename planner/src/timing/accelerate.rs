//! A plan with bang-bang velocity becomes one with limited acceleration.

use nalgebra::Point3;
use nullsweep_collision::ToolContact;
use nullsweep_robot::JointVector;
use rayon::prelude::*;

use super::sampled::{Timed, braked, timed_within};
use super::smooth::{cut, smooth};
use super::smooth_path::{Piece, SmoothPath};
use super::{Limits, jerk};
use crate::plan::{BLEND_TOLERANCE, Plan, PlanKnot, Profile};
use crate::sweep::distance_to_segment;
use crate::workcell::Workcell;

/// A blend is checked for collisions on chords that leave it by no more than this. \[rad\]
const CHORD: f64 = 2e-4;

/// The same path as `plan` (which must be of [`Profile::Velocity`]), its corners blended within
/// `BLEND_TOLERANCE` on the surface and clear of collision everywhere, as fast as the limits
/// allow. In the corners at the knots `stops`, and where no blend fits, the arm comes to rest.
#[must_use]
pub fn accelerate(plan: &Plan, cell: Workcell<'_>, limits: &Limits, stops: &[usize]) -> Plan {
    paced(plan, cell, limits, &Pace { stops, ..Pace::default() })
}

/// What a plan keeps to besides velocity and acceleration.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pace<'a> {
    /// Knots at whose corners the arm comes to rest.
    pub stops: &'a [usize],
    /// The greatest jerk of each joint. \[rad/s³\] or \[m/s³\]
    pub jerk: Option<JointVector>,
    /// The greatest speed of the pad's centre on the surface. \[m/s\]
    pub tool_speed: Option<f64>,
}

/// As [`accelerate`], within a limit of jerk and a tool speed, where there are any.
#[must_use]
pub fn paced(plan: &Plan, cell: Workcell<'_>, limits: &Limits, pace: &Pace<'_>) -> Plan {
    let points: Vec<JointVector> = plan.knots.iter().map(|k| k.q).collect();
    let judge = Judge { plan, cell };
    let runs = smooth(&points, &|i, halves| !pace.stops.contains(&i) && judge.fits(i, halves));
    let pad = cell.tool.on(cell.arm);
    let cap = |source: f64, q: &JointVector, v: &JointVector| {
        let Some(speed) = pace.tool_speed else { return f64::INFINITY };
        let touches = [source.floor() as usize + 1, (source.ceil() as usize).max(1)];
        if !touches.into_iter().any(|knot| plan.on_surface(knot)) {
            return f64::INFINITY;
        }
        let moved = JointVector::from_fn(|j| q[j] + MOMENT * v[j]);
        WITHIN * speed * MOMENT / (pad.centre(&moved) - pad.centre(q)).norm().max(1e-15)
    };
    let timed = match pace.jerk {
        None => timed_within(&runs, limits, &cap),
        Some(jerk) => {
            let one = |run: &SmoothPath| {
                let free = timed_within(std::slice::from_ref(run), limits, &cap);
                jerk::limited(&free, limits, &jerk, &cap)
            };
            let mut all: Vec<Timed> = Vec::new();
            for run in runs.par_iter().map(one).collect::<Vec<_>>() {
                let from = all.last().map_or(0, |last| last.time_ns);
                let again = usize::from(!all.is_empty());
                let late = |t: Timed| Timed { time_ns: t.time_ns + from, ..t };
                all.extend(run.into_iter().skip(again).map(late));
            }
            all
        }
    };
    let knots = timed.iter().map(|t| knot(&plan.knots, t)).collect();
    let profile = if pace.jerk.is_some() { Profile::Jerk } else { Profile::Acceleration };
    Plan { profile, jerk: pace.jerk, knots, ..plan.clone() }
}

/// A moment over which the pad's speed is looked at. \[s\]
const MOMENT: f64 = 1e-6;
/// What is planned of a tool speed, so that it is not exceeded between two looks.
const WITHIN: f64 = 0.997;

/// The way to rest from a knot of a plan with limited acceleration, along its own path.
#[derive(Clone, Debug, PartialEq)]
pub struct Rest {
    /// From the knot, at time 0, to where the arm stands.
    pub knots: Vec<PlanKnot>,
    /// The knot of the plan where that is.
    pub at: usize,
}

impl Rest {
    /// Brakes on the plan's path from its knot on. While the plan itself leaves no reserve for
    /// braking, it is followed exactly. `None` if the plan has no such knot, or cannot be gone
    /// through ([`Plan::check_bounds`]).
    #[must_use]
    pub fn after(plan: &Plan, knot: usize, limits: &Limits) -> Option<Self> {
        plan.check_bounds().ok()?;
        let knots = plan.knots.get(knot..)?;
        let first = knots.first()?;
        let stands = |k: &PlanKnot| k.v == JointVector::default();
        let early = |k: &PlanKnot| PlanKnot { time_ns: k.time_ns - first.time_ns, ..*k };
        for m in 0..knots.len() {
            let followed = || knots[..=m].iter().map(early);
            if stands(&knots[m]) {
                return Some(Self { knots: followed().collect(), at: knot + m });
            }
            let natural = (m..knots.len()).find(|&k| stands(&knots[k])).unwrap_or(knots.len() - 1);
            let mut more = 1;
            while m + more <= natural {
                let ahead = &knots[m..=m + more];
                if let Some(brake) = braked(&along(ahead), limits, RESERVE) {
                    let start = knots[m].time_ns - first.time_ns;
                    let braking = brake[1..].iter().map(|t| {
                        let own = self::knot(ahead, t);
                        PlanKnot { time_ns: own.time_ns + start, ..own }
                    });
                    let motion = followed().chain(braking).collect();
                    return Some(Self { knots: motion, at: knot + m + more });
                }
                more = (more + 1).max(more * 5 / 4);
            }
        }
        None
    }

    /// Puts this motion before a plan that starts where it ends.
    #[must_use]
    pub fn then(&self, plan: Plan) -> Plan {
        let start = self.knots.last().map_or(0, |k| k.time_ns);
        let rest = plan.knots.iter().skip(1);
        let late = |k: &PlanKnot| k.time_ns.saturating_add(start);
        let later = rest.map(|k| PlanKnot { time_ns: late(k), ..*k });
        let knots = self.knots.iter().copied().chain(later).collect();
        Plan { knots, ..plan }
    }
}

/// Share of the limits that a braking may use.
const RESERVE: f64 = 0.95;

/// The path of a plan's cubics with their time as parameter: two quadratics for each, which meet
/// them in position and velocity at both ends and stay within their accelerations.
fn along(knots: &[PlanKnot]) -> SmoothPath {
    let mut run = SmoothPath::default();
    for (i, pair) in knots.windows(2).enumerate() {
        let (a, b) = (&pair[0], &pair[1]);
        let seconds = (b.time_ns - a.time_ns) as f64 * 1e-9;
        let at = i as f64;
        // From (A + B) h/2 = Δv and (3A + B) h²/8 = Δq − v h.
        let bend = |j: usize| {
            let change = (b.v[j] - a.v[j]) / seconds;
            let mean = (b.q[j] - a.q[j] - a.v[j] * seconds) / (seconds * seconds);
            (4.0 * mean - change, 3.0 * change - 4.0 * mean)
        };
        let half = 0.5 * seconds;
        let first = Piece {
            length: half,
            start: a.q,
            slope: a.v,
            bend: JointVector::from_fn(|j| bend(j).0),
            source: [at, at + 0.5],
        };
        let second = Piece {
            length: half,
            start: first.at(half),
            slope: first.slope_at(half),
            bend: JointVector::from_fn(|j| bend(j).1),
            source: [at + 0.5, at + 1.0],
        };
        run.pieces.extend([first, second]);
    }
    run
}

/// A moment as a knot, with what the points that its path was made from say of it.
fn knot(points: &[PlanKnot], moment: &Timed) -> PlanKnot {
    let share = moment.source.fract();
    let before = &points[(moment.source as usize).min(points.len() - 1)];
    let own = PlanKnot { time_ns: moment.time_ns, q: moment.q, v: moment.v, ..*before };
    if share == 0.0 {
        return own;
    }
    let line = match (before.line, points.get(moment.source as usize + 1).and_then(|k| k.line)) {
        (Some(a), Some(b)) => Some(std::array::from_fn(|i| a[i] + share * (b[i] - a[i]))),
        _ => None,
    };
    PlanKnot { line, patch: None, ..own }
}

/// Whether a blend may be.
struct Judge<'a> {
    plan: &'a Plan,
    cell: Workcell<'a>,
}

impl Judge<'_> {
    fn fits(&self, i: usize, halves: &[Piece; 2]) -> bool {
        self.is_on_line(i, halves) && self.is_free(i, halves)
    }

    /// The pad's centre near the planned line, where there is one.
    fn is_on_line(&self, i: usize, halves: &[Piece; 2]) -> bool {
        let Some(corner) = self.plan.line(i) else { return true };
        let pad = self.cell.tool.on(self.cell.arm);
        let near = |q: &JointVector, other: Option<Point3<f64>>| {
            let end = other.unwrap_or(corner);
            distance_to_segment(&pad.centre(q), &corner, &end) <= BLEND_TOLERANCE
        };
        let (before, after) = (
            self.plan.line(i - 1).filter(|_| self.plan.on_surface(i)),
            self.plan.line(i + 1).filter(|_| self.plan.on_surface(i + 1)),
        );
        let middle = halves[1].start;
        let looks = [0.25, 0.5, 0.75];
        let ok = |half: &Piece, line: Option<Point3<f64>>| {
            line.is_none() || looks.iter().all(|share| near(&half.at(share * half.length), line))
        };
        (near(&middle, before) || near(&middle, after))
            && ok(&halves[0], before)
            && ok(&halves[1], after)
    }

    /// No collision on the blend's chords. Where the pad is on the surface on either side, or is
    /// being lifted off it, it may touch.
    fn is_free(&self, i: usize, halves: &[Piece; 2]) -> bool {
        let on_surface = self.plan.on_surface(i) || self.plan.on_surface(i + 1);
        let parts = (cut(halves, &self.plan.knots[i].q) / (4.0 * CHORD)).sqrt().ceil().max(1.0);
        let chords = |half: &Piece| -> Vec<JointVector> {
            (0..=parts as usize).map(|k| half.at(half.length * k as f64 / parts)).collect()
        };
        let free = |contact: ToolContact| {
            halves.iter().all(|half| {
                let points = chords(half);
                points.windows(2).all(|w| self.cell.world.motion_free(&w[0], &w[1], contact))
            })
        };
        if on_surface {
            return free(ToolContact::Allowed);
        }
        let knots = &self.plan.knots;
        let lifts = || {
            [(i - 1, i), (i, i + 1)].into_iter().any(|(a, b)| {
                let (a, b) = (&knots[a].q, &knots[b].q);
                !self.cell.world.motion_free(a, b, ToolContact::Forbidden)
            })
        };
        free(ToolContact::Forbidden) || (lifts() && free(ToolContact::Allowed))
    }
}

#[cfg(test)]
mod tests {
    use nullsweep_robot::{ArmSpec, Robot, Side, Tool};

    use super::*;

    /// A plan whose times fall, or go on for ever, leads to no rest, wherever one asks.
    #[test]
    fn no_rest_after_times_that_do_not_rise() {
        let robot = Robot::pr2();
        let arm = robot.arm(&ArmSpec::pr2(Side::Right)).expect("an arm");
        let moving = |time_ns, q: f64, v: f64| PlanKnot {
            time_ns,
            q: JointVector::from_fn(|j| if j < 7 { q } else { 0.0 }),
            v: JointVector::from_fn(|j| if j < 7 { v } else { 0.0 }),
            line: None,
            patch: None,
        };
        let rest = |times: [u64; 3]| {
            let [a, b, c] = times;
            let knots = vec![moving(a, 0.0, 0.1), moving(b, 0.1, 0.1), moving(c, 0.15, 0.0)];
            let plan = Plan::of(&robot, &arm, &Tool::default(), knots);
            let plan = Plan { profile: Profile::Acceleration, ..plan };
            (0..4).map(|k| Rest::after(&plan, k, &Limits::of(&arm, None))).collect::<Vec<_>>()
        };
        let sound = rest([0, 1_000_000_000, 2_000_000_000]);
        assert!(sound[..3].iter().all(Option::is_some) && sound[3].is_none());
        for times in [[9, 5, 1], [0, 2, 2], [u64::MAX, 0, 5], [0, 5, u64::MAX]] {
            assert_eq!(rest(times), [None, None, None, None], "{times:?}");
        }
    }
}
