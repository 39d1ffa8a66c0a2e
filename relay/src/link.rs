//! Whether the robot's end is there, seen from the planners'.

use std::time::{Duration, Instant};

use crate::wire::Pulse;

/// Silence after which the link counts as lost.
const SILENCE: Duration = Duration::from_secs(1);

/// How it stands with the robot's end.
#[derive(Debug, Default)]
pub struct Link {
    /// When it last gave a sign of life, and what that said.
    pulse: Option<(Instant, Pulse)>,
    pub is_up: bool,
    /// The schemas are alike.
    pub greeted: bool,
    /// When it was last greeted.
    pub greeting: Option<Instant>,
    /// When its clock was last asked for.
    pub read: Option<Instant>,
    /// The last event that was heard; none before the first sign of life.
    pub heard: Option<u64>,
    /// Events that were missed are under way.
    pub is_catching_up: bool,
}

impl Link {
    /// What the robot's end last said, while the link stands.
    pub fn pulse(&self) -> Option<Pulse> {
        self.pulse.filter(|_| self.is_up).map(|(_, pulse)| pulse)
    }

    /// Takes in a sign of life; whether it is another end's than the last one.
    pub fn sign(&mut self, pulse: Pulse) -> bool {
        let last = self.pulse.replace((Instant::now(), pulse));
        let is_new = last.is_none_or(|(_, last)| last.began_ns != pulse.began_ns);
        if is_new {
            *self = Self { pulse: self.pulse, is_up: self.is_up, ..Self::default() };
        }
        if !std::mem::replace(&mut self.is_up, true) {
            match last.filter(|_| !is_new) {
                Some((at, _)) => {
                    tracing::info!("the link is back after {:.1} s", at.elapsed().as_secs_f64());
                }
                None => tracing::info!("the robot's end is there"),
            }
        }
        is_new
    }

    /// Looks whether the link is lost.
    pub fn look(&mut self) {
        let silence = self.pulse.map(|(at, _)| at.elapsed()).filter(|_| self.is_up);
        if let Some(silence) = silence.filter(|silence| *silence >= SILENCE) {
            self.is_up = false;
            tracing::warn!(
                "no sign of the robot's end for {:.1} s; its executor goes on as it was told",
                silence.as_secs_f64()
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_silence_is_a_lost_link_and_another_end_begins_anew() {
        let mut link = Link::default();
        let pulse = Pulse { began_ns: 5, entries: 2, executor: 1 };
        assert_eq!(link.pulse(), None);
        assert!(link.sign(pulse), "the first one");
        link.heard = Some(2);
        assert!(!link.sign(Pulse { entries: 3, ..pulse }));
        link.look();
        assert_eq!((link.is_up, link.heard), (true, Some(2)));
        std::thread::sleep(SILENCE);
        link.look();
        assert_eq!((link.is_up, link.pulse()), (false, None));
        assert!(!link.sign(pulse), "it is back");
        assert_eq!((link.is_up, link.heard), (true, Some(2)));
        assert!(link.sign(Pulse { began_ns: 9, ..pulse }), "another one");
        assert_eq!((link.is_up, link.heard, link.greeted), (true, None, false));
    }
}
