//! A long run of the armed loop.

use nullsweep_ipc_types::{EventKind, JoinRule, Knot, Mode, PlanHeader, PlanId};

use crate::rig::{System, next};

/// The laboratory's proof: a million cycles of the armed loop with a swap every 100 ms, and not
/// one call into the system's heap (the debug build would abort), not one page fault.
/// `cargo test -p nullsweep-executor --test process -- --ignored --nocapture million`
#[test]
#[ignore = "takes minutes"]
fn a_million_armed_cycles_with_swaps() {
    let system = System::start_with(&["--rate", "4000", "--spin-us", "0"]);
    let events = system.ipc.event_receiver().unwrap();
    let telemetry = system.ipc.telemetry_receiver().unwrap();
    let mut publisher = system.ipc.plan_publisher(200).unwrap();
    let mut home = system.home();
    let (mut running, mut last) = (PlanId::NONE, Vec::new());
    let mut swaps = 0u64;
    let mut cycle = 0;
    while cycle < 1_001_000 {
        // There, from a knot of it back again, and so on: now by a knot, now by a stop.
        let from = last.get(60).map_or(home, |k: &Knot| k.positions);
        let angle = home[0] + 0.2 - from[0];
        let angle = if angle.abs() < 0.1 { -0.2 } else { angle };
        let (header, knots) = system.line(from, angle, 0.6);
        let rule = if running.is_some() { JoinRule::AtKnot } else { JoinRule::StopThenStart };
        let header =
            PlanHeader { join_rule: rule.wire(), join_plan: running, join_knot: 60, ..header };
        let id = publisher.publish(&header, &knots).unwrap();
        if next(&events, id).0 == EventKind::Accepted {
            let then = next(&events, id);
            if then.0 != EventKind::Started {
                let newest = telemetry.newest().unwrap().map(|t| t.value);
                let (_, log) = system.end();
                panic!("{then:?} after cycle {cycle}, swap {swaps}, {newest:?}\n{log:#?}");
            }
            swaps += 1;
            (running, last) = (id, knots);
        } else {
            // Too late for its knot: begin anew from where the arm came to rest.
            system.wait_for(Mode::Hold);
            running = PlanId::NONE;
            last.clear();
            home = telemetry.newest().unwrap().map_or(home, |t| t.value.commanded);
        }
        cycle = telemetry.newest().unwrap().map_or(cycle, |t| t.value.cycle);
    }
    let (seen, log) = system.end();
    let summary = log.iter().find(|l| l.contains("system-heap calls")).expect("a summary");
    println!("{swaps} swaps; {summary}");
    assert!(seen.worst <= 1.0, "{seen:?}");
    assert!(summary.contains(": 0 system-heap calls, 0 page faults"), "{summary}");
}
