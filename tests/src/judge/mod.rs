//! Judges a stream of setpoints as the hardware endpoint receives it.
//!
//! The judge shares no state with the executor and trusts nothing that it says: every rule is
//! recomputed from the robot's own limits. What the *reader* lost, because it was too slow to
//! empty its buffer, is counted apart from what the *sender* left out.

mod verdict;

use nullsweep_ipc_types::{Mode, PlanId, Setpoint, service};
use nullsweep_robot::{Arm, Continuous, JointVector};

pub use verdict::{Kind, PlanRun, Verdict, Violation};

/// What the judge allows.
#[derive(Clone, Debug)]
pub struct Rules {
    /// Period that one sequence number stands for. \[ns\]
    pub period_ns: u64,
    /// How far an executor's first setpoint, and the first one after a fault, may be from the
    /// measured position. \[rad\] or \[m\]
    pub start_tolerance: f64,
    /// How soon an executor that ran before this endpoint must have heard where the arm is: then
    /// its setpoints are within the same tolerance, or it says that it waits for a reset. \[ns\]
    pub meet_within_ns: u64,
    /// Silence after a deadline that ends a session. \[ns\]
    pub session_timeout_ns: u64,
    /// Samples that the reader's buffer holds: a pass that takes out this many may have lost some.
    pub buffer: usize,
    /// What times in whole nanoseconds may cost: the share by which a speed may exceed its limit,
    /// and how far a position may be outside. \[rad\] or \[m\]
    pub rounding: f64,
    /// How many violations are kept in full; the others are only counted.
    pub kept: usize,
}

impl Default for Rules {
    fn default() -> Self {
        Self {
            period_ns: 1_000_000,
            start_tolerance: 0.02,
            meet_within_ns: 100_000_000,
            session_timeout_ns: 20_000_000,
            buffer: service::SETPOINT.buffer,
            rounding: 1e-6,
            kept: 10,
        }
    }
}

/// The judge: fed with what each reading pass took out of the buffer.
#[derive(Clone)]
pub struct Judge {
    arm: Arm,
    rules: Rules,
    last: Option<Last>,
    /// Since when an executor that ran before this endpoint has not been seen near the arm. \[ns\]
    unmet_since_ns: Option<u64>,
    verdict: Verdict,
}

#[derive(Clone, Debug)]
struct Last {
    /// The last setpoint that could be judged.
    sequence: u64,
    /// The last setpoint of any kind.
    seen: u64,
    stamp_ns: u64,
    deadline_ns: u64,
    positions: JointVector,
    /// Velocities by differences; zero for the first setpoint of a session.
    rates: JointVector,
    mode: Option<Mode>,
    plan: PlanId,
}

impl Judge {
    /// A judge that knows the arm's limits.
    #[must_use]
    pub fn new(arm: &Arm, rules: Rules) -> Self {
        let verdict = Verdict {
            setpoints: 0,
            sessions: 0,
            violations: Kind::ALL.iter().map(|&k| (k, 0)).collect(),
            first: Vec::new(),
            lost_by_reader: 0,
            late: 0,
            worst_lateness_ns: 0,
            largest_step_ratio: 0.0,
            least_margin: f64::INFINITY,
            plans: Vec::new(),
        };
        Self { arm: arm.clone(), rules, last: None, unmet_since_ns: None, verdict }
    }

    /// What was found so far.
    #[must_use]
    pub fn verdict(&self) -> &Verdict {
        &self.verdict
    }

    /// Judges all setpoints of one reading pass, oldest first. `measured` is what the endpoint last
    /// reported before it.
    pub fn observe(&mut self, pass: &[Setpoint], measured: &JointVector) {
        // With a buffer that overwrites its oldest sample, only a pass that found it full can have
        // lost any, and then in front of what it took.
        let mut may_have_lost = pass.len() >= self.rules.buffer;
        for setpoint in pass {
            self.one(setpoint, measured, may_have_lost);
            may_have_lost &= pass.len() > self.rules.buffer;
        }
    }

