//! The three threads together: start, run, stop.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use nullsweep_ipc_types::ports::{Ipc, IpcError, now_ns};
use nullsweep_ipc_types::{HISTOGRAM_BUCKETS, MAX_HELD_JOINTS, Mode, bucket_upper_ns};
use nullsweep_robot::{Arm, JointKind};

use crate::admit::Rules;
use crate::alarm::Alarm;
use crate::driver::Driver;
use crate::guard::Guard;
use crate::hardware::{Hardware, IpcHardware};
use crate::journal::Journal;
use crate::record::{Recorder, Tape};
use crate::rt::{self, Grid};
use crate::service::Service;
use crate::slots::Slots;
use crate::words::Words;
use crate::worker::Worker;

/// Cycles that go on after a shutdown's stand-still, so that the endpoint hears the disable.
const AFTERGLOW: u32 = 50;
/// Least cycles from the first Hold until the loop counts as armed: by then every port was used.
const WARM_UP: u32 = 200;
/// Highest `SCHED_FIFO` priority of worker and service: above what is not real-time, below what is.
const HELPERS: u8 = 5;
/// How long a shutdown may take before the threads are left behind.
const SHUTDOWN_WITHIN: Duration = Duration::from_secs(5);
/// How long opening the ports may take, whatever is in the way.
const OPEN_WITHIN: Duration = Duration::from_secs(15);
/// How long the threads may take to end.
const LEAVE_WITHIN: Duration = Duration::from_secs(10);
/// The same where they still open their ports.
const LEAVE_UNOPENED_WITHIN: Duration = Duration::from_millis(200);

/// How an executor runs.
#[derive(Clone, Debug)]
pub struct Config {
    /// The robot's name in the services' names.
    pub robot_name: String,
    /// Isolates this system from others on the machine.
    pub ipc_root: Option<PathBuf>,
    /// The executor's own bounds; made from the arm's limits, see [`Guard::new`].
    pub guard: Guard,
    /// How far a held joint may be from where a plan takes it. \[rad\] or \[m\]
    pub held_tolerance: f64,
    /// `SCHED_FIFO` priority of the loop, 0 for the default scheduler. Worker and service get one
    /// of at most 5.
    pub priority: u8,
    /// The CPU that the loop is pinned to.
    pub cpu: Option<usize>,
    /// The last part of each period that is spent spinning, where FIFO is granted. \[ns\]
    pub spin_ns: u64,
    /// Folder of the flight recorder, and the size of each of its two files. \[bytes\]
    pub record: Option<(PathBuf, u64)>,
    /// Lines of the log that were lost, as whoever writes it counts them; told in telemetry.
    pub lost_lines: Arc<AtomicU64>,
}

