//! What the machine can do without an executor: the yardsticks of the same run.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use bytemuck::Zeroable;
use nullsweep_executor::rt::{self, become_real_time};
use nullsweep_ipc_types::ports::{Ipc, now_ns};
use nullsweep_ipc_types::{JointStates, Setpoint};

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

/// What a loop takes that waits as the executor does, reads a state and sends a setpoint, and
/// does nothing else.
#[derive(Clone, Debug, Default)]
pub(super) struct Bare {
    /// From its wake-up to its end, each cycle.
    pub(super) compute: Times,
    /// From the setpoint's stamp to the hand of a reader that waits as the lab's endpoint does.
    pub(super) one_way: Times,
}

/// Runs that loop and its reader, which answers each setpoint with a state.
pub(super) fn bare(
    root: &Path,
    time: Duration,
    priority: u8,
    cpu: Option<usize>,
    spin_ns: u64,
) -> anyhow::Result<Bare> {
    let done = AtomicBool::new(false);
    thread::scope(|scope| {
        let receiving = scope.spawn(|| -> anyhow::Result<Times> {
            let ipc = Ipc::open("bare", Some(root))?;
            let (receiver, sender) = (ipc.setpoint_receiver()?, ipc.state_sender()?);
            let (mut times, mut state) = (Times::default(), JointStates::zeroed());
            let _ = become_real_time(priority.saturating_sub(1), None);
            let mut due_ns = now_ns();
            while !done.load(Ordering::Relaxed) {
                if let Some(setpoint) = station::wait(&receiver, due_ns)? {
                    let now = now_ns();
                    times.record(now.saturating_sub(setpoint.stamp_ns));
                    due_ns = setpoint.deadline_ns;
                    state.stamp_ns = now;
                    state.setpoint_sequence = setpoint.sequence;
                    sender.send(&state)?;
                }
            }
            Ok(times)
        });
        let sending = scope.spawn(|| {
            let (fifo, _) = become_real_time(priority, cpu);
            send(root, time, if fifo { spin_ns } else { 0 })
        });
        let sent = sending.join();
        done.store(true, Ordering::Relaxed);
        let died = |_| anyhow::anyhow!("a thread of the bare loop died");
        let one_way = receiving.join().map_err(died)?;
        Ok(Bare { compute: sent.map_err(died)??, one_way: one_way? })
    })
}

fn send(root: &Path, time: Duration, spin_ns: u64) -> anyhow::Result<Times> {
    let ipc = Ipc::open("bare", Some(root))?;
    let (sender, receiver) = (ipc.setpoint_sender()?, ipc.state_receiver()?);
    let mut times = Times::default();
    let mut grid = rt::Grid::start(PERIOD_NS, spin_ns);
    let end_ns = now_ns() + time.as_nanos() as u64;
    let mut setpoint = Setpoint::zeroed();
    while setpoint.stamp_ns < end_ns {
        let wake = grid.wait(|_| ());
        if let Some(newest) = receiver.newest()? {
            setpoint.positions = newest.value.positions;
        }
        setpoint.deadline_ns = wake.deadline_ns + PERIOD_NS;
        setpoint.sequence += 1;
        setpoint.stamp_ns = now_ns();
        sender.send(&setpoint)?;
        times.record(now_ns() - wake.now_ns);
    }
    Ok(times)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_yardsticks_measure_something() {
        let times = sleep_loop(Duration::from_millis(50), 0, None).percentiles();
        assert!(times.count >= 50 && times.max_ns > 0, "{times:?}");
        let folder = tempfile::TempDir::new().expect("a folder");
        let bare = bare(folder.path(), Duration::from_millis(100), 0, None, 0).expect("both open");
        assert!(bare.one_way.percentiles().count > 0);
        assert!(bare.compute.percentiles().count > 0);
    }
}
