//! Messages of joint states, by name, to the executor's states.

use nullsweep_ipc_types::{JointStates, MAX_HELD_JOINTS};
use nullsweep_robot::{Arm, JointVector};

/// Joint states older than this when they arrive are not passed on: the robot's clock and this
/// one's disagree, or the network stalls. \[ns\]
const OLD_NS: u64 = 500_000_000;
/// How far a stamp may be ahead of this machine's clock. \[ns\]
const AHEAD_NS: u64 = 50_000_000;
/// `/joint_states` comes at 50 Hz and more; after so long without a usable one it counts as lost.
/// \[ns\]
const UNHEARD_NS: u64 = 200_000_000;
/// After so long without a word of it nobody knows where a held joint stands. Grippers and the like
/// tell of theirs less often than an arm. \[ns\]
const FORGOTTEN_NS: u64 = 3_000_000_000;
/// Least time between two lines about messages that cannot be used. \[ns\]
const TELL_NS: u64 = 2_000_000_000;

/// A message of joint states.
#[derive(Clone, Copy, Debug)]
pub struct Heard<'a> {
    /// When it was measured, on `CLOCK_MONOTONIC`. \[ns\]
    pub stamp_ns: u64,
    /// When it came, on the same clock. \[ns\]
    pub at_ns: u64,
    /// Names of joints.
    pub names: &'a [String],
    /// One for each name. \[rad\] or \[m\]
    pub positions: &'a [f64],
    /// One for each name, or none. \[rad/s\] or \[m/s\]
    pub velocities: &'a [f64],
    /// One for each name, or none. \[N·m\] or \[N\]
    pub efforts: &'a [f64],
}

/// Why a message of joint states cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum HeardError {
    /// It has some of the arm's joints, and not this one.
    #[error("joint {joint} is not in it")]
    Missing {
        /// As the messages name it.
        joint: String,
    },
    /// No message so far had this joint, which plans take as fixed.
    #[error("no message has told where joint {joint} stands, which plans take as fixed")]
    Unknown {
        /// As the messages name it.
        joint: String,
    },
    /// It was told once and is not any more.
    #[error(
        "nothing has told for {seconds:.1} s where joint {joint} stands, which plans take as fixed: \
         does its driver run?"
    )]
    Forgotten {
        /// As the messages name it.
        joint: String,
        /// Since it was last told. \[s\]
        seconds: f64,
    },
    /// It has fewer positions than names.
    #[error("it has {positions} positions for {names} names")]
    Short {
        /// Names.
        names: usize,
        /// Positions.
        positions: usize,
    },
    /// A position is NaN or infinite.
    #[error("joint {joint} is told to be at {position}")]
    NotFinite {
        /// As the messages name it.
        joint: String,
        /// As it was told.
        position: f64,
    },
    /// Its stamp is too old.
    #[error("its stamp is {seconds:.2} s old: set both machines' clocks by NTP")]
    Old {
        /// How old. \[s\]
        seconds: f64,
    },
    /// Its stamp is ahead of now.
    #[error("its stamp is {seconds:.2} s ahead: set both machines' clocks by NTP")]
    Ahead {
        /// By how much. \[s\]
        seconds: f64,
    },
    /// The robot has more joints than a state can tell of.
    #[error("{count} joints are held, the wire takes {MAX_HELD_JOINTS}")]
    TooMany {
        /// Joints outside the arm.
        count: usize,
    },
}

/// What listens to joint states.
#[derive(Clone, Debug)]
pub struct Ear {
    names: Vec<String>,
    /// Joints outside the arm, where they were last told to stand, and when that came. \[ns\]
    held: Vec<(String, Option<(f64, u64)>)>,
    measured: Option<JointVector>,
    /// When the last usable one came. \[ns\]
    heard_ns: u64,
    sequence: u64,
    warned: bool,
    /// When a message was last told to be of no use. \[ns\]
    warned_ns: Option<u64>,
}

impl Ear {
    /// Listens for an arm's joints, which the messages name as `rename` says.
    pub fn new(arm: &Arm, rename: impl Fn(&str) -> String) -> Self {
        Self {
            names: arm.joint_names().iter().map(|name| rename(name)).collect(),
            held: arm.held_joints().iter().map(|h| (rename(&h.name), None)).collect(),
            measured: None,
            heard_ns: 0,
            sequence: 0,
            warned: false,
            warned_ns: None,
        }
    }

    /// Where the arm was last measured. \[rad\] or \[m\]
    #[must_use]
    pub fn measured(&self) -> Option<JointVector> {
        self.measured
    }

    /// Whether usable messages come.
    #[must_use]
    pub fn hears(&self, now_ns: u64) -> bool {
        now_ns.saturating_sub(self.heard_ns) <= UNHEARD_NS
    }

