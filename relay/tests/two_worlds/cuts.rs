//! With a fifth of all segments lost and the line cut three times: each plan has one outcome, and the
//! arm does what it was told.

use std::collections::HashMap;
use std::process::Command;
use std::thread;
use std::time::{Duration, Instant};

use nullsweep_ipc_types::ports::{Receiver, now_ns};
use nullsweep_ipc_types::{EventKind, Mode, PlanEvent, PlanId};

use super::proxy::{Line, Proxy};
use super::rig::{
    PlannerHost, RobotHost, ask, end, end_of, free, life, log, newest, relay, wait_for,
};

const PLANS: usize = 24;
/// How long one plan takes. \[s\]
const TAKES: f64 = 0.5;
/// How long a link is cut.
pub(crate) const CUT: Duration = Duration::from_secs(3);

/// What lies between two hosts.
pub(crate) trait Road {
    /// Where the robot's end listens, in zenoh's words.
    fn listens(&self) -> String;
    /// Where the planner's end finds it.
    fn connects(&self) -> String;
    /// `relay` on the robot's host.
    fn robot(&self) -> Command;
    /// `relay` on the planner's host.
    fn planner(&self) -> Command;
    /// Lets nothing through for [`CUT`]; with `silent` the hosts are told nothing of it.
    fn cut(&self, silent: bool);
    /// How many segments or packets went, and how many of them were lost.
    fn lost(&self) -> (u64, u64);
}

/// A proxy on loopback.
struct Loopback {
    endpoint: String,
    proxy: Proxy,
}

impl Road for Loopback {
    fn listens(&self) -> String {
        self.endpoint.clone()
    }

    fn connects(&self) -> String {
        format!("tcp/127.0.0.1:{}", self.proxy.port)
    }

    fn robot(&self) -> Command {
        relay()
    }

    fn planner(&self) -> Command {
        relay()
    }

    fn cut(&self, silent: bool) {
        self.proxy.set(if silent { Line::Silent } else { Line::Cut });
        thread::sleep(CUT);
        // What was under way on a silent line is lost with its connection.
        self.proxy.set(Line::Cut);
        self.proxy.set(Line::Stands);
    }

    fn lost(&self) -> (u64, u64) {
        self.proxy.count()
    }
}

/// Every event of a world, by plan.
#[derive(Debug, Default)]
struct Book(HashMap<PlanId, Vec<(EventKind, u64)>>);

impl Book {
    fn read(&mut self, events: &Receiver<PlanEvent>) {
        while let Some(event) = events.receive().unwrap() {
            let kind = EventKind::from_wire(event.kind).unwrap();
            self.0.entry(event.plan).or_default().push((kind, event.stamp_ns));
        }
    }

    /// How often a plan was admitted or refused, and how often it ended.
    fn outcomes(&self, plan: PlanId) -> (usize, usize) {
        let life = self.0.get(&plan).map_or(&[][..], Vec::as_slice);
        let count = |wanted: fn(EventKind) -> bool| life.iter().filter(|(k, _)| wanted(*k)).count();
        (
            count(|k| matches!(k, EventKind::Accepted | EventKind::Rejected)),
            count(|k| {
                matches!(k, EventKind::Finished | EventKind::Superseded | EventKind::Aborted)
            }),
        )
    }

    fn is_refused(&self, plan: PlanId) -> bool {
        self.0.get(&plan).is_some_and(|life| life.iter().any(|(k, _)| *k == EventKind::Rejected))
    }
}

#[test]
fn every_plan_has_one_outcome_through_losses_and_cuts() {
    let (endpoint, port) = free("tcp");
    every_plan_has_one_outcome(&Loopback { endpoint, proxy: Proxy::to(port, 200) });
}

