//! Goals of a FollowJointTrajectory action and what became of them: each that was accepted has one
//! end, which is told to whoever asks, also later. No ROS in it.

use std::time::{Duration, Instant};

use crate::messages::FollowResult;

/// How long an end is kept for those who have not asked yet.
const KEPT: Duration = Duration::from_secs(60);

/// How far a goal is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// Its plan is executed.
    Executing,
    /// It was asked to be cancelled.
    Canceling,
    /// As planned.
    Succeeded,
    /// At its sender's wish.
    Canceled,
    /// Early.
    Aborted,
}

impl Status {
    /// Whether it has an end.
    pub fn is_end(self) -> bool {
        !matches!(self, Self::Executing | Self::Canceling)
    }
}

/// A goal that was accepted.
#[derive(Clone, Debug)]
pub struct Goal<Id, Asker> {
    pub id: Id,
    pub status: Status,
    pub result: FollowResult,
    /// Who waits for its end.
    askers: Vec<Asker>,
    ended: Option<Instant>,
}

/// All of them.
#[derive(Clone, Debug)]
pub struct Goals<Id, Asker> {
    all: Vec<Goal<Id, Asker>>,
}

/// Who asked for a goal's end, and the goal that has one.
type Told<'a, Id, Asker> = (Asker, &'a Goal<Id, Asker>);

impl<Id, Asker> Default for Goals<Id, Asker> {
    fn default() -> Self {
        Self { all: Vec::new() }
    }
}

impl<Id: Copy + PartialEq, Asker> Goals<Id, Asker> {
    /// Whether an id is in use.
    pub fn knows(&self, id: Id) -> bool {
        self.all.iter().any(|goal| goal.id == id)
    }

    /// Takes an accepted goal in, and forgets those whose end is old.
    pub fn accept(&mut self, id: Id, now: Instant) {
        self.all.retain(|goal| goal.ended.is_none_or(|at| now.duration_since(at) < KEPT));
        let result = FollowResult::default();
        self.all.push(Goal {
            id,
            status: Status::Executing,
            result,
            askers: Vec::new(),
            ended: None,
        });
    }

    /// Notes that a goal is to be cancelled; its status before that, `None` for one that is not
    /// known.
    pub fn cancel(&mut self, id: Id) -> Option<Status> {
        let goal = self.all.iter_mut().find(|goal| goal.id == id)?;
        let before = goal.status;
        if before == Status::Executing {
            goal.status = Status::Canceling;
        }
        Some(before)
    }

    /// Those that have no end yet.
    pub fn open(&self) -> impl Iterator<Item = Id> {
        self.all.iter().filter(|goal| !goal.status.is_end()).map(|goal| goal.id)
    }

    /// A goal has ended; who is to be told. The first end counts.
    pub fn end(
        &mut self,
        id: Id,
        status: Status,
        result: FollowResult,
        now: Instant,
    ) -> Vec<Asker> {
        match self.all.iter_mut().find(|goal| goal.id == id) {
            Some(goal) if !goal.status.is_end() => {
                goal.status = match (goal.status, status) {
                    // One that was asked to be cancelled ends cancelled, however it was stopped.
                    (Status::Canceling, Status::Aborted) => Status::Canceled,
                    (_, status) => status,
                };
                goal.result = result;
                goal.ended = Some(now);
                std::mem::take(&mut goal.askers)
            }
            _ => Vec::new(),
        }
    }

    /// Somebody asks for a goal's end: told at once where it has one, else then. Given back with its
    /// goal where it can be told; `Err` where the goal is not known.
    pub fn ask(&mut self, id: Id, asker: Asker) -> Result<Option<Told<'_, Id, Asker>>, Asker> {
        match self.all.iter_mut().find(|goal| goal.id == id) {
            None => Err(asker),
            Some(goal) if goal.status.is_end() => Ok(Some((asker, goal))),
            Some(goal) => {
                goal.askers.push(asker);
                Ok(None)
            }
        }
    }

    /// A goal.
    pub fn get(&self, id: Id) -> Option<&Goal<Id, Asker>> {
        self.all.iter().find(|goal| goal.id == id)
    }

    /// All that are known.
    pub fn iter(&self) -> impl Iterator<Item = &Goal<Id, Asker>> {
        self.all.iter()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn why(code: i32) -> FollowResult {
        FollowResult { error_code: code, error_string: String::new() }
    }

    #[test]
    fn each_goal_has_one_end_whoever_asks_and_whenever() {
        let (mut goals, now) = (Goals::<u8, &str>::default(), Instant::now());
        goals.accept(1, now);
        assert!(matches!(goals.ask(1, "early"), Ok(None)) && goals.ask(2, "nobody").is_err());
        assert_eq!(goals.end(1, Status::Succeeded, why(0), now), ["early"]);
        // Neither a second end nor a cancel changes it.
        assert!(goals.end(1, Status::Aborted, why(-1), now).is_empty());
        assert_eq!(goals.cancel(1), Some(Status::Succeeded));
        let late = goals.ask(1, "late").expect("known").expect("ended");
        assert_eq!(
            (late.0, late.1.status, late.1.result.error_code),
            ("late", Status::Succeeded, 0)
        );
    }

    #[test]
    fn what_was_cancelled_ends_cancelled_unless_it_was_there_first() {
        let (mut goals, now) = (Goals::<u8, ()>::default(), Instant::now());
        for (id, end, found) in
            [(1, Status::Aborted, Status::Canceled), (2, Status::Succeeded, Status::Succeeded)]
        {
            goals.accept(id, now);
            assert_eq!(goals.cancel(id), Some(Status::Executing));
            assert_eq!(goals.cancel(id), Some(Status::Canceling));
            goals.end(id, end, why(0), now);
            assert_eq!(goals.get(id).map(|goal| goal.status), Some(found));
        }
        assert_eq!(goals.cancel(9), None);
    }

    #[test]
    fn old_ends_are_forgotten_and_open_goals_are_not() {
        let (mut goals, now) = (Goals::<u8, ()>::default(), Instant::now());
        goals.accept(1, now);
        goals.accept(2, now);
        goals.end(1, Status::Aborted, why(-1), now);
        goals.accept(3, now + KEPT);
        assert!(!goals.knows(1) && goals.knows(2) && goals.open().eq([2, 3]));
    }
}