    fn one(&mut self, s: &Setpoint, measured: &JointVector, may_have_lost: bool) {
        self.verdict.setpoints += 1;
        let mode = Mode::from_wire(s.mode);
        let dof = self.arm.dof();
        if s.joint_count as usize != dof || mode.is_none() {
            let (value, bound) = if mode.is_none() {
                (f64::from(s.mode), Mode::ALL.len() as f64)
            } else {
                (f64::from(s.joint_count), dof as f64)
            };
            // Without a joint count the numbers mean nothing, so nothing else is judged.
            self.pass_over(s);
            return self.violate(Kind::Malformed, s, None, value, bound);
        }
        let (mut positions, mut feed_forward) = (JointVector::default(), JointVector::default());
        positions[..dof].copy_from_slice(&s.positions[..dof]);
        feed_forward[..dof].copy_from_slice(&s.velocities[..dof]);
        if let Some(j) = (0..dof).find(|&j| !(positions[j] + feed_forward[j]).is_finite()) {
            self.pass_over(s);
            return self.violate(Kind::NotFinite, s, Some(j), f64::NAN, f64::INFINITY);
        }

        let Some(last) = self.continued(s) else {
            self.verdict.sessions += 1;
            self.verdict.plans.push(PlanRun::new(s));
            if s.sequence == 1 {
                self.check_start(s, &positions, measured);
            } else {
                self.unmet_since_ns = Some(s.stamp_ns);
            }
            self.check_limits(s, &positions, &JointVector::default(), &feed_forward, measured);
            return self.keep(s, mode, positions, JointVector::default());
        };
        if s.sequence <= last.seen {
            let (value, bound) = (s.sequence as f64, last.seen as f64 + 1.0);
            return self.violate(Kind::Reordered, s, None, value, bound);
        }
        if s.stamp_ns < last.stamp_ns {
            let (value, bound) = (s.stamp_ns as f64 * 1e-9, last.stamp_ns as f64 * 1e-9);
            self.violate(Kind::Reordered, s, None, value, bound);
        }
        let missing = s.sequence - last.seen - 1;
        if missing > 0 {
            if may_have_lost {
                self.verdict.lost_by_reader += missing;
            } else {
                self.violate(Kind::Gap, s, None, missing as f64, 0.0);
            }
        }
        let lateness = s.stamp_ns.saturating_sub(last.deadline_ns);
        self.verdict.worst_lateness_ns = self.verdict.worst_lateness_ns.max(lateness);
        self.verdict.late += u64::from(lateness > self.rules.period_ns);

        let elapsed = (s.sequence - last.sequence) as f64 * self.rules.period_ns as f64 * 1e-9;
        let rates: JointVector =
            JointVector::from_fn(|j| (positions[j] - last.positions[j]) / elapsed);
        // When the executor leaves a fault, it begins again from where the arm was measured, and
        // gets there without a jump.
        let idle = mode.is_some_and(is_idle);
        let leaves = last.mode.is_some_and(is_idle) && !idle;
        if let Some(since_ns) = self.unmet_since_ns {
            let met = self.worst_start(&positions, measured).is_none();
            let late = !idle && s.stamp_ns > since_ns + self.rules.meet_within_ns;
            if met || leaves || late {
                self.unmet_since_ns = None;
            }
            if late && !leaves {
                self.check_start(s, &positions, measured);
            }
        }
        if leaves {
            self.check_start(s, &positions, measured);
        }
        let ratio = self.check_steps(s, &rates, elapsed);
        self.check_limits(s, &positions, &rates, &feed_forward, measured);
        self.follow_plan(s, &last, &rates, ratio);
        self.keep(s, mode, positions, rates);
    }

    /// The last setpoint, if this one belongs to the same session.
    fn continued(&self, s: &Setpoint) -> Option<Last> {
        let last = self.last.clone()?;
        let silent = s.stamp_ns > last.deadline_ns.saturating_add(self.rules.session_timeout_ns);
        // The first setpoint of all: an executor may be back sooner than a silence is noticed.
        let first = s.sequence == 1 && s.stamp_ns > last.stamp_ns;
        if s.sequence <= last.seen && (silent || first) { None } else { Some(last) }
    }

    fn check_start(&mut self, s: &Setpoint, positions: &JointVector, measured: &JointVector) {
        if let Some((j, off)) = self.worst_start(positions, measured) {
            self.violate(Kind::Jump, s, Some(j), off, self.rules.start_tolerance);
        }
    }

