//! A plan over steps of one clock: where it may wait, what its joints do in each step, and the plan with
//! waits put in.

use nullsweep_robot::JointVector;

use crate::plan::{Plan, PlanKnot, Profile};

/// What counts as rest: a velocity, and for a plan of limited jerk an acceleration. \[rad/s\], \[rad/s²\]
const REST: f64 = 1e-6;
/// A wait of a bang-bang plan that is asked for so near to a knot is made in the knot. \[ns\]
const SNAP_NS: u64 = 10_000;

/// A plan with the nodes, a step from each other, in which it may wait.
#[derive(Clone, Debug)]
pub(super) struct Clocked {
    pub(super) plan: Plan,
    pub(super) step_ns: u64,
    /// For each node, one more than steps.
    pub(super) may_wait: Vec<bool>,
    /// How far from its node a wait is made at most: where only rests will do, in the nearest one. \[ns\]
    near_ns: u64,
}

/// A wait: at which time of the plan, and how long. \[ns\]
pub(super) type Wait = (u64, u64);

/// A box in joint space: its middle, and how far from there it reaches. \[rad\] or \[m\]
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hull {
    low: JointVector,
    high: JointVector,
}

impl Clocked {
    pub(super) fn new(plan: &Plan, step_ns: u64) -> Self {
        let end_ns = plan.knots.last().map_or(0, |knot| knot.time_ns);
        let steps = end_ns.div_ceil(step_ns) as usize;
        let is_curved = plan.profile.is_curved();
        let mut may_wait: Vec<bool> = (0..=steps)
            .map(|node| !is_curved && (plan.tool.touches() || is_off(plan, node as u64 * step_ns)))
            .collect();
        let mut near_ns = SNAP_NS;
        for rest_ns in rests(plan).filter(|_| is_curved) {
            let node = nearest(rest_ns, step_ns);
            may_wait[node] = true;
            near_ns = near_ns.max(rest_ns.abs_diff((node as u64 * step_ns).min(end_ns)));
        }
        // Before it begins and after its end an arm is at rest.
        may_wait[0] = true;
        may_wait[steps] = true;
        Self { plan: plan.clone(), step_ns, may_wait, near_ns }
    }

    pub(super) fn steps(&self) -> usize {
        self.may_wait.len() - 1
    }

    /// A box about all joint vectors of the plan between two times, and as much before and after as a wait
    /// may be moved. \[ns\]
    pub(super) fn hull(&self, from_ns: u64, to_ns: u64) -> Hull {
        let knots = &self.plan.knots;
        let end_ns = knots.last().map_or(0, |knot| knot.time_ns);
        let near_ns = self.near_ns;
        let (from, to) = (from_ns.saturating_sub(near_ns), (to_ns + near_ns).min(end_ns));
        let from = from.min(to);
        let first = knots.partition_point(|knot| knot.time_ns <= from).clamp(1, knots.len() - 1);
        let mut hull: Option<Hull> = None;
        for k in first..knots.len() {
            let (begin, end) = (knots[k - 1].time_ns, knots[k].time_ns);
            if k > first && begin > to {
                break;
            }
            let curve = self.plan.curve(k);
            let share = |ns: u64| ns.clamp(begin, end).saturating_sub(begin) as f64 * 1e-9;
            let [a, b] = [share(from), share(to)];
            let ends = [a, b].map(|seconds| curve.at(seconds / curve.seconds()));
            // No farther from its chord than this.
            let bulge = |j: usize| curve.top_acceleration(j) * (b - a).powi(2) / 8.0;
            let low = JointVector::from_fn(|j| ends[0][j].min(ends[1][j]) - bulge(j));
            let high = JointVector::from_fn(|j| ends[0][j].max(ends[1][j]) + bulge(j));
            let this = Hull { low, high };
            hull = Some(hull.map_or(this, |hull| hull.with(&this)));
        }
        hull.unwrap_or_else(|| Hull { low: knots[0].q, high: knots[0].q })
    }

