//! What makes a thread real-time: scheduling, locked memory, a clock grid, and a heap of its own.
//!
//! The one place of the executor with `unsafe`.
#![allow(unsafe_code, reason = "scheduling and allocation have no safe interface")]

mod grid;
mod pool;

use std::fmt;
use std::io;
use std::num::NonZeroU64;

use rustix::mm::{MlockAllFlags, mlockall};
use rustix::thread::{CpuSet, sched_setaffinity, set_current_timer_slack};

pub use grid::{Grid, Wake};
pub use pool::{PoolAllocator, PoolUse, arm, enter_pool, pool_use};

/// Stack that is touched before the loop starts. \[bytes\]
const STACK: usize = 256 << 10;

/// What was asked for and not granted. The executor warns once and runs on.
#[derive(Debug, Default)]
pub struct Denied {
    whats: Vec<(&'static str, io::Error)>,
}

impl Denied {
    /// Whether everything was granted.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.whats.is_empty()
    }

    fn note(&mut self, what: &'static str, result: io::Result<()>) -> bool {
        match result {
            Ok(()) => true,
            Err(e) => {
                self.whats.push((what, e));
                false
            }
        }
    }
}

impl fmt::Display for Denied {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, (what, e)) in self.whats.iter().enumerate() {
            write!(f, "{}{what} ({e})", if i > 0 { ", " } else { "" })?;
        }
        Ok(())
    }
}

/// Makes the calling thread real-time: `SCHED_FIFO` at `priority` (0 leaves the scheduler as it
/// is), pinned to `cpu`, all memory of the process locked as it is touched, stack touched. What is
/// not permitted is noted; whether FIFO was granted is returned beside it.
#[must_use]
pub fn become_real_time(priority: u8, cpu: Option<usize>) -> (bool, Denied) {
    let mut denied = Denied::default();
    denied.note("locking memory", lock_memory());
    if let Some(cpu) = cpu {
        let mut set = CpuSet::new();
        set.set(cpu);
        denied.note("pinning to a CPU", sched_setaffinity(None, &set).map_err(io::Error::from));
    }
    let fifo = priority > 0 && denied.note("SCHED_FIFO", set_fifo(priority));
    if !fifo {
        // Without FIFO the kernel may wake us up to 50 µs late to save power.
        let slack = set_current_timer_slack(NonZeroU64::new(1)).map_err(io::Error::from);
        denied.note("timer slack", slack);
    }
    touch_stack();
    (fifo, denied)
}

/// Whether a thread of this process can be pinned to `cpu`; else why not. CPUs that are kept free of
/// ordinary threads (`isolcpus`) are not in the process's own set and can be pinned to, so it is
/// tried.
///
/// # Errors
/// In words, where there is no such CPU or the process may not use it.
pub fn probe_cpu(cpu: usize) -> Result<(), String> {
    let pinned = std::thread::spawn(move || {
        if cpu >= CpuSet::MAX_CPU {
            return Err(io::Error::from(io::ErrorKind::InvalidInput));
        }
        let mut set = CpuSet::new();
        set.set(cpu);
        sched_setaffinity(None, &set).map_err(io::Error::from)
    });
    match pinned.join() {
        Ok(Err(e)) if e.kind() == io::ErrorKind::InvalidInput => {
            // SAFETY: sysconf only reads.
            let count = unsafe { libc::sysconf(libc::_SC_NPROCESSORS_ONLN) };
            Err(format!(
                "no such CPU can be used: {count} are online, counted from 0, and a container or \
                 cpuset may allow fewer"
            ))
        }
        Ok(Err(e)) => Err(format!("pinning is refused: {e}")),
        Ok(Ok(())) | Err(_) => Ok(()),
    }
}

/// Locks all memory of the process: what is there, code included, is brought in now, so that no
/// thread faults on it later. What is mapped later is locked as it is touched, because filling a
/// whole segment at once would take long.
///
/// # Errors
/// Where the system's limit on locked memory is too low.
pub fn lock_memory() -> io::Result<()> {
    mlockall(MlockAllFlags::CURRENT)?;
    Ok(mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE | MlockAllFlags::ONFAULT)?)
}

/// Gives the calling thread `SCHED_FIFO` at `priority`, where that is not 0 and is granted.
pub fn raise(priority: u8) {
    if priority > 0 {
        // What is denied here is denied to the loop too, which says so.
        let _ = set_fifo(priority);
    }
}

/// Has the process keep the memory that it frees: giving it back to the kernel interrupts every
/// processor that runs one of its threads, the loop's too, and getting it again faults.
pub fn keep_heap() {
    #[cfg(target_env = "gnu")]
    // SAFETY: mallopt only sets parameters of the allocator and is thread-safe.
    unsafe {
        libc::mallopt(libc::M_MMAP_MAX, 0);
        libc::mallopt(libc::M_TRIM_THRESHOLD, libc::c_int::MAX);
    }
}

/// Page faults of the calling thread so far: those served from memory, and from disk.
#[must_use]
pub fn page_faults() -> (i64, i64) {
    // SAFETY: an all-zero rusage is a valid value, and getrusage writes only to it.
    let usage = unsafe {
        let mut usage: libc::rusage = std::mem::zeroed();
        libc::getrusage(libc::RUSAGE_THREAD, &raw mut usage);
        usage
    };
    (usage.ru_minflt, usage.ru_majflt)
}

fn set_fifo(priority: u8) -> io::Result<()> {
    let param = libc::sched_param { sched_priority: libc::c_int::from(priority) };
    // SAFETY: pid 0 is the calling thread, and `param` outlives the call.
    let result = unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const param) };
    if result == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}

/// Writes to every page of the stack that the loop may come to use.
#[inline(never)]
fn touch_stack() {
    let mut stack = [0u8; STACK];
    for page in stack.iter_mut().step_by(4096) {
        *page = 1;
    }
    std::hint::black_box(&stack);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cpu_that_is_not_there_is_told() {
        // At least one of them can be used.
        assert!((0..CpuSet::MAX_CPU).any(|cpu| probe_cpu(cpu).is_ok()));
        for cpu in [CpuSet::MAX_CPU - 1, CpuSet::MAX_CPU, usize::MAX] {
            let why = probe_cpu(cpu).unwrap_err();
            assert!(why.contains("are online, counted from 0"), "{why}");
        }
    }
}
