//! Setpoints at 1 kHz to short trajectories for the controller. No clock, no ROS: a test runs it.
//!
//! Each message holds the setpoints since the last one, to be followed `delay` after they were
//! due (see [`Playout`]), and ends in a stop: when messages cease, the arm slows down and holds by
//! itself. The next message's stamp is where the last one's setpoints end, so that the controller
//! splices it there and drops the stop; or, where the controller splices on arrival, it begins with
//! the last ones that are still ahead ([`Takeover`]).

use std::collections::VecDeque;

use nullsweep_ipc_types::{Mode, Setpoint};
use nullsweep_robot::{Continuous, JointVector};

use crate::playout::Playout;

/// Setpoints whose place in time is remembered.
const REMEMBERED: usize = 512;
/// Points of a message lie at least this far apart. \[ns\]
const SPACING_NS: u64 = 4_000_000;
/// A message begins so much before the last one's setpoints end: a moment later, as rounding may
/// make it, the controller would take the velocity there as 0. \[ns\]
const EARLY_NS: u64 = 10_000;
/// Where following begins, the message begins so much before the first setpoint, if there is time:
/// the motion there from where the controller holds, which is not exactly where the arm is measured,
/// is no jump then. \[ns\]
const BLEND_NS: u64 = 20_000_000;
/// A stop takes at least this long. \[s\]
const SHORTEST_STOP: f64 = 0.02;
/// What a message may take to the controller. \[ns\]
const TRANSIT_NS: u64 = 5_000_000;
/// Where the arm is asked to be when it begins to follow differs a little from where the first
/// setpoint is; so long it takes until that difference is gone. \[s\]
const FADE: f64 = 0.5;

/// When a controller leaves one message for the next one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Takeover {
    /// At the next one's stamp; until then it follows the last one.
    AtStamp,
    /// At once: from where it is, as it moves, to the next one's first point.
    AtArrival,
}

/// How a stream works.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rules {
    /// Joints of the arm.
    pub joints: usize,
    /// What the controller does.
    pub takeover: Takeover,
    /// Setpoints are followed so much later. \[ns\]
    pub delay_ns: u64,
    /// Following ends so long after the last deadline. \[ns\]
    pub timeout_ns: u64,
    /// Of the stop that ends every message. \[rad/s²\]
    pub stop_acceleration: f64,
    /// How far the first setpoint that is followed may be from the arm. \[rad\]
    pub start_tolerance: f64,
    /// Of which joints whole turns are no distance.
    pub continuous: Continuous,
}

/// A point of a message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Since the message's stamp. \[ns\]
    pub after_ns: u64,
    /// \[rad\]
    pub q: JointVector,
    /// \[rad/s\]
    pub v: JointVector,
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

/// Why setpoints are not followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// None come, or those of another executor.
    Ceased,
    /// A message would have come too late.
    Late,
    /// They are too far from the arm to begin with.
    Far,
}

impl std::fmt::Display for Stop {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Ceased => "setpoints have ceased",
            Self::Late => "a message would come too late (is --delay too short?)",
            Self::Far => "setpoints are too far from the arm to begin with",
        })
    }
}

/// A setpoint that is not sent yet.
#[derive(Clone, Copy, Debug)]
struct Due {
    /// When it is followed. \[ns\]
    at_ns: u64,
    q: JointVector,
    v: JointVector,
}

/// What is being followed.
#[derive(Clone, Debug)]
struct Following {
    playout: Playout,
    /// Up to where setpoints were sent. \[ns\]
    sent_ns: u64,
    /// The last setpoint.
    last: (JointVector, JointVector),
    /// Whole turns that bring the setpoints to where the arm is. \[rad\]
    turns: JointVector,
    /// When following began, and how far the controller's own setpoint was from the first one.
    began_ns: u64,
    offset: JointVector,
}

/// The stream's memory.
#[derive(Clone, Debug)]
pub struct Stream {
    rules: Rules,
    following: Option<Following>,
    waiting: VecDeque<Due>,
    /// Those of the messages so far that are still ahead, for [`Takeover::AtArrival`].
    ahead: VecDeque<Due>,
    /// Sequence and deadline of the last that are followed, and when.
    known: VecDeque<(u64, u64, u64)>,
    /// Where and when the last message comes to rest.
    rest: Option<(JointVector, u64)>,
    /// Whether the last message stands still where it ends.
    stands: bool,
    /// Why following ended or does not begin, until it does.
    stopped: Option<Stop>,
    last_deadline_ns: Option<u64>,
    last_sequence: u64,
    /// Messages made.
    made: u32,
    /// Messages that could not be sent in time.
    pub late: u64,
    /// Setpoints too far from the arm to begin with.
    pub refused: u64,
}

