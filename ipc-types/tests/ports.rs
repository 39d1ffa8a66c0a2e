//! Every service, there and back, each test under a root path of its own.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use bytemuck::Zeroable;
use nullsweep_ipc_types::ports::{Ipc, IpcError, now_ns};
use nullsweep_ipc_types::{
    BaseCommand, BaseJoint, BaseOrder, BaseState, BaseStatus, CommandKind, EventKind, JointStates,
    Knot, MAX_KNOTS, PlanEvent, PlanHeader, PlanId, PlanMessage, Reason, Response, Setpoint,
    Telemetry, Verdict, checksum,
};
use tempfile::TempDir;

/// Two doors under one fresh root: two processes would have one each.
fn doors() -> (TempDir, Ipc, Ipc) {
    let root = TempDir::new().unwrap();
    let a = Ipc::open("pr2", Some(root.path())).unwrap();
    let b = Ipc::open("pr2", Some(root.path())).unwrap();
    (root, a, b)
}

fn knots(n: usize) -> Vec<Knot> {
    (0..n)
        .map(|i| {
            let mut knot = Knot::zeroed();
            knot.time_from_start_ns = i as u64 * 1_000_000;
            knot.positions[3] = i as f64;
            knot
        })
        .collect()
}

#[test]
fn plan_there_and_back() {
    let (_root, planner, executor) = doors();
    let receiver = executor.plan_receiver().unwrap();
    let mut publisher = planner.plan_publisher(100).unwrap();
    let knots = knots(100);
    let header = PlanHeader { joint_count: 7, ..PlanHeader::default() };
    let before = now_ns();
    let id = publisher.publish(&header, &knots).unwrap();
    assert!(before <= id.epoch && id.epoch <= now_ns());
    assert_eq!(id.number, 1);

    let plan = receiver.receive().unwrap().expect("the plan is there");
    assert_eq!(plan.header().id, id);
    assert_eq!(plan.header().knot_count, 100);
    assert_eq!(plan.knots(), &knots[..]);
    let message = PlanMessage { header: plan.header(), knots: plan.knots() };
    assert_eq!(plan.header().checksum, checksum(message));
    assert!(receiver.receive().unwrap().is_none());
    assert_eq!(publisher.publish(&header, &knots[..2]).unwrap().number, 2);
    assert_eq!(receiver.receive().unwrap().unwrap().knots().len(), 2);
}

#[test]
fn largest_plan() {
    let (_root, planner, executor) = doors();
    let receiver = executor.plan_receiver().unwrap();
    let mut publisher = planner.plan_publisher(MAX_KNOTS).unwrap();
    let knots = knots(MAX_KNOTS);
    publisher.publish(&PlanHeader::default(), &knots).unwrap();
    assert_eq!(receiver.receive().unwrap().unwrap().knots(), &knots[..]);
}

#[test]
fn plan_without_executor_says_so() {
    let (_root, planner, executor) = doors();
    let mut publisher = planner.plan_publisher(2).unwrap();
    let header = PlanHeader::default();
    let gone = publisher.publish(&header, &knots(2)).unwrap_err();
    assert!(matches!(gone, IpcError::NoExecutor { .. }), "{gone}");
    assert!(gone.to_string().contains("executor run"), "{gone}");

    let receiver = executor.plan_receiver().unwrap();
    publisher.publish(&header, &knots(2)).unwrap();
    drop(receiver);
    let gone = publisher.publish(&header, &knots(2)).unwrap_err();
    assert!(matches!(gone, IpcError::NoExecutor { .. }), "{gone}");
}

#[test]
fn full_plan_buffer_is_reported_and_never_blocks() {
    let (_root, planner, executor) = doors();
    let receiver = executor.plan_receiver().unwrap();
    let mut publisher = planner.plan_publisher(2).unwrap();
    for _ in 0..4 {
        publisher.publish(&PlanHeader::default(), &knots(2)).unwrap();
    }
    let full = publisher.publish(&PlanHeader::default(), &knots(2)).unwrap_err();
    assert!(matches!(full, IpcError::PlanBufferFull), "{full}");
    assert_eq!(receiver.receive().unwrap().unwrap().header().id.number, 1);
    // A plan that was not taken does not use up a number.
    assert_eq!(publisher.publish(&PlanHeader::default(), &knots(2)).unwrap().number, 5);
}

