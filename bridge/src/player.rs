//! Follows trajectories in place of a controller that takes bare positions.

use std::collections::VecDeque;

use nullsweep_executor::{PlanKnot, Sample, sample};
use nullsweep_ipc_types::Interpolation;
use nullsweep_robot::JointVector;

use crate::stream::Message;

/// How soon a gap is won back, as [`Playout`](crate::Playout) does. \[s\]
const SETTLE: f64 = 0.3;
/// How fast it is played at most: a gap is won back by going faster.
const FASTEST: f64 = 1.5;

/// The moment that is played.
#[derive(Clone, Copy, Debug)]
struct Head {
    /// When it was looked. \[ns\]
    looked_ns: u64,
    /// What was played then: behind that after a gap. \[ns\]
    at: f64,
    /// How fast it goes on.
    rate: f64,
}

/// What is followed: each message from its stamp on, as [`Takeover::AtStamp`](crate::Takeover) says.
#[derive(Clone, Debug)]
pub struct Player {
    /// What is played at most from one look to the next: whoever gets bare positions sees each one a
    /// period after the last, so what is played in a longer gap is made up later. \[ns\]
    period_ns: u64,
    /// Where the joints are when, from the last one that has passed on.
    knots: VecDeque<PlanKnot>,
    head: Option<Head>,
}

impl Player {
    /// One that is asked each `period_ns`.
    #[must_use]
    pub fn new(period_ns: u64) -> Self {
        Self { period_ns, knots: VecDeque::new(), head: None }
    }

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
    /// before the first message. Where it was not asked for a while, it goes on from where it was,
    /// and is where it should be again a little later, or when the joints stand. \[rad\], \[rad/s\]
    pub fn at(&mut self, now_ns: u64) -> Option<Sample> {
        let head = self.turn(now_ns);
        let found = self.seek(head.at);
        while self.knots.get(1).is_some_and(|next| next.time <= head.at) {
            self.knots.pop_front();
        }
        found.map(|s| Sample { v: JointVector::from_fn(|j| s.v[j] * head.rate), ..s })
    }

    /// Goes on to a moment.
    fn turn(&mut self, now_ns: u64) -> Head {
        let now = now_ns as f64;
        let mut head = self.head.unwrap_or(Head { looked_ns: now_ns, at: now, rate: 1.0 });
        let passed = now_ns.saturating_sub(head.looked_ns).min(self.period_ns) as f64;
        let seconds = passed * 1e-9;
        let behind = (now - head.at - passed) * 1e-9;
        // Critically damped, and never back.
        let change = behind / (SETTLE * SETTLE) - 2.0 * (head.rate - 1.0) / SETTLE;
        head.rate = (head.rate + change * seconds).clamp(1.0, FASTEST);
        head.looked_ns = now_ns;
        head.at += passed * head.rate;
        // Where the joints stand nothing is left out.
        if let Some(first) = self.knots.front() {
            head.at = head.at.max(first.time.min(now));
        }
        if head.at >= now || self.knots.back().is_none_or(|last| last.time <= head.at) {
            (head.at, head.rate) = (now, 1.0);
        }
        *self.head.insert(head)
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
        let mut player = Player::new(MS);
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

    /// 0.5 rad/s for 100 ms, and a stop within 125 ms.
    fn moving() -> Player {
        let mut player = Player::new(MS);
        let ease = point(225, 0.05 + 0.5 * 0.0625, 0.0);
        let points = vec![point(0, 0.0, 0.5), point(100, 0.05, 0.5), ease];
        player.take(&Message { sequence: 1, start_ns: 100 * MS, points });
        player
    }

    /// A program that got no time asks late: the arm goes on from where it is, at no more than its
    /// speed, and comes to rest where it should.
    #[test]
    fn a_stall_is_no_jump() {
        for stalled in [60, 150, 500] {
            let mut player = moving();
            let (mut before, mut top, mut rest) = (0.0, 0.0f64, 0);
            let mut speed = 0.0;
            for ms in (50..150).chain(150 + stalled..1500) {
                let at = player.at(ms * MS).expect("a place");
                assert!(
                    (at.q[0] - before).abs() <= 0.75e-3 + 1e-9,
                    "{ms}: {before} to {}",
                    at.q[0]
                );
                if ms > 150 + stalled {
                    assert!((at.v[0] - speed).abs() < 0.01, "{ms}: {speed} to {}", at.v[0]);
                }
                (before, speed) = (at.q[0], at.v[0]);
                top = top.max(at.v[0]);
                if at.v[0] == 0.0 && at.q[0] > 0.08 && rest == 0 {
                    rest = ms;
                }
            }
            assert!((before - 0.08125).abs() < 1e-12 && top < 0.75, "{before}, {top}");
            assert!(rest < 500 + stalled, "{rest}");
        }
    }
}
