//! What a screen shows: the newest telemetry, what became of plans, and how it came to that.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use nullsweep_ipc_types::{EventKind, Fault, Mode, PlanEvent, PlanId, Reason, Telemetry};
use nullsweep_robot::Arm;

use crate::admit::Rejection;
use crate::cycle;
use crate::words::Words;

/// Plans whose lengths are kept.
const PLANS: usize = 16;
/// Lines of the log that are kept.
const LINES: usize = 200;
/// Telemetry older than this is of an executor that is gone or stuck: it sends 100 a second.
const STALE: Duration = Duration::from_millis(500);

/// A joint of the arm that is watched.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Joint {
    pub(super) name: String,
    /// Of a position.
    pub(super) unit: &'static str,
    /// Soft limits; infinite without. \[rad\] or \[m\]
    pub(super) limits: (f64, f64),
}

/// Everything that is known.
#[derive(Debug)]
pub(super) struct Board {
    pub(super) robot: String,
    joints: Vec<Joint>,
    words: Words,
    newest: Option<(Telemetry, Instant)>,
    /// Oldest first.
    log: VecDeque<String>,
    /// How the last command was taken.
    pub(super) answer: String,
    /// Why nothing is heard, where that is known.
    pub(super) trouble: Option<String>,
    /// How long plans take at full speed, the newest last. \[s\]
    lengths: VecDeque<(PlanId, f64)>,
    /// Deadlines that the last line says were missed.
    streak: u64,
    seen: Seen,
}

/// What was told of last, so that only changes are logged.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Seen {
    mode: u32,
    fault: u32,
    missed: u64,
    alive: bool,
}

impl Board {
    /// Of an arm.
    pub(super) fn new(robot: &str, arm: &Arm) -> Self {
        let joint = |j: usize| Joint {
            name: arm.joint_names()[j].clone(),
            unit: if arm.is_revolute(j) { "rad" } else { "m" },
            limits: if arm.limits()[j].continuous {
                (f64::NEG_INFINITY, f64::INFINITY)
            } else {
                (arm.limits()[j].lower, arm.limits()[j].upper)
            },
        };
        Self {
            robot: robot.into(),
            joints: (0..arm.dof()).map(joint).collect(),
            words: Words::of(arm, robot),
            newest: None,
            log: VecDeque::with_capacity(LINES),
            answer: String::new(),
            trouble: None,
            lengths: VecDeque::with_capacity(PLANS),
            streak: 0,
            seen: Seen::default(),
        }
    }

    /// The newest telemetry, while an executor is there.
    pub(super) fn telemetry(&self, now: Instant) -> Option<&Telemetry> {
        let (telemetry, at) = self.newest.as_ref()?;
        (now.saturating_duration_since(*at) < STALE).then_some(telemetry)
    }

    /// The joints that telemetry speaks of: an arm of another number has none of these names.
    pub(super) fn joints(&self, telemetry: &Telemetry) -> Vec<Joint> {
        let count = telemetry.joint_count as usize;
        if self.joints.len() == count {
            return self.joints.clone();
        }
        let limits = (f64::NEG_INFINITY, f64::INFINITY);
        let most = count.min(telemetry.commanded.len());
        (0..most).map(|j| Joint { name: format!("joint {j}"), unit: "", limits }).collect()
    }

    /// How long a plan takes at full speed, where its acceptance was heard. \[s\]
    pub(super) fn length(&self, plan: PlanId) -> Option<f64> {
        let known = self.lengths.iter().find(|(id, _)| *id == plan);
        known.map(|(_, length)| *length).filter(|length| *length > 0.0)
    }

    pub(super) fn log(&self) -> impl DoubleEndedIterator<Item = &str> {
        self.log.iter().map(String::as_str)
    }

    /// Takes telemetry in.
    pub(super) fn hear(&mut self, telemetry: Telemetry, now: Instant) {
        let Telemetry { mode, fault, missed_cycles: missed, .. } = telemetry;
        let before = std::mem::replace(&mut self.seen, Seen { mode, fault, missed, alive: true });
        // A new one counts from 0 again.
        let began = !before.alive || missed < before.missed;
        if began {
            self.say("an executor is there".into());
        }
        if began || (mode, fault) != (before.mode, before.fault) {
            let mode = Mode::from_wire(mode).map_or("unknown mode", Mode::text);
            match Fault::from_wire(fault) {
                Some(Fault::None) => self.say(mode.into()),
                Some(fault) => self.say(format!("{mode}: {fault}")),
                None => self.say(format!("{mode}: fault {fault}")),
            }
        }
        if !began && missed > before.missed {
            // One line, however many follow each other.
            let streak = self.streak + missed - before.missed;
            if self.streak > 0 {
                self.log.pop_back();
            }
            self.say(format!("deadlines missed: {streak}"));
            self.streak = streak;
        }
        self.trouble = None;
        self.newest = Some((telemetry, now));
    }

    /// Takes a plan's event in.
    pub(super) fn event(&mut self, event: &PlanEvent) {
        if event.kind == EventKind::Accepted.wire() {
            if self.lengths.len() == PLANS {
                self.lengths.pop_front();
            }
            self.lengths.push_back((event.plan, event.bound));
        }
        let PlanEvent { plan, joint, knot, value, bound, .. } = *event;
        let known = EventKind::from_wire(event.kind).zip(Reason::from_wire(event.reason));
        self.say(match known {
            Some((kind, reason)) => {
                let why = Rejection { reason, joint, knot, value, bound };
                self.words.event(&cycle::Event { plan, kind, why })
            }
            None => format!("plan {plan}: event {}, reason {}", event.kind, event.reason),
        });
    }

    /// Notes once that nothing is heard any more.
    pub(super) fn look(&mut self, now: Instant) {
        if self.seen.alive && self.telemetry(now).is_none() {
            self.seen.alive = false;
            self.say("the executor is silent".into());
        }
    }

    fn say(&mut self, line: String) {
        self.streak = 0;
        if self.log.len() == LINES {
            self.log.pop_front();
        }
        self.log.push_back(line);
    }
}
