//! Exit codes.

use nullsweep_planner::link::publish::PublishError;
use nullsweep_planner::link::replan::ReplanError;

/// Everything went well.
pub const OK: u8 = 0;
/// Bad input, no plan, no executor, a rejection.
pub const FAILED: u8 = 1;
/// The command line was wrong (clap's own code).
pub const USAGE: u8 = 2;
/// A plan breaks a rule; one that was made was not written.
pub const VIOLATIONS: u8 = 3;
/// The executor was lost while its answer or a plan's end was waited for.
pub const LOST: u8 = 4;

/// Jobs are to be done before `join` can go on.
pub const MORE_JOBS: u8 = 5;

/// Nobody reads what is written any more: as a shell tells a signal.
pub(super) const BROKEN_PIPE: i32 = 128 + 13;

/// The command line was wrong in a way that shows only when its files are read.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(super) struct Usage(pub(super) String);

/// The exit code of a command that failed.
pub(super) fn of(error: &anyhow::Error) -> u8 {
    if error.chain().any(|cause| cause.is::<Usage>()) {
        return USAGE;
    }
    let lost = error.chain().any(|cause| {
        let publish = match cause.downcast_ref() {
            Some(ReplanError::Publish(error)) => Some(error),
            _ => cause.downcast_ref(),
        };
        matches!(publish, Some(PublishError::Lost(_)))
    });
    if lost { LOST } else { FAILED }
}

#[cfg(test)]
mod tests {
    use nullsweep_planner::link::{Loss, Lost};

    use super::*;

    #[test]
    fn a_lost_executor_has_a_code_of_its_own() {
        let lost = || PublishError::Lost(Box::new(Lost { loss: Loss::Ended, last: None }));
        assert_eq!(of(&lost().into()), LOST);
        assert_eq!(of(&ReplanError::from(lost()).into()), LOST);
        assert_eq!(of(&anyhow::Error::from(lost()).context("while publishing")), LOST);
        assert_eq!(of(&PublishError::NoTelemetry.into()), FAILED);
        assert_eq!(of(&anyhow::Error::from(Usage("2 of 6".into())).context("--start")), USAGE);
        assert_eq!(of(&ReplanError::from(PublishError::NoTelemetry).into()), FAILED);
    }
}