impl Stream {
    /// Follows nothing yet.
    #[must_use]
    pub fn new(rules: Rules) -> Self {
        Self {
            rules,
            following: None,
            waiting: VecDeque::new(),
            ahead: VecDeque::new(),
            known: VecDeque::with_capacity(REMEMBERED),
            rest: None,
            stands: false,
            stopped: None,
            last_deadline_ns: None,
            last_sequence: 0,
            made: 0,
            late: 0,
            refused: 0,
        }
    }

    /// Takes a setpoint while the arm is measured at `measured`.
    pub fn take(&mut self, setpoint: &Setpoint, measured: &JointVector) {
        let all = self.rules.joints;
        let used = |j: usize, value: f64| if j < all { value } else { 0.0 };
        let q = JointVector::from_fn(|j| used(j, setpoint.positions[j]));
        let v = JointVector::from_fn(|j| used(j, setpoint.velocities[j]));
        let sound = setpoint.joint_count as usize == all
            && q.iter().chain(&v).all(|x| x.is_finite())
            && self.last_deadline_ns.is_none_or(|last| setpoint.deadline_ns > last);
        if !sound {
            self.refused += 1;
            return;
        }
        let (sequence, deadline_ns) = (setpoint.sequence, setpoint.deadline_ns);
        if sequence <= self.last_sequence {
            // Another executor, which counts from 1 again and knows nothing of the first one's.
            self.stop(Stop::Ceased);
            self.known.clear();
        }
        self.last_deadline_ns = Some(deadline_ns);
        self.last_sequence = sequence;
        if setpoint.disable != 0 {
            self.let_go();
        } else if self.following.is_some() {
            self.follow(sequence, deadline_ns, q, v);
        } else {
            self.begin(setpoint, &q, measured);
        }
        if let Some(following) = &self.following {
            if self.known.len() == REMEMBERED {
                self.known.pop_front();
            }
            self.known.push_back((sequence, deadline_ns, following.playout.at_ns()));
        }
    }

    /// Begins to follow with this setpoint, if it is where the arm is, which has come to rest.
    /// While the arm follows nothing, the executor's setpoints follow the arm.
    fn begin(&mut self, setpoint: &Setpoint, q: &JointVector, measured: &JointVector) {
        let turns = self.rules.continuous.turns_to(q, measured);
        let q = &(*q + turns);
        // A position that is no number is not near.
        let near = |j: usize| (q[j] - measured[j]).abs() <= self.rules.start_tolerance;
        let far = !(0..self.rules.joints).all(near);
        self.refused += u64::from(far);
        if far {
            self.stopped.get_or_insert(Stop::Far);
        }
        let playout = Playout::begin(self.rules.delay_ns, setpoint.sequence, setpoint.deadline_ns);
        let moves = self.rest.is_some_and(|(_, at_ns)| at_ns > playout.at_ns());
        // In Init the executor waits for the answer that only what is followed has.
        if far || moves || setpoint.mode == Mode::Fault.wire() {
            return;
        }
        // The controller goes on from its own setpoint, not from where the arm is.
        let from = self.rest.map_or(*measured, |(rest, _)| rest);
        let at_ns = playout.at_ns();
        self.waiting.push_back(Due { at_ns, q: from, v: JointVector::ZERO });
        self.following = Some(Following {
            playout,
            sent_ns: at_ns,
            began_ns: at_ns,
            last: (*q, JointVector::ZERO),
            turns,
            offset: from - *q,
        });
        self.stopped = None;
        self.stands = false;
    }

    fn follow(&mut self, sequence: u64, deadline_ns: u64, q: JointVector, v: JointVector) {
        let Some(f) = &mut self.following else { return };
        let q = q + f.turns;
        let still = v == JointVector::ZERO && f.last == (q, v);
        f.last = (q, v);
        f.playout.advance(sequence, deadline_ns, still);
        let (at_ns, pace) = (f.playout.at_ns(), f.playout.pace());
        let u = ((at_ns - f.began_ns) as f64 * 1e-9 / FADE).min(1.0);
        let (fade, slope) = (1.0 - u * u * (3.0 - 2.0 * u), -6.0 * u * (1.0 - u) / FADE);
        self.waiting.push_back(Due {
            at_ns,
            q: JointVector::from_fn(|j| q[j] + fade * f.offset[j]),
            v: JointVector::from_fn(|j| v[j] * pace + slope * f.offset[j]),
        });
    }

