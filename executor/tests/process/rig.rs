//! The executor as a process, and an endpoint in a thread of the test.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use bytemuck::Zeroable;
use nullsweep_ipc_types::ports::{CommandClient, Ipc, Receiver, now_ns};
use nullsweep_ipc_types::{
    CommandKind, EventKind, JointStates, Knot, Mode, PlanEvent, PlanHeader, PlanId, Reason, status,
};
use nullsweep_robot::{Arm, ArmSpec, Robot, Side};
use tempfile::TempDir;

/// A test machine may be busy: the bounds are wide where the test is not about them.
pub(crate) const PATIENT: &[&str] =
    &["--stale-ms", "500", "--lost-ms", "2000", "--min-rate", "0.05"];

/// What the endpoint saw.
#[derive(Debug, Default)]
pub(crate) struct Seen {
    pub(crate) setpoints: u64,
    /// Greatest step over its bound v·T·Δsequence; at most 1 is right.
    pub(crate) worst: f64,
    pub(crate) disabled: bool,
    pub(crate) last: [f64; 16],
}

pub(crate) struct System {
    pub(crate) root: TempDir,
    pub(crate) executor: Executor,
    pub(crate) log: JoinHandle<Vec<String>>,
    pub(crate) endpoint: JoinHandle<Seen>,
    pub(crate) over: Arc<AtomicBool>,
    pub(crate) ipc: Ipc,
    pub(crate) arm: Arm,
}

fn arm() -> Arm {
    Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).unwrap()
}

/// The process; a test that fails leaves none behind.
pub(crate) struct Executor(pub(crate) Child);

impl Drop for Executor {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The program with these arguments.
pub(crate) fn command(arguments: &[&str], stderr: Stdio) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_executor"));
    command.args(arguments).stderr(stderr);
    command
}

pub(crate) fn executor(root: &TempDir, more: &[&str]) -> Executor {
    start(root, more, Stdio::piped())
}

fn start(root: &TempDir, more: &[&str], stderr: Stdio) -> Executor {
    let here = root.path().to_str().unwrap();
    Executor(command(&["run", "--ipc-root", here], stderr).args(more).spawn().unwrap())
}

impl System {
    pub(crate) fn start() -> Self {
        Self::start_with(&[])
    }

    /// With more arguments; `ROOT` in one stands for the root folder.
    pub(crate) fn start_with(more: &[&str]) -> Self {
        Self::start_to(more, None)
    }

    /// With another standard error than a pipe into the log.
    pub(crate) fn start_to(more: &[&str], stderr: Option<Stdio>) -> Self {
        let root = TempDir::new().unwrap();
        let ipc = Ipc::open("pr2", Some(root.path())).unwrap();
        let here = root.path().to_str().unwrap();
        let more: Vec<String> = more.iter().map(|a| a.replace("ROOT", here)).collect();
        let arguments: Vec<&str> =
            PATIENT.iter().copied().chain(more.iter().map(String::as_str)).collect();
        let mut executor = start(&root, &arguments, stderr.unwrap_or_else(Stdio::piped));
        let lines = executor.0.stderr.take().map(|pipe| BufReader::new(pipe).lines());
        let log = thread::spawn(move || {
            lines.map(|lines| lines.map_while(Result::ok).collect()).unwrap_or_default()
        });
        let over = Arc::new(AtomicBool::new(false));
        let endpoint = {
            let (path, over) = (root.path().to_path_buf(), over.clone());
            thread::spawn(move || endpoint(&Ipc::open("pr2", Some(&path)).unwrap(), &arm(), &over))
        };
        let system = Self { root, executor, log, endpoint, over, ipc, arm: arm() };
        system.wait_for(Mode::Hold);
        system
    }

    /// Where the arm starts.
    pub(crate) fn home(&self) -> [f64; 16] {
        let mut home = [0.0; 16];
        home[..8].copy_from_slice(&self.arm.home()[..]);
        home
    }

