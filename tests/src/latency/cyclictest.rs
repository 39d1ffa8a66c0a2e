//! cyclictest, the common yardstick, where it is installed.

use std::io;
use std::process::Command;
use std::time::Duration;

use anyhow::{Context, ensure};

use super::stats::Times;

/// Longest lateness that its histogram tells apart. \[µs\]
const LONGEST_US: u64 = 100_000;

/// What is said where it is not installed.
pub(super) const ABSENT: &str = "cyclictest is not installed (Debian: rt-tests): its row and the \
                                 targets for wake-up lateness p50 and p99 beside it are left out";

/// Wake-up lateness of one cyclictest thread at 1 kHz, in whole microseconds; `None` where it is
/// not installed. It leaves missed deadlines out of its count.
pub(super) fn run(
    time: Duration,
    priority: u8,
    cpu: Option<usize>,
) -> anyhow::Result<Option<Times>> {
    let mut command = Command::new("cyclictest");
    command.args(["--quiet", "--threads=1", "--interval=1000", "--mlockall"]);
    command.arg(format!("--priority={priority}"));
    command.arg(format!("--duration={}", time.as_secs().max(1)));
    command.arg(format!("--histogram={LONGEST_US}"));
    if let Some(cpu) = cpu {
        command.arg(format!("--affinity={cpu}"));
    }
    let output = match command.output() {
        Ok(output) => output,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(error).context("cyclictest cannot be started"),
    };
    let said = String::from_utf8_lossy(&output.stderr);
    ensure!(output.status.success(), "cyclictest failed: {}", said.trim_end());
    parse(&String::from_utf8_lossy(&output.stdout)).map(Some)
}

/// Lines of `lateness count`, both decimal, and the number of those beyond the histogram.
fn parse(text: &str) -> anyhow::Result<Times> {
    let mut times = Times::default();
    for line in text.lines() {
        if let Some(beyond) = line.strip_prefix("# Histogram Overflows:") {
            times.record_n(LONGEST_US * 1000, beyond.trim().parse().context("overflows")?);
        }
        let mut numbers = line.split_whitespace().map(str::parse::<u64>);
        if let (Some(Ok(us)), Some(Ok(count)), None) =
            (numbers.next(), numbers.next(), numbers.next())
        {
            times.record_n(us * 1000, count);
        }
    }
    ensure!(times.percentiles().count > 0, "cyclictest's histogram could not be read");
    Ok(times)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn its_histogram_is_read() {
        let text = "# /dev/cpu_dma_latency set to 0us\nT: 0 ( 8) P:80 I:1000 C: 999\n\
                    # Histogram\n000000 000000\n000016 000989\n000100 000010\n\
                    # Total: 000000999\n# Histogram Overflows: 00001\n";
        let p = parse(text).expect("a histogram").percentiles();
        assert_eq!(p.count, 1000);
        assert!((p.p50_ns as f64 / 16_000.0 - 1.0).abs() < 1e-3, "{p:?}");
        assert!(p.max_ns >= 100_000_000);
        assert!(parse("nothing").is_err());
    }
}