#[test]
fn too_many_knots() {
    let (_root, planner, _executor) = doors();
    assert!(matches!(planner.plan_publisher(0), Err(IpcError::KnotCount { .. })));
    assert!(matches!(planner.plan_publisher(MAX_KNOTS + 1), Err(IpcError::KnotCount { .. })));
    let mut publisher = planner.plan_publisher(2).unwrap();
    for n in [0, 3] {
        let e = publisher.publish(&PlanHeader::default(), &knots(n)).unwrap_err();
        assert!(matches!(e, IpcError::KnotCount { knots, limit: 2 } if knots == n), "{e}");
    }
}

#[test]
fn setpoints_and_states_there_and_back() {
    let (_root, executor, endpoint) = doors();
    let setpoints = executor.setpoint_sender().unwrap();
    let states = endpoint.state_sender().unwrap();
    let to_endpoint = endpoint.setpoint_receiver().unwrap();
    let to_executor = executor.state_receiver().unwrap();
    assert_eq!((setpoints.receivers(), to_executor.senders()), (1, 1));
    for sequence in 1..=3 {
        let mut setpoint = Setpoint { sequence, ..Setpoint::zeroed() };
        setpoint.positions[6] = 0.5 * sequence as f64;
        assert_eq!(setpoints.send(&setpoint).unwrap(), 1);
        states.send(&JointStates { setpoint_sequence: sequence, ..JointStates::zeroed() }).unwrap();
    }
    let first = to_endpoint.receive().unwrap().unwrap();
    assert_eq!((first.sequence, first.positions[6]), (1, 0.5));
    let newest = to_endpoint.newest().unwrap().unwrap();
    assert_eq!((newest.value.sequence, newest.skipped), (3, 1));
    assert!(to_endpoint.newest().unwrap().is_none());
    assert_eq!(to_executor.newest().unwrap().unwrap().value.setpoint_sequence, 3);
}

#[test]
fn a_reader_that_sleeps_gets_the_newest() {
    let (_root, executor, endpoint) = doors();
    let sender = executor.setpoint_sender().unwrap();
    let receiver = endpoint.setpoint_receiver().unwrap();
    for sequence in 1..=1000 {
        sender.send(&Setpoint { sequence, ..Setpoint::zeroed() }).unwrap();
    }
    let newest = receiver.newest().unwrap().unwrap();
    assert_eq!((newest.value.sequence, newest.skipped), (1000, 63));
}

#[test]
fn telemetry_and_events_reach_latecomers() {
    let (_root, executor, listener) = doors();
    let telemetry = executor.telemetry_sender().unwrap();
    let events = executor.event_sender().unwrap();
    for sequence in 1..=20 {
        telemetry.send(&Telemetry { sequence, ..Telemetry::zeroed() }).unwrap();
        let event = PlanEvent {
            sequence,
            plan: PlanId { epoch: 7, number: sequence },
            kind: EventKind::Rejected.wire(),
            reason: Reason::Start.wire(),
            ..PlanEvent::zeroed()
        };
        events.send(&event).unwrap();
    }
    let late = listener.telemetry_receiver().unwrap();
    let late_events = listener.event_receiver().unwrap();
    telemetry.connect().unwrap();
    events.connect().unwrap();
    assert_eq!(late.newest().unwrap().unwrap().value.sequence, 20);
    let got: Vec<u64> =
        std::iter::from_fn(|| late_events.receive().unwrap()).map(|e| e.sequence).collect();
    assert_eq!(got, (5..=20).collect::<Vec<_>>());
}

#[test]
fn commands_there_and_back() {
    let (root, operator, executor) = doors();
    let client = operator.command_client().unwrap();
    let none = client.call(CommandKind::Status, 0.0, Duration::from_secs(1)).unwrap_err();
    assert!(matches!(none, IpcError::NoExecutor { .. }), "{none}");

    let done = AtomicBool::new(false);
    thread::scope(|s| {
        s.spawn(|| {
            let ipc = Ipc::open("pr2", Some(root.path())).unwrap();
            let server = ipc.command_server().unwrap();
            while !done.load(Ordering::Acquire) {
                while let Some(request) = server.receive().unwrap() {
                    let response = Response {
                        speed_scale: request.command().value,
                        verdict: Verdict::Accepted.wire(),
                        ..Response::zeroed()
                    };
                    request.answer(response).unwrap();
                }
                thread::sleep(Duration::from_micros(200));
            }
        });
        while client.call(CommandKind::Status, 0.0, Duration::from_secs(5)).is_err() {
            thread::sleep(Duration::from_millis(5));
        }
        for i in 0..10 {
            let value = f64::from(i) / 10.0;
            let got = client.call(CommandKind::Speed, value, Duration::from_secs(5)).unwrap();
            assert_eq!(got.speed_scale, value);
        }
        done.store(true, Ordering::Release);
    });
    // A server that is there and does not answer is told from one that is not.
    let _mute = executor.command_server().unwrap();
    let mute = client.call(CommandKind::Status, 0.0, Duration::from_millis(20)).unwrap_err();
    assert!(matches!(mute, IpcError::NoAnswer { .. }), "{mute}");
}

