//! A plan in motion: a short connector from where the arm holds, then the plan, walked along one
//! path time whose rate is ramped for pause, stop and speed.

use std::sync::Arc;

use crate::admit::ValidPlan;
use crate::guard::Guard;
use crate::interpolate::{PlanKnot, Sample, sample};
use crate::total::{limited, within};
use crate::{JointVector, MAX_DOF};

/// Cycles after which a predicted stop is given up: the slowest ramp takes 1,000 at 1 kHz.
const PREDICTION_CYCLES: usize = 20_000;

/// How far along its path a motion is and how fast it goes along it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Path time: negative on the connector, then the plan's own time. \[ns\]
    pub time: f64,
    /// Path time a unit of time, 0…1.
    pub rate: f64,
    segment: usize,
}

/// A plan that the arm is on.
#[derive(Clone, Debug)]
pub struct Path {
    plan: Arc<ValidPlan>,
    /// Whole turns added to the plan's continuous joints. \[rad\]
    shift: JointVector,
    connector: Connector,
    /// Path time from its beginning to the plan's first knot: on the connector, and at rest there
    /// for a cycle, where a joint's acceleration has to be 0 before it may rise again. \[ns\]
    lead: f64,
    progress: Progress,
}

impl Path {
    /// The plan from its first knot, reached by a connector from `from`, where the arm holds.
    #[must_use]
    pub fn start(plan: Arc<ValidPlan>, from: &JointVector, rate: f64, guard: &Guard) -> Self {
        let shift = shift(&plan, from, guard);
        let first = plan.knots().first().map_or(*from, |k| k.q + shift);
        let connector = Connector::new(from, &first, guard);
        let jerky = guard.used().iter().any(|joint| joint.limits.jerk.is_some());
        let rests = jerky && connector.duration > 0.0;
        let lead = connector.duration + if rests { guard.period_ns as f64 } else { 0.0 };
        let progress = Progress { time: -lead, rate, segment: 0 };
        Self { plan, shift, connector, lead, progress }
    }

    /// The plan entered at its first knot at full motion, `time` past it. `at` is the first
    /// knot's place as the plan before it has it. \[ns\]
    #[must_use]
    pub fn join(
        plan: Arc<ValidPlan>,
        at: &JointVector,
        time: f64,
        rate: f64,
        guard: &Guard,
    ) -> Self {
        let shift = shift(&plan, at, guard);
        let progress = Progress { time: 0.0, rate, segment: 0 };
        let connector = Connector::none(at);
        let mut path = Self { plan, shift, connector, lead: 0.0, progress };
        path.seek(time);
        path
    }

    /// The plan.
    #[must_use]
    pub fn plan(&self) -> &Arc<ValidPlan> {
        &self.plan
    }

    /// Gives the plan back.
    #[must_use]
    pub fn into_plan(self) -> Arc<ValidPlan> {
        self.plan
    }

    /// Where it is.
    #[must_use]
    pub fn progress(&self) -> Progress {
        self.progress
    }

    /// The knot whose segment it is on.
    #[must_use]
    pub fn knot(&self) -> usize {
        self.progress.segment
    }

    /// Whether the last knot is reached.
    #[must_use]
    pub fn ended(&self) -> bool {
        self.progress.time >= self.plan.duration()
    }

    /// Goes on for one cycle, the rate on its way to `target`.
    pub fn advance(&mut self, target: f64, guard: &Guard) {
        self.progress = self.next(self.progress, target, guard);
    }

    /// The commanded positions and velocities where it is.
    #[must_use]
    pub fn sample(&self) -> Sample {
        self.sample_at(self.progress)
    }

    /// Where a stop that begins with the next cycle ends; `None` where no end is in sight. The
    /// same arithmetic as [`Self::advance`], so the arm stops there bit for bit.
    #[must_use]
    pub fn predict_stop(&self, guard: &Guard) -> Option<JointVector> {
        let mut progress = self.progress;
        for _ in 0..PREDICTION_CYCLES {
            if progress.rate <= 0.0 || progress.time >= self.plan.duration() {
                return Some(self.sample_at(progress).q);
            }
            progress = self.next(progress, 0.0, guard);
        }
        None
    }

    /// A knot's place and time in this path; `None` where the plan has no such knot or the path
    /// is past it.
    #[must_use]
    pub fn upcoming(&self, knot: usize) -> Option<PlanKnot> {
        self.knot_at(knot).filter(|k| k.time > self.progress.time)
    }

    /// A knot's place and time in this path; `None` where the plan has no such knot.
    #[must_use]
    pub fn knot_at(&self, knot: usize) -> Option<PlanKnot> {
        let mut knot = *self.plan.knots().get(knot)?;
        knot.q = knot.q + self.shift;
        Some(knot)
    }

