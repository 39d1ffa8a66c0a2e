//! Judges a stream of setpoints as the hardware endpoint receives it.
//!
//! The judge shares no state with the executor and trusts nothing that it says: every rule is
//! recomputed from the robot's own limits. What the *reader* lost, because it was too slow to
//! empty its buffer, is counted apart from what the *sender* left out.

use std::collections::BTreeMap;
use std::fmt;

use nullsweep_ipc_types::{Mode, PlanId, Setpoint, service};
use nullsweep_robot::{Arm, JointVector};
use serde::Serialize;

/// What the judge allows.
#[derive(Clone, Debug)]
pub struct Rules {
    /// Period that one sequence number stands for. \[ns\]
    pub period_ns: u64,
    /// How far the first setpoint of a session may be from the measured position. \[rad\] or \[m\]
    pub start_tolerance: f64,
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
            session_timeout_ns: 20_000_000,
            buffer: service::SETPOINT.buffer,
            rounding: 1e-6,
            kept: 10,
        }
    }
}

/// How a setpoint can be wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Another joint count than the arm's, or a mode that does not exist.
    Malformed,
    /// A position or velocity is NaN or infinite.
    NotFinite,
    /// Outside the soft limits, moved in by the way that braking takes at the present speed.
    SoftLimit,
    /// Further from the last setpoint than v·T·Δsequence.
    Step,
    /// The feed-forward velocity exceeds the joint's limit.
    Velocity,
    /// The first setpoint of a session, or after a fault, is not where the arm was measured.
    Jump,
    /// The sender skipped sequence numbers.
    Gap,
    /// A sequence number or stamp that does not rise.
    Reordered,
}

impl Kind {
    /// Every kind, in the order of the table.
    pub const ALL: [Self; 8] = [
        Self::Malformed,
        Self::NotFinite,
        Self::SoftLimit,
        Self::Step,
        Self::Velocity,
        Self::Jump,
        Self::Gap,
        Self::Reordered,
    ];

    /// A few words for people.
    #[must_use]
    pub fn text(self) -> &'static str {
        match self {
            Self::Malformed => "malformed",
            Self::NotFinite => "not finite",
            Self::SoftLimit => "outside the soft limits",
            Self::Step => "step above v·T",
            Self::Velocity => "velocity above its limit",
            Self::Jump => "start away from the arm",
            Self::Gap => "gap by the sender",
            Self::Reordered => "out of order",
        }
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.text())
    }
}

/// One violation in full.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Violation {
    /// What is wrong.
    pub kind: Kind,
    /// The setpoint's sequence number.
    pub sequence: u64,
    /// The executor's mode when it was sent, as text.
    pub mode: &'static str,
    /// The plan that was executed, `0/0` for none.
    pub plan: String,
    /// The knot whose segment was executed.
    pub knot: u32,
    /// Name of the joint, where one joint is at fault.
    pub joint: Option<String>,
    /// The offending value, in the unit of what it is compared with.
    pub value: f64,
    /// The bound that it broke.
    pub bound: f64,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "setpoint {}: {}", self.sequence, self.kind)?;
        if let Some(joint) = &self.joint {
            write!(f, ", {joint}")?;
        }
        write!(f, ", {:.6} against {:.6}", self.value, self.bound)?;
        write!(f, " ({}, plan {}, knot {})", self.mode, self.plan, self.knot)
    }
}

/// A run of setpoints of one plan.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlanRun {
    /// The plan, `0/0` while none was executed.
    pub plan: String,
    /// Sequence number of its first setpoint.
    pub first_sequence: u64,
    /// Sequence number of its last setpoint.
    pub last_sequence: u64,
    /// Largest change of a joint's velocity from the setpoint before the first one to it.
    /// \[rad/s\] or \[m/s\]
    pub join_velocity_step: f64,
    /// Largest step of a joint from the setpoint before the first one, as a share of v·T.
    pub join_step_ratio: f64,
}

/// What the judge found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// Setpoints that were read.
    pub setpoints: u64,
    /// Streams without a break: an executor that restarts opens another one.
    pub sessions: u64,
    /// Violations of each kind, also those that are zero.
    pub violations: BTreeMap<Kind, u64>,
    /// The first violations in full.
    pub first: Vec<Violation>,
    /// Setpoints that this reader lost because it was slower than its buffer is long.
    pub lost_by_reader: u64,
    /// Setpoints that were made more than one period after they were due.
    pub late: u64,
    /// The largest such lateness. \[ns\]
    pub worst_lateness_ns: u64,
    /// The largest step of any joint, as a share of v·T·Δsequence.
    pub largest_step_ratio: f64,
    /// The least distance of any setpoint from a soft limit moved in by its braking way; negative
    /// outside, infinite where no joint has limits. \[rad\] or \[m\]
    pub least_margin: f64,
    /// The plans in the order in which they were executed.
    pub plans: Vec<PlanRun>,
}

