//! Moments on `CLOCK_MONOTONIC` as other machines know them: by the wall clock.

use std::time::{SystemTime, UNIX_EPOCH};

use nullsweep_ipc_types::ports::now_ns;

/// The wall clock's time at a moment on `CLOCK_MONOTONIC`, in whole seconds and nanoseconds.
#[must_use]
pub fn wall_time(at_ns: u64) -> (i32, u32) {
    let total = i128::from(at_ns) + wall_ahead_ns();
    ((total / 1_000_000_000) as i32, (total % 1_000_000_000) as u32)
}

/// The moment on `CLOCK_MONOTONIC` at a time of the wall clock, 0 for one before the machine
/// started. \[ns\]
#[must_use]
pub fn moment(seconds: i32, nanoseconds: u32) -> u64 {
    let stamp = i128::from(seconds) * 1_000_000_000 + i128::from(nanoseconds);
    u64::try_from(stamp - wall_ahead_ns()).unwrap_or(0)
}

/// How far the wall clock is ahead of `CLOCK_MONOTONIC`. A thread that is interrupted between the
/// two readings would shift a stamp by that long, so they are taken again until they were close.
fn wall_ahead_ns() -> i128 {
    let read = || {
        let before = now_ns();
        let wall = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_nanos());
        let took = now_ns() - before;
        (took, wall as i128 - i128::from(before + took / 2))
    };
    let mut best = read();
    for _ in 0..20 {
        if best.0 < 1_000 {
            break;
        }
        best = best.min(read());
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_and_back_is_the_same_moment() {
        let now = now_ns();
        let (seconds, nanoseconds) = wall_time(now);
        let unix = SystemTime::now().duration_since(UNIX_EPOCH).expect("after 1970").as_secs();
        assert!((unix as i32 - seconds).abs() <= 1, "{seconds} against {unix}");
        assert!(moment(seconds, nanoseconds).abs_diff(now) < 1_000_000);
        assert_eq!(moment(0, 5), 0);
    }
}
