//! With certificates and access control, as the examples have them.

use std::fs;
use std::path::Path;
use std::time::Duration;

use nullsweep_ipc_types::{EventKind, Mode, Verdict};
use rcgen::{BasicConstraints, CertificateParams, DnType, IsCa, Issuer, KeyPair};

use super::rig::{PlannerHost, RobotHost, ask, end, free, life, log, newest, wait_for};

/// A certificate authority.
struct Authority(Issuer<'static, KeyPair>, String);

impl Authority {
    fn new() -> Self {
        let mut params = CertificateParams::new(Vec::new()).unwrap();
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        params.distinguished_name.push(DnType::CommonName, "the robot's owner");
        let key = KeyPair::generate().unwrap();
        let pem = params.self_signed(&key).unwrap().pem();
        Self(Issuer::new(params, key), pem)
    }

    /// Writes what an end of that name needs, under the names that the examples have.
    fn write(&self, folder: &Path, name: &str) {
        let mut params = CertificateParams::new(vec!["localhost".into()]).unwrap();
        params.distinguished_name.push(DnType::CommonName, name);
        let key = KeyPair::generate().unwrap();
        let certificate = params.signed_by(&key, &self.0).unwrap();
        fs::create_dir_all(folder.join("certs")).unwrap();
        let write =
            |name: &str, text: &str| fs::write(folder.join("certs").join(name), text).unwrap();
        write("ca.pem", &self.1);
        write("own.pem", &certificate.pem());
        write("own.key", &key.serialize_pem());
    }
}

fn example(folder: &Path, name: &str) {
    let text =
        fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("examples").join(name));
    fs::write(folder.join(name), text.unwrap()).unwrap();
}

#[test]
fn only_who_has_a_certificate_comes_in_and_a_viewer_moves_nothing() {
    let robot = RobotHost::start();
    let [planner, viewer, stranger] = [(); 3].map(|()| PlannerHost::new());
    let (there, owner) = (robot.root.path(), Authority::new());
    owner.write(there, "robot");
    example(there, "robot.json5");
    let hosts = [(&planner, &owner, "planner"), (&viewer, &owner, "viewer")];
    for (host, authority, name) in hosts {
        authority.write(host.root.path(), name);
        example(host.root.path(), "planner.json5");
    }
    Authority::new().write(stranger.root.path(), "planner");
    example(stranger.root.path(), "planner.json5");

    let (endpoint, port) = free("tls");
    let by_name = format!("tls/localhost:{port}");
    let file = ["--zenoh", "planner.json5", "--connect", &by_name];
    let _far = end(there, Some(there), &["robot", "--zenoh", "robot.json5", "--listen", &endpoint]);
    let near = |host: &PlannerHost| {
        let here = host.root.path();
        end(here, Some(here), &[&["planner"][..], &file].concat())
    };
    let _ends = [near(&planner), near(&viewer), near(&stranger)];
    planner.wait();
    viewer.wait();
    let [telemetry, shown] = [&planner, &viewer].map(|host| host.ipc.telemetry_receiver().unwrap());
    wait_for("arm that holds", || newest(&telemetry).mode == Mode::Hold.wire());
    assert_eq!(newest(&shown).mode, Mode::Hold.wire(), "a viewer sees it");

    // The viewer's plan does not get through, and is not executed.
    let (header, knots) = robot.line(0.0, 0.2, 1.0);
    let events = viewer.ipc.event_receiver().unwrap();
    let mut publisher = viewer.ipc.plan_publisher(200).unwrap();
    let plan = publisher.publish(&header, &knots).unwrap();
    let refused = life(&events, plan, Duration::from_secs(20));
    assert_eq!(refused.iter().map(|(k, _)| *k).collect::<Vec<_>>(), [EventKind::Rejected]);
    let stop = nullsweep_ipc_types::CommandKind::Stop;
    let commands = viewer.ipc.command_client().unwrap();
    // No answer, or, where the link counts as down just then, that it was not carried out.
    let answer = commands.call(stop, 0.0, Duration::from_secs(4)).map(|answer| answer.verdict);
    assert!(
        answer.is_err() || answer.is_ok_and(|v| v == Verdict::Busy.wire()),
        "no command either"
    );

    // The planner's does.
    let events = planner.ipc.event_receiver().unwrap();
    let mut publisher = planner.ipc.plan_publisher(200).unwrap();
    let plan = publisher.publish(&header, &knots).unwrap();
    let done = life(&events, plan, Duration::from_secs(20));
    assert_eq!(done.last().map(|(kind, _)| *kind), Some(EventKind::Finished), "{done:?}");
    let (code, text) = ask(planner.root.path(), &[&[&*plan.to_string()][..], &file].concat());
    assert!(code == Some(0) && text.contains(" finished\n"), "{text}");

    // Who has a certificate of another authority does not come in at all.
    assert!(!stranger.ipc.plan_publisher(1).unwrap().has_executor());
    let text = log(stranger.root.path(), "planner");
    assert!(!text.contains("the robot's end is there"), "{text}");
    let words = [&["--timeout", "2"][..], &file].concat();
    assert_eq!(ask(stranger.root.path(), &words).0, Some(4));
}
