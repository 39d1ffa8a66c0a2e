//! Setpoints at 1 kHz to short trajectories for the controller. No clock, no ROS: a test runs it.
//!
//! Each message holds the setpoints since the last one, to be followed `delay` after they were
//! due, and ends in a stop: when messages cease, the arm slows down and holds by itself. The next
//! message's stamp is where the last one's setpoints end, so that the controller splices it there
//! and drops the stop.

use std::collections::VecDeque;

use nullsweep_ipc_types::{Mode, Setpoint};

/// Joints of the arm.
pub const DOF: usize = 7;
/// One value for each joint. \[rad\]
pub type Joints = [f64; DOF];

/// Setpoints whose place in time is remembered.
const REMEMBERED: usize = 512;
/// Points of a message lie at least this far apart. \[ns\]
const SPACING_NS: u64 = 4_000_000;
/// A message begins so much before the last one's setpoints end: a moment later, as rounding may
/// make it, the controller would take the velocity there as 0. \[ns\]
const EARLY_NS: u64 = 10_000;
/// A stop takes at least this long. \[s\]
const SHORTEST_STOP: f64 = 0.02;

/// How a stream works.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rules {
    /// Setpoints are followed so much later. \[ns\]
    pub delay_ns: u64,
    /// Following ends so long after the last deadline. \[ns\]
    pub timeout_ns: u64,
    /// Of the stop that ends every message. \[rad/s²\]
    pub stop_acceleration: f64,
    /// How far the first setpoint that is followed may be from the arm. \[rad\]
    pub start_tolerance: f64,
}

/// A point of a message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Since the message's stamp. \[ns\]
    pub after_ns: u64,
    /// \[rad\]
    pub q: Joints,
    /// \[rad/s\]
    pub v: Joints,
}

/// What is sent to the controller.
#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    /// Counts messages from 1.
    pub sequence: u32,
    /// When it begins, on the setpoints' clock. \[ns\]
    pub start_ns: u64,
    /// At least two, the last one at rest.
    pub points: Vec<Point>,
}

/// The stream's memory.
#[derive(Clone, Debug)]
pub struct Stream {
    rules: Rules,
    /// Setpoints that are not sent yet, as deadline, position and velocity.
    waiting: VecDeque<(u64, Joints, Joints)>,
    /// Sequence and deadline of those that were received.
    known: VecDeque<(u64, u64)>,
    /// Up to where setpoints were sent. \[ns\]
    sent_ns: Option<u64>,
    /// The last position that was sent, at rest.
    rests_at: Option<Joints>,
    last_deadline_ns: Option<u64>,
    /// Messages made.
    made: u32,
    /// Messages that could not be sent in time.
    pub late: u64,
    /// Setpoints too far from the arm to begin with.
    pub refused: u64,
}

impl Stream {
    /// Follows nothing yet.
    pub fn new(rules: Rules) -> Self {
        Self {
            rules,
            waiting: VecDeque::new(),
            known: VecDeque::with_capacity(REMEMBERED),
            sent_ns: None,
            rests_at: None,
            last_deadline_ns: None,
            made: 0,
            late: 0,
            refused: 0,
        }
    }

    /// Takes a setpoint while the arm is measured at `measured`.
    pub fn take(&mut self, setpoint: &Setpoint, measured: &Joints) {
        let q: Joints = std::array::from_fn(|j| setpoint.positions[j]);
        let v: Joints = std::array::from_fn(|j| setpoint.velocities[j]);
        let sound = setpoint.joint_count as usize == DOF
            && q.iter().chain(&v).all(|x| x.is_finite())
            && self.last_deadline_ns.is_none_or(|last| setpoint.deadline_ns > last);
        if !sound {
            self.refused += 1;
            return;
        }
        self.last_deadline_ns = Some(setpoint.deadline_ns);
        if self.known.len() == REMEMBERED {
            self.known.pop_front();
        }
        self.known.push_back((setpoint.sequence, setpoint.deadline_ns));
        if setpoint.disable != 0 {
            self.let_go();
            return;
        }
        if self.sent_ns.is_none() {
            // While the arm follows nothing, the executor's setpoints follow the arm.
            let far = (0..DOF).any(|j| (q[j] - measured[j]).abs() > self.rules.start_tolerance);
            if far || setpoint.mode == Mode::Fault.wire() || setpoint.mode == Mode::Init.wire() {
                self.refused += u64::from(far);
                return;
            }
            self.sent_ns = Some(setpoint.deadline_ns);
            self.rests_at = None;
        }
        self.waiting.push_back((setpoint.deadline_ns, q, v));
    }

    /// Forgets what the arm was to do: it follows again only what begins where it is.
    pub fn let_go(&mut self) {
        self.waiting.clear();
        self.sent_ns = None;
        self.rests_at = None;
    }

    /// Whether setpoints are being followed.
    #[cfg(test)]
    pub fn follows(&self) -> bool {
        self.sent_ns.is_some()
    }

    /// Whether setpoints have ceased; then the arm is on its way to rest on the last message.
    pub fn has_ceased(&mut self, now_ns: u64) -> bool {
        let ceased = self
            .last_deadline_ns
            .is_some_and(|last| now_ns > last.saturating_add(self.rules.timeout_ns));
        if ceased && self.waiting.is_empty() {
            self.let_go();
        }
        ceased
    }

    /// The newest setpoint that was in force at a moment, with its deadline.
    pub fn in_force(&self, at_ns: u64) -> Option<(u64, u64)> {
        let due = at_ns.checked_sub(self.rules.delay_ns)?;
        self.known.iter().rev().find(|(_, deadline)| *deadline <= due).copied()
    }