pub(crate) fn every_plan_has_one_outcome(road: &dyn Road) {
    let (mut robot, planner) = (RobotHost::start(), PlannerHost::new());
    let (there, here) = (robot.root.path().to_path_buf(), planner.root.path());
    let listen = ["robot", "--listen", &road.listens(), "--unprotected", "--telemetry", "20"];
    let _far = end_of(road.robot(), &there, Some(&there), &listen);
    let connect = ["planner", "--connect", &road.connects(), "--plan-within", "6"];
    let _near = end_of(road.planner(), here, Some(here), &connect);
    planner.wait();
    let (mut sender_book, mut robot_book) = (Book::default(), Book::default());
    let events = planner.ipc.event_receiver().unwrap();
    let robot_events = robot.ipc.event_receiver().unwrap();
    let telemetry = robot.ipc.telemetry_receiver().unwrap();
    wait_for("arm that holds", || newest(&telemetry).mode == Mode::Hold.wire());

    let mut publisher = planner.ipc.plan_publisher(200).unwrap();
    let (mut plans, mut at, mut admitted) = (Vec::new(), 0.0, Vec::new());
    for i in 0..PLANS {
        let angle = if at == 0.0 { 0.1 } else { -0.1 };
        let (header, knots) = robot.line(at, angle, TAKES);
        let published = Instant::now();
        let id = publisher.publish(&header, &knots).unwrap();
        plans.push(id);
        // In the plan's way, in its motion, and unnoticed.
        let cut = match i {
            4 => Some((0.005, false)),
            12 => Some((0.3, false)),
            18 => Some((0.2, true)),
            _ => None,
        };
        if let Some((after, silent)) = cut {
            thread::sleep(Duration::from_secs_f64(after));
            road.cut(silent);
        }
        let end = published + Duration::from_secs(20);
        while sender_book.outcomes(id).1 == 0 && !sender_book.is_refused(id) && Instant::now() < end
        {
            sender_book.read(&events);
            robot_book.read(&robot_events);
            if admitted.len() < plans.len() && sender_book.outcomes(id).0 > 0 {
                admitted.push(published.elapsed().as_secs_f64());
            }
            thread::sleep(Duration::from_millis(2));
        }
        at = position(&robot, &telemetry);
    }
    thread::sleep(Duration::from_secs(8));
    sender_book.read(&events);
    robot_book.read(&robot_events);

    let log = log(here, "planner");
    let (mut finished, mut refused) = (0, 0);
    for id in &plans {
        let (admissions, ends) = sender_book.outcomes(*id);
        let life = sender_book.0.get(id);
        assert_eq!(admissions, 1, "{id}: {life:?}\n{log}");
        if sender_book.is_refused(*id) {
            assert_eq!(ends, 0, "{id}: {life:?}");
            refused += 1;
        } else {
            assert_eq!(ends, 1, "{id}: {life:?}\n{log}");
            finished += 1;
        }
    }
    assert!(finished >= PLANS - 3, "{finished} of {PLANS} came through: {log}");
    assert_eq!(log.matches("the link is back").count().min(3), 3, "three cuts: {log}");
    // At the robot: no plan twice, each as long as it was to take, no stop and no fault.
    let mut longest = 0.0_f64;
    for (id, life) in &robot_book.0 {
        assert_eq!(robot_book.outcomes(*id), (1, 1), "{id}: {life:?}");
        let stamp = |kind| life.iter().find(|(k, _)| *k == kind).map(|(_, stamp)| *stamp);
        let (began, ended) = (stamp(EventKind::Started), stamp(EventKind::Finished));
        let took = (ended.expect("finished") - began.expect("started")) as f64 * 1e-9;
        longest = longest.max(took - TAKES);
        assert!((-0.01..2.0).contains(&(took - TAKES)), "{id} took {took} s");
    }
    assert_eq!(robot_book.0.len(), finished, "what was refused here did not run there");
    let seen = robot.finish();
    assert!(seen.worst <= 1.0, "{seen:?}");
    admitted.sort_by(f64::total_cmp);
    let (segments, lost) = road.lost();
    println!(
        "{PLANS} plans, {segments} segments or packets, {lost} lost ({:.1} %), 3 cuts of 3 s: {finished} finished, \
         {refused} refused, each once; admission after {:.2} s in the median, {:.2} s at most; ends \
         {longest:.3} s late at most; worst step {:.2} of v·T in {} setpoints",
        1e2 * lost as f64 / segments as f64,
        admitted[admitted.len() / 2],
        admitted.last().expect("one"),
        seen.worst,
        seen.setpoints,
    );
}