    /// How many usable ones came.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.sequence
    }

    /// The arm's joints as the messages name them.
    #[must_use]
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The state; `None` for a message without the arm's joints, or one that cannot be used: the
    /// first such one is told, where they come in turns with others not each of them.
    pub fn hear(&mut self, heard: &Heard<'_>) -> Option<JointStates> {
        match self.read(heard) {
            Ok(state) => {
                self.warned &= state.is_none();
                state
            }
            Err(why) => {
                if self.is_news(heard.at_ns) {
                    tracing::error!("/joint_states cannot be used: {why}");
                }
                None
            }
        }
    }

    /// Whether a message that cannot be used is to be told.
    fn is_news(&mut self, now_ns: u64) -> bool {
        let lately = self.warned_ns.is_some_and(|at| now_ns.saturating_sub(at) < TELL_NS);
        if self.warned || lately {
            return false;
        }
        (self.warned, self.warned_ns) = (true, Some(now_ns));
        true
    }

    /// As [`Self::hear`], with the reason.
    ///
    /// # Errors
    /// [`HeardError`] for a message that cannot be used.
    pub fn read(&mut self, heard: &Heard<'_>) -> Result<Option<JointStates>, HeardError> {
        let Heard { at_ns, names, positions, .. } = *heard;
        if positions.len() < names.len() {
            return Err(HeardError::Short { names: names.len(), positions: positions.len() });
        }
        let find = |name: &String| names.iter().position(|n| n == name);
        let finite = |joint: &String, position: f64| {
            let told = HeardError::NotFinite { joint: joint.clone(), position };
            if position.is_finite() { Ok(position) } else { Err(told) }
        };
        // Others than the arm's driver may tell of grippers and the like, in messages of their own.
        for (name, stands) in &mut self.held {
            if let Some(index) = find(name) {
                *stands = Some((finite(name, positions[index])?, at_ns));
            }
        }
        if !self.names.iter().any(|name| find(name).is_some()) {
            return Ok(None);
        }
        let ahead_ns = heard.stamp_ns.saturating_sub(at_ns);
        if ahead_ns > AHEAD_NS {
            return Err(HeardError::Ahead { seconds: ahead_ns as f64 * 1e-9 });
        }
        let stamp_ns = heard.stamp_ns.min(at_ns);
        if at_ns - stamp_ns > OLD_NS {
            return Err(HeardError::Old { seconds: (at_ns - stamp_ns) as f64 * 1e-9 });
        }
        let mut state = <JointStates as bytemuck::Zeroable>::zeroed();
        for (j, name) in self.names.iter().enumerate() {
            let index = find(name).ok_or_else(|| HeardError::Missing { joint: name.clone() })?;
            state.positions[j] = finite(name, positions[index])?;
            state.velocities[j] = heard.velocities.get(index).copied().unwrap_or(0.0);
            state.efforts[j] = heard.efforts.get(index).copied().unwrap_or(0.0);
        }
        if self.held.len() > MAX_HELD_JOINTS {
            return Err(HeardError::TooMany { count: self.held.len() });
        }
        for (h, (name, stands)) in self.held.iter().enumerate() {
            let (position, told_ns) =
                stands.ok_or_else(|| HeardError::Unknown { joint: name.clone() })?;
            let age_ns = at_ns.saturating_sub(told_ns);
            if age_ns > FORGOTTEN_NS {
                let seconds = age_ns as f64 * 1e-9;
                return Err(HeardError::Forgotten { joint: name.clone(), seconds });
            }
            state.held_positions[h] = position;
        }
        self.heard_ns = at_ns;
        self.sequence += 1;
        state.sequence = self.sequence;
        state.stamp_ns = stamp_ns;
        state.held_count = self.held.len() as u32;
        state.joint_count = self.names.len() as u32;
        self.measured = Some(JointVector::from_fn(|j| state.positions[j]));
        Ok(Some(state))
    }
}

#[cfg(test)]
mod tests {
    use nullsweep_robot::{ArmSpec, Robot, Side};

    use super::*;

