//! One executor at a time, and another one after it.

use std::io::{BufRead, BufReader, Read};
use std::thread;

use nullsweep_ipc_types::Mode;
use nullsweep_ipc_types::ports::IpcError;

use crate::rig::{PATIENT, System, executor};

#[test]
fn a_second_executor_is_refused_and_a_killed_one_replaced() {
    let mut system = System::start();
    let mut second = executor(&system.root, PATIENT);
    let mut text = String::new();
    second.0.stderr.take().unwrap().read_to_string(&mut text).unwrap();
    assert!(!second.0.wait().unwrap().success());
    assert!(text.contains("all places are taken"), "{text}");
    system.wait_for(Mode::Hold);

    system.executor.0.kill().unwrap();
    system.executor.0.wait().unwrap();
    let mut publisher = system.ipc.plan_publisher(2).unwrap();
    let (header, knots) = system.line([0.0; 16], 0.1, 1.0);
    // The dead one's port is there until somebody sweeps; then a publication says so.
    system.ipc.sweep_dead_nodes();
    let e = publisher.publish(&header, &knots[..2]).unwrap_err();
    assert!(matches!(e, IpcError::NoExecutor { .. }), "{e}");
    system.executor = executor(&system.root, PATIENT);
    let lines = BufReader::new(system.executor.0.stderr.take().unwrap()).lines();
    system.log = thread::spawn(move || lines.map_while(Result::ok).collect());
    system.wait_for(Mode::Hold);
    system.end();
}
