//! Plans that are to be stopped: asked for until the executor has done so. No ROS in it.

use std::time::{Duration, Instant};

use nullsweep_ipc_types::PlanId;

/// How long an answer is waited for until it is asked for again.
const PATIENCE: Duration = Duration::from_secs(5);
/// Time to the next question where the last one could not be asked.
const AGAIN: Duration = Duration::from_millis(20);
/// Time to the next question where the last one was answered and the plan goes on: a stop may take
/// so long.
const ANSWERED: Duration = Duration::from_millis(500);
/// After so long a plan of which nothing was heard holds up nothing any more. It is stopped all the
/// same should it come.
const UNHEARD: Duration = Duration::from_secs(10);
/// Plans that are remembered.
const REMEMBERED: usize = 64;

/// What became of a question.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// None yet.
    None,
    /// It was not taken.
    Busy,
    /// It was taken.
    Taken,
}

/// A plan that is to be stopped.
#[derive(Clone, Copy, Debug)]
struct Wanted {
    plan: PlanId,
    since: Instant,
    /// When the executor accepted it, by its own stamp. \[ns\]
    accepted_ns: Option<u64>,
}

/// All of them, and what is asked. A stop is one for whatever the arm does, so it is asked for only
/// where one of these plans is known to be what it does.
#[derive(Debug)]
pub struct Brake<Asked> {
    plans: Vec<Wanted>,
    asked: Option<(Instant, Asked)>,
    next: Option<Instant>,
}

impl<Asked> Default for Brake<Asked> {
    fn default() -> Self {
        Self { plans: Vec::new(), asked: None, next: None }
    }
}

impl<Asked> Brake<Asked> {
    /// Has a plan stopped, now or once the executor has it. `accepted_ns`: when it accepted it, if
    /// it has.
    pub fn want(&mut self, plan: PlanId, accepted_ns: Option<u64>, now: Instant) {
        if !self.wants(plan) {
            if self.plans.len() == REMEMBERED {
                self.plans.remove(0);
            }
            self.plans.push(Wanted { plan, since: now, accepted_ns });
            self.next = None;
        }
    }

    /// Whether a plan is to be stopped.
    pub fn wants(&self, plan: PlanId) -> bool {
        self.plans.iter().any(|p| p.plan == plan)
    }

    /// The executor has accepted a plan.
    pub fn accepted(&mut self, plan: PlanId, stamp_ns: u64) {
        if let Some(wanted) = self.plans.iter_mut().find(|p| p.plan == plan) {
            wanted.accepted_ns = Some(stamp_ns);
            self.next = None;
        }
    }

    /// A plan has ended, or was rejected.
    pub fn over(&mut self, plan: PlanId) {
        self.plans.retain(|p| p.plan != plan);
    }

    /// Whether a plan may still come that is to be stopped: a stop for it would end another one too.
    pub fn is_open(&self, now: Instant) -> bool {
        let open = |p: &Wanted| p.accepted_ns.is_none() && now.duration_since(p.since) < UNHEARD;
        self.plans.iter().any(open)
    }

