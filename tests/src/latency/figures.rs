//! What a run of the lab found, and how it is told.

use std::fs::{self, File};
use std::path::Path;
use std::{io, thread};

use anyhow::Context;
use comfy_table::{CellAlignment, Table, presets};
use nullsweep_ipc_types::HISTOGRAM_BUCKETS;
use serde::Serialize;

use super::args::Args;
use super::stats::{Percentiles, Times, of_buckets};
use super::{cyclictest, picture};
use crate::judge::Verdict;

/// One row of the table.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// What was timed.
    pub what: &'static str,
    /// Its percentiles.
    #[serde(flatten)]
    pub times: Percentiles,
}

/// What the changes from one plan to another did to the setpoints.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Swaps {
    /// Changes that the endpoint saw.
    pub count: usize,
    /// The largest step of a joint at one of them, as a share of v·T.
    pub step_ratio: f64,
    /// The largest change of a joint's velocity at one of them. \[rad/s\] or \[m/s\]
    pub velocity_step: f64,
}

impl Swaps {
    pub(super) fn add(&mut self, verdict: &Verdict) {
        for run in verdict.plans.iter().skip(1) {
            self.count += 1;
            self.step_ratio = self.step_ratio.max(run.join_step_ratio);
            self.velocity_step = self.velocity_step.max(run.join_velocity_step);
        }
    }
}

/// A figure beside its target.
#[derive(Clone, Debug, Serialize)]
pub struct Target {
    /// What is compared.
    pub what: &'static str,
    /// What was found, in `unit`.
    pub found: f64,
    /// What it should not exceed.
    pub target: f64,
    /// `×` for a ratio within the same run, else µs or a count.
    pub unit: &'static str,
}

impl Target {
    fn is_met(&self) -> bool {
        self.found <= self.target
    }
}

/// What the executor told of its armed cycles.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Armed {
    /// Cycles.
    pub cycles: u64,
    /// Calls into the system's heap.
    pub heap_calls: u64,
    /// Page faults.
    pub page_faults: u64,
}

impl Armed {
    /// Adds what an executor's last words tell.
    pub(super) fn add(&mut self, told: &str) {
        // "… armed for N cycles: H system-heap calls, F page faults; …"
        let Some((_, rest)) = told.rsplit_once("armed for ") else { return };
        let mut numbers = rest.split(|c: char| !c.is_ascii_digit()).filter(|n| !n.is_empty());
        let mut next = || numbers.next().and_then(|n| n.parse::<u64>().ok()).unwrap_or(0);
        self.cycles += next();
        self.heap_calls += next();
        self.page_faults += next();
    }
}

/// Everything that was measured.
#[derive(Clone, Debug, Serialize)]
pub struct Figures {
    /// Kernel release.
    pub kernel: String,
    /// Whether the kernel calls itself real-time.
    pub realtime_kernel: bool,
    /// Logical processors.
    pub processors: usize,
    /// Load average of the last minute when the run began.
    pub load: String,
    /// Whether stress-ng ran.
    pub stressed: bool,
    /// Length of the executor's part. \[s\]
    pub seconds: f64,
    /// Seed of the moments of publishing.
    pub seed: u64,
    /// Knots of each published plan.
    pub knots: u32,
    /// The distributions.
    pub rows: Vec<Row>,
    /// Figures beside their targets.
    pub targets: Vec<Target>,
    /// What was left out, and why.
    pub left_out: Option<&'static str>,
    /// Deadlines that the executor missed.
    pub missed_cycles: u64,
    /// The executor's armed cycles.
    pub armed: Armed,
    /// Changes of plan.
    pub swaps: Swaps,
    /// Violations that the endpoint's judge found.
    pub violations: u64,
    /// Plans that were published, and those that were accepted.
    pub plans: (usize, usize),
}

/// Sums over all rounds.
#[derive(Default)]
pub(super) struct Sums {
    pub(super) sleep: Times,
    pub(super) cyclictest: Option<Times>,
    pub(super) bare_compute: Times,
    pub(super) bare_one_way: Times,
    pub(super) wake: [u32; HISTOGRAM_BUCKETS],
    pub(super) compute: [u32; HISTOGRAM_BUCKETS],
    pub(super) round_trip: [u32; HISTOGRAM_BUCKETS],
    pub(super) made_late: Times,
    pub(super) transport: Times,
    pub(super) inter_arrival: Times,
    pub(super) publication: Times,
    pub(super) admission: Times,
    pub(super) after_admission: Times,
    pub(super) swap: Times,
    pub(super) command: Times,
    pub(super) missed: u64,
    pub(super) armed: Armed,
    pub(super) swaps: Swaps,
    pub(super) violations: u64,
    pub(super) published: usize,
    pub(super) accepted: usize,
}