/// Where joint 0 is, from home: at one of two places.
fn position(robot: &RobotHost, telemetry: &Receiver<nullsweep_ipc_types::Telemetry>) -> f64 {
    let mut now = newest(telemetry);
    wait_for("rest", || {
        now = newest(telemetry);
        now.mode == Mode::Hold.wire()
    });
    let at = now.commanded[0] - robot.arm.home()[0];
    if at.abs() < 0.05 { 0.0 } else { 0.1 }
}

#[test]
fn what_is_unknown_is_asked_for_and_what_never_went_is_refused() {
    let (robot, planner) = (RobotHost::start(), PlannerHost::new());
    let (endpoint, port) = free("tcp");
    let proxy = Proxy::to(port, 0);
    let through = format!("tcp/127.0.0.1:{}", proxy.port);
    let (there, here) = (robot.root.path(), planner.root.path());
    let _far = end(there, Some(there), &["robot", "--listen", &endpoint]);
    let _near = end(here, Some(here), &["planner", "--connect", &through, "--plan-within", "2"]);
    planner.wait();
    let events = planner.ipc.event_receiver().unwrap();
    let telemetry = robot.ipc.telemetry_receiver().unwrap();
    wait_for("arm that holds", || newest(&telemetry).mode == Mode::Hold.wire());
    let mut publisher = planner.ipc.plan_publisher(200).unwrap();

    // It runs on while the link is cut, and its end is told when the link is back.
    let (header, knots) = robot.line(0.0, 0.2, 1.5);
    let first = publisher.publish(&header, &knots).unwrap();
    wait_for("motion", || newest(&telemetry).mode == Mode::Executing.wire());
    proxy.set(Line::Cut);
    wait_for("end of the motion", || newest(&telemetry).mode == Mode::Hold.wire());
    thread::sleep(Duration::from_millis(1500));
    let (code, text) = ask(here, &[&first.to_string(), "--connect", &through, "--timeout", "1"]);
    assert_eq!(code, Some(4), "{text}");
    assert!(text.starts_with("unknown") && text.contains("ask again"), "{text}");

    // What is published meanwhile never goes: refused when its time is over, with the link still cut.
    let before = now_ns();
    let (header, knots) = robot.line(0.2, -0.2, 1.0);
    let second = publisher.publish(&header, &knots).unwrap();
    let refused = life(&events, second, Duration::from_secs(10));
    assert_eq!(refused.last().map(|(kind, _)| *kind), Some(EventKind::Rejected), "{refused:?}");
    assert!(now_ns() - before > 1_900_000_000);
    proxy.set(Line::Stands);
    let late = planner.ipc.event_receiver().unwrap();
    wait_for("end of the first", || {
        life(&late, first, Duration::from_secs(1)).iter().any(|(k, _)| *k == EventKind::Finished)
    });
    let (code, text) = ask(here, &[&first.to_string(), "--connect", &through]);
    assert!(code == Some(0) && text.contains(" finished\n"), "{text}");

    // One that goes out on a line that has fallen silent: nobody knows until the link is back, and then
    // it is too late for it.
    let (header, knots) = robot.line(0.2, -0.2, 1.0);
    proxy.set(Line::Silent);
    let third = publisher.publish(&header, &knots).unwrap();
    assert_eq!(life(&events, third, Duration::from_secs(5)), [], "nothing is known");
    proxy.set(Line::Cut);
    proxy.set(Line::Stands);
    let told = life(&events, third, Duration::from_secs(20));
    assert_eq!(told.iter().map(|(kind, _)| *kind).collect::<Vec<_>>(), [EventKind::Rejected]);
    assert_eq!(newest(&telemetry).mode, Mode::Hold.wire(), "it does not run late");
}
