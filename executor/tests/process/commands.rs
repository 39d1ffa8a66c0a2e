//! Commands and their answers.

use std::time::{Duration, Instant};

use nullsweep_ipc_types::{CommandKind, EventKind, Knot, MAX_KNOTS, Mode, Reason, Verdict};

use crate::rig::{System, next};

#[test]
fn commands_are_answered_and_obeyed() {
    let system = System::start();
    let events = system.ipc.event_receiver().unwrap();
    let client = system.client();
    let mut publisher = system.ipc.plan_publisher(200).unwrap();
    let home = system.home();
    let (header, knots) = system.line(home, 0.3, 3.0);
    let id = publisher.publish(&header, &knots).unwrap();
    assert_eq!(next(&events, id).0, EventKind::Accepted);
    let mut answers = Vec::new();
    let mut ask = |kind, value| {
        let start = Instant::now();
        let response = client.call(kind, value, Duration::from_secs(2)).unwrap();
        answers.push(start.elapsed());
        Verdict::from_wire(response.verdict).unwrap()
    };
    assert_eq!(ask(CommandKind::Speed, 0.5), Verdict::Accepted);
    assert_eq!(ask(CommandKind::Speed, 2.0), Verdict::BadValue);
    assert_eq!(ask(CommandKind::Pause, 0.0), Verdict::Accepted);
    system.wait_for(Mode::Paused);
    assert_eq!(ask(CommandKind::Reset, 0.0), Verdict::WrongMode);
    assert_eq!(ask(CommandKind::Resume, 0.0), Verdict::Accepted);
    assert_eq!(ask(CommandKind::Stop, 0.0), Verdict::Accepted);
    assert_eq!(next(&events, id).0, EventKind::Started);
    assert_eq!(next(&events, id), (EventKind::Aborted, Reason::Stopped));
    system.wait_for(Mode::Hold);
    println!("answers within {answers:?}");
    let (seen, _) = system.end();
    assert!(seen.worst <= 1.0, "{seen:?}");
}

/// A plan of the largest size is admitted beside the commands and does not delay them.
#[test]
fn commands_are_answered_while_a_large_plan_is_admitted() {
    let system = System::start();
    let events = system.ipc.event_receiver().unwrap();
    let client = system.client();
    let mut publisher = system.ipc.plan_publisher(MAX_KNOTS).unwrap();
    let home = system.home();
    let (header, short) = system.line(home, 0.0, 1.0);
    let knots: Vec<Knot> = (0..MAX_KNOTS as u64)
        .map(|i| Knot { time_from_start_ns: i * 1_000_000, ..short[0] })
        .collect();
    let mut answers = Vec::new();
    for _ in 0..5 {
        let id = publisher.publish(&header, &knots).unwrap();
        for _ in 0..30 {
            let start = Instant::now();
            client.call(CommandKind::Status, 0.0, Duration::from_secs(2)).unwrap();
            answers.push(start.elapsed());
        }
        let first = next(&events, id).0;
        assert!(matches!(first, EventKind::Accepted | EventKind::Rejected), "{first}");
        client.call(CommandKind::Stop, 0.0, Duration::from_secs(2)).unwrap();
        system.wait_for(Mode::Hold);
    }
    answers.sort();
    // How fast is the laboratory's affair; here an answer may not wait for an admission at all.
    println!("median answer {:?}, slowest {:?}", answers[75], answers[149]);
    assert!(answers[75] < Duration::from_millis(10), "{answers:?}");
    system.end();
}