/// Why an executor could not start or run to a clean end.
#[derive(Debug, thiserror::Error)]
pub enum ExecutorError {
    /// A port could not be opened.
    #[error(transparent)]
    Ipc(#[from] IpcError),
    /// The robot has more held joints than a plan can carry.
    #[error("the robot has {count} joints beside the arm, a plan carries at most {most}")]
    HeldJoints {
        /// How many it has.
        count: usize,
        /// How many may be.
        most: usize,
    },
    /// The flight recorder's folder cannot be used.
    #[error("flight recorder: {}: {error}", .folder.display())]
    Record {
        /// The folder.
        folder: PathBuf,
        /// Why.
        error: std::io::Error,
    },
    /// A thread could not be started.
    #[error("a thread could not be started: {0}")]
    Thread(#[from] std::io::Error),
    /// A thread panicked.
    #[error("the {0} thread ended unexpectedly")]
    Died(&'static str),
    /// A thread does not end, or has not opened its ports.
    #[error(
        "the {thread} thread hangs: where that is at the start, look for files of length 0 in \
         /dev/shm and for processes of this robot that are stopped"
    )]
    Hangs {
        /// Its name.
        thread: &'static str,
    },
    /// The loop did not come to a stand-still.
    #[error("the loop did not stop within {} s", .0.as_secs())]
    Stuck(Duration),
}

/// What a run did, told at its end.
#[derive(Clone, Copy, Debug, Default)]
pub struct Summary {
    /// Cycles since the start.
    pub cycles: u64,
    /// Deadlines missed.
    pub missed: u64,
    /// Cycles since the loop was armed.
    pub armed_cycles: u64,
    /// Calls into the system's heap by the armed loop.
    pub heap_calls: u64,
    /// Blocks that its own pool gave.
    pub pool_calls: u64,
    /// Page faults of the armed loop.
    pub page_faults: i64,
    /// Reads and writes at the endpoint that failed.
    pub failures: u64,
    /// Wake-up lateness, see [`nullsweep_ipc_types::bucket_upper_ns`].
    pub lateness: [u32; HISTOGRAM_BUCKETS],
    /// Compute time a cycle.
    pub compute: [u32; HISTOGRAM_BUCKETS],
}

/// The time below which a share of a histogram's samples lies: the upper bound of their bucket,
/// `None` past the last bound. \[ns\]
#[must_use]
pub fn quantile_ns(histogram: &[u32; HISTOGRAM_BUCKETS], share: f64) -> Option<u64> {
    let total: u64 = histogram.iter().map(|n| u64::from(*n)).sum();
    let mut below = 0u64;
    for (bucket, count) in histogram[..HISTOGRAM_BUCKETS - 1].iter().enumerate() {
        below += u64::from(*count);
        if below as f64 >= share * total as f64 {
            return Some(bucket_upper_ns(bucket));
        }
    }
    None
}

/// Runs an executor for `arm` until `alarm` shuts it down, then stops on the path, disables the
/// motors, tells every plan's end, and returns. Whatever hangs is left behind.
///
/// # Errors
/// When another executor runs, a port is taken or cannot be opened, or a thread died or hangs.
pub fn run(arm: &Arm, config: &Config, alarm: &Alarm) -> Result<Summary, ExecutorError> {
    rt::keep_heap();
    let rules = rules(arm, config)?;
    let Slots { looping, worker, service } = Slots::default();
    let (recorder, tape) = recorder(config)?.unzip();
    let signs = Arc::new(Signs::default());
    let worker = spawn("worker", config, &signs, move |config, signs| {
        rt::raise(helper_priority(config));
        let ipc = open(config)?;
        let worker = Worker::open(&ipc, worker, rules, recorder)?;
        signs.open.fetch_add(1, Ordering::Release);
        worker.run(&signs.done);
        Ok(())
    })?;
    let own = arm.clone();
    let service = spawn("service", config, &signs, move |config, signs| {
        rt::raise(helper_priority(config));
        let ipc = open(config)?;
        let journal = Journal::new(Words::of(&own, &config.robot_name));
        let lost = config.lost_lines.clone();
        let service = Service::open(&ipc, service, own.dof(), journal, lost)?;
        signs.open.fetch_add(1, Ordering::Release);
        service.run(&signs.done);
        Ok(())
    })?;
    let helpers = [worker, service];
    let ended = || helpers.iter().any(JoinHandle::is_finished);
    // The loop comes last: whoever sees it hold can publish plans and command it.
    if !opened(&signs, 2, &|| alarm.is_shutting_down() || ended()) {
        return unopened(&signs, alarm, None, helpers);
    }
    let own = alarm.clone();
    let looping = spawn("loop", config, &signs, move |config, signs| {
        // Before the first port, so that all their blocks are the pool's.
        rt::enter_pool();
        let ipc = open(config)?;
        let hardware = IpcHardware::open(&ipc)?;
        signs.open.fetch_add(1, Ordering::Release);
        let mut driver = Driver::new(hardware, config.guard, looping);
        driver.heed(own);
        if let Some(tape) = tape {
            driver.record(tape);
        }
        Ok(run_loop(driver, config, signs))
    })?;
    let over = || ended() || looping.is_finished();
    if !opened(&signs, 3, &|| alarm.is_shutting_down() || over()) {
        return unopened(&signs, alarm, Some(looping), helpers);
    }
    let stops = watch(&signs, alarm, &looping, &over);
    let result = end(&signs, Some(looping), helpers, LEAVE_WITHIN);
    if stops { result } else { Err(ExecutorError::Stuck(SHUTDOWN_WITHIN)) }
}

/// The end of a run whose ports were not all opened: asked for, or because of what went wrong.
fn unopened(
    signs: &Signs,
    alarm: &Alarm,
    looping: Option<Running<Summary>>,
    helpers: [Running<()>; 2],
) -> Result<Summary, ExecutorError> {
    // Nothing moves yet: what still opens its ports need not be waited for.
    match end(signs, looping, helpers, LEAVE_UNOPENED_WITHIN) {
        Err(ExecutorError::Hangs { .. }) if alarm.is_shutting_down() => Ok(Summary::default()),
        result => result,
    }
}

/// Waits until so many threads have opened their ports, unless it is `over`; whether they have.
fn opened(signs: &Signs, wanted: u32, over: &dyn Fn() -> bool) -> bool {
    let start = Instant::now();
    while signs.open.load(Ordering::Acquire) < wanted && !over() && start.elapsed() < OPEN_WITHIN {
        thread::sleep(Duration::from_millis(1));
    }
    signs.open.load(Ordering::Acquire) >= wanted
}

/// Waits for the loop's end, and asks for it where another thread has ended. Whether it comes in
/// time.
fn watch(
    signs: &Signs,
    alarm: &Alarm,
    looping: &Running<Summary>,
    ended: &dyn Fn() -> bool,
) -> bool {
    let mut told: Option<Instant> = None;
    while !looping.is_finished() {
        thread::sleep(Duration::from_millis(5));
        if signs.holds.load(Ordering::Acquire) && !signs.locked.load(Ordering::Relaxed) {
            // The endpoint's memory too, which came after the loop's thread locked its own.
            // What is denied here was denied there, which said so.
            let _ = rt::lock_memory();
            signs.locked.store(true, Ordering::Release);
        }
        if ended() {
            alarm.shut_down();
        }
        if alarm.is_shutting_down() {
            let told = told.get_or_insert_with(Instant::now);
            if told.elapsed() > SHUTDOWN_WITHIN {
                return false;
            }
        }
    }
    true
}

/// Has all threads end, and tells what the loop did or what was wrong.
fn end(
    signs: &Signs,
    looping: Option<Running<Summary>>,
    helpers: [Running<()>; 2],
    limit: Duration,
) -> Result<Summary, ExecutorError> {
    signs.done.store(true, Ordering::Release);
    let start = Instant::now();
    let running = || {
        looping.as_ref().is_some_and(|looping| !looping.is_finished())
            || helpers.iter().any(|helper| !helper.is_finished())
    };
    while running() && start.elapsed() < limit {
        thread::sleep(Duration::from_millis(1));
    }
    let summary = looping.map_or(Ok(Summary::default()), |looping| joined("loop", looping));
    let [worker, service] = helpers;
    let mut wrong = Vec::from_iter(joined("service", service).err());
    wrong.extend(joined("worker", worker).err());
    let summary = summary.map_err(|e| wrong.push(e)).unwrap_or_default();
    // What kept a thread from its work says more than that another one hangs.
    wrong.sort_by_key(|e| matches!(e, ExecutorError::Hangs { .. }));
    wrong.into_iter().next().map_or(Ok(summary), Err)
}

/// What the threads tell each other of a run's beginning and end.
#[derive(Debug, Default)]
struct Signs {
    /// Threads whose ports are open.
    open: AtomicU32,
    /// The loop has come to its first Hold.
    holds: AtomicBool,
    /// All memory that was there by then is locked.
    locked: AtomicBool,
    /// All threads shall end.
    done: AtomicBool,
}

/// The real-time loop itself.
fn run_loop<H: Hardware>(mut driver: Driver<H>, config: &Config, signs: &Signs) -> Summary {
    let (fifo, denied) = rt::become_real_time(config.priority, config.cpu);
    if !denied.is_empty() {
        tracing::warn!(
            "not real-time: {denied}. The loop runs on, later than it should. Give the process \
             CAP_SYS_NICE and CAP_IPC_LOCK, or raise `ulimit -r` and `ulimit -l`."
        );
    }
    let mut grid = Grid::start(config.guard.period_ns, if fifo { config.spin_ns } else { 0 });
    let mut held = 0;
    let mut afterglow = 0;
    let mut armed: Option<(u64, i64)> = None;
    let mut summary = Summary::default();
    while afterglow < AFTERGLOW && !signs.done.load(Ordering::Acquire) {
        let wake = grid.wait(|deadline_ns| driver.rehearse(deadline_ns));
        driver.cycle(wake);
        driver.account(wake);
        summary.cycles += 1;
        summary.missed += u64::from(wake.missed);
        if driver.state().is_down() {
            afterglow += 1;
        }
        if armed.is_none() && (held > 0 || driver.mode() == Mode::Hold) {
            held += 1;
            signs.holds.store(true, Ordering::Release);
            if held >= WARM_UP && signs.locked.load(Ordering::Acquire) {
                armed = Some((summary.cycles, faults()));
                rt::arm(true);
            }
        }
    }
    rt::arm(false);
    if let Some((cycle, faults_then)) = armed {
        summary.armed_cycles = summary.cycles - cycle;
        summary.page_faults = faults() - faults_then;
    }
    let pool = rt::pool_use();
    summary.heap_calls = pool.heap_calls;
    summary.pool_calls = pool.pool_calls;
    summary.failures = driver.failures();
    (summary.lateness, summary.compute) = driver.histograms();
    summary
}

fn faults() -> i64 {
    let (minor, major) = rt::page_faults();
    minor + major
}

/// The worker and the service sleep most of the time, but a plan or a command shall not wait for
/// whatever else runs on the machine.
fn helper_priority(config: &Config) -> u8 {
    config.priority.min(HELPERS)
}

fn rules(arm: &Arm, config: &Config) -> Result<Rules, ExecutorError> {
    let held = arm.held_joints();
    if held.len() > MAX_HELD_JOINTS {
        return Err(ExecutorError::HeldJoints { count: held.len(), most: MAX_HELD_JOINTS });
    }
    let robot = arm.robot();
    let continuous = |name: &str| {
        robot.joints().iter().any(|j| j.name == name && j.kind == JointKind::Continuous)
    };
    Ok(Rules {
        guard: config.guard,
        fingerprint: arm.fingerprint(),
        held_continuous: held.iter().map(|h| continuous(&h.name)).collect(),
        held_tolerance: config.held_tolerance,
        since_ns: now_ns(),
    })
}

fn recorder(config: &Config) -> Result<Option<(Recorder, Tape)>, ExecutorError> {
    let Some((folder, limit)) = &config.record else { return Ok(None) };
    Recorder::new(folder, *limit, config.guard)
        .map(Some)
        .map_err(|error| ExecutorError::Record { folder: folder.clone(), error })
}

fn open(config: &Config) -> Result<Ipc, IpcError> {
    Ipc::open(&config.robot_name, config.ipc_root.as_deref())
}

type Running<T> = JoinHandle<Result<T, ExecutorError>>;

fn spawn<T: Send + 'static>(
    name: &str,
    config: &Config,
    signs: &Arc<Signs>,
    run: impl FnOnce(&Config, &Signs) -> Result<T, ExecutorError> + Send + 'static,
) -> std::io::Result<Running<T>> {
    let (config, signs) = (config.clone(), signs.clone());
    thread::Builder::new().name(name.into()).spawn(move || run(&config, &signs))
}

/// What a thread ended with; one that has not ended is left behind.
fn joined<T>(name: &'static str, thread: Running<T>) -> Result<T, ExecutorError> {
    if !thread.is_finished() {
        return Err(ExecutorError::Hangs { thread: name });
    }
    thread.join().map_err(|_| ExecutorError::Died(name))?
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_upper_bounds() {
        let mut histogram = [0; HISTOGRAM_BUCKETS];
        assert_eq!(quantile_ns(&histogram, 0.5), Some(bucket_upper_ns(0)));
        histogram[3] = 98;
        histogram[10] = 1;
        histogram[HISTOGRAM_BUCKETS - 1] = 1;
        assert_eq!(quantile_ns(&histogram, 0.98), Some(bucket_upper_ns(3)));
        assert_eq!(quantile_ns(&histogram, 0.99), Some(bucket_upper_ns(10)));
        assert_eq!(quantile_ns(&histogram, 0.995), None);
    }
}
