//! Joint plans that need no surface: straight joint lines through a few postures, to try the
//! executor and the endpoint with.

use bytemuck::Zeroable;
use nullsweep_ipc_types::{
    Contact, Interpolation, JoinRule, Knot, MAX_HELD_JOINTS, PlanHeader, PlanId,
};
use nullsweep_robot::{Arm, JointVector, MAX_DOF};

/// A plan that is not sealed yet: the publisher gives it its id and checksum.
#[derive(Clone, Debug)]
pub struct Sketch {
    /// The header; id and checksum are zero.
    pub header: PlanHeader,
    /// The knots.
    pub knots: Vec<Knot>,
}

impl Sketch {
    /// Longest time between two knots. \[s\]
    const KNOT_DISTANCE: f64 = 0.05;
    /// Postures nearer than this are the same. \[s\]
    const SHORTEST: f64 = 1e-6;

    /// Straight lines through `postures` at `speed`, a share (0…1\] of the joints' velocity
    /// limits; the slowest joint of each line sets its time.
    ///
    /// # Panics
    /// Where there are fewer than two different postures.
    #[must_use]
    pub fn through(arm: &Arm, postures: &[JointVector], speed: f64) -> Self {
        let mut knots = Vec::new();
        let mut time_ns = 0;
        for line in postures.windows(2) {
            let (from, to) = (&line[0], &line[1]);
            let needed = (0..arm.dof())
                .map(|j| (to[j] - from[j]).abs() / (speed * arm.limits()[j].velocity))
                .fold(0.0, f64::max);
            if needed < Self::SHORTEST {
                continue;
            }
            let pieces = (needed / Self::KNOT_DISTANCE).ceil() as u32;
            // Rounded up, so that no joint is faster than asked for.
            let piece_ns = (needed / f64::from(pieces) * 1e9).ceil() as u64;
            if knots.is_empty() {
                knots.push(knot(arm, 0, from));
            }
            for piece in 1..=pieces {
                let share = f64::from(piece) / f64::from(pieces);
                let between = |j: usize| from[j] + (to[j] - from[j]) * share;
                let q = if piece == pieces { *to } else { JointVector::from_fn(between) };
                time_ns += piece_ns;
                knots.push(knot(arm, time_ns, &q));
            }
        }
        assert!(!knots.is_empty(), "a plan needs two different postures");

        let mut held_positions = [0.0; MAX_HELD_JOINTS];
        for (slot, held) in held_positions.iter_mut().zip(arm.held_joints()) {
            *slot = held.position;
        }
        let header = PlanHeader {
            fingerprint: arm.fingerprint(),
            base_pose: [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
            held_positions,
            held_count: arm.held_joints().len() as u32,
            joint_count: arm.dof() as u32,
            knot_count: knots.len() as u32,
            interpolation: Interpolation::Linear.wire(),
            corners: 1,
            join_rule: JoinRule::StopThenStart.wire(),
            ..PlanHeader::zeroed()
        };
        Self { header, knots }
    }

    /// From `from` to [`swung`] and back, `swings` times.
    #[must_use]
    pub fn swings(arm: &Arm, from: &JointVector, swings: usize, angle: f64, speed: f64) -> Self {
        let out = swung(arm, from, angle);
        let postures: Vec<_> =
            (0..=2 * swings).map(|k| if k % 2 == 0 { *from } else { out }).collect();
        Self::through(arm, &postures, speed)
    }

    /// Every joint out by `angle` and back, in so many knots and seconds.
    #[must_use]
    pub fn twitch(arm: &Arm, from: &JointVector, angle: f64, knots: u32, seconds: f64) -> Self {
        let out = swung(arm, from, angle);
        let mut sketch = Self::through(arm, &[*from, out, *from], 1.0);
        sketch.knots = (0..knots)
            .map(|k| {
                let share = f64::from(k) / f64::from(knots - 1);
                let bump = 1.0 - (2.0 * share - 1.0).abs();
                let q: JointVector = JointVector::from_fn(|j| from[j] + (out[j] - from[j]) * bump);
                knot(arm, (share * seconds * 1e9).round() as u64, &q)
            })
            .collect();
        sketch.header.knot_count = knots;
        sketch
    }

    /// The same plan, joining knot `knot` of `plan` without a stop.
    #[must_use]
    pub fn at_knot(mut self, plan: PlanId, knot: u32) -> Self {
        self.header.join_rule = JoinRule::AtKnot.wire();
        self.header.join_plan = plan;
        self.header.join_knot = knot;
        self
    }

    /// How long the plan takes. \[s\]
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.knots.last().map_or(0.0, |k| k.time_from_start_ns as f64 * 1e-9)
    }

    /// The joints in one of its knots.
    #[must_use]
    pub fn posture(&self, knot: usize) -> JointVector {
        let mut q = JointVector::default();
        q.copy_from_slice(&self.knots[knot].positions[..MAX_DOF]);
        q
    }
}

/// Every joint turned by `angle` away from its nearer limit. \[rad\]
#[must_use]
pub fn swung(arm: &Arm, from: &JointVector, angle: f64) -> JointVector {
    let mut q = *from;
    for j in 0..arm.dof() {
        let (lower, upper) = arm.margined_limits()[j];
        let up = !lower.is_finite() || upper - from[j] >= from[j] - lower;
        q[j] += if up { angle } else { -angle };
    }
    q
}

fn knot(arm: &Arm, time_from_start_ns: u64, q: &JointVector) -> Knot {
    let mut knot = Knot {
        time_from_start_ns,
        patch: Knot::NO_PATCH,
        contact: Contact::Transfer.wire(),
        ..Knot::zeroed()
    };
    knot.positions[..arm.dof()].copy_from_slice(&q[..arm.dof()]);
    knot
}

#[cfg(test)]
mod tests {
    use nullsweep_robot::{ArmSpec, Robot, Side};

    use super::*;

    #[test]
    fn a_sketch_keeps_the_limits_and_comes_back() {
        for side in [Side::Right, Side::Left] {
            let arm = Robot::pr2().arm(&ArmSpec::pr2(side)).expect("the PR2 has two arms");
            let sketch = Sketch::swings(&arm, &arm.home(), 2, 0.2, 0.5);
            assert_eq!(sketch.posture(0), arm.home());
            assert_eq!(sketch.posture(sketch.knots.len() - 1), arm.home());
            // 0.2 rad four times at half of the slowest joint's 2.082 rad/s.
            assert!((sketch.seconds() - 0.8 / 1.041).abs() < 1e-6, "{}", sketch.seconds());
            for (k, pair) in sketch.knots.windows(2).enumerate() {
                let dt = (pair[1].time_from_start_ns - pair[0].time_from_start_ns) as f64 * 1e-9;
                assert!(arm.within_margins(&sketch.posture(k)), "knot {k}");
                for j in 0..arm.dof() {
                    let rate = (pair[1].positions[j] - pair[0].positions[j]).abs() / dt;
                    assert!(rate <= 0.5 * arm.limits()[j].velocity * (1.0 + 1e-9));
                }
            }
        }
    }
}