impl Sums {
    /// The distributions by name. Yardsticks come before what is measured against them.
    fn rows(&self) -> Vec<Row> {
        let row = |what, times: &Times| Row { what, times: times.percentiles() };
        let own = |what, buckets| Row { what, times: of_buckets(buckets) };
        let yardstick = self.cyclictest.iter().map(|t| row("cyclictest: wake-up lateness", t));
        yardstick
            .chain([
                row("bare sleep loop: wake-up lateness", &self.sleep),
                own("executor: wake-up lateness", &self.wake),
                row("bare iceoryx2 loop: compute time", &self.bare_compute),
                own("executor: compute time", &self.compute),
                row("executor: setpoint sent after due", &self.made_late),
                row("bare iceoryx2 loop: one way", &self.bare_one_way),
                row("setpoint: sent to endpoint", &self.transport),
                row("setpoint: inter-arrival", &self.inter_arrival),
                own("setpoint to state, round trip", &self.round_trip),
                row("plan: the publisher's own call", &self.publication),
                row("plan: publish to admission", &self.admission),
                row("plan: admission to first setpoint", &self.after_admission),
                row("plan: publish to first setpoint", &self.swap),
                row("operator's command to its answer", &self.command),
            ])
            .collect()
    }

    fn targets(&self) -> Vec<Target> {
        let us = |ns: u64| ns as f64 * 1e-3;
        let ratio = |a: u64, b: u64| a as f64 / b.max(1) as f64;
        let target = |what, found, target, unit| Target { what, found, target, unit };
        let (wake, compute) = (of_buckets(&self.wake), of_buckets(&self.compute));
        let (sent, bare) = (self.transport.percentiles(), self.bare_one_way.percentiles());
        let after = self.after_admission.percentiles();
        let mut targets = Vec::new();
        if let Some(yardstick) = self.cyclictest.as_ref().map(Times::percentiles) {
            let p50 = ratio(wake.p50_ns, yardstick.p50_ns);
            let p99 = ratio(wake.p99_ns, yardstick.p99_ns);
            targets.push(target("wake-up lateness p50 to cyclictest's", p50, 0.2, "×"));
            targets.push(target("wake-up lateness p99 to cyclictest's", p99, 1.0, "×"));
        }
        let transport = ratio(sent.p50_ns, bare.p50_ns);
        let swap = self.swap.percentiles();
        targets.extend([
            target("compute time p99", us(compute.p99_ns), 5.0, "µs"),
            target("setpoint transport p50 to the bare loop's", transport, 1.2, "×"),
            target("plan: publish to first setpoint p99", us(swap.p99_ns), 10_000.0, "µs"),
            target("plan: after admission p99", us(after.p99_ns), 1000.0 + us(sent.p99_ns), "µs"),
            target("command to answer p99", us(self.command.percentiles().p99_ns), 1e4, "µs"),
            target("system-heap calls when armed", self.armed.heap_calls as f64, 0.0, ""),
            target("page faults when armed", self.armed.page_faults as f64, 0.0, ""),
        ]);
        targets
    }

    pub(super) fn figures(&self, args: &Args, load: String) -> Figures {
        Figures {
            kernel: read("/proc/sys/kernel/osrelease"),
            realtime_kernel: read("/sys/kernel/realtime") == "1",
            processors: thread::available_parallelism().map_or(0, usize::from),
            load,
            stressed: args.load,
            seconds: args.seconds,
            seed: args.seed,
            knots: args.knots,
            rows: self.rows(),
            targets: self.targets(),
            left_out: self.cyclictest.is_none().then_some(cyclictest::ABSENT),
            missed_cycles: self.missed,
            armed: self.armed,
            swaps: self.swaps,
            violations: self.violations,
            plans: (self.published, self.accepted),
        }
    }

    /// The tails as a page.
    pub(super) fn page(&self, figures: &Figures) -> String {
        let mut curves = vec![
            ("executor: wake-up lateness", picture::of_histogram(&self.wake)),
            ("executor: compute time", picture::of_histogram(&self.compute)),
            ("bare sleep loop: wake-up lateness", picture::of_times(&self.sleep)),
            ("bare iceoryx2 loop: compute time", picture::of_times(&self.bare_compute)),
            ("setpoint: sent to endpoint", picture::of_times(&self.transport)),
            ("bare iceoryx2 loop: one way", picture::of_times(&self.bare_one_way)),
            ("plan: publish to first setpoint", picture::of_times(&self.swap)),
            ("operator's command to its answer", picture::of_times(&self.command)),
        ];
        let yardstick = self.cyclictest.as_ref();
        curves.extend(yardstick.map(|t| ("cyclictest: wake-up lateness", picture::of_times(t))));
        picture::page(&format!("Latencies, kernel {}", figures.kernel), curves)
    }
}