impl Verdict {
    /// How many violations there were in all.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.violations.values().sum()
    }

    /// Whether setpoints came and none of them was wrong.
    #[must_use]
    pub fn is_clean(&self) -> bool {
        self.setpoints > 0 && self.total() == 0
    }
}

/// The judge: fed with what each reading pass took out of the buffer.
#[derive(Clone)]
pub struct Judge {
    arm: Arm,
    rules: Rules,
    last: Option<Last>,
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
        Self { arm: arm.clone(), rules, last: None, verdict }
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
            self.check_start(s, &positions, measured);
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
            std::array::from_fn(|j| (positions[j] - last.positions[j]) / elapsed);
        // When the executor leaves a fault, it begins again from where the arm was measured, and
        // gets there without a jump.
        if last.mode.is_some_and(is_idle) && !mode.is_some_and(is_idle) {
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
        if s.sequence <= last.seen && silent { None } else { Some(last) }
    }

    fn check_start(&mut self, s: &Setpoint, positions: &JointVector, measured: &JointVector) {
        for j in 0..self.arm.dof() {
            let off = (positions[j] - measured[j]).abs();
            if off > self.rules.start_tolerance {
                self.violate(Kind::Jump, s, Some(j), off, self.rules.start_tolerance);
            }
        }
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

impl PlanRun {
    fn new(s: &Setpoint) -> Self {
        Self {
            plan: s.plan.to_string(),
            first_sequence: s.sequence,
            last_sequence: s.sequence,
            join_velocity_step: 0.0,
            join_step_ratio: 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nullsweep_robot::{ArmSpec, Robot, Side};

    fn arm() -> Arm {
        Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).expect("the embedded PR2 has a right arm")
    }

    /// Setpoints that turn the shoulder pan by `rate` rad/s, starting at home.
    fn stream(arm: &Arm, count: u64, rate: f64) -> Vec<Setpoint> {
        (0..count)
            .map(|k| {
                let mut s = <Setpoint as bytemuck::Zeroable>::zeroed();
                s.sequence = k + 1;
                s.stamp_ns = k * 1_000_000;
                s.deadline_ns = s.stamp_ns + 1_000_000;
                s.joint_count = arm.dof() as u32;
                s.mode = Mode::Executing.wire();
                s.positions[..arm.dof()].copy_from_slice(&arm.home()[..arm.dof()]);
                s.positions[0] += rate * k as f64 * 1e-3;
                s.velocities[0] = rate;
                s
            })
            .collect()
    }

    /// Feeds the setpoints in passes of `pass` and gives the verdict.
    fn judged(setpoints: &[Setpoint], pass: usize) -> Verdict {
        let arm = arm();
        let mut judge = Judge::new(&arm, Rules::default());
        for chunk in setpoints.chunks(pass) {
            judge.observe(chunk, &arm.home());
        }
        judge.verdict().clone()
    }

    fn only(verdict: &Verdict, kind: Kind, count: u64) {
        assert_eq!(verdict.violations[&kind], count, "{:?}", verdict.first);
        assert_eq!(verdict.total(), count, "{:?}", verdict.first);
    }

    #[test]
    fn a_sound_stream_is_clean_whatever_the_pass() {
        for pass in [1, 3, 64, 200] {
            let verdict = judged(&stream(&arm(), 200, 0.5), pass);
            assert!(verdict.is_clean(), "{:?}", verdict.first);
            assert_eq!((verdict.setpoints, verdict.sessions, verdict.late), (200, 1, 0));
            assert!((verdict.largest_step_ratio - 0.5 / 2.088).abs() < 1e-6);
        }
    }

    #[test]
    fn nothing_received_is_not_clean() {
        assert!(!judged(&[], 1).is_clean());
    }

    #[test]
    fn a_step_above_the_velocity_limit_is_named() {
        let mut s = stream(&arm(), 20, 0.0);
        for s in &mut s[10..] {
            s.positions[3] -= 0.01;
        }
        let verdict = judged(&s, 1);
        only(&verdict, Kind::Step, 1);
        assert_eq!(verdict.first[0].sequence, 11);
        assert_eq!(verdict.first[0].joint.as_deref(), Some("r_elbow_flex_joint"));
        assert!((verdict.first[0].value - 0.01).abs() < 1e-12);
        assert!((verdict.first[0].bound - 3.3e-3).abs() < 1e-12);
    }

    #[test]
    fn the_same_motion_over_lost_samples_is_no_step() {
        // 2 rad/s is below the limit of 2.088: 50 samples apart it moves 0.1 rad.
        let all = stream(&arm(), 300, -2.0);
        let mut first = all[..20].to_vec();
        let kept = all[70..150].to_vec();
        let arm = arm();
        let mut judge = Judge::new(&arm, Rules::default());
        judge.observe(&first, &arm.home());
        judge.observe(&kept, &arm.home());
        only(judge.verdict(), Kind::Gap, 0);
        assert_eq!(judge.verdict().lost_by_reader, 50);

        // The same gap in a pass that emptied a half-full buffer is the sender's.
        first.extend_from_slice(&all[70..80]);
        only(&judged(&first, 30), Kind::Gap, 1);
    }

    #[test]
    fn a_gap_does_not_excuse_a_faster_motion() {
        let mut s = stream(&arm(), 40, 0.0);
        s.drain(10..14);
        for s in &mut s[10..] {
            s.positions[0] -= 5.0 * 2.088e-3 * 1.01;
        }
        let verdict = judged(&s, 1);
        assert_eq!(verdict.violations[&Kind::Step], 1);
        assert_eq!(verdict.violations[&Kind::Gap], 1);
    }

    #[test]
    fn soft_limits_move_in_with_speed() {
        let arm = arm();
        let j = 5; // wrist flex: k_position 20, so 3 rad/s needs 0.15 rad
        let (_, upper) = arm.braking_limits(j, 0.0);
        let mut s = stream(&arm, 60, 0.0);
        for (k, s) in s.iter_mut().enumerate() {
            s.positions[j] = upper - 0.16 + 0.003 * (k as f64).min(50.0);
        }
        let mut judge = Judge::new(&arm, Rules::default());
        let mut measured = arm.home();
        measured[j] = upper - 0.16;
        judge.observe(&s, &measured);
        let found = judge.verdict();
        // It may go on to 0.01 below the limit, but not at 3 rad/s.
        assert!(found.violations[&Kind::SoftLimit] >= 40, "{:?}", found.violations);
        assert_eq!(found.total(), found.violations[&Kind::SoftLimit]);
        let v = &found.first[0];
        assert!((v.bound - (upper - 0.15)).abs() < 1e-6, "{v}");
    }

    #[test]
    fn disorder_nonsense_and_speed_are_found() {
        let good = stream(&arm(), 30, 0.1);

        let mut s = good.clone();
        s.swap(10, 11);
        let verdict = judged(&s, 1);
        assert_eq!(verdict.violations[&Kind::Gap], 1);
        assert_eq!(verdict.violations[&Kind::Reordered], 1);

        let mut s = good.clone();
        s[5].positions[2] = f64::NAN;
        only(&judged(&s, 1), Kind::NotFinite, 1);
        let mut s = good.clone();
        s[5].velocities[2] = f64::NEG_INFINITY;
        only(&judged(&s, 1), Kind::NotFinite, 1);

        let mut s = good.clone();
        s[5].joint_count = 6;
        let verdict = judged(&s, 1);
        assert_eq!(verdict.violations[&Kind::Malformed], 1);

        let mut s = good.clone();
        s[5].velocities[0] = 2.1;
        only(&judged(&s, 1), Kind::Velocity, 1);
    }

    #[test]
    fn a_session_starts_where_the_arm_is() {
        let mut s = stream(&arm(), 10, 0.0);
        for s in &mut s {
            s.positions[1] += 0.03;
        }
        only(&judged(&s, 1), Kind::Jump, 1);

        // A restarted executor counts from one again after a silence: another session.
        let mut s = stream(&arm(), 10, 0.0);
        let again: Vec<_> = s
            .iter()
            .map(|s| Setpoint {
                stamp_ns: s.stamp_ns + 500_000_000,
                deadline_ns: s.deadline_ns + 500_000_000,
                ..*s
            })
            .collect();
        s.extend(again);
        let verdict = judged(&s, 1);
        assert!(verdict.is_clean(), "{:?}", verdict.first);
        assert_eq!(verdict.sessions, 2);
    }

    #[test]
    fn plans_and_lateness_are_followed() {
        let mut s = stream(&arm(), 30, 0.2);
        for (k, s) in s.iter_mut().enumerate() {
            s.plan.number = if k < 15 { 1 } else { 2 };
            if k >= 20 {
                s.stamp_ns += 5_000_000;
                s.deadline_ns += 5_000_000;
            }
            if k >= 15 {
                s.positions[0] -= 0.4e-3 * (k - 14) as f64; // turns back with the second plan
            }
        }
        let verdict = judged(&s, 1);
        assert!(verdict.is_clean(), "{:?}", verdict.first);
        let runs: Vec<_> =
            verdict.plans.iter().map(|r| (r.first_sequence, r.last_sequence)).collect();
        assert_eq!(runs, [(1, 15), (16, 30)]);
        assert!((verdict.plans[1].join_velocity_step - 0.4).abs() < 1e-6);
        assert_eq!((verdict.late, verdict.worst_lateness_ns), (1, 5_000_000));
    }
}