    pub(crate) fn client(&self) -> CommandClient {
        self.ipc.command_client().unwrap()
    }

    pub(crate) fn wait_for(&self, mode: Mode) {
        let client = self.client();
        let end = Instant::now() + Duration::from_secs(20);
        let mut last = None;
        while Instant::now() < end {
            last = client.call(CommandKind::Status, 0.0, Duration::from_secs(1)).ok();
            if last.is_some_and(|r| r.mode == mode.wire()) {
                return;
            }
            thread::sleep(Duration::from_millis(5));
        }
        panic!("no {mode}: {last:?}");
    }

    /// Moves joint 0 by `angle` in `seconds` from `from`.
    pub(crate) fn line(
        &self,
        from: [f64; 16],
        angle: f64,
        seconds: f64,
    ) -> (PlanHeader, Vec<Knot>) {
        let knots: Vec<Knot> = (0..=100u32)
            .map(|i| {
                let u = f64::from(i) / 100.0;
                let mut knot = Knot::zeroed();
                knot.time_from_start_ns = (u * seconds * 1e9) as u64;
                knot.positions = from;
                knot.positions[0] += angle * u;
                knot
            })
            .collect();
        let held = self.arm.held_joints();
        let mut header = PlanHeader {
            fingerprint: self.arm.fingerprint(),
            joint_count: self.arm.dof() as u32,
            held_count: held.len() as u32,
            ..PlanHeader::default()
        };
        for (to, joint) in header.held_positions.iter_mut().zip(held) {
            *to = joint.position;
        }
        (header, knots)
    }

    /// The endpoint sends no more.
    pub(crate) fn silence(&self) {
        self.over.store(true, Ordering::Release);
    }

    pub(crate) fn terminate(&self) {
        let kill = Command::new("kill").arg(self.executor.0.id().to_string()).status().unwrap();
        assert!(kill.success());
    }

    pub(crate) fn end(self) -> (Seen, Vec<String>) {
        self.terminate();
        self.finish()
    }

    pub(crate) fn finish(mut self) -> (Seen, Vec<String>) {
        let status = self.executor.0.wait().unwrap();
        self.over.store(true, Ordering::Release);
        let log = self.log.join().unwrap();
        assert!(status.success(), "{status}: {log:#?}");
        drop(self.root);
        (self.endpoint.join().unwrap(), log)
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
    let mut seen = Seen { last: state.positions, ..Seen::default() };
    while !over.load(Ordering::Acquire) {
        while let Some(setpoint) = setpoints.receive().unwrap() {
            // A sequence that falls is another executor's.
            let ahead = setpoint.sequence.saturating_sub(state.setpoint_sequence).max(1) as f64;
            for (j, limits) in arm.limits().iter().enumerate() {
                let step = (setpoint.positions[j] - seen.last[j]).abs();
                let most = limits.velocity * 1e-3 * ahead * (1.0 + 1e-6) + 1e-9;
                seen.worst = seen.worst.max(step / most);
            }
            seen.setpoints += 1;
            seen.last = setpoint.positions;
            seen.disabled = setpoint.disable != 0;
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

pub(crate) fn next(events: &Receiver<PlanEvent>, id: PlanId) -> (EventKind, Reason) {
    let end = Instant::now() + Duration::from_secs(20);
    while Instant::now() < end {
        if let Some(event) = events.receive().unwrap() {
            if event.plan == id {
                let kind = EventKind::from_wire(event.kind).unwrap();
                return (kind, Reason::from_wire(event.reason).unwrap());
            }
        } else {
            thread::sleep(Duration::from_millis(1));
        }
    }
    panic!("no event of plan {id}");
}

/// Its exit code; none where a signal ended it.
pub(crate) fn wait(child: &mut Child) -> Option<i32> {
    let end = Instant::now() + Duration::from_secs(20);
    while Instant::now() < end {
        if let Some(status) = child.try_wait().expect("known") {
            return status.code();
        }
        thread::sleep(Duration::from_millis(5));
    }
    panic!("it does not end");
}