impl Figures {
    /// Prints the table, and writes the figures as JSON to a file, or to standard output for `-`.
    pub(super) fn tell(&self, json: Option<&Path>) -> anyhow::Result<()> {
        match json {
            Some(path) if path.as_os_str() == "-" => {
                serde_json::to_writer_pretty(io::stdout().lock(), self)?;
                println!();
                return Ok(());
            }
            Some(path) => {
                let file = File::create(path)
                    .with_context(|| format!("cannot write the figures to {}", path.display()))?;
                serde_json::to_writer_pretty(file, self)?;
            }
            None => {}
        }
        println!("{}", self.table());
        Ok(())
    }

    fn table(&self) -> String {
        let mut table = Table::new();
        table.load_style(presets::UTF8_BORDERS_ONLY);
        table.set_header(std::iter::once("µs").chain(Percentiles::HEADS));
        for row in &self.rows {
            table.add_row(std::iter::once(row.what.to_owned()).chain(row.times.cells()));
        }
        for column in table.column_iter_mut().skip(1) {
            column.set_cell_alignment(CellAlignment::Right);
        }
        let mut targets = Table::new();
        targets.load_style(presets::UTF8_BORDERS_ONLY);
        targets.set_header(["target", "found", "at most", ""]);
        for t in &self.targets {
            let told = |v: f64| format!("{v:.2} {}", t.unit);
            let verdict = if t.is_met() { "met" } else { "NOT met" };
            targets.add_row([t.what.into(), told(t.found), told(t.target), verdict.into()]);
        }
        for column in targets.column_iter_mut().skip(1).take(2) {
            column.set_cell_alignment(CellAlignment::Right);
        }
        let left_out = self.left_out.map(|why| format!("{why}\n")).unwrap_or_default();
        let kind = if self.realtime_kernel { "a real-time kernel" } else { "no real-time kernel" };
        let stress = if self.stressed { ", with stress-ng" } else { "" };
        format!(
            "{table}\n{targets}\n{left_out}kernel {} ({kind}), {} processors, load {} at the start{stress}, {} s\n\
             executor histograms are told by the upper bound of their bucket; {} deadlines missed; \
             armed for {} cycles\n\
             {} plans of {} knots at random moments, {} accepted; {} violations at the endpoint\n\
             {} changes of plan: largest step {:.3} of v·T, largest change of velocity {:.3} rad/s",
            self.kernel,
            self.processors,
            self.load,
            self.seconds,
            self.missed_cycles,
            self.armed.cycles,
            self.plans.0,
            self.knots,
            self.plans.1,
            self.violations,
            self.swaps.count,
            self.swaps.step_ratio,
            self.swaps.velocity_step,
        )
    }
}

/// Load average of the last minute.
pub(super) fn loadavg() -> String {
    read("/proc/loadavg").split(' ').next().unwrap_or_default().to_owned()
}

/// A small file of the kernel's, without its line end; empty where it is not there.
fn read(path: &str) -> String {
    fs::read_to_string(path).map(|text| text.trim_end().to_owned()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[test]
    fn the_executors_last_words_are_read() {
        let mut armed = Armed::default();
        armed.add("12:00 INFO 99 cycles, 1 deadlines missed; armed for 80 cycles: 2 system-heap calls, 3 page faults; 7 blocks");
        armed.add("nothing of that kind");
        assert_eq!((armed.cycles, armed.heap_calls, armed.page_faults), (80, 2, 3));
    }

    /// Two targets need cyclictest: without it a line says that they are missing.
    #[test]
    fn a_missing_yardstick_is_told() {
        let args = Args::parse_from(["latency"]);
        let mut sums = Sums::default();
        let with = "cyclictest's";
        let told = sums.figures(&args, String::new()).table();
        assert!(told.contains(cyclictest::ABSENT) && !told.contains(with), "{told}");
        sums.cyclictest = Some(Times::default());
        let told = sums.figures(&args, String::new()).table();
        assert!(!told.contains("not installed") && told.contains(with), "{told}");
    }

    #[test]
    fn what_is_above_its_target_is_not_met() {
        let mut sums = Sums::default();
        sums.compute[20] = 1;
        sums.armed.page_faults = 1;
        let met: Vec<_> = sums.targets().iter().filter(|t| !t.is_met()).map(|t| t.what).collect();
        assert_eq!(met, ["compute time p99", "page faults when armed"]);
    }
}