    /// Forgets what the arm was to do, because its motors are off: it follows again only what
    /// begins where it is.
    pub fn let_go(&mut self) {
        self.waiting.clear();
        self.ahead.clear();
        self.following = None;
        self.rest = None;
    }

    /// Follows no longer: the arm comes to rest on the last message.
    fn stop(&mut self, why: Stop) {
        self.waiting.clear();
        self.ahead.clear();
        if self.following.take().is_some() {
            self.stopped = Some(why);
        }
    }

    /// Whether setpoints are being followed.
    #[must_use]
    pub fn follows(&self) -> bool {
        self.following.is_some()
    }

    /// Why no setpoint is followed: the arm then comes to rest on the last message, and stays
    /// there until it follows again.
    pub fn stopped(&mut self, now_ns: u64) -> Option<Stop> {
        let ceased = self
            .last_deadline_ns
            .is_some_and(|last| now_ns > last.saturating_add(self.rules.timeout_ns));
        if ceased && self.waiting.is_empty() {
            self.stop(Stop::Ceased);
        }
        if ceased { Some(Stop::Ceased) } else { self.stopped }
    }

    /// The newest setpoint that was in force at a moment, with its deadline.
    #[must_use]
    pub fn in_force(&self, at_ns: u64) -> Option<(u64, u64)> {
        let (sequence, deadline, _) = self.known.iter().rev().find(|(_, _, at)| *at <= at_ns)?;
        Some((*sequence, *deadline))
    }

    /// The next message; `None` where nothing is to be sent.
    pub fn message(&mut self, now_ns: u64) -> Option<Message> {
        let f = self.following.as_mut()?;
        let last = *self.waiting.back()?;
        let from = if f.sent_ns == f.began_ns {
            let soonest = now_ns + TRANSIT_NS + 2 * EARLY_NS;
            f.began_ns.saturating_sub(BLEND_NS).max(soonest).min(f.began_ns)
        } else {
            f.sent_ns
        };
        let mut start_ns = from.saturating_sub(EARLY_NS);
        if start_ns <= now_ns + TRANSIT_NS {
            // Too late to splice: the arm is already slowing down on the last message. A stamp in
            // the past would make it jump.
            self.late += 1;
            self.stop(Stop::Late);
            return None;
        }
        f.sent_ns = last.at_ns;
        let stands = last.v == JointVector::ZERO && self.waiting.iter().all(|due| due.q == last.q);
        if stands && self.stands && self.rest.is_some_and(|(rest, _)| rest == last.q) {
            self.waiting.clear();
            // The next message goes on from there.
            self.ahead.clear();
            self.ahead.push_back(last);
            return None;
        }
        let mut sent = Vec::with_capacity(self.waiting.len() / 4 + 2);
        let mut before = from;
        for due in self.waiting.drain(..) {
            if due.at_ns >= before + SPACING_NS || due.at_ns == last.at_ns {
                sent.push(due);
                before = due.at_ns;
            }
        }
        if self.rules.takeover == Takeover::AtArrival {
            // Its first point lies on the way that the controller is on: wherever it is there when
            // the message comes, it goes on as it did.
            let soon = now_ns + TRANSIT_NS;
            self.ahead.retain(|due| due.at_ns > soon);
            start_ns = self.ahead.front().map_or(start_ns, |first| first.at_ns - EARLY_NS);
            self.ahead.extend(sent);
            sent = self.ahead.iter().copied().collect();
        }
        let after = |due: Due| Point { after_ns: due.at_ns - start_ns, q: due.q, v: due.v };
        let mut points: Vec<Point> = sent.into_iter().map(after).collect();
        let fastest = last.v.iter().map(|v| v.abs()).fold(0.0, f64::max);
        let stop = (fastest / self.rules.stop_acceleration).max(SHORTEST_STOP);
        let rest = JointVector::from_fn(|j| last.q[j] + 0.5 * stop * last.v[j]);
        let rest_ns = last.at_ns + (stop * 1e9) as u64;
        points.push(Point { after_ns: rest_ns - start_ns, q: rest, v: JointVector::ZERO });
        self.rest = Some((rest, rest_ns));
        self.stands = fastest == 0.0;
        self.made += 1;
        Some(Message { sequence: self.made, start_ns, points })
    }
}

#[cfg(test)]
mod tests;
