//! One system of a test's own: mock, executor and a publisher under one root path.

use nullsweep_ipc_types::ports::PlanPublisher;
use nullsweep_ipc_types::{EventKind, MAX_KNOTS, PlanEvent, PlanId, Reason};
use nullsweep_robot::Arm;
use nullsweep_tests::sketch::Sketch;
use nullsweep_tests::stage::{Process, Stage};
use nullsweep_tests::system::{self, System};
use nullsweep_tests::witness::Witness;
use serde_json::Value;

use crate::common::{right_arm, stage, verdict};

/// The system.
pub(crate) struct Rig {
    // Processes first: they end before their folder goes.
    pub(crate) executor: Process,
    pub(crate) mock: Process,
    pub(crate) witness: Witness,
    pub(crate) publisher: PlanPublisher,
    pub(crate) arm: Arm,
    pub(crate) stage: Stage,
}

/// Mock and executor that hold the arm. A loaded machine may stall a process for longer than a
/// robot would bear, and must not look like a broken one.
pub(crate) fn start(stage: &Stage, mock: &[&str]) -> System {
    let mock = ["--timeout", "500"].iter().chain(mock);
    System::start(stage, mock, EXECUTOR_PATIENCE).unwrap_or_else(|e| panic!("{e:#}"))
}

/// An executor in a dead one's place.
pub(crate) fn start_executor(stage: &Stage, name: &str) -> Process {
    system::start_executor(stage, name, EXECUTOR_PATIENCE).expect("the executor starts")
}

const EXECUTOR_PATIENCE: [&str; 8] =
    ["--stale-ms", "500", "--lost-ms", "1500", "--min-rate", "0.01", "--spin-us", "0"];

impl Rig {
    /// Starts mock and executor and waits until the arm is held.
    pub(crate) fn start() -> Self {
        let stage = stage();
        let arm = right_arm();
        let System { endpoint: mock, executor, witness, ipc } = start(&stage, &[]);
        let publisher = ipc.plan_publisher(MAX_KNOTS).expect("the test can publish");
        Self { executor, mock, witness, publisher, arm, stage }
    }

    /// Swings from home and back: about `seconds` long.
    pub(crate) fn swings(&self, seconds: f64) -> Sketch {
        let speed = 0.1;
        let once = Sketch::swings(&self.arm, &self.arm.home(), 1, 0.15, speed);
        let count = (seconds / once.seconds()).ceil() as usize;
        Sketch::swings(&self.arm, &self.arm.home(), count, 0.15, speed)
    }

    pub(crate) fn publish(&mut self, sketch: &Sketch) -> PlanId {
        self.publisher.publish(&sketch.header, &sketch.knots).expect("an executor is there")
    }

    /// Publishes and waits until the plan moves the arm.
    pub(crate) fn run(&mut self, sketch: &Sketch) -> PlanId {
        let plan = self.publish(sketch);
        let event = self.witness.admission(plan).expect("an answer");
        assert_eq!(event.kind, EventKind::Accepted.wire(), "{}", describe(&event));
        self.witness.event(plan, &[EventKind::Started]).expect("it starts");
        plan
    }

    /// Waits for the end of a plan and asserts which it is.
    pub(crate) fn ends(&mut self, plan: PlanId, kind: EventKind) -> PlanEvent {
        let event = self.witness.end(plan).expect("an end");
        assert_eq!(event.kind, kind.wire(), "{}", describe(&event));
        event
    }

    /// Ends the mock and gives what it found, having asserted that nothing was wrong and that
    /// every accepted plan had exactly one end.
    pub(crate) fn verdict(mut self) -> Value {
        self.witness.look().expect("events");
        for event in self.witness.events() {
            assert_eq!(self.ends_of(event.plan), self.acceptances_of(event.plan), "{}", event.plan);
        }
        let found = verdict(&self.stage, &mut self.mock);
        assert_eq!(found["violations"], 0, "{found:#}");
        found
    }

    fn ends_of(&self, plan: PlanId) -> usize {
        let ends = [EventKind::Finished, EventKind::Superseded, EventKind::Aborted];
        self.count(plan, &ends)
    }

    fn acceptances_of(&self, plan: PlanId) -> usize {
        self.count(plan, &[EventKind::Accepted])
    }

    fn count(&self, plan: PlanId, kinds: &[EventKind]) -> usize {
        let one_of = |e: &&PlanEvent| kinds.iter().any(|k| k.wire() == e.kind) && e.plan == plan;
        self.witness.events().iter().filter(one_of).count()
    }
}

pub(crate) fn describe(event: &PlanEvent) -> String {
    let kind = EventKind::from_wire(event.kind).map_or("?", EventKind::text);
    let reason = Reason::from_wire(event.reason).map_or("?", Reason::text);
    format!(
        "plan {} was {kind}: {reason} (joint {}, knot {}, {} against {})",
        event.plan, event.joint, event.knot, event.value, event.bound
    )
}
