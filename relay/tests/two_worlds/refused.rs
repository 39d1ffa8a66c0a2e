//! Ends of other builds are refused, and both are told.

use std::time::Duration;

use zenoh::Wait;

use super::rig::{PlannerHost, RobotHost, end, free, log, wait_for};

const OTHER: &str =
    "protocol: relay 1\nbyte order: little-endian\nplan: nullsweep.Knot.v9 of 280 bytes\n";
const HELLO: &str = "nullsweep/pr2/relay/hello";

fn session(listen: &[&str], connect: &[&str]) -> zenoh::Session {
    let mut config = zenoh::Config::default();
    let list = |all: &[&str]| serde_json::Value::from(all.to_vec()).to_string();
    config.insert_json5("scouting/multicast/enabled", "false").unwrap();
    config.insert_json5("listen/endpoints", &list(listen)).unwrap();
    config.insert_json5("connect/endpoints", &list(connect)).unwrap();
    zenoh::open(config).wait().unwrap()
}

#[test]
fn the_robots_end_says_what_is_other() {
    let robot = RobotHost::start();
    let (endpoint, _) = free("tcp");
    let there = robot.root.path();
    let _far = end(there, Some(there), &["robot", "--listen", &endpoint]);
    wait_for("robot's end", || log(there, "robot").contains("the robot's end of pr2"));
    let session = session(&[], &[&endpoint]);
    let ask = |key: &str, bytes: &[u8]| {
        let replies =
            session.get(key).payload(bytes).timeout(Duration::from_secs(2)).wait().unwrap();
        let reply = replies.recv().ok()?.into_result().ok()?;
        Some(String::from_utf8_lossy(&reply.payload().to_bytes()).into_owned())
    };
    let mut theirs = None;
    wait_for("answer", || {
        theirs = ask(HELLO, OTHER.as_bytes());
        theirs.is_some()
    });
    assert!(theirs.unwrap().contains("plan: nullsweep.Knot.v1 of 272 bytes"));
    let text = log(there, "robot");
    for told in
        ["refused", "nullsweep.Knot.v1 of 272 bytes here", "nullsweep.Knot.v9 of 280 bytes there"]
    {
        assert!(text.contains(told), "{told}: {text}");
    }
    // Whatever it sends all the same is no message.
    assert_eq!(ask("nullsweep/pr2/relay/plan", &[7; 900]), None);
    assert_eq!(ask("nullsweep/pr2/relay/command", &[7; 32]), None);
}

#[test]
fn the_planners_end_says_what_is_other_and_ends() {
    let planner = PlannerHost::new();
    let (endpoint, _) = free("tcp");
    let here = planner.root.path();
    let session = session(&[&endpoint], &[]);
    let answer = session.declare_queryable(HELLO).callback(|query| {
        query.reply(HELLO, OTHER).wait().unwrap();
    });
    let _answer = answer.wait().unwrap();
    let mut near = end(here, Some(here), &["planner", "--connect", &endpoint]);
    let mut code = None;
    wait_for("end of the planners' end", || {
        session.put("nullsweep/pr2/relay/pulse", [3; 32]).wait().unwrap();
        code = near.0.try_wait().unwrap().map(|status| status.code());
        code.is_some()
    });
    assert_eq!(code, Some(Some(1)));
    let text = log(here, "planner");
    for told in
        ["another build", "nullsweep.Knot.v1 of 272 bytes here", "Knot.v9 of 280 bytes there"]
    {
        assert!(text.contains(told), "{told}: {text}");
    }
}