    /// The joint that is farthest from where it is measured, if that is too far to begin.
    fn worst_start(&self, q: &JointVector, measured: &JointVector) -> Option<(usize, f64)> {
        let apart = Continuous::of(self.arm.limits()).displacement(q, measured);
        (0..self.arm.dof())
            .map(|j| (j, apart[j]))
            .filter(|(_, off)| *off > self.rules.start_tolerance)
            .max_by(|a, b| a.1.total_cmp(&b.1))
    }

    fn check_steps(&mut self, s: &Setpoint, rates: &JointVector, elapsed: f64) -> f64 {
        let mut largest = 0.0f64;
        for j in 0..self.arm.dof() {
            let limit = self.arm.limits()[j].velocity;
            let ratio = rates[j].abs() / limit;
            largest = largest.max(ratio);
            if ratio > 1.0 + self.rules.rounding {
                let (value, bound) = (rates[j].abs() * elapsed, limit * elapsed);
                self.violate(Kind::Step, s, Some(j), value, bound);
            }
        }
        self.verdict.largest_step_ratio = self.verdict.largest_step_ratio.max(largest);
        largest
    }

    fn check_limits(
        &mut self,
        s: &Setpoint,
        positions: &JointVector,
        rates: &JointVector,
        feed_forward: &JointVector,
        measured: &JointVector,
    ) {
        let idle = Mode::from_wire(s.mode).is_some_and(is_idle);
        for j in 0..self.arm.dof() {
            let limit = self.arm.limits()[j].velocity;
            if feed_forward[j].abs() > limit * (1.0 + self.rules.rounding) {
                self.violate(Kind::Velocity, s, Some(j), feed_forward[j].abs(), limit);
            }
            let (lower, upper) = if idle {
                // Where nothing is executed the setpoint follows the arm, which somebody may have
                // pushed out of its limits.
                let (lower, upper) = self.arm.braking_limits(j, 0.0);
                (lower.min(measured[j]), upper.max(measured[j]))
            } else {
                self.arm.braking_limits(j, rates[j])
            };
            let margin = (positions[j] - lower).min(upper - positions[j]);
            self.verdict.least_margin = self.verdict.least_margin.min(margin);
            if margin < -self.rules.rounding {
                let bound = if positions[j] < lower { lower } else { upper };
                self.violate(Kind::SoftLimit, s, Some(j), positions[j], bound);
            }
        }
    }

    fn follow_plan(&mut self, s: &Setpoint, last: &Last, rates: &JointVector, ratio: f64) {
        if s.plan == last.plan
            && let Some(run) = self.verdict.plans.last_mut()
        {
            run.last_sequence = s.sequence;
            return;
        }
        let step = |j: usize| (rates[j] - last.rates[j]).abs();
        self.verdict.plans.push(PlanRun {
            join_velocity_step: (0..self.arm.dof()).map(step).fold(0.0, f64::max),
            join_step_ratio: ratio,
            ..PlanRun::new(s)
        });
    }

    fn keep(&mut self, s: &Setpoint, mode: Option<Mode>, positions: JointVector, r: JointVector) {
        self.last = Some(Last {
            sequence: s.sequence,
            seen: s.sequence,
            stamp_ns: s.stamp_ns,
            deadline_ns: s.deadline_ns,
            positions,
            rates: r,
            mode,
            plan: s.plan,
        });
    }

    /// A setpoint that cannot be judged is no gap, and the next one is judged against the last
    /// sound one.
    fn pass_over(&mut self, s: &Setpoint) {
        if let Some(last) = &mut self.last {
            last.seen = last.seen.max(s.sequence);
        }
    }

    fn violate(&mut self, kind: Kind, s: &Setpoint, joint: Option<usize>, value: f64, bound: f64) {
        *self.verdict.violations.entry(kind).or_default() += 1;
        if self.verdict.first.len() >= self.rules.kept {
            return;
        }
        self.verdict.first.push(Violation {
            kind,
            sequence: s.sequence,
            mode: Mode::from_wire(s.mode).map_or("unknown mode", Mode::text),
            plan: s.plan.to_string(),
            knot: s.knot,
            joint: joint.map(|j| self.arm.joint_names()[j].clone()),
            value,
            bound,
        });
    }
}

/// Whether the executor executes nothing and follows where the arm is.
fn is_idle(mode: Mode) -> bool {
    matches!(mode, Mode::Init | Mode::Fault)
}

#[cfg(test)]
mod tests;
