//! The flight recorder of a process that is killed.

use std::process::Command;
use std::sync::atomic::Ordering;
use std::thread;
use std::time::Duration;

use nullsweep_executor::replay;
use nullsweep_ipc_types::{CommandKind, EventKind, JoinRule, PlanHeader};

use crate::rig::{System, next};

#[test]
fn a_killed_run_replays_bit_for_bit() {
    let mut system = System::start_with(&["--record", "ROOT/flight", "--record-mib", "1"]);
    let events = system.ipc.event_receiver().unwrap();
    let client = system.client();
    let mut publisher = system.ipc.plan_publisher(200).unwrap();
    let home = system.home();
    let (header, knots) = system.line(home, 0.2, 0.5);
    let second = Duration::from_secs(1);
    let first = publisher.publish(&header, &knots).unwrap();
    assert_eq!(next(&events, first).0, EventKind::Accepted);
    client.call(CommandKind::Speed, 0.7, second).unwrap();
    let join = PlanHeader {
        join_rule: JoinRule::AtKnot.wire(),
        join_plan: first,
        join_knot: 90,
        ..header
    };
    let (_, on) = system.line(knots[90].positions, -0.2, 0.5);
    let other = publisher.publish(&join, &on).unwrap();
    assert_eq!(next(&events, other).0, EventKind::Accepted);
    assert_eq!(next(&events, other).0, EventKind::Started);
    assert_eq!(next(&events, other).0, EventKind::Finished);
    // Long enough in Hold for the files to change over at least once.
    thread::sleep(Duration::from_millis(3500));
    system.executor.0.kill().unwrap();
    system.executor.0.wait().unwrap();
    system.over.store(true, Ordering::Release);

    let files: Vec<_> = (0..2)
        .map(|i| system.root.path().join(format!("flight/flight-{i}.nswrec")))
        .filter(|f| f.exists())
        .collect();
    assert_eq!(files.len(), 2);
    let replayed: Vec<_> = files.iter().map(|f| replay(f).unwrap()).collect();
    let finished: usize = replayed.iter().map(|r| r.count(EventKind::Finished)).sum();
    let superseded: usize = replayed.iter().map(|r| r.count(EventKind::Superseded)).sum();
    assert_eq!((finished, superseded), (1, 1), "{replayed:?}");
    assert!(replayed.iter().all(|r| r.setpoints > 0));

    // A torn end is told; a setpoint that was tampered with is found.
    let bytes = std::fs::read(&files[0]).unwrap();
    let torn = system.root.path().join("torn");
    std::fs::write(&torn, &bytes[..bytes.len() - 7]).unwrap();
    let replayed_torn = replay(&torn).unwrap();
    assert_eq!(replayed_torn.cycles + 1, replayed[0].cycles);
    assert!(replayed_torn.torn > 0);
    let status = Command::new(env!("CARGO_BIN_EXE_executor")).arg("replay").arg(&torn).status();
    assert!(status.unwrap().success());
    assert!(replay(&system.root.path().join("flight")).is_err());
    system.endpoint.join().unwrap();
}
