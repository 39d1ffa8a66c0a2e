//! `planner gtsp`: solves a GTSPLIB file and says how well.

use std::io::{self, Write};
use std::path::PathBuf;
use std::time::{Duration, Instant};

use nullsweep_gtsp::tsplib::{TsplibError, read_gtsp, write_tour};
use nullsweep_gtsp::{
    Budget, Effort, Instance, SolveError, Tour, TourCost, lower_bound, solve, solve_transformed,
};
use serde::Serialize;

use crate::numbers::{positive, seconds};

/// Solve a generalized travelling-salesman instance (GTSPLIB or TSPLIB file).
#[derive(Clone, Debug, clap::Args)]
pub(super) struct GtspArgs {
    /// Instance file.
    file: PathBuf,
    /// Wall-clock limit in seconds; 10 where neither it nor --trials is given.
    #[arg(long, value_parser = limit)]
    seconds: Option<Duration>,
    /// Limit in trials: the result then depends on the file, the seed and this number alone.
    #[arg(long)]
    trials: Option<u64>,
    /// Seed of the search.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Threads; 0: one for every core.
    #[arg(long, default_value_t = 0)]
    threads: usize,
    /// Write the tour (node numbers of the file) to this TSPLIB tour file.
    #[arg(long)]
    tour: Option<PathBuf>,
    /// Write the result as JSON to this file, `-` for standard output.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Best known value: prints the gap to it.
    #[arg(long)]
    best: Option<f64>,
    /// Wall-clock limit in seconds of the search for a lower bound; 5 where it is not given, and a
    /// number of steps instead where --trials is the only limit. 0: no bound.
    #[arg(long, value_parser = seconds)]
    bound: Option<Duration>,
    /// How to solve it.
    #[arg(long, value_enum, default_value_t = Method::Search)]
    method: Method,
}

/// Ways to solve an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Method {
    /// The search on the generalized problem itself.
    Search,
    /// Behzad and Modarres' transformation and a Lin–Kernighan-style search of the ATSP.
    Transformed,
}

/// Why the subcommand failed.
#[derive(Debug, thiserror::Error)]
pub(super) enum GtspCliError {
    /// The instance cannot be read.
    #[error("cannot use {file}")]
    File {
        /// The file.
        file: PathBuf,
        /// What is wrong with it.
        source: TsplibError,
    },
    /// The search did not start.
    #[error(transparent)]
    Solve(#[from] SolveError),
    /// An output cannot be written.
    #[error("cannot write {file}")]
    Write {
        /// The file.
        file: PathBuf,
        /// The system's words.
        source: io::Error,
    },
}

#[derive(Serialize)]
struct Report<'a> {
    name: &'a str,
    clusters: usize,
    nodes: usize,
    value: f64,
    jumps: usize,
    seconds: f64,
    trials: u64,
    seed: u64,
    /// No tour costs less.
    lower_bound: Option<f64>,
    /// Excess over the best known value [%].
    gap_percent: Option<f64>,
    tour: Vec<usize>,
}

/// Runs the subcommand; the summary goes to `out`.
pub(super) fn run(args: &GtspArgs, out: &mut dyn Write) -> Result<(), GtspCliError> {
    let file = read_gtsp(&args.file)
        .map_err(|source| GtspCliError::File { file: args.file.clone(), source })?;
    let started = Instant::now();
    let (tour, cost, trials, proven) = match args.method {
        Method::Search => {
            let solution = solve(&file.instance, &budget(args), args.seed)?;
            (solution.tour, solution.cost, solution.trials, solution.proven)
        }
        Method::Transformed => {
            let (tour, cost, trials) = transformed(&file.instance, &budget(args), args.seed);
            (tour, cost, trials, false)
        }
    };
    let spent = started.elapsed();
    let bound = match effort(args) {
        _ if proven => Some(cost.total()),
        Some(effort) => lower_bound(&file.instance, &tour, effort),
        None => None,
    };
    let value = cost.total();
    let numbers = file.tour_numbers(&tour);
    let report = Report {
        name: &file.name,
        clusters: file.instance.clusters(),
        nodes: file.instance.nodes(),
        value,
        jumps: cost.jumps,
        seconds: spent.as_secs_f64(),
        trials,
        seed: args.seed,
        lower_bound: bound,
        gap_percent: args
            .best
            .map(|best| 100.0 * (value - best) / best.abs().max(f64::MIN_POSITIVE)),
        tour: numbers,
    };
    let written = |path: &PathBuf, result: io::Result<()>| {
        result.map_err(|source| GtspCliError::Write { file: path.clone(), source })
    };
    if let Some(path) = &args.tour {
        let save = || {
            let mut to = io::BufWriter::new(std::fs::File::create(path)?);
            write_tour(&file.name, &report.tour, value, &mut to)?;
            to.flush()
        };
        written(path, save())?;
    }
    let to_stdout = args.json.as_ref().is_some_and(|path| path.as_os_str() == "-");
    if let Some(path) = &args.json {
        let text = serde_json::to_string(&report).expect("plain numbers and strings");
        let result =
            if to_stdout { writeln!(out, "{text}") } else { std::fs::write(path, text + "\n") };
        written(path, result)?;
    }
    if !to_stdout {
        written(&PathBuf::from("standard output"), summary(&report, out))?;
    }
    Ok(())
}

fn summary(report: &Report<'_>, out: &mut dyn Write) -> io::Result<()> {
    write!(out, "{}: best {}", report.name, report.value)?;
    match report.lower_bound {
        Some(bound) if bound >= report.value => write!(out, ", no tour is shorter")?,
        Some(bound) => {
            let gap = 100.0 * (report.value - bound) / bound.abs().max(f64::MIN_POSITIVE);
            write!(out, ", no tour is shorter than {bound:.1} (gap {gap:.2} %)")?;
        }
        None => {}
    }
    write!(
        out,
        ", in {:.2} s, {} trials, {} clusters, {} nodes",
        report.seconds, report.trials, report.clusters, report.nodes
    )?;
    if report.jumps > 0 {
        write!(out, ", {} jumps", report.jumps)?;
    }
    if let Some(gap) = report.gap_percent {
        write!(out, ", {gap:.4} % above the best known")?;
    }
    writeln!(out)
}

/// A limit of time that lets a search begin.
fn limit(text: &str) -> Result<Duration, String> {
    positive(text)?;
    seconds(text)
}

fn budget(args: &GtspArgs) -> Budget {
    let time = match (args.seconds, args.trials) {
        (None, Some(_)) => None,
        (seconds, _) => Some(seconds.unwrap_or(Duration::from_secs(10))),
    };
    Budget { trials: args.trials, time, threads: args.threads, target: args.best }
}

/// `None`: no bound is asked for.
fn effort(args: &GtspArgs) -> Option<Effort> {
    match (args.bound, args.seconds, args.trials) {
        (None, None, Some(_)) => Some(Effort { steps: 5000, time: None }),
        (Some(Duration::ZERO), ..) => None,
        (time, ..) => {
            let time = Some(time.unwrap_or(Duration::from_secs(5)));
            Some(Effort { steps: u64::MAX, time })
        }
    }
}

fn transformed(instance: &Instance, budget: &Budget, seed: u64) -> (Tour, TourCost, u64) {
    let started = Instant::now();
    let made = std::cell::Cell::new(0);
    let stop = || {
        let end = budget.time.is_some_and(|t| started.elapsed() >= t);
        made.set(made.get() + u64::from(!end));
        end
    };
    let (tour, cost) = solve_transformed(instance, budget.trials.unwrap_or(u64::MAX), seed, &stop);
    (tour, cost, made.get())
}