    /// The last knot's place in this path.
    #[must_use]
    pub fn end(&self) -> JointVector {
        self.plan.knots().last().map_or(self.connector.to, |k| k.q + self.shift)
    }

    fn next(&self, from: Progress, target: f64, guard: &Guard) -> Progress {
        let ramp = if from.time < 0.0 {
            self.connector.ramp
        } else {
            self.plan.knots().get(from.segment).map_or(1.0, |k| k.ramp)
        };
        let most = ramp * guard.period();
        let rate = from.rate + limited(target - from.rate, most);
        let time = from.time + 0.5 * (from.rate + rate) * guard.period_ns as f64;
        Progress { time, rate, segment: self.segment(from.segment, time) }
    }

    fn seek(&mut self, time: f64) {
        self.progress.time = time;
        self.progress.segment = self.segment(0, time);
    }

    /// The segment of a path time, sought from an earlier segment on.
    fn segment(&self, from: usize, time: f64) -> usize {
        let times = self.plan.times();
        let last = times.len().saturating_sub(2);
        let mut low = from.min(last);
        // In growing strides, as it is nearly always this segment or the next one.
        let mut stride = 1;
        while low + stride <= last && times[low + stride] <= time {
            low += stride;
            stride *= 2;
        }
        let end = (low + stride).min(last + 1);
        low + times.get(low + 1..end).map_or(0, |ahead| ahead.partition_point(|t| *t <= time))
    }

    fn sample_at(&self, at: Progress) -> Sample {
        if at.time < 0.0 {
            return self.connector.sample(at.time + self.lead, at.rate);
        }
        let knots = self.plan.knots();
        let (Some(a), Some(b)) = (knots.get(at.segment), knots.get(at.segment + 1)) else {
            return Sample { q: self.connector.to, v: JointVector::ZERO };
        };
        let mut s = sample(a, b, self.plan.interpolation(), at.time);
        s.q = s.q + self.shift;
        s.v = JointVector::new(s.v.map(|v| v * at.rate));
        s
    }
}

/// A straight rest-to-rest motion, as fast as each joint's velocity and acceleration allow: one
/// trapezoid of speed shared by all joints. Some 50 operations, so it is made where it is needed.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Connector {
    from: JointVector,
    to: JointVector,
    /// \[ns\]
    duration: f64,
    /// Time of speeding up, and of slowing down. \[s\]
    rise: f64,
    /// Acceleration of the share 0…1 of the distance. \[1/s²\]
    acceleration: f64,
    /// See [`PlanKnot::ramp`].
    ramp: f64,
}

impl Connector {
    fn none(at: &JointVector) -> Self {
        Self { from: *at, to: *at, duration: 0.0, rise: 0.0, acceleration: 0.0, ramp: 50.0 }
    }

    fn new(from: &JointVector, to: &JointVector, guard: &Guard) -> Self {
        let mut farthest = 0.0f64;
        let (mut speed, mut acceleration) = (f64::INFINITY, f64::INFINITY);
        for (j, bound) in guard.used().iter().enumerate() {
            let d = (to[j] - from[j]).abs();
            farthest = farthest.max(d);
            if d > 0.0 {
                speed = speed.min(bound.velocity() / d);
                // What may not come so near a soft limit was refused.
                let most = guard.approach(j, from[j], to[j]);
                let most = most.unwrap_or_else(|| guard.connector_acceleration(j));
                acceleration = acceleration.min(most / d);
            }
        }
        if !(farthest > 0.0) || !(speed > 0.0) || !(acceleration > 0.0) {
            return Self { from: *from, ..Self::none(to) };
        }
        let rise = (speed / acceleration).min(acceleration.sqrt().recip());
        let top = acceleration * rise;
        // The distance is 1: a triangle covers top · rise, the rest is at top speed.
        let cruise = (1.0 - top * rise).max(0.0) / top;
        Self {
            from: *from,
            to: *to,
            duration: ((2.0 * rise + cruise) * 1e9).ceil(),
            rise,
            acceleration,
            ramp: within(guard.stop_acceleration / (top * farthest), 1.0, 50.0),
        }
    }

    fn sample(&self, elapsed: f64, rate: f64) -> Sample {
        let total = self.duration * 1e-9;
        let t = within(elapsed * 1e-9, 0.0, total);
        if t >= total {
            return Sample { q: self.to, v: JointVector::ZERO };
        }
        let (a, rise) = (self.acceleration, self.rise);
        let (share, speed) = if t <= rise {
            (0.5 * a * t * t, a * t)
        } else if t < total - rise {
            (0.5 * a * rise * rise + a * rise * (t - rise), a * rise)
        } else {
            let left = total - t;
            (1.0 - 0.5 * a * left * left, a * left)
        };
        let mut s = Sample { q: self.to, v: JointVector::ZERO };
        for j in 0..MAX_DOF {
            let d = self.to[j] - self.from[j];
            s.q[j] = self.from[j] + d * within(share, 0.0, 1.0);
            s.v[j] = d * speed * rate;
        }
        s
    }
}

