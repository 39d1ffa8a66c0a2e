//! What becomes of published plans.

use nullsweep_ipc_types::{EventKind, PlanHeader, PlanId, PlanMessage, Reason, checksum};

use crate::rig::{System, newest, next};

#[test]
fn a_plan_from_publication_to_its_end() {
    let system = System::start();
    let events = system.ipc.event_receiver().unwrap();
    let mut publisher = system.ipc.plan_publisher(200).unwrap();
    let home = system.home();
    let (header, knots) = system.line(home, 0.2, 0.5);

    let wrong = PlanHeader { fingerprint: 1, ..header };
    let id = publisher.publish(&wrong, &knots).unwrap();
    assert_eq!(next(&events, id), (EventKind::Rejected, Reason::Robot));
    let id = PlanId { epoch: 1, number: 1 };
    let mut old = PlanHeader { id, knot_count: knots.len() as u32, ..header };
    old.checksum = checksum(PlanMessage { header: &old, knots: &knots });
    publisher.publish_raw(&old, &knots).unwrap();
    assert_eq!(next(&events, old.id), (EventKind::Rejected, Reason::Epoch));

    let id = publisher.publish(&header, &knots).unwrap();
    assert_eq!(next(&events, id), (EventKind::Accepted, Reason::None));
    assert_eq!(next(&events, id), (EventKind::Started, Reason::None));
    // The same once more while it runs: that one is refused, and the running one goes on.
    let mut again = PlanHeader { id, knot_count: knots.len() as u32, ..header };
    again.checksum = checksum(PlanMessage { header: &again, knots: &knots });
    publisher.publish_raw(&again, &knots).unwrap();
    assert_eq!(next(&events, id), (EventKind::Rejected, Reason::Repeated));
    assert_eq!(next(&events, id), (EventKind::Finished, Reason::None));
    let telemetry = system.ipc.telemetry_receiver().unwrap();
    let report = newest(&telemetry);
    assert_eq!(report.commanded, knots[100].positions);
    assert_eq!(report.lost_lines, 0);
    assert!(report.cycle > 500 && report.joint_count == 7);

    let (seen, log) = system.end();
    assert!(seen.worst <= 1.0, "{seen:?}");
    assert_eq!(seen.last, knots[100].positions);
    assert!(seen.disabled, "the motors are asked off at the end");
    let summary = log.iter().find(|l| l.contains("system-heap calls")).expect("a summary");
    assert!(summary.contains(": 0 system-heap calls"), "{summary}");
    println!("{summary}");
}

#[test]
fn a_plan_that_runs_at_shutdown_is_stopped_and_told() {
    let system = System::start();
    let events = system.ipc.event_receiver().unwrap();
    let mut publisher = system.ipc.plan_publisher(200).unwrap();
    let home = system.home();
    let (header, knots) = system.line(home, 0.4, 4.0);
    let id = publisher.publish(&header, &knots).unwrap();
    assert_eq!(next(&events, id).0, EventKind::Accepted);
    assert_eq!(next(&events, id).0, EventKind::Started);
    system.terminate();
    assert_eq!(next(&events, id), (EventKind::Aborted, Reason::Shutdown));
    let (seen, _) = system.finish();
    assert!(seen.worst <= 1.0 && seen.disabled, "{seen:?}");
}
