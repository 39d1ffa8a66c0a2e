//! The latency lab's command line.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::Parser;

/// Measures the executor's latencies beside bare yardsticks, in alternating rounds.
#[derive(Debug, Parser)]
#[command(name = "latency", version)]
pub(super) struct Args {
    /// Seconds for the executor, in all rounds together
    #[arg(long, default_value_t = 30.0, value_name = "S")]
    pub(super) seconds: f64,
    /// Alternations of yardsticks and executor
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) rounds: u32,
    /// Knots of each plan that is published
    #[arg(long, default_value_t = 2000, value_parser = clap::value_parser!(u32).range(3..=16384))]
    pub(super) knots: u32,
    /// SCHED_FIFO priority of executor and yardsticks; 0 for the default scheduler
    #[arg(long, default_value_t = 80, value_parser = clap::value_parser!(u8).range(0..=99))]
    pub(super) priority: u8,
    /// Seed of the moments at which plans are published
    #[arg(long, default_value_t = 1)]
    pub(super) seed: u64,
    /// Write every figure as JSON, to a file or to standard output with -
    #[arg(long, value_name = "FILE|-")]
    pub(super) json: Option<PathBuf>,
    /// Pin executor, bare loop and cyclictest to this processor
    #[arg(long, value_name = "N")]
    pub(super) cpu: Option<usize>,
    /// Write the distributions as a picture, a page that needs no network
    #[arg(long, value_name = "FILE")]
    pub(super) report: Option<PathBuf>,
    /// Have stress-ng load the machine meanwhile
    #[arg(long)]
    pub(super) load: bool,
    /// Options for the executor, after `--`
    #[arg(last = true)]
    pub(super) executor: Vec<OsString>,
}
