//! Follows trajectories in place of a controller that takes bare positions.

use std::collections::VecDeque;

use nullsweep_executor::{PlanKnot, Sample, sample};
use nullsweep_ipc_types::Interpolation;
use nullsweep_robot::JointVector;

use crate::stream::Message;

/// What is followed: each message from its stamp on, as [`Takeover::AtStamp`](crate::Takeover) says.
#[derive(Clone, Debug, Default)]
pub struct Player {
    /// Where the joints are when, from the last one that has passed on.
    knots: VecDeque<PlanKnot>,
}

impl Player {
    /// Takes a message that was made for a controller that splices at the stamp.
    pub fn take(&mut self, message: &Message) {
        let (Some(first), start) = (message.points.first(), message.start_ns as f64) else {
            return;
        };
        let knot = |time: f64, q, v| PlanKnot { time, q, v, ramp: 0.0 };
        // What the last one has from there on is dropped.
        let from = self.seek(start).unwrap_or(Sample { q: first.q, v: JointVector::ZERO });
        while self.knots.back().is_some_and(|k| k.time >= start) {
            self.knots.pop_back();
        }
        self.knots.push_back(knot(start, from.q, from.v));
        let points = message.points.iter();
        self.knots.extend(points.map(|p| knot(start + p.after_ns as f64, p.q, p.v)));
    }

    /// Where the joints are to be at a moment that is not before the last one asked for; `None`
    /// before the first message. \[rad\], \[rad/s\]
    pub fn at(&mut self, now_ns: u64) -> Option<Sample> {
        let found = self.seek(now_ns as f64);
        while self.knots.get(1).is_some_and(|next| next.time <= now_ns as f64) {
            self.knots.pop_front();
        }
        found
    }

    /// Forgets all, because the arm's motors are off.
    pub fn let_go(&mut self) {
        self.knots.clear();
    }

    fn seek(&self, time: f64) -> Option<Sample> {
        let next = self.knots.iter().position(|k| k.time > time);
        match (next, self.knots.back()) {
            (None, last) => last.map(|k| Sample { q: k.q, v: JointVector::ZERO }),
            (Some(0), _) => self.knots.front().map(|k| Sample { q: k.q, v: JointVector::ZERO }),
            (Some(next), _) => {
                let (a, b) = (&self.knots[next - 1], &self.knots[next]);
                Some(sample(a, b, Interpolation::Cubic, time))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stream::Point;

    const MS: u64 = 1_000_000;

    fn point(after_ms: u64, q: f64, v: f64) -> Point {
        let joint = |x| JointVector::from_fn(|j| if j == 0 { x } else { 0.0 });
        Point { after_ns: after_ms * MS, q: joint(q), v: joint(v) }
    }

    #[test]
    fn a_message_takes_over_at_its_stamp_and_the_last_one_comes_to_rest() {
        let mut player = Player::default();
        assert!(player.at(0).is_none());
        let message = |sequence, start_ms: u64, points: Vec<Point>| Message {
            sequence,
            start_ns: start_ms * MS,
            points,
        };
        // 1 rad/s, and a stop behind it that is dropped once the next one comes.
        player.take(&message(
            1,
            100,
            vec![point(10, 0.0, 1.0), point(30, 0.02, 1.0), point(60, 0.03, 0.0)],
        ));
        player.take(&message(2, 130, vec![point(20, 0.04, 1.0), point(60, 0.06, 0.0)]));
        let mut before = 0.0;
        for ms in 90..250u64 {
            let at = player.at(ms * MS).expect("a place");
            assert!((at.q[0] - before).abs() < 0.0016, "{ms}: {}", at.q[0]);
            before = at.q[0];
            if (110..=150).contains(&ms) {
                assert!((at.q[0] - 1e-3 * (ms - 110) as f64).abs() < 1e-12, "{ms}: {}", at.q[0]);
            }
        }
        assert_eq!(player.at(300 * MS).map(|s| (s.q[0], s.v[0])), Some((0.06, 0.0)));
        player.let_go();
        assert!(player.at(301 * MS).is_none());
    }
}