#[test]
fn the_base_is_asked_and_answers() {
    let (_root, program, driver) = doors();
    let client = program.base_client().unwrap();
    let none = client.call(BaseCommand::of(BaseOrder::Status), Duration::ZERO).unwrap_err();
    assert!(matches!(none, IpcError::NoBase { .. }) && !client.is_answered(), "{none}");

    let server = driver.base_server().unwrap();
    assert!(client.is_answered());
    let mute = client.call(BaseCommand::of(BaseOrder::Arrived), Duration::ZERO).unwrap_err();
    assert!(matches!(mute, IpcError::MuteBase { .. }), "{mute}");

    let mut drive =
        BaseCommand { goal: 7, pose: [1.0, -2.0, 0.5], ..BaseCommand::of(BaseOrder::Drive) };
    drive.joints[0] = BaseJoint::new("torso_lift_joint", 0.2).unwrap();
    drive.joint_count = 1;
    thread::scope(|s| {
        s.spawn(|| {
            let client = program.base_client().unwrap();
            let status = client.call(drive, Duration::from_secs(20)).unwrap();
            assert_eq!((status.goal, status.state), (7, BaseState::Driving.wire()));
        });
        let request = loop {
            if let Some(request) = server.receive().unwrap() {
                break request;
            }
            thread::sleep(Duration::from_millis(1));
        };
        let asked = request.command();
        assert_eq!(asked, drive);
        let state = BaseState::Driving.wire();
        request.answer(BaseStatus { goal: asked.goal, state, ..BaseStatus::zeroed() }).unwrap();
    });
}

#[test]
fn single_places_are_single() {
    let (_root, a, b) = doors();
    let _plan = a.plan_receiver().unwrap();
    let _setpoint = a.setpoint_sender().unwrap();
    let _state = a.state_receiver().unwrap();
    let _telemetry = a.telemetry_sender().unwrap();
    let _event = a.event_sender().unwrap();
    let _command = a.command_server().unwrap();
    let _base = a.base_server().unwrap();
    let taken = |e: IpcError| assert!(matches!(e, IpcError::Taken { .. }), "{e}");
    taken(b.plan_receiver().unwrap_err());
    taken(b.setpoint_sender().unwrap_err());
    taken(b.state_receiver().unwrap_err());
    taken(b.telemetry_sender().unwrap_err());
    taken(b.event_sender().unwrap_err());
    taken(b.command_server().unwrap_err());
    taken(b.base_server().unwrap_err());
}

#[test]
fn roots_and_robots_are_apart() {
    let (_root, a, other_process) = doors();
    let (_other_root, b, _) = doors();
    let receiver = a.setpoint_receiver().unwrap();
    let stranger = b.setpoint_sender().unwrap();
    assert_eq!(stranger.send(&Setpoint::zeroed()).unwrap(), 0);
    let other_robot = Ipc::open("pr2-left", a.root()).unwrap();
    let sender = other_robot.setpoint_sender().unwrap();
    assert_eq!(sender.send(&Setpoint::zeroed()).unwrap(), 0);
    let sender = other_process.setpoint_sender().unwrap();
    assert_eq!(sender.send(&Setpoint::zeroed()).unwrap(), 1);
    assert!(receiver.receive().unwrap().is_some());
}

#[test]
fn bad_names_are_refused() {
    let root = TempDir::new().unwrap();
    for name in ["", "a/b", "pr2 ", "ü"] {
        assert!(matches!(Ipc::open(name, Some(root.path())), Err(IpcError::RobotName { .. })));
    }
    let file = root.path().join("file");
    std::fs::write(&file, "x").unwrap();
    assert!(matches!(Ipc::open("pr2", Some(&file)), Err(IpcError::Root { .. })));
}
