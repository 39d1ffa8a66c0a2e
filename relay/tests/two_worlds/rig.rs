//! The executor, its endpoint, and the relay's two ends.

use std::fs::File;
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use bytemuck::Zeroable;
use nullsweep_ipc_types::ports::{Ipc, Receiver, now_ns};
use nullsweep_ipc_types::{
    EventKind, JointStates, Knot, PlanEvent, PlanHeader, PlanId, Reason, Telemetry, status,
};
use nullsweep_robot::{Arm, ArmSpec, Robot, Side};
use tempfile::TempDir;

/// Holds the executor's arguments, in the process that is one.
const EXECUTOR: &str = "RELAY_TEST_EXECUTOR";
/// A test machine may be busy.
const PATIENT: &str = "--stale-ms 2000 --lost-ms 4000 --min-rate 0.02";

/// Not a test, but the executor: this binary starts itself again.
#[test]
fn executor() {
    if let Ok(arguments) = std::env::var(EXECUTOR) {
        nullsweep_executor::main_with(arguments.split(' '));
    }
}

/// A process that a test which fails does not leave behind.
pub(crate) struct Process(pub(crate) Child);

impl Process {
    pub(crate) fn end(&mut self) {
        let _ = Command::new("kill").arg(self.0.id().to_string()).status();
        let _ = self.0.wait();
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// One robot at a time: its executor runs before all else on the machine.
static ALONE: Mutex<()> = Mutex::new(());

/// What the endpoint saw.
#[derive(Debug, Default)]
pub(crate) struct Seen {
    pub(crate) setpoints: u64,
    /// Greatest step over its bound v·T·Δsequence; at most 1 is right.
    pub(crate) worst: f64,
}

/// The robot's host: an executor and its endpoint.
pub(crate) struct RobotHost {
    pub(crate) root: TempDir,
    pub(crate) ipc: Ipc,
    pub(crate) arm: Arm,
    pub(crate) executor: Process,
    over: Arc<AtomicBool>,
    endpoint: Option<JoinHandle<Seen>>,
    _alone: MutexGuard<'static, ()>,
}

fn arm() -> Arm {
    Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).unwrap()
}

impl RobotHost {
    pub(crate) fn start() -> Self {
        let alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
        let root = TempDir::new().unwrap();
        let ipc = Ipc::open("pr2", Some(root.path())).unwrap();
        let arguments = format!("executor run --ipc-root {} {PATIENT}", root.path().display());
        let executor = Command::new(std::env::current_exe().unwrap())
            .args(["rig::executor", "--exact", "--nocapture"])
            .env(EXECUTOR, arguments)
            .stdout(Stdio::null())
            .stderr(File::create(root.path().join("executor.log")).unwrap())
            .spawn()
            .unwrap();
        let over = Arc::new(AtomicBool::new(false));
        let (path, done) = (root.path().to_path_buf(), Arc::clone(&over));
        let endpoint =
            thread::spawn(move || endpoint(&Ipc::open("pr2", Some(&path)).unwrap(), &arm(), &done));
        let (executor, endpoint) = (Process(executor), Some(endpoint));
        Self { root, ipc, arm: arm(), executor, over, endpoint, _alone: alone }
    }

    /// Moves joint 0 by `angle` in `seconds` from where it is at `from`.
    pub(crate) fn line(&self, from: f64, angle: f64, seconds: f64) -> (PlanHeader, Vec<Knot>) {
        let dof = self.arm.dof();
        let knots: Vec<Knot> = (0..=100u32)
            .map(|i| {
                let u = f64::from(i) / 100.0;
                let mut knot = Knot::zeroed();
                knot.time_from_start_ns = (u * seconds * 1e9) as u64;
                knot.positions[..dof].copy_from_slice(&self.arm.home()[..dof]);
                knot.positions[0] += from + angle * u;
                knot
            })
            .collect();
        let held = self.arm.held_joints();
        let mut header = PlanHeader {
            fingerprint: self.arm.fingerprint(),
            joint_count: dof as u32,
            held_count: held.len() as u32,
            corners: 1,
            ..PlanHeader::default()
        };
        for (to, joint) in header.held_positions.iter_mut().zip(held) {
            *to = joint.position;
        }
        (header, knots)
    }