    fn ear() -> Ear {
        let arm = Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).expect("an arm");
        Ear::new(&arm, |name| name.replace("r_shoulder_pan_joint", "pan"))
    }

    /// All that is to be told, in an order of its own, with one joint of nobody's.
    fn message(ear: &Ear) -> (Vec<String>, Vec<f64>) {
        let mut names = vec!["wheel".to_string()];
        names.extend(ear.held.iter().map(|(name, _)| name.clone()));
        names.extend(ear.names().iter().rev().cloned());
        let positions = (0..names.len()).map(|i| 0.01 * i as f64).collect();
        (names, positions)
    }

    fn heard<'a>(names: &'a [String], positions: &'a [f64], stamp_ns: u64) -> Heard<'a> {
        let at_ns = 10_000_000_000;
        Heard { stamp_ns, at_ns, names, positions, velocities: &[], efforts: &[] }
    }

    #[test]
    fn joints_are_found_by_their_names() {
        let mut ear = ear();
        let (names, positions) = message(&ear);
        let state =
            ear.read(&heard(&names, &positions, 9_990_000_000)).expect("sound").expect("one");
        assert_eq!((state.sequence, state.joint_count, state.stamp_ns), (1, 7, 9_990_000_000));
        for (j, name) in ear.names().iter().enumerate() {
            let at = names.iter().position(|n| n == name).expect("there");
            assert_eq!(state.positions[j], positions[at], "{name}");
        }
        assert!(ear.names()[0] == "pan" && state.held_count > 0);
        assert!(ear.hears(10_100_000_000) && !ear.hears(10_300_000_000));
        // The stamp of a clock that is a little ahead is not later than now.
        let ahead = heard(&names, &positions, 10_040_000_000);
        let ahead = ear.read(&ahead).expect("sound").expect("one");
        assert_eq!(ahead.stamp_ns, 10_000_000_000);
    }

    #[test]
    fn what_cannot_be_used_says_why() {
        let mut ear = ear();
        let (mut names, mut positions) = message(&ear);
        let old = ear.read(&heard(&names, &positions, 9_400_000_000)).unwrap_err();
        assert_eq!(old.to_string(), "its stamp is 0.60 s old: set both machines' clocks by NTP");
        let ahead = ear.read(&heard(&names, &positions, 10_600_000_000)).unwrap_err();
        assert_eq!(
            ahead.to_string(),
            "its stamp is 0.60 s ahead: set both machines' clocks by NTP"
        );
        let few = ear.read(&heard(&names, &positions[1..], 9_990_000_000)).unwrap_err();
        assert!(matches!(few, HeardError::Short { .. }), "{few}");
        let last = positions.len() - 1;
        positions[last] = f64::NAN;
        let nan = ear.read(&heard(&names, &positions, 9_990_000_000)).unwrap_err();
        assert_eq!(nan.to_string(), "joint pan is told to be at NaN");
        positions[last] = 0.0;
        names[last] = "another".into();
        let missing = ear.read(&heard(&names, &positions, 9_990_000_000)).unwrap_err();
        assert_eq!(missing, HeardError::Missing { joint: "pan".into() });
        assert_eq!(ear.count(), 0);
    }

    /// A gripper's driver tells of its joints by itself, as many do.
    #[test]
    fn held_joints_may_come_in_messages_of_their_own() {
        let mut ear = ear();
        let (names, positions) = message(&ear);
        let split = names.len() - 7;
        let arm = heard(&names[split..], &positions[split..], 9_990_000_000);
        let unknown = ear.read(&arm).unwrap_err();
        assert!(matches!(unknown, HeardError::Unknown { .. }), "{unknown}");
        // Whatever clock it is of: it only says where something stands.
        assert_eq!(ear.read(&heard(&names[..split], &positions[..split], 0)), Ok(None));
        let state = ear.read(&arm).expect("sound").expect("one");
        assert_eq!(state.held_positions[0], positions[1]);
        // A driver that died leaves no place for ever.
        let later = |seconds: u64| {
            let at_ns = 10_000_000_000 + seconds * 1_000_000_000;
            Heard { stamp_ns: at_ns, at_ns, ..arm }
        };
        assert!(matches!(ear.read(&later(3)), Ok(Some(_))));
        let forgotten = ear.read(&later(4)).unwrap_err();
        assert!(matches!(forgotten, HeardError::Forgotten { seconds: 4.0, .. }), "{forgotten}");
        let back =
            Heard { at_ns: later(4).at_ns, ..heard(&names[..split], &positions[..split], 0) };
        assert_eq!(ear.read(&back), Ok(None));
        assert!(matches!(ear.read(&later(5)), Ok(Some(_))));
    }

    /// Two senders of the same joints, one of which has a wrong clock.
    #[test]
    fn what_comes_in_turns_is_not_told_each_time() {
        let mut ear = ear();
        let (names, positions) = message(&ear);
        let mut lines = 0;
        for k in 0..1000u64 {
            let at_ns = 10_000_000_000 + k * 10_000_000;
            let stamp_ns = if k % 2 == 0 { at_ns } else { at_ns - 800_000_000 };
            let heard = Heard { stamp_ns, at_ns, ..heard(&names, &positions, 0) };
            match ear.read(&heard) {
                Ok(_) => ear.warned = false,
                Err(_) => lines += u32::from(ear.is_news(at_ns)),
            }
        }
        assert_eq!(lines, 5);
    }
}