    /// The plan with waits, ascending in time.
    pub(super) fn with_waits(&self, waits: &[Wait]) -> Plan {
        let plan = &self.plan;
        let mut waits = self.placed(waits).into_iter().peekable();
        let (mut knots, mut late): (Vec<PlanKnot>, u64) = (Vec::new(), 0);
        for (k, knot) in plan.knots.iter().enumerate() {
            let at = |knot: PlanKnot, late: u64| PlanKnot { time_ns: knot.time_ns + late, ..knot };
            let before_ns = k.checked_sub(1).map(|before| plan.knots[before].time_ns);
            while let Some((time_ns, wait_ns)) =
                waits.next_if(|(time_ns, _)| time_ns + SNAP_NS < knot.time_ns)
            {
                if before_ns.is_some_and(|before| time_ns > before + SNAP_NS) {
                    knots.push(at(self.cut(k, time_ns), late));
                }
                hold(&mut knots, wait_ns);
                late += wait_ns;
            }
            knots.push(at(*knot, late));
        }
        for (_, wait_ns) in waits {
            hold(&mut knots, wait_ns);
        }
        Plan { knots, ..plan.clone() }
    }

    /// The waits where they can be made: in the last rest nearest to each node, where only rests will do.
    fn placed(&self, waits: &[Wait]) -> Vec<Wait> {
        let plan = &self.plan;
        if !plan.profile.is_curved() {
            return waits.to_vec();
        }
        let rest = |node: usize| {
            rests(plan).filter(|&rest_ns| nearest(rest_ns, self.step_ns) == node).last()
        };
        let place = |&(time_ns, wait_ns): &Wait| {
            let node = nearest(time_ns, self.step_ns);
            (rest(node).unwrap_or(time_ns), wait_ns)
        };
        waits.iter().map(place).collect()
    }

    /// A knot inside the segment that ends in knot `k`.
    fn cut(&self, k: usize, time_ns: u64) -> PlanKnot {
        let plan = &self.plan;
        let (before, curve) = (&plan.knots[k - 1], plan.curve(k));
        let share = (time_ns - before.time_ns) as f64 * 1e-9 / curve.seconds();
        let line = before.line.zip(plan.knots[k].line);
        PlanKnot {
            time_ns,
            line: line.map(|(a, b)| [0, 1, 2].map(|i| a[i] + share * (b[i] - a[i]))),
            ..PlanKnot::free(curve.at(share))
        }
    }
}

/// Stays in the last knot.
fn hold(knots: &mut Vec<PlanKnot>, wait_ns: u64) {
    if let Some(last) = knots.last().copied() {
        let time_ns = last.time_ns + wait_ns;
        knots.push(PlanKnot { time_ns, line: last.line, ..PlanKnot::free(last.q) });
    }
}

impl Hull {
    pub(super) fn with(&self, other: &Self) -> Self {
        Self {
            low: JointVector::from_fn(|j| self.low[j].min(other.low[j])),
            high: JointVector::from_fn(|j| self.high[j].max(other.high[j])),
        }
    }

    pub(super) fn middle(&self) -> JointVector {
        self.low.lerp(&self.high, 0.5)
    }

    pub(super) fn travel(&self) -> JointVector {
        let middle = self.middle();
        JointVector::from_fn(|j| (self.high[j] - middle[j]).max(middle[j] - self.low[j]))
    }
}

/// The node nearest to a time.
fn nearest(time_ns: u64, step_ns: u64) -> usize {
    ((time_ns + step_ns / 2) / step_ns) as usize
}

/// Whether the tool is off the surface at a time, and a little before and after.
fn is_off(plan: &Plan, time_ns: u64) -> bool {
    let last = plan.knots.len() - 1;
    let at = |ns: u64| plan.knots.partition_point(|knot| knot.time_ns < ns).min(last);
    (at(time_ns.saturating_sub(SNAP_NS))..=at(time_ns + SNAP_NS)).all(|k| !plan.on_surface(k))
}

/// The times in which an arm with limited acceleration may stay. \[ns\]
fn rests(plan: &Plan) -> impl Iterator<Item = u64> {
    let rests = (0..plan.knots.len()).filter(|&k| is_rest(plan, k));
    let free = rests.filter(|&k| plan.tool.touches() || plan.knots[k].line.is_none());
    free.map(|k| plan.knots[k].time_ns)
}

/// Whether the arm may stay in a knot for any time.
fn is_rest(plan: &Plan, k: usize) -> bool {
    let slow = |v: &JointVector| v.iter().all(|v| v.abs() <= REST);
    let into = k > 0 && !slow(&plan.curve(k).acceleration(1.0));
    let out = k + 1 < plan.knots.len() && !slow(&plan.curve(k + 1).acceleration(0.0));
    let is_even = plan.profile != Profile::Jerk || !(into || out);
    plan.knots[k].v == JointVector::ZERO && is_even
}
