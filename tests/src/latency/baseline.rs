//! What the machine can do without an executor: the yardsticks of the same run.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use bytemuck::Zeroable;
use nullsweep_executor::rt::become_real_time;
use nullsweep_ipc_types::Setpoint;
use nullsweep_ipc_types::ports::{Ipc, now_ns};

use super::station;
use super::stats::Times;
use crate::clock::Grid;

const PERIOD_NS: u64 = 1_000_000;

/// Wake-up lateness of a bare loop that sleeps to each deadline of a 1 kHz grid, in a thread with
/// the executor's own priority. A stall counts for every deadline that it passes, each with its
/// own lateness.
#[must_use]
pub(super) fn sleep_loop(time: Duration, priority: u8, cpu: Option<usize>) -> Times {
    thread::scope(|scope| {
        let loop_ = scope.spawn(|| {
            // What is denied here is denied to the executor too, which says so.
            let _ = become_real_time(priority, cpu);
            bare_loop(time)
        });
        loop_.join().unwrap_or_default()
    })
}

fn bare_loop(time: Duration) -> Times {
    let mut times = Times::default();
    let mut grid = Grid::new(PERIOD_NS);
    let end_ns = now_ns() + time.as_nanos() as u64;
    loop {
        let tick = grid.wait();
        for missed in 0..=tick.skipped {
            times.record(tick.now_ns - tick.due_ns - missed * PERIOD_NS);
        }
        if tick.now_ns >= end_ns {
            return times;
        }
    }
}

/// One way from a thread that sends a setpoint each millisecond to one that waits for it as the
/// lab's endpoint does, with nothing else done.
pub(super) fn ping(
    root: &Path,
    time: Duration,
    priority: u8,
    cpu: Option<usize>,
) -> anyhow::Result<Times> {
    let done = AtomicBool::new(false);
    thread::scope(|scope| {
        let receiving = scope.spawn(|| -> anyhow::Result<Times> {
            let receiver = Ipc::open("ping", Some(root))?.setpoint_receiver()?;
            let mut times = Times::default();
            let _ = become_real_time(priority.saturating_sub(1), None);
            let mut due_ns = now_ns();
            while !done.load(Ordering::Relaxed) {
                if let Some(setpoint) = station::wait(&receiver, due_ns)? {
                    times.record(now_ns().saturating_sub(setpoint.stamp_ns));
                    due_ns = setpoint.deadline_ns;
                }
            }
            Ok(times)
        });
        let sending = scope.spawn(|| {
            let _ = become_real_time(priority, cpu);
            send(root, time)
        });
        let sent = sending.join();
        done.store(true, Ordering::Relaxed);
        let died = |_| anyhow::anyhow!("a thread of the ping died");
        let times = receiving.join().map_err(died)?;
        sent.map_err(died)?.and(times)
    })
}

fn send(root: &Path, time: Duration) -> anyhow::Result<()> {
    let sender = Ipc::open("ping", Some(root))?.setpoint_sender()?;
    let mut grid = Grid::new(PERIOD_NS);
    let end_ns = now_ns() + time.as_nanos() as u64;
    let mut setpoint = Setpoint::zeroed();
    while setpoint.stamp_ns < end_ns {
        let tick = grid.wait();
        setpoint.deadline_ns = tick.due_ns + (tick.skipped + 1) * PERIOD_NS;
        setpoint.sequence += 1;
        setpoint.stamp_ns = now_ns();
        sender.send(&setpoint)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_yardsticks_measure_something() {
        let times = sleep_loop(Duration::from_millis(50), 0, None).percentiles();
        assert!(times.count >= 50 && times.max_ns > 0, "{times:?}");
        let folder = tempfile::TempDir::new().expect("a folder");
        let times =
            ping(folder.path(), Duration::from_millis(100), 0, None).expect("both ends open");
        assert!(times.percentiles().count > 0);
    }
}