    /// Ends executor and endpoint; what the latter saw.
    pub(crate) fn finish(&mut self) -> Seen {
        self.executor.end();
        self.over.store(true, Ordering::Release);
        self.endpoint.take().unwrap().join().unwrap()
    }
}

impl Drop for RobotHost {
    fn drop(&mut self) {
        show_where_it_failed(self.root.path(), "robot");
        self.over.store(true, Ordering::Release);
    }
}

/// Follows each setpoint at once and judges it.
fn endpoint(ipc: &Ipc, arm: &Arm, over: &AtomicBool) -> Seen {
    let states = ipc.state_sender().unwrap();
    let setpoints = ipc.setpoint_receiver().unwrap();
    let mut state = JointStates {
        joint_count: arm.dof() as u32,
        held_count: arm.held_joints().len() as u32,
        status: status::CALIBRATED,
        ..JointStates::zeroed()
    };
    state.positions[..arm.dof()].copy_from_slice(&arm.home()[..arm.dof()]);
    for (to, joint) in state.held_positions.iter_mut().zip(arm.held_joints()) {
        *to = joint.position;
    }
    let mut seen = Seen::default();
    while !over.load(Ordering::Acquire) {
        while let Some(setpoint) = setpoints.receive().unwrap() {
            let ahead = setpoint.sequence.saturating_sub(state.setpoint_sequence).max(1) as f64;
            for (j, limits) in arm.limits().iter().enumerate() {
                let step = (setpoint.positions[j] - state.positions[j]).abs();
                let most = limits.velocity * 1e-3 * ahead * (1.0 + 1e-6) + 1e-9;
                seen.worst = seen.worst.max(step / most);
            }
            seen.setpoints += 1;
            state.setpoint_sequence = setpoint.sequence;
            state.setpoint_received_ns = now_ns();
            state.positions = setpoint.positions;
        }
        state.sequence += 1;
        state.stamp_ns = now_ns();
        states.send(&state).unwrap();
        thread::sleep(Duration::from_millis(1));
    }
    seen
}

pub(crate) fn relay() -> Command {
    Command::new(env!("CARGO_BIN_EXE_relay"))
}

/// An end of the relay, its log in a file of `folder`.
pub(crate) fn end(folder: &Path, root: Option<&Path>, words: &[&str]) -> Process {
    end_of(relay(), folder, root, words)
}

/// The same by a command that starts it.
pub(crate) fn end_of(
    mut command: Command,
    folder: &Path,
    root: Option<&Path>,
    words: &[&str],
) -> Process {
    command.args(words).current_dir(folder).env("NULLSWEEP_CELL", "");
    if let Some(root) = root {
        command.arg("--ipc-root").arg(root);
    }
    let log = File::options().create(true).append(true).open(log_of(folder, words[0])).unwrap();
    Process(command.stdout(Stdio::null()).stderr(log).spawn().unwrap())
}

fn log_of(folder: &Path, end: &str) -> std::path::PathBuf {
    folder.join(format!("{end}.log"))
}

/// What an end has said.
pub(crate) fn log(folder: &Path, end: &str) -> String {
    std::fs::read_to_string(log_of(folder, end)).unwrap_or_default()
}

/// `relay ask`, to its end.
pub(crate) fn ask(folder: &Path, words: &[&str]) -> (Option<i32>, String) {
    let mut command = relay();
    command.arg("ask").args(words).current_dir(folder).env("NULLSWEEP_CELL", "");
    let Output { status, stdout, stderr } = command.output().unwrap();
    let text = String::from_utf8_lossy(&stdout) + String::from_utf8_lossy(&stderr);
    (status.code(), text.into_owned())
}

/// An endpoint of zenoh's that nobody listens on.
pub(crate) fn free(protocol: &str) -> (String, u16) {
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    (format!("{protocol}/127.0.0.1:{port}"), port)
}

/// The planners' host.
pub(crate) struct PlannerHost {
    pub(crate) root: TempDir,
    pub(crate) ipc: Ipc,
}

impl PlannerHost {
    pub(crate) fn new() -> Self {
        let root = TempDir::new().unwrap();
        let ipc = Ipc::open("pr2", Some(root.path())).unwrap();
        Self { root, ipc }
    }

    /// Waits until somebody stands in the executor's place.
    pub(crate) fn wait(&self) {
        let publisher = self.ipc.plan_publisher(1).unwrap();
        wait_for("an executor in the planners' world", || publisher.has_executor());
    }
}

impl Drop for PlannerHost {
    fn drop(&mut self) {
        show_where_it_failed(self.root.path(), "planner");
    }
}

fn show_where_it_failed(folder: &Path, end: &str) {
    if thread::panicking() {
        eprintln!("the log of the {end}'s end:\n{}", log(folder, end));
    }
}

/// Waits until it is so.
pub(crate) fn wait_for(what: &str, mut is_so: impl FnMut() -> bool) {
    let end = Instant::now() + Duration::from_secs(60);
    while !is_so() {
        assert!(Instant::now() < end, "no {what}");
        thread::sleep(Duration::from_millis(5));
    }
}

/// The events of a plan, until its end or a rejection.
pub(crate) fn life(
    events: &Receiver<PlanEvent>,
    id: PlanId,
    within: Duration,
) -> Vec<(EventKind, Reason)> {
    let end = Instant::now() + within;
    let mut life = Vec::new();
    while Instant::now() < end {
        let Some(event) = events.receive().unwrap() else {
            thread::sleep(Duration::from_millis(1));
            continue;
        };
        if event.plan != id {
            continue;
        }
        let kind = EventKind::from_wire(event.kind).unwrap();
        life.push((kind, Reason::from_wire(event.reason).unwrap()));
        if !matches!(kind, EventKind::Accepted | EventKind::Started) {
            break;
        }
    }
    life
}

/// The telemetry that comes next.
pub(crate) fn newest(telemetry: &Receiver<Telemetry>) -> Telemetry {
    while telemetry.receive().unwrap().is_some() {}
    let mut found = None;
    wait_for("telemetry", || {
        found = telemetry.newest().unwrap();
        found.is_some()
    });
    found.unwrap().value
}
