//! Without trouble: plans, events, telemetry and commands are as on one host.

use std::time::Duration;

use nullsweep_ipc_types::ports::now_ns;
use nullsweep_ipc_types::{CommandKind, EventKind, JoinRule, Mode, PlanId, Reason, Verdict};

use super::rig::{PlannerHost, RobotHost, ask, end, free, life, log, newest, wait_for};

const LONG: Duration = Duration::from_secs(20);
const DONE: [(EventKind, Reason); 3] = [
    (EventKind::Accepted, Reason::None),
    (EventKind::Started, Reason::None),
    (EventKind::Finished, Reason::None),
];

#[test]
fn a_planner_finds_the_executor_of_another_host() {
    let (mut robot, planner) = (RobotHost::start(), PlannerHost::new());
    let (endpoint, _) = free("tcp");
    let (there, here) = (robot.root.path(), planner.root.path());
    let connect = ["--connect", &endpoint];
    let mut far = end(there, Some(there), &["robot", "--listen", &endpoint]);
    let mut near = end(here, Some(here), &["planner", connect[0], connect[1]]);
    planner.wait();
    let events = planner.ipc.event_receiver().unwrap();
    let telemetry = planner.ipc.telemetry_receiver().unwrap();
    let commands = planner.ipc.command_client().unwrap();
    let call = |kind, value| commands.call(kind, value, Duration::from_secs(3)).unwrap();
    wait_for("executor that holds", || call(CommandKind::Status, 0.0).mode == Mode::Hold.wire());

    // A plan, and one that takes over in its middle, named by the id that this world knows it by.
    let mut publisher = planner.ipc.plan_publisher(200).unwrap();
    let (header, knots) = robot.line(0.0, 0.4, 4.0);
    let first = publisher.publish(&header, &knots).unwrap();
    wait_for("first plan in telemetry", || newest(&telemetry).plan == first);
    let sample = newest(&telemetry);
    assert!(now_ns().abs_diff(sample.stamp_ns) < 2_000_000_000, "in this host's time");
    let status = call(CommandKind::Status, 0.0);
    assert_eq!((status.plan, status.mode), (first, Mode::Executing.wire()));
    let (mut header, knots) = robot.line(0.3, 0.1, 1.0);
    (header.join_rule, header.join_plan, header.join_knot) = (JoinRule::AtKnot.wire(), first, 75);
    let second = publisher.publish(&header, &knots).unwrap();
    let superseded = life(&events, first, LONG);
    assert_eq!(superseded.last(), Some(&(EventKind::Superseded, Reason::None)), "{superseded:?}");
    let late = planner.ipc.event_receiver().unwrap();
    wait_for("end of the second", || newest(&telemetry).mode == Mode::Hold.wire());
    assert_eq!(life(&late, second, LONG), DONE, "a late one gets the last events");

    // Commands, and what is refused is told as on one host.
    assert_eq!(call(CommandKind::Pause, 0.0).verdict, Verdict::WrongMode.wire());
    assert_eq!(call(CommandKind::Speed, 7.0).verdict, Verdict::BadValue.wire());
    assert_eq!(call(CommandKind::Speed, 0.5).verdict, Verdict::Accepted.wire());
    let elsewhere = publisher.publish(&robot.line(0.0, 0.1, 1.0).0, &robot.line(0.0, 0.1, 1.0).1);
    let refused = life(&events, elsewhere.unwrap(), LONG);
    assert_eq!(refused, [(EventKind::Rejected, Reason::Start)]);
    let mut broken = header;
    (broken.id, broken.knot_count) = (PlanId { epoch: now_ns(), number: 99 }, knots.len() as u32);
    broken.checksum = 1;
    publisher.publish_raw(&broken, &knots).unwrap();
    assert_eq!(life(&events, broken.id, LONG), [(EventKind::Rejected, Reason::Checksum)]);
    publisher.publish_raw(&broken, &knots).unwrap();
    assert_eq!(life(&events, broken.id, LONG), [(EventKind::Rejected, Reason::Repeated)]);

    // Another end in the planners' world: it knows the last events, under the ids of this world.
    near.end();
    let again = end(here, Some(here), &["planner", connect[0], connect[1]]);
    wait_for("events of an end that came late", || {
        let late = planner.ipc.event_receiver().unwrap();
        life(&late, second, Duration::from_millis(100)) == DONE
    });
    let (code, text) = ask(here, &[&second.to_string(), connect[0], connect[1]]);
    let lines = ["accepted", "started", "finished"].map(|step| format!("plan {second} {step}\n"));
    assert_eq!((code, text), (Some(0), lines.concat()));
    let (code, text) = ask(here, &["123/4", connect[0], connect[1]]);
    assert_eq!((code, text.as_str()), (Some(0), "plan 123/4 is not known to the robot's end\n"));

    // The executor goes: nobody is in its place here either.
    let seen = robot.finish();
    wait_for("end of the executor's place", || !publisher.has_executor());
    assert!(seen.setpoints > 4000 && seen.worst <= 1.0, "{seen:?}");
    far.end();
    drop(again);
    assert!(log(here, "planner").contains("its executor has gone"), "{}", log(here, "planner"));
}
