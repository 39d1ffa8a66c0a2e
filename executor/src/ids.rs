//! No plan id is admitted twice.

use std::collections::VecDeque;

use nullsweep_ipc_types::{PlanId, Reason};

use crate::admit::Rejection;

/// Ids that are remembered.
const REMEMBERED: usize = 1024;

/// The ids of the newest plans that came with their seal unbroken. Of those that are forgotten the
/// newest epoch is kept: whatever is not newer than that counts as known, so that memory is bounded
/// and still no id is taken twice. A plan is published a moment before it comes, so a new one is
/// refused only if more than 1024 newer ones have come before it.
#[derive(Debug, Default)]
pub struct Ids {
    known: VecDeque<PlanId>,
    forgotten: u64,
}

impl Ids {
    /// Adds to what was found of a plan whether its id is new. Where the message was broken, or from
    /// another time, the id means nothing and is not remembered.
    ///
    /// # Errors
    /// What was found, or that the id came before.
    pub fn judge<T>(&mut self, id: PlanId, found: Result<T, Rejection>) -> Result<T, Rejection> {
        use Reason::{Checksum, Epoch, Malformed};
        if found.as_ref().is_err_and(|why| matches!(why.reason, Checksum | Epoch | Malformed)) {
            return found;
        }
        if id.epoch <= self.forgotten || self.known.contains(&id) {
            return Err(Rejection::new(Reason::Repeated));
        }
        if self.known.len() >= REMEMBERED
            && let Some(oldest) = self.known.pop_front()
        {
            self.forgotten = self.forgotten.max(oldest.epoch);
        }
        self.known.push_back(id);
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn id(epoch: u64, number: u64) -> PlanId {
        PlanId { epoch, number }
    }

    #[test]
    fn an_id_is_new_once() {
        let mut ids = Ids::default();
        let repeated = Err(Rejection::new(Reason::Repeated).reason);
        let mut judge = |id, found: Result<(), Reason>| {
            ids.judge(id, found.map_err(Rejection::new)).map_err(|why| why.reason)
        };
        assert_eq!(judge(id(5, 1), Ok(())), Ok(()));
        assert_eq!(judge(id(5, 1), Ok(())), repeated);
        // Another one of the same moment, and of the same number.
        assert_eq!(judge(id(5, 2), Ok(())), Ok(()));
        assert_eq!(judge(id(6, 1), Ok(())), Ok(()));
        // One that was refused has had its answer, too.
        assert_eq!(judge(id(7, 1), Err(Reason::SoftLimit)), Err(Reason::SoftLimit));
        assert_eq!(judge(id(7, 1), Ok(())), repeated);
        // What is broken says nothing of an id.
        for reason in [Reason::Checksum, Reason::Malformed, Reason::Epoch] {
            assert_eq!(judge(id(8, 1), Err(reason)), Err(reason));
        }
        assert_eq!(judge(id(8, 1), Ok(())), Ok(()));
    }

    #[test]
    fn what_is_forgotten_is_not_taken_again() {
        let mut ids = Ids::default();
        let count = 3 * REMEMBERED as u64;
        for epoch in 1..=count {
            assert!(ids.judge(id(epoch, 1), Ok(())).is_ok());
            assert!(ids.known.len() <= REMEMBERED);
        }
        for epoch in 1..=count {
            let why = ids.judge(id(epoch, 1), Ok(())).unwrap_err();
            assert_eq!(why.reason, Reason::Repeated, "{epoch}");
        }
        assert!(ids.judge(id(count + 1, 1), Ok(())).is_ok());
    }
}