    /// Asks, if there is a reason. `tells`: the plan that the newest telemetry names, and its stamp
    /// \[ns\].
    pub fn round(
        &mut self,
        tells: Option<(PlanId, u64)>,
        now: Instant,
        ask: impl FnOnce() -> Option<Asked>,
        answer: impl FnOnce(&Asked) -> Answer,
    ) {
        if let Some((at, asked)) = &self.asked {
            match answer(asked) {
                Answer::None if now.duration_since(*at) < PATIENCE => return,
                Answer::None | Answer::Busy => self.next = None,
                Answer::Taken => self.next = Some(now + ANSWERED),
            }
            self.asked = None;
        }
        let runs = |p: &Wanted| {
            let named = tells.is_some_and(|(plan, _)| plan == p.plan);
            // Or the telemetry is of before.
            named || p.accepted_ns.is_some_and(|at| tells.is_none_or(|(_, stamp)| stamp <= at))
        };
        if self.plans.iter().any(runs) && self.next.is_none_or(|next| now >= next) {
            self.asked = ask().map(|asked| (now, asked));
            self.next = self.asked.is_none().then_some(now + AGAIN);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(number: u64) -> PlanId {
        PlanId { epoch: 1, number }
    }

    /// A brake, and whether it asks in a round after so many ms.
    struct Trial {
        brake: Brake<u32>,
        began: Instant,
        count: u32,
    }

    impl Trial {
        fn new() -> Self {
            Self { brake: Brake::default(), began: Instant::now(), count: 0 }
        }

        fn at(&self, ms: u64) -> Instant {
            self.began + Duration::from_millis(ms)
        }

        fn asks(
            &mut self,
            ms: u64,
            tells: Option<(PlanId, u64)>,
            can: bool,
            answer: Answer,
        ) -> bool {
            let (before, now) = (self.count, self.at(ms));
            let count = &mut self.count;
            let ask = || {
                *count += 1;
                can.then_some(*count)
            };
            self.brake.round(tells, now, ask, |_| answer);
            self.count > before
        }
    }

    #[test]
    fn a_plan_is_stopped_once_the_executor_has_it() {
        let mut trial = Trial::new();
        trial.brake.want(plan(1), None, trial.at(0));
        // Not admitted yet, and what runs is somebody else's.
        assert!(!trial.asks(1, None, true, Answer::None));
        assert!(!trial.asks(2, Some((plan(7), 50)), true, Answer::None));
        assert!(trial.brake.is_open(trial.at(2)) && trial.brake.wants(plan(1)));
        // Told of before the telemetry names it.
        trial.brake.accepted(plan(1), 60);
        assert!(trial.asks(3, Some((PlanId::NONE, 50)), true, Answer::None));
        assert!(!trial.asks(4, Some((plan(1), 70)), true, Answer::None));
        assert!(!trial.asks(5, Some((plan(1), 71)), true, Answer::Taken));
        // A stop takes a while; a plan that goes on for longer is asked for again.
        assert!(!trial.asks(400, Some((plan(1), 72)), true, Answer::None));
        assert!(trial.asks(506, Some((plan(1), 73)), true, Answer::None));
        trial.brake.over(plan(1));
        assert!(!trial.asks(9000, Some((plan(1), 74)), true, Answer::None));
        assert!(!trial.brake.is_open(trial.at(9000)));
    }

    /// One that was given up may run all the same.
    #[test]
    fn an_orphan_is_stopped_whenever_it_shows() {
        let mut trial = Trial::new();
        trial.brake.want(plan(1), None, trial.at(0));
        assert!(trial.brake.is_open(trial.at(9_000)) && !trial.brake.is_open(trial.at(11_000)));
        assert!(!trial.asks(20_000, Some((plan(2), 1)), true, Answer::None));
        assert!(trial.asks(20_001, Some((plan(1), 2)), true, Answer::None));
    }

    #[test]
    fn what_could_not_be_asked_or_was_not_taken_is_asked_again() {
        let mut trial = Trial::new();
        trial.brake.want(plan(1), Some(5), trial.at(0));
        let tells = Some((plan(1), 10));
        assert!(trial.asks(1, tells, false, Answer::None));
        assert!(!trial.asks(2, tells, false, Answer::None));
        assert!(trial.asks(22, tells, true, Answer::None));
        // Busy: at once. Never answered: after a while.
        assert!(trial.asks(23, tells, true, Answer::Busy));
        assert!(!trial.asks(5_000, tells, true, Answer::None));
        assert!(trial.asks(5_024, tells, true, Answer::None));
        // What it does now is another's, and its end was not heard.
        assert!(!trial.asks(12_000, Some((plan(3), 12)), true, Answer::None));
    }
}