    /// The next message; `None` where nothing is to be sent.
    pub fn message(&mut self, now_ns: u64) -> Option<Message> {
        let from = self.sent_ns?;
        let (last_ns, last_q, last_v) = *self.waiting.back()?;
        let start_ns = (from + self.rules.delay_ns).saturating_sub(EARLY_NS);
        if start_ns <= now_ns {
            // Too late to splice: the arm is already slowing down on the last message. A stamp in
            // the past would make it jump.
            self.late += 1;
            self.let_go();
            return None;
        }
        let stands = last_v == [0.0; DOF] && self.waiting.iter().all(|(_, q, _)| *q == last_q);
        if stands && self.rests_at == Some(last_q) {
            self.waiting.clear();
            self.sent_ns = Some(last_ns);
            return None;
        }
        let mut points = Vec::with_capacity(self.waiting.len() / 4 + 2);
        let mut before = from;
        for &(deadline, q, v) in &self.waiting {
            if deadline >= before + SPACING_NS || deadline == last_ns {
                points.push(Point { after_ns: deadline.saturating_sub(from) + EARLY_NS, q, v });
                before = deadline;
            }
        }
        let fastest = last_v.iter().map(|v| v.abs()).fold(0.0, f64::max);
        let stop = (fastest / self.rules.stop_acceleration).max(SHORTEST_STOP);
        let rest: Joints = std::array::from_fn(|j| last_q[j] + 0.5 * stop * last_v[j]);
        let after_ns = last_ns.saturating_sub(from) + EARLY_NS + (stop * 1e9) as u64;
        points.push(Point { after_ns, q: rest, v: [0.0; DOF] });
        self.waiting.clear();
        self.sent_ns = Some(last_ns);
        self.rests_at = (fastest == 0.0).then_some(last_q);
        self.made += 1;
        Some(Message { sequence: self.made, start_ns, points })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;
    const RULES: Rules = Rules {
        delay_ns: 60 * MS,
        timeout_ns: 20 * MS,
        stop_acceleration: 4.0,
        start_tolerance: 0.02,
    };

    fn setpoint(sequence: u64, q: f64, v: f64) -> Setpoint {
        let mut s = <Setpoint as bytemuck::Zeroable>::zeroed();
        s.sequence = sequence;
        s.deadline_ns = 1000 * MS + sequence * MS;
        s.joint_count = DOF as u32;
        s.mode = Mode::Executing.wire();
        s.positions[0] = q;
        s.velocities[0] = v;
        s
    }

    #[test]
    fn messages_join_where_setpoints_end_and_come_to_rest() {
        let mut stream = Stream::new(RULES);
        let mut messages = Vec::new();
        for k in 1..=100u64 {
            stream.take(&setpoint(k, 1e-3 * k as f64, 1.0), &[0.0; DOF]);
            if k % 20 == 0 {
                messages.extend(stream.message(1000 * MS + k * MS));
            }
        }
        assert_eq!(messages.len(), 5);
        for pair in messages.windows(2) {
            let (a, b) = (&pair[0], &pair[1]);
            let joint = a.points[a.points.len() - 2];
            // The next one begins just before the last setpoint of this one is due.
            assert_eq!(b.start_ns + EARLY_NS, a.start_ns + joint.after_ns);
            assert_eq!(joint.v[0], 1.0);
        }
        for message in &messages {
            assert!(message.points.windows(2).all(|w| w[1].after_ns > w[0].after_ns));
            let [.., last, rest] = message.points[..] else { panic!("two points") };
            // 1 rad/s is stopped in 0.25 s over 0.125 rad.
            assert_eq!(rest.v, [0.0; DOF]);
            assert!((rest.q[0] - last.q[0] - 0.125).abs() < 1e-12);
            assert_eq!(rest.after_ns - last.after_ns, 250 * MS);
        }
        // What is measured 80 ms after a deadline was asked for 20 ms after it.
        assert_eq!(stream.in_force(1080 * MS + 60 * MS), Some((80, 1080 * MS)));
    }

    #[test]
    fn what_is_too_late_or_too_far_is_not_followed() {
        let mut stream = Stream::new(RULES);
        stream.take(&setpoint(1, 0.1, 0.0), &[0.0; DOF]);
        assert!(!stream.follows() && stream.refused == 1);
        stream.take(&setpoint(2, 0.01, 0.0), &[0.0; DOF]);
        assert!(stream.follows());
        // The process stalled: its stamp would lie in the past.
        assert_eq!(stream.message(1063 * MS), None);
        assert!(!stream.follows() && stream.late == 1);
        let mut nan = setpoint(3, 0.0, 0.0);
        nan.positions[3] = f64::NAN;
        stream.take(&nan, &[0.0; DOF]);
        assert!(!stream.follows());
    }

    #[test]
    fn standing_still_sends_one_message_and_ceasing_lets_go() {
        let mut stream = Stream::new(RULES);
        let mut count = 0;
        for k in 1..=100u64 {
            stream.take(&setpoint(k, 0.0, 0.0), &[0.0; DOF]);
            if k % 20 == 0 {
                count += usize::from(stream.message(1000 * MS + k * MS).is_some());
            }
        }
        assert_eq!(count, 1);
        assert!(!stream.has_ceased(1120 * MS) && stream.follows());
        assert!(stream.has_ceased(1121 * MS) && !stream.follows());
    }
}