/// Whole turns of continuous joints that bring a plan's first knot nearest to a reference. \[rad\]
fn shift(plan: &ValidPlan, reference: &JointVector, guard: &Guard) -> JointVector {
    let first = plan.knots().first();
    first.map_or(JointVector::ZERO, |k| guard.continuous().turns_to(&k.q, reference))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use rsruckig::prelude::{
        DataArrayOrVec, InputParameter, Ruckig, Synchronization, ThrowErrorHandler, Trajectory,
    };

    use super::*;
    use crate::guard::tests::pr2;

    const DOF: usize = 7;

    /// How long the best motion between two stand-stills takes by Ruckig. \[s\]
    fn best(from: &JointVector, to: &JointVector, guard: &Guard, together: Synchronization) -> f64 {
        let mut input = InputParameter::<DOF>::new(None);
        let each = |f: &dyn Fn(usize) -> f64| DataArrayOrVec::Stack(std::array::from_fn(f));
        input.current_position = each(&|j| from[j]);
        input.target_position = each(&|j| to[j]);
        input.max_velocity = each(&|j| guard.joints[j].velocity());
        input.max_acceleration = each(&|j| guard.connector_acceleration(j));
        input.max_jerk = each(&|_| f64::INFINITY);
        input.synchronization = together;
        let mut trajectory = Trajectory::new(None);
        let mut ruckig = Ruckig::<DOF, ThrowErrorHandler>::new(None, 0.001);
        ruckig.calculate(&input, &mut trajectory).expect("a motion");
        trajectory.get_duration()
    }

    proptest! {
        /// Within the start tolerance a connector is as fast as the best that any generator could
        /// make; further away it keeps to the line and to every bound.
        #[test]
        fn a_connector_is_the_best_straight_motion(
            apart in prop::array::uniform7(-1.0..1.0f64),
            far in any::<bool>(),
            weak in 0..DOF,
            share in 0.1..1.0f64,
            jerky in any::<bool>(),
        ) {
            let mut guard = pr2();
            guard.joints[weak].limits.jerk = jerky.then_some(2000.0 * share);
            guard.joints[weak].limits.acceleration *= share;
            let from = JointVector::new([0.1; MAX_DOF]);
            let reach = if far { 1.0 } else { guard.start_tolerance };
            let mut to = from;
            for j in 0..DOF {
                to[j] += reach * apart[j];
            }
            let connector = Connector::new(&from, &to, &guard);
            let seconds = connector.duration * 1e-9;
            let phase = best(&from, &to, &guard, Synchronization::Phase);
            prop_assert!(seconds >= phase - 1e-8, "{seconds} against {phase}");
            if !far {
                prop_assert!(seconds <= phase + 1e-8, "{seconds} against {phase}");
            }
            let cycle = guard.period_ns as f64;
            let cycles = (connector.duration / cycle).ceil() as usize;
            let mut last = connector.sample(0.0, 1.0);
            prop_assert_eq!(last.q, from);
            for k in 1..=cycles {
                let next = connector.sample(k as f64 * cycle, 1.0);
                let share = (next.q[0] - from[0]) / (to[0] - from[0]);
                for j in 0..DOF {
                    let line = from[j] + share * (to[j] - from[j]);
                    prop_assert!((next.q[j] - line).abs() < 1e-9);
                    prop_assert!(next.v[j].abs() <= guard.joints[j].velocity() * (1.0 + 1e-9));
                    let rise = (next.v[j] - last.v[j]).abs() / guard.period();
                    prop_assert!(rise <= guard.connector_acceleration(j) * (1.0 + 1e-6), "{rise}");
                }
                last = next;
            }
            prop_assert_eq!(last.q, to);
            // At rest before and after: the setpoints show no more jerk than there may be.
            let speed = |k: isize| match k {
                0.. => connector.sample(k as f64 * cycle, 1.0).v[weak],
                _ => 0.0,
            };
            for k in -2..=cycles as isize {
                let change = speed(k) - 2.0 * speed(k + 1) + speed(k + 2);
                let shown = change.abs() / guard.period().powi(2);
                let most = guard.joints[weak].limits.jerk.unwrap_or(f64::INFINITY);
                prop_assert!(shown <= most * (1.0 + 1e-6), "{shown} of {most} rad/s³");
            }
        }
    }
}
