//! Faults that the mock endpoint plays on request: `halt@3s`, `stale@2s+300ms`.

use std::str::FromStr;
use std::time::Duration;

/// What goes wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultKind {
    /// The motors halt, as by the run stop: brakes on, status bit set.
    Halt,
    /// The endpoint reports an error.
    Error,
    /// The joints are no longer calibrated.
    Uncalibrated,
    /// No state is sent; from `0s` on, an endpoint that comes late.
    Stale,
    /// States go on, but the joints in them stand still.
    Freeze,
    /// Every other state is lost.
    Drop,
    /// States are 10 ms old when they are sent.
    Delay,
    /// The first joint's position is not a number.
    Nan,
    /// The first joint's encoder is off by [`FaultKind::JUMP`].
    Jump,
    /// States report one joint too few.
    Count,
    /// Setpoints are read and judged, but the arm does not follow them.
    Deaf,
    /// The link to the motors is cut: nothing reaches them, their encoders stand, and after
    /// [`FaultKind::LINK_TIMEOUT`] they halt by themselves until it is back.
    Link,
    /// States name no setpoint that was in force.
    Unanswered,
    /// States name setpoint 1 as the one in force, as of a process that reads no more.
    Stuck,
    /// States name a setpoint that was never sent.
    Ahead,
    /// States are stamped by another clock, which is far ahead as `CLOCK_REALTIME` is.
    Clock,
}

impl FaultKind {
    /// How far the encoder jumps: well beyond any following error. \[rad\]
    pub const JUMP: f64 = 0.3;
    /// How long the PR2's motors stay on without communication.
    pub const LINK_TIMEOUT: Duration = Duration::from_millis(100);
    /// How far the other clock is ahead.
    pub const CLOCK_AHEAD: Duration = Duration::from_secs(1_764_000_000);

    /// Every kind with its name on the command line.
    pub const NAMES: [(Self, &'static str); 16] = [
        (Self::Halt, "halt"),
        (Self::Error, "error"),
        (Self::Uncalibrated, "uncalibrated"),
        (Self::Stale, "stale"),
        (Self::Freeze, "freeze"),
        (Self::Drop, "drop"),
        (Self::Delay, "delay"),
        (Self::Nan, "nan"),
        (Self::Jump, "jump"),
        (Self::Count, "count"),
        (Self::Deaf, "deaf"),
        (Self::Link, "link"),
        (Self::Unanswered, "unanswered"),
        (Self::Stuck, "stuck"),
        (Self::Ahead, "ahead"),
        (Self::Clock, "clock"),
    ];

    /// Its name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        Self::NAMES.iter().find(|(kind, _)| *kind == self).map_or("?", |(_, name)| name)
    }
}

/// A fault, when it begins and how long it lasts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaultAt {
    /// What goes wrong.
    pub kind: FaultKind,
    /// When, counted from the mock's start.
    pub start: Duration,
    /// For how long; `None` for good.
    pub length: Option<Duration>,
}

impl FaultAt {
    /// Whether it makes a kind of fault show at a time since the mock's start.
    #[must_use]
    pub fn shows(&self, kind: FaultKind, since_start: Duration) -> bool {
        let Some(age) = since_start.checked_sub(self.start) else { return false };
        let caused = match (self.kind, kind) {
            (FaultKind::Link, FaultKind::Deaf | FaultKind::Freeze) => true,
            (FaultKind::Link, FaultKind::Halt) => age >= FaultKind::LINK_TIMEOUT,
            (own, kind) => own == kind,
        };
        caused && self.length.is_none_or(|length| age < length)
    }
}

/// A fault that could not be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FaultSyntaxError {
    /// There is no `@`.
    #[error("`{0}` names no time; write KIND@START[+LENGTH], as in halt@3s+500ms")]
    NoTime(String),
    /// No such fault.
    #[error("there is no fault `{0}`; known are {list}", list = FaultKind::NAMES.map(|(_, n)| n).join(", "))]
    UnknownKind(String),
    /// Not a time such as `3s` or `250ms`.
    #[error("`{0}` is no time; write 3s, 0.5s or 250ms")]
    BadTime(String),
}

impl FromStr for FaultAt {
    type Err = FaultSyntaxError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let (name, times) =
            text.split_once('@').ok_or_else(|| FaultSyntaxError::NoTime(text.into()))?;
        let kind = FaultKind::NAMES
            .iter()
            .find(|(_, known)| *known == name)
            .map(|(kind, _)| *kind)
            .ok_or_else(|| FaultSyntaxError::UnknownKind(name.into()))?;
        let (start, length) = match times.split_once('+') {
            Some((start, length)) => (start, Some(duration(length)?)),
            None => (times, None),
        };
        Ok(Self { kind, start: duration(start)?, length })
    }
}

fn duration(text: &str) -> Result<Duration, FaultSyntaxError> {
    let bad = || FaultSyntaxError::BadTime(text.into());
    let (number, unit) = match text.strip_suffix("ms") {
        Some(number) => (number, 1e-3),
        None => (text.strip_suffix('s').ok_or_else(bad)?, 1.0),
    };
    let value: f64 = number.parse().map_err(|_| bad())?;
    Duration::try_from_secs_f64(value * unit).map_err(|_| bad())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_read() {
        for (kind, name) in FaultKind::NAMES {
            let fault: FaultAt = format!("{name}@1.5s").parse().expect("valid");
            assert_eq!((fault.kind, fault.start, fault.length), (kind, ms(1500), None));
            assert!(fault.shows(kind, ms(9000)) && !fault.shows(kind, ms(1499)));
        }
        let fault: FaultAt = "stale@2s+300ms".parse().expect("valid");
        let shows = |at| fault.shows(FaultKind::Stale, ms(at));
        assert_eq!([1999, 2000, 2299, 2300].map(shows), [false, true, true, false]);
        assert!(!fault.shows(FaultKind::Halt, ms(2100)));
    }

    #[test]
    fn motors_without_a_link_halt_after_a_while() {
        let fault: FaultAt = "link@2s+300ms".parse().expect("valid");
        for kind in [FaultKind::Freeze, FaultKind::Deaf] {
            assert_eq!(
                [1999, 2000, 2300].map(|at| fault.shows(kind, ms(at))),
                [false, true, false]
            );
        }
        let halts = |at| fault.shows(FaultKind::Halt, ms(at));
        assert_eq!([2099, 2100, 2299, 2300].map(halts), [false, true, true, false]);
    }

    #[test]
    fn nonsense_is_refused_with_its_reason() {
        for (text, says) in [
            ("halt", "names no time"),
            ("smoke@3s", "there is no fault `smoke`; known are halt, error"),
            ("halt@3", "`3` is no time"),
            ("halt@-3s", "`-3s` is no time"),
            ("halt@infs", "is no time"),
            ("halt@1s+x", "`x` is no time"),
        ] {
            let error = text.parse::<FaultAt>().expect_err(text);
            assert!(error.to_string().contains(says), "{text}: {error}");
        }
    }

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }
}
